"""Compiled inner loops of the simulation; numba is loaded only with this module."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def run_modes(real: np.ndarray, imag: np.ndarray, w: np.ndarray, z: np.ndarray) -> None:
    """Run z = pole z + w_k for every mode, in place: w becomes the states after each step, z the last one.

    Two modes go side by side, since a single recursion waits for its own result at each step.

    Parameters
    ----------
    real, imag : ndarray, shape (modes,)
        The poles of the step; an even number of them.
    w : ndarray, shape (2 modes, nt)
        Drive: real parts, then imaginary parts.
    z : ndarray, shape (2 modes,)
        State before the first step.
    """
    modes = real.size
    for m in range(0, modes, 2):
        n = m + 1
        a, b, x, y = real[m], imag[m], z[m], z[modes + m]
        c, d, p, q = real[n], imag[n], z[n], z[modes + n]
        for k in range(w.shape[1]):
            x, y = a * x - b * y + w[m, k], a * y + b * x + w[modes + m, k]
            p, q = c * p - d * q + w[n, k], c * q + d * p + w[modes + n, k]
            w[m, k], w[modes + m, k], w[n, k], w[modes + n, k] = x, y, p, q
        z[m], z[modes + m], z[n], z[modes + n] = x, y, p, q


@njit(cache=True)
def run_single(real: np.ndarray, imag: np.ndarray, drive: np.ndarray, out: np.ndarray, u: np.ndarray, y: np.ndarray,
               z: np.ndarray) -> None:
    """Run all modes from one input to one output, adding to y, without arrays of drive and state in between.

    Parameters
    ----------
    real, imag : ndarray, shape (modes,)
        The poles of the step; an even number of them.
    drive : ndarray, shape (2 modes, 2)
        Share of u_k and of u_(k+1): real parts, then imaginary parts.
    out : ndarray, shape (2 modes,)
    u, y : ndarray, shape (nt,)
        Input, and output: added to from the second sample on.
    z : ndarray, shape (2 modes,)
        State at the first sample; at the last one on return.
    """
    modes = real.size
    for m in range(0, modes, 2):
        n, i, j = m + 1, modes + m, modes + m + 1
        a, b, p, q = real[m], imag[m], z[m], z[i]
        c, d, r, s = real[n], imag[n], z[n], z[j]
        for k in range(u.size - 1):
            now, after = u[k], u[k + 1]
            p, q = (a * p - b * q + (drive[m, 0] * now + drive[m, 1] * after),
                    a * q + b * p + (drive[i, 0] * now + drive[i, 1] * after))
            r, s = (c * r - d * s + (drive[n, 0] * now + drive[n, 1] * after),
                    c * s + d * r + (drive[j, 0] * now + drive[j, 1] * after))
            y[k + 1] += (out[m] * p + out[i] * q) + (out[n] * r + out[j] * s)
        z[m], z[i], z[n], z[j] = p, q, r, s


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
