"""One Gaussian state, one predict, one update, one smoothing step: the linear filter that the package shares.

The readable form; `filter/kernels.py` has the same two steps compiled, in place, for long records.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray


class Gaussian(NamedTuple):
    """A normal state; several columns of means may share one covariance."""

    mean: FloatArray  # (size,) or (size, columns)
    cov: FloatArray   # (size, size)


def predict(state: Gaussian, F: FloatArray, Q: FloatArray) -> Gaussian:
    """Return the state after x = F x + noise of covariance Q."""
    return Gaussian(F @ state.mean, F @ state.cov @ F.T + Q)


def update(state: Gaussian, H: FloatArray, y: FloatArray, R: FloatArray) -> tuple[Gaussian, FloatArray, FloatArray]:
    """Return the state given y = H x + noise of covariance R, the innovation and its covariance.

    Parameters
    ----------
    H : ndarray, shape (p, size)
    y : ndarray, shape (p,)
        NaN where nothing was measured: the row is left out of everything that is returned.
    R : ndarray, shape (p, p)
    """
    there = np.isfinite(y)
    H, R = H[there], R[np.ix_(there, there)]
    innovation = (y[there] - (H @ state.mean).T).T
    S = H @ state.cov @ H.T + R
    gain = np.linalg.solve(S, H @ state.cov).T
    cov = state.cov - gain @ S @ gain.T
    return Gaussian(state.mean + gain @ innovation, 0.5 * (cov + cov.T)), innovation, S


def smooth(filtered: Gaussian, predicted: Gaussian, ahead: Gaussian, F: FloatArray) -> Gaussian:
    """Return the state given all samples, from that of the next sample (Rauch, Tung and Striebel 1965).

    Parameters
    ----------
    filtered : Gaussian
        Given the samples up to this one.
    predicted, ahead : Gaussian
        The next one's, given the samples up to this one and given all.
    F : ndarray, shape (size, size)
        Transition from this one to the next.
    """
    # Scaled to a correlation; it can be singular to rounding where states have no noise of their own.
    d = np.sqrt(np.diag(predicted.cov))
    right = (F @ filtered.cov) / d[:, None]
    gain = (np.linalg.lstsq(predicted.cov / np.outer(d, d), right, rcond=1e-14)[0] / d[:, None]).T
    return Gaussian(filtered.mean + gain @ (ahead.mean - predicted.mean),
                    filtered.cov + gain @ (ahead.cov - predicted.cov) @ gain.T)
