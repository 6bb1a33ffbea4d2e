"""A record as the estimators need it: channels on one uniform time grid, and the force where it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.records.record import Record

QUANTITIES = ("displacement", "velocity", "acceleration")
JITTER = 0.01           # steps that differ by less than this share count as uniform
SAMPLES = 16            # samples a period that a record with far more is thinned to
LEAST_PERIODS = 2.0     # a record shorter than this tells nothing


@dataclass(frozen=True, eq=False)
class Channels:
    """Measured motion on a uniform grid.

    Parameters
    ----------
    name : str
        The record's.
    start, dt : float
        First time and time step [s].
    y : ndarray, shape (nt, p)
        NaN where missing; each channel's mean is removed.
    dof, derivative : ndarray of int, shape (p,)
        What each channel is: degree of freedom, and 0, 1, 2 for displacement, velocity, acceleration.
    labels : tuple of str
    """

    name: str
    start: float
    dt: float
    y: FloatArray
    dof: NDArray[np.int64]
    derivative: NDArray[np.int64]
    labels: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of channels."""
        return self.y.shape[1]

    @property
    def time(self) -> FloatArray:
        """Sample times [s]."""
        return self.start + self.dt * np.arange(self.y.shape[0], dtype=np.float64)

    @cached_property
    def rms(self) -> FloatArray:
        """Root mean square of each channel about its mean."""
        return np.asarray(np.nanstd(self.y, axis=0))

    @cached_property
    def frequency(self) -> float:
        """Median circular frequency [rad/s] of the channels' power."""
        filled = np.where(np.isnan(self.y), 0.0, self.y) / self.rms
        power = np.sum(np.abs(np.fft.rfft(filled * np.hanning(filled.shape[0])[:, None], axis=0)) ** 2, axis=1)
        at = int(np.searchsorted(np.cumsum(power), 0.5 * power.sum()))
        return float(2.0 * np.pi * max(at, 1) / (filled.shape[0] * self.dt))

    def as_displacement(self, frequency: float) -> FloatArray:
        """Return each channel's rms as displacement, at one frequency."""
        return np.asarray(self.rms / frequency**self.derivative)

    def peak_displacement(self, frequency: float) -> FloatArray:
        """Return each channel's largest value as displacement, at one frequency."""
        return np.asarray(np.nanmax(np.abs(self.y), axis=0) / frequency**self.derivative)

    def output_matrices(self, F: FloatArray, G: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (H, D) of y = H x + D f for the composite x' = F x + G f, shapes (p, N), (p, n)."""
        N, n = G.shape
        every = {0: (np.eye(N)[N - 2 * n:N - n], np.zeros((n, n))), 1: (np.eye(N)[N - n:], np.zeros((n, n))),
                 2: (F[N - n:], G[N - n:])}
        rows = [(every[int(d)][0][j], every[int(d)][1][j]) for j, d in zip(self.dof, self.derivative)]
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def motion_channels(model: Model, record: Record) -> Channels:
    """Return displacement and acceleration of the model's degrees of freedom; velocity where displacement is absent.

    Raises
    ------
    InputError
        If no motion is there, a channel is constant, or the record is too short.
    """
    pick = []
    for j, dof in enumerate(model.dofs):
        have = [q for q in range(3) if dof + ("", "_velocity", "_acceleration")[q] in record.channels]
        pick += [(j, q) for q in have if not (q == 1 and 0 in have)]
    if not pick:
        raise InputError(f"record {record.name}: no motion of {', '.join(model.dofs)} in it; "
                         f"its columns are {', '.join(record.channels)}")
    labels = tuple(model.dofs[j] + ("", "_velocity", "_acceleration")[q] for j, q in pick)
    start, dt, count = uniform_grid(record)
    y = np.stack([on_grid(record, record.channels[label], start, dt, count) for label in labels], axis=1)
    for i, label in enumerate(labels):
        good = y[np.isfinite(y[:, i]), i]
        if good.size < 20:
            raise InputError(f"record {record.name}, column {label}: {good.size} samples; at least 20 are needed")
        if good.std() <= 1e-12 * np.abs(good).max():
            raise InputError(f"record {record.name}, column {label}: constant at {good[0]:g}; a dead sensor?")
    if record.kind != "decay":
        y = y - np.nanmean(y, axis=0)
    channels = Channels(record.name, start, dt, y, np.array([j for j, _ in pick]), np.array([q for _, q in pick]),
                        labels)
    periods = count * dt * channels.frequency / (2.0 * np.pi)
    if record.kind != "decay" and periods < LEAST_PERIODS:
        raise InputError(f"record {record.name}: {count * dt:.3g} s hold {periods:.1f} periods of the motion; "
                         f"at least {LEAST_PERIODS:g} are needed")
    return channels


def thinned(channels: Channels, force: FloatArray) -> tuple[Channels, FloatArray]:
    """Return motion and force low-passed alike and thinned to some SAMPLES a period, where there are far more.

    A linear relation survives a filter on both its sides. What goes is noise and whatever else lives far above the
    motion's frequencies, which a model of white errors would otherwise have to explain by the body.
    """
    factor = int(2.0 * np.pi / channels.frequency / channels.dt / SAMPLES)
    trim = 10       # thinned samples at each end that the filter spoils
    if factor < 2 or not np.isfinite(channels.y).all() or channels.y.shape[0] < 10 * trim * factor:
        return channels, force
    from scipy.signal import decimate

    def thin(values: FloatArray) -> FloatArray:
        mean = values.mean(axis=0)
        return np.asarray(decimate(values - mean, factor, ftype="fir", axis=0)[trim:-trim] + mean)

    start, dt = channels.start + trim * factor * channels.dt, factor * channels.dt
    return replace(channels, y=thin(channels.y), start=start, dt=dt), thin(force)


def uniform_grid(record: Record) -> tuple[float, float, int]:
    """Return start, step [s] and number of samples of the uniform grid that stands for the record's times."""
    steps = np.diff(record.time)
    dt = float(np.median(steps))
    if np.abs(steps - dt).max() < JITTER * dt:
        dt = float((record.time[-1] - record.time[0]) / (record.time.size - 1))
        return float(record.time[0]), dt, record.time.size
    return float(record.time[0]), dt, int(np.floor((record.time[-1] - record.time[0]) / dt + 1e-6)) + 1


def on_grid(record: Record, values: FloatArray, start: float, dt: float, count: int) -> FloatArray:
    """Return a channel on the uniform grid: as it is where the times are the grid's, else by a cubic within gaps."""
    grid = start + dt * np.arange(count)
    if count == record.time.size and np.abs(record.time - grid).max() < JITTER * dt:
        return np.array(values)
    from scipy.interpolate import Akima1DInterpolator

    good = np.isfinite(values)
    if good.sum() < 5:
        return np.full(count, np.nan)
    at = record.time[good]
    out = Akima1DInterpolator(at, values[good])(grid)
    behind = np.clip(np.searchsorted(at, grid, side="right") - 1, 0, at.size - 2)
    out[at[behind + 1] - at[behind] > 2.5 * dt] = np.nan
    return np.asarray(out)


def known_force(model: Model, record: Record) -> tuple[FloatArray, str] | None:
    """Return the exciting force (nt, n) on the record's uniform grid and where it is from; None if it is not known.

    Force columns come first, then a decay test's zero.

    Raises
    ------
    InputError
        If a force column has gaps longer than two samples.
    """
    start, dt, count = uniform_grid(record)
    measured = record.get("force", model.dofs)
    if measured is not None:
        rows = []
        for dof, row in zip(model.dofs, measured):
            if not np.isfinite(row).any():
                if record.kind != "decay":
                    raise InputError(f"record {record.name}: {dof}_force is missing while other forces are there; add "
                                     "it (0 where nothing acts) or drop all force columns")
                row = np.zeros(row.size)
            rows.append(_filled(record, f"{dof}_force", on_grid(record, row, start, dt, count), start, dt))
        return np.stack(rows, axis=1), "force columns"
    if record.kind == "decay":
        return np.zeros((count, model.n)), "decay test: zero"
    return None


def known_elevation(model: Model, record: Record) -> FloatArray | None:
    """Return the wave elevation (nt,) on the record's uniform grid, mean removed; None without it or without X."""
    if "wave_elevation" not in record.channels or model.hydro is None or model.hydro.X is None:
        return None
    start, dt, count = uniform_grid(record)
    column = on_grid(record, record.channels["wave_elevation"], start, dt, count)
    elevation = _filled(record, "wave_elevation", column, start, dt)
    return elevation - elevation.mean()


def _filled(record: Record, label: str, values: FloatArray, start: float, dt: float) -> FloatArray:
    """Return values with gaps of up to two samples filled by a straight line."""
    bad = ~np.isfinite(values)
    if not bad.any():
        return values
    grid = np.arange(values.size)
    starts = np.flatnonzero(bad & ~np.r_[False, bad[:-1]])
    ends = np.flatnonzero(bad & ~np.r_[bad[1:], False])
    if (ends - starts).max() >= 2:
        worst = int(np.argmax(ends - starts))
        raise InputError(f"record {record.name}, column {label}: missing from {start + dt * starts[worst]:g} to "
                         f"{start + dt * ends[worst]:g} s; a known input may not have gaps of more than two samples")
    return np.interp(grid, grid[~bad], values[~bad])
