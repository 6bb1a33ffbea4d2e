"""Readings that are not the motion's: clipped, of a sensor that hangs, or of one that is slower than the log."""

from collections.abc import Callable, Mapping
from math import comb

import numpy as np
from scipy.stats import binom

from radiation_ss.arrays import FloatArray
from radiation_ss.records.record import Record

FINEST = 1e-6  # of a channel's range: what is finer is rounding of a computed signal, no sensor's noise
TO_NORMAL = 1.4826  # median of absolute values to standard deviation
Find = Callable[[str, FloatArray, FloatArray], Mapping[str, np.ndarray]]  # of name, times [s] and readings
FAULTS = {"slower": "repeat the one before them: the sensor is slower than the log",
          "clipped": "are clipped: what the motion did beyond the sensor's range is not measured",
          "hanging": "repeat the one before them: the sensor hangs"}


def without_faults(record: Record, *, motions: bool = True) -> tuple[Record, tuple[str, ...]]:
    """Return the record without samples that are clipped or of a sensor that hangs or is slow, and what was done.

    Of forces and the elevation only what hangs; of these alone if not `motions`.
    """
    return left_out(record, lambda name, _, values: {
        f"{FAULTS[fault]}; left out": places for fault, places in faults(name, values).items()
        if (fault == "hanging" if drives(name) else motions)})


def drives(name: str) -> bool:
    """Whether a channel is what moves the body and no motion: a force or the wave elevation."""
    return name.endswith("_force") or name == "wave_elevation"


def left_out(record: Record, find: Find, most: int = 12) -> tuple[Record, tuple[str, ...]]:
    """Return the record without the readings whose places `find` gives by what is said of them: up to
    `most` of their times, or the first.
    """
    changed, said = dict[str, FloatArray](), list[str]()
    for name, values in record.channels.items():
        there = np.flatnonzero(np.isfinite(values))
        if there.size < 2:
            continue
        for what, places in find(name, record.time[there], values[there]).items():
            if places.size:
                changed.setdefault(name, np.array(values))[there[places]] = np.nan
                times = record.time[there[places]]
                first = "" if times.size <= most else "the first "
                at = ", ".join(f"{t:.4g}" for t in (times[:1] if first else times))
                said.append(f"{name} of {record.name}: {places.size} of {there.size} samples {what} ({first}at {at} "
                            "s).")
    return (record.with_channels(**changed) if changed else record), tuple(said)


def faults(name: str, values: FloatArray, repeats: int = 4) -> dict[str, np.ndarray]:
    """Return the places of readings that are not the motion's, by what is wrong there, as in `FAULTS`.

    A sensor that is slower than the log has nothing new in most of its readings. One that hangs repeats its reading
    `repeats` times or more, which neither the motion nor its range makes it do: what sticks has a velocity of zero. Nor
    does its own noise let it. A force may be held and stepped at once: of one its noise alone tells, and none that is
    zero or comes back to what it was held at before.
    """
    again = logged_again(values)
    new = np.delete(np.arange(values.size), again)
    ends = [level for _, level, _ in clipped(values[new])]
    lawful = ends + [0.0] * name.endswith(("_velocity", "_acceleration", "_force"))
    frozen, held = noiseless(values[new], repeats), sudden(values[new], repeats)
    if drives(name):
        levels, counts = np.unique([values[new[first]] for first, _ in frozen], return_counts=True)
        lawful += levels[counts > 1].tolist()
    if name.endswith("_force"):
        held, again, ends = [], again[:0], []
    hanging = [np.arange(first + 1, end) for first, end in sorted({*frozen, *held}) if values[new[first]] not in lawful]
    return {"slower": again, "clipped": new[np.isin(values[new], ends)],
            "hanging": new[np.concatenate([np.zeros(0, dtype=int), *hanging])]}


def logged_again(values: FloatArray, clear: float = 4.0) -> np.ndarray:
    """Return the places that repeat the reading before them, where most readings are repeated at once and the steps
    between them are `clear` of the smallest: not so by a coarse converter's.
    """
    steps = np.diff(values)
    edges, size = np.flatnonzero(steps), np.abs(steps[steps != 0.0])
    if edges.size < 2 or np.median(np.diff(edges)) < 2.0 or np.median(size) < clear * np.diff(np.unique(values)).min():
        return np.zeros(0, dtype=int)
    return np.flatnonzero(steps == 0.0) + 1


