"""The default filter's step: a Kalman filter for motion and force given theta, an ensemble for theta.

Given theta the problem is linear, so noise is carried by one covariance P and no member is ever shaken: members differ
only because their parameters differ. What correlation the ensemble shows is then real, not sampling noise, which is
what makes an ordinary ensemble filter collapse on constant parameters. (Rao-Blackwell; docs/theory/dual_filter.md.)
"""

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.kernels import analyse, moments, predict_covariance, project, rk4
from radiation_ss.filter.plan import MotionPlan
from radiation_ss.filter.settings import ForceModel
from radiation_ss.hydro.transforms import gauss
from radiation_ss.inference.kalman import correct
from radiation_ss.jit import jit

NODES, WEIGHTS = gauss(3)


class System(NamedTuple):
    """The equations of motion and force with their noise, theta left free."""

    plan: MotionPlan
    force: FloatArray  # (n, 2, 2): A of the force model
    q: FloatArray      # (2 n,): noise intensity of each force state
    H: FloatArray      # (4 n, m + 4 n): displacement, velocity, acceleration, force
    r: FloatArray      # (4 n,): variance of each channel's sensor


class SampleRules(NamedTuple):
    """Which samples are used, and whether the parameters learn."""

    gate: float         # standard deviations beyond which a sample is refused
    learn: int          # 0: never, 1: where the force of every degree of freedom is known, 2: always
    far: float          # standard deviations beyond which a sample counts as far off
    recent: float       # samples over which their share is taken
    patience: int = 50  # refused samples in a row after which a channel is believed again
    stuck: int = 20     # equal samples in a row after which a motion sensor counts as dead


class FilterState(NamedTuple):
    """State of the default filter, moved in place; columns are the members, then the control, then the prior model.

    The control sits at the ensemble mean of theta; the prior model keeps its parameters.
    """

    theta: FloatArray   # (n_theta, members + 2)
    z: FloatArray       # (m + 4 n, members + 2): radiation states, displacement, velocity, (force, its rate) each
    P: FloatArray       # (m + 4 n, m + 4 n): covariance given theta
    streak: np.ndarray  # (4 n,): refused samples in a row
    last: FloatArray    # (4 n,): last sample of each channel
    same: np.ndarray    # (4 n,): how often it has come in a row
    far: FloatArray     # (4 n,): share of the recent samples that were far from the prediction

    @property
    def members(self) -> int:
        """Number of members."""
        return self.theta.shape[1] - 2


def system_of(plan: MotionPlan, force: ForceModel, noise: FloatArray) -> System:
    """Return the system; noise (4, n) are the sensors' standard deviations, NaN where there is none."""
    n, m = plan.n, plan.m
    unit = np.eye(m + 4 * n)
    net = unit[m + 2 * n::2] - plan.stiffness @ unit[m:m + n] - plan.damping @ unit[m + n:m + 2 * n]
    for j, _, _, at, order in plan.pairs:
        net[j] -= unit[at + order - 1]
    H = np.vstack([unit[m:m + 2 * n], plan.inverse @ net, unit[m + 2 * n::2]])
    return System(plan, force.A, np.ascontiguousarray(force.q.ravel()), H,
                  np.where(np.isfinite(noise), noise, 1.0).ravel() ** 2)


@jit
def marginal_loop(system, rules, state, samples, out):  # type: ignore[no-untyped-def]
    """Run the default filter over samples."""
    size, columns = state.z.shape
    work, dt_of_F = working_arrays(system, state.theta.shape[0], size, columns), -1.0
    predicted, gain = np.empty((1, columns)), np.empty(size)
    dh, pull, pair = np.empty((1, columns - 2)), np.empty((1, columns - 1)), np.empty(2)
    for t in range(samples.y.shape[0]):
        y, use = samples.y[t], out.taken[t]
        dt_of_F = move(system, (state.theta, state.z, state.P), samples, t, dt_of_F, work)
        choose(system, rules, state, y, predicted, use)
        learning = learns(rules.learn, y)
        for c in range(y.size):
            if use[c]:
                out.nis[t] += take(system, c, y[c], state, learning, predicted, gain, (dh, pull, pair))
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
    z, P, (size, columns) = run.z, run.P, run.z.shape
    d, work, dt_of_F = columns - 2, working_arrays(system, run.theta.shape[0], size, columns), -1.0
    predicted, gain, slope = np.empty((1, columns)), np.empty(size), np.empty(d)
    for t in range(samples.y.shape[0]):
        y = samples.y[t]
        dt_of_F = move(system, (run.theta, z, P), samples, t, dt_of_F, work)
        learning = learns(learn, y)
        for c in range(y.size):
            if not np.isfinite(y[c]):
                continue
            project(system.H, c, z, predicted, 0)
            s = correct(system.H[c], system.r[c], y[c], z, P, predicted, gain)
            if learning:
                for k in range(d):
                    slope[k] = (predicted[0, k] - predicted[0, d]) / run.near
                    run.gradient[k] += slope[k] * (y[c] - predicted[0, d]) / s
                for k in range(d):
                    for i in range(d):
                        run.information[k, i] += slope[k] * slope[i] / s
        symmetrise(P)


