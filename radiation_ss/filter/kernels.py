"""What the compiled loops share: Runge-Kutta steps, the ensemble's analysis, draws.

Members are columns, so every inner loop runs along contiguous memory; arrays are indexed in two dimensions rather than
row by row, because a view of a row costs as much as the arithmetic on it. The NumPy version, which tests compare with,
is benchmarks/filter_by_numpy.py.
"""

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem

from radiation_ss.jit import jit

WIDTH = 128         # members side by side in `rk4_single`
STRIDE = WIDTH + 8  # a power of two would put all rows into the same sets of the cache


@jit(inner=True)
def add_rows(weights, i, factor, source, first, out, row):  # type: ignore[no-untyped-def]
    """Add factor times row i of weights, times rows of source from `first` on, to a row of out."""
    for j in range(weights.shape[1]):
        w, k = factor * weights[i, j], first + j
        if w != 0.0:
            for e in range(out.shape[1]):
                out[row, e] += w * source[k, e]


@jit(inner=True)
def project(H, c, z, out, row):  # type: ignore[no-untyped-def]
    """Write row c of H, times z, into a row of out."""
    for e in range(out.shape[1]):
        out[row, e] = 0.0
    add_rows(H, c, 1.0, z, 0, out, row)


@jit(inner=True)
def net_force(plan, z, f, first, gap, net):  # type: ignore[no-untyped-def]
    """Write excitation minus restoring, damping and radiation force; the force of dof i is row first + gap i of f."""
    n, m = net.shape[0], plan.m
    for i in range(n):
        for e in range(net.shape[1]):
            net[i, e] = f[first + gap * i, e]
        add_rows(plan.stiffness, i, -1.0, z, m, net, i)
        add_rows(plan.damping, i, -1.0, z, m + n, net, i)
    for p in range(plan.pairs.shape[0]):
        i, y = plan.pairs[p, 0], plan.pairs[p, 3] + plan.pairs[p, 4] - 1
        for e in range(net.shape[1]):
            net[i, e] -= z[y, e]


@jit(inner=True)
def reach_radiation(plan, theta, z, h, t, new):  # type: ignore[no-untyped-def]
    """Write all radiation states of z plus h times their rate (5) at t into new."""
    members, pairs, v = z.shape[1], plan.pairs, plan.m + plan.inverse.shape[0]
    for p in range(pairs.shape[0]):
        at, order = pairs[p, 3], pairs[p, 4]
        u, y, a, b = v + pairs[p, 1], at + order - 1, pairs[p, 2], pairs[p, 2] + order
        for e in range(members):
            new[at, e] = z[at, e] + h * (theta[b, e] * t[u, e] - theta[a, e] * t[y, e])
        for i in range(1, order):
            k, before, a_i, b_i = at + i, at + i - 1, a + i, b + i
            for e in range(members):
                new[k, e] = z[k, e] + h * (t[before, e] + theta[b_i, e] * t[u, e] - theta[a_i, e] * t[y, e])


@jit(inner=True)
def rk4(plan, force, theta, z, held, dt, buffers, net):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place.

    The rate G is affine in z: the step is z + h G(z + h/2 G(z + h/3 G(z + h/4 G(z)))), half the traffic of the usual
    form. The force is part of z and moves by the model `force` (n, 2, 2), or is `held`. buffers (2, rows, members) and
    net (n, members) are working arrays.
    """
    n, m = plan.inverse.shape[0], plan.m
    base = m + 2 * n
    for stage in range(4):
        h, new, t = dt / (4 - stage), buffers[stage % 2], z if stage == 0 else buffers[1 - stage % 2]
        reach_radiation(plan, theta, z, h, t, new)
        source, first, gap = (t, base, 2) if force.shape[0] else (held, 0, 1)
        net_force(plan, t, source, first, gap, net)
        for r in range(m, buffers.shape[1]):
            for e in range(z.shape[1]):
                new[r, e] = z[r, e] + h * t[r + n, e] if r < m + n else z[r, e]
        for i in range(n):
            add_rows(plan.inverse, i, h, net, 0, new, m + n + i)
        for i in range(force.shape[0]):
            for k in range(2):
                add_rows(force[i], k, h, t, base + 2 * i, new, base + 2 * i + k)
    for r in range(buffers.shape[1]):
        for e in range(z.shape[1]):
            z[r, e] = buffers[1, r, e]


@jit(inner=True)
def working_space(order):  # type: ignore[no-untyped-def]
    """Return rows of a, b, radiation states (order rows each), displacement, velocity, force."""
    return np.empty((3 * order + 3) * STRIDE)


@jit(inner=True)
def rk4_single(zero, plan, theta, z, held, dt, work):  # type: ignore[no-untyped-def]
    """Move all members of one degree of freedom with one subsystem by one Runge-Kutta step in place.

    What `rk4` does, to rounding, three times faster: a member's whole step in one pass, in registers. The compiler
    makes vector code of the one long loop only where it sees that no two rows overlap: so members are copied, WIDTH at
    a time, into rows a constant distance apart, indices are unsigned (a signed one is tested for counting from the
    end), and the order is the length of a tuple of zeros, which is part of its type. `held` is the force.
    """
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


@jit(inner=True)
def predict_covariance(F, P, FP, Q):  # type: ignore[no-untyped-def]
    """Write P = F P F' + Q (`kalman.predict`)."""
    size = P.shape[0]
    for i in range(size):
        for j in range(size):
            FP[i, j] = 0.0
        for k in range(size):
            for j in range(size):
                FP[i, j] += F[i, k] * P[k, j]
    for i in range(size):
        for j in range(i, size):
            total = Q[i, j]
            for k in range(size):
                total += FP[i, k] * F[j, k]
            P[i, j] = P[j, i] = total


