"""The choice of order: the smallest that predicts held-out frequencies about as well as any."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiation_ss.errors import SolverError

ORDERS, JOINT_ORDERS = (2, 3, 4, 5, 6, 8, 10), (2, 3, 4, 6, 8)
GOOD, NEAR = 0.01, 1.25
BANDS = 24


@dataclass(frozen=True)
class Trial:
    """One order of the path: states of the model and relative errors on the frequencies fitted and held out."""

    order: int
    states: int
    error: float
    held_out: float


def held_out(size: int) -> NDArray[np.bool_]:
    """Return True for the samples that are held out: every third of `BANDS` bands of consecutive frequencies.

    Bands and not single samples: a resonance that an order too high puts between the fitted samples shows.
    """
    band = np.arange(size) * min(BANDS, size) // size
    return np.asarray(band % 3 == 1)


def walk(trial: Callable[[int], Trial], orders: Sequence[int]) -> tuple[int, tuple[Trial, ...]]:
    """Try orders upwards; return the one chosen and the path.

    Chosen is the smallest order whose held-out error is at most `NEAR` times the smallest of the path, or at most
    `GOOD`; the path ends there, or two orders after the last that improved by a twentieth.

    Raises
    ------
    SolverError
        If no order could be fitted.
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
        if best <= GOOD or (len(path) > 2 and min(t.held_out for t in path[-2:]) > 0.95 * min(
                t.held_out for t in path[:-2])):
            break
    if not path:
        raise SolverError(f"no order could be fitted: {failure}")
    limit = max(NEAR * min(t.held_out for t in path), GOOD)
    return next(t.order for t in path if t.held_out <= limit), tuple(path)