def sudden(values: FloatArray, repeats: int, beside: int = 8, sharper: float = 2.0) -> list[tuple[int, int]]:
    """Return first and end of each run of `repeats` equal values or more that begins with a bend `sharper` times as
    sharp as any of the `beside` bends before, or ends with a jump. What is held or sticks does both gently.

    What the record begins with does not count: a body may be at rest until it is struck.
    """
    edges = np.flatnonzero(np.diff(values)) + 1
    if edges.size == 0:
        return []
    quantum = float(np.diff(np.unique(values)).min())
    bend = np.abs(np.diff(values, 2, prepend=values[0], append=values[-1]))

    def sharp(size: float, there: FloatArray) -> bool:
        return there.size == beside and size > sharper * (float(there.max()) + 1.5 * quantum)

    found = []
    for first, end in zip(edges, np.append(edges[1:], values.size)):
        if end - first < repeats:
            continue
        leaving = np.abs(np.diff(values[end - 1: end + 2]))
        jumps = leaving.size == 2 and leaving[0] > sharper * leaving[1]
        stops = sharp(float(bend[first - 1: first + 1].max()), bend[max(first - beside - 2, 0): first - 2])
        if stops or (jumps and sharp(float(bend[end - 1]), bend[end + 1: end + 1 + beside])):
            found.append((int(first), int(end)))
    return found


def noiseless(values: FloatArray, repeats: int, beside: int = 48, least: int = 16,
              unlikely: float = 1e-3) -> list[tuple[int, int]]:
    """Return first and end of each run of `repeats` equal values or more that the noise of the `beside` values before
    it makes `unlikely` in the whole record; fewer than `least` tell no noise, as in what a record begins with.
    """
    edges = np.flatnonzero(np.diff(values)) + 1
    if edges.size == 0:
        return []
    quantum = max(float(np.diff(np.unique(values)).min()), FINEST * float(np.ptp(values)))
    found, shown = list[tuple[int, int]](), np.full(values.size, True)
    for first, end in zip(edges, np.append(edges[1:], values.size)):
        if end - first < repeats:
            continue
        before = values[:first][shown[:first]][-beside:]
        chance = repeated_by_chance(before, quantum) if before.size >= least else 1.0
        if values.size * chance ** (end - first - 1) < unlikely:
            found.append((int(first), int(end)))
            shown[first + 1: end] = False
    return found


def repeated_by_chance(values: FloatArray, quantum: float, order: int = 6, resolved: float = 1.0,
                       white: float = 1.5) -> float:
    """Return with which probability noise as in some readings lets the next repeat the last; 1 where they show none.

    Two readings of white noise of deviation s round to one level q with q / (2 sqrt(pi) s) at most. In high differences
    noise outweighs the motion, and each next one is nearly twice as large; of what is smooth it is smaller. `resolved`:
    deviations in levels that are no rounding, which has 12^(-1/2). `white`: ratio of the differences.
    """
    differences = np.diff(values, order)
    noise = TO_NORMAL * float(np.median(np.abs(differences))) / np.sqrt(comb(2 * order, order))
    if noise < resolved * quantum or np.std(np.diff(differences)) < white * np.std(differences):
        return 1.0
    shown = (np.count_nonzero(np.diff(values) == 0.0) + 1.0) / (values.size + 1.0)
    return float(max(quantum / (2.0 * np.sqrt(np.pi) * noise), shown))


def clipped(values: FloatArray, unlikely: float = 1e-3) -> list[tuple[str, float, int]]:
    """Return (side, level, count) where the record stays on its extreme value more than a smooth signal can.

    Time between levels grows with the square root of the distance: the top level of a quantised signal holds at most
    1/(sqrt(2) - 1) = 2.4 times the samples of the next, and the finer the levels the fewer; that there are so many by
    chance must be `unlikely`. The very start does not count: a decay test starts from rest.
    """
    levels = np.unique(values)
    if levels.size == 1:
        return []
    quantum = float(np.diff(levels).min())
    step = max(quantum, 0.005 * float(np.ptp(values)))
    found, sharply = [], {float(values[first]) for first, _ in sudden(values, 2)}
    for side, sign in (("a maximum", 1.0), ("a minimum", -1.0)):
        x = sign * values
        top = x.max()
        at_top = x == top
        at_top[: int(np.argmin(at_top))] = False
        count = int(at_top.sum())
        beside = int(((x < top) & (x >= top - 1.001 * step)).sum())
        runs = int((np.diff(at_top.astype(int)) == 1).sum())
        by_chance = float(binom.sf(count - 1, count + beside, np.sqrt(quantum / (quantum + step))))
        if sign * top in sharply and count > 2 * runs and count > 3 * beside and by_chance < unlikely:
            found.append((side, sign * float(top), count))
    return found
