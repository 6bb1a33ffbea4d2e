"""From the probabilities of sets of effects to budget and verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.account import (
    Data,
    Fitted,
    account,
    farthest,
    first,
    numbers,
    of_size,
    place,
    predictable,
    retried,
)
from radiation_ss.diagnosis.left import Remainder, left_by, remainder, share_left, unit_of
from radiation_ss.diagnosis.prediction import Error, Predictor, gap_of
from radiation_ss.diagnosis.result import Answer, Choice, Diagnosis, HowFar, Named, Recalibrated
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.shares import DRIFT, Budget, Row
from radiation_ss.diagnosis.where import where
from radiation_ss.effects import Active, library
from radiation_ss.effects.nominal import simulated_numbers
from radiation_ss.inference.candidates import Candidate, Key, Keys
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.search import Found, pulled_slowly
from radiation_ss.simulation.corrected import Corrected


def concluded(problem: EquationError, found: Found, hidden: Sequence[Key], data: Data, rules: Rules) -> Diagnosis:
    """Return the diagnosis that follows from a search."""
    model = problem.model
    errors = Predictor(model)
    known = [r for r in data.fitted if predictable(model, r)]
    pair, closed = of_size(Fitted(numbers(problem, found.candidates[0], data.tolerated, rules), found.candidates[0],
                                  errors), problem, known, data.tolerated, rules)
    null, tested = (retried(pair, found.null, data.check(), data.tolerated, rules) if data.check
                    else (numbers(problem, found.null, data.tolerated, rules), pair))
    rest = remainder(problem, pair.candidate, data, rules)
    slow = [Row(e.name, e.dof, 0.0, (0.0, 0.0), e.inclusion, e.parameters) for e in rest.drifts.values()]
    ledger, predictions = account(found, null, tested, data, slow, rest.below)
    how = far(ledger, predictions)
    answer = decided(found, pair, ledger, closed, hidden, rules, data, rest)
    own = simulated_numbers(model, data.tolerated, force=problem.forced)
    far_off = farthest(own, pair)
    # What is rather not there than there is no answer, either; where the coefficients say so, they may be the cause.
    if answer.status == "effect" and (answer.probability < 0.5 or far_off > rules.plausible):
        blamed = far_off <= rules.plausible and answer.probability >= 1.0 - data.contradiction
        sets = (tuple(label(model.dofs, e.name, e.dof) for e in answer.effects),) if blamed else ()
        answer = replace(answer, status="ambiguous" if blamed else "unknown_effect", effects=(),
                         indistinguishable=sets,
                         probability=answer.probability if blamed else 1.0 - answer.probability)
    moved = tuple(Recalibrated(o.active.name.removeprefix("nominal_"), o.active.dof, first(a), s, o.spread)
                  for o, a, s in zip(own, pair.best.nominal, pair.best.nominal_std))
    corrected = Corrected({(a.name, a.dof): first(a) for a in pair.best.nominal}, pair.best.effects, data.tolerated,
                          {dof: (s.x, s.omega) for dof, s in problem.scales.items()})
    return Diagnosis(model.name, answer, ledger, choices(problem, found),
                     where(problem, [e.name for e in answer.effects]),
                     how, corrected, moved, predictions, model.dofs, rules)


def decided(found: Found, pair: Fitted, ledger: Budget, closed: FloatArray, hidden: Sequence[Key], rules: Rules,
            data: Data, beside: Remainder) -> Answer:
    """Return the verdict: no_gap, effect, ambiguous or unknown_effect."""
    problem = found.problem
    # Which of force, sensor and nominal zero is off cannot be told: such effects are in sets, and get no name.
    sized = [(name(problem, active, stds, found.inclusion.get((active.name, active.dof, active.other), 0.0)),
              stands_out(active, stds, rules.confirmed), size**2 >= rules.matters * float(closed @ closed))
             for active, stds, size in zip(pair.best.effects, pair.best.effects_std, closed)
             if size >= rules.matters and active.effect.family != "offset"]
    named = [e for e, clear, _ in sized if clear and e.inclusion >= rules.sure
             and unrivalled(found, (e.name, *both(e.dof)), rules.sure)]
    telling = [e for e, clear, large in sized if clear or (large and e.inclusion >= rules.sure)]
    chance = joint(found, [(e.name, *both(e.dof)) for e in named])
    # What zeros of sensors are off by in any record is no drift of the force.
    drifting = max(least_beside(closed, rules), rules.discrepancy.offset)
    slow = [e for e in beside.drifts.values() if ledger.closed_by(e.name, e.dof) >= drifting]
    unexplained = share_left(pair, ledger, [r for r in data.fitted if predictable(problem.model, r)], beside.below)
    grows = ledger.before**2 * (ledger.left - 1.0) > rules.matters**2
    kinds, forced = {run.record.kind for run in problem.runs}, problem.forced
    untold = tuple(sorted({key[0] for key in hidden} - {k[0] for k in found.inclusion}))
    rest = ledger.before * np.sqrt(ledger.unexplained)
    closes = unexplained <= rules.unexplained or rest < rules.matters
    # What is left may be another effect's: by its motion, where it is more than chance, else by its energy.
    left = min(ledger.unexplained, 1.0)
    worth = min(1.0 - max(rules.false_alarm, np.sqrt(left) if beside.missed else left, data.contradiction),
                1.0 / (1.0 + ledger.against))
    outside = rest >= rules.matters and (grows or beside.missed) and ledger.beyond >= rules.matters
    chances = likely_sets(found, rules.credible, rules.told, too_small(found.candidates[0], pair.candidate))
    chances = {(*told, *(label(problem.model.dofs, e.name, e.dof) for e in slow)): p for told, p in chances.items()}
    sets, rivals = [*chances], tuple(told for told, p in chances.items() if p >= 1.0 - rules.credible)
    doubtful = within(found, frozenset()) < 0.5 and max(closed, default=0.0) >= rules.matters
    if pulled_slowly(problem) and not any(c.terms for c in found.candidates):
        return Answer("ambiguous", (), 0.0, (), untold, next_record(kinds, forced, "slow"))
    if named and not ledger.unseen:  # without a known force nothing checks a name
        status, cap, named = "ambiguous", min(chance, 0.5), []
    elif named == telling and (named or (slow and not doubtful)) and not grows and closes:
        status, cap, named = "effect", min(chance, worth), [*named, *slow]
    elif doubtful and shrinks(ledger, rules) and (closes or not outside):
        # Effects of one set that do not stand out beside each other stand for each other.
        sets = sets if len(sets) > 1 else [(told,) for told in sets[0]]
        status, cap, named = "ambiguous", found.probabilities()[0], []
    elif outside:
        some = chance if named else 1.0 - within(found, frozenset())
        status, cap, named = "unknown_effect", 1.0 - min(some, worth), []
    elif (len(rivals) > 1 and surprising(pair, data.tolerated, problem, rules)
          and ledger.before**2 - ledger.after**2 >= rules.matters**2):
        # A number that is further off than its tolerance allows may be off itself, or by an effect like it.
        status, cap, named, sets = "ambiguous", found.probabilities()[0], [], [*rivals]
    else:
        status, cap, named = "no_gap", within(found, found.candidates[0].keys), []
    zero = with_zeros(problem.model, named, off_zero(found, pair, closed, rules))
    told = {"ambiguous": tuple(sets), "effect": zero or (rivals if len(rivals) > 1 else ())}
    return Answer(status, tuple(named), float(cap), told.get(status, ()), untold, next_record(kinds, forced, status))


def zeros() -> list[str]:
    """Return the effects by which a zero is off in all records alike: of a force, or of a sensor."""
    return sorted(e.name for e in library().values() if e.family == "offset" and not e.per_record)


def least_beside(closed: FloatArray, rules: Rules) -> float:
    """Return how much of the motion a zero that is off, or a slow force, accounts for at least to be told."""
    return max(rules.matters, float(np.sqrt(rules.matters) * np.linalg.norm(closed)))


def off_zero(found: Found, pair: Fitted, closed: FloatArray, rules: Rules) -> list[str]:
    """Return the degrees of freedom where a zero is off by what matters."""
    least, names = least_beside(closed, rules), zeros()
    sized = {active.dof for active, size in zip(pair.best.effects, closed) if active.name in names and size >= least}
    chance = {dof: sum(p for c, p in zip(found.candidates, found.probabilities())
                       if any(a in names and at == dof for a, at, _ in c.keys)) for dof in sized}
    return [dof for dof in found.problem.model.dofs if chance.get(dof, 0.0) >= rules.sure]


def with_zeros(model: Model, named: Sequence[Named], dofs: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the sets of names beside which zeros are off, each by one of the effects that make it so."""
    known = [label(model.dofs, e.name, e.dof) for e in named]
    return tuple((*known, *(label(model.dofs, zero, dof) for dof in dofs)) for zero in zeros()) if dofs else ()


