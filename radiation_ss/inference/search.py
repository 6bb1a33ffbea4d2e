"""Which effects: spike and slab over any number of them, by best-first search (George & McCulloch 1993).

Five steps: (1) columns of every effect, place and start of its shape; (2) the set without effects; (3) a score test
ranks what may be added to the best sets; (4) the first few are solved with all sizes learned anew, and sets with one
effect less; (5) until no set improves. Inclusion probabilities are sums over all sets that were solved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Active, Effect, Scales, Slab, slab
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode
from radiation_ss.inference.equation_error import EquationError, columns_of, nothing
from radiation_ss.inference.features import Symbols, features
from radiation_ss.inference.regression import Columns, Posterior, Rows, SizePrior, Sizes, gains, learn, solve


@dataclass(frozen=True)
class SearchRules:
    """What steers the search.

    Parameters
    ----------
    inclusion : float
        Prior probability that an effect acts on one place.
    rare : float
        The same of an effect that is met less often (`Effect.rare`).
    most : int
        Effects at once.
    beam : int
        Sets that are extended in each round.
    width : int
        Extensions of a set that are solved.
    sizes : SizePrior
        Of the learned sizes.
    least : float
        Log Bayes factor by the score test below which they are not.
    """

    inclusion: float = 0.1
    rare: float = 0.02
    most: int = 6
    beam: int = 3
    width: int = 6
    sizes: SizePrior = field(default_factory=SizePrior)
    least: float = -3.0


@dataclass(frozen=True, eq=False)
class Term:
    """An effect on a place with one start of its shape.

    Parameters
    ----------
    active : Active
        With strengths 0.
    columns : Columns
        One for each strength; one for each strength and record where every record has its own.
    shapes : int
        Number of starts that it was chosen from.
    """

    active: Active
    columns: Columns
    shapes: int = 1

    @property
    def key(self) -> tuple[str, str, str]:
        """Name and places."""
        return self.active.name, self.active.dof, self.active.other


Keys = frozenset[tuple[str, str, str]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of effects, solved.

    Parameters
    ----------
    terms : tuple of Term
    posterior : Posterior
        Of the base columns, then of the terms' columns.
    log_probability : float
        Log evidence and log prior, without a common constant.
    """

    terms: tuple[Term, ...]
    posterior: Posterior
    log_probability: float

    @property
    def keys(self) -> Keys:
        """The effects."""
        return frozenset(term.key for term in self.terms)


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search.

    Parameters
    ----------
    problem : EquationError
    candidates : tuple of Candidate
        Best first.
    inclusion : mapping of (name, dof, other) to float
        Probability of each effect.
    terms : tuple of Term
        All that were considered.
    """

    problem: EquationError
    candidates: tuple[Candidate, ...]
    inclusion: dict[tuple[str, str, str], float] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()

    @property
    def null(self) -> Candidate:
        """The candidate without effects beyond those that are said to be present."""
        return min(self.candidates, key=lambda c: len(c.terms))

    def probabilities(self) -> FloatArray:
        """Return the probability of each candidate."""
        values = np.array([c.log_probability for c in self.candidates])
        weights = np.exp(values - values.max())
        return np.asarray(weights / weights.sum())


def terms_of(problem: EquationError, effects: Sequence[Effect]) -> list[Term]:
    """Return every effect on every place and from every start of its shape that these records can show."""
    found = []
    seen = {"": True, "force": problem.forced, "speed": len({abs(run.record.speed) for run in problem.runs}) > 1,
            "waves": any("wave_elevation" in run.record.channels for run in problem.runs)}
    still = all(run.record.kind == "static" for run in problem.runs)
    for effect in effects:
        if not seen[effect.needs] or (still and not effect.settled):
            continue
        for dof, other in effect.places(problem.model.dofs):
            found += terms_at(problem, effect, dof, other)
    return found


def terms_at(problem: EquationError, effect: Effect, dof: str, other: str) -> list[Term]:
    """Return one term for each combination of starts of the shape."""
    sizes = scales_at(problem, dof, other)
    moving = [d for d in (dof, other) if d]
    if not all(any(run.free[problem.model.dofs.index(d)] for run in problem.runs) for d in moving):
        return []
    slabs = slabs_of(problem, effect, dof, other)
    if slabs is None:
        return []
    grids = [[0.0] if p.starts is None else list(p.starts(sizes)) for p in effect.parameters.values()]
    shapes = list(product(*grids))
    found = []
    symbols = Symbols(problem.model, Active(effect, dof, {}, other))
    for shape in shapes:
        active = Active(effect, dof, dict(zip(effect.parameters, map(float, shape))), other)
        columns = term_columns(problem, active, slabs, symbols)
        if columns is not None:
            found.append(Term(active, columns, len(shapes)))
    return found


def scales_at(problem: EquationError, dof: str, other: str) -> Scales:
    """Return the sizes of a degree of freedom and of the one that an effect couples it with, or of the whole body."""
    sizes = problem.scales[dof or problem.model.dofs[0]]
    if not dof:
        sizes = replace(sizes, modes={mode(d): problem.scales[d] for d in problem.model.dofs})
    return replace(sizes, other=problem.scales[other]) if other else sizes


def slabs_of(problem: EquationError, effect: Effect, dof: str, other: str) -> dict[str, Slab] | None:
    """Return the priors of an effect's parameters; None where it makes no force in these records."""
    sizes = scales_at(problem, dof, other)
    try:
        return {name: slab(effect, name, sizes) for name, p in effect.parameters.items() if not p.fixed}
    except InputError:
        return None


