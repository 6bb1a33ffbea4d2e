"""Fisher information of single tests, which adds up over any set of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.design.programme import PlannedTest
from radiation_ss.effects import Effect
from radiation_ss.inference.equation_error import EquationError, equation_error
from radiation_ss.inference.features import impedance
from radiation_ss.inference.measured_motion import QUANTITIES, MeasuredMotion, Resolution, measured_motion
from radiation_ss.inference.search import Term, terms_of

ROUNDING = 1e-10  # share of an effect's own information below which what is left of it is rounding


@dataclass(frozen=True, eq=False)
class Information:
    """Information on the model's numbers (n of them) and on effects' strengths, each of unit prior variance.

    Parameters
    ----------
    terms : tuple of Term
        One for each effect and place.
    places : tuple of ndarray
        Rows of each term's strengths.
    nominal : int
        Number of the model's own numbers; they come first.
    tests : ndarray, shape (nt, p, p)
        Of each test, its unknown start marginalised.
    """

    terms: tuple[Term, ...]
    places: tuple[FloatArray, ...]
    nominal: int
    tests: FloatArray

    @property
    def labels(self) -> tuple[str, ...]:
        """Effects with their places."""
        return tuple(term.active.label for term in self.terms)

    def beside_nominal(self, chosen: Sequence[int]) -> FloatArray:
        """Return the information of tests on the strengths while the model's numbers move within tolerance."""
        n = self.nominal
        total = self.tests[list(chosen)].sum(axis=0)
        return beside(total[n:, n:], total[:n, n:], total[:n, :n] + np.eye(n))

    def detectability(self, chosen: Sequence[int]) -> FloatArray:
        """Return by how many standard deviations each effect of typical size stands out, shape (k,)."""
        A = self.beside_nominal(chosen)
        return np.array([strongest(A[np.ix_(at, at)]) for at in self._within()])

    def exact(self, chosen: Sequence[int]) -> FloatArray:
        """Return the same if the model's own numbers were exactly known, shape (k,)."""
        total = self.tests[list(chosen)].sum(axis=0)[self.nominal:, self.nominal:]
        return np.array([strongest(total[np.ix_(at, at)]) for at in self._within()])

    def separation(self, chosen: Sequence[int]) -> FloatArray:
        """Return what is left of row i's detectability when effect j may act too, at any size, shape (k, k)."""
        A, own = self.beside_nominal(chosen), self.tests[list(chosen)].sum(axis=0)[self.nominal:, self.nominal:]
        within = self._within()
        result = np.tile(self.detectability(chosen)[:, None], (1, len(within)))
        for j, at in enumerate(within):
            left = A - A[:, at] @ inverse(A[np.ix_(at, at)], own[np.ix_(at, at)]) @ A[at]
            for i, rows in enumerate(within):
                if i != j:
                    result[i, j] = strongest(left[np.ix_(rows, rows)])
        return result

    def _within(self) -> list[FloatArray]:
        return [at - self.nominal for at in self.places]


def strongest(matrix: FloatArray) -> float:
    """Return the square root of the largest eigenvalue."""
    value = matrix[0, 0] if matrix.shape == (1, 1) else np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1]
    return float(np.sqrt(max(float(value), 0.0)))


def beside(own: FloatArray, cross: FloatArray, other: FloatArray) -> FloatArray:
    """Return what is left of the information `own` when the others are unknown, too: a Schur complement."""
    return own - cross.T @ np.linalg.solve(other, cross)


def inverse(matrix: FloatArray, own: FloatArray) -> FloatArray:
    """Return the inverse on the directions that tests show at all, zero on the others."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    there = values > ROUNDING * max(float(np.trace(own)), 1e-300)
    return np.asarray((vectors[:, there] / values[there]) @ vectors[:, there].T)


def planned_problem(model: Model, tests: Sequence[PlannedTest], tolerance: Mapping[str, float],
                    noise: float) -> EquationError:
    """Return the regression problem of all records; a sensor's noise is a share of what it reads at full amplitude."""
    records = list({id(test.record): test.record for test in tests}.values())
    large = {id(test.record) for test in tests if test.large}
    runs = [measured_motion(model, record, Resolution(noise_floor=0.0)) for record in records]
    full = [run for run, record in zip(runs, records) if id(record) in large] or runs
    sizes = np.stack([np.sqrt(np.mean([np.mean(getattr(run, name) ** 2, axis=1) for run in full], axis=0))
                      for name in "xva"])
    return equation_error(model, [with_noise(run, noise * sizes, record) for run, record in zip(runs, records)],
                          tolerance)


def with_noise(run: MeasuredMotion, sizes: FloatArray, record: object) -> MeasuredMotion:
    """Return a motion whose sensors have stated noise, given for displacement, velocity and acceleration."""
    keep = np.sqrt(max(run.dt / float(np.median(np.diff(run.record.time))), 1.0))
    sensors = tuple(replace(s, noise=float(sizes[s.order, s.dof]) / keep) for s in run.sensors)
    return replace(run, noise=sizes[0] / keep, sensors=sensors)


