"""When something that is not in the model pushes, holds or stops a body in a decay: a free body gains no energy."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import binary_opening, maximum_filter1d
from scipy.signal import fftconvolve

from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import natural_modes
from radiation_ss.body.model import Model
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import since_release
from radiation_ss.simulation.linear import radiation_states
from radiation_ss.simulation.spikes import without_spikes

Span = tuple[float, float]


@dataclass(frozen=True)
class PushRules:
    """What no free body does, whatever its model lacks."""

    gain: float = 1.5  # Times its energy, over a period of its slowest motion, that a body has again after it had less
    share: float = 0.1  # Of the largest energy that it reaches then: less may be waves that are left in the tank
    forced: float = 0.5  # Least force that the model does not have, of the largest one: what drag and stiffness are off
    slight: float = 0.01  # Share of the energy that is rest
    witness: float = 2.0  # Periods in which a body moves as the model before something stops it
    larger: float = 2.0  # Times the largest force before that stops a body: what resists a motion falls with it
    samples: int = 48  # A period of the fastest motion


@dataclass(frozen=True)
class Course:
    """Energy of a motion and what the model's equation lacks, averaged over half a period of the fastest motion."""

    time: FloatArray
    energy: FloatArray  # [J]
    lacking: FloatArray  # Force that is not in the model, as the root of the energy to which it would load the body
    period: float  # Of the slowest motion [s]
    step: float

    @property
    def whole(self) -> int:
        """Samples of a period."""
        return int(np.ceil(self.period / self.step))


def let_go(model: Model, record: Record, rules: PushRules = PushRules()) -> tuple[Record, tuple[str, ...]]:
    """Return a decay from its release on, and a sentence on each time in which something not in the model acts.

    Where that acts later its motions are empty; where it acts to the end, the record ends. What the model says of the
    motion is needed for a body that is pushed, not for one that is held and then let go (`since_release`).
    """
    course = _course(model, record, rules) if record.kind == "decay" else None
    first, last = record.time[0], record.time[-1]
    acts = [(start, end if end < last - course.period else np.inf) for start, end in _acting(course, rules)
            ] if course else []
    if not course or not acts or (acts[0][0] <= first and acts[0][1] > last):
        return since_release(record)
    said, given = list[str](), record
    record, held = since_release(record) if acts[0][0] > first else (record, ())
    for i, (start, end) in enumerate(acts):
        if end < last:  # to the sample, where the body is held before
            later = acts[i + 1][0] if i + 1 < len(acts) else np.inf
            end = max(end, float(since_release(given.window(end - 0.5 * course.period, later))[0].time[0]))
        if start <= first:
            record = record.window(end, np.inf)
            said.append(f"{record.name}: the body is pushed and held until {end:.4g} s; the record is taken from "
                        "there.")
            continue
        until = f"to {end:.4g} s" if end < last else "on"
        said.append(f"{record.name}: a force that is not in the model acts from {start:.4g} s {until}; that is left "
                    "out.")
        # What is not measured for more than half a period parts a record.
        record = _without(record, min(start, end - 0.55 * course.period), end)
    return record, (*held, *said)


def _without(record: Record, start: float, end: float) -> Record:
    """Return a record without its motions between two times, or without its end."""
    if end > record.time[-1]:
        return record.window(-np.inf, start)
    out = (record.time > start) & (record.time < end)
    return record.with_channels(**{name: np.where(out, np.nan, values) for name, values in record.channels.items()
                                   if not name.endswith("_force")})


