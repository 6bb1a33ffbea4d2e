"""The default filter's loop and that of its tangents, compiled: what `marginal` does, to rounding; read that one."""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.kernels import Scratch, correct, moments, predict_covariance, project, rk4, symmetrise
from radiation_ss.filter.marginal import GAUSS
from radiation_ss.jit import jit

NODES, WEIGHTS = GAUSS


@jit(inner=True)
def step_matrices(system, theta, dt, F, Q):  # type: ignore[no-untyped-def]
    """Write transition and noise covariance of one step of dt for the control's parameters, the last column but one."""
    size, n, control, count = F.shape[0], system.plan.inverse.shape[0], theta.shape[1] - 2, system.q.size
    columns, reach = np.empty((theta.shape[0], size)), np.empty((size, count))
    for p in range(theta.shape[0]):
        for i in range(size):
            columns[p, i] = theta[p, control]
    for i in range(size):
        for j in range(size):
            F[i, j] = 1.0 if i == j else 0.0
    rk4(system.plan, system.force, columns, F, F, dt, Scratch(np.empty((2, size, size)), np.empty((n, size))))
    columns = np.ascontiguousarray(columns[:, :count])
    scratch = Scratch(np.empty((2, size, count)), np.empty((n, count)))
    Q[:] = 0.0
    for at in range(NODES.size):
        reach[:] = 0.0
        for i in range(count):
            reach[size - count + i, i] = 1.0
        rk4(system.plan, system.force, columns, reach, reach, NODES[at] * dt, scratch)
        for i in range(size):
            for j in range(size):
                for k in range(count):
                    Q[i, j] += WEIGHTS[at] * dt * system.q[k] * reach[i, k] * reach[j, k]


