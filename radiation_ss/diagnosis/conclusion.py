"""From the probabilities of sets of effects to budget and verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.account import (
    Data,
    Fitted,
    account,
    carried,
    farthest,
    first,
    numbers,
    of_size,
    place,
    predictable,
    recorded_noise,
    retried,
)
from radiation_ss.diagnosis.prediction import Error, Predictor, energy, gap_of
from radiation_ss.diagnosis.result import Answer, Choice, Diagnosis, HowFar, Named, Recalibrated
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.shares import Budget
from radiation_ss.diagnosis.where import where
from radiation_ss.effects import Active, effect_named, library
from radiation_ss.effects.nominal import simulated_numbers
from radiation_ss.inference.candidates import Candidate, Key, Keys
from radiation_ss.inference.linear_model import variance
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import force_noise
from radiation_ss.inference.search import Found, pulled_slowly
from radiation_ss.records.record import Record
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
    ledger, predictions = account(found, null, tested, data)
    how = far(ledger, predictions)
    answer = decided(found, pair, ledger, closed, hidden, rules, data)
    own = simulated_numbers(model, data.tolerated, force=problem.forced)
    far_off = farthest(own, pair)
    # What is rather not there than there is no answer, either.
    if answer.status == "effect" and (answer.probability < 0.5 or far_off > rules.plausible):
        answer = replace(answer, status="unknown_effect", effects=(), indistinguishable=(),
                         probability=1.0 - answer.probability)
    moved = tuple(Recalibrated(o.active.name.removeprefix("nominal_"), o.active.dof, first(a), s, o.spread)
                  for o, a, s in zip(own, pair.best.nominal, pair.best.nominal_std))
    corrected = Corrected({(a.name, a.dof): first(a) for a in pair.best.nominal}, pair.best.effects, data.tolerated,
                          {dof: (s.x, s.omega) for dof, s in problem.scales.items()})
    return Diagnosis(model.name, answer, ledger, choices(problem, found),
                     where(problem, [e.name for e in answer.effects]),
                     how, corrected, moved, predictions, model.dofs, rules)


def decided(found: Found, pair: Fitted, ledger: Budget, closed: FloatArray, hidden: Sequence[Key], rules: Rules,
            data: Data) -> Answer:
    """Return the verdict: no_gap, effect, ambiguous or unknown_effect."""
    problem = found.problem
    # Which of force, sensor and nominal zero is off cannot be told: such effects are in sets, and get no name.
    sized = [(name(problem, active, stds, found.inclusion.get((active.name, active.dof, active.other), 0.0)),
              stands_out(active, stds, rules.confirmed), size**2 >= rules.matters * float(closed @ closed))
             for active, stds, size in zip(pair.best.effects, pair.best.effects_std, closed)
             if size >= rules.matters and effect_named(active.name).family != "offset"]
    named = [e for e, clear, _ in sized if clear and e.inclusion >= rules.sure
             and unrivalled(found, (e.name, *both(e.dof)), rules.sure)]
    telling = [e for e, clear, large in sized if clear or (large and e.inclusion >= rules.sure)]
    chance = joint(found, [(e.name, *both(e.dof)) for e in named])
    unexplained = left_over(pair, ledger, [r for r in data.fitted if predictable(problem.model, r)])
    grows = ledger.after**2 > ledger.before**2 + rules.matters**2
    kinds, forced = {run.record.kind for run in problem.runs}, problem.forced
    untold = tuple(sorted({key[0] for key in hidden} - {k[0] for k in found.inclusion}))
    rest = ledger.before * np.sqrt(ledger.unexplained)
    closes = unexplained <= rules.unexplained or rest < rules.matters
    missed = misfit(problem, pair.candidate, rules) or surprised(pair.candidate, data, rules)
    # What is left may be another effect's: by its motion, where it is more than chance, else by its energy.
    left = min(ledger.unexplained, 1.0)
    worth = min(1.0 - max(rules.false_alarm, np.sqrt(left) if missed else left, data.contradiction),
                1.0 / (1.0 + ledger.against))
    outside = rest >= rules.matters and (grows or missed) and ledger.beyond >= rules.matters
    sets = likely_sets(found, rules.credible, rules.told, too_small(found.candidates[0], pair.candidate))
    if pulled_slowly(problem) and not any(c.terms for c in found.candidates):
        return Answer("ambiguous", (), 0.0, (), untold, next_record(kinds, forced, "slow"))
    if named and not ledger.unseen:  # without a known force nothing checks a name
        status, cap, named = "ambiguous", min(chance, 0.5), []
    elif named == telling != [] and not grows and closes:
        status, cap = "effect", min(chance, worth)
    elif (within(found, frozenset()) < 0.5 and max(closed, default=0.0) >= rules.matters and shrinks(ledger, rules)
          and (closes or not outside)):
        # Effects of one set that do not stand out beside each other stand for each other.
        sets = sets if len(sets) > 1 else [(told,) for told in sets[0]]
        status, cap, named = "ambiguous", found.probabilities()[0], []
    elif outside:
        some = chance if named else 1.0 - within(found, frozenset())
        status, cap, named = "unknown_effect", 1.0 - min(some, worth), []
    else:
        status, cap, named = "no_gap", within(found, found.candidates[0].keys), []
    told = {"ambiguous": tuple(sets), "effect": with_zeros(problem.model, named, off_zero(found, pair, closed, rules))}
    return Answer(status, tuple(named), float(cap), told.get(status, ()), untold, next_record(kinds, forced, status))


def zeros() -> list[str]:
    """Return the effects by which a zero is off in all records alike: of a force, or of a sensor."""
    return sorted(e.name for e in library().values() if e.family == "offset" and not e.per_record)


def off_zero(found: Found, pair: Fitted, closed: FloatArray, rules: Rules) -> list[str]:
    """Return the degrees of freedom where a zero is off by what matters."""
    least, names = max(rules.matters, np.sqrt(rules.matters) * float(np.linalg.norm(closed))), zeros()
    sized = {active.dof for active, size in zip(pair.best.effects, closed) if active.name in names and size >= least}
    chance = {dof: sum(p for c, p in zip(found.candidates, found.probabilities())
                       if any(a in names and at == dof for a, at, _ in c.keys)) for dof in sized}
    return [dof for dof in found.problem.model.dofs if chance.get(dof, 0.0) >= rules.sure]


def with_zeros(model: Model, named: Sequence[Named], dofs: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the sets of names beside which zeros are off, each by one of the effects that make it so."""
    known = [label(model, e.name, e.dof) for e in named]
    return tuple((*known, *(label(model, zero, dof) for dof in dofs)) for zero in zeros()) if dofs else ()


