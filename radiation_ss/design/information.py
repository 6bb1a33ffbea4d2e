"""Fisher information of single tests, which adds up over any set of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.design.programme import PlannedTest
from radiation_ss.gap.posterior.fitting import Fit, fit
from radiation_ss.gap.posterior.noise import white
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.which.score import Score, scores

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


def information_of(setting: Setting, noise: Sequence[float], terms: Sequence[Term],
                   tests: Sequence[PlannedTest], gap: float | None = None) -> Information:
    """Return the information of tests; of the starts of an effect's shape the one that all tests together show best.

    Parameters
    ----------
    setting : Setting
        Of the tests' records, all sensors included.
    noise : sequence of float
        Standard deviation of each channel.
    terms : sequence of Term
    tests : sequence of PlannedTest
        Which sensors of which record.
    gap : float, optional
        Size of every effect: the share of the motion that it changes in the full-amplitude test that it changes most.
        Without it the size typical in the library.
    """
    problem = Problem(setting)
    null = fit(problem, white(noise), np.zeros(problem.size), tolerance=0.1)
    order = {id(term): k for k, term in enumerate(terms)}
    found = sorted(scores(null, list(terms)), key=lambda score: order[id(score.term)])
    ends = problem.shared + np.cumsum([score.information.shape[0] for score in found])
    places = [np.arange(end - score.information.shape[0], end) for score, end in zip(found, ends)]
    matrices = np.stack([of_test(null, noise, found, test) for test in tests])
    every = Information(tuple(score.term for score in found), tuple(places), problem.shared, matrices)
    size = every.detectability(range(len(tests)))
    best: dict[tuple[str, str, str], int] = {}
    for k, score in enumerate(found):
        if score.term.key not in best or size[k] > size[best[score.term.key]]:
            best[score.term.key] = k
    kept = list(best.values())
    sizes = np.ones(len(kept)) if gap is None else np.array([size_for(gap, null, found[k], tests) for k in kept])
    return resized(only(every, kept), sizes)


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


def size_for(gap: float, null: Fit, score: Score, tests: Sequence[PlannedTest]) -> float:
    """Return the strength, in prior deviations, that changes the motion by the share `gap` where it does so most.

    Each degree of freedom counts by its typical size. To first order, starts and numbers of the model as they are.
    """
    setting, channel, largest = null.problem.setting, 0, 0.0
    full = {id(test.record) for test in tests if test.large}
    for item in setting.records:
        squares = np.zeros(score.information.shape[0])
        for c in item.channels:
            if c.quantity == "displacement" and id(item.record) in full:
                typical = setting.scales[setting.model.dofs[c.dof]].x
                squares += np.mean(np.square(score.slopes[channel] / typical), axis=0) / setting.model.n
            channel += 1
        largest = max(largest, float(np.sqrt(squares.max())))
    return gap / largest if largest > 0.0 else 1.0


def of_test(null: Fit, noise: Sequence[float], found: Sequence[Score], test: PlannedTest) -> FloatArray:
    """Return J'J over the model's numbers and all strengths in one test, the start of its own marginalised."""
    problem, slopes, rows, channel = null.problem, null.point.slopes, [], 0
    assert slopes is not None
    shared, own = problem.shared, np.zeros(0, int)
    for r, item in enumerate(problem.setting.records):
        for c in item.channels:
            if item.record is test.record and c.quantity in test.quantities:
                own = problem.blocks[r][shared:]
                parts = [slopes[channel][:, :shared], *(score.slopes[channel] for score in found),
                         slopes[channel][:, own]]
                rows.append(np.concatenate(parts, axis=1) / noise[channel])
            channel += 1
    J = np.concatenate(rows)
    F, last = J.T @ J, own.size
    return beside(F[:-last, :-last], F[-last:, :-last], F[-last:, -last:] + np.eye(last))
