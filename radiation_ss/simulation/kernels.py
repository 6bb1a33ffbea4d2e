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
