"""Numbers that stand for missing samples: -999 and its kin, once or often, and others that recur far from the rest."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.records.columns import channel_unit
from radiation_ss.records.record import Record
from radiation_ss.units import UNITS, in_si


def check_no_codes(records: Sequence[Record]) -> None:
    """Raise InputError where a channel holds a usual code for missing samples; any other number may be a motion."""
    for record in records:
        for name in record.channels:
            factor = _unit(record, name)[1]
            for text, level in _told(record, name):
                if usual_code(level / factor):
                    raise InputError(f"record {record.name}, {text}")


def without_marks(record: Record, name: str) -> tuple[list[str], FloatArray]:
    """Return a sentence for each number of a channel that stands for missing samples, and the channel without them."""
    told, values = _told(record, name), record.channels[name]
    levels = [level for _, level in told]
    return [text for text, _ in told], np.where(np.isin(values, levels), np.nan, values) if levels else values


def _told(record: Record, name: str) -> list[tuple[str, float]]:
    """Return a sentence for each number of a channel that stands for missing samples, and the number."""
    (unit, factor), values, told = _unit(record, name), record.channels[name], []
    for level, count in _marks(values[np.isfinite(values)], factor):
        read = f" ({level / factor:g} {unit})" if unit else ""
        samples, ones = ("samples", "missing ones") if count > 1 else ("sample", "a missing one")
        told.append((f"{name}: {count} {samples} of {level:g}{read}, far from all others; does it stand for {ones}? "
                     "Leave such cells empty", level))
    return told


def _unit(record: Record, name: str) -> tuple[str, float]:
    """Return the unit that a file had a channel in, and what one of it is in SI; "" and 1 where that is SI."""
    said = re.search(rf"(?:^|[ ,;]){re.escape(name)} from ([^,;]+)", record.meta.get("converted", ""))
    si = channel_unit(name, record.units)
    factor = in_si(said[1].strip(), si) if said and si in UNITS else None
    return (said[1].strip(), factor) if said and factor else ("", 1.0)


def _marks(values: FloatArray, factor: float, far: float = 8.0, most: int = 16) -> Iterator[tuple[float, int]]:
    """Yield value and count of what stands for missing samples: at either end of `most` others or more.

    A usual code in the unit of the file may stand there once, as far away as the others range. Any other number has to
    recur and be `far` times that away.
    """
    levels, counts = np.unique(values, return_counts=True)
    first, last = 0, levels.size
    while first < last and usual_code(levels[first] / factor):
        first += 1
    while first < last and usual_code(levels[last - 1] / factor):
        last -= 1
    if last - first < most:
        return
    size = float(np.ptp(levels[first:last]))
    for k in (*range(first), *range(last, levels.size)):
        if min(abs(levels[k] - levels[first]), abs(levels[k] - levels[last - 1])) > size:
            yield float(levels[k]), int(counts[k])
    levels, counts = levels[first:last], counts[first:last]
    for end, beside, rest in ((0, 1, levels[1:]), (-1, -2, levels[:-1])):
        if rest.size >= most and counts[end] > 1 and abs(levels[end] - levels[beside]) > far * np.ptp(rest):
            yield float(levels[end]), int(counts[end])


def usual_code(value: float, alike: float = 1e-7) -> bool:
    """Return whether a number is a usual code for a missing sample, as single precision keeps it, too.

    That is one written by nines alone, two before the point or more (-99, 999.9, -9999), a power of ten from 1e10 on,
    the last number of 16 or 32 bits, or the fill value of netCDF or of well logs.

    >>> [usual_code(value) for value in (-999.0, 99.99, 1e20, -32768.0, 9.9, 998.0, 1e6)]
    [True, True, True, True, False, False, False]
    """
    size = abs(float(value))
    if not 98.0 < size < np.inf:
        return False
    decade = 10.0 ** round(np.log10(size))
    codes = [*(decade - 10.0**-places for places in range(4)), 32767.0, 32768.0, 2.0**31 - 1.0, 2.0**31, 999.25,
             9.969209968386869e36, float(np.finfo(np.float32).max), *([decade] if decade >= 1e10 else [])]
    return any(abs(size - code) <= alike * code for code in codes)
