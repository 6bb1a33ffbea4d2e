"""Diagnose the gap between a model and measured records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.effects import Effect, effect_named, library
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import InputError
from radiation_ss.gap.answer.diagnosis import Answer, Choice, Diagnosis, Named
from radiation_ss.gap.answer.words import AGAIN, advice, unit_of
from radiation_ss.gap.how_far.ledger import Error, HowFar, pooled_gap
from radiation_ss.gap.how_far.partly import told_part
from radiation_ss.gap.how_far.unseen import NAMED, Shrunk, measure, on_unseen, refit_heads, spoiled, unnamed
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.given import alive, check_some, force_known, usable
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.gap.posterior.setting import Setting, setting_of, terms_of
from radiation_ss.gap.tolerance.tolerated import retuned
from radiation_ss.gap.where.locate import locate
from radiation_ss.gap.where.residual_force import missing_force
from radiation_ss.gap.where.two_sensors import unlike_clocks
from radiation_ss.gap.which.bootstrap import refitted_law
from radiation_ss.gap.which.candidates import Candidate
from radiation_ss.gap.which.material import not_white
from radiation_ss.gap.which.search import Search, search
from radiation_ss.gap.which.verdict import LEFT_SHARE, SURE, Verdict, decide, outlined, posterior
from radiation_ss.records.record import Record
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.measured import measured_freely
from radiation_ss.simulation.unit_checks import check_units
from radiation_ss.simulation.wave_reach import coarse_excitation
from radiation_ss.threads import on_one_core

__all__ = ["Diagnosis", "diagnose"]

TAIL = 1.0 / 3.0  # of each record, where none is withheld
VISIBLE = 3.0  # an effect of the prior's typical size must show by this many standard deviations
LISTED = 12
FAR_OFF = 3.0  # tolerances, at which a retuned number is worth a word
TOLD = 0.01  # of the motion, from which on noise that is not white is worth a word


@on_one_core
def diagnose(model: Model, records: Sequence[Record] | Record, effects: Sequence[str | Effect] | None = None,
             tolerance: float | Mapping[str, float] = 0.02, seed: int = 0, *, withhold: Sequence[Record] = (),
             pairs: bool = True, progress: Callable[[str, float], None] | None = None, bootstrap: int = 0,
             cache: str | Path | None = None) -> Diagnosis:
    """Say where model and measurement differ, which effect causes it, and how far the gap shrinks with it.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        Decays, forced runs, waves with known force or with elevation (then the model needs X).
    effects : sequence of str or Effect, optional
        The library to consider; all of it by default, and outlines of laws that change in time
        (`radiation_ss.effects.outlines`): where one of these wins, the verdict is `unknown_effect`. Named
        here, an outline is an effect like the others.
    tolerance : float or mapping
        How far the model's numbers may be off, relative: a bound with a soft edge (docs/theory/diagnosis); by name:
        mass, stiffness, A_inf, kernel, force.
    seed : int
        Of the bootstrap.
    withhold : sequence of Record
        Records that no fit sees; the shrinkage is measured on them. Without any, on the last third of each record.
    pairs : bool
        Look for two effects at once.
    progress : callable (text, share), optional
    bootstrap : int
        Nulls to simulate and to fit anew for the threshold of the evidence, beside the 400 linearised ones that
        always are; 0 for none, 50 for a second opinion. Each takes about as long as a diagnosis without pairs.
    cache : path, optional
        File in which finished nulls are kept.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If model and records do not match, a tolerance is missing, or `effects` is empty.
    SolverError
        If the model without effects cannot be fitted.
    """
    if bootstrap < 0:
        raise InputError(f"bootstrap: {bootstrap}; the number of nulls to simulate, 0 for none")
    say = progress or (lambda text, share: None)
    given = [records] if isinstance(records, Record) else list(records)
    if not given:
        raise InputError("records: none given")
    check_some(effects)
    given, notes = usable(model, given)
    withhold = [measured_freely(model, record)[0] for record in withhold]
    chosen = None if effects is None else [
        replace(e if isinstance(e, Effect) else effect_named(e), outline=False) for e in effects]
    spread = tolerances(tolerance)
    # What the fit of the memory leaves out is not the body's fault.
    spread["kernel"] = float(np.hypot(spread["kernel"], np.nan_to_num(model.fit.relative_error)))
    known = [r for r in given if force_known(model, r)]
    if not known:
        from radiation_ss.gap.motion.diagnose import diagnose_motion

        return diagnose_motion(model, given, withhold, chosen, spread, notes)
    if len(known) < len(given):
        left = ", ".join(r.name for r in given if r not in known)
        notes += (f"The exciting force of {left} is unknown; the diagnosis rests on the other records.",)
    given = known
    check_units(model, given)
    notes += tuple(text for record in given for text in coarse_excitation(model, record))
    held = [(record, -np.inf) for record in withhold if force_known(model, record)]
    train = given
    if not held:
        given = [alive(model, r) for r in given]
        split = [r.time[0] + (1.0 - TAIL) * (r.time[-1] - r.time[0]) for r in given]
        held = list(zip(given, split))
        train = [given[0].window(-np.inf, split[0])] if len(given) == 1 else given
    if len(given) == 1:
        notes += ("One record only: what fits it may not hold at another amplitude or in another sea.",)
    setting = setting_of(model, train, spread)
    notes += unlike_clocks(given, {dof: scales.omega for dof, scales in setting.scales.items()})
    terms = terms_of(setting, chosen)
    found = search(setting, terms, pairs=pairs, progress=say, seed=seed)
    if bootstrap:
        law = refitted_law(found, terms, bootstrap, seed, None if cache is None else Path(cache), say)
        found = replace(found, law=law)
    answer = decide(found)
    say("unseen records", 0.97)
    seen_all = not withhold and len(given) > 1

    def predicted(answer: Verdict) -> Shrunk:
        fits = (refit_heads(model, given, held, spread, answer.chosen) if seen_all
                else (found.null, answer.chosen.fit))
        return measure(model, held, found, answer, fits, seed)

    answer, (how_far, predictions), said = on_unseen(found, answer, predicted)
    notes += (*said, *told_part(found, answer, how_far.gap_after, predicted))
    say("done", 1.0)
    notes += remarks(found, answer, how_far)
    corrected = corrected_of(found, answer, spread)
    if spoiled(how_far):
        # Unseen data never choose, but what fails on them is not handed on.
        answer = unnamed(answer) if answer.status in NAMED else answer
        how_far = replace(how_far, gap_after=how_far.gap_before, shrinkage=0.0, interval=(0.0, 0.0))
        predictions["corrected"], corrected = predictions["nominal"], Corrected({}, (), dict(spread))
    return Diagnosis(model.name, answer_of(setting, found, answer, chosen), choices(found), locate(setting, found),
                     how_far, corrected, predictions,
                     {"tolerance": spread, "seed": seed, "null": null_of(found, answer)}, notes, missing_force(setting))


def null_of(found: Search, answer: Verdict) -> dict[str, float]:
    """Return the evidence that the named effects (or else any) had to gain, and what simulated nulls reach."""
    keys = answer.chosen.key if answer.status in NAMED else tuple(found.law.evidence)
    return {"threshold": found.law.threshold(keys, SURE), "floor": SURE, "gap_left": found.law.left,
            "replicates": found.law.replicates, "refits": found.law.refits}


def remarks(found: Search, answer: Verdict, how_far: HowFar) -> tuple[str, ...]:
    """Return what a reader must know beside the verdict."""
    loose: tuple[str, ...] = () if found.null.converged else (
        "The fit without effects did not formally converge; its cost falls no more by what matters for the evidence.",)
    rough = sum(not c.fit.settled or not c.fit.converged for c in found.candidates if c.terms)
    if rough:
        loose += (f"{rough} of the candidates were not fitted to the end, for others are better by far; their gap "
                  "after is an upper bound.",)
    far = [f"{name} {pull:+.1f}" for name, pull in found.null.pulls.items() if abs(pull) > FAR_OFF]
    if far and answer.status == "no_gap":
        loose += (f"Retuning closes the gap, but moves by more than {FAR_OFF:g} tolerances: {', '.join(far)}.",)
    drift = not_white(answer.chosen.fit, found.floors)
    if drift > TOLD:
        loose += (f"{drift:.1%} of the motion is left that does not go with it: noise of a sensor that is not white (a "
                  "zero that drifts, a hum). It counts as noise.",)
    if how_far.sure and not spoiled(how_far) and how_far.sure[1] ** 2 < 0.5 * how_far.gap_after**2:
        loose += ("On unseen data most of the error is slow motion, of which the wave elevation says nothing: without "
                  f"it the gap goes from {how_far.sure[0]:.1%} to {how_far.sure[1]:.1%}.",)
    if not spoiled(how_far):
        return loose
    names = " and ".join(t.active.label for t in answer.chosen.terms) if answer.status in NAMED else "retuning"
    return (*loose, f"What was found on the records ({names}) did not hold on unseen data: the gap there went from "
            f"{how_far.gap_before:.1%} to {how_far.gap_after:.1%}. corrected.json is the model as given.",)


def named_effects(candidate: Candidate) -> tuple[Named, ...]:
    """Return the effects of a candidate with values and standard deviations."""
    setting = candidate.fit.problem.setting
    found = []
    for k, term in enumerate(candidate.terms):
        active = term.active
        units = {name: unit_of(p.unit, active.dof, active.other) for name, p in active.effect.parameters.items()}
        dof = f"{active.dof},{active.other}" if active.other else active.dof
        names = [item.record.name for item in setting.records] if active.effect.per_record else [""]
        own = {name: values_of(candidate.fit, k, r) for r, name in enumerate(names)}
        found.append(Named(active.name, dof, own[names[0]], units, own if len(own) > 1 else {}))
    return tuple(found)


def values_of(found: Fit, k: int, record: int = 0) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation of the free parameters of a fit's k-th effect in one record."""
    problem, term, place = found.problem, found.problem.terms[k], k + len(found.problem.setting.nominal)
    active, names = problem.actives(found.q, record)[place], list(term.active.effect.parameters)
    variance, values = np.diag(found.covariance), {}
    for j in term.free:
        column = problem.where[place, j][record if active.effect.per_record else 0]
        values[names[j]] = (active.values[names[j]], float(np.sqrt(variance[column]) * term.spread[j]))
    return values


