"""Motion of the composite with effects, its exact derivatives, and what the sensors read of it.

The linear model is stepped exactly by its matrix exponential; exciting force and effects are stepped by the classical
Runge-Kutta method in the frame that moves with it (Lawson 1967). Derivatives follow by CasADi's Jacobians at the
stages of each step, so they belong to the discrete solution itself. Readings are at any times, with delays, gains and
biases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.errors import SolverError
from radiation_ss.hydro.measures import statically_unstable, unstable_text
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.equations import MotionEquations, sensed
from radiation_ss.simulation.prepared import Channel, Prepared, half_steps

Parts = tuple[FloatArray, NDArray[np.int64]]  # states and accelerations at the stages of parts of steps, and where


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory on a uniform grid: state (nt, ns), acceleration (nt, n), and derivatives for nc columns if asked."""

    state: FloatArray
    acceleration: FloatArray | None = None
    d_state: FloatArray | None = None
    d_acceleration: FloatArray | None = None


@dataclass(frozen=True)
class EquationKey:
    """A model and effects on their places, whatever their numbers: what equations in symbols depend on."""

    parts: tuple[object, ...]
    model: Model = field(compare=False)
    actives: tuple[Active, ...] = field(compare=False)


@lru_cache(maxsize=32)
def equations_of(key: EquationKey) -> MotionEquations:
    """Return the equations of motion; the last ones asked for are kept."""
    return MotionEquations(key.model, key.actives)


class TooManySteps(SolverError):
    """Effects set in so sharply that steps are split into too many."""


