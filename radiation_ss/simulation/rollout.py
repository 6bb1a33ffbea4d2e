"""Motion of the composite with effects, its exact derivatives, and what the sensors read of it.

The linear model is stepped exactly by its matrix exponential; exciting force and effects are stepped by the classical
Runge-Kutta method in the frame that moves with it (Lawson 1967). Derivatives follow by CasADi's Jacobians at the
stages of each step, so they belong to the discrete solution itself. Readings are at any times, with delays, gains and
biases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.errors import SolverError
from radiation_ss.hydro.measures import statically_unstable, unstable_text
from radiation_ss.simulation.compiled import BLOCK, Compiled
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.prepared import QUANTITIES, Channel, Prepared, half_steps

Path = tuple[FloatArray, FloatArray]  # states at the grid times; states and accelerations at each step's stages


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


class Rollout:
    """The composite with a set of effects as one step function; built once, used for any record and parameters.

    `ns` and `np`, the numbers of states and of parameters, are those of `MotionEquations`; h is the step [s].
    """

    def __init__(self, model: Model, actives: Sequence[Active], h: float) -> None:
        self.model, self.actives, self.h = model, tuple(actives), float(h)
        places = tuple((id(a.effect), a.dof, a.other) for a in self.actives)
        self.equations = equations = equations_of(EquationKey((id(model), *places), model, self.actives))
        self.offsets, self.np, self.own, self.ns = equations.offsets, equations.np, equations.own, equations.ns
        f, _ = model.matrices()
        self.linear = np.zeros((self.ns, self.ns))
        self.linear[: f.shape[0], : f.shape[0]] = f
        self.half = expm(self.linear * 0.5 * self.h)
        self.rows = np.arange(model.fit.states + model.n, self.ns, dtype=np.int64)
        self.clocks = np.array([k for i, a in enumerate(self.actives) if a.effect.clock_in is not None
                                for k in range(self.offsets[i], self.offsets[i + 1])], dtype=np.int64)
        self._drives: dict[Prepared, tuple[FloatArray, FloatArray]] = {}
        self.chains: dict[object, object] = {}  # sensor chains, kept by `reading`

    def run(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, *,
            columns: FloatArray | None = None, d_start: FloatArray | None = None,
            acceleration: bool = True) -> Motion:
        """Step through a record from `start` (ns,), with `drive` (nt, 9, drives) and the parameters p (np,).

        `time` (nt,) is uniform with step h. `columns` (np, nc), `d_start` (ns, nc): directions in parameter space whose
        derivatives are wanted, and those of the start for the same. `acceleration`: whether it is wanted; displacement
        sensors do without.
        """
        path, stages = self.path(start, drive, time, p)
        d_state = None
        if columns is not None and d_start is not None:
            d_state = self.derivatives(stages, drive, time, p, columns, d_start)
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

    def path(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray) -> Path:
        """Return the states (nt, ns), and states and accelerations at each step's stages, (nt - 1, 4, ns + n).

        SolverError if they grow without bounds.
        """
        from radiation_ss.simulation.integrator import walk

        rates, n, v = self.mapped("rates"), self.model.n, self.model.fit.states + self.model.n
        states, stages = np.empty((time.size, self.ns)), np.empty((time.size - 1, 4, self.ns + n))
        states[0] = start
        dynamics = self.half, self.half @ self.half, self.linear[v:v + n]
        walk((rates.each, *rates.prepared(p)), dynamics, self.h, drive[:-1], time[:-1], states, stages)
        if not np.isfinite(states).all() or np.abs(states).max() > 1e12 * (1.0 + np.abs(start).max()):
            raise SolverError(f"the motion grows without bounds{self.why_unstable()}")
        return states, stages

    def why_unstable(self) -> str:
        """Return what makes the motion grow: the model itself, or its effects."""
        if loose := statically_unstable(self.model.M, self.model.C, self.model.dofs):
            return f"; {unstable_text(loose)}"
        return "; the effects make the model unstable" if self.actives else "; the model is unstable"

    def derivatives(self, stages: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, columns: FloatArray,
                    d_start: FloatArray) -> FloatArray:
        """Return the derivatives of the states along a path with known stages, shape (nt, ns, nc)."""
        from radiation_ss.simulation.integrator import propagate_slopes

        steps, nr = time.size - 1, self.rows.size
        at = drive[:-1].reshape(steps, 3, 3, -1)[:, :, [0, 1, 1, 2]].transpose(0, 2, 1, 3).reshape(4 * steps, 3, -1)
        moments = (time[:-1, None] + 0.5 * self.h * np.array([0.0, 1.0, 1.0, 2.0])).ravel()
        slope = self.mapped("slope")
        work, x, decided = slope.laid_out(4 * steps, stages.reshape(4 * steps, 1, -1), at, moments[:, None, None], p)
        result = np.empty((steps + 1, *d_start.shape))
        result[0] = d_start
        block = BLOCK // 4  # steps whose slopes are held at a time
        for first in range(0, steps, block):
            found = np.tile(decided, (len(x[4 * first:4 * (first + block)]), 1))
            slope.evaluate(work, x[4 * first:4 * (first + block)], found)
            propagate_slopes(self.half, self.rows, self.h, found.reshape(-1, 4, self.ns + self.np, nr),
                      np.ascontiguousarray(columns), result[first:first + block + 1])
        return result

    def mapped(self, name: str) -> Compiled:
        """Return one of the equations' functions for many samples."""
        kept = self.equations.compiled
        if name not in kept:
            kept[name] = Compiled(getattr(self.equations, name))
        return kept[name]

    def drive(self, prepared: Prepared, p: FloatArray) -> FloatArray:
        """Return a record's force at the times at which it acts, as `Prepared.drive` does; kept while these stay."""
        parts = [self.force_drive(prepared, p)]
        if self.equations.waves:
            parts.append(prepared.wave_drive)
        if self.equations.towed:
            speed = np.where(np.arange(9) < 3, prepared.record.speed, 0.0)[:, None]
            parts.append(np.broadcast_to(speed, (*parts[0].shape[:2], 1)))
        return np.concatenate(parts, axis=2) if len(parts) > 1 else parts[0]

    def force_drive(self, prepared: Prepared, p: FloatArray) -> FloatArray:
        """Return the exciting force's part of `drive`."""
        if self.clocks.size == 0:
            return prepared.punctual
        known = self._drives.get(prepared)
        if known is None or not np.array_equal(known[0], p[self.clocks]):
            times = half_steps(prepared.grid)
            clock = self.mapped("clock")(times.size, times[:, None, None], p)[:, 0]
            known = self._drives[prepared] = (p[self.clocks], prepared.drive(clock))
        return known[1]


