"""The loops of both filters, compiled: members are columns, so every inner loop runs along contiguous memory.

They do what `marginal` and `printed` do, to rounding; those are the versions to read, and the tests compare.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.draws import fill_gaussian, fill_three_point
from radiation_ss.filter.jit import jit

PATIENCE = 50  # as in `marginal`
GAUSSIAN, THREE_POINT = 0, 1


@jit
def accelerate(pairs, inverse, stiffness, damping, m, z, f, gap, rate, at, work):  # type: ignore[no-untyped-def]
    """Write xi'' by the equation of motion into rows at .. at + n of rate; the force of dof i is row gap i of f."""
    n, members = inverse.shape[0], z.shape[1]
    for i in range(n):
        force, position, velocity, out = f[gap * i], z[m + i], z[m + n + i], work[i]
        c, d = stiffness[i, i], damping[i, i]
        for e in range(members):
            out[e] = force[e] - c * position[e] - d * velocity[e]
        for j in range(n):
            if j != i and (stiffness[i, j] != 0.0 or damping[i, j] != 0.0):
                position, velocity, c, d = z[m + j], z[m + n + j], stiffness[i, j], damping[i, j]
                for e in range(members):
                    out[e] -= c * position[e] + d * velocity[e]
    for p in range(pairs.shape[0]):
        out, y = work[pairs[p, 0]], z[pairs[p, 3] + pairs[p, 4] - 1]
        for e in range(members):
            out[e] -= y[e]
    for i in range(n):
        row, out, w = rate[at + i], work[0], inverse[i, 0]
        for e in range(members):
            row[e] = w * out[e]
        for j in range(1, n):
            out, w = work[j], inverse[i, j]
            if w != 0.0:
                for e in range(members):
                    row[e] += w * out[e]


@jit
def motion_rate(pairs, inverse, stiffness, damping, m, theta, z, f, gap, dz, work):  # type: ignore[no-untyped-def]
    """Write z' of radiation states, displacement and velocity (9), (16)."""
    n, members = inverse.shape[0], z.shape[1]
    for i in range(n):
        rate, velocity = dz[m + i], z[m + n + i]
        for e in range(members):
            rate[e] = velocity[e]
    for p in range(pairs.shape[0]):
        _, k, offset, at, order = pairs[p]
        u, y = z[m + n + k], z[at + order - 1]
        a, b, rate = theta[offset], theta[offset + order], dz[at]
        for e in range(members):
            rate[e] = b[e] * u[e] - a[e] * y[e]
        for i in range(1, order):
            a, b, rate, before = theta[offset + i], theta[offset + order + i], dz[at + i], z[at + i - 1]
            for e in range(members):
                rate[e] = before[e] + b[e] * u[e] - a[e] * y[e]
    accelerate(pairs, inverse, stiffness, damping, m, z, f, gap, dz, m + n, work)


@jit
def force_rate(force, base, z, dz):  # type: ignore[no-untyped-def]
    """Write the derivative of the force states (force, its rate) of each degree of freedom."""
    for i in range(force.shape[0]):
        f, g, df, dg, A = z[base + 2 * i], z[base + 2 * i + 1], dz[base + 2 * i], dz[base + 2 * i + 1], force[i]
        for e in range(z.shape[1]):
            df[e] = A[0, 0] * f[e] + A[0, 1] * g[e]
            dg[e] = A[1, 0] * f[e] + A[1, 1] * g[e]


