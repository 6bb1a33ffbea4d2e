"""Innovations of a Kalman filter for a sampled linear system, compiled; frozen gain once it has settled."""

from __future__ import annotations

import numpy as np
from numba import njit

from radiation_ss.arrays import FloatArray


@njit(cache=True)
def innovations(Ad: FloatArray, drive: FloatArray, H: FloatArray, direct: FloatArray, R: FloatArray, Q: FloatArray,
                x0: FloatArray, P0: FloatArray, y: FloatArray, tolerance: float,
                ) -> tuple[FloatArray, FloatArray]:
    """Return innovations e and their variances s, both (nt, p); a missing sample (NaN) has e = 0, s = 1.

    Scalar measurement updates one after the other (R diagonal), so any subset of channels may be missing. After a
    stretch with all channels present over which the variances s change by less than `tolerance` (relative), the gains
    are frozen until a sample is missing.

    Parameters
    ----------
    Ad, Q, P0 : ndarray, shape (N, N)
        Transition, process noise covariance, initial covariance.
    drive : ndarray, shape (nt, N)
        Known input's share of the next state, x_{k+1} = Ad x_k + drive_k + noise.
    H : ndarray, shape (p, N)
    direct : ndarray, shape (nt, p)
        Known input's share of the outputs.
    R : ndarray, shape (p,)
        Measurement variances.
    x0 : ndarray, shape (N,)
    y : ndarray, shape (nt, p)
    tolerance : float
    """
    nt, p = y.shape
    N = Ad.shape[0]
    e, s = np.zeros((nt, p)), np.ones((nt, p))
    x, P = x0.copy(), P0.copy()
    gains, sizes = np.zeros((p, N)), np.zeros(p)
    settled, last = 0, np.zeros(p)
    for k in range(nt):
        complete = True
        for i in range(p):
            if np.isnan(y[k, i]):
                complete = False
        frozen = settled >= 10 and complete
        if not complete:
            settled = 0
        for i in range(p):
            if np.isnan(y[k, i]):
                continue
            if not frozen:
                column = P @ H[i]
                sizes[i] = H[i] @ column + R[i]
                gains[i] = column / sizes[i]
                P -= np.outer(gains[i], column)
            e[k, i] = y[k, i] - direct[k, i] - H[i] @ x
            s[k, i] = sizes[i]
            x += gains[i] * e[k, i]
        x = Ad @ x + drive[k]
        if not frozen:
            P = Ad @ P @ Ad.T + Q
            P = 0.5 * (P + P.T)
            if complete:
                change = np.max(np.abs(sizes - last) / sizes)
                settled = settled + 1 if change < tolerance else 0
                last[:] = sizes
    return e, s


def gaussian_log_likelihood(e: FloatArray, s: FloatArray) -> float:
    """Return the log likelihood of innovations with variances s, up to the constant."""
    return -0.5 * float(np.sum(np.log(s) + e * e / s))
