"""Derivatives of a Lawson-Runge-Kutta path: the chain rule through the four stages, compiled once."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.simulation.interpreter import evaluate_all

BLOCK = 32  # steps whose derivatives are evaluated at a time: they stay in the cache until they are used


@njit(cache=True)
def along(instructions: NDArray[np.int64], work: FloatArray, x: FloatArray, decided: FloatArray, half: FloatArray,
          rows: NDArray[np.int64], h: float, columns: FloatArray, start: FloatArray) -> FloatArray:
    """Return the derivatives of the states along a path, shape (nt, ns, nc).

    Parameters
    ----------
    instructions, work
        Of `Equations.slope`, with what parameters alone decide.
    x : ndarray, shape (4 steps, width)
        Its inputs at each stage.
    decided : ndarray, shape (outputs,)
        Its outputs as far as parameters alone decide them.
    half, rows, h, columns, start
        As in `propagate`.
    """
    steps, ns, nr = x.shape[0] // 4, start.shape[0], rows.size
    result = np.empty((steps + 1, ns, start.shape[1]))
    copy_into(start, result[0])
    slope = np.empty((4 * BLOCK, decided.size))
    for k in range(slope.shape[0]):
        for i in range(decided.size):
            slope[k, i] = decided[i]
    for first in range(0, steps, BLOCK):
        count = min(BLOCK, steps - first)
        evaluate_all(instructions, work, x[4 * first: 4 * (first + count)], slope[: 4 * count])
        propagate(half, rows, h, slope[: 4 * count].reshape(count, 4, -1, nr), columns,
                  result[first: first + count + 1])
    return result


@njit(cache=True)
def propagate(half: FloatArray, rows: NDArray[np.int64], h: float, slope: FloatArray, columns: FloatArray,
              result: FloatArray) -> None:
    """Fill in the derivatives of the states along a path from the first on.

    With the stages' rates r0 to r3 a step is x + = E2 x + h (E2 r0 + 2 E1 r1 + 2 E1 r2 + r3) / 6, E1 and E2 the
    linear part's exponentials over half the step and all of it. Each rate's derivative is kept as a table by the step's
    first state and by those parameters that move it, so that a step is one product with a small square matrix:
    start columns need no more than that.

    Parameters
    ----------
    half : ndarray, shape (ns, ns)
        exp(A h / 2) of the linear part.
    rows : ndarray of int, shape (nr,)
        States whose rate is not linear: velocities and the effects' own.
    h : float
    slope : ndarray, shape (steps, 4, ns + np, nr)
        Derivatives of their rates by states and parameters at each stage, transposed.
    columns : ndarray, shape (np, nc)
        Directions in parameter space.
    result : ndarray, shape (steps + 1, ns, nc)
        The first one is known.
    """
    steps, nr, ns = slope.shape[0], rows.size, result.shape[1]
    whole = np.dot(half, half)
    thin = half[:, rows].copy()
    ahead = np.concatenate((half, whole, thin), axis=1)
    weights = np.zeros((ns, 4 * nr))
    copy_into(h / 6.0 * whole[:, rows], weights[:, :nr])
    copy_into(h / 3.0 * thin, weights[:, nr: 2 * nr])
    copy_into(h / 3.0 * thin, weights[:, 2 * nr: 3 * nr])
    for j in range(nr):
        weights[rows[j], 3 * nr + j] = h / 6.0
    place, parameter, column, value = nonzero(columns)
    wide = ns + place.size
    jacobian, moved = np.empty((4, nr, ns)), np.empty((3 * nr, 2 * ns + nr))
    rate, end, step = np.zeros((4, nr, wide)), np.empty((ns, wide)), np.empty((ns, ns))
    for k in range(steps):
        lay_out(slope[k], parameter, column, value, jacobian, rate)
        np.dot(jacobian[1:].reshape(3 * nr, ns), ahead, moved)
        for j in range(nr):
            for c in range(ns):
                rate[0, j, c] = jacobian[0, j, c]
                rate[1, j, c] = moved[j, c]
                rate[2, j, c] = moved[nr + j, c]
                rate[3, j, c] = moved[2 * nr + j, ns + c]
        add_product(moved[:nr, 2 * ns:], 0.5 * h, rate[0], rate[1])
        add_product(jacobian[2][:, rows], 0.5 * h, rate[1], rate[2])
        add_product(moved[2 * nr:, 2 * ns:], h, rate[2], rate[3])
        np.dot(weights, rate.reshape(4 * nr, wide), end)
        for i in range(ns):
            for j in range(ns):
                step[i, j] = whole[i, j] + end[i, j]
        after = result[k + 1]
        np.dot(step, result[k], after)
        for i in range(ns):
            for c in range(place.size):
                after[i, place[c]] += end[i, ns + c]


@njit(cache=True)
def copy_into(source: FloatArray, target: FloatArray) -> None:
    """Copy a matrix; loops, because numba compiles the error message of `target[:] = source` for seconds."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True)
def nonzero(columns: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Return which columns are not zero, and of every entry of these its row, its column among them and its value."""
    used = np.array([np.any(columns[:, c] != 0.0) for c in range(columns.shape[1])])
    place = np.flatnonzero(used)
    row, column = np.nonzero(columns[:, place])
    value = np.empty(row.size)
    for k in range(row.size):
        value[k] = columns[row[k], place[column[k]]]
    return place, row, column, value


@njit(cache=True)
def lay_out(slope: FloatArray, parameter: NDArray[np.int64], column: NDArray[np.int64], value: FloatArray,
            jacobian: FloatArray, rate: FloatArray) -> None:
    """Set each stage's derivatives by the state, and behind them in `rate` those by the parameters' directions."""
    ns = jacobian.shape[2]
    for stage in range(4):
        for j in range(jacobian.shape[1]):
            for c in range(ns):
                jacobian[stage, j, c] = slope[stage, c, j]
            rate[stage, j, ns:] = 0.0
            for k in range(value.size):
                rate[stage, j, ns + column[k]] += value[k] * slope[stage, ns + parameter[k], j]


@njit(cache=True)
def add_product(a: FloatArray, factor: float, b: FloatArray, c: FloatArray) -> None:
    """Add factor a b to c; loops, as a is smaller than what calls of linear algebra are good for."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            weight = factor * a[i, j]
            if weight != 0.0:
                for k in range(b.shape[1]):
                    c[i, k] += weight * b[j, k]