def label(dofs: Sequence[str], name: str, where: str) -> str:
    """Return an effect with its place, which is not said of a body with one motion."""
    return f"{name} on {where}" if where and len(dofs) > 1 else name


def contradiction(model: Model) -> float:
    """Return by how much the model's coefficients are not symmetric or not passive, of their largest damping."""
    if model.hydro is None:
        return 0.0
    found = [f.value for f in model.hydro.check().findings if f.problem and f.kind in ("negative damping", "asymmetry")]
    return float(np.clip(max(map(abs, found), default=0.0), 0.0, 1.0))


def shrinks(ledger: Budget, rules: Rules) -> bool:
    """Whether the best set leaves less of unseen records than there was, or no gap that matters."""
    return not ledger.unseen or ledger.after < ledger.before or ledger.after**2 < ledger.noise**2 + rules.matters**2


def stands_out(active: Active, stds: Sequence[float], least: float) -> bool:
    """Whether a strength of an effect differs from zero by some standard deviations."""
    parameters = active.effect.parameters.items()
    return any(p.strength and s > 0.0 and abs(active.values[n]) >= least * s for (n, p), s in zip(parameters, stds))


def both(dof: str) -> tuple[str, str]:
    """Take a place apart."""
    one, _, other = dof.partition(",")
    return one, other