def label(model: Model, name: str, where: str) -> str:
    """Return an effect with its place, which is not said of a body with one motion."""
    return f"{name} on {where}" if where and model.n > 1 else name


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


def left_over(pair: Fitted, ledger: Budget, fitted: Sequence[Record]) -> float:
    """Return the share of the gap's energy that is left unexplained, in the records of the fit and unseen together."""
    rest = ledger.before**2 * ledger.unexplained
    given = pair.errors((), fitted) if fitted else None
    best = pair.errors(pair.best.actives, fitted) if fitted else None
    if given is None or best is None:
        return ledger.unexplained
    return float((rest + energy(best).sum()) / max(ledger.before**2 + energy(given).sum(), 1e-300))


def misfit(problem: EquationError, candidate: Candidate, rules: Rules) -> bool:
    """Whether the force that is left would move the body by what matters, beside noise and tolerances."""
    rows, residual = problem.rows, left_by(problem, candidate, known=True)
    # No less than far above the motion: what is less in its band went to the force.
    noise = np.maximum(rows.noise, variance(rows, candidate.posterior.sizes)[0])
    excess, chance, whole = np.zeros((3, problem.model.n))
    for p in [p for p in problem.places if p.order < 0 and problem.runs[p.record].record.kind != "static"]:
        run, i = problem.runs[p.record], p.dof
        # The sensors' noise is white in the motion: in a row of the force it tells the impedance there.
        through = run.noise[i] ** 2 / np.tile(force_noise(problem.model, run, p), len(run.basis))
        omega = np.concatenate([block.omega[: p.bins] for block in run.basis])
        own = noise[p.rows] + recorded_noise(run, i, omega) ** 2
        excess[i] += np.sum((residual[p.rows] ** 2 - own) * through)
        chance[i] += 2.0 * np.sum((own * through) ** 2)
        whole[i] += np.sum(run.x[i] ** 2)
    return bool(np.any(excess > np.maximum(rules.matters**2 * whole, rules.confirmed * np.sqrt(chance))))


def left_by(problem: EquationError, candidate: Candidate, known: bool = False) -> FloatArray:
    """Return the equation error that a set leaves; `known`: beside what is known of."""
    return problem.residual([term.columns for term in candidate.terms], candidate.posterior, known)


def surprised(candidate: Candidate, data: Data, rules: Rules) -> bool:
    """Whether the withheld records hold a force that the set does not explain, its numbers fitted to them."""
    if data.withheld is None:
        return False
    return misfit(data.withheld, carried(candidate, data.withheld, rules), rules)


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


def unit_of(form: str, dof: str, other: str) -> str:
    """Return a parameter's unit in SI for a degree of freedom."""
    def turns(d: str) -> bool:
        return d.split("__")[-1] in ("Roll", "Pitch", "Yaw")
    text = form.replace("F", "N m" if turns(dof) else "N").replace("X", "rad" if turns(dof) else "m")
    return text.replace("Y", "rad" if turns(other) else "m")


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


def likely_sets(found: Found, share: float, most: int, small: Keys = frozenset()) -> list[tuple[str, ...]]:
    """Return sets of names, the most probable first, that hold most of the probability; `small` effects untold."""
    sets: list[tuple[str, ...]] = []
    total = 0.0
    for candidate, p in zip(found.candidates, found.probabilities()):
        labels = tuple(sorted(label(found.problem.model, a, f"{b},{c}" if c else b)
                              for a, b, c in candidate.keys - small))
        if labels not in sets:
            sets.append(labels)
        total += p
        if total > share or len(sets) == most:
            break
    return sets


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
    closed = sum(r.share for r in ledger.rows if r.cause not in ("unexplained", "noise"))
    scale = ledger.before**2 / room if room > 0.1 * ledger.noise**2 and room > 0.0 else 0.0
    unexplained = next(r for r in ledger.rows if r.cause == "unexplained")
    quiet = next(r for r in ledger.rows if r.cause == "noise").share
    interval = tuple(float((1.0 - quiet - u) * scale) for u in (unexplained.interval[1], unexplained.interval[0]))
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
