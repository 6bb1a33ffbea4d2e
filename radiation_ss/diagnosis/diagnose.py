"""Diagnose the gap between a model and measured records: a budget of causes, and a verdict that follows from it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.arrays import FloatArray, generator, listed
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.account import Data, Fitted, account, first, numbers, of_size, predictable
from radiation_ss.diagnosis.decision import answered, doubted, grounds, named_effect
from radiation_ss.diagnosis.left import all_right, left_by, put_right, remainder, retried
from radiation_ss.diagnosis.prediction import Error, Predictor, clocks, gap_of, split
from radiation_ss.diagnosis.result import Choice, Diagnosis, HowFar, Recalibrated
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.shares import DRIFT, Budget, Row
from radiation_ss.diagnosis.where import where
from radiation_ss.effects import Effect, effect_named, library, optional
from radiation_ss.effects.nominal import simulated_numbers, tolerances
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode
from radiation_ss.inference.candidates import Candidate, Key, from_regression
from radiation_ss.inference.equation import equation_error, left_out
from radiation_ss.inference.evidence import by_trajectories
from radiation_ss.inference.motion import MeasuredMotion, measured_motion, parted
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.readings import moves, not_measured, unmoved
from radiation_ss.inference.refined import searched
from radiation_ss.inference.search import Found
from radiation_ss.inference.slow_test import freely_placed
from radiation_ss.methods import accepting
from radiation_ss.parallel import on_one_core
from radiation_ss.records.convert import as_records
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import check_given_once, named_apart, suspicions
from radiation_ss.simulation.corrected import Corrected, numbers_of
from radiation_ss.simulation.measured import coarse_excitation, drifting, measured_driven, measured_freely
from radiation_ss.simulation.misreadings import other_readings
from radiation_ss.simulation.run import steady_force
from radiation_ss.simulation.unit_checks import check_units, doubts

__all__ = ["Diagnosis", "diagnose"]

Progress = Callable[[str, float], None]


@accepting(model=as_model, records=as_records, withhold=as_records)
@on_one_core
def diagnose(model: Model, records: Sequence[Record] | Record,
             effects: Sequence[str | Effect] | str | Effect | None = None, absent: Sequence[str] | str = (),
             present: Sequence[str] | str = (), tolerance: float | Mapping[str, float] | None = None,
             seed: int = 0, *, withhold: Sequence[Record] | Record = (), rules: Rules | None = None,
             progress: Progress | None = None) -> Diagnosis:
    """Say where model and measurement differ, which effects cause it, and how far the gap shrinks with them.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    records : Record, path or pandas.DataFrame, or a sequence of them
    effects : sequence of str or Effect, or one of them, optional
        The library to consider; by default all of it, between bodies what joins them.
    absent, present : sequence of str, or str
        Effects that this rig cannot have, and that it has for certain.
    tolerance : float or mapping of str to float, optional
        Relative standard deviation of mass, stiffness, A_inf, kernel and force; its common scale is learned. What it
        does not name has the model's own, else 0.02.
    seed : int
    withhold : Record, path or pandas.DataFrame, or a sequence of them
        Records that no fit sees. Without any, the effects are searched in all of every record, and their numbers are
        fitted anew without the last third of each to see how they predict it; of a static test without every third
        load in ascending order.
    rules : Rules, optional
        Every number that decides.
    progress : callable, optional
        Told what is going on and how much is done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If records do not fit the model or one is given twice, or a name is unknown.

    Examples
    --------
    A body that has quadratic drag, and a model without it.

    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    >>> time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(0)
    >>> force = np.convolve(rng.normal(size=1200), np.hanning(20), "same")
    >>> moved = rss.simulate(model, (time, force[None]), [("quadratic_drag", "Heave", {"coefficient": 1.0})])
    >>> heave = moved.outputs[0] + 0.002 * rng.normal(size=1200)
    >>> record = rss.Record(time, {"Heave": heave, "Heave_force": force}, kind="forced")
    >>> result = rss.diagnose(model, record, effects=["quadratic_drag", "linear_stiffness"])
    >>> result.verdict.status, [effect.name for effect in result.verdict.effects]
    ('effect', ['quadratic_drag'])
    """
    if rules is not None and not isinstance(rules, Rules):
        raise InputError(f"rules: {type(rules).__name__} found; a radiation_ss.diagnosis.Rules is needed")
    rules, tell = rules or Rules(), progress or (lambda text, share: None)
    generator(seed)
    raw, withhold = ([some] if isinstance(some, Record) else list(some) for some in (records, withhold))
    if not raw:
        raise InputError("records: none is given")
    check_given_once(raw, withhold)
    apart = named_apart([*raw, *withhold])
    raw, withhold = list(apart[:len(raw)]), list(apart[len(raw):])
    for record in (*raw, *withhold):
        if record.kind == "static":
            steady_force(model, record)
    check_units(model, [*raw, *withhold])
    given, notes = cleaned(model, raw)
    if not given:
        raise not_measured(model, raw[0])
    withhold, said = cleaned(model, withhold)
    absent, present = listed(absent), listed(present)
    chosen = considered(model, None if effects is None else listed(effects), absent, present)
    tell("reading the records", 0.05)
    tolerated = tolerances(tolerance, model.tolerance)
    problem = posed(model, given, tolerated, rules)
    tell("searching for effects", 0.2)
    # The course of a slow force is not searched: what the search leaves tells it.
    drifts = [e for e in chosen if e.name == DRIFT and DRIFT not in present]
    found, hidden = searched(problem, [e for e in chosen if e not in drifts], present, rules.search, rules.visible,
                             rules.refinements)
    found = by_trajectories(found, tolerated, rules.search, rules.fit, present)
    if left_out(problem, found.candidates[0].posterior):
        notes.append(f"The records show radiation that its fit with {model.fit.states} states leaves out: a fit of "
                     "higher order closes a part of the gap.")
    tell("predicting unseen records", 0.7)
    if withhold:
        data = Data(tuple(given), tuple(withhold), tolerated, seed,
                    withheld=posed(model, withhold, tolerated, rules))
    else:
        heads, tails = split(model, given, rules.tail, rules.resolution.levels)
        notes += [f"Record {r.name} has too few places for a part that no fit sees: it is checked by what was fitted."
                  for r, rest in zip(given, tails) if r is rest]
        data = Data(tuple(given), tuple(tails), tolerated, seed, lambda: posed(model, heads, tolerated, rules))
    data, notes = replace(data, contradiction=contradiction(model, problem.runs), drifts=bool(drifts)), [*notes, *said]
    if data.contradiction > rules.false_alarm:
        notes = [*notes, f"The model's coefficients are not symmetric or not passive by {data.contradiction:.0%} of "
                 "their largest damping where the body moves (hydro.check()): no name is surer than they are."]
    result = concluded(problem, found, hidden, data, rules)
    status = result.verdict.status
    if status != "no_gap" and (instead := other_readings(model, raw, of_units=status == "effect")):
        result = replace(result, verdict=doubted(result.verdict, model.dofs), misreadings=instead)
    return result.with_notes([*notes, *clocks(result.predictions.get("corrected", ()), rules.matters,
                                              rules.unexplained)])


def cleaned(model: Model, records: Sequence[Record]) -> tuple[list[Record], list[str]]:
    """Return the free motion in the records, without what is not measured, and a sentence on all that was left out.

    InputError if no record has a stretch without gaps that is long enough.
    """
    kept, refused = list[Record](), list[InputError]()
    notes = [text for record in records for text in (
        *(f"record {record.name}, {said}" for said in suspicions(record, stated=False)), *doubts(model, record))]
    for record in records:
        clean = {"prescribed": measured_driven, "static": freely_placed}.get(record.kind, measured_freely)
        found, said = clean(model, record)
        notes += [*said, *coarse_excitation(model, record), *drifting(model, record), *unmoved(model, record)]
        try:
            parts, said_too = parted(model, found) if moves(model, found) else ([found], [])
        except InputError as no_stretch:
            parts, said_too = [], [f"{no_stretch}; it is left out."]
            refused.append(no_stretch)
        still = [part for part in parts if not moves(model, part)]
        kept += [part for part in parts if part not in still]
        notes += [*said_too, *(f"Record {part.name} holds only noise and is left out." for part in still)]
    if refused and not kept:
        raise refused[0]
    return kept, notes


def posed(model: Model, records: Sequence[Record], tolerated: dict[str, float], rules: Rules) -> EquationError:
    """Return the regression problem of some records."""
    return equation_error(model, [measured_motion(model, r, rules.resolution) for r in records], tolerated,
                          rules.discrepancy)


def contradiction(model: Model, runs: Sequence[MeasuredMotion] = ()) -> float:
    """Return by how much the model's coefficients are not symmetric or not passive, of their largest damping.

    Root mean square over the frequencies of the motions, by the power that the largest damping takes there; the largest
    one without a motion.
    """
    data = model.hydro
    if data is None:
        return 0.0
    report = data.check()
    if not any(f.problem and f.kind in ("negative damping", "asymmetry") for f in report.findings):
        return 0.0
    off = np.clip(np.maximum(-report.smallest_eigenvalue, report.asymmetry), 0.0, 1.0)
    damping, energy, met = np.einsum("wii->wi", data.B).max(axis=0), 0.0, 0.0
    for run in runs:
        power = damping @ np.abs(np.fft.rfft(run.v, axis=1)) ** 2
        there = np.interp(2.0 * np.pi * np.fft.rfftfreq(run.time.size, run.dt), data.omega, off)
        energy, met = energy + float(power.sum()), met + float(power @ there**2)
    return float(np.sqrt(met / energy) if energy > 0.0 else off.max())


def considered(model: Model, effects: Sequence[str | Effect] | None, absent: Sequence[str],
               present: Sequence[str]) -> list[Effect]:
    """Return the effects to consider."""
    if effects is None:
        joined = [e for e in optional().values() if e.scope == "between" and e.places(model.dofs)]
        chosen = [*library().values(), *joined, *([effect_named("mooring_lines")] if loose(model) else [])]
    else:
        chosen = [effect_named(e) if isinstance(e, str) else e for e in effects]
    chosen += [effect_named(name) for name in present if name not in {e.name for e in chosen}]
    names = [e.name for e in chosen]
    if len(set(names)) < len(names):
        raise InputError(f"effects: {next(n for n in names if names.count(n) > 1)!r} is there twice")
    for name in set(absent) - set(names):
        effect_named(name)
    both = sorted(set(absent) & set(present))
    if both:
        raise InputError(f"effect {both[0]}: said to be absent and present")
    asked = {e if isinstance(e, str) else e.name for e in effects or ()} & set(absent)
    if asked:
        raise InputError(f"effect {min(asked)}: among the effects to consider, and said to be absent")
    return [e for e in chosen if e.name not in absent]


def loose(model: Model) -> bool:
    """Whether nothing in the model of one body holds it in the horizontal plane, in one of several motions."""
    modes = [mode(dof) for dof in model.dofs]
    held = {m for m, c in zip(modes, np.diag(model.C)) if c != 0.0}
    return 1 < model.n == len(set(modes)) and bool({"Surge", "Sway", "Yaw"} & (set(modes) - held))


def concluded(problem: EquationError, found: Found, hidden: Sequence[Key], data: Data, rules: Rules) -> Diagnosis:
    """Return the diagnosis that follows from a search."""
    model = problem.model
    errors = Predictor(model)
    known = [r for r in data.fitted if predictable(model, r)]
    pair, closed = of_size(Fitted(numbers(problem, found.candidates[0], data.tolerated, rules), found.candidates[0],
                                  errors), problem, known, data.tolerated, rules)
    rest = remainder(problem, pair.candidate, data, rules)
    slow = [Row(e.name, e.dof, 0.0, (0.0, 0.0), e.inclusion, e.parameters) for e in rest.drifts.values()]

    def checked(pair: Fitted) -> tuple[Budget, dict[str, list[Error]]]:
        null, tested = (retried(pair, found.null, data.check(), data.tolerated, rules) if data.check
                        else (numbers(problem, found.null, data.tolerated, rules), pair))
        return account(found, null, tested, data, slow, rest.below)

    ledger, predictions = checked(pair)
    own = simulated_numbers(model, data.tolerated, force=problem.forced)
    on = grounds(found, pair, ledger, closed, own, data, rest, rules)
    answer = answered(on, found, ledger, hidden, rules)
    if (zeroed := put_right(found, pair, on.zeros, data, rules)) is not pair:
        told = checked(zeroed)
        if all_right(told[0], on.zeros, rules):
            pair, ledger, predictions = zeroed, *told
    moved = tuple(Recalibrated(o.active.name.removeprefix("nominal_"), o.active.dof, first(a), s, o.spread)
                  for o, a, s in zip(own, pair.best.nominal, np.hypot(pair.best.nominal_std,
                                                                      off_best(found, pair.candidate, len(own)))))
    corrected = Corrected({(a.name, a.dof): first(a) for a in pair.best.nominal}, pair.best.effects, data.tolerated,
                          {dof: (s.x, s.omega) for dof, s in problem.scales.items()}, numbers_of(model))
    return Diagnosis(model.name, answer, ledger, choices(problem, found, pair, data.tolerated),
                     where(problem, [e.name for e in answer.effects]),
                     far(ledger, predictions), corrected, moved, predictions, model.dofs, rules)


def off_best(found: Found, best: Candidate, count: int) -> FloatArray:
    """Return how far the numbers of the model, `count` of them, are off those of the best set in all sets, rms."""
    means = np.array([c.posterior.mean[:count] for c in found.candidates])
    return np.asarray(np.sqrt(found.probabilities() @ (means - best.posterior.mean[:count]) ** 2))


def choices(problem: EquationError, found: Found, pair: Fitted, tolerated: dict[str, float],
            most: int = 12) -> tuple[Choice, ...]:
    """Return the list of candidates, the best set with its own numbers, the others with the equation error's."""
    rows, rendered = problem.rows, []
    best = found.candidates[0].log_probability
    size = sum(float(np.sum(rows.scale[p.rows] ** 2)) / p.bins for p in problem.places if p.order < 0)
    before = float(np.sqrt(np.sum(rows.error**2) / max(size, 1e-300)))
    for candidate, p in list(zip(found.candidates, found.probabilities()))[:most]:
        own = pair.best if candidate.keys == pair.candidate.keys else from_regression(problem, candidate, tolerated)
        effects = [named_effect(problem, active, stds, 1.0) for active, stds in zip(own.effects, own.effects_std)]
        after = float(np.sqrt(np.sum(left_by(problem, candidate) ** 2) / max(size, 1e-300)))
        rendered.append(Choice(tuple(effects), float(p), candidate.log_probability - best, before, after))
    return tuple(rendered)


def far(ledger: Budget, predictions: Mapping[str, Sequence[Error]]) -> HowFar:
    """Return the gaps on unseen records."""
    if not predictions:
        return HowFar(0.0, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0), ())
    room = ledger.before**2 - ledger.noise**2
    scale = ledger.before**2 / room if room > 0.1 * ledger.noise**2 and room > 0.0 else 0.0
    # What no model predicts does not shrink the gap: a slow force and a constant of each record are explained alone.
    told = 1.0 - sum(r.share for r in ledger.rows if r.cause in ("noise", "offset", DRIFT))
    low, share, high = (float((told - left) * scale) for r in ledger.rows if r.cause == "unexplained"
                        for left in (r.interval[1], r.share, r.interval[0]))
    retuned = gap_of(predictions["recalibrated"]) / max(gap_of(predictions["given"]), 1e-300) * ledger.before
    return HowFar(ledger.before, retuned, ledger.after, ledger.noise, share, (low, high), ledger.unseen)
