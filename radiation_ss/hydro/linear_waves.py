"""Linear waves in water of constant depth: wave number, profile, group velocity, frequency of encounter.

K = omega^2 / g.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from radiation_ss.arrays import FloatArray, positive
from radiation_ss.errors import InputError


def wave_number(K: FloatArray, depth: float) -> FloatArray:
    """Return k0 of k tanh(k h) = K = omega^2 / g, to rounding, by Newton from Fenton & McKee's (1990) start."""
    K, depth = np.asarray(K, dtype=float), positive(depth, "depth", "m", or_infinite=True)
    if np.isinf(depth):
        return K
    target = K * depth
    x = target / np.tanh(target ** 0.75) ** (2.0 / 3.0)
    for _ in range(6):
        t = np.tanh(x)
        x = x - (x * t - target) / (t + x * (1.0 - t * t))
    return x / depth


def profile(k0: FloatArray, depth: float, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cosh k0(z + h) / cosh k0 h, e^{k0 z} in deep water, and its derivative k0 sinh k0(z + h) / cosh k0 h."""
    deep = np.exp(k0 * z)
    if np.isinf(depth):
        return deep, k0 * deep
    deep, image = deep / (1.0 + np.exp(-2.0 * k0 * depth)), np.exp(-2.0 * k0 * (z + depth))
    return deep * (1.0 + image), k0 * deep * (1.0 - image)


def group_velocity(omega: FloatArray, k0: FloatArray, depth: float) -> FloatArray:
    """Return the group velocity c_g [m/s]."""
    return 0.5 * omega / k0 * (1.0 + depth_ratio(k0, depth))


def depth_ratio(k0: FloatArray, depth: float) -> FloatArray:
    """Return 2 k0 h / sinh(2 k0 h)."""
    x = 2.0 * k0 * depth
    return np.zeros_like(k0) if np.isinf(depth) else 2.0 * x * np.exp(-x) / -np.expm1(-2.0 * x)


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