@jit(inner=True)
def moments(E, r, members):  # type: ignore[no-untyped-def]
    """Return mean and sample variance of the first `members` values of a row, in one pass about the first of them."""
    shift, total, squares = E[r, 0], 0.0, 0.0
    for e in range(members):
        d = E[r, e] - shift
        total += d
        squares += d * d
    mean = total / members
    return shift + mean, max(squares - total * mean, 0.0) / (members - 1)


@jit(inner=True)
def product(A, i, B, j, members):  # type: ignore[no-untyped-def]
    """Return the sum over members of a row of A times a row of B."""
    total = 0.0
    for e in range(members):
        total += A[i, e] * B[j, e]
    return total


@jit(inner=True)
def analyse(E, first, rows, Y, D, p, gains):  # type: ignore[no-untyped-def]
    """Add to rows of E their covariances with the anomalies Y (p, members), times D (p, columns): the analysis (34).

    Columns beyond the members move by the same gains, two observations at a time; gains (p + 1,) is a working array.
    """
    members, columns = Y.shape[1], D.shape[1]
    for r in range(first, first + rows):
        centre, gains[p] = E[r, 0], 0.0
        for i in range(0, p, 2):
            j, one, two = min(i + 1, p - 1), 0.0, 0.0
            for e in range(members):
                one += (E[r, e] - centre) * Y[i, e]
                two += (E[r, e] - centre) * Y[j, e]
            gains[i] = one / (members - 1)
            if j > i:
                gains[j] = two / (members - 1)
        for i in range(0, p, 2):
            j, one, two = min(i + 1, p - 1), gains[i], gains[i + 1]
            for e in range(columns):
                E[r, e] += one * D[i, e] + two * D[j, e]


@jit
def fill_gaussian(rng, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with standard normal draws of a numpy.random.Generator."""
    for i in range(out.size):
        out[i] = rng.standard_normal()


@jit
def fill_three_point(counter, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with -sqrt(3), 0, sqrt(3), of probabilities 1/6, 2/3, 1/6, four from each 64 random bits.

    They match the Gaussian's first five moments, which is all that a covariance and its sampling error see. The bits
    are a counter (1,) and a hash (SplitMix64; Steele, Lea, Flood 2014), which the compiler makes side by side: .5 of
    the time of those of numpy.random.Generator, with which a run takes 1.3 times as long.
    """
    bits, root = np.empty((out.size + 3) // 4, dtype=np.uint64), 3.0**0.5
    for i in range(bits.size):
        x = counter[0] + np.uint64(0x9E3779B97F4A7C15) * np.uint64(i + 1)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        bits[i] = x ^ (x >> np.uint64(31))
    counter[0] += np.uint64(0x9E3779B97F4A7C15) * np.uint64(bits.size)
    for lane in range(4):
        values = out[lane * bits.size:(lane + 1) * bits.size]
        for i in range(values.size):
            v = np.int64((bits[i] >> np.uint64(16 * lane)) & np.uint64(0xFFFF))
            values[i] = (root if v >= 54613 else 0.0) - (root if v < 10923 else 0.0)
