"""What a filter needs of the model, as plain arrays: one derivative serves both filters and the compiled loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.inference.subsystems import Subsystems


class Plan(NamedTuple):
    """Constants of the equation of motion (9)-(13) with parameters free.

    The state of a member is [radiation states (m); displacement (n); velocity (n)]; arrays hold members as columns.
    """

    pairs: np.ndarray      # (n_pairs, 5): force dof, velocity dof, offset in theta, offset in state, order
    inverse: FloatArray    # (n, n): (M + A_inf)^-1
    stiffness: FloatArray  # (n, n): C
    damping: FloatArray    # (n, n): D
    m: int                 # radiation states

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.inverse.shape[0]


class Samples(NamedTuple):
    """Samples as the loops take them; dts lead to each sample, in `steps` Runge-Kutta steps."""

    y: FloatArray      # (nt, channels); NaN where missing
    dts: FloatArray    # (nt,) [s]
    steps: np.ndarray  # (nt,)

    def part(self, first: int, last: int) -> Samples:
        """Return some of them."""
        return Samples(self.y[first:last], self.dts[first:last], self.steps[first:last])


def plan_of(model: Model, parts: Subsystems) -> Plan:
    """Return the plan of a model whose radiation model has the given subsystems."""
    inverse = np.array(np.linalg.inv(model.M + model.A_inf), dtype=float)
    return Plan(parts.pairs, inverse, np.array(model.C), np.array(model.D), parts.states)


def acceleration(plan: Plan, z: FloatArray, f: FloatArray) -> FloatArray:
    """Return xi'' by the equation of motion (1), shape (n, members)."""
    m, n = plan.m, plan.n
    net = f - plan.stiffness @ z[m:m + n] - plan.damping @ z[m + n:m + 2 * n]
    for j, _, _, at, order in plan.pairs:
        net[j] -= z[at + order - 1]  # the radiation force
    return plan.inverse @ net


def derivative(plan: Plan, theta: FloatArray, z: FloatArray, f: FloatArray) -> FloatArray:
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


def rk4(rate: Callable[[FloatArray], FloatArray], z: FloatArray, dt: float) -> FloatArray:
    """Return z after one classical Runge-Kutta step of z' = rate(z)."""
    k1 = rate(z)
    k2 = rate(z + 0.5 * dt * k1)
    k3 = rate(z + 0.5 * dt * k2)
    k4 = rate(z + dt * k3)
    return z + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def longest_step(parts: Subsystems, model: Model, theta: FloatArray) -> float:
    """Return the longest RK4 step [s] that keeps |eigenvalue| dt below 0.3 for parameters (..., n_theta)."""
    fastest = max(np.abs(p).max() for p in parts.poles(theta))
    natural = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(model.M + model.A_inf, model.C))).max())
    return float(0.3 / max(fastest, natural, 1e-9))
