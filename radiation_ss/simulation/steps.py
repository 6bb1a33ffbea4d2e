"""The integrator's steps: a path by Lawson's Runge-Kutta method, and its derivatives by the chain rule through them.

Compiled once for all models, as `integrator` is. Where a force sets in at once a step is split in two, again and again.
Its error is the larger one of two that take no evaluation more: that of the embedded method of third order (Balac &
Mahe 2013), and a jump of the rates between two stages, which shows in how their curvature differs from that of the step
before. The two stages at a step's middle tell how fast its motion decays there (Hairer & Wanner 1996, IV.2): up to 2 in
a step the method damps what derivatives it has, beyond 2.8 these grow unseen by the error.
"""

import math

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit
from radiation_ss.simulation.integrator import copy, evaluate

Program = tuple[NDArray[np.int64], FloatArray, FloatArray]
"""Instructions of `MotionEquations`, working memory and result with what parameters decide."""


@jit(inner=True)
def lay(x: FloatArray, drive: FloatArray, time: float, h: float, share: float) -> None:
    """Put the drive, (9, drives), and the time at a share of a step behind the point in x."""
    drives, (a, b, c) = drive.shape[1], ((1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share),
                                         share * (2.0 * share - 1.0))
    first = x.size - 1 - 3 * drives
    for k in range(3):
        for i in range(drives):
            x[first + k * drives + i] = a * drive[3 * k, i] + b * drive[3 * k + 1, i] + c * drive[3 * k + 2, i]
    x[x.size - 1] = time + h * share


@jit(inner=True)
def rated(program: Program, x: FloatArray, linear: FloatArray, rate: FloatArray, point: FloatArray) -> None:
    """Fill in the rates of the stepped states, (nr,), and after a point's states its accelerations."""
    (instructions, work, result), (n, ns) = program, linear.shape
    copy(point[:ns], x)
    evaluate(instructions, work, x, result)
    for i in range(rate.size):
        rate[i] = result[n * ns + i]
    for i in range(n):
        own = 0.0
        for j in range(ns):
            rate[i] += result[j * n + i] * point[j]
            own += linear[i, j] * point[j]
        point[ns + i] = rate[i] + own


