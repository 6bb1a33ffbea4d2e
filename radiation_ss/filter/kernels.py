"""What the compiled loops share: Runge-Kutta steps, moments, the Kalman filter's predict and update in place.

Members are columns, so every inner loop runs along contiguous memory; arrays are indexed in two dimensions rather than
row by row, because a view of a row costs as much as the arithmetic on it.
"""

from __future__ import annotations

from typing import NamedTuple

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit


class Scratch(NamedTuple):
    """Working arrays of `rk4`."""

    buffers: FloatArray  # (2, rows, members)
    net: FloatArray      # (n, members)


@jit(inner=True)
def net_force(plan, z, f, first, gap, net):  # type: ignore[no-untyped-def]
    """Write excitation minus restoring, damping and radiation force; the force of dof i is row first + gap i of f."""
    n, m, members = plan.inverse.shape[0], plan.m, z.shape[1]
    for i in range(n):
        row, x, v, c, d = first + gap * i, m + i, m + n + i, plan.stiffness[i, i], plan.damping[i, i]
        for e in range(members):
            net[i, e] = f[row, e] - c * z[x, e] - d * z[v, e]
        for j in range(n):
            c, d = plan.stiffness[i, j], plan.damping[i, j]
            if j != i and (c != 0.0 or d != 0.0):
                x, v = m + j, m + n + j
                for e in range(members):
                    net[i, e] -= c * z[x, e] + d * z[v, e]
    for p in range(plan.pairs.shape[0]):
        i, y = plan.pairs[p, 0], plan.pairs[p, 3] + plan.pairs[p, 4] - 1
        for e in range(members):
            net[i, e] -= z[y, e]


@jit(inner=True)
def combine(weights, i, source, first, out, row):  # type: ignore[no-untyped-def]
    """Write row i of weights, times rows of source from `first` on, into a row of out."""
    members, w = out.shape[1], weights[i, 0]
    for e in range(members):
        out[row, e] = w * source[first, e]
    for j in range(1, weights.shape[1]):
        w, k = weights[i, j], first + j
        if w != 0.0:
            for e in range(members):
                out[row, e] += w * source[k, e]


@jit(inner=True)
def reach(z, h, weights, i, source, first, new, row):  # type: ignore[no-untyped-def]
    """Write a row of z, plus h times row i of weights times rows of source from `first` on, into that row of new."""
    members, w = new.shape[1], h * weights[i, 0]
    for e in range(members):
        new[row, e] = z[row, e] + w * source[first, e]
    for j in range(1, weights.shape[1]):
        w, k = h * weights[i, j], first + j
        if w != 0.0:
            for e in range(members):
                new[row, e] += w * source[k, e]


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
def rk4(plan, force, theta, z, held, dt, scratch):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place.

    The rate G is affine in z, and there the classical step is z + h G(z + h/2 G(z + h/3 G(z + h/4 G(z)))): the Taylor
    series to h^4 by Horner's rule, half the traffic of the usual form. The force is part of z and moves by the force
    model `force` (n, 2, 2), or it is `held` where there is no model.
    """
    buffers, net, n, m = scratch.buffers, scratch.net, plan.inverse.shape[0], plan.m
    base = m + 2 * n
    for at in range(4):
        h, new, t = dt / (4 - at), buffers[at % 2], z if at == 0 else buffers[1 - at % 2]
        reach_radiation(plan, theta, z, h, t, new)
        if force.shape[0]:
            net_force(plan, t, t, base, 2, net)
        else:
            net_force(plan, t, held, 0, 1, net)
        for i in range(n):
            x, v = m + i, m + n + i
            for e in range(z.shape[1]):
                new[x, e] = z[x, e] + h * t[v, e]
            reach(z, h, plan.inverse, i, net, 0, new, v)
        for i in range(force.shape[0]):
            f = base + 2 * i
            reach(z, h, force[i], 0, t, f, new, f)
            reach(z, h, force[i], 1, t, f, new, f + 1)
    for r in range(buffers.shape[1]):
        for e in range(z.shape[1]):
            z[r, e] = buffers[1, r, e]


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
def project(weights, c, z, out, row):  # type: ignore[no-untyped-def]
    """Write row c of weights, times z, into a row of out, skipping the zeros."""
    columns = z.shape[1]
    for e in range(columns):
        out[row, e] = 0.0
    for r in range(weights.shape[1]):
        w = weights[c, r]
        if w != 0.0:
            for e in range(columns):
                out[row, e] += w * z[r, e]


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
def correct(h, r, y, z, P, predicted, gain):  # type: ignore[no-untyped-def]
    """Move every column of z, and P, by one channel (`kalman.update`); return the innovation's variance."""
    size, columns = z.shape[0], z.shape[1]
    s = r
    for i in range(size):
        gain[i] = 0.0
        for j in range(size):
            gain[i] += P[i, j] * h[j]
        s += h[i] * gain[i]
    for i in range(size):
        k = gain[i] / s
        for e in range(columns):
            z[i, e] += k * (y - predicted[0, e])
        for j in range(size):
            P[i, j] -= k * gain[j]
    return s


@jit(inner=True)
def symmetrise(P):  # type: ignore[no-untyped-def]
    """Write (P + P') / 2 over P."""
    for i in range(P.shape[0]):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