@jit
def rk4(pairs, inverse, stiffness, damping, m, force, theta, z, held, dt, buffers, work):  # type: ignore[no-untyped-def]
    """Move all members by one Runge-Kutta step in place; `buffers` (3, rows, members) is scratch.

    The force is part of z and moves by the force model `force` (n, 2, 2), or it is `held` where there is no model.
    """
    rate, stage, total = buffers[0], buffers[1], buffers[2]
    base = m + 2 * inverse.shape[0]
    rows = base + 2 * force.shape[0]
    for at in range(4):
        source = z if at == 0 else stage
        if force.shape[0] == 0:
            motion_rate(pairs, inverse, stiffness, damping, m, theta, source, held, 1, rate, work)
        else:
            motion_rate(pairs, inverse, stiffness, damping, m, theta, source, source[base:], 2, rate, work)
            force_rate(force, base, source, rate)
        to_stage = 0.5 * dt if at < 2 else dt
        share = dt / 6.0 if at == 0 or at == 3 else dt / 3.0
        for r in range(rows):
            k, new, old, sums = rate[r], stage[r], z[r], total[r]
            if at == 0:
                for e in range(k.size):
                    sums[e] = old[e] + share * k[e]
                    new[e] = old[e] + to_stage * k[e]
            elif at < 3:
                for e in range(k.size):
                    sums[e] += share * k[e]
                    new[e] = old[e] + to_stage * k[e]
            else:
                for e in range(k.size):
                    old[e] = sums[e] + share * k[e]


@jit
def spread_of(row, members):  # type: ignore[no-untyped-def]
    """Return the sample variance of the first `members` values."""
    mean = 0.0
    for e in range(members):
        mean += row[e]
    mean /= members
    total = 0.0
    for e in range(members):
        total += (row[e] - mean) ** 2
    return total / (members - 1)


@jit
def project(h, z, out):  # type: ignore[no-untyped-def]
    """Write h z, skipping the zeros of h."""
    out[:] = 0.0
    for r in range(h.size):
        if h[r] != 0.0:
            w, row = h[r], z[r]
            for e in range(out.size):
                out[e] += w * row[e]


@jit
def regress(E, dh, members, spread, variance, innovation):  # type: ignore[no-untyped-def]
    """Move rows of E by the square root of one scalar observation; the control column moves by the same shift.

    dh holds the members' anomalies of the predicted observation.
    """
    total = spread + variance
    shrink = 1.0 / (1.0 + np.sqrt(variance / total))
    for r in range(E.shape[0]):
        row, covariance = E[r], 0.0
        for e in range(members):
            covariance += row[e] * dh[e]
        gain = covariance / (members - 1) / total
        if gain != 0.0:
            shift, cut = gain * innovation, gain * shrink
            for e in range(members):
                row[e] += shift - cut * dh[e]
            row[members] += shift


@jit
def transition(plant, force, theta, dt, F):  # type: ignore[no-untyped-def]
    """Write the matrix of one Runge-Kutta step for the control's parameters, the last column but one."""
    pairs, inverse, stiffness, damping = plant
    size, n, control = F.shape[0], inverse.shape[0], theta.shape[1] - 2
    columns = np.empty((theta.shape[0], size))
    for p in range(theta.shape[0]):
        columns[p, :] = theta[p, control]
    F[:] = 0.0
    for i in range(size):
        F[i, i] = 1.0
    rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, columns, F, F, dt,
        np.empty((3, size, size)), np.empty((n, size)))


@jit
def predict_covariance(F, P, FP, q, dt):  # type: ignore[no-untyped-def]
    """Write P = F (P + N) F' + N with half of the force's noise N on each side of the step."""
    base = P.shape[0] - q.size
    for i in range(q.size):
        P[base + i, base + i] += 0.5 * dt * q[i]
    np.dot(F, P, FP)
    np.dot(FP, F.T, P)
    for i in range(q.size):
        P[base + i, base + i] += 0.5 * dt * q[i]


