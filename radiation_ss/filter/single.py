"""The Runge-Kutta step of one degree of freedom with one subsystem: a member's whole step in one pass, in registers.

What `kernels.rk4` does, to rounding, three times faster. The compiler makes vector code of the one long loop only where
it sees that no two rows overlap: so members are copied, WIDTH at a time, into rows a constant distance apart, indices
are unsigned (a signed one is tested for counting from the end), and the order is the length of a tuple, `zero`, which
is part of its type.
"""

from __future__ import annotations

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem

from radiation_ss.jit import jit

WIDTH = 128
STRIDE = WIDTH + 8  # a power of two would put all rows into the same sets of the cache


@jit(inner=True)
def working_space(order):  # type: ignore[no-untyped-def]
    """Return rows of a, b, radiation states (order rows each), displacement, velocity, force."""
    return np.empty((3 * order + 3) * STRIDE)


@jit(inner=True)
def rk4_single(zero, plan, theta, z, held, dt, work):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place; `held` is the force, zero a tuple of `order` zeros."""
    order, w, c, d = len(zero), plan.inverse[0, 0], plan.stiffness[0, 0], plan.damping[0, 0]
    for start in range(0, z.shape[1], WIDTH):
        count = min(WIDTH, z.shape[1] - start)
        fetch(theta, 2 * order, start, count, work, 0)
        fetch(z, order + 2, start, count, work, 2 * order)
        fetch(held, 1, start, count, work, 3 * order + 2)
        step(zero, work, count, dt, w, c, d)
        begin = np.uintp(start)
        for r in range(order + 2):
            at = np.uintp((2 * order + r) * STRIDE)
            for e in range(count):
                z[r, begin + np.uintp(e)] = work[at + np.uintp(e)]


@jit(inner=True)
def fetch(source, rows, start, count, work, row):  # type: ignore[no-untyped-def]
    """Copy members of the first rows into working rows."""
    begin = np.uintp(start)
    for r in range(rows):
        to = np.uintp((row + r) * STRIDE)
        for e in range(count):
            work[to + np.uintp(e)] = source[r, begin + np.uintp(e)]


@jit(inner=True)
def step(zero, work, count, dt, w, c, d):  # type: ignore[no-untyped-def]
    """Move `count` members in their working rows."""
    n = len(zero)
    for member in range(count):
        e, start = np.uintp(member), zero
        for i in range(n):
            start = tuple_setitem(start, i, work[np.uintp((2 * n + i) * STRIDE) + e])
        at_x, at_v = np.uintp(3 * n * STRIDE) + e, np.uintp((3 * n + 1) * STRIDE) + e
        x0, v0, force = work[at_x], work[at_v], work[np.uintp((3 * n + 2) * STRIDE) + e]
        s, x, v = start, x0, v0
        for stage in range(4):
            h, y, new = dt / (4 - stage), s[n - 1], zero
            for i in range(n):
                rate = work[np.uintp((n + i) * STRIDE) + e] * v - work[np.uintp(i * STRIDE) + e] * y
                if i > 0:
                    rate += s[i - 1]
                new = tuple_setitem(new, i, start[i] + h * rate)
            x1 = x0 + h * v
            v = v0 + h * w * (force - c * x - d * v - y)
            s, x = new, x1
        for i in range(n):
            work[np.uintp((2 * n + i) * STRIDE) + e] = s[i]
        work[at_x], work[at_v] = x, v
