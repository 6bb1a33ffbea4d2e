"""Quadrature shared by the transforms and the section solver."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray


def gauss(number: int) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre points and weights on [0, 1]."""
    t, w = np.polynomial.legendre.leggauss(number)
    return 0.5 * (t + 1.0), 0.5 * w


def composite(grid: FloatArray, parts: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Return Gauss points and weights on all intervals of the grid, each cut in equal parts."""
    u, du = gauss(6)
    step = np.repeat(np.diff(grid) / parts, parts)
    first = np.repeat(grid[:-1], parts) + step * np.concatenate([np.arange(p) for p in parts])
    return (first[:, None] + step[:, None] * u).ravel(), (step[:, None] * du).ravel()


def fourier_integral(x: FloatArray, f: FloatArray, y: FloatArray) -> ComplexArray:
    """Return int f(x) e^{i x y} dx over the range of x by Gauss quadrature of the spline, fine enough for max(y)."""
    parts = np.maximum(1, np.ceil(np.diff(x) * y.max() / 4.0)).astype(int)
    nodes, weights = composite(x, parts)
    values = (CubicSpline(x, f)(nodes) * weights[:, None, None]).reshape(nodes.size, -1)
    block = max(1, 4_000_000 // nodes.size)
    rows = [np.exp(1j * y[i:i + block, None] * nodes) @ values for i in range(0, y.size, block)]
    return np.concatenate(rows).reshape(y.size, *f.shape[1:])


def exponential_integral(power: float, x: FloatArray) -> ComplexArray:
    """Return int_1^oo u^-power e^{i x u} du for x >= 0 and power > 1 (or power = 1 and x > 0), shape of x.

    Legendre's continued fraction for x >= 2; below, the part up to u = 2/x by Gauss quadrature in ln u.
    """
    x = np.asarray(x, dtype=float)
    found = np.full(x.shape, 1.0 / (power - 1.0) if power > 1.0 else np.inf, dtype=complex)
    for low, high, terms in ((2.0, 20.0, 120), (20.0, np.inf, 25)):
        part = (x >= low) & (x < high)
        found[part] = _continued_fraction(power, x[part], terms)
    small = (x > 0.0) & (x < 2.0)
    stretch = np.log(2.0 / x[small])
    v, dv = gauss(60)
    steps = stretch[:, None] * v
    inner = stretch * (np.exp((1.0 - power) * steps + 1j * x[small, None] * np.exp(steps)) @ dv)
    found[small] = inner + np.exp((1.0 - power) * stretch) * _continued_fraction(power, np.array([2.0]), 120)
    return found


def _continued_fraction(power: float, x: FloatArray, terms: int) -> ComplexArray:
    z = -1j * x
    fraction = np.zeros_like(z)
    for k in range(terms, 0, -1):
        fraction = k * (power + k - 1.0) / (z + power + 2.0 * k - fraction)
    return np.exp(-z) / (z + power - fraction)  # E_power(z)
