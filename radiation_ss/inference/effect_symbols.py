"""An effect's expressions as compiled functions of the signals along a measured motion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import DEPTHS, Action, Active, acting, named
from radiation_ss.fit.rational import frequency_response
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.linear import exact_step, propagate

Series = Sequence[FloatArray]
"""Signals along a record, (nt,) each."""


@dataclass(frozen=True, eq=False)
class Along:
    """A sparse matrix along a record: entries (k, nt) with their rows and columns, and the matrix's shape."""

    values: FloatArray
    row: np.ndarray
    column: np.ndarray
    shape: tuple[int, int]

    def column_zero(self) -> FloatArray:
        """Return the first column, shape (rows, nt)."""
        found = np.zeros((self.shape[0], self.values.shape[1]))
        found[self.row] = self.values
        return found

    def mean(self) -> FloatArray:
        """Return the mean over the record, dense."""
        found = np.zeros(self.shape)
        if self.values.size:
            found[self.row, self.column] = self.values.mean(axis=1)
        return found


class Symbols:
    """An effect's expressions as CasADi functions of the signals along a motion."""

    def __init__(self, model: Model, active: Active) -> None:
        self.model, self.active, effect = model, active, active.effect
        n, m = model.n, model.fit.states
        places = [model.dofs.index(d) for d in (active.dof, active.other) if d]
        self.places = places or list(range(n))
        self.x, self.v, self.a, self.u = (ca.SX.sym(name, n) for name in "xvau")
        self.memory, self.radiation = ca.SX.sym("memory", n), ca.SX.sym("radiation", m)
        self.t, self.elevation, self.elevation_rate = ca.SX.sym("t"), ca.SX.sym("eta"), ca.SX.sym("rate")
        self.envelope, self.speed = ca.SX.sym("envelope"), ca.SX.sym("speed")
        self.orbital = ca.SX.sym("orbital", len(DEPTHS) * n)
        self.z, self.p = ca.SX.sym("z", effect.states), ca.SX.sym("p", len(effect.parameters))
        self.moving = ca.vertcat(self.x, self.v, self.a, self.memory, self.radiation)
        self._functions: dict[tuple[str, int], tuple[Compiled, list[Any]]] = {}
        self.given = ca.vertcat(self.moving, self.u, self.t, self.elevation, self.elevation_rate,
                                self.envelope, self.orbital, self.speed)

    def signals(self) -> list[Any]:
        """Return what the effect's expressions read, for each degree of freedom."""
        n = self.model.n
        every = [SimpleNamespace(x=self.x[i], v=self.v[i], a=self.a[i], u=self.u[i], y=self.x[i], t=self.t,
                                 memory=self.memory[i], radiation=self.radiation, elevation=self.elevation,
                                 elevation_rate=self.elevation_rate, envelope=self.envelope,
                                 orbital=self.orbital[i], below=ca.vertsplit(self.orbital)[n + i::n], dof=dof,
                                 speed=self.speed)
                 for i, dof in enumerate(self.model.dofs)]
        for s in every:
            s.all = every
            s.other = every[self.places[1]] if len(self.places) > 1 else None
        return every

    @cached_property
    def action(self) -> Action:
        """Forces and rates in symbols."""
        z = ca.vertsplit(self.z) if self.active.effect.states else []
        return acting(self.active, self.signals(), self.model.dofs, named(self.active.effect, ca.vertsplit(self.p)), z)

    @property
    def targets(self) -> list[int]:
        """Positions of the degrees of freedom that the force acts on."""
        return [place for place, _ in self.action.forces]

    def values(self, run: MeasuredMotion) -> Series:
        """Return the signals along a record, not copied."""
        u = run.force if run.force is not None else np.zeros_like(run.x)
        return [*run.x, *run.v, *run.a, *run.memory, *run.radiation, *u, run.time, run.elevation,
                run.elevation_rate, run.envelope, *run.orbital, np.broadcast_to(run.record.speed, run.time.shape)]

    def following(self, slope: Along, omega: FloatArray) -> ComplexArray:
        """Return the response to displacements of what has a slope by `moving`, shape (nw, rows, n)."""
        n, fit, mean = self.model.n, self.model.fit, slope.mean()
        w = 1j * omega[:, None, None]
        x, v, a, memory, states = np.split(mean, [n, 2 * n, 3 * n, 4 * n], axis=1)
        response = x + w * v + w**2 * a
        radiation = memory @ fit.c + states
        if np.any(radiation):
            response = response + w * frequency_response(fit.a, fit.b, radiation, omega)
        return np.asarray(response)

    def force(self, rows: Series, strength: int, values: FloatArray, at_one: FloatArray, steps: FloatArray,
              omega: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return the force by one strength, shape (targets, nt), and its mean response, shape (nw, targets, n)."""
        effect = self.active.effect
        z = self.own_states(rows, at_one, steps) if effect.states else np.zeros((0, rows[0].size))
        if omega.size == 0:
            none = np.zeros((0, len(self.targets), self.model.n), dtype=complex)
            return self.along(rows, strength, values, z), none

        def wanted() -> list[Any]:
            by = self.by_strength(strength)
            return [by, ca.jacobian(by, self.moving), ca.jacobian(by, self.z)]

        value, slope, slope_z = self.mapped(("force", strength), wanted, rows, z, values)
        response = self.following(slope, omega)
        if effect.states:
            response = response + slope_z.mean() @ self.state_response(rows, z, at_one, omega)
        return value.column_zero(), response

    def by_strength(self, strength: int) -> ca.SX:
        """Return the forces' derivatives by one strength."""
        return ca.densify(ca.jacobian(ca.vertcat(*[value for _, value in self.action.forces]), self.p)[:, strength])

    def along(self, rows: Series, strength: int, values: FloatArray, z: FloatArray) -> FloatArray:
        """Return the force by one strength, shape (targets, nt), for signals and own states."""
        (value,) = self.mapped(("force alone", strength), lambda: [self.by_strength(strength)], rows, z, values)
        return value.column_zero()

    def state_response(self, rows: Series, z: FloatArray, p: FloatArray, omega: FloatArray) -> ComplexArray:
        """Return the mean response of the effect's own states to displacements, shape (nw, states, n)."""
        size = self.active.effect.states

        def wanted() -> list[Any]:
            rates = ca.vertcat(*self.action.rates)
            return [ca.jacobian(rates, self.z), ca.jacobian(rates, self.moving)]

        by_z, by_motion = self.mapped(("rates", 0), wanted, rows, z, p)
        own = 1j * omega[:, None, None] * np.eye(size) - by_z.mean()
        return np.asarray(np.linalg.solve(own, self.following(by_motion, omega)))

    def scalar(self, part: str, place: int, rows: Series, strength: int,
               values: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return an input's or an output's derivative by one strength, shape (nt,), and its mean slope (1, n).

        The slope is that by the forces or by the displacements.
        """
        effect = self.active.effect
        none = np.zeros((self.z.numel(), rows[0].size))

        def wanted() -> list[Any]:
            result = getattr(effect, part)(self.signals()[place], named(effect, ca.vertsplit(self.p)))
            by = ca.densify(ca.jacobian(ca.SX(result), self.p)[:, strength])
            return [by, ca.jacobian(by, self.u if part == "input" else self.x)]

        value, slope = self.mapped((f"{part} {place}", strength), wanted, rows, none, values)
        return value.column_zero()[0], slope.mean()[0]

    def mapped(self, key: tuple[str, int], outputs: Callable[[], list[Any]], rows: Series,
               z: FloatArray, values: FloatArray) -> list[Along]:
        """Return expressions along a record; what computes them is kept under its key."""
        if key not in self._functions:
            wanted = [ca.sparsify(part) for part in outputs()]
            entries = ca.vertcat(*[ca.SX(ca.vertcat(*part.nonzeros())) for part in wanted])
            function = ca.Function("along", [ca.vertcat(self.given, self.z), self.p], [entries])
            self._functions[key] = Compiled(function), [part.sparsity() for part in wanted]
        compiled, patterns = self._functions[key]
        found = compiled.along([*rows, *z], values)
        ends = np.cumsum([0] + [pattern.nnz() for pattern in patterns])
        places = [pattern.get_triplet() for pattern in patterns]
        return [Along(found[i:j], np.array(at[0], int), np.array(at[1], int), pattern.shape)
                for i, j, at, pattern in zip(ends[:-1], ends[1:], places, patterns)]

    def own_states(self, rows: Series, p: FloatArray, steps: FloatArray,
                   begins: FloatArray | None = None) -> FloatArray:
        """Return the effect's own states from rest, shape (states, nt): with linear rates exact for lines between
        samples, else by the classical Runge-Kutta method. With linear rates they may begin otherwise.
        """
        if self.slopes is not None and np.ptp(steps) <= 1e-9 * steps.max():
            own, by_signals = np.split(np.asarray(self.slopes(p)), [self.z.numel()], axis=1)
            used = np.flatnonzero(np.any(by_signals, axis=0)).tolist()
            seen, step = np.stack([rows[k] for k in used], axis=1), exact_step(own, by_signals[:, used], steps[0])
            return np.ascontiguousarray(propagate(step, seen, np.zeros(len(own)) if begins is None else begins).T)
        fastest = np.abs(np.linalg.eigvals(self.slope(0.0, 0.0, p).full())).max()
        parts = int(np.clip(np.ceil(fastest * steps.max()), 1, 32))  # Runge and Kutta's method is stable to 2.8
        if ("step", parts) not in self._functions:
            self._functions["step", parts] = Compiled(self._step(parts)), []
        compiled, _ = self._functions["step", parts]
        signals = [*(row[:-1] for row in rows), *(row[1:] for row in rows), steps]
        return np.ascontiguousarray(compiled.steps_along(signals, p, self.z.numel()))

    @cached_property
    def slopes(self) -> ca.Function | None:
        """Derivatives of the own states' rates by these and the signals, of parameters; None if they vary."""
        rates, signals = ca.vertcat(*self.action.rates), ca.vertcat(self.z, self.given)
        found = ca.jacobian(rates, signals)
        alone = ca.simplify(ca.substitute(rates, signals, ca.SX.zeros(signals.numel())))
        linear = not ca.depends_on(found, signals) and alone.is_zero() and found[:, self.z.numel():].nnz() > 0
        return ca.Function("slopes", [self.p], [ca.densify(found)]) if linear else None

    @cached_property
    def slope(self) -> ca.Function:
        """Derivative of the own states' rates by these, of states, signals and parameters."""
        return ca.Function("slope", [self.z, self.given, self.p],
                           [ca.jacobian(ca.vertcat(*self.action.rates), self.z)])

    def _step(self, parts: int) -> ca.Function:
        """Return one step of the own states, in parts, of state, signals before and after, step and parameters."""
        size = self.given.numel()
        rates = ca.vertcat(*self.action.rates)
        f = ca.Function("rates", [self.z, self.given, self.p], [rates])
        now, after = ca.SX.sym("now", size), ca.SX.sym("after", size)
        whole = ca.SX.sym("h")
        z, h = self.z, whole / parts
        for k in range(parts):
            begin, middle, end = (now + (after - now) * share / parts for share in (k, k + 0.5, k + 1))
            k1 = f(z, begin, self.p)
            k2 = f(z + 0.5 * h * k1, middle, self.p)
            k3 = f(z + 0.5 * h * k2, middle, self.p)
            k4 = f(z + h * k3, end, self.p)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return ca.Function("step", [ca.vertcat(self.z, now, after, whole), self.p], [z])

    def clock(self, part: str, rows: Series, strength: int, active: Active) -> tuple[FloatArray, FloatArray]:
        """Return a clock's derivative by one strength, and how much it is off with the effect's numbers, (nt,) each."""
        def wanted() -> list[Any]:
            clock = getattr(active.effect, part)(SimpleNamespace(t=self.t), named(active.effect, ca.vertsplit(self.p)))
            return [ca.jacobian(clock, self.p)[:, strength], clock - self.t]

        none = np.zeros((self.z.numel(), rows[0].size))
        slope, off = self.mapped((part, strength), wanted, rows, none, np.array(active.vector))
        return slope.column_zero()[0], off.column_zero()[0]
