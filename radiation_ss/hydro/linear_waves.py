"""Linear waves in water of constant depth: wave number, profile over the depth, group velocity. K = omega^2 / g."""

import numpy as np

from radiation_ss.arrays import FloatArray, positive


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