def choices(found: Search) -> tuple[Choice, ...]:
    """Return the list of candidates, best first."""
    probabilities = posterior(found.candidates)
    before = total_gap(found.nominal)
    top = found.candidates[0].evidence
    return tuple(Choice(named_effects(c), probabilities[c.key], c.evidence - top, before, total_gap(c.fit))
                 for c in found.candidates[:LISTED])


def total_gap(found: Fit) -> float:
    """Return the gap of a fit on its own records, noise included."""
    channels = [c for item in found.problem.setting.records for c in item.channels]
    errors = [Error("", c.dof, c.quantity, c.time, c.value, r) for c, r in zip(channels, found.point.residuals)]
    first = {e.dof: e.quantity for e in reversed(errors)}
    return pooled_gap([e for e in errors if first[e.dof] == e.quantity])


def answer_of(setting: Setting, found: Search, answer: Verdict, effects: Sequence[Effect] | None) -> Answer:
    """Word the verdict."""
    rivals = answer.rivals or ([answer.chosen] if answer.chosen.terms else [])
    sets = tuple(tuple(t.active.name for t in c.terms) for c in answer.rivals)
    families = frozenset(t.active.effect.family for c in rivals for t in c.terms)
    outline = (named_effects(answer.chosen) if answer.status == "unknown_effect" and answer.left <= LEFT_SHARE
               and outlined(answer.chosen) else ())
    advised = (AGAIN if outline else advice(families)) if answer.status in ("ambiguous", "unknown_effect") else ""
    return Answer(answer.status, named_effects(answer.chosen) if answer.status in NAMED else (),
                  answer.probability, sets, not_testable(setting, found, effects), advised, outline)


