"""The noise of a sensor, by the spectrum of its readings far above the motion."""

import numpy as np
from scipy.signal import periodogram, welch

from radiation_ss.arrays import FloatArray


def noise_of(values: FloatArray, dt: float, omega: float, segments: int = 8) -> float:
    """Return the standard deviation of a signal's white noise, from the median of its spectrum far above the motion.

    The mean over segments, which every part of the record has the same weight in: noise may grow with the motion. They
    have four periods at least.
    """
    _, _, far, count = spectra(values, dt, omega, segments)
    return float(np.sqrt(np.median(far[1]) / (2.0 * dt) / middle_of(count))) if far[1].size else 0.0


def spectra(values: FloatArray, dt: float, omega: float, segments: int
            ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray], int]:
    """Return frequencies and power density of a signal, both far above its motion, and how many segments it has."""
    length = int(np.clip(max(values.size // segments, 8 * np.pi / (omega * dt)), 1, values.size))
    frequency, power = welch(values - values.mean(), 1.0 / dt, "hann", length, scaling="density")
    at = 2 * np.pi * frequency
    far = (at > min(6.0 * omega, 0.7 * np.pi / dt)) & (at < 0.98 * np.pi / dt)
    return at, power, (at[far], power[far]), max(2 * values.size // length - 1, 1)


def middle_of(count: int) -> float:
    """Return the median by the mean of a mean of squares of two normal numbers each (Wilson and Hilferty)."""
    return float(np.log(2.0) if count == 1 else (1.0 - 1.0 / (9.0 * count)) ** 3)


def coloured_noise(values: FloatArray, dt: float, omega: float, at: FloatArray, white: float = 1.0,
                   segments: int = 8) -> FloatArray:
    """Return the standard deviations a sample of white noise as strong as a signal's at frequencies `at` [rad/s].

    Noise of the first order, S = s / (1 - 2 c cos(w dt) + c^2), by the spectrum far above the motion, where the motion
    itself may leave a tail, w^-6: the mean of all colours, each as probable as it fits the logarithms: many may fit.
    `white`: odds that it has none, by prior; every other motion has no tail. Nowhere more than the signal itself shows
    within half an octave to either side.
    """
    _, _, (high, far), count = spectra(values, dt, omega, segments)
    if not far.size or not np.all(far > 0.0):
        return np.zeros_like(at)
    colours, tails = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 0.95, 20),
                                                           [0.0, *np.geomspace(0.1, 1e4, 11)]))

    def shape(w: FloatArray) -> FloatArray:
        return np.asarray(1.0 / (1.0 - 2.0 * np.outer(colours, np.cos(w * dt)) + colours[:, None] ** 2))

    flat = far / (shape(high) + tails[:, None] * shape(high[:1]) * (high / high[0]) ** -6.0)
    # A mean of k squares of two normal numbers has a logarithm of variance 1 / k; under Hann's window bins go in pairs.
    fits = -0.25 * segments * high.size * np.var(np.log(flat), axis=1)
    weights = np.exp(fits - fits.max()) * np.where(colours > 0.0, 1.0, 19.0 * white) * np.where(tails > 0.0, 1.0, 11.0)
    density = weights @ (np.median(flat, axis=1)[:, None] * shape(at)) / middle_of(count) / weights.sum()
    frequency, power = periodogram(values, 1.0 / dt, "hann")
    near = np.abs(np.log2(np.maximum(2.0 * np.pi * frequency, 1e-300) / at[:, None])) <= 0.5
    lines = near.sum(axis=1)
    # By two standard deviations of a mean of squares more; under Hann's window those of neighbours go together.
    shown = near @ power / np.maximum(lines, 1) * (1.0 + 2.0 * np.sqrt(1.5 / np.maximum(lines, 1)))
    return np.asarray(np.sqrt(np.where(lines > 0, np.minimum(density, shown), density) / (2.0 * dt)))


def scatter(values: FloatArray, load: FloatArray, least: int = 8) -> float:
    """Return how far places lie from the straight line between those before and after, along the load between theirs.

    Their standard deviation, by the median: of a slow test no spectrum shows the noise, for its steps are no motion.
    NaN if fewer than `least` have a load between their neighbours': the median of so few is off by a third.
    """
    before, after = np.diff(load)[:-1], np.diff(load)[1:]
    along = before * after > 0.0
    if along.sum() < least:
        return np.nan
    share = before[along] / (before + after)[along]
    off = (values[1:-1] - values[:-2])[along] - share * (values[2:] - values[:-2])[along]
    return float(np.median(np.abs(off) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)) / 0.6745)
