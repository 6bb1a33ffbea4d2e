"""Slow tests, without dynamics: which loads are known, which way the body came, where friction holds it."""

from itertools import pairwise

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.inference.grid import Grid, averaged
from radiation_ss.inference.sensor_noise import scatter
from radiation_ss.records.record import Record
from radiation_ss.records.signals import whole


def loads_known(model: Model, record: Record, grid: Grid) -> np.ndarray:
    """Return which samples of a static test's grid have all of its loads, (nt,): the others tell the way only."""
    force = record.get("force", model.dofs)
    missing = np.zeros(record.time.size, dtype=bool)
    for row in [] if force is None else force:
        missing |= np.isfinite(row).any() & ~np.isfinite(row)
    return averaged(np.interp(grid.even, record.time, missing.astype(float)), grid.keep) == 0.0


def slow_path(values: FloatArray, dt: float, noise: float, omega: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return the rate of a slow test, and the time that each piece of its way takes at that rate [s].

    The rate is the direction that the position last went, times one speed: a body held after a step keeps the
    direction that it came from, as its dry friction does. That has no speed of its own, so it is as in free motion, at
    `omega` [rad/s]; of a body that nothing restores, 0, the mean pace of the path. A turn is what goes back by six
    standard deviations of the noise and by a hundredth of the range.
    """
    least = least_turn(values, noise)
    way, at, ways, path = 0.0, float(values[0]), np.zeros(values.size), np.zeros(values.size)
    for k, value in enumerate(values.tolist()):
        if way * (value - at) > 0.0:
            at = value
        elif abs(value - at) > least:
            way, at = float(np.sign(value - at)), value
        ways[k], path[k] = way, at
    gone = np.abs(np.diff(path))
    pace = omega * float(np.std(values)) or float(gone.sum()) / (dt * values.size)
    return ways * pace, gone / max(pace, 1e-300)


def freely_placed(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a static test without the loads at which friction holds the body, and a sentence that says so.

    Its places stay: they tell which way the body comes to the others.
    """
    told, said = dict[str, FloatArray](), list[str]()
    for dof in model.dofs:
        places, load = record.channels.get(dof), record.channels.get(f"{dof}_force")
        if places is None or load is None or not np.isfinite(load).any() or not np.isfinite(places).any():
            continue
        x, F = (whole(record.time, values, record.time) for values in (places, load))
        held = stuck(x, F, float(np.nan_to_num(scatter(x, F)))) & np.isfinite(load)
        if held.any():
            told[f"{dof}_force"] = np.where(held, np.nan, load)
            said.append(f"Record {record.name}: at {held.sum()} of {held.size} readings {dof} stays while its load "
                        "turns, as dry friction may hold it by any force up to its own; they say which way the body "
                        "came, and of no law.")
    return record.with_channels(**told), tuple(said)


def stuck(values: FloatArray, load: FloatArray, noise: float) -> np.ndarray:
    """Return at which readings of a slow test the body stays where it was although its load goes on, (nt,).

    From where the load turns, if by the ranges of both it should have moved twice as far as `least_turn` sees. Dry
    friction holds it there by any force up to its own, so they say nothing of a law of place and direction.
    """
    least, found = least_turn(values, noise), np.zeros(values.size, dtype=bool)
    stiffness = float(np.ptp(load)) / max(float(np.ptp(values)), 1e-300)
    for first, last in pairwise(turns(load)):
        away = np.flatnonzero(np.abs(values[first:last + 1] - values[first]) > least)
        end = first + int(away[0]) if away.size else last + 1
        if abs(load[end - 1] - load[first]) > 2.0 * stiffness * least:
            found[first + 1:end] = True
    return found


def turns(values: FloatArray) -> list[int]:
    """Return where a slow signal turns, its first and last readings among them."""
    found, way, at, least = [0], 0.0, 0, least_turn(values, 0.0)
    for k, value in enumerate(values.tolist()):
        if way * (value - values[at]) > 0.0:
            at = k
        elif abs(value - values[at]) > least:
            found += [at] if at else []
            way, at = float(np.sign(value - values[at])), k
    return [*found, values.size - 1]


def least_turn(values: FloatArray, noise: float) -> float:
    """Return by how much a position has to go back to be a turn of a slow test."""
    return max(6.0 * noise, 0.01 * float(np.ptp(values)))
