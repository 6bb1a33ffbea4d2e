"""A record as the equation of motion takes it: motion, force and sensors on one uniform grid, in local cosine bases.

These are orthonormal functions of short support, for equations of motion in weak form. A test function that vanishes
with its slope at both ends takes the derivatives of the motion upon itself: <g, x''> = <g'', x> and <g, x'> =
-<g', x>, so no measured signal is differentiated (Coifman & Meyer 1991).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.readings import (
    Grid,
    Sensor,
    averaged,
    channel,
    fewest,
    integrated,
    known_force,
    second_sensors,
    slow_motions,
    slow_path,
    still_or_waves,
    typical,
)
from radiation_ss.records.record import Record
from radiation_ss.simulation.linear import left_over, radiation_states
from radiation_ss.simulation.measured import measured_freely, unsure_edge

FINE = 10  # frequencies in each bin at which the Jacobian of the data is taken


@dataclass(frozen=True, eq=False)
class Block:
    """The test functions of one interval."""

    start: int  # First sample of the support
    # g, dg, ddg (bins, ns): Test functions and their first two derivatives on the samples of the support, times the
    # sampling interval's square root: white noise of variance 1 a sample has projections of variance 1
    g: FloatArray
    dg: FloatArray
    ddg: FloatArray
    omega: FloatArray  # (bins,): Circular frequencies [rad/s]

    @property
    def samples(self) -> slice:
        """Samples of the support."""
        return slice(self.start, self.start + self.g.shape[1])

    def project(self, values: FloatArray, order: int = 0, bins: int | None = None) -> FloatArray:
        """Return the projections of the `order`-th time derivative of a signal, shape (..., bins)."""
        test = (self.g, -self.dg, self.ddg)[order][:bins]
        return np.asarray(values[..., self.samples] @ test.T)


def projected_on(basis: Sequence[Block], values: FloatArray, order: int = 0, bins: int | None = None) -> FloatArray:
    """Return the projections of the `order`-th derivative of signals (..., nt) on a basis, shape (..., blocks, bins).

    Blocks that share their test functions are taken together, in groups that do not overlap: as matrices these are
    multiplied by BLAS.
    """
    parts, first = [], 0
    while first < len(basis):
        block, last = basis[first], first + 1
        while last < len(basis) and basis[last].g is block.g:
            last += 1
        if last == first + 1:
            parts.append(block.project(values, order, bins)[..., None, :])
            first = last
            continue
        test = (block.g, -block.dg, block.ddg)[order][:bins]
        step = basis[first + 1].start - block.start
        windows = np.lib.stride_tricks.sliding_window_view(values[..., block.start:], block.g.shape[1], axis=-1)
        windows = windows[..., :(last - first - 1) * step + 1:step, :]
        part = np.empty((*windows.shape[:-1], test.shape[0]))
        apart = -(-block.g.shape[1] // step)  # windows that overlap are no matrix whose product is fast
        for k in range(min(apart, last - first)):
            part[..., k::apart, :] = windows[..., k::apart, :] @ test.T
        parts.append(part)
        first = last
    return np.concatenate(parts, axis=-2)


def bell(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sin(pi/2 S(u)) with S rising smoothly from 0 at u = -1 to 1 at u = 1, and its first two derivatives.

    bell(u)^2 + bell(-u)^2 = 1, and both derivatives are continuous.
    """
    r = 0.5 * (np.clip(u, -1.0, 1.0) + 1.0)
    angle = 0.5 * np.pi * r**4 * (35.0 - 84.0 * r + 70.0 * r**2 - 20.0 * r**3)
    slope = 35.0 * np.pi * (r * (1.0 - r)) ** 3
    bend = 52.5 * np.pi * (r * (1.0 - r)) ** 2 * (1.0 - 2.0 * r)
    return np.sin(angle), np.cos(angle) * slope, np.cos(angle) * bend - np.sin(angle) * slope**2


def blocks(count: int, dt: float, length: float, top: float, edge: float, alike: float = np.inf) -> list[Block]:
    """Return the local cosine basis of a record of `count` samples.

    Parameters
    ----------
    dt : float
        Sampling interval [s].
    length : float
        Wanted length of an interval [s]; the record holds a whole number of them, at least one.
    top : float
        Highest circular frequency of a test function [rad/s].
    edge : float
        Half width of the bell at the record's two ends [s]; between intervals it is a half of their length.
    alike : float
        Number of intervals from which they last a whole number of samples and share their test functions: memory does
        not grow with the record. What is left over, an interval at most, widens the two ends.
    """
    total = (count - 1) * dt
    edge = min(edge, 0.2 * total)
    number = max(round((total - 2 * edge) / length), 1)
    L = (total - 2 * edge) / number
    if number < alike:
        return [_block(j, number, count, dt, L, top, edge) for j in range(number)]
    samples = int(L / dt)
    L, number = samples * dt, int((total - 2 * edge) / (samples * dt))
    edge = 0.5 * (total - number * L)
    inner = _block(1, number, count, dt, L, top, edge)
    return [_block(0, number, count, dt, L, top, edge),
            *(replace(inner, start=inner.start + (j - 1) * samples) for j in range(1, number - 1)),
            _block(number - 1, number, count, dt, L, top, edge)]


