"""Sets of effects searched with numbers that the error is not linear in: shapes by Gauss and Newton, clocks by secants.

The search knows a few starts of each shape, and of a delay its first order, to which two do for one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_array

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Effect, Slab
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.inference.candidates import Candidate, Key, Keys, Term, placed, slabs_of, terms_of, with_numbers
from radiation_ss.inference.linear_model import Columns, Sizes
from radiation_ss.inference.odds import SearchRules
from radiation_ss.inference.problem import EquationError, pulled_slowly
from radiation_ss.inference.regression import solve
from radiation_ss.inference.search import (
    Found,
    first_set,
    promise,
    search,
    solve_set,
    start_sizes,
    testable,
    within_medians,
)

Slope = tuple[int, str, Slab, Columns]  # which term, the name of its number, its prior, the change of the error


def searched(problem: EquationError, effects: Sequence[Effect], present: Sequence[str], rules: SearchRules,
             visible: float, rounds: int) -> tuple[Found, list[Key]]:
    """Return the sets of effects with their probabilities, shapes and clocks fitted, and what is not testable.

    `visible`: see `testable`. `rounds`: how often shapes are fitted and sets searched again at most.
    """
    null = first_set(problem, (), rules)
    if pulled_slowly(problem) and not present:
        places = [(e.name, *at) for e in effects for at in e.places(problem.model.dofs)]
        return search(problem, [], rules), places
    posterior = solve(problem.rows, problem.base, within_medians(problem, null.posterior.sizes))
    terms, hidden = testable(problem, posterior, terms_of(problem, effects), visible)
    acting = {term.active.name for term in terms} | {name for name, _, _ in hidden}
    hidden += [(e.name, "", "") for e in effects if not e.needs and e.name not in acting]
    known = [] if present else [null, *likely_clocks(problem, null, terms, rules)]
    found, done = search(problem, terms, rules, present, known), set()
    # After a search by starts alone: an effect in its best shape may hide a set of simpler ones from it.
    sharper = [] if present else likely_shapes(problem, null, terms, rules)
    for _ in range(rounds):
        best = [c for c in found.candidates[: rules.beam] if frozenset(c.terms) not in done]
        sharper += [s for c in best[:2] for s in retimed(problem, c, rules, present)]
        near = [*best, *(rivals(problem, best[0], terms, rules, present) if best else ())]
        sharper += [fitted_shapes(problem, c, rules, present) for c in near
                    if shaped(c) and frozenset(c.terms) not in done]
        done |= {frozenset(c.terms) for c in (*near, *sharper)}
        terms = [*terms, *(t for c in sharper for t in c.terms if t not in terms)]
        if not any(s.log_probability > found.candidates[0].log_probability for s in sharper):
            found = found.beside(sharper, terms)
            break
        found, sharper = search(problem, terms, rules, present, [*found.candidates, *sharper]), []
    return replace(found, terms=(*found.terms, *late(problem, found.terms))), hidden


def shaped(candidate: Candidate) -> Keys:
    """Return the effects of a set whose shape was one of several."""
    return frozenset(term.key for term in candidate.terms if term.shaped)


def likely_shapes(problem: EquationError, null: Candidate, terms: Sequence[Term],
                  rules: SearchRules) -> list[Candidate]:
    """Return the sets of the likeliest effects with a shape, each in the shape that fits best from its likeliest start.

    At the prior's medians: sizes of the set without effects hold what an effect would explain.
    """
    free, sizes, found = [t for t in terms if t.shaped], start_sizes(problem), []
    for one in likely(problem, null, free, rules):
        starts = (solve_set(problem, [t], sizes, rules, learned=False) for t in free if t.key == one.key)
        best = max(starts, key=lambda c: c.log_probability)
        found.append(fitted_shapes(problem, solve_set(problem, best.terms, sizes, rules, near=best), rules))
    return found


def rivals(problem: EquationError, best: Candidate, terms: Sequence[Term], rules: SearchRules,
           present: Sequence[str]) -> Iterator[Candidate]:
    """Yield sets with another shaped effect in the place of each of the best set, in the likeliest start.

    By its starts alone such a one is far behind an effect in its best shape.
    """
    for out in (t for t in best.terms if t.shaped and t.active.name not in present):
        rest = tuple(t for t in best.terms if t is not out)
        free = [t for t in terms if t.shaped and t.active.dof == out.active.dof and t.key not in best.keys]
        columns = problem.with_columns(t.columns for t in rest)
        order = sorted(promise(problem, best, columns, free, rules).values(), key=lambda pair: -pair[0])
        for _, term in order[: rules.width]:
            yield solve_set(problem, (*rest, term), best.posterior.sizes, rules, present, learned=False)


def likely(problem: EquationError, null: Candidate, terms: Sequence[Term], rules: SearchRules) -> list[Term]:
    """Return the terms of the effects that are likelier there than not, the likeliest first."""
    best = promise(problem, null, problem.base, terms, rules).values()
    return [term for odds, term in sorted(best, key=lambda pair: -pair[0]) if odds > 0.0]


def fitted_shapes(problem: EquationError, candidate: Candidate, rules: SearchRules, present: Sequence[str] = (),
                  steps: int = 6, accuracy: float = 0.1) -> Candidate:
    """Return a set with the shapes of its effects where its evidence is largest, and the prior mass about them.

    At most `steps` are made, each halved until it climbs, until all are within `accuracy` standard deviations.
    """
    found, change, covariance = candidate, np.zeros(0), np.zeros((0, 0))
    for _ in range(steps):
        slopes = list(slopes_of(problem, found))
        if not slopes:
            return candidate
        columns = problem.with_columns([*(t.columns for t in found.terms), *(s[-1] for s in slopes)])
        posterior = solve(problem.rows, columns, found.posterior.sizes)
        change, covariance = posterior.mean[-len(slopes):], posterior.covariance[-len(slopes):, -len(slopes):]
        tried = (solve_set(problem, moved(problem, found.terms, slopes, share * change), found.posterior.sizes, rules,
                           present, learned=False) for share in (1.0, 0.5, 0.25))
        height = found.posterior.log_evidence - 0.5 * apart(found, slopes)
        higher = next((c for c in tried if c.posterior.log_evidence - 0.5 * apart(c, slopes) > height), None)
        if higher is None:
            break
        found = higher
        if np.all(np.abs(change) < accuracy * np.sqrt(np.diag(covariance))):
            break
    if found is candidate:
        return candidate
    terms = [replace(t, volume=volume_of(t, k, slopes, covariance)) for k, t in enumerate(found.terms)]
    return solve_set(problem, terms, found.posterior.sizes, rules, present)


def slopes_of(problem: EquationError, candidate: Candidate, part: float = 0.05) -> Iterator[Slope]:
    """Yield how the error changes with each number of a shape, by a step of a part of its prior."""
    for k, (term, at) in enumerate(placed(problem, candidate.terms)):
        slabs = slabs_of(problem, term.active.effect, term.active.dof, term.active.other)
        if not term.shaped or slabs is None:
            continue
        strengths = candidate.posterior.mean[at]
        here = term.columns.values @ strengths
        for name in (n for n, slab in slabs.items() if not term.active.effect.parameters[n].strength and slab.sd):
            slab, value = slabs[name], term.active.values[name]
            step = part * slab.sd * (1.0 if value + part * slab.sd <= slab.upper else -1.0)
            near = with_numbers(problem, term, {name: value + step})
            if near is not None and near.columns.count == term.columns.count:
                values = ((near.columns.values @ strengths - here) / step)[:, None]
                relative = csc_array(((near.columns.relative - term.columns.relative) @ strengths / step)[:, None])
                yield k, name, slab, Columns(values, np.array([slab.sd]), np.array([-np.inf]), np.array([0]),
                                             relative)


def moved(problem: EquationError, terms: Sequence[Term], slopes: Sequence[Slope], change: FloatArray) -> list[Term]:
    """Return terms with other numbers of their shapes, changed by a prior standard deviation and to bounds at most."""
    found = list(terms)
    for k in {s[0] for s in slopes}:
        numbers = {name: float(np.clip(terms[k].active.values[name] + np.clip(step, -slab.sd, slab.sd), slab.lower,
                                       slab.upper)) for (j, name, slab, _), step in zip(slopes, change) if j == k}
        new = with_numbers(problem, terms[k], numbers)
        found[k] = terms[k] if new is None else replace(new, start=terms[k].start or terms[k].active)
    return found


def apart(candidate: Candidate, slopes: Sequence[Slope]) -> float:
    """Return the squared distance of all shapes from their starts, in prior standard deviations."""
    return sum(distance(candidate.terms[k], name, slab) ** 2 for k, name, slab, _ in slopes)


def distance(term: Term, name: str, slab: Slab) -> float:
    """Return how far a number of a shape is from its start, in prior standard deviations."""
    return (term.active.values[name] - (term.start or term.active).values[name]) / slab.sd


def volume_of(term: Term, k: int, slopes: Sequence[Slope], covariance: FloatArray) -> float:
    """Return the log prior mass about a term's shape, of that about its start, by Laplace's approximation."""
    at = [j for j, slope in enumerate(slopes) if slope[0] == k]
    if not at:
        return term.volume
    sd = np.array([slopes[j][2].sd for j in at])
    far = sum(distance(term, slopes[j][1], slopes[j][2]) ** 2 for j in at)
    return float(0.5 * np.linalg.slogdet(covariance[np.ix_(at, at)] / np.outer(sd, sd))[1] - 0.5 * far)


def likely_clocks(problem: EquationError, null: Candidate, terms: Sequence[Term],
                  rules: SearchRules) -> list[Candidate]:
    """Return the sets of the likeliest clocks, exact: to first order a large delay needs many effects beside it."""
    clocks = [t for t in terms if t.clock]
    return [timed(problem, [term], null.posterior.sizes, rules)
            for term in likely(problem, null, [*clocks, *late(problem, terms)], rules)]


def late(problem: EquationError, terms: Sequence[Term], starts: Sequence[float] = (1.25, 2.5, 3.75)) -> list[Term]:
    """Return the clocks among terms, linear about some standard deviations of their priors.

    A sixth of a period away from a delay nothing looks likely by first order; of a delay one deviation is a tenth.
    """
    return [linear_about(problem, [t], start * t.columns.spread)[0] for t in terms if t.clock
            for size in starts for start in (-size, size)]


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

    At most `steps` are made, until each is within `accuracy` standard deviations; if they do not get there it is the
    set to first order: linear about another number a clock is none, but smooths.
    """
    found = solve_set(problem, terms, sizes, rules, present)
    last: FloatArray | None = None
    for _ in range(steps):
        about, estimate, std = clock_numbers(problem, found).T
        off = estimate - about
        if np.all(np.abs(off) < accuracy * std):
            return found
        step = off
        if last is not None:
            slope = (off - last[1]) / np.where(about == last[0], np.inf, about - last[0])
            step = np.where(slope < 0.0, -off / np.where(slope < 0.0, slope, 1.0), off)
        last = np.array([about, off])
        found = solve_set(problem, linear_about(problem, terms, about + step), found.posterior.sizes, rules, present)
    return solve_set(problem, linear_about(problem, terms, np.zeros(about.size)), sizes, rules, present)


