"""What these records can show at all, and what they cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.equation_error import EquationError
from radiation_ss.inference.regression import Point, Posterior, safe
from radiation_ss.inference.search import Term

Key = tuple[str, str, str]


def information(problem: EquationError, null: Posterior, terms: Sequence[Term]) -> FloatArray:
    """Return the information on each term's best seen strength, in units of its prior."""
    W = problem.rows.power / null.variance
    weighted = W[:, None] * problem.base.values
    point = Point(safe(1.0 - problem.base.relative[problem.rows.telling] @ null.mean), null.noise, null.variance, null.residual)
    found = []
    for term in terms:
        X = term.columns.values
        cross = weighted.T @ X
        A = np.diag(X.T @ (W[:, None] * X) - cross.T @ null.covariance @ cross).copy()
        if np.any(term.columns.relative):
            A += np.diag(point.impedance_terms(problem.rows, term.columns.relative[problem.rows.telling])[1])
        found.append(float(np.max(A * term.columns.spread**2, initial=0.0)))
    return np.array(found)


def testable(problem: EquationError, null: Posterior, terms: Sequence[Term],
             least: float) -> tuple[list[Term], list[Key]]:
    """Return the terms that the records can show, and the effects that they cannot.

    Parameters
    ----------
    problem : EquationError
    null : Posterior
        Without effects.
    terms : sequence of Term
    least : float
        Information below which a term cannot be seen: 1 halves the prior's variance.
    """
    known = information(problem, null, terms)
    kept = [t for t, value in zip(terms, known) if value >= least]
    seen = {t.key for t in kept}
    return kept, sorted({t.key for t in terms} - seen)


def twins(problem: EquationError, null: Posterior, terms: Sequence[Term], alike: float) -> list[tuple[Key, Key]]:
    """Return pairs of effects whose columns are alike once the nominal numbers have adapted.

    Parameters
    ----------
    problem : EquationError
    null : Posterior
    terms : sequence of Term
    alike : float
        Correlation from which two are twins.
    """
    W = problem.rows.power / null.variance
    single = [t for t in terms if t.columns.count == 1]
    if len(single) < 2:
        return []
    X = np.concatenate([t.columns.values for t in single], axis=1)
    X = X / np.sqrt(np.maximum(np.sum(W[:, None] * X**2, axis=0), 1e-300))
    cross = (W[:, None] * problem.base.values).T @ X
    C = X.T @ (W[:, None] * X) - cross.T @ null.covariance @ cross
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    C = np.abs(C) / np.outer(size, size)
    found = []
    for i in range(len(single)):
        for j in range(i):
            pair = (single[j].key, single[i].key)
            if C[i, j] > alike and pair[0] != pair[1] and pair not in found and min(size[i], size[j]) > 1e-4:
                found.append(pair)
    return found
