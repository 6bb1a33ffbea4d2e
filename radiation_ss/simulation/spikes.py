"""Single samples of a record that stand apart: of a motion, of what moves the body, and of a load cell."""

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray, lagrange
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.faults import TO_NORMAL, drives, left_out
from radiation_ss.records.record import Record
from radiation_ss.records.signals import grid_of, whole
from radiation_ss.simulation.linear import exact_step, propagate

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
    part: float = 0.5  # Of the answer to a force that must be seen: the force or the inertia may be off by that
    # Of the natural period, to either side: where a motion is looked at for its answer to a force
    periods: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0)


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


@dataclass(frozen=True, eq=False)
class Answers:
    """What forces of one motion make of it by the model, as displacement, velocity and acceleration."""

    time: FloatArray  # (nt,) [s], even
    # (k, 3, nt): By the recorded forces without their spikes, from rest; its slope, and a free swing. Of a prescribed
    # motion none
    beside: FloatArray
    impulse: FloatArray  # (3, nt): By a unit of force at one sample, `since` the first of them [s]
    since: FloatArray  # (nt,)
    period: float  # Natural period [s]

    @classmethod
    def of(cls, model: Model, record: Record, i: int, spiky: FloatArray) -> "Answers":
        """Return the answers of motion i; `spiky` are the times of its spikes."""
        time = grid_of(record)
        (F, G), step, force = model.matrices(), time[1] - time[0], np.zeros((time.size, model.n))
        for j, dof in enumerate(model.dofs):
            values = record.channels.get(f"{dof}_force")
            if values is not None:
                kept = ~np.isin(record.time, spiky) if j == i else np.full(values.size, True)
                force[:, j] = whole(record.time, np.where(kept, values, np.nan), time)
        pulse = np.zeros_like(force)
        pulse[2, i] = 1.0
        stepped = exact_step(F, G, step)

        def motions(u: FloatArray) -> FloatArray:
            x, v = (propagate(stepped, u, np.zeros(F.shape[0]))[:, model.fit.states + k * model.n + i] for k in (0, 1))
            return np.stack([x, v, np.gradient(v, step)])

        omega = natural_frequency(model, i)
        swing = [np.tile(wave(omega * (time - time[0])), (3, 1)) for wave in (np.cos, np.sin)]
        moved = motions(force)
        beside = np.array([moved, np.gradient(moved, axis=1), *swing][:0 if record.kind == "prescribed" else 4])
        return cls(time, beside.reshape(-1, 3, time.size), motions(pulse), time - time[0] - 2.0 * step,
                   2.0 * np.pi / omega)

    def missing(self, t: FloatArray, x: FloatArray, order: int, when: float, size: float, rules: SpikeRules) -> bool:
        """Whether the motion x at times t about a force of some size at an instant has surely not its answer.

        Beside the answer goes what the other forces make, late or early and by any factor, a free swing and a
        polynomial; the answer may be late or early as a blow may, and have another factor.
        """
        smooth = np.column_stack([np.vander((t - when) / np.ptp(t), DEGREE + 1),
                                  *(np.interp(t, self.time, part[order]) for part in self.beside)])
        if t.size <= smooth.shape[1]:
            return False
        basis = np.linalg.qr(smooth[:, np.any(smooth, axis=0)])[0]
        first, last, pace = rules.blows
        late = float(np.median(np.diff(t))) * np.arange(first, last + 0.5 * pace, pace)
        made = size * np.interp(t[:, None] - when - late, self.since, self.impulse[order], left=0.0)
        rest, made = (part - basis @ (basis.T @ part) for part in (x, made))
        none = float(rest @ rest)
        noise = none / max(t.size - basis.shape[1], 1)
        there = float(np.min(np.sum((rest[:, None] - made) ** 2, axis=0)))
        some = np.max(np.maximum(rest @ made, 0.0) ** 2 / (np.sum(made**2, axis=0) + 1e-300))
        return bool(there > none + (rules.surer / rules.part) ** 2 * noise and there > rules.clearer * none
                    and some < rules.surer**2 * noise)


def without_spikes_of_force(model: Model, record: Record, rules: SpikeRules = SpikeRules()
                            ) -> tuple[Record, tuple[str, ...]]:
    """Return the record without single samples of force and wave elevation that stand apart, and a sentence each.

    A blow may last one sample: of a force it is a spike only if the motion has surely not what a blow makes of it.
    """
    def find(name: str, time: FloatArray, values: FloatArray) -> dict[str, np.ndarray]:
        if not drives(name) or time.size < 4 * SIDE or not np.ptp(values) > 0.0:
            return {}
        found = spikes(time, values, rules)
        if name == "wave_elevation" or not found.size:
            return {"stand apart from their neighbours and are left out": found}
        beside = np.delete(np.arange(values.size), found)
        sizes = values[found] - np.interp(time[found], time[beside], values[beside])
        idle = unanswered(model, record, name.removesuffix("_force"), time[found], sizes, rules)
        return {"stand apart from their neighbours, no motion answers to them, and they are left out": found[idle]}

    return left_out(record, find)


def unanswered(model: Model, record: Record, dof: str, when: FloatArray, sizes: FloatArray,
               rules: SpikeRules) -> np.ndarray:
    """Return which forces of one sample a motion surely does not answer to, by its first sensor, (spikes,).

    It is looked at for some parts of its natural period. Where nothing is measured a prescribed motion is none, and of
    any other it is not known.
    """
    rows = {order: values[0] for order, quantity in enumerate(QUANTITIES)
            if (values := record.get(quantity, [dof])) is not None and np.isfinite(values).sum() >= 4 * SIDE}
    if dof not in model.dofs or not rows:
        return np.full(when.size, dof in model.dofs and record.kind == "prescribed")
    order = min(rows)
    there = np.isfinite(rows[order])
    t, x = record.time[there], rows[order][there]
    answers, step = Answers.of(model, record, model.dofs.index(dof), when), float(np.median(np.diff(t)))
    found = np.full(when.size, False)
    for k, (at, size) in enumerate(zip(when, sizes)):
        for reach in {max(part * answers.period, SIDE * step) for part in rules.periods}:
            near = np.abs(t - at) <= reach + 0.01 * step
            if min(np.count_nonzero(near & (t < at)), np.count_nonzero(near & (t > at))) >= SIDE:
                found[k] |= answers.missing(t[near], x[near], order, at, size, rules)
    return found
