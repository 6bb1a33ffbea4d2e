"""Records whose motion is given beside those that are simulated: the rows of their equation, by the same numbers."""

from collections.abc import Sequence
from copy import copy

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Active
from radiation_ss.inference.candidates import Candidate, Key, Term, placed
from radiation_ss.inference.effect_features import features_of
from radiation_ss.inference.linear_model import Columns, variance
from radiation_ss.inference.own import TOLERANCE
from radiation_ss.inference.problem import EquationError, Filling


class GivenMotion:
    """Weighted errors of one record's measured force by nominal numbers, effects' parameters and its own unknowns.

    The motion is an input, so the equation error is what a simulation would say. The own unknowns are what the record
    has for itself and what no number tells. `actives`: the nominal numbers and what is simulated of the candidate, one
    after the other in the vector of all parameters. `like`: the same record beside another set, whose weights and own
    unknowns are taken.
    """

    common: tuple[FloatArray, np.ndarray]  # Weighted own unknowns of any set, and which of them are tolerances

    def __init__(self, problem: EquationError, candidate: Candidate, actives: Sequence[Active], record: int,
                 tolerance: float, like: "GivenMotion | None" = None) -> None:
        self.problem, self.record, self.tolerance = problem, record, tolerance
        mine = [p for p in problem.places if p.record == record and p.order < 0]
        self.rows = slice(mine[0].rows.start, mine[-1].rows.stop)
        self.dof = np.repeat([p.dof for p in mine], [p.rows.stop - p.rows.start for p in mine])
        self.noise, self.power = problem.model.n + self.dof, problem.rows.power[self.rows]

        terms = [term for term in candidate.terms if term.simulated]
        self.nominal, ends = len(actives) - len(terms), np.cumsum([0, *(len(a.vector) for a in actives)])
        self.terms = [(t, slice(i, j)) for t, i, j in zip(terms, ends[self.nominal:], ends[self.nominal + 1:])]
        strengths = [[p.strength for p in a.effect.parameters.values()] for a in actives[self.nominal:]]
        self.linear = np.flatnonzero(np.concatenate([np.ones(self.nominal, dtype=bool), *strengths]))
        self.made = dict[tuple[Key, tuple[float, ...]], FloatArray]()  # Rows of effects at numbers of their shapes

        columns, mean = problem.with_columns(term.columns for term in candidate.terms), candidate.posterior.mean
        values, changes, held = columns.values[self.rows], self._changes(columns), np.zeros(columns.count)
        numbers, begins = [np.arange(self.nominal)], [np.arange(0)]
        for term, at in placed(problem, candidate.terms):
            if term.simulated:
                numbers.append(np.arange(at.start, at.start + len(term.strengths)))
                begins.append(np.arange(at.start + len(term.strengths), at.stop))
            else:  # acts as it was found
                held[at] = mean[at]
        self.known, self.unchanged = problem.rows.error[self.rows] - values @ held, 1.0 - changes @ held
        self.changes = changes[:, np.concatenate(numbers)]
        if like is None:
            factor = 1.0 - changes @ mean
            noise, *forces = (part[self.rows] for part in variance(problem.rows, candidate.posterior.sizes))
            self.weight = factor * np.sqrt(self.power / (noise * factor**2 + sum(forces)))
        else:
            self.weight = like.weight
        self.common = self._own(candidate) if like is None else like.common
        # What the effects' own states make that are not at rest when the record begins
        states = values[:, np.concatenate(begins)] * columns.spread[np.concatenate(begins)] * self.weight[:, None]
        states = states[:, np.any(states, axis=0)]
        self.own = np.hstack([self.common[0], states])
        self.tolerated = np.r_[self.common[1], np.zeros(states.shape[1], dtype=bool)]

    def tolerating(self, tolerance: float) -> "GivenMotion":
        """Return the same rows with another log of the common factor of the tolerances."""
        found = copy(self)
        found.tolerance = tolerance
        return found

    @property
    def added(self) -> FloatArray:
        """What the own unknowns add to the weighted rows, one standard deviation each, (rows, unknowns)."""
        return np.asarray(self.own * np.where(self.tolerated, np.exp(self.tolerance), 1.0))

    def errors(self, p: FloatArray, own: FloatArray) -> FloatArray:
        """Return the weighted errors at all parameters and own unknowns."""
        error, factor = self._at(p)
        return np.asarray(self.weight * error / factor - self.added @ own)

    def derivatives(self, p: FloatArray, free: np.ndarray, sd: FloatArray, small: float = 1e-4) -> FloatArray:
        """Return the derivatives of the weighted errors, less their sign, by free parameters in units of sd."""
        error, factor = self._at(p)
        found = np.zeros((error.size, p.size))
        found[:, self.linear] = self.columns(p) - (error / factor)[:, None] * self.changes
        for k, size in zip(free, sd):
            if k not in self.linear:  # a number of a shape
                found[:, k] = (error - self._at(p + small * size * (np.arange(p.size) == k))[0]) / (small * size)
        return np.asarray((self.weight / factor)[:, None] * found[:, free] * sd)

    def beside(self, terms: Sequence[Term], p: FloatArray) -> FloatArray:
        """Return what terms beside the set add to the weighted rows, one standard deviation of each strength."""
        error, factor = self._at(p)
        ratio, found = (error / factor)[:, None], list[FloatArray]()
        for term in terms:
            k = len(term.strengths)
            rows = np.asarray(term.columns.values[self.rows])[:, :k] - ratio * self._changes(term.columns)[:, :k]
            found.append(rows * term.columns.spread[:k])
        return np.asarray((self.weight / factor)[:, None] * np.hstack(found))

    def columns(self, p: FloatArray) -> FloatArray:
        """Return the rows of each number that they are linear in, at the shapes of all parameters."""
        parts = [np.asarray(self.problem.base.values[self.rows])[:, : self.nominal]]
        return np.concatenate([*parts, *(self._of_term(term, p[at]) for term, at in self.terms)], axis=1)

    def _at(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the error, and by what the measured force is multiplied."""
        numbers = p[self.linear]
        return self.known - self.columns(p) @ numbers, self.unchanged - self.changes @ numbers

    def _of_term(self, term: Term, values: FloatArray) -> FloatArray:
        """Return the rows of a term's strengths at the numbers of its shape."""
        strength = [p.strength for p in term.active.effect.parameters.values()]
        mine = np.where(strength, term.active.vector, values)
        if np.all(mine == term.active.vector):
            return np.asarray(term.columns.values[self.rows])[:, : len(term.strengths)]
        key = term.key, tuple(mine.tolist())
        if key not in self.made:
            self.made[key] = rows_of_effect(self.problem, term.active.with_values(key[1]), self.record)[self.rows]
        return self.made[key]

    def _changes(self, columns: Columns) -> FloatArray:
        """Return by how much of itself each unknown lessens what a row's force is multiplied by, (rows, unknowns).

        It is the same at all frequencies.
        """
        n = self.problem.model.n
        first = sum(run.omega_fine.size * n for run in self.problem.runs[: self.record])
        return np.asarray(columns.relative.tocsr()[first:first + n].toarray().real[self.dof])

    def _own(self, candidate: Candidate) -> tuple[FloatArray, np.ndarray]:
        """Return the weighted own unknowns at stated tolerances, and which of them are tolerances."""
        problem, factors, first = self.problem, candidate.posterior.sizes.factors.copy(), self.rows.start
        factors[TOLERANCE] = 0.0
        mine, base = problem.rows.own[self.record], problem.base
        found = np.zeros((self.weight.size, mine.count))
        for rows, at, values in mine.parts:
            if rows.stop <= self.rows.stop:
                found[rows.start - first:rows.stop - first, at] = values
        both = np.hstack([np.asarray(base.values[self.rows])[:, self.nominal:], found])
        factor = np.r_[base.factor[self.nominal:], mine.factor]
        both *= np.exp(factors)[factor] * np.r_[base.spread[self.nominal:], mine.spread] * self.weight[:, None]
        seen = np.any(both, axis=0)
        return both[:, seen], factor[seen] == TOLERANCE


def rows_of_effect(problem: EquationError, active: Active, record: int) -> FloatArray:
    """Return the rows of all records of each strength of an effect, those of one record filled."""
    effect = active.effect
    made = [Filling(problem, effect.linear) for p in effect.parameters.values() if p.strength]
    for filling, feature in zip(made, next(iter(features_of(problem.symbols(active), active, [problem.runs[record]])))):
        filling.add(record, feature)
    found = problem.mixed(np.concatenate([filling.values for filling in made], axis=1))
    if problem.quiet is not None:
        found[problem.quiet] = 0.0
    return found
