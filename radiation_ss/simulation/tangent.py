"""Derivatives of a Lawson-Runge-Kutta path: the chain rule through the four stages, compiled once."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray


@njit(cache=True)
def propagate(half: FloatArray, rows: NDArray[np.int64], h: float, jacobian: FloatArray, push: FloatArray,
              start: FloatArray) -> FloatArray:
    """Return the derivatives of the states along a path, shape (nt, ns, nc).

    Parameters
    ----------
    half : ndarray, shape (ns, ns)
        exp(A h / 2) of the linear part.
    rows : ndarray of int, shape (nr,)
        States whose rate is not linear: velocities and the effects' own.
    h : float
    jacobian : ndarray, shape (steps, 4, nr, ns)
        Derivative of their rates by the state at each stage.
    push : ndarray, shape (steps, 4, nr, nc)
        Derivative by the parameters.
    start : ndarray, shape (ns, nc)
    """
    steps, nr, ns, nc = jacobian.shape[0], rows.size, start.shape[0], start.shape[1]
    result = np.empty((steps + 1, ns, nc))
    result[0] = start
    thin = np.empty((ns, nr))
    for j in range(nr):
        thin[:, j] = half[:, rows[j]]
    thin_whole = half @ thin
    for k in range(steps):
        d = result[k]
        k1 = jacobian[k, 0] @ d + push[k, 0]
        middle = half @ d
        stage = middle + 0.5 * h * (thin @ k1)
        k2 = jacobian[k, 1] @ stage + push[k, 1]
        stage = middle.copy()
        for j in range(nr):
            stage[rows[j]] += 0.5 * h * k2[j]
        k3 = jacobian[k, 2] @ stage + push[k, 2]
        end = half @ middle
        k4 = jacobian[k, 3] @ (end + h * (thin @ k3)) + push[k, 3]
        end += h / 6.0 * (thin_whole @ k1 + 2.0 * (thin @ (k2 + k3)))
        for j in range(nr):
            end[rows[j]] += h / 6.0 * k4[j]
        result[k + 1] = end
    return result
