"""The choice of order: the smallest that predicts held-out frequencies about as well as any."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.rational import frequency_response

Realisation = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Trial:
    """One order of the path: states of the model and relative errors on the frequencies fitted and held out."""

    order: int
    states: int
    error: float
    held_out: float


def choose_order(problem: Problem, quick: Callable[[Problem, int], Realisation],
                 full: Callable[[Problem, int], Realisation], floor: int = 6, good: float = 1e-3,
                 ) -> tuple[int, tuple[Trial, ...]]:
    """Return the order chosen on held-out frequencies, and the path.

    An order below `floor` is taken only where the fit to all samples is no worse than that of `floor`, or its relative
    error is at most `good`. `quick`, `full`: fits a problem with an order: on the path of orders, and for the
    comparison with `floor`.
    """
    out = _held_out(problem.x.size)
    training = replace(problem, x=problem.x[~out], K=problem.K[~out], weight=problem.weight[~out])

    def errors(part: Realisation, *sides: Any) -> list[float]:
        K = frequency_response(*part, problem.x * problem.rate) / np.outer(problem.scale, problem.scale)
        miss = problem.weight * (K[:, *np.triu_indices(problem.m)] - problem.K)
        size = problem.weight * problem.K
        return [float(np.linalg.norm(miss[side]) / np.linalg.norm(size[side])) for side in sides]

    def trial(order: int) -> Trial:
        part = quick(training, order)
        return Trial(order, part[0].shape[0], *errors(part, ~out, out))

    fewest = max(2 if problem.zero else 1, problem.x_points.size + 1 if problem.x_points.size else 1)
    orders = [order for order in ((2, 3, 4, 5, 6, 8, 10) if problem.m == 1 else (2, 3, 4, 6, 8))
              if fewest <= order <= problem.x.size]
    chosen, path = _walk(trial, orders)
    floor = max(floor, fewest)
    if chosen < floor <= problem.x.size:
        everything = slice(None)
        limit = max(good, *errors(full(problem, floor), everything))
        chosen = next(order for order in (*(n for n in orders if chosen <= n < floor), floor)
                      if order == floor or errors(full(problem, order), everything)[0] <= limit)
    return chosen, path


def _held_out(size: int, bands: int = 24) -> NDArray[np.bool_]:
    """Return True for the samples that are held out: every third of `bands` bands of consecutive frequencies.

    Bands and not single samples: a resonance that an order too high puts between the fitted samples shows.
    """
    band = np.arange(size) * min(bands, size) // size
    return np.asarray(band % 3 == 1)


def _walk(trial: Callable[[int], Trial], orders: Sequence[int], good: float = 0.01,
          near: float = 1.25) -> tuple[int, tuple[Trial, ...]]:
    """Try orders upwards; return the one chosen and the path.

    Chosen is the smallest order whose held-out error is at most `near` times the smallest of the path, or at most
    `good`; the path ends there, or two orders after the last that improved by a twentieth.
    """
    path: list[Trial] = []
    failure = "no order was tried"
    for order in orders:
        try:
            path.append(trial(order))
        except SolverError as error:
            failure = str(error)
            continue
        best = min(t.held_out for t in path)
        if best <= good or (len(path) > 2 and min(t.held_out for t in path[-2:]) > 0.95 * min(
                t.held_out for t in path[:-2])):
            break
    if not path:
        raise SolverError(f"no order could be fitted: {failure}")
    limit = max(near * min(t.held_out for t in path), good)
    return next(t.order for t in path if t.held_out <= limit), tuple(path)