def _block(j: int, number: int, count: int, dt: float, L: float, top: float, edge: float) -> Block:
    """Return the test functions of one interval of length L."""
    time = np.asarray(dt * np.arange(count), dtype=np.float64)
    a, b = edge + j * L, edge + (j + 1) * L
    rise, fall = (edge if j == 0 else 0.5 * L), (edge if j == number - 1 else 0.5 * L)
    keep = np.flatnonzero((time >= a - rise - 1e-9 * dt) & (time <= b + fall + 1e-9 * dt))
    t = time[keep]
    up, down = (bell(np.asarray(u, dtype=np.float64)) for u in ((t - a) / rise, (b - t) / fall))
    w, dw = up[0] * down[0], up[1] / rise * down[0] - up[0] * down[1] / fall
    ddw = up[2] / rise**2 * down[0] - 2 * up[1] * down[1] / (rise * fall) + up[0] * down[2] / fall**2
    omega = np.asarray(np.pi / L * (np.arange(max(int(top * L / np.pi), 1)) + 0.5), dtype=np.float64)
    c = np.cos(np.outer(omega, t - a)) * np.sqrt(2.0 * dt / L)
    s = np.sin(np.outer(omega, t - a)) * np.sqrt(2.0 * dt / L)
    W = omega[:, None]
    return Block(int(keep[0]), w * c, dw * c - W * w * s, ddw * c - 2 * W * dw * s - W**2 * w * c, omega)


def samplewise(count: int) -> Block:
    """Return test functions that take the samples as they are; for signals without dynamics."""
    none = np.zeros((count, count))
    return Block(0, np.eye(count), none, none, np.zeros(count))