def name(problem: EquationError, active: Active, stds: Sequence[float], chance: float) -> Named:
    """Return an effect with numbers and units."""
    second = active.other or active.dof
    units = {n: unit_of(p.unit, active.dof, second) for n, p in active.effect.parameters.items()}
    values = {n: (v, s) for (n, v), s in zip(active.values.items(), stds) if s > 0.0}
    return Named(active.name, place(active), values, units, chance)


def joint(found: Found, keys: Sequence[Key]) -> float:
    """Return the probability that all of some effects are there."""
    wanted = set(keys)
    return float(sum(p for c, p in zip(found.candidates, found.probabilities()) if wanted <= c.keys))


def unrivalled(found: Found, key: Key, sure: float) -> bool:
    """Whether no other effect in the place of one makes a set that is nearly as likely."""
    best = max((c for c in found.candidates if key in c.keys), key=lambda c: c.log_probability)
    rest = best.keys - {key}
    others = [c.log_probability for c in found.candidates
              if len(c.keys) == len(best.keys) and rest < c.keys != best.keys]
    return best.log_probability - max(others, default=-np.inf) >= np.log(sure / (1.0 - sure))


def within(found: Found, keys: Keys) -> float:
    """Return the probability that no effect but some is there."""
    return float(sum(p for c, p in zip(found.candidates, found.probabilities()) if c.keys <= keys))


def too_small(best: Candidate, kept: Candidate) -> Keys:
    """Return the effects of a set that close too little to matter, and on the same place what a zero stands for."""
    small = best.keys - kept.keys
    alike = {e.name for e in library().values() if e.family == "offset"}
    return small | {(other, dof, "") for name, dof, _ in small if name in alike for other in alike}


