"""Diagnosis where no force is known: nonlinear effects and faulty sensors only; the rest cannot be tested."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.effects import Active, Effect, Scales, effect_named, library
from radiation_ss.gap.answer.diagnosis import Answer, Choice, Diagnosis, Named
from radiation_ss.gap.answer.words import unit_of
from radiation_ss.gap.how_far.ledger import HowFar
from radiation_ss.gap.motion.spectra import (
    BlindFit,
    Even,
    band_powers,
    even_record,
    even_records,
    fit_library,
    spectra_of,
)
from radiation_ss.gap.where.locate import Where
from radiation_ss.gap.where.tapers import tapered
from radiation_ss.gap.where.two_sensors import fault, ratio_rows
from radiation_ss.gap.which.verdict import WITHIN
from radiation_ss.records.record import Record
from radiation_ss.simulation.corrected import Corrected

MATERIAL_FAULT = 0.02  # of a sensor: relative gain, or phase [rad] at the motion's frequency
SURE = 5.0  # least log evidence, prior odds included
SHOWS = 5.0  # least reach, in standard deviations, of an effect that counts as testable


@dataclass(frozen=True, eq=False)
class Item:
    """One candidate: an effect with numbers and its log evidence against none, prior odds included."""

    active: Active
    deviation: Mapping[str, float]
    evidence: float

    def named(self) -> Named:
        """Return it as the report has it."""
        values = {k: (self.active.values[k], d) for k, d in self.deviation.items()}
        units = {k: unit_of(self.active.effect.parameters[k].unit, self.active.dof) for k in values}
        return Named(self.active.name, self.active.dof, values, units)


def diagnose_motion(model: Model, records: Sequence[Record], withhold: Sequence[Record],
                    effects: Sequence[Effect] | None, spread: Mapping[str, float],
                    remarks: tuple[str, ...] = ()) -> Diagnosis:
    """Diagnose records of motion only.

    Raises
    ------
    InputError
        If no record measures the displacement of every degree of freedom.
    """
    scales, omega, seen = even_records(model, records)
    unseen = [e for e in (even_record(model, r, omega) for r in withhold) if e is not None]
    pool = list(library().values()) if effects is None else list(effects)
    blind = fit_library(model, seen, pool, scales)
    odds = float(np.log(0.8 / max(len(blind) + 2 * model.n, 1)))
    items = [item_of(found, odds) for found in blind] + sensor_faults(model, records, pool, scales, odds)
    items.sort(key=lambda item: -item.evidence)
    rivals = [i for i in items if i.evidence > SURE and i.evidence > items[0].evidence - WITHIN]
    found = assemble(model, seen, unseen, items, rivals, blind, pool, spread)
    return replace(found, notes=(*remarks, *found.notes))


def item_of(found: BlindFit, odds: float) -> Item:
    """Return a fitted effect as a candidate."""
    assert found.term is not None
    values, deviation = found.term.active.vector, {}
    names = list(found.term.active.effect.parameters)
    for value, error, j in zip(found.values, found.deviation, found.term.strengths):
        values[j] = float(value) * found.term.spread[j]
        deviation[names[j]] = float(error) * found.term.spread[j]
    return Item(found.term.active.with_values(values), deviation, found.evidence + odds)


def sensor_faults(model: Model, records: Sequence[Record], pool: Sequence[Effect], scales: Mapping[str, Scales],
                  odds: float) -> list[Item]:
    """Compare displacement and acceleration of one motion: the ratio of sound sensors is -w^2."""
    names, found = {e.name for e in pool}, []
    for dof in model.dofs:
        rows = [row for record in records for row in ratio_rows(record, dof, scales[dof].omega)]
        if not rows:
            continue
        gain, delay, covariance = fault(rows)
        error = np.sqrt(np.diag(covariance))
        for name, key, value, deviation, size, prior in (
                ("sensor_gain", "gain", gain, error[0], abs(gain), 0.2),
                ("sensor_delay", "delay", delay, error[1], delay * scales[dof].omega, 0.3 / scales[dof].omega)):
            if name not in names:
                continue
            deviation = max(float(deviation), 1e-12)
            evidence = 0.5 * (value / deviation) ** 2 - float(np.log(np.hypot(prior, deviation) / deviation))
            evidence = evidence if size > MATERIAL_FAULT else min(evidence, 0.0)
            found.append(Item(Active(effect_named(name), dof, {key: float(value)}), {key: deviation},
                              float(evidence) + odds))
    return found


def outer_gap(model: Model, evens: Sequence[Even], found: BlindFit | None) -> float:
    """Return the motion outside the waves' own band, relative to the whole motion."""
    ratios = []
    for even in evens:
        one = spectra_of(model, even, found.term if found else None, found.values if found else None)
        theta = np.zeros(0) if found is None else found.values
        powers, _ = band_powers(one, theta)
        whole = tapered(even.raw)
        for i, power in enumerate(powers):
            total = float(np.sum(np.mean(np.abs(whole[:, :, i]) ** 2, axis=0)))
            ratios.append(float(np.sum(power)) / max(total, 1e-300))
    return float(np.sqrt(np.mean(ratios)))