def term_columns(problem: EquationError, active: Active, slabs: dict[str, Slab],
                 symbols: Symbols | None = None) -> Columns | None:
    """Return the columns of a term; None if these records do not show it."""
    merged = nothing(problem.rows.error.size, problem.rows.weight.size)
    strengths = [name for name, p in active.effect.parameters.items() if p.strength]
    for name, by_record in zip(strengths, features(problem.model, active, problem.runs, symbols)):
        prior = slabs[name]
        column = columns_of(problem, by_record, prior.sd or 1.0, positive=active.effect.parameters[name].sign > 0)
        if not np.isfinite(column.values).all():
            return None
        merged = merged + (by_records(problem, column) if active.effect.per_record else column)
    seen = merged.values * merged.spread / np.sqrt(problem.rows.noise + 1e-300)[:, None]
    return merged if np.sqrt(np.sum(seen**2, axis=0)).max(initial=0.0) > 0.1 else None


def by_records(problem: EquationError, column: Columns) -> Columns:
    """Return one column for each record."""
    merged = nothing(problem.rows.error.size, problem.rows.weight.size)
    terms = np.concatenate([np.full(run.omega_fine.size * problem.model.n, r)
                            for r, run in enumerate(problem.runs)])
    for r in range(len(problem.runs)):
        values, relative = np.zeros_like(column.values), np.where((terms == r)[:, None], column.relative, 0.0)
        for place in problem.places:
            if place.record == r:
                values[place.rows] = column.values[place.rows]
        if np.any(values):
            merged = merged + Columns(values, column.spread, column.positive, column.learned, relative)
    return merged


