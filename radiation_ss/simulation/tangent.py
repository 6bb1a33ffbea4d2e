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
        Derivative by the parameters; its memory is used for the rates' whole derivatives.
    start : ndarray, shape (ns, nc)
    """
    steps, nr, ns, nc = jacobian.shape[0], rows.size, start.shape[0], start.shape[1]
    result = np.empty((steps + 1, ns, nc))
    result[0] = start
    whole = np.dot(half, half)
    thin, thin_whole = half[:, rows].copy(), whole[:, rows].copy()
    middle, stage = np.empty((ns, nc)), np.empty((ns, nc))
    both = np.empty((nr, nc))
    for k in range(steps):
        d, end, rate = result[k], result[k + 1], push[k]
        middle[:] = 0.0
        end[:] = 0.0
        add_product(half, d, 1.0, middle)
        add_product(whole, d, 1.0, end)
        add_product(jacobian[k, 0], d, 1.0, rate[0])
        stage[:] = middle
        add_product(thin, rate[0], 0.5 * h, stage)
        add_product(jacobian[k, 1], stage, 1.0, rate[1])
        stage[:] = middle
        for j in range(nr):
            for c in range(nc):
                stage[rows[j], c] += 0.5 * h * rate[1, j, c]
        add_product(jacobian[k, 2], stage, 1.0, rate[2])
        stage[:] = end
        add_product(thin, rate[2], h, stage)
        add_product(jacobian[k, 3], stage, 1.0, rate[3])
        for j in range(nr):
            for c in range(nc):
                both[j, c] = rate[1, j, c] + rate[2, j, c]
        add_product(thin_whole, rate[0], h / 6.0, end)
        add_product(thin, both, h / 3.0, end)
        for j in range(nr):
            for c in range(nc):
                end[rows[j], c] += h / 6.0 * rate[3, j, c]
    return result


@njit(cache=True)
def add_product(a: FloatArray, b: FloatArray, factor: float, c: FloatArray) -> None:
    """Add factor a b to c; loops, as calls of linear algebra cost more than such small products."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            weight = factor * a[i, j]
            if weight != 0.0:
                for k in range(b.shape[1]):
                    c[i, k] += weight * b[j, k]
