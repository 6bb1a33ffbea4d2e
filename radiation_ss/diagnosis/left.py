"""What the best set leaves: a force beyond noise and tolerances, whether it is slow against the motion; zeros that are
off, put right by the first effect that makes them so; the same set solved for other records.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import kurtosis

from radiation_ss.arrays import FloatArray
from radiation_ss.diagnosis.account import Data, Fitted, numbers
from radiation_ss.diagnosis.prediction import cosines, energy, without_slow
from radiation_ss.diagnosis.result import Named
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.sets import zeros
from radiation_ss.diagnosis.shares import DRIFT, Budget
from radiation_ss.effects import effect_named
from radiation_ss.effects.slabs import slab
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.inference.candidates import Candidate, FittedSet, with_numbers
from radiation_ss.inference.force_errors import recorded_noise, typical_frequency
from radiation_ss.inference.linear_model import variance
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import Place, force_noise, projected
from radiation_ss.inference.search import Found, solve_set, start_sizes
from radiation_ss.records.record import Record
from radiation_ss.simulation.headings import computed


@dataclass(frozen=True, eq=False)
class Left:
    """Which motions, shape (n,), the force that is left would move by what matters, and what its slow part is."""

    # whole, beside (n,): With and without the part that is slow
    whole: np.ndarray
    beside: np.ndarray
    # (n,): Whether in any record what is not slow has so large a share of the energy that it may not be left beside a
    # name
    fast: np.ndarray
    square: FloatArray  # (n,): Sum of the slow force's mean squares over the records
    count: FloatArray  # (n,): Of its unknowns
    records: FloatArray  # (n,)
    # (1 + draws, n): How much the slow force comes in events: as it is, and with the signs of its cosines drawn
    events: FloatArray


def slow_below(problem: EquationError, run: MeasuredMotion, i: int) -> float:
    """Return the frequency below which a force is slow against a motion: that of `slow_drift`, of this record's own.

    It is slow against the free motion, too: at a resonance the model's own errors look like forces. A motion that is
    mostly drift has the frequency of the force that is known.
    """
    known = problem.scales[problem.model.dofs[i]]
    scales = replace(known, omega=min(typical_frequency(problem.model, run, i), known.natural or np.inf))
    return slab(effect_named(DRIFT), "frequency", scales).upper


def left(problem: EquationError, candidate: Candidate, data: Data, rules: Rules) -> Left:
    """Return what is left of the force in some records, beside noise and tolerances.

    `data` has the relative standard deviation of a force that the model makes of the elevation, at each frequency.
    """
    tolerance, rng = data.tolerated["force"], np.random.default_rng(data.seed)
    rows, residual = problem.rows, left_by(problem, candidate, known=True)
    # No less than far above the motion: what is less in its band went to the force.
    noise = np.maximum(rows.noise, variance(rows, candidate.posterior.sizes)[0])
    n = problem.model.n
    sums, slow, fast, events = np.zeros((4, n)), np.zeros((3, n)), np.zeros(n, dtype=bool), np.zeros((1, n))
    for p in [p for p in problem.places if p.order < 0 and problem.runs[p.record].record.kind != "static"]:
        run, i = problem.runs[p.record], p.dof
        if not np.any(run.x[i]):  # held fast: no force is a motion
            continue
        # The sensors' noise is white in the motion: in a row of the force it tells the impedance there.
        through = np.tile(run.noise[i, : p.bins] ** 2 / force_noise(problem.model, run, p), len(run.basis))
        omega = np.concatenate([block.omega[: p.bins] for block in run.basis])
        own = noise[p.rows] + recorded_noise(problem.model, run, i, omega) ** 2
        if run.force is not None and computed(problem.model, run.record):
            own = own + (tolerance * projected(problem.model, run, p, run.force)) ** 2
        rest, course, part = beside_slow(problem, p, residual[p.rows], through)
        count = part.size
        # Of the noise, too, each unknown of the slow force takes what a row has.
        mine = np.array([np.sum((residual[p.rows] ** 2 - own) * through),
                         np.sum((rest**2 - own) * through) + count * np.mean(own * through),
                         2.0 * np.sum((own * through) ** 2), np.sum(run.x[i] ** 2)])
        sums[:, i] += mine
        slow[:, i] += float(np.var(course @ part)), count, 1.0
        events = events + np.outer(count * peaked(course, part, rng), np.arange(n) == i)
        fast[i] |= bool(matters(mine, rules)[0]) and mine[1] > rules.unexplained * mine[0]
    whole, beside = matters(sums, rules)
    return Left(whole, whole & beside, fast, slow[0], slow[1], slow[2], events)


def peaked(course: FloatArray, part: FloatArray, rng: np.random.Generator, draws: int = 1000) -> FloatArray:
    """Return the kurtosis of a slow force, and of others of the same power at each frequency, shape (1 + draws,).

    The cosines (nt, k) of one that is the same throughout a record have independent signs; those of an event agree.
    """
    thin = course[::max(1, course.shape[0] // (8 * part.size))]
    signs = np.vstack([np.ones(part.size), rng.choice([-1.0, 1.0], (draws, part.size))])
    if not np.any(part[1:]):  # the first is the constant, which has no course
        return np.zeros(1 + draws)
    return np.asarray(np.nan_to_num(kurtosis(thin[:, 1:] @ (signs * part)[:, 1:].T, axis=0)))


def matters(sums: FloatArray, rules: Rules) -> np.ndarray:
    """Return whether the energy that is left, with and without its slow part, is more than chance and not too small.

    `sums` are both energies, the variance by chance and the motion's energy, shape (4, ...); shape (2, ...).
    """
    return np.asarray(sums[:2] > np.maximum(rules.matters**2 * sums[3], rules.confirmed * np.sqrt(sums[2])))


def beside_slow(problem: EquationError, place: Place, residual: FloatArray,
                weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rows of one place without what a slow force makes; its cosines (nt, k), and how much of each it has."""
    run = problem.runs[place.record]
    slow = cosines(run.time, slow_below(problem, run, place.dof))
    columns = projected_on(run.basis, slow.T, 0, place.bins).reshape(slow.shape[1], -1).T
    root = np.sqrt(weights)
    found = np.linalg.lstsq(root[:, None] * columns, root * residual, rcond=None)[0]
    return residual - columns @ found, slow, np.asarray(found, dtype=np.float64)


