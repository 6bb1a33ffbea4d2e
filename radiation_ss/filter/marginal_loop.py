"""The default filter's loop, compiled: what `marginal` does, to rounding; that is the version to read."""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.kernels import moments, project, regress, rk4
from radiation_ss.filter.marginal import GAUSS, PATIENCE, STUCK
from radiation_ss.jit import jit

NODES, WEIGHTS = GAUSS


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
        np.empty((2, size, size)), np.empty((n, size)))


@jit(inner=True)
def noise_covariance(plant, force, theta, q, dt, Q):  # type: ignore[no-untyped-def]
    """Write the covariance that the force's noise leaves over a step for the control's parameters."""
    pairs, inverse, stiffness, damping = plant
    size, n, control, count = Q.shape[0], inverse.shape[0], theta.shape[1] - 2, q.size
    base = size - count
    columns, reach = np.empty((theta.shape[0], count)), np.empty((size, count))
    buffers, net = np.empty((2, size, count)), np.empty((n, count))
    for p in range(theta.shape[0]):
        for i in range(count):
            columns[p, i] = theta[p, control]
    Q[:] = 0.0
    for at in range(NODES.size):
        reach[:] = 0.0
        for i in range(count):
            reach[base + i, i] = 1.0
        rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, columns, reach, reach, NODES[at] * dt, buffers,
            net)
        for i in range(size):
            for j in range(size):
                for k in range(count):
                    Q[i, j] += WEIGHTS[at] * dt * q[k] * reach[i, k] * reach[j, k]


@jit(inner=True)
def predict_covariance(F, P, FP, Q):  # type: ignore[no-untyped-def]
    """Write P = F P F' + Q."""
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
def correct(H, c, r, y, z, P, predicted, gain):  # type: ignore[no-untyped-def]
    """Move every column of z, and P, by channel c and its prediction; return the innovation's variance given theta."""
    size, columns = z.shape[0], z.shape[1]
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
    return s


@jit(inner=True)
def take(H, c, r, y, theta, z, P, learning, predicted, gain, dh):  # type: ignore[no-untyped-def]
    """Assimilate channel c; return its squared normalised innovation."""
    members = z.shape[1] - 2
    project(H, c, z, predicted, 0)
    mean, spread = moments(predicted, 0, members)
    innovation = y - predicted[0, members]
    s = correct(H, c, r, y, z, P, predicted, gain)
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
                  Y, dts, steps, out, nis, used, taken):
    """Run the default filter over samples Y (nt, 4 n); learn is 0 never, 1 with a known force, 2 always.

    Which channels were taken goes into `taken` (nt, 4 n).
    """
    pairs, inverse, stiffness, damping = plant
    n, size, columns = inverse.shape[0], z.shape[0], z.shape[1]
    buffers, work = np.empty((2, size, columns)), np.empty((n, columns))
    F, FP, Q = np.empty((size, size)), np.empty((size, size)), np.empty((size, size))
    predicted, dh, gain = np.empty((1, columns)), np.empty((1, columns - 2)), np.empty(size)
    dt_of_F = -1.0
    for t in range(Y.shape[0]):
        y, use = Y[t], taken[t]
        dt = dts[t] / steps[t] if steps[t] else 0.0
        if steps[t] and dt != dt_of_F:
            transition(plant, force, theta, dt, F)
            noise_covariance(plant, force, theta, q, dt, Q)
            dt_of_F = dt
        for _ in range(steps[t]):
            rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, theta, z, z, dt, buffers, work)
            predict_covariance(F, P, FP, Q)
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
