"""The default filter's step: a Kalman filter for motion and force given theta, an ensemble for theta.

Given theta the problem is linear, so noise is carried by one covariance P and no member is ever shaken: members differ
only because their parameters differ. What correlation the ensemble shows is then real, not sampling noise, which is
what makes an ordinary ensemble filter collapse on constant parameters. (Rao-Blackwell; docs/theory/dual_filter.md.)

This NumPy version is the one to read; `marginal_loop` does the same in one loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.ensemble import scalar_update
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.plan import Plan, acceleration, derivative, rk4
from radiation_ss.inference.kalman import Gaussian, predict, update
from radiation_ss.inference.scales import Scales

GAUSS = (np.array([0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5]), np.array([5.0, 8.0, 5.0]) / 18.0)  # on (0, 1)


class System(NamedTuple):
    """The equations of motion and force with their noise, theta left free."""

    plan: Plan
    force: FloatArray  # (n, 2, 2): A of the force model
    q: FloatArray      # (2 n,): noise intensity of each force state
    H: FloatArray      # (4 n, m + 4 n): displacement, velocity, acceleration, force
    r: FloatArray      # (4 n,): variance of each channel's sensor


class Rules(NamedTuple):
    """Which samples are used, and whether the parameters learn."""

    gate: float         # standard deviations beyond which a sample is refused
    learn: int          # 0: never, 1: where the force of every degree of freedom is known, 2: always
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

    @property
    def members(self) -> int:
        """Number of members."""
        return self.theta.shape[1] - 2

    @classmethod
    def at_rest(cls, theta: FloatArray, P: FloatArray, channels: int) -> FilterState:
        """Return the state before the first sample."""
        count = np.zeros(channels, dtype=np.int64)
        return cls(np.ascontiguousarray(theta), np.zeros((P.shape[0], theta.shape[1])), P.copy(), count,
                   np.full(channels, np.nan), count.copy())


def system_of(plan: Plan, force: ForceModel, noise: FloatArray) -> System:
    """Return the system; noise (4, n) are the sensors' standard deviations, NaN where there is none."""
    n, base = plan.n, plan.m + 2 * plan.n
    unit = np.eye(base + 2 * n)
    H = np.vstack([unit[plan.m:base], acceleration(plan, unit[:base], unit[base::2]), unit[base::2]])
    return System(plan, force.A, np.ascontiguousarray(force.q.ravel()), H,
                  np.where(np.isfinite(noise), noise, 1.0).ravel() ** 2)


def start_covariance(plan: Plan, theta: FloatArray, scales: Scales, force: ForceModel) -> FloatArray:
    """Return P at the start: motion within three of its standard deviations, radiation states and force as in mid-sea.

    The radiation states are those that a harmonic velocity of the motion's size and mean frequency leaves (5).
    """
    n, m = plan.n, plan.m
    P = np.zeros((m + 4 * n, m + 4 * n))
    variances = P.ravel()[::m + 4 * n + 1]
    variances[m:m + n] = (3.0 * scales.motion) ** 2
    variances[m + n:m + 2 * n] = (3.0 * scales.motion * scales.omega) ** 2
    variances[m + 2 * n:] = force.start.ravel()
    for _, k, offset, at, order in plan.pairs:
        s = 1j * scales.omega[k]
        a, b = theta[offset:offset + order], theta[offset + order:offset + 2 * order]
        powers = s ** np.arange(order)
        y, x = (b @ powers) / (a @ powers + s**order), 0.0
        for i in range(order):
            x = (x + b[i] - a[i] * y) / s
            variances[at + i] = 2.0 * (abs(x) * scales.motion[k] * scales.omega[k]) ** 2
    return P


def rate(system: System, theta: FloatArray, z: FloatArray) -> FloatArray:
    """Return the derivative of motion and force together, members as columns."""
    n, base = system.plan.n, system.plan.m + 2 * system.plan.n
    s = z[base:].reshape(n, 2, -1)
    return np.vstack([derivative(system.plan, theta, z[:base], s[:, 0]), np.reshape(system.force @ s, (2 * n, -1))])


def transition(system: System, theta: FloatArray, dt: float) -> FloatArray:
    """Return the matrix of one RK4 step for one parameter vector."""
    size = system.H.shape[1]
    columns = np.broadcast_to(theta[:, None], (theta.size, size))
    return rk4(lambda z: rate(system, columns, z), np.eye(size), dt)


def noise_covariance(system: System, theta: FloatArray, dt: float) -> FloatArray:
    """Return the covariance that the force's noise leaves over a step, the integral of F(s) diag(q) F(s)' over it.

    By Gauss's rule with three nodes. Noise that only enters at the ends of a step gives the force another path between
    two samples, and parameters learnt over minutes see the difference.
    """
    base, total = system.plan.m + 2 * system.plan.n, 0.0
    for node, weight in zip(*GAUSS):
        reach = transition(system, theta, node * dt)[:, base:]
        total = total + weight * dt * (reach * system.q) @ reach.T
    return np.asarray(total)


def advance(system: System, state: FilterState, dt: float, steps: int) -> None:
    """Move members and covariance by `steps` RK4 steps of dt."""
    control = state.theta[:, state.members]
    F, Q = transition(system, control, dt), noise_covariance(system, control, dt)
    for _ in range(steps):
        state.z[:] = rk4(lambda z: rate(system, state.theta, z), state.z, dt)
        state.P[:] = predict(Gaussian(state.z, state.P), F, Q).cov


def usable(system: System, state: FilterState, y: FloatArray, rules: Rules) -> np.ndarray:
    """Return which channels to use.

    A sample beyond the gate is refused, but not for ever; so is a motion sensor that repeats itself.
    """
    H = system.H
    state.same[:] = np.where(y == state.last, state.same + 1, 0)
    state.last[:] = np.where(np.isfinite(y), y, state.last)
    working = (state.same < rules.stuck) | (np.arange(y.size) >= 3 * y.size // 4)
    variance = np.einsum("ci,ij,cj->c", H, state.P, H) + (H @ state.z[:, :state.members]).var(axis=1, ddof=1)
    far = np.abs(y - H @ state.z[:, state.members]) > rules.gate * np.sqrt(variance + system.r)
    there = np.isfinite(y) & working
    refused = there & far & (state.streak < rules.patience)
    state.streak[:] = np.where(refused, state.streak + 1, np.where(there, 0, state.streak))
    return there & ~refused


def assimilate(system: System, state: FilterState, y: FloatArray, use: np.ndarray, learn: bool) -> float:
    """Take one sample, channel by channel; return the sum of squared normalised innovations (NIS).

    Given theta: Kalman update with a common gain. Then, if `learn`, theta and what depends on it by the square root of
    the ensemble, with the innovation variance given theta as the observation's.
    """
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
