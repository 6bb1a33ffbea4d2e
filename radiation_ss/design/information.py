"""Fisher information: of planned tests by what their sensors read, of records at hand by their equation error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import pinvh, solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.design.programme import PlannedTest, Simulated, simulated
from radiation_ss.effects import Effect
from radiation_ss.effects.nominal import nominal_effects
from radiation_ss.inference.candidates import Term, slabs_of, terms_of
from radiation_ss.inference.equation import equation_error
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import projected
from radiation_ss.records.columns import QUANTITIES


@dataclass(frozen=True, eq=False)
class Information:
    """Information on the model's numbers (n of them) and on effects' strengths, each of unit prior variance."""

    terms: tuple[Term, ...]  # One for each effect and place
    places: tuple[FloatArray, ...]  # Rows of each term's strengths, behind the model's own numbers
    nominal: int  # Number of the model's own numbers; they come first
    tests: FloatArray  # (nt, p, p): Of each test, its unknown start marginalised

    @property
    def labels(self) -> tuple[str, ...]:
        """Effects with their places."""
        return tuple(term.active.label for term in self.terms)

    def beside_nominal(self, chosen: Sequence[int]) -> FloatArray:
        """Return the information of tests on the strengths while the model's numbers move within tolerance."""
        n = self.nominal
        total = self.tests[list(chosen)].sum(axis=0)
        return total[n:, n:] - total[:n, n:].T @ np.linalg.solve(total[:n, :n] + np.eye(n), total[:n, n:])

    def alone(self, chosen: Sequence[int]) -> FloatArray:
        """Return the same if the model's own numbers were exactly known."""
        return self.tests[list(chosen)].sum(axis=0)[self.nominal:, self.nominal:]

    def detectability(self, chosen: Sequence[int], exact: bool = False) -> FloatArray:
        """Return by how many standard deviations each effect stands out, (k,); `exact`: of a model known exactly."""
        A = self.alone(chosen) if exact else self.beside_nominal(chosen)
        return np.array([strongest(A[np.ix_(at, at)]) for at in self.places])

    def separation(self, chosen: Sequence[int]) -> FloatArray:
        """Return what is left of row i's detectability when effect j may act too, at any size, shape (k, k)."""
        A, own = self.beside_nominal(chosen), self.alone(chosen)
        result = np.tile(self.detectability(chosen)[:, None], (1, len(self.places)))
        for j, at in enumerate(self.places):
            left = A - A[:, at] @ inverse(A[np.ix_(at, at)], own[np.ix_(at, at)]) @ A[at]
            for i, rows in enumerate(self.places):
                if i != j:
                    result[i, j] = strongest(left[np.ix_(rows, rows)])
        return result


def strongest(matrix: FloatArray) -> float:
    """Return the square root of the largest eigenvalue."""
    value = matrix[0, 0] if matrix.shape == (1, 1) else np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1]
    return float(np.sqrt(max(float(value), 0.0)))


def inverse(matrix: FloatArray, own: FloatArray, rounding: float = 1e-10) -> FloatArray:
    """Return the inverse on the directions that tests show by more than a share `rounding`, zero on the others."""
    return np.asarray(pinvh(0.5 * (matrix + matrix.T), atol=rounding * max(float(np.trace(own)), 1e-300), rtol=0.0))


def information_of(model: Model, tests: Sequence[PlannedTest], effects: Sequence[Effect],
                   tolerance: Mapping[str, float], noise: float, gap: float | None = None) -> Information:
    """Return the information of tests; of the starts of an effect's shape the one that all tests together show best.

    `noise`: standard deviation of each sensor, of what it reads at full amplitude. `gap`: share of the motion that
    every effect changes in the full-amplitude test that it changes most; without it the size typical in the library.
    """
    records = list({id(test.record): test.record for test in tests}.values())
    large = {id(test.record) for test in tests if test.large}
    full = [id(record) in large for record in records]
    plan = simulated(model, records, full, noise)
    problem = equation_error(model, plan.runs, tolerance)
    # What every effect is seen beside, in each record: changes by the model's own numbers, and by unknown starts.
    own = [[part * number.spread for part in plan.by(number.active, problem.symbols(number.active))]
           for number in nominal_effects(model, tolerance, force=problem.forced)]
    nominal = [np.concatenate(changes, axis=-1) for changes in zip(*own)]
    unknown = [plan.unknown(r) for r in range(len(records))]
    place, n = {id(record): r for r, record in enumerate(records)}, nominal[0].shape[-1]

    def read(changes: Sequence[FloatArray]) -> list[FloatArray]:
        """Return changes in each record as each test's sensors read them, in standard deviations."""
        rows = [plan.weighed(r, change) for r, change in enumerate(changes)]
        return [np.concatenate([rows[place[id(test.record)]][order] for order, name in enumerate(QUANTITIES)
                                if order == 0 or name in test.quantities]) for test in tests]

    own_numbers = [Beside.of(*parts) for parts in zip(read(nominal), read(unknown))]

    def seen(changes: Sequence[FloatArray]) -> FloatArray:
        """Return each test's information on the model's own numbers and on effects that make changes."""
        return np.stack([known.information(J) for known, J in zip(own_numbers, read(changes))])

    best: dict[tuple[str, str, str], tuple[float, Term, list[FloatArray]]] = {}
    for term in (t for t in terms_of(problem, effects) if t.active.of_first_sensor):  # of others the motion tells none
        effect = term.active.effect  # changes by one prior standard deviation of each strength
        slabs = slabs_of(problem, effect, term.active.dof, term.active.other) or {}
        spread = np.array([slabs[name].sd for name, p in effect.parameters.items() if p.strength])
        spread = np.tile(spread, len(plan.runs)) if effect.per_record else spread
        change = [part * spread for part in plan.by(term.active, problem.symbols(term.active), effect.per_record)]
        if gap is not None:
            factor = size_for(gap, plan, change, full)
            change = [part * factor for part in change]
        alone = Information((term,), (np.arange(change[0].shape[-1]),), n, seen(change))
        value = float(alone.detectability(range(len(tests)))[0])
        if term.key not in best or value > best[term.key][0]:
            best[term.key] = (value, term, change)
    kept = list(best.values())
    places = side_by_side([change[0].shape[-1] for _, _, change in kept])
    together = [np.concatenate([own[..., :0], *(change[r] for _, _, change in kept)], axis=-1)
                for r, own in enumerate(nominal)]
    return Information(tuple(term for _, term, _ in kept), places, n, seen(together))


