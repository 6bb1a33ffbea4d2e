"""What both compiled filters do: Runge-Kutta steps, moments, projections, the square root of one observation.

Members are columns, so every inner loop runs along contiguous memory; arrays are indexed in two dimensions rather than
row by row, because a view of a row costs as much as the arithmetic on it.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.jit import jit


@jit(inner=True)
def net_force(pairs, stiffness, damping, m, z, f, first, gap, net):  # type: ignore[no-untyped-def]
    """Write exciting minus restoring, damping and memory force; the force of dof i is row first + gap i of f."""
    n, members = net.shape[0], z.shape[1]
    for i in range(n):
        row, x, v, c, d = first + gap * i, m + i, m + n + i, stiffness[i, i], damping[i, i]
        for e in range(members):
            net[i, e] = f[row, e] - c * z[x, e] - d * z[v, e]
        for j in range(n):
            if j != i and (stiffness[i, j] != 0.0 or damping[i, j] != 0.0):
                x, v, c, d = m + j, m + n + j, stiffness[i, j], damping[i, j]
                for e in range(members):
                    net[i, e] -= c * z[x, e] + d * z[v, e]
    for p in range(pairs.shape[0]):
        i, y = pairs[p, 0], pairs[p, 3] + pairs[p, 4] - 1
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
def memory_rate(pairs, v, theta, z, rate):  # type: ignore[no-untyped-def]
    """Write the rate of all radiation states (5); v is the velocities' first row."""
    members = z.shape[1]
    for p in range(pairs.shape[0]):
        at, order = pairs[p, 3], pairs[p, 4]
        u, y, a, b = v + pairs[p, 1], at + order - 1, pairs[p, 2], pairs[p, 2] + order
        for e in range(members):
            rate[at, e] = theta[b, e] * z[u, e] - theta[a, e] * z[y, e]
        for i in range(1, order):
            k, before, a_i, b_i = at + i, at + i - 1, a + i, b + i
            for e in range(members):
                rate[k, e] = z[before, e] + theta[b_i, e] * z[u, e] - theta[a_i, e] * z[y, e]


@jit(inner=True)
def rk4(pairs, inverse, stiffness, damping, m, force, theta, z, held, dt, buffers, net):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place; `buffers` (3, rows, members) is scratch.

    The force is part of z and moves by the force model `force` (n, 2, 2), or it is `held` where there is no model.
    """
    n, rate, new, total = inverse.shape[0], buffers[0], buffers[1], buffers[2]
    base, rows, members = m + 2 * n, rate.shape[0], rate.shape[1]
    for at in range(4):
        source = z if at == 0 else new
        memory_rate(pairs, m + n, theta, source, rate)
        if force.shape[0]:
            net_force(pairs, stiffness, damping, m, source, source, base, 2, net)
        else:
            net_force(pairs, stiffness, damping, m, source, held, 0, 1, net)
        for i in range(n):
            x, v = m + i, m + n + i
            for e in range(members):
                rate[x, e] = source[v, e]
            combine(inverse, i, net, 0, rate, v)
        for i in range(force.shape[0]):
            f = base + 2 * i
            combine(force[i], 0, source, f, rate, f)
            combine(force[i], 1, source, f, rate, f + 1)
        share = dt / 6.0 if at == 0 or at == 3 else dt / 3.0
        reach = dt if at == 2 else 0.5 * dt
        for r in range(rows):
            if at == 0:
                for e in range(members):
                    total[r, e] = z[r, e] + share * rate[r, e]
                    new[r, e] = z[r, e] + reach * rate[r, e]
            elif at < 3:
                for e in range(members):
                    total[r, e] += share * rate[r, e]
                    new[r, e] = z[r, e] + reach * rate[r, e]
            else:
                for e in range(members):
                    z[r, e] = total[r, e] + share * rate[r, e]


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
def regress(E, first, Y, y, mean, spread, variance, innovation):  # type: ignore[no-untyped-def]
    """Move rows of E from `first` on by the square root of one scalar observation.

    Row y of Y holds the predicted observation, of the given mean over members; a column of E that is no member
    (the control) moves by the shift alone.
    """
    members, total = Y.shape[1], spread + variance
    shrink = 1.0 / (1.0 + np.sqrt(variance / total))
    for r in range(first, E.shape[0]):
        covariance, centre = 0.0, E[r, 0]
        for e in range(members):
            covariance += (E[r, e] - centre) * (Y[y, e] - mean)
        gain = covariance / (members - 1) / total
        shift, cut = gain * innovation, gain * shrink
        for e in range(members):
            E[r, e] += shift - cut * (Y[y, e] - mean)
        if E.shape[1] > members:
            E[r, members] += shift