def reading(rollout: Rollout, motion: Motion, grid: FloatArray, channel: Channel, p: FloatArray,
            columns: FloatArray | None = None) -> tuple[FloatArray, FloatArray | None]:
    """Return a channel's predicted samples, shape (nk,), and their derivatives, shape (nk, nc).

    Sensor effects act on the displacement's sensor where there is one, on every sensor where there is none.
    """
    key = (channel.dof, channel.quantity)
    if key not in rollout.chains:
        rollout.chains[key] = SensorChain(rollout, channel)
    chain = rollout.chains[key]
    assert isinstance(chain, SensorChain)
    time = chain.clock(channel.time, p)
    values, slopes, derivatives = zip(*(interpolate(
        rollout, motion, grid, dof, channel.quantity, time, channel.under_way) for dof in chain.dofs))
    return chain.read(channel.time, time, np.array(values), np.array(slopes), derivatives, p, columns)


class SensorChain:
    """The sensor effects that touch one channel, composed into one expression."""

    def __init__(self, rollout: Rollout, channel: Channel) -> None:
        dofs = rollout.model.dofs
        p = ca.SX.sym("p", rollout.np)
        touching = [(a, values) for a, values in rollout.equations.of(p) if a.effect.sensor
                    and a.dof in (dofs[channel.dof], "")
                    and (channel.quantity == "displacement" or (a.effect.clock_out is not None and a.dof == ""))]
        self.dofs = [channel.dof] + [dofs.index(a.other) for a, _ in touching if a.other]
        self.late = any(a.effect.clock_out for a, _ in touching)
        self.functions = self._functions(touching, p) if touching else None
        self._mapped: dict[int, Compiled] = {}

    def _functions(self, touching: Sequence[tuple[Active, Any]], p: Any) -> tuple[ca.Function, ...]:
        """Return the clock, the reading, and the reading's derivatives."""
        t, y = ca.SX.sym("t"), ca.SX.sym("y", len(self.dofs))
        slope, now = ca.SX.sym("dy", len(self.dofs)), ca.SX.sym("now")
        clock: Any = t
        for active, parameters in touching:
            if active.effect.clock_out is not None:
                clock = active.effect.clock_out(SimpleNamespace(t=clock), parameters)
        # The value at the clock's present time, to first order around it, so that derivatives see the clock.
        values = [y[k] + slope[k] * (clock - now) for k in range(len(self.dofs))]
        result, other = values[0], 1
        for active, parameters in touching:
            if active.effect.output is None:
                continue
            s = SimpleNamespace(y=result, t=t)
            if active.other:
                s.other = SimpleNamespace(y=values[other])
                other += 1
            result = active.effect.output(s, parameters)
        point = [t, now, y, slope, p]
        return (ca.Function("clock", [t, p], [ca.densify(clock)]), ca.Function("read", point, [ca.densify(result)]),
                ca.Function("read_slope", point, [ca.densify(ca.jacobian(result, ca.vertcat(y, p)))]))

    def clock(self, time: FloatArray, p: FloatArray) -> FloatArray:
        """Return the times at which the channel is really read."""
        return self.mapped(0)(time.size, time[:, None, None], p)[:, 0, 0] if self.late else time

    def mapped(self, which: int) -> Compiled:
        """Return one of the functions for many samples."""
        assert self.functions is not None
        if which not in self._mapped:
            self._mapped[which] = Compiled(self.functions[which])
        return self._mapped[which]

    def read(self, nominal: FloatArray, time: FloatArray, values: FloatArray, slopes: FloatArray,
             derivatives: Sequence[FloatArray | None], p: FloatArray,
             columns: FloatArray | None) -> tuple[FloatArray, FloatArray | None]:
        """Return the readings and their derivatives."""
        if self.functions is None:
            return values[0], derivatives[0]
        point = (nominal[:, None, None], time[:, None, None], values.T[:, None], slopes.T[:, None], p)
        result = self.mapped(1)(time.size, *point)[:, 0, 0]
        if columns is None:
            return result, None
        slope = self.mapped(2)(time.size, *point)[:, :, 0]
        gradient = slope[:, len(self.dofs):] @ columns
        for i, d_value in enumerate(derivatives):
            assert d_value is not None
            gradient = gradient + slope[:, [i]] * d_value
        return result, gradient