def left_by(problem: EquationError, candidate: Candidate, known: bool = False) -> FloatArray:
    """Return the equation error that a set leaves; `known`: beside what is known of."""
    return problem.residual([term.columns for term in candidate.terms], candidate.posterior, known)


def carried(candidate: Candidate, problem: EquationError, rules: Rules) -> Candidate:
    """Return the same set of effects solved for other records."""
    terms = (with_numbers(problem, term, {}) for term in candidate.terms)
    found = solve_set(problem, [t for t in terms if t is not None], start_sizes(problem), rules.search)
    return replace(found, point=candidate.point)


def retried(pair: Fitted, null: Candidate, problem: EquationError, tolerated: dict[str, float],
            rules: Rules) -> tuple[FittedSet, Fitted]:
    """Return the numbers of the set without effects and of the best one by other records."""
    again = carried(pair.candidate, problem, rules)
    return (numbers(problem, carried(null, problem, rules), tolerated, rules),
            Fitted(numbers(problem, again, tolerated, rules), again, pair.errors))


@dataclass(frozen=True, eq=False)
class Remainder:
    """What no effect of the search explains."""

    missed: bool  # Whether there is a force that matters, in any records, beside those that are slow
    drifts: Mapping[int, Named]  # The slow force on each motion whose unexplained force is slow in all records
    # By record and motion: the frequency below which it is [rad/s]
    below: Mapping[tuple[str, int], float]


