"""Both dual filters in NumPy, step by step: what the compiled loops of `radiation_ss.filter` have to do, to rounding.

Members are columns. Equation numbers are those of Hanaki, Takaoka and Minoura (2022).
"""

import numpy as np

from radiation_ss.inference.kalman import Gaussian, predict

GAUSS = (np.array([0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5]), np.array([5.0, 8.0, 5.0]) / 18.0)  # on (0, 1)


def acceleration(plan, z, f):
    """Return xi'' by the equation of motion (1), shape (n, members)."""
    m, n = plan.m, plan.n
    net = f - plan.stiffness @ z[m:m + n] - plan.damping @ z[m + n:m + 2 * n]
    for j, _, _, at, order in plan.pairs:
        net[j] -= z[at + order - 1]  # the radiation force
    return plan.inverse @ net


def derivative(plan, theta, z, f):
    """Return z' for members as columns (9), (16); theta (n_theta, members), f (n, members)."""
    m, n = plan.m, plan.n
    rate = np.empty((m + 2 * n, z.shape[1]))
    for _, k, offset, at, order in plan.pairs:
        u, y = z[m + n + k], z[at + order - 1]
        rate[at:at + order] = theta[offset + order:offset + 2 * order] * u - theta[offset:offset + order] * y
        rate[at + 1:at + order] += z[at:at + order - 1]
    rate[m:m + n] = z[m + n:m + 2 * n]
    rate[m + n:] = acceleration(plan, z, f)
    return rate


def rk4(rate, z, dt):
    """Return z after one classical Runge-Kutta step of z' = rate(z)."""
    k1 = rate(z)
    k2 = rate(z + 0.5 * dt * k1)
    k3 = rate(z + 0.5 * dt * k2)
    k4 = rate(z + dt * k3)
    return z + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


# The default filter.

def update(state, H, y, R):
    """Return the state given y = H x + noise of covariance R (NaN: not measured), the innovation and its covariance."""
    there = np.isfinite(y)
    H, R = H[there], R[np.ix_(there, there)]
    innovation = (y[there] - (H @ state.mean).T).T
    S = H @ state.cov @ H.T + R
    gain = np.linalg.solve(S, H @ state.cov).T
    cov = state.cov - gain @ S @ gain.T
    return Gaussian(state.mean + gain @ innovation, 0.5 * (cov + cov.T)), innovation, S


def rate(system, theta, z):
    """Return the derivative of motion and force together, members as columns."""
    n, base = system.plan.n, system.plan.m + 2 * system.plan.n
    s = z[base:].reshape(n, 2, -1)
    return np.vstack([derivative(system.plan, theta, z[:base], s[:, 0]), np.reshape(system.force @ s, (2 * n, -1))])


def transition(system, theta, dt):
    """Return the matrix of one RK4 step for one parameter vector."""
    size = system.H.shape[1]
    columns = np.broadcast_to(theta[:, None], (theta.size, size))
    return rk4(lambda z: rate(system, columns, z), np.eye(size), dt)


def noise_covariance(system, theta, dt):
    """Return the covariance that the force's noise leaves over a step, the integral of F(s) diag(q) F(s)' over it."""
    base, total = system.plan.m + 2 * system.plan.n, 0.0
    for node, weight in zip(*GAUSS):
        reach = transition(system, theta, node * dt)[:, base:]
        total = total + weight * dt * (reach * system.q) @ reach.T
    return total


def advance(system, state, dt, steps):
    """Move members and covariance by `steps` RK4 steps of dt."""
    control = state.theta[:, state.members]
    F, Q = transition(system, control, dt), noise_covariance(system, control, dt)
    for _ in range(steps):
        state.z[:] = rk4(lambda z: rate(system, state.theta, z), state.z, dt)
        state.P[:] = predict(Gaussian(state.z, state.P), F, Q).cov


