"""The integrator: a path by Lawson's Runge-Kutta method, and its derivatives by the chain rule through the stages.

Compiled once for all models: the equations come as lists of CasADi's instructions, from `compiled.Compiled`, whose
codes are positions in `compiled.OPERATIONS`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray


@njit(cache=True, error_model="numpy")
def elementary(code: int, a: float, b: float) -> float:
    """Return the value of one operation; those of one operand ignore the second."""
    if code == 9:
        return 1.0 / a
    if code == 11:
        return math.sin(a)
    if code == 12:
        return math.cos(a)
    if code == 13:
        return math.tanh(a)
    if code == 14:
        return math.exp(a)
    if code == 15:
        return math.sqrt(a)
    if code == 16:
        return abs(a)
    if code == 17:
        return (1.0 if a > 0.0 else 0.0) - (1.0 if a < 0.0 else 0.0)
    if code == 18:
        return 1.0 if a < b else 0.0
    if code == 19:
        return 1.0 if a <= b else 0.0
    if code == 20:
        return 1.0 if a == b else 0.0
    if code == 21:
        return 1.0 if a != b else 0.0
    if code == 22:
        return 1.0 if a == 0.0 else 0.0
    if code == 23:
        return 1.0 if a != 0.0 and b != 0.0 else 0.0
    if code == 24:
        return 1.0 if a != 0.0 or b != 0.0 else 0.0
    if code == 25:
        return min(a, b)
    if code == 26:
        return max(a, b)
    if code == 27 or code == 28:
        return a**b
    return seldom(code, a, b)


@njit(cache=True, error_model="numpy")
def seldom(code: int, a: float, b: float) -> float:
    """Return the value of an operation that few effects hold."""
    if code == 29:
        return math.log(a)
    if code == 30:
        return math.tan(a)
    if code == 31:
        return math.asin(a)
    if code == 32:
        return math.acos(a)
    if code == 33:
        return math.atan(a)
    if code == 34:
        return math.atan2(a, b)
    if code == 35:
        return math.sinh(a)
    if code == 36:
        return math.cosh(a)
    if code == 37:
        return math.asinh(a)
    if code == 38:
        return math.acosh(a)
    if code == 39:
        return math.atanh(a)
    if code == 40:
        return float(np.floor(a))
    if code == 41:
        return float(np.ceil(a))
    if code == 42:
        return float(np.fmod(a, b))
    if code == 43:
        return math.copysign(a, b)
    if code == 44:
        return math.erf(a)
    if code == 45:
        return math.log1p(a)
    if code == 46:
        return math.expm1(a)
    if code == 47:
        return math.hypot(a, b)
    return a


@njit(cache=True, error_model="numpy")
def evaluate(instructions: NDArray[np.int64], work: FloatArray, x: FloatArray, result: FloatArray) -> None:
    """Run the instructions once, from x to result."""
    for k in range(instructions.shape[0]):
        code, out, one, two = instructions[k, 0], instructions[k, 1], instructions[k, 2], instructions[k, 3]
        if code == 0:
            work[out] = x[one]
        elif code == 1:
            result[out] = work[one]
        elif code == 2:
            work[out] = work[one] + work[two]
        elif code == 3:
            work[out] = work[one] - work[two]
        elif code == 4:
            work[out] = work[one] * work[two]
        elif code == 5:
            work[out] = work[one] / work[two]
        elif code == 6:
            work[out] = -work[one]
        elif code == 7:
            work[out] = work[one] * work[one]
        elif code == 8:
            work[out] = 2.0 * work[one]
        elif code == 10:
            work[out] = work[two] if work[one] != 0.0 else 0.0
        else:
            work[out] = elementary(code, work[one], work[two])


@njit(cache=True, error_model="numpy")
def recur(instructions: NDArray[np.int64], work: FloatArray, rows: FloatArray, result: FloatArray) -> FloatArray:
    """Run the instructions for every row, the last result before it; return all results, zero first."""
    count, size = rows.shape[0], result.size
    x, found = np.empty(size + rows.shape[1]), np.zeros((count + 1, size))
    for k in range(count):
        x[:size], x[size:] = found[k], rows[k]
        evaluate(instructions, work, x, result)
        found[k + 1] = result
    return found


@njit(cache=True, error_model="numpy")
def walk(instructions: NDArray[np.int64], work: FloatArray, result: FloatArray, half: FloatArray, linear: FloatArray,
         h: float, drive: FloatArray, time: FloatArray, states: FloatArray, stages: FloatArray) -> None:
    """Step through a record by Lawson's Runge-Kutta method.

    Parameters
    ----------
    instructions, work, result
        Of `Equations.rates`, with what parameters alone decide.
    half : ndarray, shape (ns, ns)
        exp(A h / 2) of the linear part.
    linear : ndarray, shape (n, ns)
        The linear part's rows of the velocities' rates.
    h : float
    drive : ndarray, shape (steps, 9, drives)
    time : ndarray, shape (steps,)
    states : ndarray, shape (steps + 1, ns)
        The first one is the start; the others are filled.
    stages : ndarray, shape (steps, 4, ns + n)
        Filled with states and accelerations at the stages.
    """
    n, ns = linear.shape
    extra = result.size - n * ns  # the velocities' rates and those of the effects' own states
    first = ns - extra
    drives = drive.shape[2]
    x, rate = np.empty(ns + 3 * drives + 1), np.empty((4, extra))
    whole = np.dot(half, half)
    middle, end = np.empty(ns), np.empty(ns)
    for k in range(states.shape[0] - 1):
        state = states[k]
        for i in range(ns):
            u, w = 0.0, 0.0
            for j in range(ns):
                u += half[i, j] * state[j]
                w += whole[i, j] * state[j]
            middle[i], end[i] = u, w
        for stage in range(4):
            at = (stage + 1) // 2
            point = stages[k, stage]
            for i in range(ns):
                if stage == 0:
                    point[i] = state[i]
                elif stage == 1:
                    point[i] = middle[i]
                    for j in range(extra):
                        point[i] += 0.5 * h * half[i, first + j] * rate[0, j]
                elif stage == 2:
                    point[i] = middle[i] + (0.5 * h * rate[1, i - first] if i >= first else 0.0)
                else:
                    point[i] = end[i]
                    for j in range(extra):
                        point[i] += h * half[i, first + j] * rate[2, j]
            for i in range(ns):
                x[i] = point[i]
            for c in range(3):
                for i in range(drives):
                    x[ns + c * drives + i] = drive[k, 3 * c + at, i]
            x[ns + 3 * drives] = time[k] + 0.5 * h * at
            evaluate(instructions, work, x, result)
            for i in range(extra):
                rate[stage, i] = result[n * ns + i]
            for i in range(n):
                added, own = rate[stage, i], 0.0
                for j in range(ns):
                    added += result[j * n + i] * point[j]
                    own += linear[i, j] * point[j]
                rate[stage, i] = added
                point[ns + i] = added + own
        following = states[k + 1]
        for i in range(ns):
            u = end[i] + (h / 6.0 * rate[3, i - first] if i >= first else 0.0)
            for j in range(extra):
                u += h / 6.0 * (whole[i, first + j] * rate[0, j] + 2.0 * half[i, first + j] * (rate[1, j] + rate[2, j]))
            following[i] = u


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
