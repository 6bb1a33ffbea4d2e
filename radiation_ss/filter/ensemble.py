"""Ensembles: draws with exact moments, the analysis of an ensemble Kalman filter. Members are columns."""

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


def analysis(E: FloatArray, Y: FloatArray, y: FloatArray, std: FloatArray, draws: FloatArray | None) -> FloatArray:
    """Return the ensemble given observations (31)-(34).

    Parameters
    ----------
    E : ndarray, shape (d, members)
    Y : ndarray, shape (p, members)
        Predicted observations.
    y, std : ndarray, shape (p,)
        Observations and the standard deviations of their (uncorrelated) errors.
    draws : ndarray, shape (p, members), optional
        Standard normal draws that perturb the observations (33); without them the deterministic analysis, one
        observation after the other (serial EnSRF, Whitaker and Hamill 2002).
    """
    if draws is None:
        joint, size = np.vstack([E, Y]), E.shape[0]
        for i in range(y.size):
            members = np.column_stack([joint, joint.mean(axis=1)])
            joint = scalar_update(members, members[size + i], y[i], std[i] ** 2)[:, :-1]
        return joint[:size]
    W = std[:, None] * draws
    dE, dY, dW = (part - part.mean(axis=1, keepdims=True) for part in (E, Y, W))
    gain = np.linalg.solve(dY @ dY.T + dW @ dW.T, dY @ dE.T).T
    return E + gain @ (y[:, None] + W - Y)


def scalar_update(E: FloatArray, h: FloatArray, y: float, variance: float) -> FloatArray:
    """Return E after one scalar observation y of the predicted values h, by the square root of the scalar problem.

    The last column is no member: it is the control, which moves by the gain times its own innovation, and whose
    innovation moves the members' mean.
    """
    members = E[:, :-1]
    dh = h[:-1] - h[:-1].mean()
    total = dh @ dh / (dh.size - 1) + variance
    gain = (members - members.mean(axis=1, keepdims=True)) @ dh / (dh.size - 1) / total
    shift, shrink = gain * (y - h[-1]), 1.0 / (1.0 + np.sqrt(variance / total))
    return np.column_stack([members + shift[:, None] - np.outer(shrink * gain, dh), E[:, -1] + shift])
