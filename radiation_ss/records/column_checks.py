"""Whether the columns of one degree of freedom are each other's derivatives: units, signs, clocks."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import motion_unit
from radiation_ss.records.columns import RATES
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, columns_of, compared, spectrum_of, whole

FACTOR = 25.0  # between two ways to one number; degrees for radians are 57, millimetres 1000


def column_conflicts(record: Record, dof: str, rows: str = "", opposite: float = 0.8,
                     coherent: float = 0.2) -> list[str]:
    """Return a sentence for each pair of columns of a degree of freedom that are no derivatives of each other.

    `opposite`: correlation with which a turned sign is said. `coherent`: least with which two columns are one motion:
    of two sensors at rest each shows its own noise. `rows`: what the rows are called.
    """
    rows = rows or f"all {record.time.size} rows"
    have = columns_of(record, dof)
    off, turned = [], []
    both = np.flatnonzero(np.all([np.isfinite(record.channels[column]) for _, column in have], axis=0))
    if both.size < 16:
        return []
    record = record.window(record.time[both[0]], record.time[both[-1]])
    for (low, lower), (high, upper) in pairwise(have):
        omega, below = spectrum_of(record, record.channels[lower])
        above = spectrum_of(record, record.channels[upper])[1]
        factor = factor_between(omega, above, below * omega ** (high - low))
        made = below * (1j * omega) ** (high - low)
        if factor is not None:
            if max(abs(compared(above[band], made[band])[0]) for band in (band_of(omega, above), band_of(omega, made))
                   ) >= coherent:
                off.append((lower, upper, factor))
            continue
        band = band_of(omega, above)
        against = compared(above[band], made[band])[0]
        if against < -opposite and not later_rather(record, (lower, upper), high - low, (omega, made, above), against):
            turned.append(f"column {lower} or {upper}: {upper} is minus the rate of change of {lower}; the sign of one "
                          "of them is turned")
    if turned:
        return turned
    if len(off) == 2:       # both pairs: the column in the middle, if it is off alone
        (_, middle, one), (_, _, two) = off
        if 1.0 / FACTOR < one * two < FACTOR:
            return [f"column {middle}, {rows}: {one:.3g} times what {dof} and "
                    f"{dof}_acceleration say; a wrong unit? {units_text(dof, (middle,))}"]
    found = []
    for lower, upper, factor in off:
        odd = lower if lower == have[0][1] else upper  # if a third column speaks against it
        named = odd if len(have) == 3 and len(off) == 1 else f"{lower} or {upper}"
        found.append(f"column {named}, {rows}: {upper} is {factor:.3g} times the rate of change of {lower}; a wrong "
                     f"unit? {units_text(dof, (lower, upper))}")
    return found


def column_doubts(record: Record, dof: str, apart: float = 1.4, alike: float = 0.95, lines: int = 8) -> list[str]:
    """Return a sentence for each column that is another one's derivative but for time, or a factor of `apart` or more.

    Where they correlate by `alike` in the band of the motion, noise makes 5 % of that at most. Of a decay that is over
    at once the window leaves nothing: the band of what is left has less than so many `lines`; and that goes by the
    window's edge rather than by time.
    """
    dying, found = record.kind == "decay", []
    record = replace(record, kind="motion-only")  # windowed: the ends of a decay are no motion
    for (low, lower), (high, upper) in pairwise(columns_of(record, dof)):
        omega, below = spectrum_of(record, record.channels[lower])
        band, above = band_of(omega, below), spectrum_of(record, record.channels[upper])[1]
        made = below * (1j * omega) ** (high - low) * band
        correlation, times = compared(made[band], above[band])
        if band.sum() < lines:
            continue
        rate = f"the {'rate' if high - low == 1 else 'second rate'} of change of {lower}"
        if correlation <= alike and not dying:
            lag = lag_between(omega, made, above)
            correlation, times = correlation_at(record, (lower, upper), high - low, lag)
            if correlation > alike:
                found.append(f"{upper} comes {abs(lag):.3g} s {'later' if lag > 0.0 else 'earlier'} than {rate}; one "
                             "of the two is read late, or their clocks differ")
        if correlation > alike and not 1.0 / apart < times < apart:
            unit = " (in knots?)" if (upper, lower) == (f"{dof}_velocity", dof) and 1.85 < times < 2.05 else ""
            weight = upper == f"{dof}_acceleration" and motion_unit(dof) == "m" and 0.95 < 9.81 * times < 1.05
            unit = " (in g?)" if weight else unit
            found.append(f"{upper} is {times:.3g} times {rate}{unit}; {units_text(dof, (lower, upper))}")
    return found


def later_rather(record: Record, columns: tuple[str, str], order: int,
                 spectra: tuple[FloatArray, ComplexArray, ComplexArray], against: float, share: float = 0.25) -> bool:
    """Return whether time explains two columns that go `against` each other but for a share of what a sign leaves."""
    omega, made, above = spectra
    if record.kind == "decay":
        return False
    lag = lag_between(omega, made * band_of(omega, above), above)
    return 1.0 - correlation_at(record, columns, order, lag)[0] < share * (1.0 + against)


def lag_between(omega: FloatArray, one: ComplexArray, other: ComplexArray, near: float = 0.01) -> float:
    """Return by how much another signal of the same record comes later [s], by the largest correlation.

    Of regular motions many are as large, but for the share `near`: it is the shortest lag.
    """
    size, part = 2 * (omega.size - 1), 8  # lags in each sample
    alike = np.fft.irfft(np.conj(one) * other, part * size)
    lags = 2.0 * np.pi / omega[1] * np.fft.fftfreq(alike.size)
    peaks = (alike >= np.roll(alike, 1)) & (alike >= np.roll(alike, -1)) & (alike >= (1.0 - near) * alike.max())
    return float(lags[peaks][np.argmin(np.abs(lags[peaks]))])


def correlation_at(record: Record, columns: tuple[str, str], order: int, lag: float) -> tuple[float, float]:
    """Return `compared` of a column's derivative of some order and of another column that comes later by `lag` [s]."""
    first, last = record.time[0] + max(-lag, 0.0), record.time[-1] - max(lag, 0.0)
    part = record.window(first, last)
    later = np.interp(part.time + lag, record.time, whole(record.time, record.channels[columns[1]]))
    omega, below = spectrum_of(part, part.channels[columns[0]])
    band = band_of(omega, below)
    return compared(below[band] * (1j * omega[band]) ** order, spectrum_of(part, later)[1][band])


def units_text(dof: str, columns: Sequence[str]) -> str:
    """Return which units the columns of a degree of freedom have to be in."""
    units = (f"{column} in {motion_unit(dof)}{RATES[column.removeprefix(dof)]}" for column in columns)
    return f"check the units ({', '.join(units)})"


def factor_between(omega: FloatArray, one: ComplexArray, other: ComplexArray) -> float | None:
    """Return how much larger one spectrum is, if in the band of either by more than FACTOR.

    Where only one of two bands says so, one signal has something of its own there: drift, noise, slow motion.
    """
    found = [compared(other[band], one[band])[1] for band in (band_of(omega, one), band_of(omega, other))]
    if min(found) > FACTOR or 0.0 < min(found) <= max(found) < 1.0 / FACTOR:
        return float(np.sqrt(found[0] * found[1]))
    return None
