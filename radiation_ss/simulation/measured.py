"""What a record shows of the free motion of a body: without spikes, clipped samples and the time before a release,
and how far from its ends the force of the elevation is known.
"""

import numpy as np
from scipy.fft import dct

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.hydro.data import HydroData, motion_unit
from radiation_ss.records.faults import without_faults
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import without_dead, without_gravity
from radiation_ss.records.signals import middle, only_noise, spectrum_of
from radiation_ss.simulation.headings import force_of_waves
from radiation_ss.simulation.pushes import let_go
from radiation_ss.simulation.spikes import without_spikes, without_spikes_of_force


def measured_freely(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a record without dead sensors, gravity, clipped samples, spikes and what is before a release, and what was
    said.
    """
    fastest = max(natural_frequency(model, i) for i in range(model.n))
    said: tuple[str, ...] = ()
    for clean in (without_dead, without_gravity, without_faults,
                  lambda given: without_spikes(given, 2.0 * np.pi / fastest),
                  lambda given: without_spikes_of_force(model, given), lambda given: let_go(model, given)):
        record, more = clean(record)
        said += more
    return record, said


def measured_driven(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a record of a prescribed motion without spikes of its forces and what these hang at, and what was said.

    The motion is the rig's: it may be held, turned and stopped at once.
    """
    record, said = without_faults(record, motions=False)
    record, more = without_spikes_of_force(model, record)
    return record, (*said, *more)


def drifting(model: Model, record: Record, far: float = 3.0) -> tuple[str, ...]:
    """Return a sentence for each motion that nothing restores and whose trend is `far` deviations of the rest."""
    said = []
    for i, dof in enumerate(model.dofs):
        values = record.channels.get(dof)
        if record.kind != "waves" or model.C[i, i] != 0.0 or values is None or np.isfinite(values).sum() < 16:
            continue
        there = np.isfinite(values)
        time = record.time[there] - record.time[there][0]
        speed, first = np.polyfit(time, values[there], 1)
        way, unit = speed * time[-1], motion_unit(dof)
        if abs(way) > far * float(np.std(values[there] - speed * time - first)):
            said.append(f"Record {record.name}: {dof} drifts by {way:.3g} {unit} ({speed:.3g} {unit}/s): a mean force "
                        "of second order in the waves, or a current, that a linear model does not have; it is no gap "
                        "of the coefficients.")
    return tuple(said)


def pace(model: Model, record: Record, i: int) -> float:
    """Return the natural frequency of a motion [rad/s]; if nothing restores it that in the record, 0 for noise."""
    values = record.channels.get(model.dofs[i])
    if model.C[i, i] > 0.0:
        return natural_frequency(model, i)
    if (values is None or np.isfinite(values).sum() < 16 or np.nanstd(values) == 0.0 or only_noise(record, values)):
        return 0.0
    return middle(*spectrum_of(record, values))


def power_of(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return circular frequencies [rad/s] and power of a signal without its mean. Of its even extension, which has no
    jumps at the ends: a window would take the start of a record, where a decay has all of its motion.
    """
    there, dt = np.isfinite(values), float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], dt), time[there], values[there])
    count = even.size // 2
    power = (dct(even - even.mean()) ** 2)[: 2 * count].reshape(count, 2).sum(axis=1)
    return np.asarray(np.pi * (2.0 * np.arange(count) + 0.5) / (even.size * dt)), np.asarray(power)


def unsure_edge(model: Model, record: Record, *, periods: float = 1.5, longest: float = 1.0 / 6.0) -> float:
    """Return how much of a record's ends [s] has an unsure force, where it comes from the elevation; else 0.

    At least 1.5 wave `periods`. X = int h(t) e^(-i w t) dt gives the mean square time over which the memory h of this
    sea's force reaches, sum S |dX/dw|^2 / sum S |X|^2 (Parseval); an even one reaches sqrt(3) times its root.
    `longest`: share of a record that is left out at either end at most.
    """
    if not record.force_from_elevation(model.dofs) or not np.nanstd(record.channels["wave_elevation"]) > 0.0:
        return 0.0
    least = periods * 2.0 * np.pi / mean_frequency(record.time, record.channels["wave_elevation"])
    length = float(record.time[-1] - record.time[0])
    return min(max(least, np.sqrt(3.0) * reach(model, record)), longest * length)


def reach(model: Model, record: Record, slight: float = 1e-6) -> float:
    """Return the standard deviation [s] of the memory of the sea's force about the time itself; the longest one. A
    force of less than the share `slight` of the largest one's power is rounding.
    """
    known = model.hydro
    if known is None or known.X is None or known.omega.size < 2:
        return 0.0
    X = force_of_waves(model, record)
    slope = np.gradient(X, known.omega, axis=0)
    sea = sea_powers(known, record)[:, None] * np.gradient(known.omega)[:, None]
    power, moment = np.sum(sea * np.abs(X) ** 2, axis=0), np.sum(sea * np.abs(slope) ** 2, axis=0)
    counts = power > slight * max(float(power.max()), 1e-300)
    return float(np.sqrt(np.max(moment[counts] / power[counts]))) if counts.any() else 0.0


def coarse_excitation(model: Model, record: Record, *, turn: float = 1.0, share: float = 0.05,
                      slight: float = 1e-6) -> tuple[str, ...]:
    """Return a sentence for each degree of freedom whose X turns too far between frequencies that the sea has. By
    `turn` [rad]: at .8 a cubic is off by 1 %, at 2 by half; with a `share` of the force's power; `slight` is rounding.
    """
    known = model.hydro
    if known is None or known.X is None or known.omega.size < 2 or not record.force_from_elevation(model.dofs):
        return ()
    said = []
    X, sea, omega = force_of_waves(model, record), sea_powers(known, record), known.omega
    powers = sea[:, None] * np.abs(X) ** 2
    between = 0.5 * (powers[1:] + powers[:-1]) * np.diff(omega)[:, None]
    turns = np.abs(np.angle(X[1:] * X[:-1].conj()))
    totals = np.sum(between, axis=0)
    for i, dof in enumerate(model.dofs):
        far = turns[:, i] > turn
        if totals[i] > slight * totals.max() and between[far, i].sum() > share * totals[i]:
            k = int(np.argmax(np.where(far, between[:, i], 0.0)))
            said.append(f"X of {dof} turns by {turns[k, i]:.1f} rad between {omega[k]:.3g} and {omega[k + 1]:.3g} "
                        f"rad/s: too coarse for the sea of {record.name}; give X at more frequencies.")
    return tuple(said)


def sea_powers(known: HydroData, record: Record) -> FloatArray:
    """Return the elevation's power at the frequencies of X, each the mean over half the way to its neighbours."""
    omega, spectrum = spectrum_of(record, record.channels["wave_elevation"])
    middles = 0.5 * (known.omega[1:] + known.omega[:-1])
    edges = np.concatenate([[known.omega[0]], middles, [known.omega[-1]]])
    cumulated = np.concatenate([[0.0], np.cumsum(np.abs(spectrum) ** 2)])
    at = np.concatenate([omega, [2.0 * omega[-1] - omega[-2]]]) - 0.5 * omega[1]
    return np.asarray(np.diff(np.interp(edges, at, cumulated)) / np.maximum(np.diff(edges), 1e-300))


def mean_frequency(time: FloatArray, values: FloatArray, floor: float = 0.0) -> float:
    """Return the mean circular frequency of a signal's power spectrum where it is above `floor` of its peak [rad/s]."""
    omega, power = (part[1:] for part in power_of(time, values))
    power = np.where(power > floor * power.max(initial=0.0), power, 0.0)
    return float(np.sum(omega * power) / max(power.sum(), 1e-300))
