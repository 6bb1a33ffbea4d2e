"""Motion of the composite with effects, and its exact derivatives: a fourth-order exponential integrator.

The linear model is stepped exactly by its matrix exponential; exciting force and effects are stepped by the classical
Runge-Kutta method in the frame that moves with it (Lawson 1967). One step is a CasADi function; derivatives
follow by its Jacobian along the trajectory, so they belong to the discrete solution itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.plant.model import Model
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.effects.definition import Active, named


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory on a uniform grid, with derivatives.

    Parameters
    ----------
    state : ndarray, shape (nt, ns)
        Radiation states, displacement, velocity, states of effects.
    acceleration : ndarray, shape (nt, n), or None
    d_state, d_acceleration : ndarray, shapes (nt, ns, nc), (nt, n, nc), or None
        Derivatives for the columns asked for.
    """

    state: FloatArray
    acceleration: FloatArray | None = None
    d_state: FloatArray | None = None
    d_acceleration: FloatArray | None = None


class Rollout:
    """The composite with a set of effects as one step function; built once, used for any record and parameters.

    Parameters
    ----------
    model : Model
    actives : sequence of Active
        Effects; sensors among them are ignored here.
    h : float
        Step [s].

    Attributes
    ----------
    ns : int
        Number of states: radiation, displacement, velocity, then the effects' own.
    np : int
        Number of parameters of all actives together, sensors included.
    """

    def __init__(self, model: Model, actives: Sequence[Active], h: float) -> None:
        self.model, self.actives, self.h = model, tuple(actives), float(h)
        self.offsets = np.cumsum([0] + [len(a.effect.parameters) for a in self.actives])
        self.np = int(self.offsets[-1])
        self.own = sum(a.effect.states for a in self.actives)
        self.ns = model.fit.states + 2 * model.n + self.own
        self._mapped: dict[str, Compiled] = {}
        self.moves_clock = any(a.effect.clock_in is not None for a in self.actives)
        self.chains: dict[object, object] = {}  # sensor chains, kept by `reading`
        self._functions()

    def _functions(self) -> None:
        n = self.model.n
        s, p = ca.SX.sym("s", self.ns), ca.SX.sym("p", self.np)
        drive = ca.SX.sym("u", n, 9)  # force at the start, middle and end of the step, its slope, and its clock
        time = ca.SX.sym("t")
        f, _ = self.model.matrices()
        linear = np.zeros((self.ns, self.ns))
        linear[: f.shape[0], : f.shape[0]] = f
        half, whole = expm(linear * 0.5 * self.h), expm(linear * self.h)

        def rest(state: Any, at: int) -> Any:
            return self._rest(state, [drive[:, at], drive[:, 3 + at], drive[:, 6 + at]], time + 0.5 * self.h * at, p)

        h = self.h
        k1, acceleration = rest(s, 0)
        s_half = ca.mtimes(half, s)
        second = s_half + 0.5 * h * ca.mtimes(half, k1)
        k2, _ = rest(second, 1)
        third = s_half + 0.5 * h * k2
        k3, _ = rest(third, 1)
        fourth = ca.mtimes(half, s_half) + h * ca.mtimes(half, k3)
        k4, _ = rest(fourth, 2)
        following = (ca.mtimes(whole, s) + h / 6.0 * (ca.mtimes(whole, k1) + 2.0 * ca.mtimes(half, k2 + k3) + k4))
        point = [s, drive, time, p]
        options = {"cse": True}
        both = ca.vertcat(s, p)
        self.half, first = half, self.model.fit.states + n
        self.rows = np.arange(first, self.ns, dtype=np.int64)
        # One stage's Jacobian as a function, so that the four share it.
        at, moment = ca.SX.sym("d", n, 3), ca.SX.sym("m")
        rate, _ = self._rest(s, [at[:, 0], at[:, 1], at[:, 2]], moment, p)
        slope = ca.densify(ca.jacobian(rate[first:], both))
        self.functions = {
            "step": ca.Function("step", point, [ca.densify(following)], options),
            "stages": ca.Function("stages", point, [ca.densify(ca.horzcat(s, second, third, fourth))], options),
            "slope": ca.Function("slope", [s, at, moment, p], [slope], options),
            "acc": ca.Function("acc", point, [ca.densify(acceleration)], options),
            "acc_slope": ca.Function("acc_slope", point, [ca.densify(ca.jacobian(acceleration, both))], options)}

    def _signals(self, state: Any, drive: list[Any], time: Any, p: Any) -> tuple[list[Any], Any, Any, Any]:
        """Return the signals of each degree of freedom, the acceleration symbol and the acting exciting force."""
        model, m, n = self.model, self.model.fit.states, self.model.n
        acceleration = ca.SX.sym("a", n)
        memory = ca.mtimes(ca.DM(model.fit.c), state[:m]) if m else ca.SX.zeros(n)
        acting = []
        for i, dof in enumerate(model.dofs):
            clock = self._clock_in(dof, time, p)
            value = drive[0][i] + drive[1][i] * (clock - drive[2][i])
            for active, values in self._of(p):
                if active.effect.input is not None and active.dof in (dof, ""):
                    value = active.effect.input(SimpleNamespace(u=value, t=time), values)
            acting.append(value)
        signals = [SimpleNamespace(x=state[m + i], v=state[m + n + i], a=acceleration[i], u=acting[i], t=time,
                                   memory=memory[i], radiation=state[:m]) for i in range(n)]
        for s in signals:
            s.all = signals
        return signals, acceleration, ca.vertcat(*acting), memory

    def _clock_in(self, dof: str, time: Any, p: Any) -> Any:
        """Return the time at which the recorded force acts."""
        for active, values in self._of(p):
            if active.effect.clock_in is not None and active.dof in (dof, ""):
                time = active.effect.clock_in(SimpleNamespace(t=time), values)
        return time

    def _of(self, p: Any) -> list[tuple[Active, Any]]:
        """Each active with its parameters as attributes."""
        return [(a, named(a.effect, [p[k] for k in range(self.offsets[i], self.offsets[i + 1])]))
                for i, a in enumerate(self.actives)]

    def _rest(self, state: Any, drive: list[Any], time: Any, p: Any) -> tuple[Any, Any]:
        """Return what the linear model leaves of the state's rate, and the acceleration."""
        model, m, n = self.model, self.model.fit.states, self.model.n
        signals, a, acting, memory = self._signals(state, drive, time, p)
        force, rates, at = [ca.SX(0)] * n, [], m + 2 * n
        for active, values in self._of(p):
            effect = active.effect
            if effect.force is None and effect.rates is None:
                continue
            places = [model.dofs.index(d) for d in (active.dof, active.other) if d]
            s = SimpleNamespace(**vars(signals[places[0] if places else 0]))
            s.other = signals[places[1]] if len(places) > 1 else None
            s.z = [state[at + k] for k in range(effect.states)]
            at += effect.states
            if effect.rates is not None:
                rates += list(effect.rates(s, values))
            if effect.force is not None:
                result = effect.force(s, values)
                for place, value in zip(places or range(n), result if isinstance(result, (tuple, list)) else (result,)):
                    force[place] = force[place] + value
        x, v = state[m:m + n], state[m + n:m + 2 * n]
        passive = -memory - ca.mtimes(ca.DM(model.C), x) - ca.mtimes(ca.DM(model.D), v)
        total = passive + acting + ca.vertcat(*force)
        inertia = ca.DM(model.M + model.A_inf)
        slope = ca.jacobian(total, a)
        free = ca.substitute(total, a, ca.SX.zeros(n))
        linear = ca.mtimes(ca.inv(inertia), passive)
        inverse = ca.inv(inertia) if slope.nnz() == 0 else ca.inv(inertia - slope)
        acceleration = ca.mtimes(inverse, free)
        rates = [ca.substitute(rate, a, acceleration) for rate in rates]
        return ca.vertcat(ca.SX(m + n, 1), acceleration - linear, *rates), acceleration

    def run(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, *,
            columns: FloatArray | None = None, d_start: FloatArray | None = None,
            acceleration: bool = True) -> Motion:
        """Step through a record.

        Parameters
        ----------
        start : ndarray, shape (ns,)
        drive : ndarray, shape (nt, 9, n)
            From `Prepared.drive`.
        time : ndarray, shape (nt,)
            Uniform with step h.
        p : ndarray, shape (np,)
        columns : ndarray, shape (np, nc), optional
            Directions in parameter space whose derivatives are wanted.
        d_start : ndarray, shape (ns, nc), optional
            Derivative of the start for the same columns.
        acceleration : bool
            Whether the acceleration is wanted; displacement sensors do without.

        Raises
        ------
        SolverError
            If the motion grows beyond all bounds.
        """
        path = self.path(start, drive, time, p)
        d_state = None
        if columns is not None and d_start is not None:
            d_state = self.derivatives(path, drive, time, p, columns, d_start)
        if not acceleration:
            return Motion(path, None, d_state)
        point = (path[:, None], drive, time[:, None, None], p)
        value = self.mapped("acc", time.size)(time.size, *point)[:, 0]
        if d_state is None or columns is None:
            return Motion(path, value)
        slope = self.mapped("acc_slope", time.size)(time.size, *point).transpose(0, 2, 1)
        return Motion(path, value, d_state, slope[:, :, : self.ns] @ d_state + slope[:, :, self.ns:] @ columns)

    def path(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray) -> FloatArray:
        """Return the states, shape (nt, ns); SolverError if they grow without bounds."""
        count = time.size - 1
        states = np.empty((time.size, self.ns))
        states[0] = start
        states[1:] = self.mapped("step", count)(count, start, drive[:-1], time[:-1, None, None], p)[:, 0]
        if not np.isfinite(states).all() or np.abs(states).max() > 1e12 * (1.0 + np.abs(start).max()):
            raise SolverError("the motion grows without bounds; the effects make the model unstable")
        return states

    def derivatives(self, path: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, columns: FloatArray,
                    d_start: FloatArray) -> FloatArray:
        """Return the derivatives of the states along a path, shape (nt, ns, nc)."""
        from radiation_ss.simulation.tangent import propagate

        steps, nr = time.size - 1, self.rows.size
        stages = self.mapped("stages", steps)(steps, path[:-1, None], drive[:-1], time[:-1, None, None], p)
        at = drive[:-1].reshape(steps, 3, 3, -1)[:, :, [0, 1, 1, 2]].transpose(0, 2, 1, 3).reshape(4 * steps, 3, -1)
        moments = (time[:-1, None] + 0.5 * self.h * np.array([0.0, 1.0, 1.0, 2.0])).ravel()
        flat = stages.reshape(4 * steps, 1, -1)
        slope = self.mapped("slope", 4 * steps)(4 * steps, flat, at, moments[:, None, None], p)
        slope = slope.transpose(0, 2, 1)
        push = (slope[:, :, self.ns:].reshape(4 * steps * nr, -1) @ columns).reshape(steps, 4, nr, -1)
        jacobian = np.ascontiguousarray(slope[:, :, : self.ns]).reshape(steps, 4, nr, self.ns)
        result: FloatArray = propagate(self.half, self.rows, self.h, jacobian, push, np.ascontiguousarray(d_start))
        return result

    def mapped(self, name: str, count: int) -> Compiled:
        """Return one of the functions for many steps: `step` accumulates, the others map."""
        known = self._mapped.get(name)
        if known is None or known.count < count:
            known = Compiled(self.functions[name], count, accumulate=name == "step")
            self._mapped[name] = known
        return known

    def clock(self, time: FloatArray, p: FloatArray) -> FloatArray:
        """Return the times at which the recorded force acts, shape (nt, n)."""
        if not self.moves_clock:
            return np.repeat(time[:, None], self.model.n, axis=1)
        if "clock" not in self.functions:
            t, q = ca.SX.sym("t"), ca.SX.sym("p", self.np)
            clocks = [self._clock_in(dof, t, q) for dof in self.model.dofs]
            self.functions["clock"] = ca.Function("clock", [t, q], [ca.densify(ca.vertcat(*clocks))])
        return self.mapped("clock", time.size)(time.size, time[:, None, None], p)[:, 0]
