"""Signals of a record: spectra, gaps, even samples."""


import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.ndimage import median_filter

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.records.columns import RATES
from radiation_ss.records.record import Record


def compared(one: ComplexArray, other: ComplexArray) -> tuple[float, float]:
    """Return the correlation of two spectra, and how many times as large the second one is; zeros if one is none."""
    low, high = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if low == 0.0 or high == 0.0:
        return 0.0, 0.0
    return float(np.vdot(one, other).real) / (low * high), high / low


def grid_of(record: Record) -> FloatArray:
    """Return uniform times that stand for the record's."""
    # Two sensors that are read one just after the other have a tiny median step: the grid stays bounded.
    dt = max(float(np.median(np.diff(record.time))), float(np.ptp(record.time)) / (8.0 * record.time.size))
    return record.time[0] + dt * np.arange(max(2, int((record.time[-1] - record.time[0]) / dt + 1.5)))


def spectrum_of(record: Record, values: FloatArray, spiky: bool = True) -> tuple[FloatArray, ComplexArray]:
    """Return frequencies [rad/s] and Fourier coefficients; windowed unless the motion dies away. A computed one is not
    `spiky`: its first swings may be all of it.
    """
    grid = grid_of(record)
    even = whole(record.time, without_spikes(values) if spiky else values, grid)
    even = even - even.mean()
    window = np.ones(even.size) if record.kind == "decay" else np.hanning(even.size)
    return 2.0 * np.pi * np.fft.rfftfreq(even.size, grid[1] - grid[0]), np.fft.rfft(even * window)


def rms_in(record: Record, spectrum: ComplexArray, band: np.ndarray) -> float:
    """Return the rms that a band of `spectrum_of` stands for."""
    size = grid_of(record).size
    window = 1.0 if record.kind == "decay" else 0.375     # mean square of the window
    return float(np.sqrt(2.0 * np.sum(np.abs(spectrum[band]) ** 2) / window) / size)


def whole(time: FloatArray, values: FloatArray, at: FloatArray | None = None) -> FloatArray:
    """Return values with what is missing filled by a straight line, at other times if given."""
    there = np.isfinite(values)
    at = time if at is None else at
    return np.interp(at, time[there], values[there]) if there.any() else np.zeros(at.size)


def middle(omega: FloatArray, spectrum: ComplexArray) -> float:
    """Return the median frequency of a signal's power; 0 of none."""
    power = np.cumsum(np.abs(spectrum[1:]) ** 2)
    return float(omega[1 + int(np.searchsorted(power, 0.5 * power[-1]))]) if power.any() else 0.0


def band_of(omega: FloatArray, spectrum: ComplexArray) -> np.ndarray:
    """Return which frequencies lie between a third and three times the median frequency."""
    centre = middle(omega, spectrum)
    return (omega > centre / 3.0) & (omega < 3.0 * centre) & (omega > 0.0)


def columns_of(record: Record, dof: str) -> list[tuple[int, str]]:
    """Return order of the derivative and name of each column of a degree of freedom in motion."""
    found = []
    for order, suffix in enumerate(RATES):
        values = record.channels.get(dof + suffix, np.zeros(0))
        good = values[np.isfinite(values)]
        if good.size > 8 and np.ptp(good) > 1e-12 * np.abs(good).max() and not only_noise(record, values):
            found.append((order, dof + suffix))
    return found


def only_noise(record: Record, values: FloatArray, bands: int = 8, flat: float = 0.1) -> bool:
    """Whether a signal's power is the same in all of eight bands of frequency: noise of a sensor, no motion."""
    power = np.abs(spectrum_of(record, values)[1][1:]) ** 2
    if power.size < 16 * bands:
        return False
    means = np.array([part.mean() for part in np.array_split(power, bands)])
    return bool(means.max() > 0.0 and means.min() > flat * means.max())