def fit_of(item: Item | None, blind: Sequence[BlindFit]) -> BlindFit | None:
    """Return the fit that an item came from, None where it came from none (sensors compared with each other)."""
    return next((f for f in blind if item is not None and f.term is not None
                 and f.term.active.name == item.active.name and f.term.active.dof == item.active.dof), None)


def assemble(model: Model, seen: Sequence[Even], unseen: Sequence[Even], items: list[Item], rivals: list[Item],
             blind: list[BlindFit], pool: Sequence[Effect], spread: Mapping[str, float]) -> Diagnosis:
    """Put the result into the common form."""
    status = "no_gap" if not rivals else "effect" if len(rivals) == 1 else "ambiguous"
    chosen = rivals[0] if rivals else None
    fitted = fit_of(chosen, blind)
    place = list(unseen) or list(seen)
    before, after = outer_gap(model, place, None), outer_gap(model, place, fitted)
    if after > 1.2 * before:  # what was found makes it worse: not handed on
        status, chosen, rivals, after = "unknown_effect", None, [], before
    shrunk = 0.0 if before == 0.0 else 1.0 - (after / before) ** 2
    logs = np.array([0.0, *[i.evidence for i in items]])
    weights = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    at_first = outer_gap(model, seen, None)
    which = [Choice((), float(weights[0]), -float(logs.max()), at_first, at_first)]
    which += [Choice((i.named(),), float(w), i.evidence - float(logs.max()), at_first,
                     outer_gap(model, seen, fit_of(i, blind))) for i, w in zip(items, weights[1:])]
    which.sort(key=lambda c: -c.log_evidence)
    probability = float(weights[0]) if not rivals else float(
        sum(w for i, w in zip(items, weights[1:]) if any(i is r for r in rivals)))
    family = chosen.active.effect.family if chosen else "mixed"
    gaps = {e.record.name: (outer_gap(model, [e], None),) * 3 for e in seen}
    where = Where(gaps, dict.fromkeys(model.dofs, 1.0 / model.n), [], family,
                  bool(chosen and not chosen.active.effect.linear))
    answer = Answer(status, (chosen.named(),) if chosen else (), probability,
                    tuple((r.active.name,) for r in rivals) if status == "ambiguous" else (),
                    hidden(model, blind, items, pool),
                    "waves with the exciting force known, or a decay test: motion alone tests no linear cause")
    notes: tuple[str, ...] = (
        "Motion only: the unknown force absorbs every linear cause, so only nonlinear effects and sensors against "
        "each other are tested.",
        "The gap here is the motion outside the waves' own band, relative to the whole motion.")
    names = tuple(e.record.name for e in place) if unseen else ()
    if not unseen:
        notes += ("No record was withheld, so the shrinkage is on the records of the fit.",)
    how_far = HowFar(before, before, after, 0.0, shrunk, (min(shrunk, 0.0), max(shrunk, 0.0)), names)
    corrected = Corrected({}, (chosen.active,) if chosen else (), dict(spread))
    return Diagnosis(model.name, answer, tuple(which), where, how_far, corrected, {},
                     {"tolerance": dict(spread), "motion_only": True}, notes)


def hidden(model: Model, blind: Sequence[BlindFit], items: Sequence[Item], pool: Sequence[Effect]) -> tuple[str, ...]:
    """Return the effects that these records cannot show."""
    shown = {f.term.active.name for f in blind if f.term is not None and f.reach > SHOWS}
    shown |= {i.active.name for i in items if i.active.effect.sensor}
    return tuple(sorted(e.name for e in pool if e.name not in shown and (model.n > 1 or not e.coupled)))

