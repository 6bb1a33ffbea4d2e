"""A record as the estimators need it: channels on one uniform time grid, and the force where it is known."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.motion import parted
from radiation_ss.records.columns import RATES
from radiation_ss.records.probe import check_elevation_at_body
from radiation_ss.records.record import Record
from radiation_ss.records.signals import filled, stretches
from radiation_ss.simulation.prepared import driven_at

ENDINGS = tuple(RATES)


@dataclass(frozen=True, eq=False)
class Channels:
    """Measured motion on a uniform grid."""

    name: str  # The record's
    # start, dt: First time and time step [s]
    start: float
    dt: float
    y: FloatArray  # (nt, p): NaN where missing; each channel's mean is removed
    # dof, derivative (p,): What each channel is: degree of freedom, and 0, 1, 2 for displacement, velocity,
    # acceleration
    dof: NDArray[np.int64]
    derivative: NDArray[np.int64]
    labels: tuple[str, ...]
    drifts: NDArray[np.bool_] | None = None  # (p,): Which are displacements that nothing restores; none without it

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

    @property
    def power(self) -> FloatArray:
        """Periodogram of each channel over its rms, Hann window, missing samples zero, shape (nk, p).

        Of a displacement that drifts, that of its rate about a straight line: how far a steady load took it, and where
        it was pushed off to, say nothing of how it moves.
        """
        filled = np.nan_to_num(self.y)
        if self.drifts is not None and self.drifts.any():
            from scipy.signal import detrend

            filled[:, self.drifts] = detrend(np.gradient(filled[:, self.drifts], self.dt, axis=0), axis=0)
        filled = filled / np.maximum(filled.std(axis=0), 1e-300)
        return np.asarray(np.abs(np.fft.rfft(filled * np.hanning(filled.shape[0])[:, None], axis=0)) ** 2)

    @property
    def spacing(self) -> float:
        """Width of a bin of `power` [rad/s]."""
        return 2.0 * np.pi / (self.y.shape[0] * self.dt)

    @cached_property
    def frequency(self) -> float:
        """Median circular frequency [rad/s] of the channels' power."""
        power = np.sum(self.power, axis=1)
        return self.spacing * max(int(np.searchsorted(np.cumsum(power), 0.5 * power.sum())), 1)

    @property
    def period(self) -> float:
        """Typical period of the motion [s]."""
        return 2.0 * np.pi / self.frequency

    def pick(self, which: NDArray[np.int64]) -> "Channels":
        """Return some of the channels."""
        return replace(self, y=self.y[:, which], dof=self.dof[which], derivative=self.derivative[which],
                       labels=tuple(self.labels[i] for i in which),
                       drifts=None if self.drifts is None else self.drifts[which])

    def one_each(self) -> "Channels":
        """Return the channel of lowest derivative of each degree of freedom."""
        return self.pick(np.array([i for i in range(self.count)
                                   if self.derivative[i] == self.derivative[self.dof == self.dof[i]].min()]))

    def cut(self, first: int, last: int) -> "Channels":
        """Return the samples from `first` to before `last`."""
        return replace(self, y=self.y[first:last], start=self.start + first * self.dt)


def motion_channels(model: Model, record: Record, least_periods: float = 2.0) -> Channels:
    """Return displacement and acceleration of the model's degrees of freedom; velocity where displacement is absent."""
    pick = []
    for j, dof in enumerate(model.dofs):
        have = [q for q in range(3) if dof + ENDINGS[q] in record.channels]
        pick += [(j, q) for q in have if not (q == 1 and 0 in have)]
    if not pick:
        raise InputError(f"record {record.name}: no motion of {', '.join(model.dofs)} in it; "
                         f"its columns are {', '.join(record.channels)}")
    labels = tuple(model.dofs[j] + ENDINGS[q] for j, q in pick)
    start, dt, count = uniform_grid(record)
    y = np.stack([on_grid(record, record.channels[label]) for label in labels], axis=1)
    for i, label in enumerate(labels):
        good = y[np.isfinite(y[:, i]), i]
        if good.size < 20:
            raise InputError(f"record {record.name}, column {label}: {good.size} samples; at least 20 are needed")
        if good.std() <= 1e-12 * np.abs(good).max():
            raise InputError(f"record {record.name}, column {label}: constant at {good[0]:g}; a dead sensor?")
    if record.kind != "decay":
        y = y - np.nanmean(y, axis=0)
    channels = Channels(record.name, start, dt, y, np.array([j for j, _ in pick]), np.array([q for _, q in pick]),
                        labels, np.array([q == 0 and model.C[j, j] == 0.0 for j, q in pick]))
    if record.kind != "decay" and count * dt < least_periods * channels.period:
        raise InputError(f"record {record.name}: {count * dt:.3g} s hold {count * dt / channels.period:.1f} periods of "
                         f"the motion; at least {least_periods:g} are needed")
    return channels


def strong_bins(power: FloatArray, floor: float) -> NDArray[np.int64]:
    """Return the bins at which any channel has `floor` of its largest power, smoothed over three; power (nw, p)."""
    smooth = np.array([np.convolve(column, np.ones(3) / 3.0, mode="same") for column in power.T])
    return np.flatnonzero((smooth > floor * smooth.max(axis=1, keepdims=True)).any(axis=0))


