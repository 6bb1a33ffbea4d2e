"""Runs the instructions of `compiled.Compiled`: one sample, many samples side by side, or step by step along a path.

The codes are positions in `compiled.OPERATIONS`. Frequent operations stand in the loops themselves, so that the
machine takes several samples at once; the others are in `elementary`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray

LANES = 32  # samples side by side: their working memory stays in the cache


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
def evaluate_all(instructions: NDArray[np.int64], initial: FloatArray, x: FloatArray, result: FloatArray) -> None:
    """Run the instructions for each row of x, into the rows of result."""
    work = np.empty((initial.size, LANES))
    for k in range(initial.size):
        work[k] = initial[k]
    for begin in range(0, x.shape[0], LANES):
        size = min(LANES, x.shape[0] - begin)
        for k in range(instructions.shape[0]):
            code, out, one, two = instructions[k, 0], instructions[k, 1], instructions[k, 2], instructions[k, 3]
            if code == 0:
                for j in range(size):
                    work[out, j] = x[begin + j, one]
                continue
            if code == 1:
                for j in range(size):
                    result[begin + j, out] = work[one, j]
                continue
            c, a, b = work[out], work[one], work[two]
            if code == 2:
                for j in range(LANES):
                    c[j] = a[j] + b[j]
            elif code == 3:
                for j in range(LANES):
                    c[j] = a[j] - b[j]
            elif code == 4:
                for j in range(LANES):
                    c[j] = a[j] * b[j]
            elif code == 5:
                for j in range(LANES):
                    c[j] = a[j] / b[j]
            elif code == 6:
                for j in range(LANES):
                    c[j] = -a[j]
            elif code == 7:
                for j in range(LANES):
                    c[j] = a[j] * a[j]
            elif code == 8:
                for j in range(LANES):
                    c[j] = 2.0 * a[j]
            elif code == 10:
                for j in range(LANES):
                    c[j] = b[j] if a[j] != 0.0 else 0.0
            else:
                for j in range(size):
                    c[j] = elementary(code, a[j], b[j])


@njit(cache=True, error_model="numpy")
def evaluate_on(instructions: NDArray[np.int64], work: FloatArray, size: int, x: FloatArray,
                result: FloatArray) -> None:
    """Run the instructions for each row of x in turn; the first `size` results become those inputs of the next row."""
    for k in range(x.shape[0]):
        evaluate(instructions, work, x[k], result[k])
        if k + 1 < x.shape[0]:
            x[k + 1, :size] = result[k, :size]


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
