"""Effects as columns of the equation error, sets of them, and the numbers of a set."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Active, Effect, Scales, Slab
from radiation_ss.effects.nominal import nominal_effects
from radiation_ss.effects.slabs import slab
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode
from radiation_ss.inference.effect_features import Feature, features_of, ringing
from radiation_ss.inference.linear_model import Columns, Posterior, joined
from radiation_ss.inference.problem import EquationError, Filling
from radiation_ss.inference.stored import ByRecord, Shelf

Key = tuple[str, str, str]  # name and places of an effect
Kind = tuple[Key, tuple[float, ...]]  # with the numbers that are chosen, not fitted
Keys = frozenset[Key]


@dataclass(frozen=True, eq=False)
class Term:
    """An effect on a place with one start of its shape."""

    active: Active  # With strengths 0; a clock's are those about which it is linear
    # One for each strength; one for each strength and record where every record has its own; behind them what own
    # states make that are not at rest at a record's start
    columns: Columns
    shapes: int = 1  # Number of starts, as rare as its own, that it was chosen from
    start: Active | None = None  # The one that a refined shape comes from: the middle of its prior
    volume: float = 0.0  # Log prior mass of a refined shape, of that about its start
    width: float = 1.0  # What multiplies the prior standard deviations of its strengths

    def widened(self, width: float) -> "Term":
        """Return the term with its strengths' priors of another width."""
        spread = width / self.width * self.columns.spread
        return self if width == self.width else replace(self, columns=replace(self.columns, spread=spread), width=width)

    @property
    def key(self) -> Key:
        """Name and places."""
        return self.active.key

    @property
    def strengths(self) -> list[str]:
        """Names of the strengths."""
        return [name for name, p in self.active.effect.parameters.items() if p.strength]

    @property
    def shaped(self) -> bool:
        """Whether numbers of its shape are fitted, from one of several starts."""
        return self.shapes > 1 and not self.chosen

    @property
    def chosen(self) -> bool:
        """Whether no number of its shape is fitted."""
        return all(p.strength or p.fixed for p in self.active.effect.parameters.values())

    @property
    def kind(self) -> Kind:
        """Name, places and what is chosen of the shape."""
        parameters = self.active.effect.parameters.items()
        return self.key, tuple(self.active.values.get(name, 0.0) for name, p in parameters if p.fixed)

    @property
    def simulated(self) -> bool:
        """Whether simulations show it: they are of the first sensors, and have no numbers of each record's own."""
        return self.active.of_first_sensor and not self.active.effect.per_record

    @property
    def clock(self) -> bool:
        """Whether it shifts time by one number for all records."""
        effect = self.active.effect
        return not effect.per_record and (effect.clock_in is not None or effect.clock_out is not None)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of effects, solved."""

    terms: tuple[Term, ...]
    posterior: Posterior  # Of the base columns, then of the terms' columns; without what has the length of all rows
    log_probability: float  # Log evidence and log prior, without a common constant
    # Whether the sizes are this set's own; at those of another set the probability is a lower bound
    learned: bool = True
    # Nominal numbers and effects' parameters of the trajectories that fit best, where these have been weighed
    point: FloatArray | None = None

    @property
    def keys(self) -> Keys:
        """The effects."""
        return frozenset(term.key for term in self.terms)


@dataclass(frozen=True, eq=False)
class FittedSet:
    """A set of effects with its numbers."""

    nominal: tuple[Active, ...]  # The model's own numbers, recalibrated
    effects: tuple[Active, ...]
    nominal_std: tuple[float, ...]
    effects_std: tuple[tuple[float, ...], ...]  # Standard deviation of each parameter; 0 for one that is not fitted

    @property
    def actives(self) -> tuple[Active, ...]:
        """Everything to be simulated."""
        return (*self.nominal, *self.effects)


def terms_of(problem: EquationError, effects: Sequence[Effect], held: int = 5_000_000) -> list[Term]:
    """Return every effect on every place and from every start of its shape that these records can show.

    Beyond `held` numbers their columns are kept in a temporary file.
    """
    found, shelf = [], Shelf(held)
    driven = any(run.record.kind == "prescribed" for run in problem.runs)  # the force is measured
    seen = {"": True, "force": problem.forced or driven,
            "speed": len({abs(run.record.speed) for run in problem.runs}) > 1,
            "waves": any("wave_elevation" in run.record.channels for run in problem.runs)}
    still = all(run.record.kind == "static" for run in problem.runs)
    for effect in effects:
        if still and effect.input is not None and effect.linear:  # where no waves act, the force is the loads alone
            effect = replace(effect, needs="")
        if not seen[effect.needs] or (still and not effect.settled):
            continue
        for dof, other in effect.places(problem.model.dofs):
            found += [replace(term, columns=replace(term.columns, values=shelf.put(term.columns.values)))
                      for term in terms_at(problem, effect, dof, other)]
    return found


def terms_at(problem: EquationError, effect: Effect, dof: str, other: str) -> Iterator[Term]:
    """Yield one term for each combination of starts of the shape."""
    sizes = scales_at(problem, dof, other)
    moving = [d for d in (dof, other) if d]
    if not all(any(run.free[problem.model.dofs.index(d)] for run in problem.runs) for d in moving):
        return
    slabs = slabs_of(problem, effect, dof, other)
    if slabs is None:
        return
    grids = [[0.0] if p.starts is None else list(p.starts(sizes)) for p in effect.parameters.values()]
    shapes = [Active(effect, dof, dict(zip(effect.parameters, map(float, s))), other) for s in product(*grids)]
    if not any(place.order >= 0 and place.dof in map(problem.model.dofs.index, moving) for place in problem.places):
        shapes = [shape for shape in shapes if shape.values.get("all_sensors", 0.0) == 0.0]  # there is one sensor
    for active in (shape.bound(problem.model) for shape in shapes):
        columns = term_columns(problem, active, slabs)
        if columns is not None:
            yield Term(active, columns, sum(shape.rare == active.rare for shape in shapes))


def scales_at(problem: EquationError, dof: str, other: str) -> Scales:
    """Return the sizes of a degree of freedom and of the one that an effect couples it with, or of the whole body."""
    sizes = problem.scales[dof or problem.model.dofs[0]]
    if not dof:
        sizes = replace(sizes, modes={mode(d): problem.scales[d] for d in problem.model.dofs})
    return replace(sizes, other=problem.scales[other]) if other else sizes


def slabs_of(problem: EquationError, effect: Effect, dof: str, other: str) -> dict[str, Slab] | None:
    """Return the priors of an effect's parameters; None where it makes no force in these records."""
    sizes = scales_at(problem, dof, other)
    if effect.needs == "waves" and sizes.elevation == 0.0:  # the waves meet other motions only
        return None
    try:
        return {name: slab(effect, name, sizes) for name, p in effect.parameters.items() if not p.fixed}
    except InputError:
        return None


