"""Short gaps of a stationary record, filled by their conditional mean given what is measured around them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, toeplitz

from radiation_ss.arrays import FloatArray

NOISE = 1e-4        # of the record's variance: measurement noise of 1 % that the neighbours carry
SMOOTH = 5          # bins of the spectrum averaged


def filled(y: FloatArray, longest: int, reach: int) -> FloatArray:
    """Return y, shape (nt,), with gaps of up to `longest` NaN filled; longer ones, and those at the ends, stay.

    A straight line would cut the crest off a wave; the conditional mean under the record's autocovariance does not.

    Parameters
    ----------
    reach : int
        Samples looked at on each side of a gap.
    """
    bad = ~np.isfinite(y)
    if not bad.any() or bad.all():
        return y
    out, good = np.array(y), np.flatnonzero(~bad)
    r = autocovariance(np.interp(np.arange(y.size), good, y[good]) - y[good].mean(), 2 * reach + longest + 1)
    edges = np.flatnonzero(np.diff(np.r_[0, bad.astype(int), 0]))
    for start, end in zip(edges[::2], edges[1::2]):
        if start == 0 or end == y.size or end - start > longest:
            continue
        near = np.arange(max(0, start - reach), min(y.size, end + reach))
        known, gap = near[~bad[near]], np.arange(start, end)
        R = toeplitz(r[:near.size])[np.ix_(known - near[0], known - near[0])] + NOISE * r[0] * np.eye(known.size)
        cross = r[np.abs(gap[:, None] - known)]
        centre = y[good].mean()
        out[gap] = centre + cross @ cho_solve(cho_factor(R), y[known] - centre)
    return out


def autocovariance(y: FloatArray, lags: int) -> FloatArray:
    """Return the autocovariance at lags 0 ... lags - 1 of the smoothed periodogram, so that it is positive definite."""
    window = np.hanning(y.size + 2)[1:-1]
    power = np.abs(np.fft.rfft(y * window, 2 * y.size)) ** 2 / np.sum(window**2)
    power = np.convolve(power, np.ones(SMOOTH) / SMOOTH, mode="same")
    return np.asarray(np.fft.irfft(power)[:lags], dtype=np.float64)
