"""The noise of each channel: unknown to the program, estimated from residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.drift import Drift, drift_of
from radiation_ss.simulation.prepare import Channel

DRIFT_NUMBERS = 2  # beside the innovation's deviation


def mean_square(values: FloatArray) -> float:
    """Return the mean square."""
    return float(np.mean(np.square(values)))


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of each channel: a drifting zero beside white noise, or none, then an autoregression.

    Parameters
    ----------
    deviation : tuple of float
        Standard deviation of the innovation.
    filters : tuple of ndarray
        Coefficients 1, -phi_1, ... of the whitening filter.
    drifts : tuple of Drift or None
        What is taken out before; None where nothing drifts.
    """

    deviation: tuple[float, ...]
    filters: tuple[FloatArray, ...]
    drifts: tuple[Drift | None, ...]

    def whiten(self, channel: int, values: FloatArray) -> FloatArray:
        """Return values along axis 0, filtered to unit white noise."""
        drift, taps = self.drifts[channel], self.filters[channel]
        values = values if drift is None else drift.innovations(values)
        result = values / self.deviation[channel]
        for lag in range(1, taps.size):
            result[lag:] += (taps[lag] / self.deviation[channel]) * values[:-lag]
        return result

    def colour(self, channel: int, values: FloatArray) -> FloatArray:
        """Return noise made of unit white noise: the inverse of `whiten`, once the first samples are gone."""
        drawn = lfilter([self.deviation[channel]], self.filters[channel], values)
        drift = self.drifts[channel]
        return np.asarray(drawn if drift is None else lfilter([1.0, -drift.pole], [1.0, -drift.memory], drawn))


def white(deviations: Sequence[float]) -> Noise:
    """Return white noise of given standard deviations."""
    return Noise(tuple(map(float, deviations)), tuple(np.ones(1) for _ in deviations), (None,) * len(deviations))


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
    """Fit the noise of each channel's residual, not below its floor; with a drift where BIC is for it.

    Columns of a residual, if it has several, are independent parts: their covariances add.
    """
    deviations, filters, drifts = [], [], []
    for residual, floor in zip(residuals, floors):
        score, deviation, taps = autoregression(residual, order)
        drift = drift_of(residual)
        if drift is not None:
            with_drift = autoregression(drift.innovations(residual), order)
            if with_drift[0] + DRIFT_NUMBERS * np.log(len(residual)) < score:
                _, deviation, taps = with_drift
            else:
                drift = None
        deviations.append(max(deviation, floor))
        filters.append(taps)
        drifts.append(drift)
    return Noise(tuple(deviations), tuple(filters), tuple(drifts))


def autoregression(values: FloatArray, order: int) -> tuple[float, float, FloatArray]:
    """Return BIC, innovation deviation and whitening taps 1, -phi of the order that BIC chooses (Yule-Walker)."""
    n = len(values)
    covariance = np.array([np.sum(values[: n - k] * values[k:]) / n for k in range(order + 1)])
    if covariance[0] <= 0.0:
        return -np.inf, 1e-300, np.ones(1)
    best = (n * float(np.log(covariance[0])), covariance[0], np.ones(1))
    for p in range(1, order + 1):
        phi = solve_toeplitz(covariance[:p] + 1e-9 * covariance[0] * (np.arange(p) == 0), covariance[1:p + 1])
        variance = covariance[0] - phi @ covariance[1:p + 1]
        if variance <= 0.0:
            break
        score = n * float(np.log(variance)) + p * float(np.log(n))
        if score < best[0]:
            best = (score, variance, np.concatenate([[1.0], -phi]))
    return best[0], float(np.sqrt(best[1])), best[2]