def term_columns(problem: EquationError, active: Active, slabs: dict[str, Slab]) -> Columns | None:
    """Return the columns of a term; None if these records do not show it. Records are taken one after the other."""
    effect = active.effect
    strengths = [name for name, p in effect.parameters.items() if p.strength]
    linear = effect.linear or effect.family == "offset"
    made = [Filling(problem, linear) for _ in strengths]
    for r, found in enumerate(features_of(problem.symbols(active), active, problem.runs)):
        for filling, feature in zip(made, found):
            if not (np.isfinite(feature.force).all() and np.isfinite(feature.reading).all()):
                return None
            filling.add(r, feature)
    parts = [filling.columns(slabs[name].sd or 1.0, lower=slabs[name].lower) for filling, name in zip(made, strengths)]
    if not all(np.isfinite(part.values).all() for part in parts):
        return None
    merged = joined([by_records(problem, part) if effect.per_record else part for part in parts])
    merged = merged if effect.per_record else replace(merged, values=np.asarray(merged.values))
    if not np.sqrt(seen_in(problem, merged)).max(initial=0.0) > 0.1:
        return None
    rings = off_rest(problem, active, slabs)
    return joined([merged, *rings]) if rings else merged


def off_rest(problem: EquationError, active: Active, slabs: dict[str, Slab]) -> list[Columns]:
    """Return what the own states of a linear effect make that nobody knows at a record's start, for each record."""
    effect, symbols = active.effect, problem.symbols(active)
    strengths = [name for name, p in effect.parameters.items() if p.strength]
    if effect.unrest is None or not effect.linear or len(strengths) != 1:
        return []
    sizes = effect.unrest(scales_at(problem, active.dof, active.other))
    made = [Filling(problem, linear=True) for _ in sizes]
    for r, run in enumerate(problem.runs):
        for filling, force in zip(made, ringing(symbols, active, run, np.array(sizes) * run.under_way())):
            none = np.zeros((run.omega_fine.size, *[problem.model.n] * 2), dtype=complex)
            filling.add(r, Feature(force, 0.0 * force, none, none, 0.0 * force))
    return [by_records(problem, filling.columns(slabs[strengths[0]].sd or 1.0)) for filling in made]


def with_numbers(problem: EquationError, term: Term, numbers: Mapping[str, float]) -> Term | None:
    """Return a term with other numbers of its shape or clock, in these records; None if they do not show it."""
    active = replace(term.active, values={**term.active.values, **numbers})
    slabs = slabs_of(problem, active.effect, active.dof, active.other)
    columns = term_columns(problem, active, slabs) if slabs else None
    return None if columns is None else replace(term, active=active, columns=columns, width=1.0).widened(term.width)


def seen_in(problem: EquationError, columns: Columns) -> FloatArray:
    """Return each column's sum of squares over the sensors' noise, for one prior standard deviation."""
    scale, total = np.sqrt(problem.rows.noise + 1e-300)[:, None], np.zeros(columns.count)
    for part in problem.rows.parts:
        total += np.sum(np.clip(columns.values[part] * columns.spread / scale[part], -1e9, 1e9) ** 2, axis=0)
    return total


