"""The paper's filter's loop, compiled: what `printed` does, to rounding; that is the version to read."""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.draws import fill_gaussian, fill_three_point
from radiation_ss.filter.jit import jit
from radiation_ss.filter.kernels import combine, moments, net_force, project, regress, rk4

GAUSSIAN, THREE_POINT = 0, 1


@jit(inner=True)
def perturb(E, first, std, draws, row):  # type: ignore[no-untyped-def]
    """Add noise of the given standard deviations to rows of E from `first` on, by rows of draws from `row` on."""
    for i in range(std.size):
        r, k, s = first + i, row + i, std[i]
        for e in range(E.shape[1]):
            E[r, e] += s * draws[k, e]


@jit(inner=True)
def factor(S, p):  # type: ignore[no-untyped-def]
    """Write the Cholesky factor of the leading p x p block into its lower triangle."""
    for i in range(p):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(total) if i == j else total / S[j, j]


@jit(inner=True)
def whiten(S, p, D):  # type: ignore[no-untyped-def]
    """Write S^-1 D over the first p rows of D, with S factored."""
    members = D.shape[1]
    for i in range(p):
        for k in range(i):
            w = S[i, k]
            for e in range(members):
                D[i, e] -= w * D[k, e]
        w = 1.0 / S[i, i]
        for e in range(members):
            D[i, e] *= w
    for i in range(p - 1, -1, -1):
        for k in range(i + 1, p):
            w = S[k, i]
            for e in range(members):
                D[i, e] -= w * D[k, e]
        w = 1.0 / S[i, i]
        for e in range(members):
            D[i, e] *= w


@jit(inner=True)
def differences(Y, p, y, std, draws, first, D, W):  # type: ignore[no-untyped-def]
    """Write perturbed innovations D and anomalies W of the perturbations; turn Y into anomalies."""
    members = Y.shape[1]
    for i in range(p):
        k, s, observed = first + i, std[i], y[i]
        mean, middle = moments(Y, i, members)[0], moments(draws, k, members)[0]
        for e in range(members):
            D[i, e] = observed + s * draws[k, e] - Y[i, e]
            W[i, e] = s * (draws[k, e] - middle)
            Y[i, e] -= mean


@jit(inner=True)
def covariance_of(Y, W, p, S):  # type: ignore[no-untyped-def]
    """Write the lower triangle of cov(Y) + cov(W), both anomalies (31)-(33)."""
    members = Y.shape[1]
    for i in range(p):
        for j in range(i + 1):
            total = 0.0
            for e in range(members):
                total += Y[i, e] * Y[j, e] + W[i, e] * W[j, e]
            S[i, j] = total / (members - 1)


@jit(inner=True)
def regress_all(E, first, rows, Y, D, p, gain):  # type: ignore[no-untyped-def]
    """Add cov(E, Y) D to rows of E, two observations at a time (34); Y holds anomalies."""
    members = Y.shape[1]
    for r in range(first, first + rows):
        centre = E[r, 0]
        for i in range(0, p, 2):
            j, one, two = min(i + 1, p - 1), 0.0, 0.0
            for e in range(members):
                one += (E[r, e] - centre) * Y[i, e]
                two += (E[r, e] - centre) * Y[j, e]
            gain[i], gain[i + 1] = one / (members - 1), two / (members - 1)
        for i in range(0, p, 2):
            j, one = min(i + 1, p - 1), gain[i]
            two = gain[i + 1] if i + 1 < p else 0.0
            for e in range(members):
                E[r, e] += one * D[i, e] + two * D[j, e]


@jit(inner=True)
def gather(Y, y, std, draws, first, kept, kept_std):  # type: ignore[no-untyped-def]
    """Move what is there of y, and its rows, to the front; return its squared normalised innovations and how many."""
    p, nis, members = 0, 0.0, Y.shape[1]
    for c in range(y.size):
        if np.isfinite(y[c]):
            mean, spread = moments(Y, c, members)
            nis += (y[c] - mean) ** 2 / (spread + std[c] ** 2)
            kept[p], kept_std[p] = y[c], std[c]
            if p < c:
                for e in range(members):
                    Y[p, e] = Y[c, e]
                if first + c < draws.shape[0]:
                    for e in range(members):
                        draws[first + p, e] = draws[first + c, e]
            p += 1
    return nis, p


