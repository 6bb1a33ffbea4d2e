"""The noise of each channel: unknown to the program, estimated from residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz

from radiation_ss.arrays import FloatArray
from radiation_ss.simulation.prepare import Channel


def mean_square(values: FloatArray) -> float:
    """Return the mean square."""
    return float(np.mean(np.square(values)))


@dataclass(frozen=True, eq=False)
class Noise:
    """Autoregressive noise of each channel.

    Parameters
    ----------
    deviation : tuple of float
        Standard deviation of the innovation.
    filters : tuple of ndarray
        Coefficients 1, -phi_1, ... of the whitening filter.
    """

    deviation: tuple[float, ...]
    filters: tuple[FloatArray, ...]

    def whiten(self, channel: int, values: FloatArray) -> FloatArray:
        """Return values along axis 0, filtered to unit white noise; the first samples, without a past, weigh less."""
        taps = self.filters[channel]
        result = values / self.deviation[channel]
        for lag in range(1, taps.size):
            result[lag:] += (taps[lag] / self.deviation[channel]) * values[:-lag]
        return result


def white(deviations: Sequence[float]) -> Noise:
    """Return white noise of given standard deviations."""
    return Noise(tuple(map(float, deviations)), tuple(np.ones(1) for _ in deviations))


def floor_of(channel: Channel, residual: FloatArray, omega: float) -> float:
    """Return the standard deviation of white noise from the residual's spectrum far above the motion.

    Parameters
    ----------
    channel : Channel
    residual : ndarray
        Residual of any reasonable fit; its smooth part does not matter.
    omega : float
        Typical circular frequency of the motion [rad/s].
    """
    dt = np.median(np.diff(channel.time))
    nyquist = np.pi / dt
    power = np.abs(np.fft.rfft((residual - residual.mean()) * np.hanning(residual.size))) ** 2
    power = power / np.sum(np.hanning(residual.size) ** 2)
    at = 2.0 * np.pi * np.fft.rfftfreq(residual.size, dt)
    low = min(5.0 * omega, 0.6 * nyquist)
    band = power[(at >= low) & (at <= 0.98 * nyquist)]
    if band.size < 4:
        return float(np.std(residual))
    # The median of exponentially distributed ordinates is log 2 times their mean, and does not see harmonics.
    level = float(np.median(band) / np.log(2.0))
    return max(np.sqrt(level), 1e-9 * float(np.std(channel.value)) + 1e-300)


def coloured(residuals: Sequence[FloatArray], floors: Sequence[float], order: int = 4) -> Noise:
    """Fit an autoregression to each channel's residual (Yule-Walker, order by BIC), not below its floor."""
    deviations, filters = [], []
    for residual, floor in zip(residuals, floors):
        deviation, taps = autoregression(residual, order)
        deviations.append(max(deviation, floor))
        filters.append(taps)
    return Noise(tuple(deviations), tuple(filters))


def autoregression(values: FloatArray, order: int) -> tuple[float, FloatArray]:
    """Return innovation deviation and whitening taps 1, -phi of the order that BIC chooses."""
    n = values.size
    covariance = np.array([values[: n - k] @ values[k:] / n for k in range(order + 1)])
    if covariance[0] <= 0.0:
        return 1e-300, np.ones(1)
    best = (n * np.log(covariance[0]), covariance[0], np.ones(1))
    for p in range(1, order + 1):
        phi = solve_toeplitz(covariance[:p] + 1e-9 * covariance[0] * (np.arange(p) == 0), covariance[1:p + 1])
        variance = covariance[0] - phi @ covariance[1:p + 1]
        if variance <= 0.0:
            break
        score = n * np.log(variance) + p * np.log(n)
        if score < best[0]:
            best = (score, variance, np.concatenate([[1.0], -phi]))
    return float(np.sqrt(best[1])), best[2]