def unseen_strengths(problem: EquationError, term: Term) -> set[str]:
    """Return the strengths that make nothing in any row: of a motion that only ever is at rest beside the others."""
    if term.active.effect.per_record:
        return set()
    return {name for name, seen in zip(term.strengths, seen_in(problem, term.columns)) if not seen > 0.0}


def twins(terms: Sequence[Term], alike: float = 1e-3, chunk: int = 50_000) -> frozenset[frozenset[Kind]]:
    """Return pairs of linear effects whose columns are the same, as a sensor's gain and that of the force may be.

    They are told as two sets: both in one are only a wider prior of either.
    """
    linear = [(t, seen_columns(t)) for t in terms if t.active.effect.linear and t.chosen]
    single = [(t, seen) for t, seen in linear if seen.size == 1]
    rows, gram = single[0][0].columns.values.shape[0] if single else 0, np.zeros((len(single), len(single)))
    for first in range(0, rows, chunk):
        part = np.concatenate([t.columns.values[first:first + chunk][:, seen] for t, seen in single], axis=1)
        gram += part.T @ part
    size = np.sqrt(np.diag(gram))
    same = np.argwhere(np.triu(np.abs(gram) > (1.0 - alike) * np.outer(size, size), 1))
    return frozenset(frozenset((single[i][0].kind, single[j][0].kind)) for i, j in same
                     if single[i][0].key != single[j][0].key)


def seen_columns(term: Term) -> NDArray[np.int64]:
    """Return which columns of a term are not zero everywhere."""
    count = term.columns.count
    if count == 1 or term.active.effect.per_record:
        return np.arange(count)
    return np.flatnonzero(np.any(np.asarray(term.columns.values), axis=0))


def by_records(problem: EquationError, column: Columns) -> Columns:
    """Return one column for each record."""
    terms = np.repeat(np.arange(len(problem.runs)), [run.omega_fine.size * problem.model.n for run in problem.runs])
    record, values = np.zeros(problem.rows.error.size, dtype=int), np.asarray(column.values)[:, 0]
    for place in problem.places:
        record[place.rows] = place.record
    there = np.unique(record[values != 0.0])
    spread, lower, factor = (np.repeat(part, there.size) for part in (column.spread, column.lower, column.factor))
    at = np.where(np.isin(record, there), np.searchsorted(there, record), -1)
    return Columns(ByRecord(values, at, there.size), spread, lower, factor,
                   csc_array((terms[:, None] == there) * column.relative.toarray()))


def placed(problem: EquationError, terms: Sequence[Term]) -> Iterator[tuple[Term, slice]]:
    """Yield the terms of a set with where their unknowns stand, after those of the base columns."""
    at = problem.base.count
    for term in terms:
        yield term, slice(at, at + term.columns.count)
        at += term.columns.count


def carried_over(problem: EquationError, near: Candidate, terms: Sequence[Term], columns: Columns) -> Posterior:
    """Return the unknowns of a set as another one has them; a term that this has not is at its prior."""
    places = {id(term.active): range(at.start, at.stop) for term, at in placed(problem, near.terms)}
    wanted = [*range(problem.base.count)]
    for term in terms:
        wanted += places.get(id(term.active), [-1] * term.columns.count)
    at = np.array(wanted)
    known = np.flatnonzero(at >= 0)
    mean, covariance = np.zeros(at.size), np.diag(columns.spread**2)
    mean[known] = near.posterior.mean[at[known]]
    covariance[np.ix_(known, known)] = near.posterior.covariance[np.ix_(at[known], at[known])]
    return replace(near.posterior, mean=mean, covariance=covariance)


def from_regression(problem: EquationError, candidate: Candidate, tolerance: dict[str, float]) -> FittedSet:
    """Return the numbers of the equation error."""
    own = nominal_effects(problem.model, tolerance, force=problem.forced)
    mean, std = candidate.posterior.mean, np.sqrt(np.diag(candidate.posterior.covariance))
    nominal = tuple(o.active.with_values([mean[k]]) for k, o in enumerate(own))
    at, effects, spread = problem.base.count, [], []
    for term in candidate.terms:
        names = term.strengths
        width = term.columns.count // max(len(names), 1) if term.active.effect.per_record else 1
        values, deviations = dict(term.active.values), dict.fromkeys(term.active.effect.parameters, 0.0)
        acts, first = iter(seen_in(problem, term.columns)[::width] > 0.0), at
        for name in names:
            values[name] = float(max(mean[at], term.columns.lower[at - first]))
            deviations[name] = float(std[at]) if next(acts) else 0.0
            at += width
        at = first + term.columns.count
        effects.append(replace(term.active, values=values))
        spread.append(tuple(deviations.values()))
    return FittedSet(nominal, tuple(effects), tuple(std[: len(own)].tolist()), tuple(spread))
