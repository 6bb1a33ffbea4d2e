"""Ensembles: draws with exact moments, stochastic and square-root analysis, inflation. Members are columns."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray


def exact_draws(rng: np.random.Generator, size: int, members: int) -> FloatArray:
    """Return standard normal draws, shape (size, members), with sample mean 0 and, where possible, covariance I.

    With more members than variables the sample covariance is made the identity exactly, so that conditioning the
    ensemble equals conditioning the Gaussian; with fewer, each variable gets unit variance.
    """
    draws = rng.standard_normal((size, members))
    draws -= draws.mean(axis=1, keepdims=True)
    if members > size + 1:
        factor = np.linalg.cholesky(draws @ draws.T / (members - 1))
        return np.linalg.solve(factor, draws)
    return draws / draws.std(axis=1, ddof=1, keepdims=True)


def stochastic_update(E: FloatArray, Y: FloatArray, y: FloatArray, W: FloatArray) -> FloatArray:
    """Return the analysis with perturbed observations (31)-(34).

    Parameters
    ----------
    E : ndarray, shape (d, members)
    Y : ndarray, shape (p, members)
        Predicted observations.
    y : ndarray, shape (p,)
    W : ndarray, shape (p, members)
        Perturbations of the observations; their sample covariance is R (33).
    """
    dE, dY, dW = (part - part.mean(axis=1, keepdims=True) for part in (E, Y, W))
    gain = np.linalg.solve(dY @ dY.T + dW @ dW.T, dY @ dE.T).T
    return E + gain @ (y[:, None] + W - Y)


def square_root_update(E: FloatArray, Y: FloatArray, y: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the deterministic analysis, one observation after the other (serial EnSRF, Whitaker and Hamill 2002).

    Parameters
    ----------
    E : ndarray, shape (d, members)
    Y : ndarray, shape (p, members)
        Predicted observations.
    y, variance : ndarray, shape (p,)
        Observations and their (uncorrelated) error variances.
    """
    joint, size = np.vstack([E, Y]), E.shape[0]
    for i in range(y.size):
        joint = scalar_update(joint, joint[size + i], y[i], variance[i])
    return joint[:size]


def scalar_update(E: FloatArray, h: FloatArray, y: float, variance: float) -> FloatArray:
    """Return E after one scalar observation y of the predicted values h, by the square root of the scalar problem."""
    members = E.shape[1]
    mean, centre = h.mean(), E.mean(axis=1, keepdims=True)
    dh, dE = h - mean, E - centre
    total = dh @ dh / (members - 1) + variance
    gain = (dE @ dh / (members - 1) / total)[:, None]
    shrink = 1.0 / (1.0 + np.sqrt(variance / total))
    return centre + gain * (y - mean) + dE - shrink * gain * dh


def inflate(E: FloatArray, factor: float) -> FloatArray:
    """Return the ensemble with its spread about the mean multiplied by a factor."""
    mean = E.mean(axis=1, keepdims=True)
    return mean + factor * (E - mean)