class Rollout:
    """The composite with a set of effects in steps of h [s]; built once, used for any record and parameters.

    A step is halved up to `halvings` times while its error is more than `accuracy` of a state's largest value so far.
    TooManySteps where a record takes `most` steps.
    """

    def __init__(self, model: Model, actives: Sequence[Active], h: float, halvings: int = 0,
                 accuracy: float = 1e-4, most: int = 4_000_000) -> None:
        self.model, self.actives, self.h, self.accuracy, self.most = model, tuple(actives), float(h), accuracy, most
        forms = tuple(a.form for a in self.actives)
        self.equations = equations = equations_of(EquationKey((id(model), *forms), model, self.actives))
        self.offsets, self.np, self.own, self.ns = equations.offsets, equations.np, equations.own, equations.ns
        self.linear, self.rows = equations.linear, equations.stepped
        self.half = np.array([expm(self.linear * 0.5**k * self.h) for k in range(1, halvings + 2)])
        self.whole = self.half @ self.half
        self.clocks = np.array([k for i, a in enumerate(self.actives) if a.effect.clock_in is not None
                                for k in range(self.offsets[i], self.offsets[i + 1])], dtype=np.int64)
        self._drives: dict[Prepared, tuple[FloatArray, FloatArray]] = {}
        self._chains: dict[tuple[int, str], SensorChain] = {}

    def run(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, *,
            columns: FloatArray | None = None, d_start: FloatArray | None = None,
            acceleration: bool = True) -> Motion:
        """Step through a record from `start` (ns,), with `drive` (nt, 9, drives), uniform times and the parameters p
        (np,).

        `columns` (np, nc), `d_start` (ns, nc): directions of parameters and start whose derivatives are wanted.
        `acceleration`: whether it is wanted; displacement sensors do without.
        """
        path, parts = self.path(start, drive, time, p, kept=columns is not None)
        d_state = None
        if columns is not None and d_start is not None:
            d_state = self.derivatives(parts, drive, time, p, columns, d_start)
        if not acceleration:
            return Motion(path, None, d_state)
        here = drive[:, [0, 3, 6]]
        value = self.mapped("acceleration")(time.size, path[:, None], here, time[:, None, None], p)[:, 0]
        if d_state is None or columns is None:
            return Motion(path, value)
        point = np.concatenate([path, value], axis=1)[:, None]
        n, v = self.model.n, self.model.fit.states + self.model.n
        slope = self.mapped("slope")(time.size, point, here, time[:, None, None], p)
        slope = slope.transpose(0, 2, 1)[:, :n]
        by_state = slope[:, :, : self.ns] + self.linear[v:v + n]
        return Motion(path, value, d_state, by_state @ d_state + slope[:, :, self.ns:] @ columns)

    def path(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray,
             kept: bool = True) -> tuple[FloatArray, Parts]:
        """Return the states (nt, ns), and if `kept` what derivatives need."""
        from radiation_ss.simulation.steps import walk

        rates, n, v = self.mapped("rates"), self.model.n, self.model.fit.states + self.model.n
        states = np.empty((time.size, self.ns))
        states[0] = start
        dynamics = self.half, self.whole, self.linear[v:v + n]
        limits = self.accuracy, 1e12 * (1.0 + float(np.abs(start).max())), self.most
        parts = walk((rates.each, *rates.prepared(p)), dynamics, self.rows, self.h, (drive, time), states, limits, kept)
        if parts[1].shape[0] == self.most:
            raise TooManySteps(f"effects: their forces set in so sharply that more than {self.most} steps are needed")
        if not np.isfinite(states).all():
            raise SolverError(f"the motion grows without bounds{self.why_unstable()}")
        return states, parts

    def why_unstable(self) -> str:
        """Return what makes the motion grow: the model itself, or its effects."""
        if loose := statically_unstable(self.model.M, self.model.C, self.model.dofs):
            return f"; {unstable_text(loose)}"
        return "; the effects make the model unstable" if self.actives else "; the model is unstable"

    def derivatives(self, parts: Parts, drive: FloatArray, time: FloatArray, p: FloatArray, columns: FloatArray,
                    d_start: FloatArray, largest: float = 1e150) -> FloatArray:
        """Return the derivatives of the states along a path in known parts of steps, shape (nt, ns, nc).

        Those that grow without bounds, beyond the `largest` whose square is a number, are not known: nan.
        """
        from radiation_ss.simulation.steps import propagate_slopes

        slope, result = self.mapped("slope"), np.empty((time.size, *d_start.shape))
        result[0] = d_start
        propagate_slopes((slope.each, *slope.prepared(p)), (self.half, self.whole), self.rows, self.h, (drive, time),
                         parts, np.ascontiguousarray(columns), result)
        if not max(result.max(initial=0.0), -result.min(initial=0.0)) < largest:
            result[~(np.abs(result) < largest)] = np.nan
        return result

    def mapped(self, name: str) -> Compiled:
        """Return one of the equations' functions for many samples."""
        kept = self.equations.compiled
        if name not in kept:
            kept[name] = Compiled(getattr(self.equations, name))
        return kept[name]

    def drive(self, prepared: Prepared, p: FloatArray) -> FloatArray:
        """Return a record's force at the times at which it acts, as `Prepared.drive` does; kept while these stay."""
        known = self._drives.get(prepared)
        if known is None or not np.array_equal(known[0], p[self.clocks]):
            times = half_steps(prepared.grid)
            late = self.mapped("clock")(times.size, times[:, None, None], p)[:, 0] if self.clocks.size else None
            known = self._drives[prepared] = (p[self.clocks], prepared.drive(late))
        parts = [known[1]]
        if self.equations.waves:
            parts.append(prepared.wave_drive)
        if self.equations.towed:
            speed = np.where(np.arange(9) < 3, prepared.record.speed, 0.0)[:, None]
            parts.append(np.broadcast_to(speed, (*parts[0].shape[:2], 1)))
        return np.concatenate(parts, axis=2) if len(parts) > 1 else parts[0]

    def chain(self, channel: Channel) -> "SensorChain":
        """Return the sensor effects that touch a channel."""
        key = (channel.dof, channel.quantity)
        if key not in self._chains:
            self._chains[key] = SensorChain(self, channel)
        return self._chains[key]


def reading(rollout: Rollout, motion: Motion, grid: FloatArray, channel: Channel, p: FloatArray,
            columns: FloatArray | None = None) -> tuple[FloatArray, FloatArray | None]:
    """Return a channel's predicted samples (nk,) and their derivatives (nk, nc). Sensor effects act on the
    displacement's sensor where there is one, on every sensor where there is none.
    """
    chain = rollout.chain(channel)
    time = chain.clock(channel.time, p)
    values, slopes, derivatives = zip(*(interpolate(
        rollout, motion, grid, dof, channel.quantity, time, channel.under_way) for dof in chain.dofs))
    return chain.read(channel.time, time, np.array(values), np.array(slopes), derivatives, p, columns)