def usable(system, state, y, rules):
    """Return which channels to use: no spikes, but not for ever, and no motion sensor that repeats itself."""
    H = system.H
    state.same[:] = np.where(y == state.last, state.same + 1, 0)
    state.last[:] = np.where(np.isfinite(y), y, state.last)
    working = (state.same < rules.stuck) | (np.arange(y.size) >= 3 * y.size // 4)
    variance = np.einsum("ci,ij,cj->c", H, state.P, H) + (H @ state.z[:, :state.members]).var(axis=1, ddof=1)
    off = np.abs(y - H @ state.z[:, state.members]) / np.sqrt(variance + system.r)
    there = np.isfinite(y) & working
    state.far[there] += ((off > rules.far) - state.far)[there] / rules.recent
    refused = there & (off > rules.gate) & (state.streak < rules.patience)
    state.streak[:] = np.where(refused, state.streak + 1, np.where(there, 0, state.streak))
    return there & ~refused


def assimilate(system, state, y, use, learn):
    """Take one sample, channel by channel; return the sum of squared normalised innovations (NIS)."""
    members, nis = state.members, 0.0
    for c in np.flatnonzero(use):
        predicted = system.H[c] @ state.z
        moved, _, S = update(Gaussian(state.z, state.P), system.H[c:c + 1], y[c:c + 1], system.r[c:c + 1, None])
        nis += (y[c] - predicted[members]) ** 2 / (S[0, 0] + predicted[:members].var(ddof=1))
        state.z[:], state.P[:] = moved
        if learn:
            joint = np.vstack([state.theta, state.z])[:, :members + 1]
            joint = scalar_update(joint, predicted[:members + 1], y[c], S[0, 0])
            state.theta[:, :members + 1], state.z[:, :members + 1] = np.split(joint, [state.theta.shape[0]])
    return float(nis)


def scalar_update(E, h, y, variance):
    """Return E after one scalar observation y of the predicted values h, by the square root of the scalar problem.

    The last column is no member: it is the control, which moves by the gain times its own innovation, and whose
    innovation moves the members' mean.
    """
    members = E[:, :-1]
    dh = h[:-1] - h[:-1].mean()
    total = dh @ dh / (dh.size - 1) + variance
    gain = (members - members.mean(axis=1, keepdims=True)) @ dh / (dh.size - 1) / total
    shift, shrink = gain * (y - h[-1]), 1.0 / (1.0 + np.sqrt(variance / total))
    return np.column_stack([members + shift[:, None] - np.outer(shrink * gain, dh), E[:, -1] + shift])


# The paper's filter.

def analysis(E, Y, y, std, draws=None):
    """Return the ensemble given observations (31)-(34): perturbed by draws, or by the square root without them.

    The square root is that of Whitaker and Hamill (2002), eq. 10.
    """
    dE, dY = (part - part.mean(axis=1, keepdims=True) for part in (E, Y))
    if draws is None:
        S = dY @ dY.T / (Y.shape[1] - 1) + np.diag(std**2)
        root = np.linalg.cholesky(S)
        gain = np.linalg.solve(S, dY @ dE.T / (Y.shape[1] - 1)).T
        reduced = gain @ root @ np.linalg.inv(root + np.diag(std))
        return E + (gain @ (y - Y.mean(axis=1)))[:, None] - reduced @ dY
    W = std[:, None] * draws
    dW = W - W.mean(axis=1, keepdims=True)
    return E + np.linalg.solve(dY @ dY.T + dW @ dW.T, dY @ dE.T).T @ (y[:, None] + W - Y)


def printed_step(engine, ensembles, sample, draws):
    """Take one sample (y, dt, steps) into the ensembles (theta, z); return the NIS and the number of channels used.

    draws, shape (sum of sizes in engine.noise, members), are in the order of the engine's noise.
    """
    plan, noise, (H, points), variant = engine.plan, engine.noise, engine.constraint, engine.variant
    (y, dt, steps), n, base, (theta, z) = sample, plan.n, plan.m + 2 * plan.n, ensembles
    on_theta, on_z, on_f, on_motion, on_acceleration = np.split(draws, np.cumsum([part.size for part in noise])[:-1])
    for _ in range(steps):
        z[:base] = rk4(lambda x: derivative(plan, theta, x, z[base:]), z[:base], dt)
    z[:base] += noise.state[:, None] * on_z
    theta += noise.theta[:, None] * on_theta
    z[base:] += noise.force[:, None] * on_f

    def force():
        return _assimilate([z[base:]], acceleration(plan, z[:base], z[base:]), y[2 * n:], noise.acceleration,
                           on_acceleration if variant.perturbed else None)

    def motion():
        predicted = np.vstack([z[plan.m:base], H @ theta])
        found = _assimilate([theta, z[:base]], predicted, np.r_[y[:2 * n], points], noise.motion,
                            on_motion if variant.perturbed else None)
        for E in (theta, z[:base]):
            mean = E.mean(axis=1, keepdims=True)
            E[:] = mean + variant.inflation * (E - mean)
        return found

    results = [part() for part in ((force, motion) if variant.force_first else (motion, force))]
    return sum(nis for nis, _ in results), sum(used for _, used in results) - points.size


def _assimilate(parts, Y, y, std, draws):
    """Move parts of an ensemble by the channels that are there; return their NIS and number."""
    use = np.isfinite(y)
    if not use.any():
        return 0.0, 0
    Y, y, std = Y[use], y[use], std[use]
    nis = float(np.sum((y - Y.mean(axis=1)) ** 2 / (Y.var(axis=1, ddof=1) + std**2)))
    moved = analysis(np.vstack(parts), Y, y, std, None if draws is None else draws[use])
    for part, values in zip(parts, np.split(moved, np.cumsum([len(part) for part in parts])[:-1])):
        part[:] = values
    return nis, y.size