def information_of(model: Model, tests: Sequence[PlannedTest], effects: Sequence[Effect],
                   tolerance: Mapping[str, float], noise: float, gap: float | None = None) -> Information:
    """Return the information of tests; of the starts of an effect's shape the one that all tests together show best.

    Parameters
    ----------
    model : Model
    tests : sequence of PlannedTest
        Which sensors of which record.
    effects : sequence of Effect
    tolerance : mapping of str to float
    noise : float
        Standard deviation of each sensor, of what it reads at full amplitude.
    gap : float, optional
        Size of every effect: the share of the motion that it changes in the full-amplitude test that it changes most.
        Without it the size typical in the library.
    """
    problem = planned_problem(model, tests, tolerance, noise)
    every = information(problem, terms_of(problem, effects), tests)
    size = every.detectability(range(len(tests)))
    best: dict[tuple[str, str, str], int] = {}
    for k, term in enumerate(every.terms):
        if term.key not in best or size[k] > size[best[term.key]]:
            best[term.key] = k
    kept = list(best.values())
    large = {id(test.record) for test in tests if test.large}
    order = list({id(test.record): None for test in tests})
    full = [r for r, key in enumerate(order) if key in large]
    sizes = np.ones(len(kept)) if gap is None else np.array([size_for(gap, problem, every.terms[k], full)
                                                             for k in kept])
    return resized(only(every, kept), sizes)


def information(problem: EquationError, terms: Sequence[Term], tests: Sequence[PlannedTest] | None = None,
                variance: FloatArray | None = None) -> Information:
    """Return the information of tests on nominal numbers and effects; of all records together without tests.

    Parameters
    ----------
    problem : EquationError
    terms : sequence of Term
    tests : sequence of PlannedTest, optional
    variance : ndarray, shape (N,), optional
        Of each row; that of the sensors' noise if absent.
    """
    v = problem.rows.noise if variance is None else variance
    own = len([label for label in problem.labels if label.startswith("nominal")])
    columns = [problem.base.values[:, :own] * problem.base.spread[:own]]
    columns += [term.columns.values * term.columns.spread for term in terms]
    J = np.concatenate(columns, axis=1) / np.sqrt(v)[:, None]
    nuisance = problem.base.values[:, own:] * problem.base.spread[own:] / np.sqrt(v)[:, None]
    records = list({id(test.record): None for test in tests}) if tests is not None else []
    picked = [rows_of(problem, records.index(id(t.record)), t.quantities) for t in tests or ()]
    if tests is None:
        picked = [np.arange(v.size)]
    ends = own + np.cumsum([term.columns.count for term in terms])
    places = tuple(np.arange(end - term.columns.count, end) for end, term in zip(ends, terms))
    return Information(tuple(terms), places, own, np.stack([marginal(J[rows], nuisance[rows]) for rows in picked]))


def rows_of(problem: EquationError, record: int, quantities: Sequence[str]) -> np.ndarray:
    """Return the rows of one record that some sensors give."""
    return np.concatenate([np.arange(p.rows.start, p.rows.stop) for p in problem.places if p.record == record
                           and (p.order < 0 or QUANTITIES[p.order] in quantities)])


def marginal(J: FloatArray, nuisance: FloatArray) -> FloatArray:
    """Return J'J with nuisance columns of unit prior variance marginalised."""
    there = np.any(nuisance, axis=0)
    N = nuisance[:, there]
    return beside(J.T @ J, N.T @ J, N.T @ N + np.eye(N.shape[1]))


def only(every: Information, kept: Sequence[int]) -> Information:
    """Return the information on some of the terms."""
    rows = np.concatenate([np.arange(every.nominal), *(every.places[k] for k in kept)]).astype(int)
    ends = every.nominal + np.cumsum([every.places[k].size for k in kept])
    places = tuple(np.arange(end - every.places[k].size, end) for k, end in zip(kept, ends))
    return Information(tuple(every.terms[k] for k in kept), places, every.nominal,
                       every.tests[:, rows[:, None], rows])


def resized(information: Information, sizes: FloatArray) -> Information:
    """Return the information on strengths in units of `sizes` prior deviations."""
    unit = np.concatenate([np.ones(information.nominal),
                           *(np.full(at.size, size) for at, size in zip(information.places, sizes))])
    return replace(information, tests=information.tests * unit * unit[:, None])


def size_for(gap: float, problem: EquationError, term: Term, full: Sequence[int]) -> float:
    """Return the strength, in prior deviations, that changes the motion by the share `gap` where it does so most.

    Each degree of freedom counts by its typical size. To first order, with the model's own numbers.
    """
    largest = 0.0
    for r in full:
        run, change = problem.runs[r], np.zeros(term.columns.count)
        Z = np.abs(np.einsum("wii->wi", impedance(problem.model, run.basis[0].omega)))
        for place in problem.places:
            if place.record == r and place.order < 0:
                stiff = np.tile(Z[: place.bins, place.dof], len(run.basis))[:, None]
                rows = term.columns.values[place.rows] * term.columns.spread / stiff
                own = np.sum(run.x[place.dof] ** 2)
                change += np.sum(rows**2, axis=0) / max(float(own), 1e-300) / problem.model.n
        largest = max(largest, float(np.sqrt(change.max(initial=0.0))))
    return gap / largest if largest > 0.0 else 1.0
