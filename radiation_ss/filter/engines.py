"""The two filters as objects with state: start, advance over samples, hand out and take back their arrays."""

from __future__ import annotations

from dataclasses import fields
from typing import NamedTuple, Protocol

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.marginal import Cloud, observation_matrix, start_covariance
from radiation_ss.filter.marginal_loop import marginal_loop
from radiation_ss.filter.members import Drawing, Members
from radiation_ss.filter.plan import Plan
from radiation_ss.filter.printed import Constraint, Noise
from radiation_ss.filter.printed_loop import GAUSSIAN, THREE_POINT, printed_loop
from radiation_ss.filter.relearn import Relearning, Window
from radiation_ss.inference.scales import Scales

LEARN = {"never": 0, "known-force": 1, "always": 2}
DRAWS = {"gaussian": GAUSSIAN, "three-point": THREE_POINT}


class Outcome(NamedTuple):
    """What the samples gave, time first; `baseline` is the force with the parameters at their start."""

    force: FloatArray
    force_std: FloatArray
    theta: FloatArray
    theta_std: FloatArray
    baseline: FloatArray
    nis: FloatArray
    used: np.ndarray


def _outcome(samples: int, n: int, n_theta: int) -> Outcome:
    force, force_std, theta, theta_std = (np.empty((samples, size)) for size in (n, n, n_theta, n_theta))
    return Outcome(force, force_std, theta, theta_std, np.full((samples, n), np.nan), np.zeros(samples),
                   np.zeros(samples, dtype=np.int64))


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


