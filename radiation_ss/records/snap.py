"""Compiled loops of the derivative smoother; numba is loaded only with this module."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def filter_snap(t: np.ndarray, y: np.ndarray, q: float, r: float,
                mean: np.ndarray, P: np.ndarray) -> float:
    """Run a Kalman filter on (d/dt)^4 x = white noise of intensity q, x measured with variance r; NaN is missing.

    Products are written out: linear algebra calls would take ten seconds to compile.

    Parameters
    ----------
    mean, P : ndarray, shapes (nt, 4), (nt, 4, 4)
        Filled with the filtered displacement, velocity, acceleration and jerk, and their covariance.

    Returns
    -------
    log_likelihood : float
    """
    F, Q = np.zeros((4, 4)), np.zeros((4, 4))
    total = 0.0
    for k in range(t.size):
        x, p = mean[k], P[k]
        if k == 0:
            for i in range(4):
                p[i, i] = 100.0
        else:
            transition(t[k] - t[k - 1], q, F, Q)
            for i in range(4):
                x[i] = 0.0
                for j in range(4):
                    x[i] += F[i, j] * mean[k - 1, j]
                    p[i, j] = Q[i, j]
                    for m in range(i, 4):  # F is upper triangular
                        for n in range(j, 4):
                            p[i, j] += F[i, m] * P[k - 1, m, n] * F[j, n]
        if not np.isnan(y[k]):
            s = p[0, 0] + r
            e = y[k] - x[0]
            g0, g1, g2, g3 = p[0, 0] / s, p[1, 0] / s, p[2, 0] / s, p[3, 0] / s
            gain = (g0, g1, g2, g3)
            for i in range(4):
                x[i] += gain[i] * e
                for j in range(4):
                    p[i, j] -= gain[i] * gain[j] * s
            total -= 0.5 * (e * e / s + np.log(2.0 * np.pi * s))
    return total


@njit(cache=True)
def transition(d: float, q: float, F: np.ndarray, Q: np.ndarray) -> None:
    """Fill the transition over d and the noise of a chain of four integrators driven by white noise of intensity q."""
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    for i in range(4):
        for j in range(4):
            if j >= i:
                F[i, j] = d ** (j - i) / factorial[j - i]
            m, n = 3 - i, 3 - j
            Q[i, j] = q * d ** (m + n + 1) / (factorial[m] * factorial[n] * (m + n + 1))