@jit
def choose(H, r, gate, z, P, streak, y, predicted, use):  # type: ignore[no-untyped-def]
    """Write which channels to use, all judged against the prediction before any of them is taken."""
    members = z.shape[1] - 2
    for c in range(y.size):
        use[c] = np.isfinite(y[c])
        if not use[c]:
            continue
        project(H[c], z, predicted)
        total = r[c] + spread_of(predicted, members)
        for i in range(P.shape[0]):
            if H[c, i] != 0.0:
                for j in range(P.shape[0]):
                    total += H[c, i] * P[i, j] * H[c, j]
        if abs(y[c] - predicted[members]) > gate * np.sqrt(total) and streak[c] < PATIENCE:
            use[c] = False
            streak[c] += 1
        else:
            streak[c] = 0


@jit
def take(h, r, y, theta, z, P, learning, predicted, Ph, dh):  # type: ignore[no-untyped-def]
    """Assimilate one channel; return its squared normalised innovation."""
    size, members = z.shape[0], z.shape[1] - 2
    project(h, z, predicted)
    s = r
    for i in range(size):
        Ph[i] = 0.0
        for j in range(size):
            Ph[i] += P[i, j] * h[j]
        s += h[i] * Ph[i]
    spread, innovation = spread_of(predicted, members), y - predicted[members]
    for i in range(size):
        gain, row = Ph[i] / s, z[i]
        for e in range(row.size):
            row[e] += gain * (y - predicted[e])
        for j in range(size):
            P[i, j] -= Ph[i] * Ph[j] / s
    if learning:
        mean = 0.0
        for e in range(members):
            mean += predicted[e]
        mean /= members
        for e in range(members):
            dh[e] = predicted[e] - mean
        regress(theta, dh, members, spread, s, innovation)
        regress(z, dh, members, spread, s, innovation)
    return innovation**2 / (s + spread)


@jit
def report(theta, z, P, t, out):  # type: ignore[no-untyped-def]
    """Write force, its spread, the baseline's force and the parameters of one sample."""
    force, std, mean, spread, baseline = out
    members, base = z.shape[1] - 2, z.shape[0] - 2 * force.shape[1]
    for i in range(force.shape[1]):
        f = z[base + 2 * i]
        force[t, i], baseline[t, i] = f[members], f[members + 1]
        std[t, i] = np.sqrt(spread_of(f, members) + P[base + 2 * i, base + 2 * i])
    for p in range(theta.shape[0]):
        mean[t, p] = theta[p, members]
        spread[t, p] = np.sqrt(spread_of(theta[p], members))


@jit
def marginal_loop(plant, force, q, H, r, gate, learn, theta, z, P, streak, Y, dts, steps, out, nis, used):  # type: ignore[no-untyped-def]
    """Run the default filter over samples Y (nt, 4 n); learn is 0 never, 1 with a known force, 2 always."""
    pairs, inverse, stiffness, damping = plant
    n, size, columns = inverse.shape[0], z.shape[0], z.shape[1]
    buffers, work = np.empty((3, size, columns)), np.empty((n, columns))
    F, FP = np.empty((size, size)), np.empty((size, size))
    predicted, dh, Ph = np.empty(columns), np.empty(columns - 2), np.empty(size)
    dt_of_F, use = -1.0, np.empty(4 * n, dtype=np.bool_)
    for t in range(Y.shape[0]):
        y = Y[t]
        dt = dts[t] / steps[t] if steps[t] else 0.0
        if steps[t] and dt != dt_of_F:
            transition(plant, force, theta, dt, F)
            dt_of_F = dt
        for _ in range(steps[t]):
            rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, theta, z, z, dt, buffers, work)
            predict_covariance(F, P, FP, q, dt)
        choose(H, r, gate, z, P, streak, y, predicted, use)
        known = True
        for c in range(3 * n, 4 * n):
            known = known and np.isfinite(y[c])
        learning = learn == 2 or (learn == 1 and known)
        for c in range(4 * n):
            if use[c]:
                nis[t] += take(H[c], r[c], y[c], theta, z, P, learning, predicted, Ph, dh)
                used[t] += 1
        if learning:
            dt_of_F = -1.0
        for i in range(size):
            for j in range(i):
                P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
        report(theta, z, P, t, out)