def remainder(problem: EquationError, candidate: Candidate, data: Data, rules: Rules) -> Remainder:
    """Return what is left in the records of the fit and, the set's numbers fitted to them, in those withheld."""
    found = [left(problem, candidate, data, rules)]
    if data.withheld is not None:
        found.append(left(data.withheld, carried(candidate, data.withheld, rules), data, rules))
    whole, beside = (np.array([getattr(part, f) for part in found]) for f in ("whole", "beside"))
    fast = np.array([part.fast for part in found])
    events = np.asarray(sum(part.events for part in found))
    steady = np.mean(events >= events[0], axis=0) > rules.false_alarm  # else it comes and goes: a ship, a shifted load
    slow = whole.all(axis=0) & ~fast.any(axis=0) & steady & data.drifts
    square, count, records = (sum(getattr(part, f) for part in found) for f in ("square", "count", "records"))
    drifts = {}
    for i in map(int, np.flatnonzero(slow)):
        rms, dof = float(np.sqrt(square[i] / records[i])), problem.model.dofs[i]
        # The spread is that of a Gaussian force with so many unknowns.
        drifts[i] = Named(DRIFT, dof, {"rms": (rms, rms / float(np.sqrt(2.0 * count[i])))},
                          {"rms": unit_of("F", dof, dof)}, rules.slow)
    problems = [problem, *([data.withheld] if data.withheld is not None else [])]
    below = {(run.record.name, i): slow_below(p, run, i) for p in problems for run in p.runs for i in drifts}
    return Remainder(bool(np.where(slow, beside, whole).any()), drifts, below)


def share_left(pair: Fitted, ledger: Budget, fitted: Sequence[Record],
               slow: Mapping[tuple[str, int], float]) -> float:
    """Return the share of the gap's energy that is left unexplained, in the records of the fit and unseen together.

    `slow` are the frequencies below which the errors of some records' motions are explained.
    """
    rest = ledger.before**2 * ledger.unexplained
    given = pair.errors((), fitted) if fitted else None
    best = pair.errors(pair.best.actives, fitted) if fitted else None
    if given is None or best is None:
        return ledger.unexplained
    kept = energy(without_slow(best, slow)).sum()
    return float((rest + kept) / max(ledger.before**2 + energy(given).sum(), 1e-300))


def least_beside(closed: FloatArray, rules: Rules) -> float:
    """Return how much of the motion a zero that is off, or a slow force, accounts for at least to be told."""
    return max(rules.matters, float(np.sqrt(rules.matters) * np.linalg.norm(closed)))


def off_zero(found: Found, pair: Fitted, closed: FloatArray, ledger: Budget, rules: Rules) -> list[str]:
    """Return the degrees of freedom where a zero is off by what matters, or in some record by more than is allowed."""
    least, names = least_beside(closed, rules), zeros()
    sized = {active.dof for active, size in zip(pair.best.effects, closed) if active.name in names and size >= least}
    chance = {dof: sum(p for c, p in zip(found.candidates, found.probabilities())
                       if any(a in names and at == dof for a, at, _ in c.keys)) for dof in sized}
    return [dof for dof in found.problem.model.dofs
            if chance.get(dof, 0.0) >= rules.sure or ledger.constant.get(dof, 0.0) >= rules.discrepancy.offset]


def put_right(found: Found, pair: Fitted, off: Sequence[str], data: Data, rules: Rules) -> Fitted:
    """Return the best set with the first effect by which each zero may be off, one for all records, beside it."""
    names, known = zeros(), {(t.key[0], t.key[1]): t for t in found.terms}
    there = {dof for name, dof, _ in pair.candidate.keys if name in names}
    terms = [known[names[0], dof] for dof in off if dof not in there and (names[0], dof) in known]
    if not terms:
        return pair
    sizes = pair.candidate.posterior.sizes
    candidate = solve_set(found.problem, [*pair.candidate.terms, *terms], sizes, rules.search)
    return Fitted(numbers(found.problem, candidate, data.tolerated, rules), candidate, pair.errors)


def all_right(ledger: Budget, off: Sequence[str], rules: Rules) -> bool:
    """Whether no zero is off any more on unseen records."""
    return all(ledger.constant.get(dof, 0.0) < rules.discrepancy.offset for dof in off)


def unit_of(form: str, dof: str, other: str) -> str:
    """Return a parameter's unit in SI for a degree of freedom; none of a share ("1")."""
    text = form.replace("F", force_unit(dof)).replace("X", motion_unit(dof)).replace("Y", motion_unit(other))
    return "" if form == "1" else text
