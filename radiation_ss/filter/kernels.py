"""What both compiled filters do: Runge-Kutta steps, moments, projections, the square root of one observation.

Members are columns, so every inner loop runs along contiguous memory; arrays are indexed in two dimensions rather than
row by row, because a view of a row costs as much as the arithmetic on it.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.jit import jit


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
def reach_memory(pairs, v, theta, z, h, t, new):  # type: ignore[no-untyped-def]
    """Write all radiation states of z plus h times their rate (5) at t into new; v is the velocities' first row."""
    members = z.shape[1]
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
def rk4(pairs, inverse, stiffness, damping, m, force, theta, z, held, dt, buffers, net):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place; `buffers` (2, rows, members) is scratch.

    The rate G is affine in z, and there the classical step is z + h G(z + h/2 G(z + h/3 G(z + h/4 G(z)))): the Taylor
    series to h^4 by Horner's rule, half the traffic of the usual form. The force is part of z and moves by the force
    model `force` (n, 2, 2), or it is `held` where there is no model.
    """
    n = inverse.shape[0]
    base = m + 2 * n
    for at in range(4):
        h, new, t = dt / (4 - at), buffers[at % 2], z if at == 0 else buffers[1 - at % 2]
        reach_memory(pairs, m + n, theta, z, h, t, new)
        if force.shape[0]:
            net_force(pairs, stiffness, damping, m, t, t, base, 2, net)
        else:
            net_force(pairs, stiffness, damping, m, t, held, 0, 1, net)
        for i in range(n):
            x, v = m + i, m + n + i
            for e in range(z.shape[1]):
                new[x, e] = z[x, e] + h * t[v, e]
            reach(z, h, inverse, i, net, 0, new, v)
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
