"""What goes into the filters' loops and comes out of them, as plain arrays."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.settings import ForceModel, natural_frequencies
from radiation_ss.fit.result import RadiationFit
from radiation_ss.inference.scales import SignalScales, channel_names
from radiation_ss.inference.subsystems import Subsystems


class MotionPlan(NamedTuple):
    """Constants of the equation of motion (9)-(13), parameters free."""

    pairs: np.ndarray      # (n_pairs, 5): force dof, velocity dof, offset in theta, offset in state, order
    inverse: FloatArray    # (n, n): (M + A_inf)^-1
    stiffness: FloatArray  # (n, n): C
    damping: FloatArray    # (n, n): D
    m: int                 # radiation states

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.inverse.shape[0]


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

    def parameters(self, plan: MotionPlan) -> FloatArray:
        """Return the units of theta: a_l in time^-(n - l + 1), b_l in force over velocity, times the same."""
        gain = np.ones(int((plan.pairs[:, 2] + 2 * plan.pairs[:, 4]).max()))
        for j, k, offset, _, order in plan.pairs:
            powers = self.time ** -np.arange(order, 0.0, -1.0)
            gain[offset:offset + order] = powers
            gain[offset + order:offset + 2 * order] = self.force[j] * self.time / self.length[k] * powers
        return gain

    def plan(self, plan: MotionPlan) -> MotionPlan:
        """Return the plan in these units."""
        return plan._replace(inverse=plan.inverse * self.force * self.time**2 / self.length[:, None],
                             stiffness=plan.stiffness * self.length / self.force[:, None],
                             damping=plan.damping * self.length / self.time / self.force[:, None])


class SampleBlock(NamedTuple):
    """Samples as the loops take them; dts lead to each sample, in `steps` Runge-Kutta steps."""

    y: FloatArray      # (nt, 4 n): displacement, velocity, acceleration, known force; NaN where missing
    dts: FloatArray    # (nt,) [s]
    steps: np.ndarray  # (nt,)

    @classmethod
    def of(cls, time: FloatArray, y: FloatArray, last: float, interval: float, longest: float,
           tolerance: float = 1e-3, longest_gap: float = 3600.0) -> SampleBlock:
        """Return the samples y (4 n, nt) at some times, after one at `last` (NaN: none), in steps of at most `longest`.

        Intervals within a relative `tolerance` of the usual one count as equal to it: only they enter the filter, and
        rounded times then give the same numbers as exact ones. InputError if time goes back, or ascends by more than
        `longest_gap` [s] at once.
        """
        dts = time - np.concatenate([time[:1] if np.isnan(last) else [last], time[:-1]])
        if not dts.min() >= 0.0:
            raise InputError(f"time: {time[int(np.argmin(dts))]:g} s comes after a later sample; samples must be in "
                             "order")
        if dts.max() > longest_gap:
            at = int(np.argmax(dts))
            raise InputError(f"time: {time[at]:.10g} s comes {dts[at]:.4g} s after the sample before, more than "
                             f"{longest_gap:g} s; where the clock was set, go on with times by the old one, else start "
                             "anew with prepare(record)")
        dts = np.where(np.abs(dts - interval) <= tolerance * interval, interval, dts)
        return cls(np.ascontiguousarray(y.T), dts, np.ceil(dts / longest - 1e-9).astype(np.int64))

    def part(self, first: int, last: int) -> SampleBlock:
        """Return some of them."""
        return SampleBlock(*(values[first:last] for values in self))


class Outcome(NamedTuple):
    """What the samples gave, time first; `baseline` is the force with the parameters at their start."""

    force: FloatArray
    force_std: FloatArray
    theta: FloatArray
    theta_std: FloatArray
    baseline: FloatArray
    nis: FloatArray    # (nt,): sum of squared normalised innovations
    taken: np.ndarray  # (nt, 4 n): whether a channel was used

    @classmethod
    def empty(cls, samples: int, n: int, n_theta: int) -> Outcome:
        """Return room for some samples."""
        force, force_std, theta, theta_std, baseline = (np.empty((samples, k)) for k in (n, n, n_theta, n_theta, n))
        return cls(force, force_std, theta, theta_std, baseline, np.zeros(samples),
                   np.zeros((samples, 4 * n), dtype=np.bool_))

    def check_finite(self, time: FloatArray) -> None:
        """Raise SolverError if the filter has diverged by the last of some times."""
        if not (np.isfinite(self.theta[-1]).all() and np.isfinite(self.force[-1]).all()):
            at = int(np.argmin(np.isfinite(self.force).all(axis=1) & np.isfinite(self.theta).all(axis=1)))
            raise SolverError(f"the filter diverged at {time[at]:g} s: its members are no longer finite")

    def part(self, first: int, last: int) -> Outcome:
        """Return some of them."""
        return Outcome(*(values[first:last] for values in self))


def plan_of(model: Model, parts: Subsystems) -> MotionPlan:
    """Return the plan of a model whose radiation model has the given subsystems."""
    inverse = np.array(np.linalg.inv(model.M + model.A_inf), dtype=float)
    return MotionPlan(parts.pairs, inverse, np.array(model.C), np.array(model.D), parts.states)


def longest_step(parts: Subsystems, model: Model, theta: FloatArray, reach: float = 0.3) -> float:
    """Return the longest RK4 step [s] that keeps |eigenvalue| dt below `reach` for parameters (..., n_theta)."""
    fastest = max(np.abs(p).max() for p in parts.poles(theta))
    return float(reach / max(fastest, natural_frequencies(model).max(), 1e-9))


def start_covariance(fit: RadiationFit, scales: SignalScales, force: ForceModel) -> FloatArray:
    """Return the state's covariance before the first sample: motion within three of its standard deviations, radiation
    states as a harmonic velocity of the motion's size leaves them (5), force states.
    """
    speed, radiation = scales.motion * scales.omega, np.zeros(fit.states)
    for k, w in enumerate(scales.omega):
        left = np.linalg.solve(1j * w * np.eye(fit.states) - fit.a, fit.b[:, k] * speed[k])
        radiation += 2.0 * np.abs(left) ** 2
    return np.diag(np.r_[radiation, (3.0 * scales.motion) ** 2, (3.0 * speed) ** 2, force.start.ravel()])


@cache
def rows_of(dofs: tuple[str, ...]) -> dict[str, int]:
    """Return the row of each channel's name in a block of samples."""
    return {name: row for row, name in enumerate(channel_names(dofs))}


def sampled(sample: Mapping[str, float], dofs: tuple[str, ...]) -> tuple[float, FloatArray]:
    """Return time and channels, shape (size, 1), of one live sample."""
    rows = rows_of(dofs)
    y = np.full((len(rows), 1), np.nan)
    if not isinstance(sample, Mapping):
        raise InputError(f"step: {type(sample).__name__} found; a mapping of `time` and channels to numbers is needed")
    for name, value in sample.items():
        if name != "time" and name not in rows:
            raise InputError(f"step: channel {name!r} is unknown; a sample has `time` and any of {', '.join(rows)}")
        plain = float(value) if isinstance(value, (np.floating, np.integer)) else value
        if not isinstance(plain, (int, float)) or abs(plain) > sys.float_info.max:
            raise InputError(f"step: {name} is {value!r}; a finite number is needed, or NaN where it is missing")
        if name != "time":
            y[rows[name], 0] = plain
    if not isfinite(sample.get("time", nan)):
        raise InputError("step: `time` [s] is missing; every sample needs it")
    return float(sample["time"]), y
