"""A quick look at many starts of a shape: the linear model's response to the effect's force, by FFT."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import casadi as ca
import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.effects import Effect
from radiation_ss.effects.definition import named
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.linear import frequencies, paths, receptance
from radiation_ss.gap.posterior.problem import Point, whitened
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.which.score import score_all
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.prepare import QUANTITIES

MANY, KEEP = 8, 2


def scan(root: Fit, terms: Sequence[Term]) -> list[Term]:
    """Return the terms with only the best starts of those effects that have many.

    The effect's force is taken along the root's motion; its response is that of the nominal linear model. That is
    enough to choose a start; the score test itself is exact.
    """
    groups: dict[tuple[str, str, str], list[Term]] = {}
    for term in terms:
        groups.setdefault(term.key, []).append(term)
    wide = {key for key, group in groups.items() if len(group) > MANY and static(group[0])}
    if not wide:
        return list(terms)
    r, J = root.whitened()
    inverse, motions = root.covariance, paths(root)
    responses = [receptance(root.problem.setting.model, frequencies(m["padded"], m["h"])) for m in motions]
    kept = [term for term in terms if term.key not in wide]
    for key in wide:
        group = groups[key]
        found = slopes(root.problem.setting, group, motions, responses)
        _, C = whitened(Point(root.point.residuals, found), root.noise)
        assert C is not None
        widths = [len(term.strengths) for term in group]
        gains = [item.gain for item in score_all(group, widths, r, J, C, inverse, root.q)]
        kept += [group[k] for k in np.argsort(gains)[::-1][:KEEP]]
    return kept


def static(term: Term) -> bool:
    """Whether the effect is a force on one degree of freedom without own states, the same in all records."""
    effect = term.active.effect
    return effect.force is not None and effect.states == 0 and effect.scope == "dof" and not effect.per_record


def slopes(setting: Setting, group: Sequence[Term], motions: list[dict],
           responses: list[ComplexArray]) -> list[FloatArray]:
    """Return the readings' derivatives by the strengths of one effect from all its starts, for every channel.

    Motions have own states under "own" where the effect has any: for each term a row of states at each time.
    """
    dof, force = setting.model.dofs.index(group[0].active.dof), unit_force(group[0].active.effect)
    found: list[FloatArray] = []
    for prepared, motion, H in zip(setting.records, motions, responses):
        spectra = np.fft.rfft(forces(group, force, motion, dof), motion["padded"])
        omega = frequencies(motion["padded"], motion["h"])
        for channel in prepared.channels:
            filtered = H[:, channel.dof, dof] * (1j * omega) ** QUANTITIES.index(channel.quantity)
            response = np.fft.irfft(filtered * spectra, motion["padded"])[:, : prepared.grid.size]
            place = (channel.time - prepared.grid[0]) / motion["h"]
            left = np.clip(place.astype(int), 0, prepared.grid.size - 2)
            share = (place - left)[:, None]
            values = (1.0 - share) * response.T[left] + share * response.T[left + 1]
            found.append(setting.without_slow(len(found), values))
    return found


def forces(group: Sequence[Term], force: Compiled, motion: dict, dof: int) -> FloatArray:
    """Return the force of unit strength along a motion, one row for each strength of each term."""
    size = motion["time"].size
    x, v = motion["x"][:, dof], motion["v"][:, dof]
    shared = np.stack([x, v, np.gradient(v, motion["h"]), motion["time"]], axis=1)
    rows = []
    for term in group:
        parts = [shared, motion["own"][term]] if term.active.effect.states else [shared]
        point, nothing = np.concatenate(parts, axis=1)[:, None], np.array(term.active.vector)
        without = force(size, point, nothing)[:, 0, 0]
        for j in term.strengths:
            values = nothing.copy()
            values[j] = 1.0
            rows.append(force(size, point, values)[:, 0, 0] - without)
    spreads = [term.spread[j] for term in group for j in term.strengths]
    return np.array(rows) * np.array(spreads)[:, None]


def unit_force(effect: Effect) -> Compiled:
    """Return an effect's force by displacement, velocity, acceleration, time and own states, and its parameters."""
    point, p = ca.SX.sym("s", 4 + effect.states), ca.SX.sym("p", len(effect.parameters))
    signals = SimpleNamespace(x=point[0], v=point[1], a=point[2], t=point[3], u=ca.SX(0), memory=ca.SX(0))
    signals.other, signals.all = signals, [signals]
    signals.z = [point[4 + k] for k in range(effect.states)]
    assert effect.force is not None
    value = effect.force(signals, named(effect, [p[k] for k in range(len(effect.parameters))]))
    return Compiled(ca.Function("force", [point, p], [ca.densify(ca.SX(value))]))