@jit(inner=True)
def times(matrix: FloatArray, x: FloatArray, target: FloatArray) -> None:
    """Fill in a matrix times the first numbers of x."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * x[j]
        target[i] = total


@jit(inner=True)
def advance(half: FloatArray, whole: FloatArray, rows: NDArray[np.int64], h: float, stage: int, rate: FloatArray,
            target: FloatArray) -> None:
    """Bring the linear motion up to the point of stage 1 to 3, or 4, the end of a step of h, by the rates so far."""
    nr = rows.size
    for i in range(half.shape[0]):
        for j in range(nr):
            if stage == 1:
                target[i] += 0.5 * h * half[i, rows[j]] * rate[0, j]
            elif stage == 3:
                target[i] += h * half[i, rows[j]] * rate[2, j]
            elif stage == 4:
                target[i] += h / 6.0 * (whole[i, rows[j]] * rate[0, j]
                                        + 2.0 * half[i, rows[j]] * (rate[1, j] + rate[2, j]))
    for j in range(nr):
        if stage == 2:
            target[rows[j]] += 0.5 * h * rate[1, j]
        elif stage == 4:
            target[rows[j]] += h / 6.0 * rate[3, j]


@jit(inner=True)
def errors(rows: NDArray[np.int64], part: float, now: FloatArray, after: FloatArray, rate: FloatArray, accuracy: float,
           largest: FloatArray, before: FloatArray, curved: FloatArray) -> tuple[float, float]:
    """Return the error of a part, and its decay, in units of those from which it is split.

    `largest`, values of the stepped states so far, and the rates' curvature `curved` are filled in; `before` it was the
    part's before.
    """
    worst, bent, moved = 0.0, 0.0, 0.0
    for j in range(rows.size):
        i = rows[j]
        largest[j] = max(largest[j], abs(now[0, i]), abs(after[i]))
        curved[j] = (rate[0, j] - rate[1, j] - rate[2, j] + rate[4, j]) / part**2
        if largest[j] > 0.0:
            error = max(part / 10.0 * abs(rate[4, j] - rate[3, j]), part**3 / 3.0 * abs(curved[j] - before[j]))
            worst = max(worst, error / (accuracy * largest[j]))
            bent += ((rate[2, j] - rate[1, j]) / largest[j])**2
            moved += ((now[2, i] - now[1, i]) / largest[j])**2
    return worst, 0.5 * part * math.sqrt(bent / moved) if moved > 0.0 else 0.0


@jit(inner=True)
def longer(rows: np.ndarray) -> np.ndarray:
    """Return an array with room for as many rows more."""
    found = np.empty((2 * rows.shape[0], *rows.shape[1:]), dtype=rows.dtype)
    copy(rows.reshape(-1), found.reshape(-1)[:rows.size])
    return found


@jit(inner=True)
def within(x: FloatArray, count: int, limit: float) -> bool:
    """Return whether the first numbers of x are finite and no larger than a limit."""
    for i in range(count):
        if not abs(x[i]) <= limit:
            return False
    return True


@jit
def walk(program: Program, dynamics: tuple[FloatArray, FloatArray, FloatArray], rows: NDArray[np.int64], h: float,
         signals: tuple[FloatArray, FloatArray], states: FloatArray, limits: tuple[float, float, int],
         kept: bool) -> tuple[FloatArray, NDArray[np.int64]]:
    """Step through a record by Lawson's Runge-Kutta method: fill states (steps + 1, ns) from the first one on.

    The dynamics: exp(A h / 2) of the linear part and its square for h and each half of it, (levels, ns, ns), and the
    linear part's rows (n, ns) of the velocities' rates. rows (nr,): the states whose rate is not linear, velocities
    first. The signals: drive (steps, 9, drives) and time (steps,). The limits: of a step's error, over a state's
    largest value so far, beyond which it is split; of the states, and of the number of parts, beyond which what is
    left of the states is NaN. Returned: states and accelerations at the stages, (parts, 4, ns + n),
    none unless `kept`, and of each part its step, how many of the shortest parts are before it there, and its level.
    """
    (halves, wholes, linear), (drive, time), (accuracy, largest_state, most) = dynamics, signals, limits
    (n, ns), nr, finest = linear.shape, rows.size, halves.shape[0] - 1
    units, level, count = 1 << finest, finest, 0
    taken = np.empty((states.shape[0], 3), dtype=np.int64)
    stages = np.empty((states.shape[0] if kept else 0, 4, ns + n))
    x, rate, largest = np.empty(ns + 3 * drive.shape[2] + 1), np.empty((5, nr)), np.zeros(nr)
    now, after = np.empty((4, ns + n)), np.empty(ns + n)
    curved, before = np.zeros(nr), np.zeros(nr)
    for i in range(ns):
        now[0, i] = states[0, i]
    lay(x, drive[0], time[0], h, 0.0)
    rated(program, x, linear, rate[0], now[0])
    for k in range(states.shape[0] - 1):
        at = 0
        while at < units:
            span, part = units >> level, h / (1 << level)
            times(halves[level], now[0], now[1])
            times(wholes[level], now[0], now[3])
            copy(now[1], now[2])
            copy(now[3], after)
            for stage in range(1, 5):
                point = now[stage] if stage < 4 else after
                advance(halves[level], wholes[level], rows, part, stage, rate, point)
                lay(x, drive[k], time[k], h, (at + 0.5 * span * ((stage + 1) // 2)) / units)
                rated(program, x, linear, rate[stage], point)
            worst, stiff = errors(rows, part, now, after, rate, accuracy, largest, before, curved)
            if level < finest and (worst > 1.0 or stiff > 1.0):
                level += 1
                continue
            if count >= most or not within(after, ns, largest_state):
                states[k + 1:] = np.nan
                return stages[:count], taken[:count]
            if count == taken.shape[0]:
                stages, taken = longer(stages), longer(taken)
            taken[count, 0], taken[count, 1], taken[count, 2] = k, at, level
            if kept:
                copy(now.reshape(-1), stages[count].reshape(-1))
            count += 1
            at += span
            copy(after, now[0])
            copy(rate[4], rate[0])
            copy(curved, before)
            if level > 0 and 16.0 * worst <= 1.0 and 2.0 * stiff <= 1.0 and at % (2 * span) == 0:
                level -= 1
        for i in range(ns):
            states[k + 1, i] = after[i]
    return stages[:count], taken[:count]


@jit(inner=True)
def through(slope: FloatArray, matrix: FloatArray, target: FloatArray) -> None:
    """Fill in the derivatives (nr, k) of the rates by what moves the states by a matrix (ns, k)."""
    nr = target.shape[0]
    for j in range(nr):
        for i in range(target.shape[1]):
            target[j, i] = 0.0
        for m in range(matrix.shape[0]):
            if slope[m * nr + j] != 0.0:
                for i in range(target.shape[1]):
                    target[j, i] += slope[m * nr + j] * matrix[m, i]


@jit
def propagate_slopes(program: Program, dynamics: tuple[FloatArray, FloatArray], rows: NDArray[np.int64], h: float,
                     signals: tuple[FloatArray, FloatArray], path: tuple[FloatArray, NDArray[np.int64]],
                     columns: FloatArray, result: FloatArray) -> None:
    """Fill in the derivatives of the states along a path from the first on, by the chain rule through `walk`'s stages.

    With the stages' rates r0 to r3 a step is x + = E2 x + h (E2 r0 + 2 E1 r1 + 2 E1 r2 + r3) / 6, E1 and E2 the linear
    part's exponentials over half the step and all of it: the dynamics. A stage's rates are linear in what a part starts
    from, in parameters, and in the rates of the stage before. The program (see `walk`), `MotionEquations.slope`, has
    the derivatives of the rates by states and parameters, (ns + np, nr). The path: stages of `walk` and where they are.
    columns (np, nc) are directions in parameter space; of result (steps + 1, ns, nc) the
    first one is known.
    """
    (instructions, work, slope), (halves, wholes), (drive, time), (stages, taken) = program, dynamics, signals, path
    (ns, nc), nr, units = result.shape[1:], rows.size, 1 << (halves.shape[0] - 1)
    x, unit = np.empty(stages.shape[2] + 3 * drive.shape[2] + 1), np.eye(ns)
    thin, pick, last = np.empty((ns, nr)), np.zeros((ns, nr)), np.empty((ns, 3 * nr))
    by_start, following = np.empty((ns + 4 * nr, ns)), np.empty((ns + 4 * nr, nc))  # of a part's end and its rates
    by_rate, rate, added = np.empty((4, nr, nr)), np.empty((4 * nr, nc)), np.empty((ns, nc))
    moving, moved = np.nonzero(columns)
    current = result[0].copy()
    for j in range(nr):
        pick[rows[j], j] = 1.0
    for s in range(taken.shape[0]):
        k, at, level = taken[s, 0], taken[s, 1], taken[s, 2]
        span, part, half, whole = units >> level, h / (1 << level), halves[level], wholes[level]
        for i in range(ns):
            for j in range(ns):
                by_start[i, j] = whole[i, j]
            for j in range(nr):
                thin[i, j], last[i, j] = half[i, rows[j]], part / 6.0 * whole[i, rows[j]]
                last[i, nr + j] = last[i, 2 * nr + j] = part / 3.0 * thin[i, j]
        for stage in range(4):
            first = stage * nr
            copy(stages[s, stage], x)
            lay(x, drive[k], time[k], h, (at + 0.5 * span * ((stage + 1) // 2)) / units)
            evaluate(instructions, work, x, slope)
            through(slope, unit if stage == 0 else whole if stage == 3 else half, by_start[ns + first:ns + first + nr])
            through(slope, pick if stage == 2 else thin, by_rate[stage])
            for j in range(nr):
                for c in range(nc):
                    rate[first + j, c] = 0.0
            for i in range(moving.size):
                p, c = moving[i], moved[i]
                for j in range(nr):
                    rate[first + j, c] += slope[(ns + p) * nr + j] * columns[p, c]
        np.dot(by_start, current, following)
        for stage in range(4):
            first, share = stage * nr, 0.0 if stage == 0 else part if stage == 3 else 0.5 * part
            for j in range(nr):
                for c in range(nc):
                    rate[first + j, c] += following[ns + first + j, c]
                    for i in range(nr if stage > 0 else 0):
                        rate[first + j, c] += share * by_rate[stage, j, i] * rate[first - nr + i, c]
        np.dot(last, rate[:3 * nr], added)
        for i in range(ns):
            for c in range(nc):
                current[i, c] = following[i, c] + added[i, c]
        for j in range(nr):
            for c in range(nc):
                current[rows[j], c] += part / 6.0 * rate[3 * nr + j, c]
        if at + span == units:
            copy(current.reshape(-1), result[k + 1].reshape(-1))
