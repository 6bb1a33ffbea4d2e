"""Vectorised evaluation of small state-space and rational models."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from radiation_ss.arrays import ComplexArray, FloatArray


def frequency_response(a: FloatArray, b: FloatArray, c: FloatArray, omega: ArrayLike) -> ComplexArray:
    """Return c (i w I - a)^-1 b for all frequencies at once, shape (nw, n_out, n_in).

    Parameters
    ----------
    a, b, c : ndarray, shapes (N, N), (N, n_in), (n_out, N)
    omega : array_like, shape (nw,)
        Circular frequencies [rad/s].
    """
    w = np.atleast_1d(np.asarray(omega, dtype=float))
    if a.shape[0] == 0:
        return np.zeros((w.size, c.shape[0], b.shape[1]), dtype=complex)
    resolvent = 1j * w[:, None, None] * np.eye(a.shape[0]) - a
    return c @ np.linalg.solve(resolvent, np.broadcast_to(b.astype(complex), (w.size, *b.shape)))


def impulse_response(a: FloatArray, b: FloatArray, c: FloatArray, t: ArrayLike) -> FloatArray:
    """Return c exp(a t) b, shape (nt, n_out, n_in), for times t >= 0 [s]."""
    times = np.atleast_1d(np.asarray(t, dtype=float))
    if a.shape[0] == 0:
        return np.zeros((times.size, c.shape[0], b.shape[1]))
    return c @ expm(a * times[:, None, None]) @ b
