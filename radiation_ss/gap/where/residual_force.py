"""The missing force along the motion: what has to act on the model as given so that it moves as measured.

Inverse dynamics of the composite on the low-passed measured motion:
f = (M + A_inf) a + D v + C x + memory(v) - exciting force, equation (1) solved for what is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.gap.posterior.linear import smooth
from radiation_ss.gap.posterior.setting import Setting

TOP = 3.5  # highest frequency of the force, in multiples of the motion's


@dataclass(frozen=True, eq=False)
class Missing:
    """The missing force in one record on one degree of freedom.

    Parameters
    ----------
    record, dof : str
    time, force, x, v : ndarray, shape (nt,)
    shares : mapping of name to share of the force's energy that x, v, a, v|v|, x^3, x^2 or a constant explains
    """

    record: str
    dof: str
    time: FloatArray
    force: FloatArray
    x: FloatArray
    v: FloatArray
    shares: dict[str, float]


def missing_force(setting: Setting) -> list[Missing]:
    """Return the missing force for each record that measures the displacement of every degree of freedom."""
    model, found = setting.model, []
    omega = max(scales.omega for scales in setting.scales.values())
    for prepared in setting.records:
        channels = {c.dof: c for c in prepared.channels if c.quantity == "displacement"}
        if len(channels) < model.n or prepared.force is None:
            continue
        h = min(float(np.median(np.diff(c.time))) for c in channels.values())
        time = np.arange(max(c.time[0] for c in channels.values()), min(c.time[-1] for c in channels.values()), h)
        raw = np.stack([np.interp(time, channels[i].time, channels[i].value) for i in range(model.n)], axis=1)
        x, v, a = smooth(raw, h, min(TOP * omega, 0.8 * np.pi / h))
        acting = np.stack([f(time) for f in prepared.force], axis=1)
        force = a @ (model.M + model.A_inf).T + v @ model.D.T + x @ model.C.T + memory_force(model, v, h) - acting
        inner = slice(time.size // 20, -time.size // 20)  # the ends of a Fourier derivative are unsure
        for i, dof in enumerate(model.dofs):
            found.append(Missing(prepared.record.name, dof, time[inner], force[inner, i], x[inner, i], v[inner, i],
                                 explained(force[inner, i], x[inner, i], v[inner, i], h)))
    return found


def memory_force(model: Model, v: FloatArray, h: float) -> FloatArray:
    """Return the radiation memory of a motion that began at rest, shape (nt, n)."""
    if model.fit.states == 0:
        return np.zeros_like(v)
    step = expm(model.fit.a * h)
    push = np.linalg.solve(model.fit.a, (step - np.eye(model.fit.states)) @ model.fit.b)
    state, rows = np.zeros(model.fit.states), np.empty_like(v)
    for k in range(v.shape[0]):
        rows[k] = model.fit.c @ state
        state = step @ state + push @ v[k]
    return rows


def explained(force: FloatArray, x: FloatArray, v: FloatArray, h: float) -> dict[str, float]:
    """Return the share of the force's energy that each simple shape explains by itself."""
    shapes = {"constant": np.ones(x.size), "x": x, "v": v, "a": np.gradient(v, h), "v|v|": v * np.abs(v), "x^3": x**3,
              "x^2": x**2 - np.mean(x**2)}
    energy = float(force @ force)
    if energy == 0.0:
        return dict.fromkeys(shapes, 0.0)
    return {name: float((shape @ force) ** 2 / max(float(shape @ shape), 1e-300) / energy)
            for name, shape in shapes.items()}
