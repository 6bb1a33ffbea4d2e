"""The integrator: a path by Lawson's Runge-Kutta method, and its derivatives by the chain rule through the stages.

Compiled once for all models: the equations come as lists of CasADi's instructions, from `compiled.Compiled`; codes
are positions in `compiled.OPERATIONS`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit


@jit
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


@jit
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


@jit
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


@jit
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy numbers; a loop, as an assignment of slices takes seconds to compile."""
    for i in range(source.size):
        target[i] = source[i]


@jit
def recur(instructions: NDArray[np.int64], work: FloatArray, rows: FloatArray, result: FloatArray) -> FloatArray:
    """Run the instructions for every row, the last result before it; return all results, zero first."""
    count, size = rows.shape[0], result.size
    x, found = np.empty(size + rows.shape[1]), np.zeros((count + 1, size))
    for k in range(count):
        copy(found[k], x[:size])
        copy(rows[k], x[size:])
        evaluate(instructions, work, x, result)
        copy(result, found[k + 1])
    return found


@jit
def walk(program: tuple[NDArray[np.int64], FloatArray, FloatArray], dynamics: tuple[FloatArray, FloatArray, FloatArray],
         rows: NDArray[np.int64], h: float, drive: FloatArray, time: FloatArray, states: FloatArray,
         stages: FloatArray) -> None:
    """Step through a record by Lawson's Runge-Kutta method: fill states (steps + 1, ns) from the first one on.

    The program: instructions of `MotionEquations.rates`, working memory and result with what parameters decide. The
    dynamics: exp(A h / 2) of the linear part, its square, and its rows (n, ns) of the velocities' rates. rows (nr,):
    the states whose rate is not linear, velocities first. drive (steps, 9, drives), time (steps,); stages (steps, 4,
    ns + n) are filled with states and accelerations at the stages.
    """
    (instructions, work, result), (half, whole, linear) = program, dynamics
    n, ns = linear.shape
    extra, drives = rows.size, drive.shape[2]
    thin, last = np.empty((ns, extra)), np.empty((ns, extra))
    for i in range(ns):
        for j in range(extra):
            thin[i, j], last[i, j] = half[i, rows[j]], whole[i, rows[j]]
    x, rate = np.empty(ns + 3 * drives + 1), np.empty((4, extra))
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
            point, source = stages[k, stage], state if stage == 0 else end if stage == 3 else middle
            for i in range(ns):
                point[i] = source[i]
                if stage == 1 or stage == 3:
                    for j in range(extra):
                        point[i] += 0.25 * h * (stage + 1) * thin[i, j] * rate[stage - 1, j]
            if stage == 2:
                for j in range(extra):
                    point[rows[j]] += 0.5 * h * rate[1, j]
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
            u = end[i]
            for j in range(extra):
                u += h / 6.0 * (last[i, j] * rate[0, j] + 2.0 * thin[i, j] * (rate[1, j] + rate[2, j]))
            following[i] = u
        for j in range(extra):
            following[rows[j]] += h / 6.0 * rate[3, j]


@jit
def propagate_slopes(program: tuple[NDArray[np.int64], FloatArray, FloatArray], dynamics: tuple[FloatArray, FloatArray],
                     rows: NDArray[np.int64], h: float, path: tuple[FloatArray, FloatArray, FloatArray],
                     columns: FloatArray, result: FloatArray) -> None:
    """Fill in the derivatives of the states along a path from the first on, by the chain rule through `walk`'s stages.

    With the stages' rates r0 to r3 a step is x + = E2 x + h (E2 r0 + 2 E1 r1 + 2 E1 r2 + r3) / 6, E1 and E2 the linear
    part's exponentials over half the step and all of it: the dynamics. rows (nr,) are the states whose rate is not
    linear; the program (see `walk`), `MotionEquations.slope`, has the derivatives of their rates by states and
    parameters, (ns + np, nr). The path: stages, drive and time of `walk`. columns (np, nc) are directions in parameter
    space; of result (steps + 1, ns, nc) the first one is known.
    """
    (instructions, work, slope), (half, whole), (stages, drive, time) = program, dynamics, path
    ns, nr, nc, drives = result.shape[1], rows.size, result.shape[2], drive.shape[2]
    thin = np.empty((ns, nr))
    both, last = np.empty((2 * ns, ns)), np.empty((ns, 3 * nr))  # loops: slices of arrays take seconds to compile
    for i in range(ns):
        for j in range(ns):
            both[i, j], both[ns + i, j] = half[i, j], whole[i, j]
        for j in range(nr):
            thin[i, j], last[i, j] = half[i, rows[j]], h / 6.0 * whole[i, rows[j]]
            last[i, nr + j] = last[i, 2 * nr + j] = h / 3.0 * thin[i, j]
    x, point, rate = np.empty(stages.shape[2] + 3 * drives + 1), np.empty((ns, nc)), np.empty((4 * nr, nc))
    by_state, now = np.empty((nr, ns)), np.empty((nr, nc))
    following, added = np.empty((2 * ns, nc)), np.empty((ns, nc))  # by the linear part over half the step and all of it
    moving, moved = np.nonzero(columns)
    for k in range(stages.shape[0]):
        np.dot(both, result[k], following)
        for stage in range(4):
            at = (stage + 1) // 2
            copy(stages[k, stage], x)
            for c in range(3):
                copy(drive[k, 3 * c + at], x[stages.shape[2] + c * drives:])
            x[-1] = time[k] + 0.5 * h * at
            evaluate(instructions, work, x, slope)
            source = result[k] if stage == 0 else following[ns:] if stage == 3 else following[:ns]
            for i in range(ns):
                for c in range(nc):
                    point[i, c] = source[i, c]
                for j in range(nr):
                    by_state[j, i] = slope[i * nr + j]
            if stage == 2:
                for j in range(nr):
                    for c in range(nc):
                        point[rows[j], c] += 0.5 * h * rate[nr + j, c]
            elif stage > 0:
                np.dot(thin, rate[(stage - 1) * nr:stage * nr], added)
                share = 0.5 * h if stage == 1 else h
                for i in range(ns):
                    for c in range(nc):
                        point[i, c] += share * added[i, c]
            np.dot(by_state, point, now)
            for i in range(moving.size):
                p, c = moving[i], moved[i]
                for j in range(nr):
                    now[j, c] += slope[(ns + p) * nr + j] * columns[p, c]
            for j in range(nr):
                for c in range(nc):
                    rate[stage * nr + j, c] = now[j, c]
        np.dot(last, rate[:3 * nr], added)
        for i in range(ns):
            for c in range(nc):
                result[k + 1, i, c] = following[ns + i, c] + added[i, c]
        for j in range(nr):
            for c in range(nc):
                result[k + 1, rows[j], c] += h / 6.0 * rate[3 * nr + j, c]


@jit
def run_linear(F: FloatArray, x: FloatArray) -> None:
    """Add F x_(k-1) to each row x_k but the first, in turn."""
    for k in range(1, x.shape[0]):
        for i in range(x.shape[1]):
            total = x[k, i]
            for j in range(x.shape[1]):
                total += F[i, j] * x[k - 1, j]
            x[k, i] = total


@jit
def run_modes(real: np.ndarray, imag: np.ndarray, w: np.ndarray, z: np.ndarray) -> None:
    """Run z = pole z + w_k for every mode, in place: w becomes the states after each step, z the last one.

    Two modes go side by side, since a single recursion waits for its own result. real, imag (modes,), an even number,
    are the poles; w (2 modes, nt) and z (2 modes,) have real parts, then imaginary parts.
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
