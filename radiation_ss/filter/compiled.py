"""The loops of both filters, compiled: members are columns, so every inner loop runs along contiguous memory.

They do what `marginal` and `printed` do, to rounding; those are the versions to read, and the tests compare.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.draws import fill_gaussian, fill_three_point
from radiation_ss.filter.jit import jit
from radiation_ss.filter.marginal import PATIENCE, STUCK

GAUSSIAN, THREE_POINT = 0, 1


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


@jit(inner=True)
def transition(plant, force, theta, dt, F):  # type: ignore[no-untyped-def]
    """Write the matrix of one Runge-Kutta step for the control's parameters, the last column but one."""
    pairs, inverse, stiffness, damping = plant
    size, n, control = F.shape[0], inverse.shape[0], theta.shape[1] - 2
    columns = np.empty((theta.shape[0], size))
    for p in range(theta.shape[0]):
        for i in range(size):
            columns[p, i] = theta[p, control]
    for i in range(size):
        for j in range(size):
            F[i, j] = 1.0 if i == j else 0.0
    rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, columns, F, F, dt,
        np.empty((3, size, size)), np.empty((n, size)))


@jit(inner=True)
def predict_covariance(F, P, FP, q, dt):  # type: ignore[no-untyped-def]
    """Write P = F (P + N) F' + N with half of the force's noise N on each side of the step."""
    base = P.shape[0] - q.size
    for i in range(q.size):
        P[base + i, base + i] += 0.5 * dt * q[i]
    size = P.shape[0]
    for i in range(size):
        for j in range(size):
            FP[i, j] = 0.0
        for k in range(size):
            for j in range(size):
                FP[i, j] += F[i, k] * P[k, j]
    for i in range(size):
        for j in range(i, size):
            total = 0.0
            for k in range(size):
                total += FP[i, k] * F[j, k]
            P[i, j] = P[j, i] = total
    for i in range(q.size):
        P[base + i, base + i] += 0.5 * dt * q[i]


@jit(inner=True)
def choose(H, r, gate, z, P, streak, last, same, y, predicted, use):  # type: ignore[no-untyped-def]
    """Write which channels to use, all judged against the prediction before any of them is taken."""
    members = z.shape[1] - 2
    for c in range(y.size):
        same[c] = same[c] + 1 if y[c] == last[c] else 0
        dead = same[c] >= STUCK and c < 3 * y.size // 4
        if np.isfinite(y[c]):
            last[c] = y[c]
        use[c] = np.isfinite(y[c]) and not dead
        if not use[c]:
            continue
        project(H, c, z, predicted, 0)
        total = r[c] + moments(predicted, 0, members)[1]
        for i in range(P.shape[0]):
            if H[c, i] != 0.0:
                for j in range(P.shape[0]):
                    total += H[c, i] * P[i, j] * H[c, j]
        if abs(y[c] - predicted[0, members]) > gate * np.sqrt(total) and streak[c] < PATIENCE:
            use[c] = False
            streak[c] += 1
        else:
            streak[c] = 0


@jit(inner=True)
def take(H, c, r, y, theta, z, P, learning, predicted, gain, dh):  # type: ignore[no-untyped-def]
    """Assimilate channel c; return its squared normalised innovation."""
    size, columns, members = z.shape[0], z.shape[1], z.shape[1] - 2
    project(H, c, z, predicted, 0)
    mean, spread = moments(predicted, 0, members)
    innovation = y - predicted[0, members]
    s = r
    for i in range(size):
        gain[i] = 0.0
        for j in range(size):
            gain[i] += P[i, j] * H[c, j]
        s += H[c, i] * gain[i]
    for i in range(size):
        k = gain[i] / s
        for e in range(columns):
            z[i, e] += k * (y - predicted[0, e])
        for j in range(size):
            P[i, j] -= k * gain[j]
    if learning:
        for e in range(members):
            dh[0, e] = predicted[0, e]
        regress(theta, 0, dh, 0, mean, spread, s, innovation)
        regress(z, 0, dh, 0, mean, spread, s, innovation)
    return innovation**2 / (s + spread)


@jit(inner=True)
def report(theta, z, P, t, out):  # type: ignore[no-untyped-def]
    """Write force, its spread, the baseline's force and the parameters of one sample."""
    force, std, mean, spread, baseline = out
    members, base = z.shape[1] - 2, z.shape[0] - 2 * force.shape[1]
    for i in range(force.shape[1]):
        f = base + 2 * i
        force[t, i], baseline[t, i] = z[f, members], z[f, members + 1]
        std[t, i] = np.sqrt(moments(z, f, members)[1] + P[f, f])
    for p in range(theta.shape[0]):
        mean[t, p], spread[t, p] = theta[p, members], np.sqrt(moments(theta, p, members)[1])


@jit
def marginal_loop(plant, force, q, H, r, gate, learn, theta, z, P, streak, last, same,  # type: ignore[no-untyped-def]
                  Y, dts, steps, out, nis, used):
    """Run the default filter over samples Y (nt, 4 n); learn is 0 never, 1 with a known force, 2 always."""
    pairs, inverse, stiffness, damping = plant
    n, size, columns = inverse.shape[0], z.shape[0], z.shape[1]
    buffers, work = np.empty((3, size, columns)), np.empty((n, columns))
    F, FP = np.empty((size, size)), np.empty((size, size))
    predicted, dh, gain = np.empty((1, columns)), np.empty((1, columns - 2)), np.empty(size)
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
        choose(H, r, gate, z, P, streak, last, same, y, predicted, use)
        known = True
        for c in range(3 * n, 4 * n):
            known = known and np.isfinite(y[c])
        learning = learn == 2 or (learn == 1 and known)
        for c in range(4 * n):
            if use[c]:
                nis[t] += take(H, c, r[c], y[c], theta, z, P, learning, predicted, gain, dh)
                used[t] += 1
        if learning:
            dt_of_F = -1.0
        for i in range(size):
            for j in range(i):
                P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
        report(theta, z, P, t, out)


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
        perturb(z, base, on_force, draws, n_theta + base)
        net_force(pairs, stiffness, damping, m, z, z, base, 1, net)
        for i in range(n):
            combine(inverse, i, net, 0, predicted, i)
        more, count = gather(predicted, Y[t, 2 * n:], on_acceleration, draws, system + p, kept, kept_std)
        analyse(z, base, n, nobody, predicted, count, kept, kept_std, draws, system + p, perturbed, scratch, S)
        nis[t] += more
        used[t] = there + count - (p - 2 * n)
        report_printed(theta, z, base, t, out)


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