@jit
def perturb(E, std, draws):  # type: ignore[no-untyped-def]
    """Add noise of the given standard deviations to the rows of E."""
    for r in range(std.size):
        row, draw, s = E[r], draws[r], std[r]
        for e in range(row.size):
            row[e] += s * draw[e]


@jit
def centred(row, out):  # type: ignore[no-untyped-def]
    """Write the anomalies of a row; return its mean."""
    mean = 0.0
    for e in range(row.size):
        mean += row[e]
    mean /= row.size
    for e in range(row.size):
        out[e] = row[e] - mean
    return mean


@jit
def factor(S, p):  # type: ignore[no-untyped-def]
    """Write the Cholesky factor of the leading p x p block into its lower triangle."""
    for i in range(p):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(total) if i == j else total / S[j, j]


@jit
def whiten(S, p, D):  # type: ignore[no-untyped-def]
    """Write S^-1 D over D, with S factored."""
    for i in range(p):
        for k in range(i):
            w, row, other = S[i, k], D[i], D[k]
            for e in range(row.size):
                row[e] -= w * other[e]
        D[i] *= 1.0 / S[i, i]
    for i in range(p - 1, -1, -1):
        for k in range(i + 1, p):
            w, row, other = S[k, i], D[i], D[k]
            for e in range(row.size):
                row[e] -= w * other[e]
        D[i] *= 1.0 / S[i, i]


@jit
def stochastic(parts, Y, y, std, draws, D, W, S):  # type: ignore[no-untyped-def]
    """Move the ensembles of `parts` by perturbed observations (31)-(34); Y (p, members) is overwritten."""
    p, members = y.size, Y.shape[1]
    for i in range(p):
        w, row, difference, draw, s = W[i], Y[i], D[i], draws[i], std[i]
        for e in range(members):
            difference[e] = y[i] + s * draw[e] - row[e]
        centred(draw, w)
        for e in range(members):
            w[e] *= s
        centred(row, row)
    for i in range(p):
        for j in range(i + 1):
            total, a, b, u, v = 0.0, Y[i], Y[j], W[i], W[j]
            for e in range(members):
                total += a[e] * b[e] + u[e] * v[e]
            S[i, j] = total / (members - 1)
    factor(S, p)
    whiten(S, p, D)
    for E in parts:
        for r in range(E.shape[0]):
            row = E[r]
            for i in range(p):
                S[i, p] = 0.0
                for e in range(members):
                    S[i, p] += row[e] * Y[i, e]
            for i in range(p):
                gain = S[i, p] / (members - 1)
                for e in range(members):
                    row[e] += gain * D[i, e]


@jit
def square_root(parts, Y, y, std, dh):  # type: ignore[no-untyped-def]
    """Move the ensembles of `parts` by the square root, one observation after the other; Y moves along."""
    p, members = y.size, Y.shape[1]
    for i in range(p):
        mean, spread = centred(Y[i], dh), 0.0
        for e in range(members):
            spread += dh[e] * dh[e]
        spread /= members - 1
        variance = std[i] * std[i]
        for E in parts:
            regress_plain(E, dh, spread, variance, y[i] - mean, 0)
        regress_plain(Y, dh, spread, variance, y[i] - mean, i + 1)


@jit
def regress_plain(E, dh, spread, variance, innovation, first):  # type: ignore[no-untyped-def]
    """Move rows of E from `first` on by the square root of one scalar observation with anomalies dh."""
    total = spread + variance
    shrink = 1.0 / (1.0 + np.sqrt(variance / total))
    for r in range(first, E.shape[0]):
        row, covariance = E[r], 0.0
        for e in range(row.size):
            covariance += row[e] * dh[e]
        gain = covariance / (row.size - 1) / total
        shift, cut = gain * innovation, gain * shrink
        for e in range(row.size):
            row[e] += shift - cut * dh[e]


