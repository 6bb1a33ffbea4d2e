"""A quick look at many starts of a shape: the linear model's response to the effect's force, by FFT."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.linear import frequencies, paths, receptance
from radiation_ss.gap.posterior.problem import Point, whitened
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.which.score import score_all
from radiation_ss.simulation.effects.definition import named, numeric
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
    dof = setting.model.dofs.index(group[0].active.dof)
    found: list[FloatArray] = []
    for prepared, motion, H in zip(setting.records, motions, responses):
        rows = [force * term.spread[j] for term in group for j, force in forces(term, motion, dof)]
        spectra = np.fft.rfft(np.array(rows), motion["padded"])
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


def forces(term: Term, motion: dict, dof: int) -> list[tuple[int, FloatArray]]:
    """Return the force of unit strength along a motion for each strength of the term."""
    effect = term.active.effect
    x, v, none = motion["x"][:, dof], motion["v"][:, dof], np.zeros(motion["time"].size)
    signals = SimpleNamespace(x=x, v=v, a=np.gradient(v, motion["h"]), t=motion["time"], u=none, memory=none)
    signals.other, signals.all = signals, [signals]
    signals.z = motion["own"][term].T if effect.states else []
    assert effect.force is not None
    found = []
    for j in term.strengths:
        values = term.active.vector
        values[j] = 1.0
        one = numeric(effect.force(signals, named(effect, values))) - numeric(
            effect.force(signals, named(effect, term.active.vector)))
        found.append((j, np.asarray(one, dtype=np.float64) * np.ones(motion["time"].size)))
    return found
