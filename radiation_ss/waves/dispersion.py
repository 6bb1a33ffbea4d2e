"""Waves that travel: the frequency at which a moving body meets them, and another place."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft
from scipy.optimize import brentq
from scipy.signal import lfilter, lfiltic

from radiation_ss.arrays import FloatArray, positive, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.section.green import group_velocity, wave_number


def encounter_frequency(omega: ArrayLike, speed: float, heading: float = np.pi, *, depth: float = np.inf,
                        g: float = 9.81) -> FloatArray:
    """Return the frequency at which a body under way meets waves, w - k U cos(heading) [rad/s].

    Negative where the body overtakes the waves (following seas): the phase then runs backwards.

    Parameters
    ----------
    omega : array_like
        Circular frequencies of the waves [rad/s], positive.
    speed : float
        Forward speed U of the body [m/s].
    heading : float
        Direction in which the waves travel, from the body's forward direction [rad]: 0 following, pi head seas.
    depth, g : float
        Water depth [m], gravity [m/s^2].

    Examples
    --------
    A ship at 15.5 knots in head seas of 10 s:

    >>> we = encounter_frequency(2.0 * np.pi / 10.0, 15.5 * 1852.0 / 3600.0)
    >>> round(float(2.0 * np.pi / we), 3)
    6.619
    """
    if not (np.isfinite(speed) and np.isfinite(heading)):
        raise InputError(f"speed {speed} m/s, heading {heading} rad: finite numbers are needed")
    omega = np.asarray(omega, dtype=float)
    return omega - wave_number(omega**2 / g, depth) * speed * np.cos(heading)


def wave_frequencies(encounter: float, speed: float, heading: float = np.pi, *, depth: float = np.inf,
                     g: float = 9.81) -> tuple[float, ...]:
    """Return the wave frequencies that a body under way meets at one frequency [rad/s], ascending.

    One in head and beam seas; up to three in following seas, the last ones of waves that the body overtakes.

    Parameters
    ----------
    encounter : float
        Magnitude of the encounter frequency [rad/s], positive.
    speed, heading, depth, g
        As for `encounter_frequency`.

    Examples
    --------
    >>> [round(w, 4) for w in wave_frequencies(0.2, 8.0, 0.0)]
    [0.2516, 0.9746, 1.4013]
    """
    encounter = positive(encounter, "encounter", "rad/s")
    along = speed * np.cos(heading) if abs(np.cos(heading)) > 1e-12 else 0.0
    top = encounter if along <= 0.0 else g / (2.0 * along) * (1.0 + np.sqrt(1.0 + 4.0 * encounter * along / g))
    grid = np.concatenate([[1e-9 * top], np.linspace(0.0, 1.0 + 1e-9, 4001)[1:] * top])
    found: list[float] = []
    for target in (encounter, -encounter):
        def miss(w: ArrayLike, target: float = target) -> FloatArray:
            return encounter_frequency(w, speed, heading, depth=depth, g=g) - target

        values = miss(grid)
        turns = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
        found += [float(brentq(miss, grid[i], grid[i + 1], xtol=1e-14, rtol=1e-13)) for i in turns]
        found += grid[values == 0.0].tolist()
    return tuple(sorted(found))


def carry_elevation(elevation: ArrayLike, dt: float, distance: float, *, depth: float = np.inf, g: float = 9.81,
                    share: float = 0.99) -> FloatArray:
    """Return the elevation of long-crested waves some way farther on [m], NaN where the samples do not tell it.

    Each harmonic a e^{i w t} becomes a e^{i (w t - k d)}. Waves that pass the probe reach the place with their group
    speed: what has passed before the first sample, or passes after the last one, is not known there. The slowest and
    the fastest waves looked at are those between which `share` of the energy lies. There must be no waves from
    elsewhere.

    Parameters
    ----------
    elevation : array_like, shape (nt,)
        Even samples without gaps [m].
    dt : float
        Time step [s].
    distance : float
        From the probe to the place, in the direction in which the waves travel [m]; negative where they pass the place
        first.
    depth, g : float
        Water depth [m], gravity [m/s^2].
    share : float
        0 to 1.

    Raises
    ------
    InputError
        If a sample is missing, or the record is shorter than the waves' way.

    Examples
    --------
    A wave of 1 s in deep water is 1.56 m long: 0.78 m farther on it is in opposite phase.

    >>> t = 0.02 * np.arange(3000)
    >>> moved = carry_elevation(np.cos(2.0 * np.pi * t), 0.02, 9.81 / (4.0 * np.pi))
    >>> round(float(moved[1500] / np.cos(2.0 * np.pi * t[1500])), 2)
    -1.0
    """
    x = read_only(elevation, "elevation", (None,))
    dt, depth = positive(dt, "dt", "s"), positive(depth, "depth", "m", or_infinite=True)
    if not np.isfinite(distance):
        raise InputError(f"distance: {distance} m; a finite number is needed")
    mean = float(x.mean())
    energy = np.cumsum(np.abs(rfft((x - mean) * np.hanning(x.size))[1:]) ** 2)
    omega = 2.0 * np.pi / (x.size * dt) * np.arange(1, energy.size + 1)
    if energy[-1] == 0.0:
        return np.array(x)
    low, middle, high = (omega[np.searchsorted(energy, part * energy[-1])] for part in
                         (0.5 * (1.0 - share), 0.5, 0.5 * (1.0 + share)))
    ends = np.array([low, high])
    lags = distance / group_velocity(ends, wave_number(ends**2 / g, depth), depth)
    # Beyond the samples the waves go on as they went: a sudden end would send waves of all lengths.
    more = int(2.0 * np.abs(lags).max() / dt) + 1
    order = min(int(6.0 * np.pi / (middle * dt)) + 2, x.size // 3)
    before, after = _continued(x[::-1] - mean, order, more)[::-1], _continued(x - mean, order, more)
    longer = np.concatenate([before, x - mean, after])
    period = next_fast_len(longer.size + more, real=True)
    harmonics = 2.0 * np.pi / (period * dt) * np.arange(1, period // 2 + 1)
    k = np.concatenate([[0.0], wave_number(harmonics**2 / g, depth)])
    moved = irfft(rfft(longer, period) * np.exp(-1j * k * distance), period)[more:more + x.size] + mean
    first = int(np.ceil(max(lags.max(), 0.0) / dt))
    last = x.size + int(np.floor(min(lags.min(), 0.0) / dt))
    if last - first < 2:
        raise InputError(f"elevation: {x.size * dt:.4g} s are too short; the waves need {np.abs(lags).max():.4g} s for "
                         f"{abs(distance):g} m")
    moved[:first] = moved[last:] = np.nan
    return moved


def _continued(x: FloatArray, order: int, count: int) -> FloatArray:
    """Return samples after the last one by linear prediction (Burg 1975: such a prediction never grows)."""
    ahead, back = x[1:], x[:-1]
    weights = np.ones(1)
    for _ in range(order):
        power = float(ahead @ ahead + back @ back)
        if power <= 1e-24 * float(x @ x) or ahead.size < 2:
            break
        reflection = -2.0 * float(ahead @ back) / power
        weights = np.append(weights, 0.0)
        weights = weights + reflection * weights[::-1]
        ahead, back = (ahead + reflection * back)[1:], (back + reflection * ahead)[:-1]
    past = lfiltic([1.0], weights, x[:-weights.size:-1])
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / count)
    return lfilter([1.0], weights, np.zeros(count), zi=past)[0] * fade