def _course(model: Model, record: Record, rules: PushRules) -> Course | None:
    """Return the course of energy; None if a motion is not measured or the model restores none: then it is unknown."""
    periods = natural_modes(model).period
    restored = np.isfinite(periods)
    rows = without_spikes(record, float(periods.min()))[0].get("displacement", model.dofs) if restored.any() else None
    there = np.zeros(0, dtype=bool) if rows is None else np.all(np.isfinite(rows), axis=0)
    if rows is None or there.sum() < 16:
        return None
    time, step = record.time[there], float(periods[restored].min()) / rules.samples
    at = np.arange(time[0], time[-1], step)
    if at.size < 2 * rules.samples or at.size > 100 * time.size:
        return None
    x = CubicSpline(time, rows[:, there], axis=1)(at)
    memory = model.fit.c @ radiation_states(model, x, step)
    place, speed, rate = _averages(x, rules.samples // 2, step)
    radiated = _averages(memory, rules.samples // 2, step)[0]
    inertia, stiff = model.M + model.A_inf, np.diag(model.C)[restored, None]
    rest = inertia @ rate + model.D @ speed + model.C @ place + radiated
    # The sensor's zero may be off; or the body is held away from it at last.
    ends = np.median(x[:, -(at.size // 5):], axis=1, keepdims=True)
    zeros = (np.zeros_like(ends), ends)
    loads = [0.5 * np.sum((rest - model.C @ zero)[restored] ** 2 / stiff, axis=0) for zero in zeros]
    best = int(np.argmin([np.median(load) for load in loads]))
    place = place - zeros[best]
    energy = 0.5 * (np.sum(place * (model.C @ place), axis=0) + np.sum(speed * (inertia @ speed), axis=0))
    middle = at[rules.samples // 4:][:energy.size]
    return Course(middle, energy, np.sqrt(loads[best]), float(periods[restored].max()), step)


def _averages(x: FloatArray, count: int, step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return means of motions over `count` samples by (1 - cos)^2, and the first and the second derivatives of these.

    The weights are derived in place of the motion: noise is not differentiated.
    """
    phase, pace = 2.0 * np.pi * (np.arange(count) + 0.5) / count, 2.0 * np.pi / (count * step)
    weights = ((1.0 - np.cos(phase)) ** 2, 2.0 * pace * (1.0 - np.cos(phase)) * np.sin(phase),
               2.0 * pace**2 * (np.cos(phase) - np.cos(2.0 * phase)))
    found = [fftconvolve(x, w[None] / (1.5 * count), mode="valid", axes=1) for w in weights]
    return found[0], found[1], found[2]


def _acting(course: Course, rules: PushRules) -> Iterator[Span]:
    """Yield when something pushes the body: its energy rises by a force that is not in the model; or stops it."""
    energy, most = course.energy, maximum_filter1d(course.energy, course.whole)
    top = float(energy.max())
    forced = (course.lacking > rules.forced * np.sqrt(np.maximum(energy, rules.slight * top)))
    # What is off for a sample is off for half a period of the averages.
    lasting, begin = binary_opening(forced, np.ones(rules.samples // 2 + 1)), 0
    for low, high in _rises(most, rules.gain, rules.share * top):
        pushed = np.flatnonzero(lasting[low:high + course.whole // 2]) + low
        if not pushed.size:
            continue
        last = int(pushed[-1])
        while low > begin and lasting[low]:
            low -= 1
        while last + 1 < energy.size and lasting[last + 1]:
            last += 1
        if energy[begin:low + 1].max() < rules.share * top:  # at rest before
            yield -np.inf if not begin else course.time[begin], course.time[last]
        else:
            stop = _stopped(course, forced, begin, low, rules)
            yield course.time[low if stop is None else stop], course.time[last]
        begin = last + 1
    stop = _stopped(course, forced, begin, energy.size - 1, rules)
    if stop is not None and energy.size - stop > course.whole // 2:
        yield course.time[stop], np.inf


def _rises(most: FloatArray, gain: float, least: float) -> Iterator[tuple[int, int]]:
    """Yield the lowest and the highest place of each rise by a factor `gain` and above `least`."""
    low = high = 0
    rising = False
    for k, value in enumerate(most):
        if rising:
            high = k if value > most[high] else high
            if value * gain < most[high]:
                yield low, high
                rising, low = False, k
        elif value < most[low]:
            low = k
        elif value > max(gain * most[low], least):
            rising, high = True, k
    if rising:
        yield low, high


def _stopped(course: Course, forced: NDArray[np.bool_], begin: int, end: int, rules: PushRules) -> int | None:
    """Return when a body that moves as the model is stopped at once and then rests or is held; None if it is not."""
    half, lacking = course.whole // 2, course.lacking
    after = np.flatnonzero(forced[begin + half:end]) + begin + half
    if not after.size or (at := int(after[0])) - begin < rules.witness * course.whole:
        return None
    sudden = lacking[at:at + half].max() > rules.larger * lacking[begin + half:at - half].max()
    free = ~forced[at:end] & (course.energy[at:end] > rules.slight * course.energy.max())
    return at if sudden and not binary_opening(free, np.ones(half)).any() else None