class SensorChain:
    """The sensor effects that touch one channel, composed into one expression."""

    def __init__(self, rollout: Rollout, channel: Channel) -> None:
        dofs = rollout.model.dofs
        p = ca.SX.sym("p", rollout.np)
        touching = [(a, values) for a, (_, values) in zip(rollout.actives, rollout.equations.of(p)) if a.effect.sensor
                    and a.dof in (dofs[channel.dof], "")
                    and (a.of_first_sensor if channel.quantity == "displacement" else a.of_other_sensors)]
        self.dofs = [channel.dof] + [dofs.index(a.other) for a, _ in touching if a.other]
        self.late = any(a.effect.clock_out for a, _ in touching)
        t, y = ca.SX.sym("t"), ca.SX.sym("y", len(self.dofs))
        slope, now = ca.SX.sym("dy", len(self.dofs)), ca.SX.sym("now")
        clock: Any = t
        for active, parameters in touching:
            if active.effect.clock_out is not None:
                clock = active.effect.clock_out(SimpleNamespace(t=clock), parameters)
        # The value at the clock's present time, to first order around it, so that derivatives see the clock.
        first, *others = ca.vertsplit(y + slope * (clock - now))
        read, point = sensed(touching, first, others, t), [t, now, y, slope, p]
        functions = {"clock": ([t, p], clock), "read": (point, read),
                     "slope": (point, ca.jacobian(read, ca.vertcat(y, p)))} if touching else {}
        self.functions = {name: Compiled(ca.Function(name, given, [ca.densify(value)]))
                          for name, (given, value) in functions.items()}

    def clock(self, time: FloatArray, p: FloatArray) -> FloatArray:
        """Return the times at which the channel is really read."""
        return self.functions["clock"](time.size, time[:, None, None], p)[:, 0, 0] if self.late else time

    def read(self, nominal: FloatArray, time: FloatArray, values: FloatArray, slopes: FloatArray,
             derivatives: Sequence[FloatArray | None], p: FloatArray,
             columns: FloatArray | None) -> tuple[FloatArray, FloatArray | None]:
        """Return the readings and their derivatives."""
        if not self.functions:
            return values[0], derivatives[0]
        point = (nominal[:, None, None], time[:, None, None], values.T[:, None], slopes.T[:, None], p)
        result = self.functions["read"](time.size, *point)[:, 0, 0]
        if columns is None:
            return result, None
        slope = self.functions["slope"](time.size, *point)[:, :, 0]
        gradient = slope[:, len(self.dofs):] @ columns
        for i, d_value in enumerate(derivatives):
            assert d_value is not None
            gradient = gradient + slope[:, [i]] * d_value
        return result, gradient


def interpolate(rollout: Rollout, motion: Motion, grid: FloatArray, dof: int, quantity: str,
                time: FloatArray, under_way: bool = False) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return value, slope in time and derivatives of one quantity at any times, by cubic Hermite polynomials. Before
    the start the first one goes on where the body is under way; one that is released goes on as fast as it starts.
    """
    at, order, h = rollout.model.fit.states + dof, QUANTITIES.index(quantity), grid[1] - grid[0]
    place = np.clip((time - grid[0]) / h, -np.inf if under_way else 0.0, grid.size - 1 - 1e-9)
    k = np.maximum(place, 0.0).astype(int)
    f = place - k
    early = np.zeros(time.size) if under_way else np.minimum(time - grid[0], 0.0)
    weights = 1 - 3 * f**2 + 2 * f**3, h * (f - 2 * f**2 + f**3), 3 * f**2 - 2 * f**3, h * (f**3 - f**2), early

    def known(state: FloatArray, acceleration: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Return the quantity and its rate at the grid's times; of the acceleration by central differences."""
        nodes = [state[:, at], state[:, at + rollout.model.n]]
        nodes += [] if acceleration is None else [acceleration[:, dof]]
        return nodes[order], nodes[order + 1] if order < 2 else np.gradient(nodes[2], h, axis=0)

    def blend(y: FloatArray, d: FloatArray) -> FloatArray:
        a, b, c, e, before = (w.reshape(-1, *[1] * (y.ndim - 1)) for w in weights)
        return a * y[k] + b * d[k] + c * y[k + 1] + e * d[k + 1] + before * d[:1]

    y, d = known(motion.state, motion.acceleration)
    slope = (6 * f * (f - 1) * (y[k] - y[k + 1]) / h + (1 - 4 * f + 3 * f**2) * d[k] + (3 * f**2 - 2 * f) * d[k + 1])
    moved = None if motion.d_state is None else blend(*known(motion.d_state, motion.d_acceleration))
    return blend(y, d), slope, moved
