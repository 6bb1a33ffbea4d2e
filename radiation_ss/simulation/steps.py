"""How long the integrator's steps may be: for the body, for its force and for the effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Active
from radiation_ss.records.column_checks import middle, spectrum_of
from radiation_ss.records.record import Record
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.measured import power_of


def step_size(model: Model, records: Sequence[Record], actives: Sequence[Active] = ()) -> float:
    """Return an integrator step [s]: 0.45 rad of the fastest natural motion, 0.7 rad of the force's band edge.

    With effects, also what their own rates ask for in motions of the records' size: friction, drag and hysteresis turn
    faster than the body. The linear model itself is stepped exactly. A kink is not followed in steps below 1/64.
    """
    inertia = model.M + model.A_inf
    squares = np.linalg.eigvals(np.linalg.solve(inertia, model.C)).real
    natural = edge = float(np.sqrt(max(squares.max(), 1e-12)))
    for record in records:
        for dof in model.dofs:
            values = record.channels.get(f"{dof}_force")
            if values is not None and np.isfinite(values).sum() > 8 and np.nanstd(values) > 0.0:
                edge = max(edge, band_edge(record.time, values))
    whole = min(0.45 / natural, 0.7 / edge)
    return min(whole, max(1.0 / max(effect_rate(model, records, actives), 1e-12), whole / 64)) if actives else whole


def effect_rate(model: Model, records: Sequence[Record], actives: Sequence[Active]) -> float:
    """Return the largest eigenvalue [1/s] that effects bring in, at rest and at three times the records' rms.

    Own states are 0, or 1 in motion, where hysteresis has its limit.
    """
    equations = MotionEquations(model, actives)
    m, n, ns = model.fit.states, model.n, equations.ns
    x, v = np.zeros(n), np.zeros(n)
    for record in records:
        for i, dof in enumerate(model.dofs):
            values = record.channels.get(dof)
            if values is not None and np.isfinite(values).sum() > 8 and np.nanstd(values) > 0.0:
                x[i] = max(x[i], 3.0 * np.nanstd(values))
                v[i] = max(v[i], 3.0 * np.nanstd(values) * middle(*spectrum_of(record, values)))
    p, drive = np.concatenate([a.vector for a in actives]), np.zeros((equations.drives, 3))
    found = 0.0
    for at_x, at_v in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        point = np.concatenate([np.zeros(m), at_x * x, at_v * v, np.full(equations.own, at_v), np.zeros(n)])
        rows = np.asarray(equations.slope(point, drive, 0.0, p))[:, :ns]
        whole = np.zeros((ns, ns))
        whole[m + n:] = rows
        if np.isfinite(whole).all():
            found = max(found, float(np.abs(np.linalg.eigvals(whole)).max()))
    return found


def band_edge(time: FloatArray, values: FloatArray, share: float = 0.98) -> float:
    """Return the circular frequency below which a share of a signal's variance lies [rad/s]."""
    omega, power = power_of(time, values)
    return float(omega[np.searchsorted(np.cumsum(power), share * power.sum())])
