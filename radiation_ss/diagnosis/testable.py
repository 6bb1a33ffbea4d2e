"""What these records can show at all, and what they cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.inference.candidates import Key, Term
from radiation_ss.inference.linear_model import Posterior
from radiation_ss.inference.own import Marginal
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.regression import Point, bends_of, safe


def information(problem: EquationError, null: Posterior, terms: Sequence[Term]) -> FloatArray:
    """Return the information on each term's best seen strength, in units of its prior."""
    beside = Marginal(problem.rows.own, problem.rows.power / null.variance, float(np.exp(null.sizes.tolerance)))
    weighted = beside.times(problem.base.values)
    told = problem.rows.telling
    point = Point(safe(1.0 - problem.base.relative[told] @ null.mean), null.noise, null.variance, null.residual)
    found = []
    for term in terms:
        X = term.columns.values
        cross = weighted.T @ X
        A = np.diag(X.T @ beside.times(X) - cross.T @ null.covariance @ cross).copy()
        if np.any(term.columns.relative):
            A += np.diag(point.impedance_information(problem.rows, bends_of(problem.rows, term.columns.relative),
                                                      term.columns.count))
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


def pulled_slowly(problem: EquationError, share: float = 0.5) -> bool:
    """Whether an unknown force moves the body so slowly that any restoring and any force explain each other.

    That is where no record states a force, and each motion that something restores is slower than a share of its
    natural frequency.
    """
    if any(run.force is not None for run in problem.runs):
        return False
    restored = np.diag(problem.model.C) > 0.0
    moving = [(run.omega[i], natural_frequency(problem.model, int(i))) for run in problem.runs
              for i in np.flatnonzero(run.free & restored)]
    return bool(moving) and all(omega < share * natural for omega, natural in moving)
