"""A sensor whose zero drifts: white noise beside a first-order (Ornstein-Uhlenbeck) process.

An autoregression of a few samples cannot hold both, and takes the slow part for motion. Filter and first samples are
those of the Kalman filter of the drift d read with white noise of variance w,

    d' = memory d + q,   y = d + noise,

in its steady state but for the first sample, of which only the stationary variances are known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from radiation_ss.arrays import FloatArray

BINS = 3  # an octave
MEMORIES = 10.0  # in a record, at least: what lasts longer is an offset or a slow force
LEAST = 24  # samples from which on a spectrum says anything


@dataclass(frozen=True)
class Drift:
    """White noise and a drift.

    Parameters
    ----------
    white, variance : float
        Variances of the white noise and of the drift.
    memory : float
        Correlation of the drift from sample to sample, in (0, 1).
    """

    white: float
    variance: float
    memory: float

    @property
    def predicted(self) -> float:
        """Variance of the drift predicted one sample ahead: the positive root of Riccati's equation."""
        # P = m^2 P w / (P + w) + (1 - m^2) v  is  P^2 + P (w - m^2 w - (1 - m^2) v) - (1 - m^2) v w = 0
        new = (1.0 - self.memory**2) * self.variance
        half = 0.5 * ((1.0 - self.memory**2) * self.white - new)
        return float(-half + np.sqrt(half**2 + new * self.white))

    @property
    def gain(self) -> float:
        """Kalman gain of the steady state."""
        return self.predicted / (self.predicted + self.white)

    @property
    def pole(self) -> float:
        """Pole of the whitening filter, (1 - memory / z) / (1 - pole / z)."""
        return self.memory * (1.0 - self.gain)

    def innovations(self, values: FloatArray) -> FloatArray:
        """Return innovations of values along axis 0, all of the steady state's variance."""
        rest, first = self.white + self.variance, values[:1]
        begin = -self.memory * self.variance / rest * first
        later, _ = lfilter([1.0, -self.memory], [1.0, -self.pole], values[1:], axis=0, zi=begin)
        return np.concatenate([first * np.sqrt((self.predicted + self.white) / rest), later])

    def spectrum(self, cosine: FloatArray) -> FloatArray:
        """Return the power at frequencies of given cosine of omega dt; that of white noise is its variance."""
        m = self.memory
        return np.asarray(self.white + self.variance * (1.0 - m**2) / (1.0 - 2.0 * m * cosine + m**2))


def drift_of(values: FloatArray) -> Drift | None:
    """Return the drift that the spectrum of a residual shows best (Whittle's likelihood); None of too few samples.

    Columns, if there are several, are independent parts of it: their powers add.
    """
    if len(values) < LEAST or not np.any(values):
        return None
    at, power, count = binned(values)
    level = float(np.sum(values**2) / len(values))
    slowest = float(np.log(MEMORIES / len(values)))
    cosine, shares = np.cos(at), power / level
    low = max(float(np.log(shares.min())), -40.0)
    # Beyond these bounds one of the two variances is nothing beside the other, or the memory nothing in one sample.
    bounds = [(-60.0, 60.0), (-60.0, 60.0), (slowest, np.log(40.0))]
    starts = [np.array([low, 0.0, max(np.log(corner), slowest)]) for corner in (0.003, 0.03, 0.3)]
    found = [minimize(misfit, start, (cosine, shares, count), method="L-BFGS-B", jac=True, bounds=bounds)
             for start in starts]
    w, v, corner = np.exp(min(found, key=lambda one: float(one.fun)).x)
    return Drift(level * w, level * v, float(np.exp(-corner)))


def misfit(p: FloatArray, cosine: FloatArray, power: FloatArray, count: FloatArray) -> tuple[float, FloatArray]:
    """Return minus twice Whittle's log likelihood and its gradient.

    Of the logarithms of both variances and of the drift's corner, -log(memory) [rad/sample].
    """
    w, v, corner = np.exp(p)
    m = np.exp(-corner)
    below = 1.0 - 2.0 * m * cosine + m**2
    shape = (1.0 - m**2) / below
    S = w + v * shape
    bent = (-2.0 * m * below - (1.0 - m**2) * 2.0 * (m - cosine)) / below**2  # d shape / d memory
    slopes = np.array([np.full(S.size, w), v * shape, -v * bent * m * corner])
    return float(np.sum(count * (np.log(S) + power / S))), slopes @ (count * (1.0 - power / S) / S)


def binned(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return frequency [rad/sample], mean power and number of ordinates in bins of even width in log frequency."""
    parts = values.reshape(len(values), -1)
    window = np.hanning(len(parts))[:, None]
    spectra = np.fft.rfft((parts - parts.mean(axis=0)) * window, axis=0)
    power = np.sum(np.abs(spectra) ** 2, axis=1) / np.sum(window**2)
    at = np.pi * np.arange(power.size) / (power.size - 1)
    at, power = at[1:], power[1:]
    edges = np.geomspace(at[0], at[-1], max(int(BINS * np.log2(at[-1] / at[0])), 4) + 1)
    index = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(index, minlength=edges.size - 1).astype(float)
    there = count > 0
    frequency, mean = (np.bincount(index, v, minlength=edges.size - 1)[there] / count[there] for v in (at, power))
    return frequency, np.maximum(mean, 1e-300), count[there]
