"""The dual ensemble Kalman filter as the paper prints it (14)-(34), one step; the readable NumPy version.

Two ensembles take turns (Fig. 3): state and parameters of member i are predicted with force i and corrected by
displacement and velocity; then force i is corrected by the acceleration, through the equation of motion at state i.
`printed_loop` does the same in one loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.ensemble import inflate, square_root_update, stochastic_update
from radiation_ss.filter.plan import Plan, acceleration, derivative, rk4


class Noise(NamedTuple):
    """Standard deviations at each step, of the system and of the observations."""

    theta: FloatArray         # (n_theta,)
    state: FloatArray         # (m + 2 n,)
    force: FloatArray         # (n,)
    motion: FloatArray        # (2 n + n_points,): displacement, velocity, pseudo-observations
    acceleration: FloatArray  # (n,)

    @property
    def rows(self) -> int:
        """Rows of draws a step of the stochastic analysis uses."""
        return sum(part.size for part in self)


class Constraint(NamedTuple):
    """Pseudo-observations H theta = y (25)-(27)."""

    H: FloatArray  # (n_points, n_theta)
    y: FloatArray  # (n_points,)


@dataclass(eq=False)
class Twin:
    """The two ensembles; columns are members."""

    theta: FloatArray  # (n_theta, members)
    z: FloatArray      # (m + 2 n, members)
    f: FloatArray      # (n, members)


def printed_step(plan: Plan, twin: Twin, noise: Noise, constraint: Constraint, y: FloatArray, dt: float, steps: int,
                 draws: FloatArray, stochastic: bool = True, inflation: float = 1.0) -> tuple[float, int]:
    """Take one sample; return the sum of squared normalised innovations and the number of channels used.

    Parameters
    ----------
    y : ndarray, shape (3 n,)
        Displacement, velocity, acceleration; NaN where missing.
    dt, steps : float, int
        `steps` Runge-Kutta steps of dt lead to the sample.
    draws : ndarray, shape (noise.rows, members)
        Standard normal (or moment-matched) draws in the order of Noise; the square root needs the first three parts.
    stochastic : bool
        Perturbed observations (34); otherwise the square-root analysis, which ignores the observations' draws.
    inflation : float
        Factor on the spread of state and parameters after their analysis.
    """
    n, m = plan.n, plan.m
    on_theta, on_z, on_f, on_motion, on_acceleration = np.split(draws, np.cumsum([part.size for part in noise])[:-1])
    for _ in range(steps):
        twin.z = rk4(lambda z: derivative(plan, twin.theta, z, twin.f), twin.z, dt)
    twin.z = twin.z + noise.state[:, None] * on_z
    twin.theta = twin.theta + noise.theta[:, None] * on_theta

    observed = np.concatenate([y[:2 * n], constraint.y])
    predicted = np.vstack([twin.z[m:m + 2 * n], constraint.H @ twin.theta])
    joint, nis, used = _analysis(np.vstack([twin.theta, twin.z]), predicted, observed, noise.motion, on_motion,
                                 stochastic)
    twin.theta, twin.z = np.split(inflate(joint, inflation), [twin.theta.shape[0]])

    twin.f = twin.f + noise.force[:, None] * on_f
    twin.f, more, count = _analysis(twin.f, acceleration(plan, twin.z, twin.f), y[2 * n:], noise.acceleration,
                                    on_acceleration, stochastic)
    return nis + more, used + count - constraint.y.size


def _analysis(E: FloatArray, Y: FloatArray, y: FloatArray, std: FloatArray, draws: FloatArray,
              stochastic: bool) -> tuple[FloatArray, float, int]:
    """Return the analysis with the channels that are there, its NIS and their number."""
    use = np.isfinite(y)
    if not use.any():
        return E, 0.0, 0
    Y, y, std = Y[use], y[use], std[use]
    nis = float(np.sum((y - Y.mean(axis=1)) ** 2 / (Y.var(axis=1, ddof=1) + std**2)))
    if stochastic:
        return stochastic_update(E, Y, y, std[:, None] * draws[use]), nis, y.size
    return square_root_update(E, Y, y, std**2), nis, y.size
