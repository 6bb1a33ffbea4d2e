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

Path = tuple[FloatArray, FloatArray]  # states at the grid times; states and accelerations at each step's stages


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
        f, _ = model.matrices()
        self.linear = np.zeros((self.ns, self.ns))
        self.linear[: f.shape[0], : f.shape[0]] = f
        self.half = expm(self.linear * 0.5 * self.h)
        self.rows = np.arange(model.fit.states + model.n, self.ns, dtype=np.int64)
        self._mapped: dict[str, Compiled] = {}
        self.moves_clock = any(a.effect.clock_in is not None for a in self.actives)
        self.chains: dict[object, object] = {}  # sensor chains, kept by `reading`

    def _step(self) -> ca.Function:
        n, half, h = self.model.n, self.half, self.h
        s, p = ca.SX.sym("s", self.ns), ca.SX.sym("p", self.np)
        drive = ca.SX.sym("u", n, 9)  # force at the start, middle and end of the step, its slope, and its clock
        time = ca.SX.sym("t")
        def rest(state: Any, at: int) -> Any:
            return self._rest(state, [drive[:, at], drive[:, 3 + at], drive[:, 6 + at]], time + 0.5 * self.h * at, p)

        k1, a1 = rest(s, 0)
        whole = half @ half
        s_half, s_whole = ca.mtimes(half, s), ca.mtimes(whole, s)
        second = s_half + 0.5 * h * ca.mtimes(half, k1)
        k2, a2 = rest(second, 1)
        third = s_half + 0.5 * h * k2
        k3, a3 = rest(third, 1)
        fourth = s_whole + h * ca.mtimes(half, k3)
        k4, a4 = rest(fourth, 2)
        following = s_whole + h / 6.0 * (ca.mtimes(whole, k1) + 2.0 * ca.mtimes(half, k2 + k3) + k4)
        stages = ca.vertcat(ca.horzcat(s, second, third, fourth), ca.horzcat(a1, a2, a3, a4))
        return ca.Function("step", [s, drive, time, p], [ca.densify(following), ca.densify(stages)], {"cse": True})

    def _stage(self, name: str) -> ca.Function:
        """Return the acceleration ("acc") or the Jacobian ("slope") of one stage, shared by the four."""
        n = self.model.n
        s, p, a = ca.SX.sym("s", self.ns), ca.SX.sym("p", self.np), ca.SX.sym("a", n)
        at, time = ca.SX.sym("d", n, 3), ca.SX.sym("t")
        drive = [at[:, 0], at[:, 1], at[:, 2]]
        if name == "acc":
            return ca.Function("acc", [s, at, time, p], [ca.densify(self._rest(s, drive, time, p)[1])], {"cse": True})
        slope = ca.densify(self._slope(s, a, drive, time, p))
        return ca.Function("slope", [ca.vertcat(s, a), at, time, p], [slope], {"cse": True})

    def _clock(self) -> ca.Function:
        t, p = ca.SX.sym("t"), ca.SX.sym("p", self.np)
        clocks = [self._clock_in(dof, t, p) for dof in self.model.dofs]
        return ca.Function("clock", [t, p], [ca.densify(ca.vertcat(*clocks))])

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

    def _balance(self, state: Any, drive: list[Any], time: Any, p: Any) -> tuple[Any, Any, Any, list[Any]]:
        """Return the acceleration symbol, the linear model's passive force, the whole force and the effects' rates."""
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
        return a, passive, passive + acting + ca.vertcat(*force), rates

    def _inverse_inertia(self, total: Any, a: Any) -> tuple[Any, Any]:
        """Return the inverse of the inertia with what effects add to it, and of the linear model's own."""
        inertia = ca.DM(self.model.M + self.model.A_inf)
        own, slope = ca.inv(inertia), ca.jacobian(total, a)
        return (own if slope.nnz() == 0 else ca.inv(inertia - slope)), own

    def _rest(self, state: Any, drive: list[Any], time: Any, p: Any) -> tuple[Any, Any]:
        """Return what the linear model leaves of the state's rate, and the acceleration."""
        m, n = self.model.fit.states, self.model.n
        a, passive, total, rates = self._balance(state, drive, time, p)
        inverse, own = self._inverse_inertia(total, a)
        acceleration = ca.mtimes(inverse, ca.substitute(total, a, ca.SX.zeros(n)))
        rates = [ca.substitute(rate, a, acceleration) for rate in rates]
        return ca.vertcat(ca.SX(m + n, 1), acceleration - ca.mtimes(own, passive), *rates), acceleration

    def _slope(self, state: Any, acceleration: Any, drive: list[Any], time: Any, p: Any) -> Any:
        """Return the derivatives of `_rest`'s rows `rows` by states and parameters, where the acceleration is known.

        By implicit differentiation of inertia * a = force(state, p, a): shorter than through the solution.
        """
        a, passive, total, rates = self._balance(state, drive, time, p)
        inverse, own = self._inverse_inertia(total, a)
        both = ca.vertcat(state, p)
        d_a = ca.mtimes(inverse, ca.jacobian(total, both))
        rows = [d_a - ca.mtimes(own, ca.jacobian(passive, both))]
        if rates:
            rate = ca.vertcat(*rates)
            rows.append(ca.jacobian(rate, both) + ca.mtimes(ca.jacobian(rate, a), d_a))
        return ca.substitute(ca.vertcat(*rows), a, acceleration)

    def run(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, *,
            columns: FloatArray | None = None, d_start: FloatArray | None = None,
            acceleration: bool = True, known: Path | None = None) -> Motion:
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
        known : tuple of ndarray, optional
            What `path` returns, where it is known already.

        Raises
        ------
        SolverError
            If the motion grows beyond all bounds.
        """
        path, stages = known if known is not None else self.path(start, drive, time, p)
        d_state = None
        if columns is not None and d_start is not None:
            d_state = self.derivatives(stages, drive, time, p, columns, d_start)
        if not acceleration:
            return Motion(path, None, d_state)
        here = drive[:, [0, 3, 6]]
        value = self.mapped("acc")(time.size, path[:, None], here, time[:, None, None], p)[:, 0]
        if d_state is None or columns is None:
            return Motion(path, value)
        point = np.concatenate([path, value], axis=1)[:, None]
        n, v = self.model.n, self.model.fit.states + self.model.n
        slope = self.mapped("slope")(time.size, point, here, time[:, None, None], p)
        slope = slope.transpose(0, 2, 1)[:, :n]
        by_state = slope[:, :, : self.ns] + self.linear[v:v + n]
        return Motion(path, value, d_state, by_state @ d_state + slope[:, :, self.ns:] @ columns)

    def path(self, start: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray) -> Path:
        """Return the states, shape (nt, ns), and at each step's stages states and accelerations, (nt - 1, 4, ns + n).

        Raises
        ------
        SolverError
            If they grow without bounds.
        """
        count = time.size - 1
        following, stages = self.mapped("step").all(count, start, drive[:-1], time[:-1, None, None], p)
        states = np.concatenate([np.asarray(start)[None], following[:, 0]])
        if not np.isfinite(states).all() or np.abs(states).max() > 1e12 * (1.0 + np.abs(start).max()):
            raise SolverError("the motion grows without bounds; the effects make the model unstable")
        return states, stages

    def derivatives(self, stages: FloatArray, drive: FloatArray, time: FloatArray, p: FloatArray, columns: FloatArray,
                    d_start: FloatArray) -> FloatArray:
        """Return the derivatives of the states along a path with known stages, shape (nt, ns, nc)."""
        from radiation_ss.simulation.tangent import propagate

        steps, nr = time.size - 1, self.rows.size
        at = drive[:-1].reshape(steps, 3, 3, -1)[:, :, [0, 1, 1, 2]].transpose(0, 2, 1, 3).reshape(4 * steps, 3, -1)
        moments = (time[:-1, None] + 0.5 * self.h * np.array([0.0, 1.0, 1.0, 2.0])).ravel()
        flat = stages.reshape(4 * steps, 1, -1)
        slope = self.mapped("slope")(4 * steps, flat, at, moments[:, None, None], p).transpose(0, 2, 1)
        push = (slope[:, :, self.ns:].reshape(4 * steps * nr, -1) @ columns).reshape(steps, 4, nr, -1)
        jacobian = np.ascontiguousarray(slope[:, :, : self.ns]).reshape(steps, 4, nr, self.ns)
        result: FloatArray = propagate(self.half, self.rows, self.h, jacobian, push, np.ascontiguousarray(d_start))
        return result

    def mapped(self, name: str) -> Compiled:
        """Return one of the functions for many samples: `step` accumulates, the others map."""
        if name not in self._mapped:
            made = {"step": self._step, "clock": self._clock}.get(name, lambda: self._stage(name))()
            self._mapped[name] = Compiled(made, accumulate=name == "step")
        return self._mapped[name]

    def clock(self, time: FloatArray, p: FloatArray) -> FloatArray:
        """Return the times at which the recorded force acts, shape (nt, n)."""
        if not self.moves_clock:
            return np.repeat(time[:, None], self.model.n, axis=1)
        return self.mapped("clock")(time.size, time[:, None, None], p)[:, 0]