def search(problem: EquationError, terms: Sequence[Term], rules: SearchRules | None = None,
           present: Sequence[str] = (), known: Sequence[Candidate] = ()) -> Found:
    """Return sets of effects with their probabilities.

    Parameters
    ----------
    problem : EquationError
    terms : sequence of Term
    rules : SearchRules, optional
    present : sequence of str
        Names of effects that are in every set.
    known : sequence of Candidate
        Sets that are solved already.
    """
    rules = rules or SearchRules()
    rows, base = problem.rows, problem.base
    start = start_sizes(problem)
    fixed = chosen_present(rows, base, terms, present, start)
    solved: dict[Keys, Candidate] = {}
    solved |= {c.keys: c for c in sorted(known, key=lambda c: c.log_probability)}
    if not known:
        first = solve_set(problem, fixed, start, rules, present)
        solved[first.keys] = first
    extended: set[Keys] = set()
    while True:
        ranked = sorted(solved.values(), key=lambda c: -c.log_probability)
        parents = [c for c in ranked[: rules.beam] if c.keys not in extended]
        if not parents:
            break
        for parent in parents:
            extended.add(parent.keys)
            for terms_now in proposals(problem, parent, terms, rules, fixed):
                keys = frozenset(t.key for t in terms_now)
                if keys not in solved:
                    solved[keys] = solve_set(problem, terms_now, replace(parent.posterior.sizes, tolerance=0.0), rules,
                                             present)
    ranked = sorted(solved.values(), key=lambda c: -c.log_probability)
    found = Found(problem, tuple(ranked), {}, tuple(terms))
    chance = found.probabilities()
    inclusion: dict[tuple[str, str, str], float] = {}
    for candidate, p in zip(ranked, chance):
        for key in candidate.keys:
            inclusion[key] = inclusion.get(key, 0.0) + float(p)
    return Found(problem, tuple(ranked), inclusion, tuple(terms))


def proposals(problem: EquationError, parent: Candidate, terms: Sequence[Term], rules: SearchRules,
              fixed: Sequence[Term]) -> list[tuple[Term, ...]]:
    """Return the sets next to a candidate: one effect more, the most promising first, or one less."""
    columns = problem.base
    for term in parent.terms:
        columns = columns + term.columns
    kept = {t.key for t in fixed}
    less = [tuple(t for t in parent.terms if t.key != out.key) for out in parent.terms if out.key not in kept]
    if len(parent.terms) >= rules.most:
        return less
    free = [t for t in terms if t.key not in parent.keys]
    # At the stated tolerances: wide ones already hold what an effect like a nominal number would explain.
    stated = solve(problem.rows, columns, replace(parent.posterior.sizes, tolerance=0.0))
    values = gains(problem.rows, columns, stated, [t.columns for t in free])
    best: dict[tuple[str, str, str], tuple[float, Term]] = {}
    for value, term in zip(values, free):
        if np.isfinite(value) and (term.key not in best or value > best[term.key][0]):
            best[term.key] = (float(value), term)
    order = sorted(best.values(), key=lambda pair: -pair[0] - log_prior(pair[1], rules))[: rules.width]
    return less + [(*parent.terms, term) for value, term in order if value > rules.least]


def start_sizes(problem: EquationError) -> Sizes:
    """Return the prior medians of all sizes."""
    rows = problem.rows
    return Sizes(np.log(rows.share), np.log(rows.ambient), np.zeros(rows.sensor.max() + 1), 0.0)


def solve_set(problem: EquationError, terms: Sequence[Term], sizes: Sizes, rules: SearchRules | None = None,
              present: Sequence[str] = ()) -> Candidate:
    """Return a set of effects with all sizes learned."""
    rules = rules or SearchRules()
    columns = problem.base
    for term in terms:
        columns = columns + term.columns
    posterior = learn(problem.rows, columns, sizes, rules.sizes)
    prior = sum(log_prior(term, rules, present) for term in terms)
    return Candidate(tuple(terms), posterior, float(posterior.log_evidence + prior))


def log_prior(term: Term, rules: SearchRules, present: Sequence[str] = ()) -> float:
    """Return the log odds that an effect acts, one of the starts of its shape chosen."""
    chance = rules.rare if term.active.effect.rare else rules.inclusion
    odds = 0.0 if term.active.name in present else np.log(chance / (1.0 - chance))
    return float(odds - np.log(term.shapes))


def chosen_present(rows: Rows, base: Columns, terms: Sequence[Term], present: Sequence[str],
                   start: Sizes) -> tuple[Term, ...]:
    """Return, of each effect that is said to be present, the most promising place and shape."""
    if not present:
        return ()
    null = learn(rows, base, start)
    chosen = []
    for name in present:
        mine = [t for t in terms if t.active.name == name]
        if not mine:
            raise InputError(f"present: effect {name!r} cannot be seen in these records, or is not considered")
        chosen.append(mine[int(np.argmax(gains(rows, base, null, [t.columns for t in mine])))])
    return tuple(chosen)