def side_by_side(counts: Sequence[int]) -> tuple[FloatArray, ...]:
    """Return the rows of terms with so many strengths each."""
    return tuple(np.arange(end - count, end) for end, count in zip(np.cumsum(counts), counts))


def size_for(gap: float, plan: Simulated, changes: Sequence[FloatArray], full: Sequence[bool]) -> float:
    """Return the factor with which an effect changes the motion by the share `gap`, to first order, at most."""
    moving = plan.sizes[0] > 0.0
    shares = [np.mean(change[0, moving] ** 2, axis=1) / plan.sizes[0, moving, None] ** 2
              for change, is_full in zip(changes, full) if is_full or not any(full)]
    largest = float(np.sqrt(max(np.max(np.sum(share, axis=0)) / plan.model.n for share in shares)))
    return gap / largest if largest > 0.0 else 1.0


def information(problem: EquationError, terms: Sequence[Term], variance: FloatArray) -> Information:
    """Return the information of all records together on nominal numbers and effects.

    The zero of a sensor is left to the effects: a steady load and a bias are among them. An unknown force absorbs
    whatever goes linearly with the motion at each frequency. `variance` (N,): of each row.
    """
    base, own = problem.base, sum(label.startswith("nominal") for label in problem.labels)
    common = np.asarray(base.values) * base.spread
    columns = [common[:, :own]]
    unforced = np.zeros(variance.size, dtype=bool)
    for place in problem.places:
        unforced[place.rows] = problem.runs[place.record].force is None and place.order < 0
    for term in terms:
        hidden = (unforced & term.active.effect.linear)[:, None]
        columns.append(np.where(hidden, 0.0, term.columns.values) * term.columns.spread)
    J = np.concatenate(columns, axis=1) / np.sqrt(variance)[:, None]
    lone = []  # what each record has for itself but the zeros of its sensors
    for part in problem.rows.own:
        values = np.zeros((variance.size, part.count))
        part.times(np.diag(part.spread), values)
        lone.append(values[:, [not label.startswith(("offset|", "drift|")) for label in part.labels]])
    nuisance = np.concatenate([common[:, own:], *lone, absorbed(problem)], axis=1)
    places = side_by_side([term.columns.count for term in terms])
    known = Beside.of(J, nuisance / np.sqrt(variance)[:, None])
    return Information(tuple(terms), places, own, known.information(J[:, :0])[None])


def absorbed(problem: EquationError, wide: float = 10.0) -> FloatArray:
    """Return what an unknown force, `wide` a priori, hides: a mean, and at each frequency what the motion scales."""
    found = [np.zeros((problem.rows.error.size, 0))]
    for place in problem.places:
        run = problem.runs[place.record]
        if run.force is not None or place.order >= 0:
            continue
        mean = np.zeros((problem.rows.error.size, 1))
        mean[place.rows, 0] = projected(problem.model, run, place, np.ones_like(run.raw))
        found.append(wide * problem.scales[problem.model.dofs[place.dof]].force * mean)
        stiff = np.abs(impedance(problem.model, run.basis[0].omega[: place.bins])[:, place.dof])
        for j in np.flatnonzero(run.free):
            for values in (run.x[j], run.v[j] / run.omega[j]):
                rows = np.stack([block.project(values)[: place.bins] for block in run.basis])
                at = np.zeros((problem.rows.error.size, place.bins))
                at[place.rows] = (rows[:, :, None] * np.diag(wide * stiff[:, j])).reshape(-1, place.bins)
                found.append(at)
    return np.concatenate(found, axis=1)


@dataclass(frozen=True, eq=False)
class Beside:
    """Columns that every effect is seen beside, what nuisances of unit prior variance hide of them taken off once."""

    columns: FloatArray
    hiding: FloatArray  # (rows, k): nuisances times the root of their inverse information
    hidden: FloatArray  # (k, columns)

    @classmethod
    def of(cls, columns: FloatArray, nuisance: FloatArray) -> "Beside":
        """Prepare them."""
        N = nuisance[:, np.any(nuisance, axis=0)]
        hiding = solve_triangular(np.linalg.cholesky(N.T @ N + np.eye(N.shape[1])), N.T, lower=True).T
        return cls(columns, hiding, hiding.T @ columns)

    def information(self, J: FloatArray) -> FloatArray:
        """Return the information on the columns and those of J, the nuisances unknown."""
        both, hidden = np.hstack([self.columns, J]), np.hstack([self.hidden, self.hiding.T @ J])
        return both.T @ both - hidden.T @ hidden