def without_spikes(row: FloatArray) -> FloatArray:
    """Return a channel with NaN where a sample stands out of the median of its neighbours."""
    good = np.flatnonzero(np.isfinite(row))
    if good.size < 16:
        return row
    apart = np.abs(row[good] - median_filter(row[good], 5, mode="nearest"))
    limit = 12.0 * np.median(apart[apart > 0.0]) if (apart > 0.0).any() else np.inf
    cleaned = row.copy()
    cleaned[good[apart > limit]] = np.nan
    return cleaned


def stretches(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, end) of each stretch of true values."""
    edges = np.flatnonzero(np.diff(np.r_[0, true.astype(int), 0]))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def filled(y: FloatArray, longest: int, reach: int, noise: float = 1e-4) -> FloatArray:
    """Return y, shape (nt,), with gaps of up to `longest` NaN filled; longer ones, and those at the ends, stay.

    A line would cut the crest off a wave; the conditional mean under the autocovariance, of `reach` samples on each
    side with a share `noise` of measurement noise, does not.
    """
    bad = ~np.isfinite(y)
    if not bad.any() or bad.all():
        return y
    out, good = np.array(y), np.flatnonzero(~bad)
    centre = y[good].mean()
    r = autocovariance(np.interp(np.arange(y.size), good, y[good]) - centre, 2 * reach + longest + 1)
    for start, end in stretches(bad):
        if start == 0 or end == y.size or end - start > longest:
            continue
        near = np.arange(max(0, start - reach), min(y.size, end + reach))
        known = near[~bad[near]]
        R = toeplitz(r[:near.size])[np.ix_(known - near[0], known - near[0])] + noise * r[0] * np.eye(known.size)
        cross = r[np.abs(np.arange(start, end)[:, None] - known)]
        out[start:end] = centre + cross @ cho_solve(cho_factor(R), y[known] - centre)
    return out


def autocovariance(y: FloatArray, lags: int, smooth: int = 5) -> FloatArray:
    """Return the autocovariance at lags 0 ... lags - 1 of the periodogram averaged over `smooth` bins."""
    window = np.hanning(y.size + 2)[1:-1]
    power = np.abs(np.fft.rfft(y * window, 2 * y.size)) ** 2 / np.sum(window**2)
    power = np.convolve(power, np.ones(smooth) / smooth, mode="same")
    return np.asarray(np.fft.irfft(power)[:lags], dtype=np.float64)


def bridged(time: FloatArray, values: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Return times and readings with those put in that are missing between even ones, by 1.5 periods [s] around."""
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + 0.5 * step, step)
    behind = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, time.size - 2)
    apart = time[behind + 1] - time[behind] > 2.5 * step
    missing = apart & (np.minimum(grid - time[behind], time[behind + 1] - grid) > 0.5 * step)
    if not missing.any():
        return time, values
    even = np.where(missing, np.nan, np.interp(grid, time, values))
    even = filled(even, grid.size, int(1.5 * period / step))
    order = np.argsort(at := np.r_[time, grid[missing]], kind="stable")
    return at[order], np.r_[values, even[missing]][order]


def unread(record: Record, at: FloatArray, longest: float, missed: float) -> list[tuple[float, float]]:
    """Return where a channel that is read `at` some times has a gap, or is not read yet or no more."""
    usual = missed * float(np.median(np.diff(at)))
    least = np.r_[usual, np.full(at.size - 1, max(longest, usual)), usual]
    around = np.r_[record.time[0], at, record.time[-1]]
    return [(float(around[k]), float(around[k + 1])) for k in np.flatnonzero(np.diff(around) > least)]


def even_samples(record: Record, name: str, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a channel on even times between its first and last sample."""
    there = np.isfinite(values)
    t = record.time[there]
    if t.size < 8:
        raise InputError(f"record {record.name}: {name} has {t.size} samples; at least 8 are needed")
    step = float(np.median(np.diff(t)))
    widest = int(np.argmax(np.diff(t)))
    if t[widest + 1] - t[widest] > 3.5 * step:
        raise InputError(f"record {record.name}: {name} has no sample from {t[widest]:.6g} to {t[widest + 1]:.6g} s; "
                         "take a part without gaps, record.window(start, end)")
    grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
    return grid, CubicSpline(t, values[there])(grid)
