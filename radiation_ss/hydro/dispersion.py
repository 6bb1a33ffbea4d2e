"""The dispersion relation of linear water waves."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray


def wavenumber(omega: ArrayLike, depth: float = np.inf, g: float = 9.81) -> FloatArray:
    """Return the real wavenumber k [1/m] of omega^2 = g k tanh(k depth), by Newton's method.

    Parameters
    ----------
    omega : array_like
        Circular frequencies [rad/s], not negative.
    depth, g : float
        Water depth [m], gravity [m/s^2].
    """
    deep = np.asarray(omega, dtype=float) ** 2 / g
    if np.isinf(depth):
        return deep
    y = deep * depth
    # Eckart's start is within 5 % everywhere; Newton then doubles the digits each step.
    x = np.where(y > 0.0, y / np.sqrt(np.tanh(np.maximum(y, 1e-300))), 0.0)
    for _ in range(6):
        t = np.tanh(x)
        slope = t + x * (1.0 - t * t)
        x = np.where(slope > 0.0, x - (x * t - y) / np.where(slope > 0.0, slope, 1.0), 0.0)
    return x / depth