def likely_sets(found: Found, share: float, most: int, small: Keys = frozenset()) -> dict[tuple[str, ...], float]:
    """Return sets of names with their probability, the first one's candidate the most probable; `small` effects untold.

    They hold a share of the probability, as far as so many do.
    """
    chances: dict[tuple[str, ...], float] = {}
    for candidate, p in zip(found.candidates, found.probabilities()):
        labels = tuple(sorted(label(found.problem.model.dofs, a, f"{b},{c}" if c else b)
                              for a, b, c in candidate.keys - small))
        chances[labels] = chances.get(labels, 0.0) + float(p)
    order = list(chances)
    order[1:] = sorted(order[1:], key=lambda labels: -chances[labels])
    needed = 1 + int(np.searchsorted(np.cumsum([chances[labels] for labels in order]), share))
    return {labels: chances[labels] for labels in order[:min(needed, most)]}


def surprising(pair: Fitted, tolerated: dict[str, float], problem: EquationError, rules: Rules) -> bool:
    """Whether a nominal number is further off than one of so many is by chance if the stated tolerances hold."""
    own = simulated_numbers(problem.model, tolerated, force=problem.forced)
    least = float(norm.isf(0.5 * (1.0 - rules.credible) / len(own)))
    return any(abs(first(a)) - rules.confirmed * s > 0.0 and abs(first(a)) >= least * o.spread
               for o, a, s in zip(own, pair.best.nominal, pair.best.nominal_std))


def choices(problem: EquationError, found: Found, most: int = 12) -> tuple[Choice, ...]:
    """Return the list of candidates."""
    rows, rendered = problem.rows, []
    best = found.candidates[0].log_probability
    own = sum(float(np.sum(rows.scale[p.rows] ** 2)) / p.bins for p in problem.places if p.order < 0)
    before = float(np.sqrt(np.sum(rows.error**2) / max(own, 1e-300)))
    for candidate, p in list(zip(found.candidates, found.probabilities()))[:most]:
        at, effects = problem.base.count, []
        spread = np.sqrt(np.diag(candidate.posterior.covariance))
        for term in candidate.terms:
            strengths = [n for n, q in term.active.effect.parameters.items() if q.strength]
            values = {n: (float(candidate.posterior.mean[at + k]), float(spread[at + k]))
                      for k, n in enumerate(strengths)}
            effects.append(Named(term.active.name, place(term.active), values, {}, 1.0))
            at += term.columns.count
        after = float(np.sqrt(np.sum(left_by(problem, candidate) ** 2) / max(own, 1e-300)))
        rendered.append(Choice(tuple(effects), float(p), candidate.log_probability - best, before, after))
    return tuple(rendered)


def far(ledger: Budget, predictions: Mapping[str, Sequence[Error]]) -> HowFar:
    """Return the gaps on unseen records."""
    if not predictions:
        return HowFar(0.0, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0), ())
    room = ledger.before**2 - ledger.noise**2
    # A slow force is explained, not predicted: it does not shrink the gap.
    closed = sum(r.share for r in ledger.rows if r.cause not in ("unexplained", "noise", DRIFT))
    scale = ledger.before**2 / room if room > 0.1 * ledger.noise**2 and room > 0.0 else 0.0
    unexplained = next(r for r in ledger.rows if r.cause == "unexplained")
    told = 1.0 - ledger.slow - next(r for r in ledger.rows if r.cause == "noise").share
    interval = tuple(float((told - u) * scale) for u in (unexplained.interval[1], unexplained.interval[0]))
    retuned = gap_of(predictions["recalibrated"]) / max(gap_of(predictions["given"]), 1e-300) * ledger.before
    return HowFar(ledger.before, retuned, ledger.after, ledger.noise,
                  float(closed * scale), (interval[0], interval[1]), ledger.unseen)


def next_record(kinds: set[str], forced: bool, status: str) -> str:
    """Return what to measure next: a kind of test that was not given."""
    if status in ("no_gap", "effect"):
        return ""
    if status == "slow":
        return "the force that pulls or holds the body (kind static), or its release (kind decay)"
    if "decay" not in kinds and "prescribed" not in kinds:
        return "a decay test from a large displacement"
    if not forced:
        return "waves or a forced test with known force near the natural frequency"
    return "the same test at half and at twice the amplitude"
