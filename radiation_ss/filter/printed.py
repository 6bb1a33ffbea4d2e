"""The dual ensemble Kalman filter as the paper prints it (14)-(34), one step; the readable NumPy version.

Two ensembles take turns (section 3.2, Fig. 3): force i is corrected by the acceleration, through the equation of motion
at state i; then state and parameters of member i by displacement and velocity. `printed_loop` does the same in one
loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.ensemble import analysis
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


class Ensembles(NamedTuple):
    """The two ensembles, moved in place; columns are members."""

    theta: FloatArray  # (n_theta, members)
    z: FloatArray      # (m + 3 n, members): radiation states, displacement, velocity; the force's ensemble


class Variant(NamedTuple):
    """What the paper leaves open, or what can be done in its place."""

    perturbed: bool = True    # perturbed observations (34); otherwise the square-root analysis
    force_first: bool = True  # the force's analysis before that of state and parameters, as section 3.2 has it
    three_point: bool = False  # three-point draws in place of Gaussian ones
    inflation: float = 1.0    # factor on the spread of state and parameters after their analysis


def printed_step(plan: Plan, ensembles: Ensembles, noise: Noise, constraint: Constraint, variant: Variant,
                 sample: tuple[FloatArray, float, int], draws: FloatArray) -> tuple[float, int]:
    """Take one sample; return the sum of squared normalised innovations and the number of channels used.

    Parameters
    ----------
    sample : (ndarray, float, int)
        Displacement, velocity, acceleration, shape (3 n,), NaN where missing; dt and the number of Runge-Kutta steps of
        dt that lead to it.
    draws : ndarray, shape (noise.rows, members)
        Standard normal (or moment-matched) draws in the order of Noise; the square root needs the first three parts.
    """
    y, dt, steps = sample
    n, base, (theta, z) = plan.n, plan.m + 2 * plan.n, ensembles
    on_theta, on_z, on_f, on_motion, on_acceleration = np.split(draws, np.cumsum([part.size for part in noise])[:-1])
    for _ in range(steps):
        z[:base] = rk4(lambda x: derivative(plan, theta, x, z[base:]), z[:base], dt)
    z[:base] += noise.state[:, None] * on_z
    theta += noise.theta[:, None] * on_theta
    z[base:] += noise.force[:, None] * on_f

    def force() -> tuple[float, int]:
        return _assimilate([z[base:]], acceleration(plan, z[:base], z[base:]), y[2 * n:], noise.acceleration,
                           on_acceleration if variant.perturbed else None)

    def motion() -> tuple[float, int]:
        predicted = np.vstack([z[plan.m:base], constraint.H @ theta])
        found = _assimilate([theta, z[:base]], predicted, np.r_[y[:2 * n], constraint.y], noise.motion,
                            on_motion if variant.perturbed else None)
        for E in (theta, z[:base]):
            mean = E.mean(axis=1, keepdims=True)
            E[:] = mean + variant.inflation * (E - mean)
        return found

    results = [part() for part in ((force, motion) if variant.force_first else (motion, force))]
    return sum(nis for nis, _ in results), sum(used for _, used in results) - constraint.y.size


def _assimilate(parts: list[FloatArray], Y: FloatArray, y: FloatArray, std: FloatArray,
                draws: FloatArray | None) -> tuple[float, int]:
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