@jit(inner=True)
def learns(rule, y):  # type: ignore[no-untyped-def]
    """Return whether the parameters learn from a sample: always, or where the force of every dof is known."""
    known = True
    for c in range(3 * y.size // 4, y.size):
        known = known and np.isfinite(y[c])
    return rule == 2 or (rule == 1 and known)


@jit(inner=True)
def choose(system, rules, state, y, predicted, use):  # type: ignore[no-untyped-def]
    """Write which channels to use, all judged against the prediction before any of them is taken."""
    H, P, members = system.H, state.P, state.z.shape[1] - 2
    for c in range(y.size):
        state.same[c] = state.same[c] + 1 if y[c] == state.last[c] else 0
        dead = state.same[c] >= rules.stuck and c < 3 * y.size // 4
        if np.isfinite(y[c]):
            state.last[c] = y[c]
        use[c] = np.isfinite(y[c]) and not dead
        if not use[c]:
            continue
        project(H, c, state.z, predicted, 0)
        total = system.r[c] + moments(predicted, 0, members)[1]
        for i in range(P.shape[0]):
            if H[c, i] != 0.0:
                for j in range(P.shape[0]):
                    total += H[c, i] * P[i, j] * H[c, j]
        if abs(y[c] - predicted[0, members]) > rules.gate * np.sqrt(total) and state.streak[c] < rules.patience:
            use[c] = False
            state.streak[c] += 1
        else:
            state.streak[c] = 0


@jit(inner=True)
def regress(E, dh, spread, variance, innovation):  # type: ignore[no-untyped-def]
    """Move rows of E by the square root of one scalar observation with anomalies dh (1, members) (`scalar_update`)."""
    members, total = dh.shape[1], spread + variance
    shrink = 1.0 / (1.0 + np.sqrt(variance / total))
    for r in range(E.shape[0]):
        covariance, centre = 0.0, E[r, 0]
        for e in range(members):
            covariance += (E[r, e] - centre) * dh[0, e]
        gain = covariance / (members - 1) / total
        shift, cut = gain * innovation, gain * shrink
        for e in range(members):
            E[r, e] += shift - cut * dh[0, e]
        E[r, members] += shift


@jit(inner=True)
def take(system, c, y, state, learning, predicted, gain, dh):  # type: ignore[no-untyped-def]
    """Assimilate channel c; return its squared normalised innovation."""
    members = state.z.shape[1] - 2
    project(system.H, c, state.z, predicted, 0)
    mean, spread = moments(predicted, 0, members)
    innovation = y - predicted[0, members]
    s = correct(system.H[c], system.r[c], y, state.z, state.P, predicted, gain)
    if learning:
        for e in range(members):
            dh[0, e] = predicted[0, e] - mean
        regress(state.theta, dh, spread, s, innovation)
        regress(state.z, dh, spread, s, innovation)
    return innovation**2 / (s + spread)


@jit(inner=True)
def report(state, t, out):  # type: ignore[no-untyped-def]
    """Write force, its spread, the prior model's force and the parameters of one sample."""
    theta, z, n = state.theta, state.z, out.force.shape[1]
    members, base = z.shape[1] - 2, z.shape[0] - 2 * n
    for i in range(n):
        f = base + 2 * i
        out.force[t, i], out.baseline[t, i] = z[f, members], z[f, members + 1]
        out.force_std[t, i] = np.sqrt(moments(z, f, members)[1] + state.P[f, f])
    for p in range(theta.shape[0]):
        out.theta[t, p], out.theta_std[t, p] = theta[p, members], np.sqrt(moments(theta, p, members)[1])


@jit
def marginal_loop(system, rules, state, samples, out, taken):  # type: ignore[no-untyped-def]
    """Run the default filter over samples; which channels were taken goes into `taken` (nt, 4 n)."""
    n, (size, columns) = system.plan.inverse.shape[0], state.z.shape
    scratch = Scratch(np.empty((2, size, columns)), np.empty((n, columns)))
    F, FP, Q = np.empty((size, size)), np.empty((size, size)), np.empty((size, size))
    predicted, dh, gain = np.empty((1, columns)), np.empty((1, columns - 2)), np.empty(size)
    dt_of_F = -1.0
    for t in range(samples.y.shape[0]):
        y, use, steps = samples.y[t], taken[t], samples.steps[t]
        dt = samples.dts[t] / steps if steps else 0.0
        if steps and dt != dt_of_F:
            step_matrices(system, state.theta, dt, F, Q)
            dt_of_F = dt
        for _ in range(steps):
            rk4(system.plan, system.force, state.theta, state.z, state.z, dt, scratch)
            predict_covariance(F, state.P, FP, Q)
        choose(system, rules, state, y, predicted, use)
        learning = learns(rules.learn, y)
        for c in range(y.size):
            if use[c]:
                out.nis[t] += take(system, c, y[c], state, learning, predicted, gain, dh)
                out.used[t] += 1
        if learning:
            dt_of_F = -1.0
        symmetrise(state.P)
        report(state, t, out)


@jit
def tangent_loop(system, learn, run, samples):  # type: ignore[no-untyped-def]
    """Run the Kalman filter with its tangents over samples; add up Fisher information (d, d) and gradient (d,).

    Columns of theta and z are d neighbours, each at the distance `near` along one parameter, then the control twice.
    The innovations' variance is taken as independent of the parameters: its share of the gradient has mean zero.
    """
    theta, z, P, near = run.theta, run.z, run.P, run.near
    n, (size, columns) = system.plan.inverse.shape[0], z.shape
    d = columns - 2
    scratch = Scratch(np.empty((2, size, columns)), np.empty((n, columns)))
    F, FP, Q = np.empty((size, size)), np.empty((size, size)), np.empty((size, size))
    predicted, gain, slope = np.empty((1, columns)), np.empty(size), np.empty(d)
    dt_of_F = -1.0
    for t in range(samples.y.shape[0]):
        y, steps = samples.y[t], samples.steps[t]
        dt = samples.dts[t] / steps if steps else 0.0
        if steps and dt != dt_of_F:
            step_matrices(system, theta, dt, F, Q)
            dt_of_F = dt
        for _ in range(steps):
            rk4(system.plan, system.force, theta, z, z, dt, scratch)
            predict_covariance(F, P, FP, Q)
        learning = learns(learn, y)
        for c in range(y.size):
            if not np.isfinite(y[c]):
                continue
            project(system.H, c, z, predicted, 0)
            s = correct(system.H[c], system.r[c], y[c], z, P, predicted, gain)
            if learning:
                for k in range(d):
                    slope[k] = (predicted[0, k] - predicted[0, d]) / near
                for k in range(d):
                    run.gradient[k] += slope[k] * (y[c] - predicted[0, d]) / s
                    for m in range(d):
                        run.information[k, m] += slope[k] * slope[m] / s
        symmetrise(P)