@jit(inner=True)
def working_arrays(system, n_theta, size, columns):  # type: ignore[no-untyped-def]
    """Return room for `move`: F, F P, Q, the control's parameters and force columns; `rk4`'s for z, F and those."""
    n, count, square = system.plan.inverse.shape[0], system.q.size, (size, size)
    return ((np.empty(square), np.empty(square), np.empty(square), np.empty((n_theta, size)), np.empty((size, count))),
            (np.empty((2, size, columns)), np.empty((n, columns))), (np.empty((2, size, size)), np.empty((n, size))),
            (np.empty((2, size, count)), np.empty((n, count))))


@jit(inner=True)
def move(system, state, samples, t, dt_of_F, work):  # type: ignore[no-untyped-def]
    """Move states and covariance to sample t; return the step that transition F is for, which was `dt_of_F`.

    F and Q are those of the control's parameters. Q is the integral of F(s) diag(q) F(s)', by Gauss's rule: noise only
    at the ends of a step gives the force another path. F, its columns at Gauss's points and the states take turns in
    one loop, as each further call of `rk4` takes seconds to compile.
    """
    (theta, z, P), (arrays, of_z, of_F, of_reach), steps = state, work, samples.steps[t]
    (F, FP, Q, control, reach), size, count = arrays, z.shape[0], system.q.size
    dt = samples.dts[t] / steps if steps else 0.0
    renewed = steps > 0 and dt != dt_of_F
    if renewed:
        dt_of_F = dt
        for p in range(theta.shape[0]):
            for i in range(size):
                control[p, i] = theta[p, theta.shape[1] - 2]
        for i in range(size):
            for j in range(size):
                F[i, j], Q[i, j] = 1.0 if i == j else 0.0, 0.0
    points = NODES.size
    for turn in range(-1 - points if renewed else 0, steps):
        now, target, (buffers, net), h = theta, z, of_z, dt
        if turn == -1 - points:
            now, target, (buffers, net) = control, F, of_F
        elif turn < 0:
            now, target, (buffers, net), h = control, reach, of_reach, NODES[turn] * dt
            for i in range(size):
                for j in range(count):
                    reach[i, j] = 1.0 if i == size - count + j else 0.0
        rk4(system.plan, system.force, now, target, target, h, buffers, net)
        if turn >= 0:
            predict_covariance(F, P, FP, Q)
        elif turn >= -points:
            for i in range(size):
                for j in range(size):
                    for k in range(count):
                        Q[i, j] += WEIGHTS[turn] * dt * system.q[k] * reach[i, k] * reach[j, k]
    return dt_of_F


@jit(inner=True)
def learns(rule, y):  # type: ignore[no-untyped-def]
    """Return whether the parameters learn from a sample: always, or where the force of every dof is known."""
    known = True
    for c in range(3 * y.size // 4, y.size):
        known = known and np.isfinite(y[c])
    return rule == 2 or (rule == 1 and known)


@jit(inner=True)
def choose(system, rules, state, y, predicted, use):  # type: ignore[no-untyped-def]
    """Write which channels to use, all judged against the prediction before any of them is taken.

    A sample beyond the gate is refused, but not for ever; so is a motion sensor that repeats itself.
    """
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
        off = abs(y[c] - predicted[0, members]) / np.sqrt(total)
        state.far[c] += ((1.0 if off > rules.far else 0.0) - state.far[c]) / rules.recent
        if off > rules.gate and state.streak[c] < rules.patience:
            use[c] = False
            state.streak[c] += 1
        else:
            state.streak[c] = 0


@jit(inner=True)
def take(system, c, y, state, learning, predicted, gain, work):  # type: ignore[no-untyped-def]
    """Assimilate channel c; return its squared normalised innovation.

    Given theta: Kalman update with a common gain. Then, if `learning`, theta and what depends on it by the square root
    of the ensemble, with the innovation's variance given theta as the observation's.
    """
    (dh, pull, gains), members = work, state.z.shape[1] - 2
    project(system.H, c, state.z, predicted, 0)
    mean, spread = moments(predicted, 0, members)
    innovation = y - predicted[0, members]
    s = correct(system.H[c], system.r[c], y, state.z, state.P, predicted, gain)
    total = spread + s
    if learning:
        shrink = 1.0 / (1.0 + np.sqrt(s / total))
        for e in range(members):
            dh[0, e] = predicted[0, e] - mean
            pull[0, e] = (innovation - shrink * dh[0, e]) / total
        pull[0, members] = innovation / total
        for part in range(2):
            moved = state.z if part else state.theta
            analyse(moved, 0, moved.shape[0], dh, pull, 1, gains)
    return innovation**2 / total


@jit(inner=True)
def symmetrise(P):  # type: ignore[no-untyped-def]
    """Write (P + P') / 2 over P."""
    for i in range(P.shape[0]):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


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
