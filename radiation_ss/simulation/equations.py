"""The equations of motion of the composite with a set of effects, as CasADi functions."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import DEPTHS, Active, acting, named

if TYPE_CHECKING:
    pass


class MotionEquations:
    """Model and effects in symbols; sensors among the effects are ignored.

    `ns` is the number of states: radiation, displacement, velocity, then the effects' own; `np` that of parameters of
    all actives together, sensors included. If an effect needs the `waves`, the drive has, below the forces, a row of
    elevation and those of orbital velocity for each degree of freedom. Where one needs the forward speed (`towed`),
    the drive's last row has it.
    """

    def __init__(self, model: Model, actives: Sequence[Active]) -> None:
        self.model, self.actives = model, tuple(actives)
        self.offsets = np.cumsum([0] + [len(a.effect.parameters) for a in self.actives])
        self.np = int(self.offsets[-1])
        self.own = sum(a.effect.states for a in self.actives)
        self.ns = model.fit.states + 2 * model.n + self.own
        self.waves = any(a.effect.needs == "waves" for a in self.actives)
        self.towed = any(a.effect.needs == "speed" for a in self.actives)
        self.drives = model.n + (2 + len(DEPTHS) * model.n if self.waves else 0) + self.towed
        force = np.concatenate([-model.fit.c, -model.C, -model.D, np.zeros((model.n, self.own))], axis=1)
        self.passive = ca.DM(force)  # of the linear model, by the state
        self.compiled: dict[str, Any] = {}  # functions for many samples, kept by `Rollout`

    @cached_property
    def linear(self) -> FloatArray:
        """What is stepped exactly, (ns, ns): the linear model, and own states whose rates have constant coefficients.

        Of a state's rate that is not `stepped`, its row is the whole.
        """
        state, at = self._symbols[0], self.ns - self.own
        found = np.zeros((self.ns, self.ns))
        found[:at, :at] = self.model.matrices()[0]
        for k, rate in enumerate(self._balance[3], at):
            slope = ca.jacobian(rate, state)
            if slope.is_constant() and ca.substitute(rate, state, ca.SX.zeros(self.ns)).is_zero():
                found[k] = np.asarray(ca.DM(slope)).ravel()
        return found

    @cached_property
    def stepped(self) -> NDArray[np.int64]:
        """The states whose rates are more than `linear`: the velocities, then own states."""
        at = self.ns - self.own
        moved = [k for k in range(at - self.model.n, self.ns) if k < at or not self.linear[k].any()]
        return np.array(moved, dtype=np.int64)

    @cached_property
    def core(self) -> ca.Function:
        """The equations as a function of state, drive (value, slope and recorded time, (drives, 3)), time and
        parameters.

        Its outputs: by the state, what is linear in it of the velocity's rate beyond the linear model, (n, ns); the
        rest of that rate; by the state, what is linear of the acceleration, of the same rest; the rates of the effects'
        own states that are `stepped`.
        """
        n = self.model.n
        s, at, time, p = self._symbols
        a, linear, active, _ = self._balance
        inverse, own = self._inverse_inertia(active, a)
        rates = self._stepped_rates
        rest = ca.mtimes(inverse, ca.substitute(active, a, ca.SX.zeros(n)))
        whole = ca.mtimes(inverse, self.passive + linear)
        # Without a change of inertia the passive force cancels.
        added = ca.mtimes(own, linear) if inverse is own else whole - ca.mtimes(own, self.passive)
        follow = ca.substitute(ca.vertcat(*rates), a, ca.mtimes(whole, s) + rest) if rates else ca.SX(0, 1)
        return ca.Function("core", [s, at, time, p], [added, rest, whole, follow])

    @cached_property
    def rates(self) -> ca.Function:
        """Of `core` what a step needs: what is linear beyond the linear model, the rest, rates of own states."""
        s, at, time, p = self._symbols
        added, rest, _, follow = self.core(s, at, time, p)
        return ca.Function("rates", [s, at, time, p], [ca.densify(added), ca.densify(rest), ca.densify(follow)])

    @cached_property
    def slope(self) -> ca.Function:
        """Derivatives by states and parameters of the rates of the `stepped` states beyond the linear model.

        By implicit differentiation of inertia * a = force(state, p, a), which is shorter than through the solution.
        """
        n = self.model.n
        s, at, time, p = self._symbols
        a, linear, active, _ = self._balance
        inverse, own = self._inverse_inertia(active, a)
        both, passive = ca.vertcat(s, p), ca.horzcat(self.passive, ca.DM(n, self.np))
        d_force = ca.jacobian(ca.mtimes(linear, s) + active, both)
        rows = [ca.mtimes(own, d_force) if inverse is own
                else ca.mtimes(inverse, passive + d_force) - ca.mtimes(own, passive)]
        if rates := self._stepped_rates:
            rate, d_a = ca.vertcat(*rates), ca.mtimes(inverse, passive + d_force)
            rows.append(ca.jacobian(rate, both) + ca.mtimes(ca.jacobian(rate, a), d_a))
        return ca.Function("slope", [ca.vertcat(s, a), at, time, p], [ca.densify(ca.vertcat(*rows))], {"cse": True})

    @cached_property
    def beyond(self) -> ca.Function:
        """Exciting and effects' force as a function of state and acceleration, drive, time and parameters."""
        s, at, time, p = self._symbols
        a, linear, active, _ = self._balance
        return ca.Function("beyond", [ca.vertcat(s, a), at, time, p], [ca.densify(ca.mtimes(linear, s) + active)])

    @cached_property
    def follow(self) -> ca.Function:
        """Rates of the effects' own states as a function of state and acceleration, drive, time and parameters."""
        s, at, time, p = self._symbols
        a, _, _, rates = self._balance
        return ca.Function("follow", [ca.vertcat(s, a), at, time, p], [ca.densify(ca.vertcat(*rates))])

    @cached_property
    def acceleration(self) -> ca.Function:
        """The acceleration as a function of state, drive, time and parameters."""
        s, at, time, p = self._symbols
        _, rest, linear, _ = self.core(s, at, time, p)
        return ca.Function("acc", [s, at, time, p], [ca.densify(ca.mtimes(linear, s) + rest)], {"cse": True})

    @cached_property
    def clock(self) -> ca.Function:
        """The times at which the recorded force acts, as a function of time and parameters."""
        t, p = ca.SX.sym("t"), ca.SX.sym("p", self.np)
        clocks = [self._clock_in(dof, t, p) for dof in self.model.dofs]
        return ca.Function("clock", [t, p], [ca.densify(ca.vertcat(*clocks))])

    def _signals(self, state: Any, drive: Any, time: Any, p: Any) -> tuple[list[Any], Any, list[Any]]:
        """Return the signals of each degree of freedom, the acceleration symbol and the acting exciting force."""
        model, m, n = self.model, self.model.fit.states, self.model.n
        acceleration = ca.SX.sym("a", n)
        memory = ca.mtimes(ca.DM(model.fit.c), state[:m]) if m else ca.SX.zeros(n)
        acting = []
        for i, dof in enumerate(model.dofs):
            clock = self._clock_in(dof, time, p)
            value = drive[i, 0] + drive[i, 1] * (clock - drive[i, 2])
            for active, values in self.of(p):
                if active.effect.input is not None and active.dof in (dof, ""):
                    value = active.effect.input(SimpleNamespace(u=value, t=time), values)
            acting.append(value)
        signals = [SimpleNamespace(x=state[m + i], v=state[m + n + i], a=acceleration[i], u=acting[i], t=time,
                                   memory=memory[i], radiation=state[:m], dof=dof) for i, dof in enumerate(model.dofs)]
        for i, s in enumerate(signals if self.waves else []):
            rows = [drive[k, :] for k in (n, n + 1, *(n + 2 + i + k * n for k in range(len(DEPTHS))))]
            s.elevation, s.envelope, s.orbital, *s.below = (row[0] + row[1] * (time - row[2]) for row in rows)
            s.elevation_rate = rows[0][1]
        for s in signals if self.towed else []:
            s.speed = drive[self.drives - 1, 0]
        return signals, acceleration, acting

    def _clock_in(self, dof: str, time: Any, p: Any) -> Any:
        """Return the time at which the recorded force acts."""
        for active, values in self.of(p):
            if active.effect.clock_in is not None and active.dof in (dof, ""):
                time = active.effect.clock_in(SimpleNamespace(t=time), values)
        return time

    def of(self, p: Any) -> list[tuple[Active, Any]]:
        """Each active with its parameters as attributes."""
        return [(a, named(a.effect, [p[k] for k in range(self.offsets[i], self.offsets[i + 1])]))
                for i, a in enumerate(self.actives)]

    @cached_property
    def _symbols(self) -> tuple[Any, Any, Any, Any]:
        return (ca.SX.sym("s", self.ns), ca.SX.sym("d", self.drives, 3), ca.SX.sym("t"), ca.SX.sym("p", self.np))

    @cached_property
    def _balance(self) -> tuple[Any, Any, Any, list[Any]]:
        """Return the acceleration symbol, the force beyond the linear model, and the effects' rates. Of the force first
        what is linear in the state with a coefficient of parameters alone, (n, ns), then the rest.
        """
        model, m, n = self.model, self.model.fit.states, self.model.n
        state, drive, time, p = self._symbols
        signals, a, force = self._signals(state, drive, time, p)
        linear, rates, at = ca.SX(n, self.ns), [], m + 2 * n
        varying = ca.vertcat(state, a, time, ca.vec(drive))
        for active, values in self.of(p):
            own = [state[at + k] for k in range(active.effect.states)]
            at += len(own)
            forces, follow = acting(active, signals, model.dofs, values, own)
            rates += follow
            for place, value in forces:
                slope = ca.jacobian(ca.SX(value), state)
                if slope.nnz() and not ca.depends_on(slope, varying):
                    linear[place, :] += slope
                    value = ca.substitute(ca.SX(value), state, ca.SX.zeros(self.ns))
                force[place] = force[place] + value
        return a, linear, ca.vertcat(*force), rates

    @property
    def _stepped_rates(self) -> list[Any]:
        """The rates of own states that are stepped."""
        return [self._balance[3][k - self.ns + self.own] for k in self.stepped[self.model.n:]]

    def _inverse_inertia(self, active: Any, a: Any) -> tuple[Any, Any]:
        """Return the inverse of the inertia with what effects add to it, and of the linear model's own."""
        inertia = ca.DM(self.model.M + self.model.A_inf)
        own, slope = ca.inv(inertia), ca.jacobian(active, a)
        return (own if slope.nnz() == 0 else ca.inv(inertia - slope)), own


def sensed(sensors: Sequence[tuple[Active, Any]], value: Any, others: Iterable[Any], t: Any) -> Any:
    """Return what sensor effects make of a value; `others` are those of their second degrees of freedom."""
    others = iter(others)
    for active, parameters in sensors:
        other = SimpleNamespace(y=next(others)) if active.other else None
        if active.effect.output is not None:
            value = active.effect.output(SimpleNamespace(y=value, t=t, other=other), parameters)
    return value
