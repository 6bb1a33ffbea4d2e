"""The paper's filter's loop, compiled: what `printed` does, to rounding; that is the version to read.

Both analyses, perturbed and square-root, come to one form: each row of the ensemble moves by g D. Rows D, shape
(p, members), are what the members see of the innovations; g solves a small system whose right-hand side is the row's
covariance with the predicted observations. So a row is read once for the covariances and once to move it, and the mean
and spread that are handed out are taken on the way.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.draws import fill_gaussian, fill_three_point
from radiation_ss.filter.kernels import combine, moments, net_force, project, rk4
from radiation_ss.filter.single import LARGEST, STRIDE, rk4_single
from radiation_ss.jit import jit

GAUSSIAN, THREE_POINT = 0, 1


@jit(inner=True)
def perturb(E, first, std, draws, row):  # type: ignore[no-untyped-def]
    """Add noise of the given standard deviations to rows of E from `first` on, by rows of draws from `row` on."""
    for i in range(std.size):
        r, k, s = first + i, row + i, std[i]
        for e in range(E.shape[1]):
            E[r, e] += s * draws[k, e]


@jit(inner=True)
def gather(Y, y, std, row, seen, place):  # type: ignore[no-untyped-def]
    """Turn predictions Y of what is there of y into anomalies, moved to the front.

    Innovations and standard deviations go to `seen`, the numbers of rows of draws, counted from `row`, to `place`.
    Return the squared normalised innovations and how many there are.
    """
    p, nis, members = 0, 0.0, Y.shape[1]
    for c in range(y.size):
        if np.isfinite(y[c]):
            mean, spread = moments(Y, c, members)
            innovation = y[c] - mean
            nis += innovation * innovation / (spread + std[c] * std[c])
            seen[p, 0], seen[p, 1], place[p] = innovation, std[c], row + c
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
def prepare_perturbed(Y, p, seen, place, draws, D, S):  # type: ignore[no-untyped-def]
    """Write perturbed innovations D and the factor S of cov(Y) + cov(perturbations) (31)-(33)."""
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
def prepare_root(Y, p, seen, D, S):  # type: ignore[no-untyped-def]
    """Write D and S of the serial square root: an observation moves the predictions of those after it, too."""
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
def prepare(Y, p, seen, place, draws, D, S, perturbed):  # type: ignore[no-untyped-def]
    """Write D and S of either analysis."""
    if perturbed:
        prepare_perturbed(Y, p, seen, place, draws, D, S)
    else:
        prepare_root(Y, p, seen, D, S)


@jit(inner=True)
def covariances(E, first, rows, Y, p, G):  # type: ignore[no-untyped-def]
    """Write the covariances of the anomalies Y with rows of E from `first` on, two of Y at a time."""
    members = Y.shape[1]
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
def move(E, first, rows, D, p, G):  # type: ignore[no-untyped-def]
    """Add G' D to rows of E from `first` on, two observations at a time."""
    for r in range(rows):
        k = first + r
        for i in range(0, p, 2):
            j, one = min(i + 1, p - 1), G[i, r]
            two = G[j, r] if j > i else 0.0
            for e in range(D.shape[1]):
                E[k, e] += one * D[i, e] + two * D[j, e]


@jit(inner=True)
def correct(E, first, rows, Y, D, p, S, G, perturbed):  # type: ignore[no-untyped-def]
    """Assimilate p observations into rows of E from `first` on (34)."""
    covariances(E, first, rows, Y, p, G)
    solve(S, p, G, rows, perturbed)
    move(E, first, rows, D, p, G)


@jit(inner=True)
def report(E, first, mean, std, t):  # type: ignore[no-untyped-def]
    """Write means and standard deviations of rows of E from `first` on."""
    for i in range(mean.shape[1]):
        middle, variance = moments(E, first + i, E.shape[1])
        mean[t, i], std[t, i] = middle, np.sqrt(variance)


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
    force_mean, force_std, theta_mean, theta_std = out
    n, members, n_theta = inverse.shape[0], theta.shape[1], theta.shape[0]
    base, p = z.shape[0] - n, on_motion.size
    m, motion, force = base - 2 * n, z[:base], z[base:]
    system = n_theta + base + n
    draws = np.empty((system + (p + n if perturbed else 0), members))
    flat, none = draws.reshape(draws.size), np.empty((0, 2, 2))
    buffers, net = np.empty((2, base, members)), np.empty((n, members))
    predicted, D = np.empty((p, members)), np.empty((p, members))
    S, G, seen, place = np.empty((p, p)), np.empty((p, n_theta + base)), np.empty((p, 3)), np.empty(p, dtype=np.int64)
    y, last = np.empty(p), np.empty(n)
    single, work = pairs.shape[0] == 1 and n == 1 and m <= LARGEST, np.empty((3 * m + 3) * STRIDE)
    for c in range(2 * n, p):
        y[c] = pseudo[c - 2 * n]
    for t in range(Y.shape[0]):
        if kind == THREE_POINT:
            fill_three_point(state, flat)
        else:
            fill_gaussian(state, flat)
        for _ in range(steps[t]):
            dt = dts[t] / steps[t]
            if single:
                rk4_single(m, inverse[0, 0], stiffness[0, 0], damping[0, 0], theta, motion, force, dt, work)
            else:
                rk4(pairs, inverse, stiffness, damping, m, none, theta, motion, force, dt, buffers, net)
        perturb(theta, 0, on_theta, draws, 0)
        perturb(z, 0, on_state, draws, n_theta)
        for c in range(2 * n):
            y[c] = Y[t, c]
            for e in range(members):
                predicted[c, e] = z[m + c, e]
        for c in range(2 * n, p):
            project(H, c - 2 * n, theta, predicted, c)
        nis[t], there = gather(predicted, y, on_motion, system, seen, place)
        prepare(predicted, there, seen, place, draws, D, S, perturbed)
        correct(theta, 0, n_theta, predicted, D, there, S, G, perturbed)
        correct(z, 0, base, predicted, D, there, S, G, perturbed)
        if inflation != 1.0:
            inflate(theta, n_theta, inflation)
            inflate(z, base, inflation)
        report(theta, 0, theta_mean, theta_std, t)
        perturb(z, base, on_force, draws, n_theta + base)
        net_force(pairs, stiffness, damping, m, z, z, base, 1, net)
        for i in range(n):
            combine(inverse, i, net, 0, predicted, i)
            last[i] = Y[t, 2 * n + i]
        more, count = gather(predicted, last, on_acceleration, system + p, seen, place)
        prepare(predicted, count, seen, place, draws, D, S, perturbed)
        correct(z, base, n, predicted, D, count, S, G, perturbed)
        report(z, base, force_mean, force_std, t)
        nis[t] += more
        used[t] = there + count - (p - 2 * n)