def clock_numbers(problem: EquationError, candidate: Candidate) -> FloatArray:
    """Return of each clock in a set the number about which it is linear, its estimate and its standard deviation.

    The estimate takes over what the phase of the nominal force had taken. Shape (numbers, 3).
    """
    found, mean, std = [], candidate.posterior.mean, candidate.posterior.std
    phase = {label.split("|")[1]: value for label, value in zip(problem.labels, mean) if "force_phase" in label}
    for term, at in placed(problem, candidate.terms):
        if term.clock:
            place = problem.model.dofs.index(term.active.dof) if term.active.dof else 0
            late = phase.get(term.active.dof, 0.0) / natural_frequency(problem.model, place)
            found += [(about, value + late, deviation) for about, value, deviation
                      in zip((term.active.values[name] for name in term.strengths), mean[at], std[at])]
    return np.array(found).reshape(-1, 3)


def linear_about(problem: EquationError, terms: Sequence[Term], numbers: FloatArray) -> tuple[Term, ...]:
    """Return terms with their clocks linear about these numbers, one clock's after the other's."""
    found, at = [], 0
    for term in terms:
        if term.clock:
            values = dict(zip(term.strengths, map(float, numbers[at:])))
            at += len(values)
            term = with_numbers(problem, term, values) or term
        found.append(term)
    return tuple(found)