@jit
def analyse(parts, Y, y, std, draws, perturbed, D, W, S):  # type: ignore[no-untyped-def]
    """Assimilate what is there of y; return the sum of squared normalised innovations and the number of channels.

    Y (p, members) holds the predicted observations and is used up; D, W (p, members) and S (p, p + 1) are scratch.
    """
    there, nis = np.empty(y.size, dtype=np.int64), 0.0
    p = 0
    for c in range(y.size):
        if np.isfinite(y[c]):
            there[p] = c
            p += 1
            mean = Y[c].mean()
            nis += (y[c] - mean) ** 2 / (spread_of(Y[c], Y.shape[1]) + std[c] ** 2)
    if p == 0:
        return 0.0, 0
    if p < y.size:
        keep = there[:p]
        Y, y, std = Y[keep], y[keep], std[keep]
        draws = draws[keep] if perturbed else draws
    if perturbed:
        stochastic(parts, Y, y, std, draws, D, W, S)
    else:
        square_root(parts, Y, y, std, D[0])
    return nis, p


@jit
def printed_loop(plant, theta, z, noise, H, pseudo, state, kind, perturbed, Y, dts, steps, out, nis, used):  # type: ignore[no-untyped-def]
    """Run the paper's filter over samples Y (nt, 3 n); the last n rows of z are the force ensemble."""
    pairs, inverse, stiffness, damping = plant
    on_theta, on_state, on_force, on_motion, on_acceleration = noise
    n, members, n_theta = inverse.shape[0], theta.shape[1], theta.shape[0]
    base, p = z.shape[0] - n, on_motion.size
    m, motion, force = base - 2 * n, z[:base], z[base:]
    system = n_theta + base + n
    draws = np.empty((system + (p + n if perturbed else 0), members))
    buffers, work, none = np.empty((3, base, members)), np.empty((n, members)), np.empty((0, 2, 2))
    predicted, D, W = np.empty((p, members)), np.empty((p, members)), np.empty((p, members))
    S, y, acceleration = np.empty((p, p + 1)), np.empty(p), np.empty((n, members))
    y[2 * n:] = pseudo
    for t in range(Y.shape[0]):
        if kind == THREE_POINT:
            fill_three_point(state, draws.reshape(draws.size))
        else:
            fill_gaussian(state, draws.reshape(draws.size))
        for _ in range(steps[t]):
            rk4(pairs, inverse, stiffness, damping, m, none, theta, motion, force, dts[t] / steps[t], buffers,
                work)
        perturb(theta, on_theta, draws)
        perturb(motion, on_state, draws[n_theta:])
        predicted[:2 * n] = z[m:base]
        for c in range(2 * n, p):
            project(H[c - 2 * n], theta, predicted[c])
        y[:2 * n] = Y[t, :2 * n]
        nis[t], used[t] = analyse((theta, motion), predicted, y, on_motion, draws[system:], perturbed, D, W, S)
        perturb(force, on_force, draws[n_theta + base:])
        accelerate(pairs, inverse, stiffness, damping, m, z, force, 1, acceleration, 0, work)
        more, count = analyse((force,), acceleration, Y[t, 2 * n:], on_acceleration, draws[system + p:], perturbed,
                              D, W, S)
        nis[t] += more
        used[t] += count - (p - 2 * n)
        report_printed(theta, force, t, out)


@jit
def report_printed(theta, force, t, out):  # type: ignore[no-untyped-def]
    """Write means and standard deviations of one sample."""
    out_force, out_std, out_theta, out_spread = out
    for i in range(force.shape[0]):
        out_force[t, i], out_std[t, i] = force[i].mean(), np.sqrt(spread_of(force[i], force.shape[1]))
    for p in range(theta.shape[0]):
        out_theta[t, p], out_spread[t, p] = theta[p].mean(), np.sqrt(spread_of(theta[p], theta.shape[1]))