class Engine(Protocol):
    """A filter with state."""

    def advance(self, y: FloatArray, dts: FloatArray, steps: np.ndarray) -> Outcome:
        """Take samples y (nt, 4 n): displacement, velocity, acceleration, known force; NaN where missing.

        dts (nt,) [s] lead to each sample, in `steps` (nt,) Runge-Kutta steps.
        """

    def members(self) -> FloatArray:
        """Return the ensemble of parameters, (n_theta, members)."""

    def drawn(self) -> FloatArray:
        """Return the ensemble as it was drawn, (n_theta, members): its spread is that of the parameters."""

    def kept(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble with its members repaired as the filter does it, and how many were, from the start."""

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""


class MarginalEngine:
    """The default filter; see `marginal`, and `relearn` for the iterated update.

    `counts` are members repaired so far: unstable ones and ones that were not passive.
    """

    def __init__(self, plan: Plan, drawing: Drawing, scales: Scales, force: ForceModel, gate: float,
                 learn: str) -> None:
        self.plan, self.force, self.gate, self.learn = plan, force, gate, LEARN[learn]
        self.q = np.ascontiguousarray(force.q.ravel())
        self.r = np.where(np.isfinite(scales.noise), scales.noise, 1.0).ravel() ** 2
        self.H = observation_matrix(plan)
        self.placed = drawing.members()
        self.counts = np.array([self.placed.unstable, self.placed.not_passive])
        theta = np.column_stack([self.placed.theta, self.placed.centre, drawing.parts.theta])
        self.cloud = Cloud(np.ascontiguousarray(theta), np.zeros((plan.m + 4 * plan.n, theta.shape[1])),
                           start_covariance(plan, theta[:, -1], scales, force), np.zeros(4 * plan.n, dtype=np.int64),
                           np.full(4 * plan.n, np.nan), np.zeros(4 * plan.n, dtype=np.int64))
        self.relearn = Relearning(plan, force, self.q, self.H, self.r, self.cloud.P.copy(), self.learn, drawing)
        self.seen = np.zeros((drawing.size, drawing.size))
        self.window = Window.empty(4 * plan.n) if self.learn and drawing.size else None

    def advance(self, y: FloatArray, dts: FloatArray, steps: np.ndarray) -> Outcome:
        """Take samples; where the window is full, take it again before going on."""
        out = _outcome(y.shape[0], self.plan.n, self.cloud.theta.shape[0])
        first = 0
        while first < y.shape[0]:
            last = y.shape[0] if self.window is None else min(y.shape[0], first + self.window.room)
            here = slice(first, last)
            taken = self._take(y[here], dts[here], steps[here], Outcome(*(part[here] for part in out)))
            if self.window is not None:
                self.window.add(y[here], dts[here], steps[here], taken)
                if not self.window.room:
                    self.settle()
                    self.window = self.window.doubled()
            first = last
        return out

    def _take(self, y: FloatArray, dts: FloatArray, steps: np.ndarray, out: Outcome) -> np.ndarray:
        cloud, taken = self.cloud, np.zeros(y.shape, dtype=np.bool_)
        marginal_loop(self.plan.plant, self.force.A, self.q, self.H, self.r, self.gate, self.learn,
                      cloud.theta, cloud.z, cloud.P, cloud.streak, cloud.last, cloud.same, y, dts, steps,
                      out[:5], out.nis, out.used, taken)
        return taken

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Take the window again; return mean and standard deviation of the parameters, each (n_theta,)."""
        if self.window is not None and self.relearn.learns(self.window):
            found = self.relearn(self.window, self.cloud)
            if found is not None:
                self.placed, self.seen = found
                self.counts += self.placed.unstable, self.placed.not_passive
        return self.cloud.theta[:, self.cloud.members].copy(), self.drawn().std(axis=1, ddof=1)

    def members(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.cloud.theta[:, :self.cloud.members]

    def drawn(self) -> FloatArray:
        """Return the members before repairs; as they are, where the recursion has moved them since.

        A repair puts a member onto the boundary of the physical region. That is no condition on the region: it takes
        spread away without telling anything.
        """
        return self.placed.drawn if np.array_equal(self.placed.theta, self.members()) else self.members()

    def kept(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble with members that left the physical region since the last repair put back."""
        found = self.relearn.drawing.physical(self.members(), self.cloud.theta[:, self.cloud.members], self.seen)
        unstable, not_passive = self.counts + (found.unstable, found.not_passive)
        return found.theta, {"repaired": int(unstable), "made_passive": int(not_passive)}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""
        kept = {} if self.window is None else {f"window_{f.name}": getattr(self.window, f.name) for f in fields(Window)}
        return {field.name: getattr(self.cloud, field.name) for field in fields(Cloud)} | {"counts": self.counts,
                                                                                          "seen": self.seen,
                                                                                          "drawn": self.drawn()} | kept

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""
        self.cloud = Cloud(*(np.ascontiguousarray(arrays[field.name]) for field in fields(Cloud)))
        self.counts, self.seen, self.window = arrays["counts"], arrays["seen"], None
        self.placed = self.placed._replace(theta=self.members().copy(), drawn=arrays["drawn"])
        if "window_y" in arrays:
            y, dts, steps, count = (arrays[f"window_{f.name}"] for f in fields(Window))
            self.window = Window(y, dts, steps, int(count))


class PrintedEngine:
    """The paper's filter; see `printed`. Everything inside is in the paper's units."""

    def __init__(self, plan: Plan, drawn: Members, noise: Noise, constraint: Constraint, units: Units,
                 state: np.ndarray, perturbed: bool, draws: str, inflation: float = 1.0) -> None:
        self.units, self.gain, self.n = units, units.parameters(plan), plan.n
        self.plan = units.plan(plan)
        self.noise, self.constraint, self.perturbed, self.draws = noise, constraint, perturbed, DRAWS[draws]
        self.inflation = inflation
        self.theta, self.unstable = np.ascontiguousarray(drawn.theta / self.gain[:, None]), drawn.unstable
        self.z, self.state = np.zeros((plan.m + 3 * plan.n, self.theta.shape[1])), state

    def advance(self, y: FloatArray, dts: FloatArray, steps: np.ndarray) -> Outcome:
        """Take samples; known forces are not used."""
        units, out = self.units, _outcome(y.shape[0], self.n, self.theta.shape[0])
        observed = np.ascontiguousarray(y[:, :3 * self.n] / units.motion)
        printed_loop(self.plan.plant, self.theta, self.z, tuple(self.noise), self.constraint.H, self.constraint.y,
                     self.state, self.draws, self.perturbed, self.inflation, observed, dts / units.time, steps,
                     out[:4], out.nis, out.used)
        for part, unit in zip(out, (units.force, units.force, self.gain, self.gain)):
            part *= unit
        return out

    def members(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.theta * self.gain[:, None]

    def drawn(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.members()

    def kept(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble as it is: the paper repairs nothing after the start."""
        return self.members(), {"repaired": self.unstable}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""
        return {"theta": self.theta, "z": self.z, "generator": self.state}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""
        self.theta, self.z, self.state = (np.ascontiguousarray(arrays[key]) for key in ("theta", "z", "generator"))
