"""Gaps in a signal: where they are, and what the signal did there by its own autocovariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, toeplitz

from radiation_ss.arrays import FloatArray


def stretches(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, end) of each stretch of true values."""
    edges = np.flatnonzero(np.diff(np.r_[0, true.astype(int), 0]))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def filled(y: FloatArray, longest: int, reach: int, noise: float = 1e-4) -> FloatArray:
    """Return y, shape (nt,), with gaps of up to `longest` NaN filled; longer ones, and those at the ends, stay.

    A straight line would cut the crest off a wave; the conditional mean under the record's autocovariance does not.
    `reach`: samples looked at on each side of a gap. `noise`: share of the variance that the neighbours carry as
    measurement noise.
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
    """Return times and readings, shape (nt,) each, with those put in that are missing between evenly spaced ones.

    `period`: of the motion [s]; 1.5 of them are looked at on each side of a gap.
    """
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
