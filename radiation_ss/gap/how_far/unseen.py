"""What an answer does on data that no fit has seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.errors import SolverError
from radiation_ss.gap.how_far.ledger import (
    Error,
    HowFar,
    errors_on,
    noise_errors,
    pooled_gap,
    shrinkage,
    shrinkage_interval,
)
from radiation_ss.gap.posterior.fitting import Fit, fit_free_noise
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, slow_cosines, without
from radiation_ss.gap.tolerance.tolerated import retuned
from radiation_ss.gap.which.candidates import Candidate
from radiation_ss.gap.which.search import Search
from radiation_ss.gap.which.verdict import Verdict, decide
from radiation_ss.records.record import Record

NAMED = ("effect", "ambiguous")  # answers whose effects go into the corrected model
UNSURE = 0.5  # probability of an unknown effect where unseen data contradict what the evidence was sure of
Shrunk = tuple[HowFar, dict[str, list[Error]]]


def on_unseen(found: Search, answer: Verdict, predicted: Callable[[Verdict], Shrunk],
              ) -> tuple[Verdict, Shrunk, tuple[str, ...]]:
    """Measure the answer on unseen data; where two effects fail there, what evidence holds for one alone.

    Unseen data choose no effect, they only refuse. Notes say what they refused.
    """
    result = bounded(answer, predicted)
    if len(answer.chosen.terms) > 1 and (result is None or spoiled(result[0])):
        simpler = decide(found, most=1)
        again = bounded(simpler, predicted) if simpler.status in NAMED else None
        if again is not None and not spoiled(again[0]):
            names = " and ".join(t.active.label for t in answer.chosen.terms)
            return simpler, again, (f"{names} together explain the records best and fail on unseen data; "
                                    f"{simpler.chosen.terms[0].active.label} alone does not.",)
    if result is not None:
        return answer, result, ()
    answer = unnamed(answer)
    return answer, predicted(answer), ("With the effects found on the records the motion grows without bounds on "
                                       "unseen data; corrected.json is retuned only.",)


def unnamed(answer: Verdict) -> Verdict:
    """Return the verdict of an unknown effect in place of one that unseen data refuse."""
    return replace(answer, status="unknown_effect", rivals=[], probability=UNSURE)


def bounded(answer: Verdict, predicted: Callable[[Verdict], Shrunk]) -> Shrunk | None:
    """Return the measured shrinkage; None if the motion grows without bounds with the effects named."""
    try:
        return predicted(answer)
    except SolverError:
        if answer.status not in NAMED:
            raise
        return None


def spoiled(how_far: HowFar) -> bool:
    """Whether the corrected model does clearly worse on unseen data than the model as given, slow motion left out."""
    before, after = how_far.sure or (how_far.gap_before, how_far.gap_after)
    return after > 1.2 * before + how_far.noise_floor


def without_slow(model: Model, record: Record, errors: list[Error]) -> list[Error]:
    """Return errors without what a slow force could make that the record's elevation does not hold."""
    return [replace(e, error=without(slow_cosines(model, record, e.time), e.error)) for e in errors]


def refit_heads(model: Model, records: Sequence[Record], held: Sequence[tuple[Record, float]],
                spread: Mapping[str, float], chosen: Candidate) -> tuple[Fit, Fit]:
    """Fit the model without effects and with the chosen ones to the heads of the records only."""
    heads = [record.window(-np.inf, split) for record, split in held]
    setting = setting_of(model, heads, spread)
    fits = []
    for source in ((), chosen.terms):
        for _ in range(chosen.fit.problem.setting.halvings if source else 0):
            setting = setting.finer
        problem = Problem(setting, source)
        begin = problem.extend(chosen.fit.q, chosen.fit.problem)
        floors = tuple(1e-3 * d for d in chosen.fit.noise.deviation)
        try:
            fits.append(fit_free_noise(problem, floors, chosen.fit.noise, begin))
        except SolverError:  # a start of the heads lacks what tamed the motion: begin without effects
            fits.append(fit_free_noise(problem, floors, chosen.fit.noise, np.zeros(problem.size)))
    return fits[0], fits[1]


def measure(model: Model, held: Sequence[tuple[Record, float]], found: Search, answer: Verdict, fits: tuple[Fit, Fit],
            seed: int) -> tuple[HowFar, dict[str, list[Error]]]:
    """Predict the unseen records with the nominal, the retuned and the corrected model."""
    predictions: dict[str, list[Error]] = {"nominal": [], "retuned": [], "corrected": []}
    sure: dict[str, list[Error]] = {"nominal": [], "corrected": []}
    for k, (record, split) in enumerate(held):
        seen = k if split > -np.inf else None
        retuned = actives_of(fits[0], seen)
        corrected = actives_of(fits[1], seen) if answer.status in NAMED else retuned
        for name, actives in (("nominal", []), ("retuned", retuned), ("corrected", corrected)):
            errors = errors_on(model, actives, record, split)
            predictions[name] += errors
            if name in sure:
                sure[name] += without_slow(model, record, errors)
    scales = found.null.problem.setting.scales
    sounds = noise_errors(predictions["corrected"], {i: scales[dof].omega for i, dof in enumerate(model.dofs)})
    before, middle, after = (pooled_gap(predictions[name]) for name in ("nominal", "retuned", "corrected"))
    noise = pooled_gap(sounds)
    period = 2.0 * np.pi / min(s.omega for s in scales.values())
    interval = shrinkage_interval(predictions["nominal"], predictions["corrected"], sounds, 2.0 * period,
                                  np.random.default_rng(seed))
    names = tuple(record.name if split == -np.inf else f"{record.name} from {split:.4g} s" for record, split in held)
    whole = all(one.error is other.error for one, other in zip(sure["nominal"], predictions["nominal"]))
    judged = None if whole else (pooled_gap(sure["nominal"]), pooled_gap(sure["corrected"]))
    return HowFar(before, middle, after, noise, shrinkage(before, after, noise), interval, names, judged), predictions


def actives_of(found: Fit, record: int | None) -> list[Active]:
    """Return nominal numbers and effects of a fit: what applies to any record, and a record's own where one is given.

    A slow force that the first part of a record showed goes on in its last part; in another record it is another one.
    """
    actives = found.problem.actives(retuned(found), record or 0)
    return [a for a in actives if record is not None or not a.effect.per_record]
