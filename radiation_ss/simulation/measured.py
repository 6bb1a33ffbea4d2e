"""What a record shows of the free motion of a body: without spikes, clipped samples and the time before a release,
and how far from its ends the force of the elevation is known.
"""

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct

from radiation_ss.arrays import FloatArray, lagrange
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.hydro.data import HydroData, motion_unit
from radiation_ss.records.faults import TO_NORMAL, drives, left_out, without_faults
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import since_release, without_dead, without_gravity
from radiation_ss.records.signals import middle, only_noise, spectrum_of
from radiation_ss.simulation.headings import force_of_waves


def measured_freely(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a record without dead sensors, gravity, clipped samples, spikes and what is before a release, and what was
    said.
    """
    fastest = max(natural_frequency(model, i) for i in range(model.n))
    said: tuple[str, ...] = ()
    for clean in (without_dead, without_gravity, without_faults,
                  lambda given: without_spikes(given, 2.0 * np.pi / fastest), since_release):
        record, more = clean(record)
        said += more
    return record, said


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


SIDE, DEGREE = 6, 5  # samples on each side of a spike, and the polynomial through them
BESIDE = 16  # samples on each side from which the noise at its place is taken


@dataclass(frozen=True)
class SpikeRules:
    """What makes a sample a spike."""

    apart: float = 8.0  # Standard deviations of the noise that it stands out of a smooth motion
    surer: float = 5.0  # Standard deviations by which it must explain its place better than a blow does
    clearer: float = 4.0  # Times more that the best blow must leave, where noise is no measure
    most: float = 0.02  # Largest share of all samples; where more stand apart, that is how the motion is
    resolved: float = 6.0  # Samples in a period: three in each swing
    # Where a blow may be: first and last place and step, in samples from the spike
    blows: tuple[float, float, float] = (-2.0, 2.0, 0.25)


def without_spikes(record: Record, period: float, rules: SpikeRules = SpikeRules()) -> tuple[Record, tuple[str, ...]]:
    """Return the record without samples of displacement and velocity that stand apart, and a sentence for each channel.

    An accelerometer may show a blow as one sharp sample: it stays; so does a motion with fewer than `rules.resolved`
    samples in the model's shortest natural `period` [s].
    """
    def find(name: str, time: FloatArray, values: FloatArray) -> dict[str, np.ndarray]:
        if (drives(name) or name.endswith("_acceleration") or time.size < 4 * SIDE
                or rules.resolved * float(np.median(np.diff(time))) > period):
            return {}
        return {"stand apart from their neighbours and are left out": spikes(time, values, rules)}

    return left_out(record, find)


def spikes(t: FloatArray, x: FloatArray, rules: SpikeRules) -> np.ndarray:
    """Return the places of the samples x at t that stand apart from those before and after them.

    They are far from the cubic through two neighbours on either side, by the noise of the record and around them
    (Hampel's rule). A blow gives sharp places, too: a spike must explain its place better than a corner or a step.
    """
    apart = from_neighbours(t, x)
    noise = noise_around(x, apart)
    size = np.abs(apart)
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(size, 2), 5).max(axis=1)
    doubtful = np.flatnonzero((size == highest) & (size > rules.surer * noise))
    if doubtful.size > rules.most * x.size + 1.0:
        return np.zeros(0, dtype=int)
    for _ in range(2):  # beside all that are doubtful, then beside those only that turn out to be spikes
        sure = [k for k in doubtful if is_spike(t, x, int(k), float(noise[k]), doubtful, rules)]
        doubtful = np.array(sure, dtype=int)
    return doubtful


def from_neighbours(t: FloatArray, x: FloatArray) -> FloatArray:
    """Return how far each sample is from the cubic through its neighbours, over what unit noise makes of it."""
    found = np.zeros(x.size)
    beside, step = np.arange(2, x.size - 2)[:, None] + [-2, -1, 1, 2], float(np.median(np.diff(t)))
    weights = lagrange(t[beside], t[2:-2])
    distance = x[2:-2] - np.sum(weights * x[beside], axis=1)
    whole = t[4:] - t[:-4] < 6.0 * step
    found[2:-2] = np.where(whole, distance / np.sqrt(1.0 + np.sum(weights**2, axis=1)), 0.0)
    return found


def noise_around(x: FloatArray, apart: FloatArray) -> FloatArray:
    """Return the noise's standard deviation at each sample: of the record or of its surroundings, or a level of a
    coarse quantisation, whichever is largest.
    """
    size = np.abs(apart)
    moved = size[size > 1e-12 * np.ptp(x)]
    levels = np.diff(np.unique(x))
    levels = levels[levels > 1e-9 * np.ptp(x)]
    everywhere = max(TO_NORMAL * float(np.median(moved)) if moved.size else 0.0,
                     float(levels.min()) if levels.size else 0.0)
    padded = np.pad(size, BESIDE, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * BESIDE + 1)
    others = np.abs(np.arange(-BESIDE, BESIDE + 1)) > 2
    return np.maximum(everywhere, TO_NORMAL * np.median(around[:, others], axis=1))


def is_spike(t: FloatArray, x: FloatArray, k: int, noise: float, others: np.ndarray, rules: SpikeRules) -> bool:
    """Whether one sample apart of a smooth motion explains a place, and a corner or a step does not; others are left
    out.
    """
    near = np.setdiff1d(np.arange(max(k - 2 * SIDE, 0), min(k + 2 * SIDE + 1, x.size)), others)
    before, after = near[near < k][-SIDE:], near[near > k][:SIDE]
    if min(before.size, after.size) < SIDE:
        return False
    around = np.concatenate([before, [k], after])
    step = float(np.median(np.diff(t[around])))
    at = (t[around] - t[k]) / step
    if np.ptp(at) > 3.0 * SIDE:
        return False
    smooth, y = np.vander(at / SIDE, DEGREE + 1), x[around]
    spike = left(smooth, (at == 0.0).astype(float), y)
    first, last, pace = rules.blows
    blows = [np.maximum(at - where, 0.0) for where in np.arange(first, last + 0.5 * pace, pace)]
    blows += [(at > where).astype(float) for where in 0.5 * (at[1:] + at[:-1]) if abs(where) < 2.0]
    blow = min(left(smooth, column, y) for column in blows)
    plain = left(smooth, np.zeros(at.size), y)
    return bool(plain - spike > (rules.apart * noise) ** 2 and blow - spike > (rules.surer * noise) ** 2
                and blow > rules.clearer * spike)


def left(smooth: FloatArray, column: FloatArray, y: FloatArray) -> float:
    """Return the sum of squares that a smooth motion with one column more leaves."""
    basis = np.column_stack([smooth, column])
    return float(np.sum((y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]) ** 2))


def unsure_edge(model: Model, record: Record, *, periods: float = 1.5, longest: float = 1.0 / 6.0) -> float:
    """Return how much of a record's ends [s] has an unsure force, where it comes from the elevation; else 0.

    At least 1.5 wave `periods`. X = int h(t) e^(-i w t) dt gives the mean square time over which the memory h of this
    sea's force reaches, sum S |dX/dw|^2 / sum S |X|^2 (Parseval); an even one reaches sqrt(3) times its root.
    `longest`: share of a record that is left out at either end at most.
    """
    if not record.force_from_elevation(model.dofs):
        return 0.0
    least = periods * 2.0 * np.pi / mean_frequency(record.time, record.channels["wave_elevation"])
    length = float(record.time[-1] - record.time[0])
    if least >= longest * length:
        return 0.0
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