def thinned(channels: Channels, force: FloatArray, samples: int = 16, trim: int = 10) -> tuple[Channels, FloatArray]:
    """Return motion and force low-passed alike and thinned to some `samples` a period, where there are far more.

    It is the period of the faster of both: a moored body may swing far slower than the waves drive it. A linear
    relation survives a filter on both its sides; noise far above the motion goes, which a model of white errors would
    explain by the body. So do `trim` thinned samples at each end.
    """
    driven = replace(channels, y=force[:, force.std(axis=0) > 0.0], drifts=None)
    fastest = min(channels.period, driven.period if driven.y.size else np.inf)
    factor = int(fastest / channels.dt / samples)
    if factor < 2 or not np.isfinite(channels.y).all() or channels.y.shape[0] < 10 * trim * factor:
        return channels, force
    from scipy.signal import decimate

    def thin(values: FloatArray) -> FloatArray:
        mean = values.mean(axis=0)
        return np.asarray(decimate(values - mean, factor, ftype="fir", axis=0)[trim:-trim] + mean)

    return replace(channels, y=thin(channels.y), start=channels.start + trim * factor * channels.dt,
                   dt=factor * channels.dt), thin(force)


def uniform_grid(record: Record, jitter: float = 0.01) -> tuple[float, float, int]:
    """Return start, step [s] and number of samples of the uniform grid that stands for the record's times."""
    steps = np.diff(record.time)
    dt = float(np.median(steps))
    if np.abs(steps - dt).max() < jitter * dt:
        dt = float((record.time[-1] - record.time[0]) / (record.time.size - 1))
        return float(record.time[0]), dt, record.time.size
    return float(record.time[0]), dt, int(np.floor((record.time[-1] - record.time[0]) / dt + 1e-6)) + 1


def on_grid(record: Record, values: FloatArray, jitter: float = 0.01) -> FloatArray:
    """Return a channel on the uniform grid: as it is where the times are the grid's, else by a cubic within gaps."""
    start, dt, count = uniform_grid(record)
    grid = start + dt * np.arange(count)
    if count == record.time.size and np.abs(record.time - grid).max() < jitter * dt:
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


def check_force_known(model: Model, record: Record) -> None:
    """Raise InputError where a record states no force, or only some: no column, no decay, no elevation with X.

    That a record has no motion of the model either is another error.
    """
    if not set(model.dofs) & set(record.dofs):
        return
    measured, data = record.get("force", model.dofs), model.hydro
    rows = [np.zeros(0)] * model.n if measured is None else measured
    missing = [] if record.kind == "decay" else [
        f"{dof}_force" for dof, row in zip(model.dofs, rows) if not np.isfinite(row).any()]
    empty = [name for name in missing if name in record.channels]
    sea = "wave_elevation" in record.channels and data is not None and data.X is not None
    if not missing or (measured is None and sea):
        return
    if len(missing) < model.n:
        raise InputError(f"record {record.name}: {missing[0]} is missing while other forces are there; add it (0 where "
                         "nothing acts) or drop all force columns")
    lacking = f"column {empty[0]} is empty" if empty else (
        f"no {' or '.join(missing)} among its columns {', '.join(record.channels)}")
    raise InputError(f"record {record.name}: the force is not known ({lacking}, not '# kind: decay', no wave_elevation "
                     "with X in the model); method 'spectral' needs none")


def between_gaps(model: Model, record: Record) -> tuple[list[Record], list[str]]:
    """Return the parts of a record that its known input is whole in, and sentences on what is left out.

    Shorter gaps than half a period are filled (`_bridged`). Parts whose motion is too short go, too.
    """
    def gap(part: Record) -> float:
        return max((float(np.diff(np.r_[part.time[0], at, part.time[-1]]).max()) for at in driven_at(model, part)),
                   default=0.0)

    few = 3.5 * float(np.median(np.diff(record.time)))  # two missing samples
    parts, said = ([record], list[str]()) if gap(record) < few or record.kind == "decay" else parted(model, record)
    kept, short = list[Record](), list[InputError]()
    for part in parts:
        try:
            motion_channels(model, part)
            kept.append(part)
        except InputError as error:
            short.append(error)
    if not kept:
        raise short[0] if not said else InputError(f"record {record.name}: its force or elevation has gaps, and no "
                                                   f"part between them is long enough ({short[0]})")
    said += [f"{error}; that part is left out" for error in short]
    if (longest := max(map(gap, kept))) > few and record.kind != "decay":
        said.append(f"record {record.name}: gaps of the force or the elevation, of {longest:.3g} s at most, are filled")
    return kept, said


def known_force(model: Model, record: Record) -> FloatArray | None:
    """Return the exciting force (nt, n) on the uniform grid: recorded, or a decay test's zero; None if not known."""
    measured = record.get("force", model.dofs)
    if measured is None:
        return None
    rows = [row if np.isfinite(row).any() else np.zeros(row.size) for row in measured]
    return np.stack([_bridged(record, row) for row in rows], axis=1)


def known_elevation(record: Record) -> FloatArray:
    """Return the wave elevation (nt,) on the record's uniform grid, mean removed."""
    check_elevation_at_body(record)
    elevation = _bridged(record, record.channels["wave_elevation"])
    return elevation - elevation.mean()


def _bridged(record: Record, column: FloatArray) -> FloatArray:
    """Return a column on the uniform grid, its gaps filled: by a straight line those of up to two samples."""
    values = on_grid(record, column)
    longest = max((end - first for first, end in stretches(~np.isfinite(values))), default=0)
    if longest > 2 and np.nanstd(values) > 0.0:
        values = filled(values, longest, 3 * longest)
    grid, bad = np.arange(values.size), ~np.isfinite(values)
    return np.interp(grid, grid[~bad], values[~bad])
