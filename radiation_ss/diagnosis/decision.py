"""The verdict, and the grounds that it follows from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from radiation_ss.arrays import FloatArray
from radiation_ss.diagnosis.account import (
    Data,
    Fitted,
    farthest,
    first,
    in_second_sensors,
    numbers_told,
    place,
    predictable,
)
from radiation_ss.diagnosis.left import (
    Remainder,
    least_beside,
    off_zero,
    share_left,
    unit_of,
)
from radiation_ss.diagnosis.result import Answer, Named
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.sets import (
    Names,
    joint,
    label,
    likely_sets,
    places,
    told_sets,
    unrivalled,
    with_zeros,
    within,
    zeros,
)
from radiation_ss.diagnosis.shares import Budget
from radiation_ss.effects import Active
from radiation_ss.effects.nominal import OwnNumber
from radiation_ss.inference.candidates import Key
from radiation_ss.inference.problem import EquationError, pulled_slowly
from radiation_ss.inference.search import Found
from radiation_ss.records.columns import RATES
from radiation_ss.simulation.headings import computed


@dataclass(frozen=True)
class Grounds:
    """What a verdict follows from."""

    named: tuple[Named, ...]  # Effects that close what matters, stand out, are probable and have no rival
    slow: tuple[Named, ...]  # Slow forces that close what matters
    zeros: tuple[str, ...]  # Motions where a zero is off
    sets: tuple[Names, ...]  # Those that are not improbable by name, the most probable one first
    chance: float  # Probability that all of `named` are there
    none: float  # Probability that no effect is
    worth: float  # Most that a name can be worth, by what is left beside it and by what speaks against it
    contradiction: float  # By how much the model's coefficients contradict themselves
    first: float  # Probability of the first set
    no_more: float  # Probability that none is beside those of the first set
    whole: bool  # Whether `named` is all that tells
    checked: bool  # Whether unseen records check a name: those of a known force
    matter: bool  # Whether any effect closes what matters
    shrinks: bool  # Whether the gap of unseen records shrinks
    grows: bool  # Whether it surely grows
    closes: bool  # Whether little of it is left
    outside: bool  # Whether another effect is left
    plausible: bool  # Whether each nominal number is as near as it may be beside a name
    moved: bool  # Whether the model's numbers close what matters
    surprising: bool  # Whether one of them is further off than its tolerance allows

    @property
    def rather(self) -> bool:
        """Whether some effect is rather there than not."""
        return self.none < 0.5

    @property
    def doubtful(self) -> bool:
        """Whether an effect that matters is rather there than not."""
        return self.rather and self.matter


def grounds(found: Found, pair: Fitted, ledger: Budget, closed: FloatArray, own: Sequence[OwnNumber], data: Data,
            beside: Remainder, rules: Rules) -> Grounds:
    """Return what the verdict follows from."""
    problem, dofs = found.problem, found.problem.model.dofs
    seen = np.maximum(closed, in_second_sensors(problem, pair.candidate))
    # Which of force, sensor and nominal zero is off cannot be told: such effects are in sets, and get no name.
    sized = [(named_effect(problem, active, stds, found.inclusion.get(active.key, 0.0)),
              stands_out(active, stds, rules.confirmed), size**2 >= rules.matters * float(closed @ closed))
             for active, stds, size in zip(pair.best.effects, pair.best.effects_std, seen)
             if size >= rules.matters and active.effect.family != "offset"]
    named = [e for e, clear, _ in sized if clear and e.inclusion >= rules.sure and not ledger.worse
             and unrivalled(found, (e.name, *places(e.dof)), rules.sure)]
    telling = [e for e, clear, large in sized if clear or (large and e.inclusion >= rules.sure)]
    # What zeros of sensors are off by in any record is no drift of the force.
    drifting = max(least_beside(closed, rules), rules.discrepancy.offset)
    slow = [e for e in beside.drifts.values() if ledger.closed_by(e.name, e.dof) >= drifting]
    chances = told_sets(found, pair.candidate.keys)
    sets = likely_sets(chances, 1.0 - rules.credible, rules.told)
    # A force of waves is as sure as its tolerance at each frequency, and so is what is predicted with it.
    by_waves = any(computed(problem.model, record) for record in data.unseen)
    allowed = np.hypot(rules.matters, data.tolerated["force"] * by_waves)
    rest, grows = ledger.before * np.sqrt(ledger.unexplained), ledger.before**2 * ledger.grown > allowed**2
    left = share_left(pair, ledger, [r for r in data.fitted if predictable(problem.model, r)], beside.below)
    # What is left may be another effect's: by its motion, where it is more than chance, else by its energy.
    odd = float(np.sqrt(min(ledger.unexplained, 1.0)) if beside.missed else min(ledger.unexplained, 1.0))
    return Grounds(
        named=tuple(named), slow=tuple(slow), zeros=tuple(off_zero(found, pair, closed, ledger, rules)),
        sets=tuple((*told, *(label(dofs, e.name, e.dof) for e in slow)) for told in sets),
        chance=joint(found, [(e.name, *places(e.dof)) for e in named]),
        none=within(chances, ()), first=min(float(found.probabilities()[0]), chances[sets[0]]),
        no_more=within(chances, sets[0]),
        worth=min(1.0 - max(rules.false_alarm, odd, data.contradiction), 1.0 / (1.0 + ledger.against),
                  *(e.inclusion for e in slow)),
        contradiction=data.contradiction, whole=named == telling, checked=bool(ledger.unseen),
        matter=max(seen, default=0.0) >= rules.matters, shrinks=shrinks(ledger, rules), grows=grows,
        closes=left <= rules.unexplained or rest < rules.matters,
        outside=min(rest, ledger.unexplained) >= rules.matters and (grows or beside.missed)
        and ledger.beyond >= rules.matters,
        plausible=farthest(own, pair) <= rules.plausible,
        moved=ledger.before**2 - ledger.after**2 >= rules.matters**2, surprising=surprising(own, pair, rules))


def answered(on: Grounds, found: Found, ledger: Budget, hidden: Sequence[Key], rules: Rules) -> Answer:
    """Return the verdict with what it names and what to measure next."""
    problem = found.problem
    kinds, untold = {run.record.kind for run in problem.runs}, {k[0] for k in hidden} - {k[0] for k in found.inclusion}
    if slowly := pulled_slowly(problem) and not any(c.terms for c in found.candidates):
        status, chance, sets = "ambiguous", 0.0, tuple[Names, ...]()
    else:
        status, chance, sets = verdict(on, problem.model.dofs)
    return Answer(status, on.named if status == "effect" else (), float(chance), sets,
                  tuple(sorted(untold)), next_record(kinds, problem.forced, "slow" if slowly else status, sets))


def doubted(answer: Answer, dofs: Sequence[str]) -> Answer:
    """Return an answer without names that what a column may be instead explains as well."""
    if not answer.effects:
        return answer
    named = tuple(label(dofs, e.name, e.dof) for e in answer.effects)
    return replace(answer, status="ambiguous", effects=(), probability=min(answer.probability, 0.5),
                   indistinguishable=answer.indistinguishable or (named,),
                   next_record="a known load and a known place by the same sensors")


def verdict(on: Grounds, dofs: Sequence[str]) -> tuple[str, float, tuple[Names, ...]]:
    """Return no_gap, effect, ambiguous or unknown_effect with its probability and the sets beside it."""
    if on.named and not on.checked:  # without a known force nothing checks a name
        return "ambiguous", min(on.chance, 0.5), on.sets
    if on.whole and (on.named or (on.slow and not on.doubtful)) and on.closes and not on.grows:
        sure, told = min(on.chance, on.worth), tuple(label(dofs, e.name, e.dof) for e in (*on.named, *on.slow))
        if on.plausible and sure >= 0.5 and not on.slow:
            return "effect", sure, with_zeros(dofs, told, on.zeros) or (on.sets if len(on.sets) > 1 else ())
        # What is rather not there than there is no answer; where the coefficients say so, they may be the cause. A slow
        # force is as well one that the library has not: wind, a ship, a load that shifts.
        blamed = on.plausible and (sure >= 1.0 - on.contradiction or (sure >= 0.5 and bool(on.slow)))
        return ("ambiguous", sure, (told,)) if blamed else ("unknown_effect", 1.0 - sure, ())
    if on.doubtful and (not on.outside or (on.shrinks and on.closes)):
        # Effects of one set that do not stand out beside each other stand for each other, each beside those that do.
        clear = tuple(label(dofs, e.name, e.dof) for e in on.named)
        apart = tuple((*clear, one) for one in on.sets[0] if one not in clear)
        sets = on.sets if len(on.sets) > 1 or not apart else apart
        # What predicts no better, and is not sure by itself, may as well be absent.
        return "ambiguous", on.first, sets if on.shrinks or on.named else ((), *sets)
    if on.outside:
        return "unknown_effect", 1.0 - min(on.chance if on.named else 1.0 - on.none, on.worth), ()
    if on.moved and ((on.surprising and len(on.sets) > 1) or on.rather):
        # A number that is further off than its tolerance allows may be off itself, or by an effect like it; and that
        # nothing is there is no answer where that is rather not so.
        return "ambiguous", on.first, on.sets if len(on.sets) > 1 else ((), *on.sets)
    if on.zeros:  # of one record, say: no set of effects for all of them has it
        return "ambiguous", 0.5 * on.no_more, with_zeros(dofs, (), on.zeros)
    return "no_gap", on.no_more, ()


def shrinks(ledger: Budget, rules: Rules) -> bool:
    """Whether the best set leaves less of unseen records than there was, or no gap that matters."""
    return not ledger.unseen or ledger.after < ledger.before or ledger.after**2 < ledger.noise**2 + rules.matters**2


def stands_out(active: Active, stds: Sequence[float], least: float) -> bool:
    """Whether a strength of an effect differs from zero by some standard deviations."""
    parameters = active.effect.parameters.items()
    return any(p.strength and s > 0.0 and abs(active.values[n]) >= least * s for (n, p), s in zip(parameters, stds))


def named_effect(problem: EquationError, active: Active, stds: Sequence[float], chance: float) -> Named:
    """Return an effect with numbers and units."""
    second = active.other or active.dof
    units = {n: unit_of(p.unit, active.dof, second) for n, p in active.effect.parameters.items()}
    return Named(active.name, place(active), numbers_told(active, stds), units, chance, channels_of(problem, active))


def channels_of(problem: EquationError, active: Active) -> tuple[str, ...]:
    """Return the channels that an effect is of, where it is of second sensors alone."""
    read = {(s.order, s.dof) for run in problem.runs for s in run.sensors if not active.of_first_sensor}
    return tuple(f"{active.dof}{list(RATES)[order]}" for order, dof in sorted(read)
                 if problem.model.dofs[dof] == active.dof)


def surprising(own: Sequence[OwnNumber], pair: Fitted, rules: Rules) -> bool:
    """Whether a nominal number is further off than one of so many is by chance if the stated tolerances hold."""
    least = float(norm.isf(0.5 * (1.0 - rules.credible) / len(own)))
    return any(abs(first(a)) - rules.confirmed * s > 0.0 and abs(first(a)) >= least * o.spread
               for o, a, s in zip(own, pair.best.nominal, pair.best.nominal_std))


def next_record(kinds: set[str], forced: bool, status: str, sets: Sequence[Names]) -> str:
    """Return what to measure next: a kind of test that was not given, or what tells the sets apart."""
    if status in ("no_gap", "effect"):
        return ""
    if status == "slow":
        return "the force that pulls or holds the body (kind static), or its release (kind decay)"
    apart = {told for names in sets for told in names if not all(told in other for other in sets)}
    if apart and all(told.partition(" on ")[0] in zeros() for told in apart):
        return "the sensor's reading of a known place: in any motion a steady force looks like a zero that is off"
    if "decay" not in kinds and "prescribed" not in kinds:
        return "a decay test from a large displacement"
    if not forced:
        return "waves or a forced test with known force near the natural frequency"
    return "the same test at half and at twice the amplitude"
