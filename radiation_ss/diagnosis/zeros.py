"""Zeros of forces or sensors that are off: found, told, and put right by the first effect that makes them so."""

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.diagnosis.account import Data, Fitted, numbers
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.sets import zeros
from radiation_ss.diagnosis.shares import Budget
from radiation_ss.inference.search import Found, solve_set


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
