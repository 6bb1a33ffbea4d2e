"""A record as the equation of motion takes it: motion, force and its noise, and sensors, on one uniform grid."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import make_smoothing_spline

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.inference.grid import Grid, averaged, fewest
from radiation_ss.inference.local_cosine import Block, blocks, samplewise, smooth
from radiation_ss.inference.readings import (
    SLOW,
    Sensor,
    channel,
    clear_up_to,
    driven_up_to,
    gauged,
    integrated,
    known_force,
    not_measured,
    second_sensors,
    slow_motions,
    still_or_waves,
    typical,
)
from radiation_ss.inference.sensor_noise import scatter
from radiation_ss.inference.slow_test import loads_known, slow_path
from radiation_ss.records.record import Record
from radiation_ss.records.signals import bridged, unread, whole
from radiation_ss.simulation.linear import left_over, radiation_states
from radiation_ss.simulation.measured import measured_freely, unsure_edge
from radiation_ss.simulation.prepared import driven_at

FINE = 10  # frequencies in each bin at which the Jacobian of the data is taken


@dataclass(frozen=True)
class Resolution:
    """How finely a record is looked at."""

    periods: float = 2.0  # Length of a test function's interval, in typical periods of the slowest motion
    harmonics: float = 3.5  # Highest frequency of a test function, in typical frequencies of the fastest motion
    samples: int = 48  # Samples a period of the fastest motion that are kept; records sampled faster are averaged
    least: int = 30  # Samples a period at least; readings farther apart are joined by a spline
    levels: int = 600  # Samples of a static test that are kept; longer ones are averaged
    # Least standard deviation of a sensor's noise, of the motion's rms: sensors are not better than that
    noise_floor: float = 2e-4
    white: float = 9.0  # Odds by prior that the noise of a motion's sensor is white
    alike: int = 64  # Intervals of a record from which they share their test functions: memory does not grow with it


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """One record's motion on a uniform grid."""

    record: Record
    time: FloatArray  # (nt,)
    # raw, x, v, a (n, nt): Displacement as measured, and motion in the span of the basis
    raw: FloatArray
    x: FloatArray
    v: FloatArray
    a: FloatArray
    # (n,): Degrees of freedom whose motion is measured, or whose force is where the motion is prescribed: they have an
    # equation. Motions that show none are held, but see `followed`
    free: np.ndarray
    force: FloatArray | None  # (n, nt): Known exciting force; the measured total force where the motion is prescribed
    # memory, radiation (n, nt), (m, nt): Radiation force and states along the motion
    memory: FloatArray
    radiation: FloatArray
    # (k, n, nt): Radiation forces that the motion before the record may have left, one standard deviation each
    transients: FloatArray
    # (k, n, nt): Slow motions that an integrated velocity or acceleration cannot tell, one standard deviation each
    lost: FloatArray
    noise: FloatArray  # (n, bins): Standard deviation a sample of white noise as strong as the displacement's there
    omega: FloatArray  # (n,): Typical circular frequency of each motion [rad/s]
    reach: FloatArray  # (n,): Highest frequency that a motion's equation is looked at [rad/s]
    clear: FloatArray  # (n,): Highest frequency of x, v and a [rad/s]: beyond it the sensor's noise is larger
    basis: list[Block]
    sensors: tuple[Sensor, ...]
    elevation: FloatArray  # (nt,): Wave elevation at the body [m]; 0 where it is not known
    envelope: FloatArray  # (nt,): Its envelope [m]
    # (4 n, nt): Velocity of the linear wave along each degree of freedom, at the body and at `DEPTHS` below it
    orbital: FloatArray
    # (n, nt - 1): What `v` lasts from each sample to the next [s]: dt, or in a static test what the way takes
    steps: FloatArray

    @property
    def prescribed(self) -> bool:
        """Whether the motion is given and the force is what a model predicts."""
        return self.record.kind in ("prescribed", "static")

    @property
    def paced(self) -> bool:
        """Whether velocities are rates; in a static test whose times are row numbers they are directions alone."""
        return self.record.kind != "static" or bool(np.any(np.diff(self.record.time) != 1.0))

    @cached_property
    def pace(self) -> FloatArray:
        """Velocities of a slow test that may not have rested at its readings, (n, nt): 0 where no time is known."""
        return self.rates(self.x)

    def rates(self, values: FloatArray) -> FloatArray:
        """Return the rates of signals (n, nt) of a slow test, see `pace`; of what is smooth of them."""
        if not self.paced or self.time.size <= 4:
            return np.zeros_like(values)
        return np.stack([make_smoothing_spline(self.time, row).derivative()(self.time) for row in values])

    @property
    def driven_alone(self) -> bool:
        """Whether a rig drives one motion, read by one sensor: its delay is one of the force, as large."""
        alone = np.count_nonzero(self.free) == 1 and not self.sensors
        return self.record.kind == "prescribed" and self.force is not None and alone

    @cached_property
    def omega_fine(self) -> FloatArray:
        """Frequencies at which the Jacobian of the data is taken [rad/s]: some in each bin, resonances are narrow.

        Of a prescribed motion the data are the force, and its Jacobian has no frequency.
        """
        if self.prescribed:
            return np.zeros(FINE)
        width = 2.0 * self.basis[0].omega[0] / FINE
        return np.asarray(width * (np.arange(FINE * self.basis[0].omega.size) + 0.5))

    @property
    def places(self) -> int:
        """Samples that the rows of its equation stand for; of a static test those whose load is known."""
        return self.basis[0].g.shape[0] if self.record.kind == "static" else self.time.size

    @property
    def kept(self) -> float:
        """Samples of the record for each of the grid's."""
        return self.dt / float(np.median(np.diff(self.record.time)))

    @cached_property
    def elevation_rate(self) -> FloatArray:
        """Slope of the wave elevation by time [m/s]."""
        return np.gradient(self.elevation, self.dt)

    @property
    def driven(self) -> bool:
        """Whether a known force drives its motion, which can then be predicted."""
        return self.force is not None and not self.prescribed

    def under_way(self, share: float = 0.2) -> bool:
        """Whether it begins with a motion at more than a share of its largest velocity: not at a release."""
        speed = np.abs(self.v[self.free])
        return bool(np.any(speed[:, 0] > share * speed.max(axis=1)))

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return float(self.time[1] - self.time[0])


