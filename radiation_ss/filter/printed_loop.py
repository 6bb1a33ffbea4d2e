"""The paper's filter's loop, compiled: what `printed` does, to rounding; that is the version to read.

Both analyses, perturbed and square-root, come to one form: each row of the ensemble moves by g D. Rows D, shape
(p, members), are what the members see of the innovations; g solves a small system whose right-hand side is the row's
covariance with the predicted observations. So a row is read once for the covariances and once to move it, and the mean
and spread that are handed out are taken on the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.draws import fill_gaussian, fill_three_point
from radiation_ss.filter.kernels import Scratch, combine, moments, net_force, project, rk4
from radiation_ss.filter.single import LARGEST, rk4_single, working_space
from radiation_ss.jit import jit


class Work(NamedTuple):
    """Working arrays of one analysis of up to p observations and as many rows as the larger ensemble has."""

    Y: FloatArray      # (p, members): predictions, then their anomalies
    D: FloatArray      # (p, members): what the members see of the innovations
    S: FloatArray      # (p, p)
    G: FloatArray      # (p, rows)
    seen: FloatArray   # (p, 3): innovation, standard deviation, a sum
    place: np.ndarray  # (p,): row of draws


@jit(inner=True)
def perturb(E, first, std, draws, row):  # type: ignore[no-untyped-def]
    """Add noise of the given standard deviations to rows of E from `first` on, by rows of draws from `row` on."""
    for i in range(std.size):
        r, k, s = first + i, row + i, std[i]
        for e in range(E.shape[1]):
            E[r, e] += s * draws[k, e]


@jit(inner=True)
def gather(work, y, std, row):  # type: ignore[no-untyped-def]
    """Turn predictions of what is there of y into anomalies, moved to the front; row is the first of their draws.

    Return the squared normalised innovations and how many there are.
    """
    Y = work.Y
    p, nis, members = 0, 0.0, Y.shape[1]
    for c in range(y.size):
        if np.isfinite(y[c]):
            mean, spread = moments(Y, c, members)
            innovation = y[c] - mean
            nis += innovation * innovation / (spread + std[c] * std[c])
            work.seen[p, 0], work.seen[p, 1], work.place[p] = innovation, std[c], row + c
            for e in range(members):
                Y[p, e] = Y[c, e] - mean
            p += 1
    return nis, p


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
def product(A, i, B, j):  # type: ignore[no-untyped-def]
    """Return the sum over members of a row of A times a row of B."""
    total = 0.0
    for e in range(A.shape[1]):
        total += A[i, e] * B[j, e]
    return total


@jit(inner=True)
def prepare_perturbed(work, p, draws):  # type: ignore[no-untyped-def]
    """Write perturbed innovations D and the factor S of cov(Y) + cov(perturbations) (31)-(33)."""
    Y, D, S, seen, place = work.Y, work.D, work.S, work.seen, work.place
    members = Y.shape[1]
    for i in range(p):
        k, innovation, s, total = place[i], seen[i, 0], seen[i, 1], 0.0
        for e in range(members):
            D[i, e] = innovation + s * draws[k, e] - Y[i, e]
            total += draws[k, e]
        seen[i, 2] = total
        for j in range(i + 1):
            noise = product(draws, k, draws, place[j]) - total * seen[j, 2] / members
            S[i, j] = (product(Y, i, Y, j) + s * seen[j, 1] * noise) / (members - 1)
    factor(S, p)


@jit(inner=True)
def prepare_root(work, p):  # type: ignore[no-untyped-def]
    """Write D and S of the serial square root: an observation moves the predictions of those after it, too."""
    Y, D, S, seen = work.Y, work.D, work.S, work.seen
    members = Y.shape[1]
    for i in range(p):
        for k in range(i):
            gain = product(Y, i, Y, k) / (members - 1) / S[k, k]
            for e in range(members):
                Y[i, e] += gain * (D[k, e] - seen[k, 0])
            seen[i, 0] -= gain * seen[k, 0]
        for k in range(i):
            S[i, k] = seen[k, 2] * product(Y, i, Y, k) / (members - 1)
        variance = seen[i, 1] * seen[i, 1]
        S[i, i] = product(Y, i, Y, i) / (members - 1) + variance
        shrink, innovation = 1.0 / (1.0 + np.sqrt(variance / S[i, i])), seen[i, 0]
        seen[i, 2] = shrink
        for e in range(members):
            D[i, e] = innovation - shrink * Y[i, e]


@jit(inner=True)
def covariances(E, first, rows, work, p):  # type: ignore[no-untyped-def]
    """Write the covariances of the anomalies Y with rows of E from `first` on, two of Y at a time."""
    Y, G, members = work.Y, work.G, work.Y.shape[1]
    for r in range(rows):
        k = first + r
        centre = E[k, 0]
        for i in range(0, p, 2):
            j, one, two = min(i + 1, p - 1), 0.0, 0.0
            for e in range(members):
                one += (E[k, e] - centre) * Y[i, e]
                two += (E[k, e] - centre) * Y[j, e]
            G[i, r], G[j, r] = one / (members - 1), two / (members - 1)


@jit(inner=True)
def solve(S, p, G, rows, perturbed):  # type: ignore[no-untyped-def]
    """Write S^-1 G over G, shape (p, rows): S factored where perturbed, itself triangular where not."""
    for i in range(p):
        for k in range(i):
            for r in range(rows):
                G[i, r] -= S[i, k] * G[k, r]
        scale = 1.0 / S[i, i]
        for r in range(rows):
            G[i, r] *= scale
    for i in range(p - 1 if perturbed else -1, -1, -1):
        for k in range(i + 1, p):
            for r in range(rows):
                G[i, r] -= S[k, i] * G[k, r]
        scale = 1.0 / S[i, i]
        for r in range(rows):
            G[i, r] *= scale


@jit(inner=True)
def correct(E, first, rows, work, p, perturbed):  # type: ignore[no-untyped-def]
    """Assimilate p observations into rows of E from `first` on (34), two observations at a time."""
    covariances(E, first, rows, work, p)
    solve(work.S, p, work.G, rows, perturbed)
    D, G = work.D, work.G
    for r in range(rows):
        k = first + r
        for i in range(0, p, 2):
            j, one = min(i + 1, p - 1), G[i, r]
            two = G[j, r] if j > i else 0.0
            for e in range(D.shape[1]):
                E[k, e] += one * D[i, e] + two * D[j, e]


@jit(inner=True)
def inflate(E, rows, factor):  # type: ignore[no-untyped-def]
    """Multiply the spread of the first rows of E about their means by a factor."""
    for r in range(rows):
        mean = moments(E, r, E.shape[1])[0]
        for e in range(E.shape[1]):
            E[r, e] = mean + factor * (E[r, e] - mean)


@jit(inner=True)
def assimilate_force(plan, z, y, std, work, draws, perturbed):  # type: ignore[no-untyped-def]
    """Correct the force, the last n rows of z, by the acceleration; return NIS and number of channels."""
    n = plan.inverse.shape[0]
    base = z.shape[0] - n
    net_force(plan, z, z, base, 1, work.D)
    for i in range(n):
        combine(plan.inverse, i, work.D, 0, work.Y, i)
    nis, p = gather(work, y, std, draws.shape[0] - n)
    if perturbed:
        prepare_perturbed(work, p, draws)
    else:
        prepare_root(work, p)
    correct(z, base, n, work, p, perturbed)
    return nis, p


@jit(inner=True)
def assimilate_motion(ensembles, constraint, y, std, work, draws, row, variant):  # type: ignore[no-untyped-def]
    """Correct state and parameters by displacement, velocity and points; return NIS and number of channels."""
    theta, z, points = ensembles.theta, ensembles.z, constraint.y.size
    n = (y.size - points) // 2
    base = z.shape[0] - n
    for c in range(2 * n):
        for e in range(z.shape[1]):
            work.Y[c, e] = z[base - 2 * n + c, e]
    for c in range(points):
        project(constraint.H, c, theta, work.Y, 2 * n + c)
    nis, p = gather(work, y, std, row)
    if variant.perturbed:
        prepare_perturbed(work, p, draws)
    else:
        prepare_root(work, p)
    correct(theta, 0, theta.shape[0], work, p, variant.perturbed)
    correct(z, 0, base, work, p, variant.perturbed)
    if variant.inflation != 1.0:
        inflate(theta, theta.shape[0], variant.inflation)
        inflate(z, base, variant.inflation)
    return nis, p - points


@jit(inner=True)
def report(E, first, mean, std, t):  # type: ignore[no-untyped-def]
    """Write means and standard deviations of rows of E from `first` on."""
    for i in range(mean.shape[1]):
        middle, variance = moments(E, first + i, E.shape[1])
        mean[t, i], std[t, i] = middle, np.sqrt(variance)


@jit
def printed_loop(plan, ensembles, noise, constraint, variant, generator, samples, out):  # type: ignore[no-untyped-def]
    """Run the paper's filter over samples (nt, 3 n)."""
    theta, z = ensembles
    n, m, members, n_theta = plan.inverse.shape[0], plan.m, theta.shape[1], theta.shape[0]
    base, p = m + 2 * n, noise.motion.size
    motion, force, system = z[:base], z[base:], n_theta + base + n
    draws = np.empty((system + (p + n if variant.perturbed else 0), members))
    flat, none = draws.reshape(draws.size), np.empty((0, 2, 2))
    scratch = Scratch(np.empty((2, base, members)), np.empty((n, members)))
    work = Work(np.empty((p, members)), np.empty((p, members)), np.empty((p, p)), np.empty((p, n_theta + base)),
                np.empty((p, 3)), np.empty(p, dtype=np.int64))
    y = np.empty(p)
    single, space = plan.pairs.shape[0] == 1 and n == 1 and m <= LARGEST, working_space(m)
    for c in range(2 * n, p):
        y[c] = constraint.y[c - 2 * n]
    for t in range(samples.y.shape[0]):
        if variant.three_point:
            fill_three_point(generator, flat)
        else:
            fill_gaussian(generator, flat)
        for _ in range(samples.steps[t]):
            dt = samples.dts[t] / samples.steps[t]
            if single:
                rk4_single(plan, theta, motion, force, dt, space)
            else:
                rk4(plan, none, theta, motion, force, dt, scratch)
        perturb(theta, 0, noise.theta, draws, 0)
        perturb(z, 0, noise.state, draws, n_theta)
        perturb(z, base, noise.force, draws, n_theta + base)
        for c in range(2 * n):
            y[c] = samples.y[t, c]
        last = samples.y[t, 2 * n:]
        if variant.force_first:
            nis, used = assimilate_force(plan, z, last, noise.acceleration, work, draws, variant.perturbed)
        more, count = assimilate_motion(ensembles, constraint, y, noise.motion, work, draws, system, variant)
        if not variant.force_first:
            nis, used = assimilate_force(plan, z, last, noise.acceleration, work, draws, variant.perturbed)
        report(theta, 0, out.theta, out.theta_std, t)
        report(z, base, out.force, out.force_std, t)
        out.nis[t], out.used[t] = nis + more, used + count
