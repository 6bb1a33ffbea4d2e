"""Shapes of effects (a gap, a frequency, a lag) where records ask for them: where the score test gains most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.candidates import Candidate, Term, slabs_of, term_columns
from radiation_ss.inference.effect_features import Symbols
from radiation_ss.inference.linear_model import Columns, Posterior, joined
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.regression import solve
from radiation_ss.inference.score import gains
from radiation_ss.inference.search import SearchRules, promise, solve_set


def sharpened(problem: EquationError, parent: Candidate, terms: Sequence[Term], rules: SearchRules) -> list[Term]:
    """Return the effects that promise something beside a set, and those in it, each with the shape that gains most."""
    found = []
    for out in (None, *parent.terms):
        rest = [t for t in parent.terms if t is not out]
        columns = joined([problem.base, *(t.columns for t in rest)])
        free = [t for t in terms if t.key not in parent.keys] if out is None else [out]
        best = promise(problem, parent, columns, free, rules)
        shaped = [t for odds, t in best.values() if free_shape(t) and (odds > rules.least or t is out)]
        if shaped:
            stated = solve(problem.rows, columns, replace(parent.posterior.sizes, tolerance=0.0))
            found += [new for t in shaped if (new := best_shape(problem, columns, stated, t, rules))]
    return found


def free_shape(term: Term) -> list[str]:
    """Return the names of the shape parameters that are fitted."""
    return [n for n, p in term.active.effect.parameters.items() if not p.strength and not p.fixed]


def best_shape(problem: EquationError, columns: Columns, stated: Posterior, term: Term, rules: SearchRules,
               worth: float = 1.0) -> Term | None:
    """Return an effect with the shape that gains most beside some columns; None if it gains no log evidence `worth`."""
    active, names = term.active, free_shape(term)
    slabs = slabs_of(problem, active.effect, active.dof, active.other)
    if slabs is None:
        return None
    symbols = Symbols(problem.model, active)
    start = np.array([active.values[n] for n in names])
    bounds = [(slabs[n].lower, slabs[n].upper) for n in names]
    # A step into the bounds, of the size by which starts differ.
    step = np.array([0.2 * slabs[n].sd * (1.0 if x + 0.2 * slabs[n].sd < slabs[n].upper else -1.0)
                     for n, x in zip(names, start)])
    tried: dict[float, Term] = {}

    def loss(shape: FloatArray) -> float:
        shaped = replace(active, values={**active.values, **dict(zip(names, map(float, shape)))})
        made = term_columns(problem, shaped, slabs, symbols)
        if made is None:
            return np.inf
        gain = float(gains(problem.rows, columns, stated, [made], rules.sizes.cut)[0])
        tried[gain] = Term(shaped, made, term.shapes)
        return -gain

    first = -loss(start)
    minimize(loss, start, method="Nelder-Mead", bounds=bounds,
             options={"initial_simplex": start + np.vstack([np.zeros(start.size), np.diag(step)]),
                      "maxfev": 15 + 10 * start.size, "xatol": 0.0, "fatol": worth})
    best = max(tried, default=first)
    return tried[best] if best >= first + worth else None


def with_shapes(problem: EquationError, parent: Candidate, terms: Sequence[Term], rules: SearchRules,
                present: Sequence[str]) -> Candidate:
    """Return a set with the shapes of some terms for those of its own."""
    shaped = {t.key: t for t in terms}
    return solve_set(problem, [shaped.get(t.key, t) for t in parent.terms], parent.posterior.sizes, rules, present)