def interpolate(rollout: Rollout, motion: Motion, grid: FloatArray, dof: int, quantity: str,
                time: FloatArray, under_way: bool = False) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return value, slope in time and derivatives of one quantity at any times, by cubic Hermite polynomials.

    Before the start, where a late sensor reads its first samples, the first polynomial goes on where the body is under
    way. One that is released, which had no acceleration there, goes on as fast as it starts.
    """
    m, n = rollout.model.fit.states, rollout.model.n
    order = QUANTITIES.index(quantity)
    h = grid[1] - grid[0]
    place = np.clip((time - grid[0]) / h, -np.inf if under_way else 0.0, grid.size - 1 - 1e-9)
    k = np.maximum(place, 0.0).astype(int)
    f = place - k
    early = np.zeros(time.size) if under_way else np.minimum(time - grid[0], 0.0)

    def node(which: int, derivative: bool) -> FloatArray:
        if which == 2:
            return motion.d_acceleration[:, dof] if derivative else motion.acceleration[:, dof]  # type: ignore[index]
        at = m + which * n + dof
        return motion.d_state[:, at] if derivative else motion.state[:, at]  # type: ignore[index]

    def rate(derivative: bool) -> FloatArray:
        # The jerk is not a state: central differences of the acceleration serve.
        return node(order + 1, derivative) if order < 2 else np.gradient(node(2, derivative), h, axis=0)

    def blend(derivative: bool) -> FloatArray:
        y, d = node(order, derivative), rate(derivative)
        w = [1 - 3 * f**2 + 2 * f**3, h * (f - 2 * f**2 + f**3), 3 * f**2 - 2 * f**3, h * (f**3 - f**2)]
        before = early[:, None] * d[:1] if derivative else early * d[0]
        w = [weight[:, None] for weight in w] if derivative else w
        return w[0] * y[k] + w[1] * d[k] + w[2] * y[k + 1] + w[3] * d[k + 1] + before

    y, d = node(order, False), rate(False)
    slope = (6 * f * (f - 1) * (y[k] - y[k + 1]) / h + (1 - 4 * f + 3 * f**2) * d[k] + (3 * f**2 - 2 * f) * d[k + 1])
    return blend(False), slope, blend(True) if motion.d_state is not None else None
