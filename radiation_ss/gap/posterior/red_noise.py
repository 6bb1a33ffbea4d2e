"""What of a residual is noise though it is not white: a sensor's drift, and tones where no body moves.

What a model lacks moves with the body: its residual has its power where the motion has, and falls with the motion. A
sensor's drift does neither. Within the motion's band a residual counts as noise where both hold:

* its spectrum is that of white noise and a first-order drift within chance, in the whole band of the motion;
* block by block its energy is e = n^2 + s^2 m^2, m^2 the predicted motion's, and a fair share is n^2 beyond doubt. The
  energy of a block is about exponential; a few that hold most of it are an event. Where the motion is as large all the
  time nothing can be said.

Far above the motion inertia keeps the body still: what is left there may have any spectrum and is noise if it does not
fall with the motion.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import gamma

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.drift import binned, drift_of
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.gap.posterior.setting import channel_omegas
from radiation_ss.simulation.prepare import Channel

ABOVE = 6.0  # times the typical frequency the receptance is a thirty-fifth of that at rest
BAND = (0.5, 3.5)  # of the typical frequency: where what a model lacks would show
CHANCE = 1e-3  # that a bin of pure noise is as loud
SPREAD = 1.5  # ordinates that a Hann window makes one of
FEWEST = 8  # blocks
DROP = 1.35  # of log likelihood: a one-sided bound of 95 %
FAIR = 0.1  # of the residual's energy that is n^2 beyond doubt
EVENT = 3.0  # standard deviations
SHARES = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 60)])


def noise_with_drift(found: Fit, floors: tuple[float, ...]) -> tuple[float, ...]:
    """Return the noise of each channel: its white floor, or more where the residual is a drift or above the motion."""
    return tuple(max(floor, noise_in(channel, residual, omega))
                 for (channel, residual, omega), floor in zip(with_frequency(found), floors))


def drifting(found: Fit) -> list[bool]:
    """Say of each channel whether its sensor drifts: it does in every record, so beyond doubt in most of them."""
    sensors: dict[tuple[int, str], list[bool]] = {}
    for channel, residual, omega in with_frequency(found):
        beyond_doubt = (is_drift(channel.time, residual, omega)
                        and steady_noise(channel, residual, residual - residual.mean(), omega) > 0.0)
        sensors.setdefault((channel.dof, channel.quantity), []).append(beyond_doubt)
    return [bool(np.mean(sensors[c.dof, c.quantity]) > 0.5) for c, _, _ in with_frequency(found)]


def with_frequency(found: Fit) -> list[tuple[Channel, FloatArray, float]]:
    """Return each channel with its residual and the typical frequency of its motion [rad/s]."""
    setting = found.problem.setting
    channels = [c for item in setting.records for c in item.channels]
    return list(zip(channels, found.point.residuals, channel_omegas(setting)))


def noise_in(channel: Channel, residual: FloatArray, omega: float) -> float:
    """Return the rms of what is noise beyond doubt in a residual, its mean apart; 0 where that cannot be told."""
    part = (residual - residual.mean() if is_drift(channel.time, residual, omega)
            else fast(channel.time, residual, ABOVE * omega))
    return steady_noise(channel, residual, part, omega)


def steady_noise(channel: Channel, residual: FloatArray, part: FloatArray, omega: float) -> float:
    """Return the rms of what of a part of a residual does not fall with the motion; 0 where that cannot be told."""
    e, m = blocks(channel.time, part, channel.value - residual, 2.0 * np.pi / omega)
    least, likely = steady(e, m)
    return float(np.sqrt(likely)) if least > FAIR * mean_square(part) and not eventful(e) else 0.0


def eventful(e: FloatArray) -> bool:
    """Whether the energy of blocks is that of an event, a gust say: spread wider than exponential ones are.

    The squared coefficient of variation of B exponential values is 1 with a variance of 8 / B.
    """
    return bool(np.var(e) > (1.0 + EVENT * np.sqrt(8.0 / e.size)) * np.mean(e) ** 2)


def fast(time: FloatArray, values: FloatArray, omega: float) -> FloatArray:
    """Return the part above a frequency."""
    at = 2.0 * np.pi * np.fft.rfftfreq(values.size, float(np.median(np.diff(time))))
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * (at > omega), values.size))


def blocks(time: FloatArray, residual: FloatArray, motion: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """Return mean squares of residual and motion in blocks of time."""
    block = ((time - time[0]) / length).astype(int)
    count = np.bincount(block)
    full = count > 0.5 * np.median(count)
    e, m = (np.bincount(block, v**2)[full] / count[full] for v in (residual, motion))
    return e, m


def steady(e: FloatArray, m: FloatArray) -> tuple[float, float]:
    """Return lower bound and likeliest value of n^2; zeros of too few blocks, or of nothing."""
    if e.size < FEWEST or not np.any(e):
        return 0.0, 0.0
    # n^2 = share * scale, s^2 m^2 = (1 - share) * scale * m^2 / mean(m^2): the scale that is most likely is a mean.
    shape = np.maximum(SHARES[:, None] + (1.0 - SHARES[:, None]) * m / m.mean(), 1e-12)
    scale = np.mean(e / shape, axis=1)
    loglik = -(e.size * np.log(scale) + np.log(shape).sum(axis=1))
    first, best = int(np.argmax(loglik > loglik.max() - DROP)), int(np.argmax(loglik))
    return float(SHARES[first] * scale[first]), float(SHARES[best] * scale[best])


def is_drift(time: FloatArray, residual: FloatArray, omega: float) -> bool:
    """Whether a residual's spectrum is that of white noise and a first-order drift around the motion's frequency."""
    drift = drift_of(residual)
    if drift is None:
        return False
    at, power, count = binned(residual)
    typical = omega * float(np.median(np.diff(time)))  # rad/sample
    inside = (at > BAND[0] * typical) & (at < BAND[1] * typical)
    freedom = np.maximum(count[inside] / SPREAD, 1.0)
    ratio = power[inside] / drift.spectrum(np.cos(at[inside]))
    return bool(np.all(ratio < gamma.isf(CHANCE, freedom) / freedom))