@jit(inner=True)
def analyse(E, top, rows, other, Y, p, y, std, draws, first, perturbed, scratch, S):  # type: ignore[no-untyped-def]
    """Assimilate p observations y, predicted by Y (used up), into `rows` rows of E from `top` on and into `other`."""
    D, W = scratch[0], scratch[1]
    if perturbed:
        differences(Y, p, y, std, draws, first, D, W)
        covariance_of(Y, W, p, S)
        factor(S, p)
        whiten(S, p, D)
        regress_all(E, top, rows, Y, D, p, S[p])
        regress_all(other, 0, other.shape[0], Y, D, p, S[p])
        return
    for i in range(p):
        mean, spread = moments(Y, i, Y.shape[1])
        regress(E[:top + rows], top, Y, i, mean, spread, std[i] * std[i], y[i] - mean)
        regress(other, 0, Y, i, mean, spread, std[i] * std[i], y[i] - mean)
        regress(Y[:p], i + 1, Y, i, mean, spread, std[i] * std[i], y[i] - mean)


@jit(inner=True)
def report_printed(theta, z, base, t, out):  # type: ignore[no-untyped-def]
    """Write means and standard deviations of one sample."""
    force, std, mean, spread = out
    for i in range(force.shape[1]):
        middle, variance = moments(z, base + i, z.shape[1])
        force[t, i], std[t, i] = middle, np.sqrt(variance)
    for p in range(theta.shape[0]):
        middle, variance = moments(theta, p, theta.shape[1])
        mean[t, p], spread[t, p] = middle, np.sqrt(variance)


@jit(inner=True)
def inflate(E, rows, factor):  # type: ignore[no-untyped-def]
    """Multiply the spread of the first rows of E about their means by a factor."""
    for r in range(rows):
        mean = moments(E, r, E.shape[1])[0]
        for e in range(E.shape[1]):
            E[r, e] = mean + factor * (E[r, e] - mean)


@jit
def printed_loop(plant, theta, z, noise, H, pseudo, state, kind, perturbed, inflation,  # type: ignore[no-untyped-def]
                 Y, dts, steps, out, nis, used):
    """Run the paper's filter over samples Y (nt, 3 n); the last n rows of z are the force ensemble."""
    pairs, inverse, stiffness, damping = plant
    on_theta, on_state, on_force, on_motion, on_acceleration = noise
    n, members, n_theta = inverse.shape[0], theta.shape[1], theta.shape[0]
    base, p = z.shape[0] - n, on_motion.size
    m, motion, force = base - 2 * n, z[:base], z[base:]
    system = n_theta + base + n
    draws = np.empty((system + (p + n if perturbed else 0), members))
    flat, none, nobody = draws.reshape(draws.size), np.empty((0, 2, 2)), np.empty((0, members))
    buffers, net, scratch = np.empty((3, base, members)), np.empty((n, members)), np.empty((2, p, members))
    predicted, S = np.empty((p, members)), np.empty((p + 1, p + 2))
    y, kept, kept_std = np.empty(p), np.empty(p), np.empty(p)
    for c in range(2 * n, p):
        y[c] = pseudo[c - 2 * n]
    for t in range(Y.shape[0]):
        if kind == THREE_POINT:
            fill_three_point(state, flat)
        else:
            fill_gaussian(state, flat)
        for _ in range(steps[t]):
            rk4(pairs, inverse, stiffness, damping, m, none, theta, motion, force, dts[t] / steps[t], buffers, net)
        perturb(theta, 0, on_theta, draws, 0)
        perturb(z, 0, on_state, draws, n_theta)
        for c in range(2 * n):
            y[c] = Y[t, c]
            for e in range(members):
                predicted[c, e] = z[m + c, e]
        for c in range(2 * n, p):
            project(H, c - 2 * n, theta, predicted, c)
        nis[t], there = gather(predicted, y, on_motion, draws, system, kept, kept_std)
        analyse(z, 0, base, theta, predicted, there, kept, kept_std, draws, system, perturbed, scratch, S)
        if inflation != 1.0:
            inflate(theta, n_theta, inflation)
            inflate(z, base, inflation)
        perturb(z, base, on_force, draws, n_theta + base)
        net_force(pairs, stiffness, damping, m, z, z, base, 1, net)
        for i in range(n):
            combine(inverse, i, net, 0, predicted, i)
        more, count = gather(predicted, Y[t, 2 * n:], on_acceleration, draws, system + p, kept, kept_std)
        analyse(z, base, n, nobody, predicted, count, kept, kept_std, draws, system + p, perturbed, scratch, S)
        nis[t] += more
        used[t] = there + count - (p - 2 * n)
        report_printed(theta, z, base, t, out)
