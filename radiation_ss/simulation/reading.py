"""What the sensors read of a trajectory: any times, delays, gains, biases, with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects import Active
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.prepared import QUANTITIES, Channel
from radiation_ss.simulation.rollout import Motion, Rollout


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