def measured_motion(model: Model, record: Record, resolution: Resolution | None = None) -> MeasuredMotion:
    """Put a record on a uniform grid and find motion, radiation force and noise.

    InputError if the record measures none of the model's degrees of freedom, or is too short.
    """
    resolution = resolution or Resolution()
    still = record.kind == "static"
    if still:  # irregular times say the order of the loads only
        steps = np.diff(record.time)
        step = float(np.median(steps)) if np.ptp(steps) <= np.median(steps) else 1.0
        record = replace(record, time=record.time[0] + step * np.arange(record.time.size))
    elif record.kind != "prescribed":
        record = measured_freely(model, record)[0]
    edge = unsure_edge(model, record)
    found = [channel(model, record, i) for i in range(model.n)]
    moving = np.array([f is not None for f in found])
    if not moving.any():
        raise not_measured(model, record)
    free = gauged(model, record, moving) if record.kind == "prescribed" else moving
    step = min(float(np.median(np.diff(f[1]))) for f in found if f is not None)
    omega = np.array([typical(model, f, i) for i, f in enumerate(found)])
    if not still:
        found = [f and (f[0], *bridged(f[1], f[2], 2 * np.pi / w)) for f, w in zip(found, omega)]
    omega[~moving] = omega[moving].max()
    reach = np.array([max(resolution.harmonics * w, driven_up_to(model, record, i)) for i, w in enumerate(omega)])
    fastest = reach[moving].max()
    grid = Grid(record.time[0] + edge, record.time[-1] - edge, step)
    grid = (grid.of_at_most(resolution.levels) if still else
            grid.with_samples(resolution.least, resolution.samples, 2 * np.pi * resolution.harmonics / fastest))
    time = grid.time
    if (count := grid.own.size // grid.keep) < fewest(record):
        raise InputError(f"record {record.name}: {count} samples at {resolution.samples} a period; at least "
                         f"{fewest(record)} are needed")
    dt = float(time[1] - time[0])
    length = min(resolution.periods * 2 * np.pi / omega[moving].min(), (time[-1] - time[0]) / 3.0)
    top = min(fastest, 0.7 * np.pi / (step * grid.keep))
    basis = ([samplewise(loads_known(model, record, grid))] if still else
             blocks(time.size, dt, length, top, 0.125 * length, resolution.alike))
    bins = None if still else basis[0].omega
    raw, noise = np.zeros((model.n, time.size)), np.zeros((model.n, basis[0].omega.size))
    tops = np.full(model.n, top)
    for i, f in enumerate(found):
        if f is not None:
            values = integrated(grid.between(*f[1:]), step / grid.split, f[0], omega[i])
            raw[i] = averaged(values, grid.keep)
            floor = resolution.noise_floor * float(np.std(values)) * np.sqrt(grid.split / grid.keep)
            level = grid.noise(*f[1:], omega[i], bins, resolution.white)
            if still and (load := record.channels.get(f"{model.dofs[i]}_force")) is not None:
                along = scatter(f[2], whole(record.time, load, f[1])) / np.sqrt(grid.keep)
                level = level if np.isnan(along) else np.array(along)
            # An integral's noise is that of each frequency; what is slower than `integrated` keeps is in `lost`.
            slow = omega[i] if bins is None else np.maximum(bins, SLOW * omega[i])
            noise[i] = np.maximum(level / slow ** f[0], floor)
            if not still:
                tops[i] = clear_up_to(grid, f, omega[i], resolution.white, top)
    if still:
        states = np.zeros((model.fit.states, time.size))
        v, steps = (np.stack(part) for part in zip(*(
            slow_path(row, dt, s[0], natural_frequency(model, i) * (model.C[i, i] > 0.0))
            for i, (row, s) in enumerate(zip(raw, noise)))))
        x = raw = followed(model, record, raw)
        a = np.zeros_like(raw)
    else:
        x, v, a = smoothed(raw, dt, length, tops, omega if record.kind == "decay" else None)
        states, steps = radiation_states(model, raw, dt), np.broadcast_to(dt, (model.n, time.size - 1))
    force = known_force(model, record, grid)
    transients = left_over(model, time, v) if not still else np.zeros((0, *raw.shape))
    lost = np.concatenate([slow_motions(f[0], raw, i, omega[i], dt) for i, f in enumerate(found) if f])
    extra = tuple(second_sensors(model, record, grid, found, omega, bins, resolution.white))
    waves = still_or_waves(model, record, grid)
    return MeasuredMotion(record, time, raw, x, v, a, free, force, model.fit.c @ states, states, transients, lost,
                          noise, omega, reach, tops, basis, extra, waves[0], waves[1], waves[2:], steps)


def followed(model: Model, record: Record, x: FloatArray) -> FloatArray:
    """Return places (n, nt) of a static test, with those that it has no columns of where the model comes to rest."""
    without = np.array([dof not in record.dofs for dof in model.dofs])
    free, given = np.flatnonzero(without), np.flatnonzero(~without)
    found = np.array(x)
    found[free] = -np.linalg.pinv(model.C[np.ix_(free, free)]) @ model.C[np.ix_(free, given)] @ x[given]
    return found


def parted(model: Model, record: Record, missed: float = 1.5) -> tuple[list[Record], list[str]]:
    """Return the parts of a record between gaps of more than half a period, and a sentence on what is left out.

    Gaps are those of motions, of forces and of the elevation that makes them. An interval between samples is no gap
    where it is at most `missed` times the usual one; before the first sample and after the last every longer one is.
    Parts that are shorter than a test function's interval of the fastest motion are left out. What is under way when
    a later part begins is not known: those of a decay are records without a force. InputError if no part is long
    enough.
    """
    read = [(i, f) for i in range(model.n) if (f := channel(model, record, i))] if record.kind != "static" else []
    omega = [typical(model, f, i) for i, f in read]
    driven = [(at, max(omega)) for at in driven_at(model, record) if read]
    gaps = [gap for at, w in [*((f[1], w) for (_, f), w in zip(read, omega)), *driven]
            for gap in unread(record, at, np.pi / w, missed)]
    if not gaps:
        return [record], []
    gaps, least = sorted(set(gaps)), Resolution().periods * 2 * np.pi / max(omega)
    starts = np.maximum.accumulate([record.time[0], *(end for _, end in gaps)])
    spans = [(a, b) for a, b in zip(starts, [*(start for start, _ in gaps), record.time[-1]]) if b - a >= least]
    if not spans:
        raise InputError(f"record {record.name}: no stretch without gaps in motion and force is as long as two "
                         f"periods, {least:.3g} s")
    told = ", ".join(f"{start:.4g} to {end:.4g} s" for start, end in gaps)
    none = {f"{dof}_force": np.zeros(record.time.size) for dof in model.dofs}
    later = replace(record, kind="forced", channels={**record.channels, **none}) if record.kind == "decay" else record
    parts = [replace(with_waves(model, record if a == record.time[0] else later, a, b),
                     name=f"{record.name} from {a:.4g} s") for a, b in spans]
    return parts, [f"Record {record.name}: motion or force is not measured from {told}; {len(parts)} "
                   f"{'part of it is' if len(parts) == 1 else 'parts of it are'} taken, of {least:.3g} s at least."]


def with_waves(model: Model, record: Record, first: float, last: float, missed: float = 3.5) -> Record:
    """Return a part of a record with what is known of the waves before and after it, as far as their force reaches.

    `missed`: the longest interval, of the usual one, over which the elevation is interpolated.
    """
    part = record.window(first, np.nextafter(last, np.inf))
    if (edge := unsure_edge(model, record)) == 0.0:
        return part
    (at,) = driven_at(model, record)
    breaks = np.flatnonzero(np.diff(at) > missed * np.median(np.diff(at)))
    low = max((float(t) for t in at[np.r_[0, breaks + 1]] if t <= first), default=first)
    high = min((float(t) for t in at[np.r_[breaks, at.size - 1]] if t >= last), default=last)
    for _ in range(20):  # of a short part a smaller edge is left out, and less is needed
        part = record.window(max(low, first - edge), np.nextafter(min(high, last + edge), np.inf))
        edge = unsure_edge(model, part)
    return part


def smoothed(raw: FloatArray, dt: float, length: float, tops: FloatArray, swings: FloatArray | None = None
             ) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, velocity and acceleration up to frequencies `tops` (n,), reflected beyond the record's ends.

    A decay, of circular frequencies `swings` (n,), starts with its largest acceleration: what is before its start keeps
    slope and curvature, x(-t) = x(t) - 2 v(0) sin(w t) / w.
    """
    pad = min(int(length / dt), raw.shape[1] - 1)
    before = 2 * raw[:, :1] - raw[:, pad:0:-1]
    if swings is not None:
        first = start_slopes(raw, dt, swings)
        phase = np.outer(swings, dt * np.arange(pad, 0, -1))
        before = raw[:, pad:0:-1] - 2.0 * (first / swings)[:, None] * np.sin(phase)
    after = 2 * raw[:, -1:] - raw[:, -2:-pad - 2:-1]
    full = np.concatenate([before, raw, after], axis=1)
    basis = blocks(full.shape[1], dt, length, tops.max(), 0.25 * length)
    return tuple(part[:, pad:pad + raw.shape[1]] for part in smooth(basis, full, tops))  # type: ignore[return-value]


def start_slopes(raw: FloatArray, dt: float, omega: FloatArray) -> FloatArray:
    """Return the slopes of motions (n, nt) at their start: zero if the first quarter periods fit better from rest.

    Of two polynomials with four numbers, one has the powers 0 to 3 and one has 4 for 1.
    """
    slopes, better = np.zeros(omega.size), 0.0
    for i, w in enumerate(omega):
        if not np.any(raw[i]):
            continue  # not measured
        count = min(max(int(0.5 * np.pi / (w * dt)) + 1, 6), raw.shape[1])
        powers = (w * dt * np.arange(count))[:, None] ** np.arange(5)
        free, rest = (np.linalg.lstsq(powers[:, some], raw[i, :count])[:2] for some in ([0, 1, 2, 3], [0, 2, 3, 4]))
        slopes[i] = w * free[0][1]
        better += count * float(np.log(rest[1].sum() + 1e-300) - np.log(free[1].sum() + 1e-300))
    return slopes if better > 0.0 else np.zeros_like(slopes)
