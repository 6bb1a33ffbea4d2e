"""Candidates fitted in the full model, in steps fine enough for their laws."""

from __future__ import annotations

import numpy as np

from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.fitting import Fit, fit, fit_free_noise, residual_energy
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import Setting
from radiation_ss.gap.which.candidates import FAR
from radiation_ss.gap.which.score import Score, strength_columns

ROUGH = 0.5  # error of the integrator, in standard deviations of the noise, above which the step is halved
HALVINGS = 4  # of the step, at most


def refit_term(root: Fit, item: Score, floors: tuple[float, ...], ceiling: float = np.inf) -> Fit | None:
    """Fit the root's effects and one more in the full model.

    None if the motion grows without bounds from every start in the finest steps, too: such a candidate is dropped.
    """
    terms = (*root.problem.terms, item.term)
    setting = root.problem.setting.fine_enough(terms)
    while True:
        problem = Problem(setting, terms)
        best = first_pass(problem, root, item)
        if best is not None or setting.halvings >= HALVINGS:
            break
        setting = setting.finer
    if best is None:
        return None
    return fit_free_noise(problem, floors, root.noise, best.q, ceiling=ceiling, known=best.point)


def first_pass(problem: Problem, root: Fit, item: Score) -> Fit | None:
    """Return the best of three fits after one pass; None if the motion grows without bounds in all.

    They start where the root's numbers follow the strength, to first order, for these may hold the same already; from
    the root's numbers as they are, where the first order goes astray; and from untouched ones.
    """
    at = strength_columns(problem, len(problem.terms) - 1, item.term)
    followed, kept = (problem.extend(q, root.problem) for q in (root.q + item.follows @ item.strength, root.q))
    untouched = kept.copy()
    untouched[: len(problem.setting.nominal)] = 0.0
    results = []
    for start in (followed, kept, untouched):
        start[at] = item.strength
        try:
            results.append(fit(problem, root.noise, start, passes=1))
        except SolverError:
            continue
    return min(results, key=lambda f: f.cost, default=None)


def in_fine_steps(found: Fit, floors: tuple[float, ...], halvings: int = HALVINGS) -> Fit:
    """Go on in half the step until that no longer changes the motion by what the noise would show."""
    setting = found.problem.setting
    while setting.halvings < halvings and step_error(found, floors, setting.finer) > ROUGH:
        setting = setting.finer
        try:
            found = fit_free_noise(Problem(setting, found.problem.terms), floors, found.noise, found.q)
        except SolverError:
            break
    return found


def step_error(found: Fit, floors: tuple[float, ...], finer: Setting) -> float:
    """Return how far finer steps move the readings: rms of the worst channel over its noise."""
    try:
        point = Problem(finer, found.problem.terms).at(found.q, slopes=False)
    except SolverError:
        return np.inf
    return max(np.sqrt(mean_square(a - b)) / floor
               for a, b, floor in zip(point.residuals, found.point.residuals, floors))


def members(together: list[Fit], floors: tuple[float, ...]) -> list[Fit]:
    """Return the fits of each effect of the best pair alone, started where the pair has it.

    From the null's numbers a right effect may not have got there by itself. What the pair beats by far is not polished.
    """
    if not together:
        return []
    best, found = min(together, key=residual_energy), []
    ceiling = residual_energy(best) + FAR
    for term in best.problem.terms:
        problem = Problem(best.problem.setting, (term,))
        try:
            found.append(fit_free_noise(problem, floors, best.noise, problem.extend(best.q, best.problem),
                                        ceiling=ceiling))
        except SolverError:
            continue
    return found