def smooth(basis: list[Block], values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a signal's part in the span of the basis with its first two derivatives, each of the signal's shape."""
    found = tuple(np.zeros_like(values) for _ in range(3))
    for block in basis:
        weight = block.project(values)
        for part, shape in zip(found, (block.g, block.dg, block.ddg)):
            part[..., block.samples] += weight @ shape
    return found[0], found[1], found[2]


@dataclass(frozen=True)
class Resolution:
    """How finely a record is looked at."""

    periods: float = 2.0  # Length of a test function's interval, in typical periods of the slowest motion
    harmonics: float = 3.5  # Highest frequency of a test function, in typical frequencies of the fastest motion
    samples: int = 48  # Samples a period of the fastest motion at least: closer readings are averaged, others joined
    levels: int = 600  # Samples of a static test that are kept; longer ones are averaged
    # Least standard deviation of a sensor's noise, of the motion's rms: sensors are not better than that
    noise_floor: float = 2e-4
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
    free: np.ndarray  # (n,): Degrees of freedom that are measured; the others are held
    force: FloatArray | None  # (n, nt): Known exciting force; the measured total force where the motion is prescribed
    # memory, radiation (n, nt), (m, nt): Radiation force and states along the motion
    memory: FloatArray
    radiation: FloatArray
    # (k, n, nt): Radiation forces that the motion before the record may have left, one standard deviation each
    transients: FloatArray
    # (k, n, nt): Slow motions that an integrated velocity or acceleration cannot tell, one standard deviation each
    lost: FloatArray
    noise: FloatArray  # (n,): Standard deviation of the displacement's noise a sample
    omega: FloatArray  # (n,): Typical circular frequency of each motion [rad/s]
    basis: list[Block]
    sensors: tuple[Sensor, ...]
    elevation: FloatArray  # (nt,): Wave elevation at the body [m]; 0 where it is not known
    envelope: FloatArray  # (nt,): Its envelope [m]
    # (n, nt): Velocity of the linear wave along each degree of freedom at the body; 0 without an elevation
    orbital: FloatArray
    # (n, nt - 1): What `v` lasts from each sample to the next [s]: dt, or in a static test what the way takes
    steps: FloatArray

    @property
    def prescribed(self) -> bool:
        """Whether the motion is given and the force is what a model predicts."""
        return self.record.kind in ("prescribed", "static")

    @cached_property
    def omega_fine(self) -> FloatArray:
        """Frequencies at which the Jacobian of the data is taken [rad/s]: some in each bin, resonances are narrow."""
        if self.record.kind == "static":
            return np.zeros(0)
        width = 2.0 * self.basis[0].omega[0] / FINE
        return np.asarray(width * (np.arange(FINE * self.basis[0].omega.size) + 0.5))

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return float(self.time[1] - self.time[0])


def measured_motion(model: Model, record: Record, resolution: Resolution | None = None) -> MeasuredMotion:
    """Put a record on a uniform grid and find motion, radiation force and noise.

    Raises
    ------
    InputError
        If the record measures none of the model's degrees of freedom, or is too short.
    """
    resolution = resolution or Resolution()
    still = record.kind == "static"
    if still:  # its times say the order of the loads only
        record = replace(record, time=record.time[0] + np.median(np.diff(record.time)) * np.arange(record.time.size))
    elif record.kind != "prescribed":
        record = measured_freely(model, record)[0]
    edge = unsure_edge(model, record)
    found = [channel(model, record, i) for i in range(model.n)]
    free = np.array([f is not None for f in found])
    if not free.any():
        raise InputError(f"record {record.name}: it measures {', '.join(record.dofs) or 'no motion'}, and the model's "
                         f"degrees of freedom are {', '.join(model.dofs)}")
    step = min(float(np.median(np.diff(f[1]))) for f in found if f is not None)
    omega = np.array([typical(model, f, i) for i, f in enumerate(found)])
    omega[~free] = omega[free].max()
    grid = Grid(record.time[0] + edge, record.time[-1] - edge, step)
    grid = (grid.of_at_most(resolution.levels) if still else
            grid.with_samples(resolution.samples, 2 * np.pi / omega[free].max()))
    time = grid.time
    if grid.own.size // grid.keep < fewest(record):
        raise InputError(f"record {record.name}: {time.size} samples at {resolution.samples} a period; at least "
                         f"{fewest(record)} are needed")
    raw, noise = np.zeros((model.n, time.size)), np.zeros(model.n)
    for i, f in enumerate(found):
        if f is not None:
            values = integrated(grid.between(*f[1:]), step / grid.split, f[0], omega[i])
            raw[i] = averaged(values, grid.keep)
            floor = resolution.noise_floor * float(np.std(values)) * np.sqrt(grid.split / grid.keep)
            noise[i] = max(grid.noise(*f[1:], omega[i]) / omega[i] ** f[0], floor)
    dt = float(time[1] - time[0])
    length = min(resolution.periods * 2 * np.pi / omega[free].min(), (time[-1] - time[0]) / 3.0)
    top = min(resolution.harmonics * omega[free].max(), 0.7 * np.pi / (step * grid.keep))
    if still:
        basis, states = [samplewise(time.size)], np.zeros((model.fit.states, time.size))
        x, a = raw, np.zeros_like(raw)
        v, steps = (np.stack(part) for part in zip(*(slow_path(row, dt, s) for row, s in zip(raw, noise))))
    else:
        basis = blocks(time.size, dt, length, top, 0.125 * length, resolution.alike)
        x, v, a = smoothed(raw, dt, length, top, still=record.kind == "decay")
        states, steps = radiation_states(model, raw, dt), np.broadcast_to(dt, (model.n, time.size - 1))
    force = known_force(model, record, grid)
    transients = left_over(model, time, v) if record.kind not in ("decay", "static") else np.zeros((0, *raw.shape))
    lost = np.concatenate([slow_motions(f[0], raw, i, omega[i], dt) for i, f in enumerate(found) if f])
    extra = tuple(second_sensors(model, record, grid, found, omega))
    waves = still_or_waves(model, record, grid)
    return MeasuredMotion(record, time, raw, x, v, a, free, force, model.fit.c @ states, states, transients, lost,
                          noise, omega, basis, extra, waves[0], waves[1], waves[2:], steps)


def smoothed(raw: FloatArray, dt: float, length: float, top: float, still: bool
             ) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, velocity and acceleration in the span of the basis, reflected beyond the record's ends.

    A body that is released from rest starts with no velocity, so its start is reflected evenly.
    """
    pad = min(int(length / dt), raw.shape[1] - 1)
    before = raw[:, pad:0:-1] if still else 2 * raw[:, :1] - raw[:, pad:0:-1]
    after = 2 * raw[:, -1:] - raw[:, -2:-pad - 2:-1]
    full = np.concatenate([before, raw, after], axis=1)
    basis = blocks(full.shape[1], dt, length, top, 0.25 * length)
    return tuple(part[:, pad:pad + raw.shape[1]] for part in smooth(basis, full))  # type: ignore[return-value]
