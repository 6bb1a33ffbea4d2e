"""The default filter's step: a Kalman filter for motion and force given theta, an ensemble for theta.

Given theta the problem is linear, so noise is carried by one covariance P and no member is ever shaken: members differ
only because their parameters differ. What correlation the ensemble shows is then real, not sampling noise, which is
what makes an ordinary ensemble filter collapse on constant parameters. (Rao-Blackwell; docs/theory/dual_filter.md.)

This NumPy version is the one to read; `marginal_loop` does the same in one loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.ensemble import scalar_update
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.plan import Plan, acceleration, derivative, rk4
from radiation_ss.inference.scales import Scales

PATIENCE = 50  # refused samples in a row after which a channel is believed again
GAUSS = (np.array([0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5]), np.array([5.0, 8.0, 5.0]) / 18.0)  # on (0, 1)
STUCK = 20     # equal samples in a row after which a motion sensor counts as dead


@dataclass(eq=False)
class Cloud:
    """State of the marginal filter; columns are the members, then the control run, then doing nothing.

    The control run sits at the ensemble mean of theta; doing nothing keeps its start.
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


def start_covariance(plan: Plan, theta: FloatArray, scales: Scales, force: ForceModel) -> FloatArray:
    """Return P at the start: motion within three of its standard deviations, memory and force as in mid-sea.

    The memory's states are those that a harmonic velocity of the motion's size and mean frequency leaves (5).
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


def observation_matrix(plan: Plan) -> FloatArray:
    """Return H, shape (4 n, m + 4 n): displacement, velocity, acceleration (feed-through) and force."""
    n, base = plan.n, plan.m + 2 * plan.n
    H = np.zeros((4 * n, base + 2 * n))
    unit = np.eye(base + 2 * n)
    H[:n], H[n:2 * n] = unit[plan.m:plan.m + n], unit[plan.m + n:base]
    H[2 * n:3 * n] = acceleration(plan, unit[:base], unit[base::2])
    H[3 * n:] = unit[base::2]
    return H


def rate(plan: Plan, force: FloatArray, theta: FloatArray, z: FloatArray) -> FloatArray:
    """Return the derivative of motion and force together; force is A of the force model, shape (n, 2, 2)."""
    base = plan.m + 2 * plan.n
    s = z[base:].reshape(plan.n, 2, -1)
    return np.vstack([derivative(plan, theta, z[:base], s[:, 0]), np.reshape(force @ s, (2 * plan.n, -1))])


def transition(plan: Plan, force: FloatArray, theta: FloatArray, dt: float) -> FloatArray:
    """Return the matrix of one RK4 step for one parameter vector."""
    size = plan.m + 4 * plan.n
    columns = np.broadcast_to(theta[:, None], (theta.size, size))
    return rk4(lambda z: rate(plan, force, columns, z), np.eye(size), dt)


def noise_covariance(plan: Plan, force: FloatArray, q: FloatArray, theta: FloatArray, dt: float) -> FloatArray:
    """Return the covariance that the force's noise leaves over a step, the integral of F(s) diag(q) F(s)' over it.

    By Gauss's rule with three nodes. Noise that only enters at the ends of a step gives the force another path between
    two samples, and parameters learnt over minutes see the difference.
    """
    base, total = plan.m + 2 * plan.n, 0.0
    for node, weight in zip(*GAUSS):
        reach = transition(plan, force, theta, node * dt)[:, base:]
        total = total + weight * dt * (reach * q) @ reach.T
    return np.asarray(total)


def predict(plan: Plan, force: FloatArray, q: FloatArray, cloud: Cloud, dt: float, steps: int) -> None:
    """Move members and covariance by `steps` RK4 steps of dt; q is the noise intensity of each force state, (2 n,)."""
    control = cloud.theta[:, cloud.members]
    F, noise = transition(plan, force, control, dt), noise_covariance(plan, force, q, control, dt)
    for _ in range(steps):
        cloud.z = rk4(lambda z: rate(plan, force, cloud.theta, z), cloud.z, dt)
        cloud.P = F @ cloud.P @ F.T + noise


def spread(H: FloatArray, cloud: Cloud) -> FloatArray:
    """Return the variance of each predicted channel: what P says plus what the parameters add."""
    return np.einsum("ci,ij,cj->c", H, cloud.P, H) + (H @ cloud.z[:, :cloud.members]).var(axis=1, ddof=1)


def believable(H: FloatArray, cloud: Cloud, y: FloatArray, r: FloatArray, gate: float) -> np.ndarray:
    """Return which channels to use.

    A sample beyond `gate` standard deviations is refused, but not for ever; so is a motion sensor that repeats itself.
    """
    cloud.same = np.where(y == cloud.last, cloud.same + 1, 0)
    cloud.last = np.where(np.isfinite(y), y, cloud.last)
    alive = (cloud.same < STUCK) | (np.arange(y.size) >= 3 * y.size // 4)
    far = np.abs(y - H @ cloud.z[:, cloud.members]) > gate * np.sqrt(spread(H, cloud) + r)
    there = np.isfinite(y) & alive
    refused = there & far & (cloud.streak < PATIENCE)
    cloud.streak = np.where(refused, cloud.streak + 1, np.where(there, 0, cloud.streak))
    return there & ~refused


def assimilate(H: FloatArray, cloud: Cloud, y: FloatArray, r: FloatArray, use: np.ndarray, learn: bool) -> float:
    """Take one sample, channel by channel; return the sum of squared normalised innovations (NIS).

    Given theta: Kalman update with a common gain. Then, if `learn`, theta and what depends on it by the square root of
    the ensemble, with the innovation variance given theta as the observation's.
    """
    members, nis = cloud.members, 0.0
    for c in np.flatnonzero(use):
        h, Ph = H[c], cloud.P @ H[c]
        s = h @ Ph + r[c]
        predicted = h @ cloud.z
        nis += (y[c] - predicted[members]) ** 2 / (s + predicted[:members].var(ddof=1))
        cloud.z += np.outer(Ph / s, y[c] - predicted)
        cloud.P -= np.outer(Ph, Ph) / s
        if learn:
            joint = np.vstack([cloud.theta, cloud.z])[:, :members + 1]
            # The control column is moved as the mean is: scalar_update is affine in the columns' anomalies.
            cloud.theta[:, :members + 1], cloud.z[:, :members + 1] = np.split(
                _with_control(joint, predicted[:members + 1], y[c], s), [cloud.theta.shape[0]])
    cloud.P = 0.5 * (cloud.P + cloud.P.T)
    return float(nis)


def _with_control(E: FloatArray, h: FloatArray, y: float, variance: float) -> FloatArray:
    """Update members by the square root, and the control (last column) by the gain times its own innovation."""
    members = E[:, :-1]
    d = h[:-1] - h[:-1].mean()
    gain = (members - members.mean(axis=1, keepdims=True)) @ d / (d @ d + variance * (d.size - 1))
    moved = scalar_update(members, h[:-1], y, variance)
    shift = gain * (y - h[-1])
    # Members keep the control at their mean in theta: both move by the control's innovation.
    moved += (shift - gain * (y - h[:-1].mean()))[:, None]
    return np.column_stack([moved, E[:, -1] + shift])
