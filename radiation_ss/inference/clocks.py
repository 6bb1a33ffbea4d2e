"""Clocks of a set of effects, exact: an effect of a delay is not linear in it, and to first order two do for one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.inference.candidates import Candidate, Term, slabs_of, term_columns
from radiation_ss.inference.linear_model import Sizes
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.search import SearchRules, promise, solve_set


def likely_clocks(problem: EquationError, null: Candidate, terms: Sequence[Term],
                  rules: SearchRules, starts: float = 2.5) -> list[Candidate]:
    """Return the sets of the likeliest clocks, exact: to first order a large delay needs many effects beside it.

    Each is tried about none and about `starts` standard deviations of its prior, where no delay may look likely.
    """
    clocks = [t for t in terms if t.clock]
    near = [linear_about(problem, [t], sign * starts * t.columns.spread)[0] for t in clocks for sign in (-1.0, 1.0)]
    best = promise(problem, null, problem.base, [*clocks, *near], rules)
    likely = sorted((pair for pair in best.values() if pair[0] > 0.0), key=lambda pair: -pair[0])
    return [timed(problem, [term], null.posterior.sizes, rules) for _, term in likely[: rules.beam]]


def retimed(problem: EquationError, candidate: Candidate, rules: SearchRules,
            present: Sequence[str]) -> list[Candidate]:
    """Return a set of effects with its clocks exact, all of them and each by itself: to first order two do for one."""
    clocks = [t for t in candidate.terms if t.clock]
    found = []
    for kept in ([clocks] if clocks else []) + [[t] for t in clocks if len(clocks) > 1]:
        terms = [t for t in candidate.terms if t in kept or not t.clock]
        found.append(timed(problem, terms, candidate.posterior.sizes, rules, present))
    return found


def timed(problem: EquationError, terms: Sequence[Term], sizes: Sizes, rules: SearchRules,
          present: Sequence[str] = (), steps: int = 8, accuracy: float = 0.1) -> Candidate:
    """Return a set with its clocks linear about their own estimates, by the secant method for each.

    At most `steps` are made, until each is within `accuracy` standard deviations; the best of all sets is kept.
    """
    best = found = solve_set(problem, terms, sizes, rules, present)
    last: FloatArray | None = None
    for _ in range(steps):
        about, estimate, std = clock_numbers(problem, found).T
        off = estimate - about
        if np.all(np.abs(off) < accuracy * std):
            break
        step = off
        if last is not None:
            slope = (off - last[1]) / np.where(about == last[0], np.inf, about - last[0])
            step = np.where(slope < 0.0, -off / np.where(slope < 0.0, slope, 1.0), off)
        last = np.array([about, off])
        found = solve_set(problem, linear_about(problem, terms, about + step), found.posterior.sizes, rules, present)
        best = max(best, found, key=lambda c: c.log_probability)
    return best


def clock_numbers(problem: EquationError, candidate: Candidate) -> FloatArray:
    """Return of each clock in a set the number about which it is linear, its estimate and its standard deviation.

    The estimate takes over what the phase of the nominal force had taken. Shape (numbers, 3).
    """
    found, at, (mean, std) = [], problem.base.count, (candidate.posterior.mean, candidate.posterior.std)
    phase = {label.split("|")[1]: value for label, value in zip(problem.labels, mean) if "force_phase" in label}
    for term in candidate.terms:
        if term.clock:
            place = problem.model.dofs.index(term.active.dof) if term.active.dof else 0
            late = phase.get(term.active.dof, 0.0) / natural_frequency(problem.model, place)
            found += [(about, value + late, deviation) for about, value, deviation
                      in zip(term.active.values.values(), mean[at:], std[at:])]
        at += term.columns.count
    return np.array(found).reshape(-1, 3)


def linear_about(problem: EquationError, terms: Sequence[Term], numbers: FloatArray) -> tuple[Term, ...]:
    """Return terms with their clocks linear about these numbers, one clock's after the other's."""
    found, at = [], 0
    for term in terms:
        if term.clock:
            values = dict(zip(term.active.values, map(float, numbers[at:])))
            at += len(values)
            active = replace(term.active, values=values)
            slabs = slabs_of(problem, active.effect, active.dof, active.other)
            columns = term_columns(problem, active, slabs) if slabs else None
            term = term if columns is None else replace(term, active=active, columns=columns)
        found.append(term)
    return tuple(found)
