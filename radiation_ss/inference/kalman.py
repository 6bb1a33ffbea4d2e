"""One Gaussian state, one predict, one smoothing step: the linear filter that the package shares.

`innovations` is the same filter compiled, one channel after the other; `filter/kernels.py` has its steps in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit


class Gaussian(NamedTuple):
    """A normal state; several columns of means may share one covariance."""

    mean: FloatArray  # (size,) or (size, columns)
    cov: FloatArray   # (size, size)


def predict(state: Gaussian, F: FloatArray, Q: FloatArray) -> Gaussian:
    """Return the state after x = F x + noise of covariance Q."""
    return Gaussian(F @ state.mean, F @ state.cov @ F.T + Q)


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


@jit
def innovations(F: FloatArray, Q: FloatArray, H: FloatArray, R: FloatArray, P0: FloatArray,
                drive: FloatArray, y: FloatArray, settled_at: float) -> tuple[FloatArray, FloatArray]:
    """Return innovations e and their variances s, both (nt, p); a missing sample (NaN) has e = 0, s = 1.

    One channel after the other, so that any of them may be missing. After ten samples with all channels over which
    the variances change by less than `settled_at` (relative), the gains are frozen until a sample is missing.

    Parameters
    ----------
    F, Q, P0 : ndarray, shape (N, N)
        Transition, noise covariance, covariance at the start about a mean of zero.
    H : ndarray, shape (p, N)
    R : ndarray, shape (p,)
        Measurement variances.
    drive : ndarray, shape (nt, N)
        Known input's share of the next state, x_{k+1} = F x_k + drive_k + noise.
    y : ndarray, shape (nt, p)
        Less what the known input adds to the outputs directly.
    """
    nt, p = y.shape
    e, s = np.zeros((nt, p)), np.ones((nt, p))
    x, P = np.zeros(F.shape[0]), P0.copy()
    gains, sizes = np.zeros((p, F.shape[0])), np.zeros(p)
    settled, last = 0, np.zeros(p)
    for k in range(nt):
        complete = not np.isnan(y[k]).any()
        settled = settled if complete else 0
        frozen = settled >= 10
        for i in range(p):
            if np.isnan(y[k, i]):
                continue
            if not frozen:
                column = P @ H[i]
                sizes[i] = H[i] @ column + R[i]
                gains[i] = column / sizes[i]
                P -= np.outer(gains[i], column)
            e[k, i] = y[k, i] - H[i] @ x
            s[k, i] = sizes[i]
            x += gains[i] * e[k, i]
        x = F @ x + drive[k]
        if not frozen:
            P = F @ P @ F.T + Q
            P = 0.5 * (P + P.T)
            if complete:
                settled = settled + 1 if np.max(np.abs(sizes - last) / sizes) < settled_at else 0
                last[:] = sizes
    return e, s


def log_likelihood(e: FloatArray, s: FloatArray) -> float:
    """Return the log likelihood of innovations with variances s, up to the constant."""
    return -0.5 * float(np.sum(np.log(s) + e * e / s))
