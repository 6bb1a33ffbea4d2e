"""The paper's filter as an object with state; see `printed` for its step. Everything inside is in the paper's units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.filter.engines import Outcome
from radiation_ss.filter.members import Members
from radiation_ss.filter.plan import Plan, Samples
from radiation_ss.filter.printed import Constraint, Ensembles, Noise, Variant
from radiation_ss.filter.printed_loop import printed_loop


class Units(NamedTuple):
    """Units in which the paper's filter works: everything is of order one in them."""

    length: FloatArray  # (n,) [m or rad]: of each degree of freedom
    mass: float         # [kg]: of the first one
    time: float         # [s]

    @property
    def force(self) -> FloatArray:
        """Units of force (n,) [N or N m]: force times displacement is one energy for all."""
        return self.mass * self.length[0] ** 2 / self.time**2 / self.length

    @property
    def motion(self) -> FloatArray:
        """Units of displacements, velocities and accelerations, shape (3 n,)."""
        return np.concatenate([self.length, self.length / self.time, self.length / self.time**2])

    def parameters(self, plan: Plan) -> FloatArray:
        """Return the units of theta: a_l in time^-(n - l + 1), b_l in force over velocity, times the same."""
        gain = np.ones(int((plan.pairs[:, 2] + 2 * plan.pairs[:, 4]).max()))
        for j, k, offset, _, order in plan.pairs:
            powers = self.time ** -np.arange(order, 0.0, -1.0)
            gain[offset:offset + order] = powers
            gain[offset + order:offset + 2 * order] = self.force[j] * self.time / self.length[k] * powers
        return gain

    def plan(self, plan: Plan) -> Plan:
        """Return the plan in these units."""
        return plan._replace(inverse=plan.inverse * self.force * self.time**2 / self.length[:, None],
                             stiffness=plan.stiffness * self.length / self.force[:, None],
                             damping=plan.damping * self.length / self.time / self.force[:, None])


class PaperEngine:
    """The paper's filter."""

    def __init__(self, plan: Plan, drawn: Members, noise: Noise, constraint: Constraint, units: Units,
                 variant: Variant, generator: np.ndarray) -> None:
        self.units, self.gain, self.n = units, units.parameters(plan), plan.n
        self.plan, self.noise, self.constraint, self.variant = units.plan(plan), noise, constraint, variant
        self.generator = generator
        self.unstable = drawn.unstable
        self.state = Ensembles(np.ascontiguousarray(drawn.theta / self.gain[:, None]),
                               np.zeros((plan.m + 3 * plan.n, drawn.theta.shape[1])))

    def advance(self, samples: Samples) -> Outcome:
        """Take samples; known forces are not used."""
        units, out = self.units, Outcome.empty(samples.dts.size, self.n, self.gain.size)
        scaled = Samples(np.ascontiguousarray(samples.y[:, :3 * self.n] / units.motion), samples.dts / units.time,
                         samples.steps)
        printed_loop(self.plan, self.state, self.noise, self.constraint, self.variant, self.generator, scaled, out)
        for part, unit in zip(out, (units.force, units.force, self.gain, self.gain)):
            part *= unit
        return out

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Refuse: the paper takes no sample twice."""
        raise InputError("settle: only the default filter takes samples again; use preset=None")

    def members(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.state.theta * self.gain[:, None]

    def drawn(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.members()

    def projected(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble as it is: the paper repairs nothing after the start."""
        return self.members(), {"repaired": self.unstable}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""
        return self.state._asdict() | {"generator": self.generator}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""
        self.state = Ensembles(*(np.ascontiguousarray(arrays[key]) for key in Ensembles._fields))
        self.generator = np.ascontiguousarray(arrays["generator"])