def not_testable(setting: Setting, found: Search, effects: Sequence[Effect] | None) -> tuple[str, ...]:
    """Return effects of which a typical size would not show in these records beside the nominal numbers."""
    best = found.candidates[0].fit
    sizes = [mean_square(r) for r in best.point.residuals]
    ratio = float(np.mean([d**2 / max(s, 1e-300) for d, s in zip(found.null.noise.deviation, sizes)]))
    seen: dict[str, float] = {}
    for item in found.ranked:
        value = float(np.sqrt(max(np.linalg.eigvalsh(item.information)[-1], 0.0) * ratio))
        seen[item.term.active.name] = max(seen.get(item.term.active.name, 0.0), value)
    pool = library().values() if effects is None else effects
    return tuple(sorted(e.name for e in pool if seen.get(e.name, 0.0) < VISIBLE
                        and not (setting.model.n == 1 and e.coupled)))


def corrected_of(found: Search, answer: Verdict, spread: Mapping[str, float]) -> Corrected:
    """Return what simulate needs to predict with the corrected model: retuned only, where no effect is named."""
    source = answer.chosen.fit if answer.status in NAMED else found.null
    problem = source.problem
    actives = problem.actives(retuned(source))
    count = len(problem.setting.nominal)
    nominal = {(a.name, a.dof): float(a.values["share"]) for a in actives[:count]}
    effects = tuple(a for a in actives[count:] if not a.effect.per_record)
    motion = {dof: (scales.x, scales.omega) for dof, scales in problem.setting.scales.items()}
    return Corrected(nominal, effects, dict(spread), motion)


