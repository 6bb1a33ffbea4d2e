"""The motion as measured, as a path of the model: what forces along it are, whatever the model would do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca
import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import named
from radiation_ss.gap.posterior.linear import smooth
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.prepare import half_steps
from radiation_ss.simulation.rollout import Path

TOP = 6.0  # highest frequency of the motion that is kept, in multiples of its own


@dataclass(frozen=True, eq=False)
class Measured:
    """One record's motion on the integrator's grid with half steps.

    Parameters
    ----------
    time : ndarray, shape (2 nt - 1,)
    x, v, a : ndarray, shape (2 nt - 1, n)
    radiation : ndarray, shape (2 nt - 1, m)
        Radiation states of a motion that begins at rest.
    """

    time: FloatArray
    x: FloatArray
    v: FloatArray
    a: FloatArray
    radiation: FloatArray


def measured(setting: Setting, record: int) -> Measured | None:
    """Return the low-passed motion of a record; None unless every degree of freedom's displacement is measured."""
    prepared, model = setting.records[record], setting.model
    channels = {c.dof: c for c in prepared.channels if c.quantity == "displacement"}
    if len(channels) < model.n:
        return None
    omega = max(scales.omega for scales in setting.scales.values())
    step = min(float(np.median(np.diff(c.time))) for c in channels.values())
    even = np.arange(max(c.time[0] for c in channels.values()), min(c.time[-1] for c in channels.values()), step)
    raw = np.stack([np.interp(even, channels[i].time, channels[i].value) for i in range(model.n)], axis=1)
    time = half_steps(prepared.grid)[: 2 * prepared.grid.size - 1]
    x, v, a = (np.stack([np.interp(time, even, row) for row in part.T], axis=1)
               for part in smooth(raw, step, min(TOP * omega, 0.8 * np.pi / step)))
    return Measured(time, x, v, a, radiation_along(model, v, 0.5 * setting.h))


def radiation_along(model: Model, v: FloatArray, h: float) -> FloatArray:
    """Return the radiation states along a velocity in steps of h, from rest, shape (nt, m)."""
    count = model.fit.states
    rows = np.zeros((v.shape[0], count))
    if count:
        step = expm(model.fit.a * h)
        push = np.linalg.solve(model.fit.a, (step - np.eye(count)) @ model.fit.b)
        for k in range(v.shape[0] - 1):
            rows[k + 1] = step @ rows[k] + push @ (0.5 * (v[k] + v[k + 1]))
    return rows


def path_along(model: Model, motion: Measured) -> Path:
    """Return the motion as a path of the model without effects."""
    states = np.concatenate([motion.radiation, motion.x, motion.v], axis=1)
    both = np.concatenate([states, motion.a], axis=1)
    return states[::2].copy(), np.stack([both[:-2:2], both[1:-1:2], both[1:-1:2], both[2::2]], axis=1)


def states_along(terms: Sequence[Term], motion: Measured, dof: int) -> list[FloatArray]:
    """Return the own states of one effect from each of its shapes along a motion, shape (nt, states) each.

    From rest, by the classical Runge-Kutta method, all shapes in one function.
    """
    effect, h = terms[0].active.effect, 2.0 * float(motion.time[1] - motion.time[0])
    z = [ca.SX.sym(f"z{k}", effect.states) for k in range(len(terms))]
    signal = ca.SX.sym("s", 4, 3)

    def rates(states: list[ca.SX], at: int) -> list[ca.SX]:
        x, v, a, t = (signal[row, at] for row in range(4))
        return [ca.vertcat(*effect.rates(SimpleNamespace(x=x, v=v, a=a, t=t, z=ca.vertsplit(state)),  # type: ignore[misc]
                                         named(effect, term.active.vector))) for term, state in zip(terms, states)]

    first = rates(z, 0)
    second = rates([s + 0.5 * h * k for s, k in zip(z, first)], 1)
    third = rates([s + 0.5 * h * k for s, k in zip(z, second)], 1)
    last = rates([s + h * k for s, k in zip(z, third)], 2)
    after = ca.vertcat(*[s + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                         for s, a, b, c, d in zip(z, first, second, third, last)])
    step = ca.Function("step", [ca.vertcat(*z), signal, ca.SX.sym("p", 0)], [ca.densify(after)], {"cse": True})
    rows = np.stack([motion.x[:, dof], motion.v[:, dof], motion.a[:, dof], motion.time], axis=1)
    signals = np.stack([rows[:-2:2], rows[1:-1:2], rows[2::2]], axis=1)
    states = Compiled(step).repeated(signals.shape[0], np.zeros(effect.states * len(terms)), signals,
                                     np.zeros(0))[0][:, 0]
    return [np.concatenate([np.zeros((1, effect.states)), part])
            for part in np.split(states, len(terms), axis=1)]
