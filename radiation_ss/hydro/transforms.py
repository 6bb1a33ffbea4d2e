"""Ogilvie's relations (2)-(4) between added mass, damping and retardation kernel, on a finite band.

Between the given frequencies the data are a cubic spline; above the last one a power law fitted to the top of the band;
below the first one a parabola through the first three. What the two continuations contribute is reported, not hidden.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray, lagrange, read_only
from radiation_ss.errors import InputError


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


@dataclass(frozen=True, eq=False)
class Tail:
    """Continuation B = value (omega_N / omega)^power above the last frequency omega_N."""

    omega: float  # omega_N [rad/s]
    # value, power (n, n)
    value: FloatArray
    power: FloatArray
    fitted: np.ndarray  # (n, n): False where the top of the band shows no decay of one sign and the power 3 is assumed
    share: FloatArray  # (n, n): int of |B| above omega_N, of the whole int of |B|: what the data do not show


@dataclass(frozen=True, eq=False)
class InfiniteAddedMass:
    """A_inf estimated by Kramers-Kronig, with its uncertainty."""

    # value, std (n, n): Estimate and standard uncertainty: spread over the frequencies, and what the tail contributes
    value: FloatArray
    std: FloatArray
    tail: Tail
    rising: NDArray[np.bool_]  # (n, n): Whether the damping rises up to the end of the band: all of the value is unsure


def fit_tail(omega: ArrayLike, B: ArrayLike, powers: tuple[float, float] = (1.5, 12.0), usual: float = 3.0) -> Tail:
    """Fit a power law to the damping over the highest frequencies.

    `omega` (nw,): [rad/s]. `B` (nw, n, n). `powers`: slowest and fastest decay that the data can show; a slower one is
    not fitted. `usual`: power where the data show none.
    """
    w, values = _band(omega, B, "B")
    top = w >= min(0.8 * w[-1], w[-4])
    upper = values[top]
    sign = np.sign(upper)
    one_sign = (np.abs(sign.sum(axis=0)) == upper.shape[0])
    x = np.log(w[top] / w[-1])
    logs = np.log(np.where(one_sign, np.abs(upper), 1.0))
    slope = -np.tensordot(x - x.mean(), logs, axes=(0, 0)) / np.sum((x - x.mean()) ** 2)
    fitted = one_sign & (slope > powers[0])
    power = np.where(fitted, np.minimum(slope, powers[1]), usual)
    inside = np.trapezoid(np.abs(values), w, axis=0) + 0.5 * w[0] * np.abs(values[0])
    outside = np.abs(values[-1]) * w[-1] / (power - 1.0)
    total = inside + outside
    share = np.divide(outside, total, out=np.zeros_like(total), where=total > 0.0)
    return Tail(float(w[-1]), values[-1].copy(), power, fitted, share)


def kernel(omega: ArrayLike, B: ArrayLike, t: ArrayLike) -> FloatArray:
    """Return the retardation kernel L(t) = 2/pi int_0^oo B cos(wt) dw (2), shape (nt, n, n).

    `omega` (nw,): [rad/s]. `B` (nw, n, n): radiation damping. `t` (nt,): [s].
    """
    w, values = _band(omega, B, "B")
    times = read_only(np.atleast_1d(t), "t", (None,), finite=False)
    if times.size == 0 or not np.isfinite(times).all() or times.min() < 0.0:
        raise InputError("t: times must be finite and not negative, in seconds")
    tail = fit_tail(w, values)
    grid, full = _with_zero(w, values)
    L = fourier_integral(grid, full, times).real
    powers, which = np.unique(tail.power, return_inverse=True)
    beyond = w[-1] * np.stack([exponential_integral(p, w[-1] * times).real for p in powers], axis=-1)
    return 2.0 / np.pi * (L + tail.value * beyond[:, which.reshape(tail.power.shape)])


def added_mass_from_damping(omega: ArrayLike, B: ArrayLike, *, tail: bool = True) -> FloatArray:
    """Return A - A_inf by Kramers-Kronig, 2/pi PV int_0^oo B(w') / (w'^2 - w^2) dw', shape (nw, n, n).

    From (2) and (4). `tail=False` leaves the continuation above the band out. Least certain near the band's end.
    """
    w, values = _band(omega, B, "B")
    grid, full = _with_zero(w, values)
    nodes, weights = composite(grid, np.ones(w.size, dtype=int))
    beyond = fit_tail(w, values)
    s, ds = gauss(60)
    upper = w[-1] / s
    outside = beyond.value * s[:, None, None] ** beyond.power if tail else np.zeros((s.size, *values.shape[1:]))
    x = np.concatenate([nodes, upper])
    W = np.concatenate([weights, ds * w[-1] / s ** 2])
    f = np.concatenate([CubicSpline(grid, full)(nodes), outside])
    ratio = W / (x ** 2 - w[:, None] ** 2)  # PV int dw' / (w'^2 - w^2) = 0, so B(w) is subtracted
    own = ratio.sum(axis=1)[:, None, None] * values
    return 2.0 / np.pi * (np.tensordot(ratio, f, axes=(1, 0)) - own)


def beside_implied(omega: ArrayLike, A: ArrayLike, B: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return A - A_inf less what B implies by Kramers-Kronig, (nw, n, n), and the A_inf of its median, (n, n).

    It is zero of a causal body. Below the lowest and above nine tenths of the highest frequency it is less sure.
    """
    raw = np.asarray(A) - added_mass_from_damping(omega, B)
    w = np.asarray(omega)
    level = np.median(raw[(w > w[0]) & (w < 0.9 * w[-1])], axis=0)
    return raw - level, level


def estimate_A_inf(omega: ArrayLike, A: ArrayLike, B: ArrayLike, least: float = 1e-3,
                   large: float = 0.5) -> InfiniteAddedMass:
    """Estimate A_inf as the level that A and the Kramers-Kronig transform of B differ by.

    Each frequency gives one estimate; the median over the middle of the band is taken. Where the damping, by a line
    through the last fifth of the band, rises, to `large` of its largest at the end, and B / w there is `least` of
    A_inf, most of it may lie beyond: the estimate may be all wrong.
    """
    (w, mass), (_, damping) = _band(omega, A, "A"), _band(omega, B, "B")
    with_tail = mass - added_mass_from_damping(w, B)
    without = mass - added_mass_from_damping(w, B, tail=False)
    used = (w > w[0]) & (w < 0.9 * w[-1]) if w.size > 5 else np.ones(w.size, dtype=bool)
    value = np.median(with_tail[used], axis=0)
    low, high = np.quantile(with_tail[used], [0.1, 0.9], axis=0)
    spread = (high - low) / 2.563  # the standard deviation of a normal distribution with these quantiles
    continuation = np.abs(np.median(with_tail[used] - without[used], axis=0))
    size, top = np.abs(damping), w >= min(0.8 * w[-1], w[-4])
    slope = np.tensordot(w[top] - w[top].mean(), size[top], axes=(0, 0))
    rising = (slope > 0.0) & (size[-1] >= large * size.max(axis=0)) & (size[-1] > least * w[-1] * np.abs(value))
    std = np.maximum(np.hypot(spread, continuation), np.where(rising, np.abs(value), 0.0))
    return InfiniteAddedMass(value, std, fit_tail(w, B), rising)


def _band(omega: ArrayLike, values: ArrayLike, name: str) -> tuple[FloatArray, FloatArray]:
    grid = read_only(omega, "omega", (None,))
    if grid.size < 4 or np.any(np.diff(grid) <= 0.0):
        raise InputError(f"omega: at least 4 ascending frequencies [rad/s] are needed, {grid.size} values found")
    return grid, read_only(values, name, (grid.size, None, None))


def _with_zero(w: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Add omega = 0 by the parabola through the first three values; where that would change sign, zero."""
    zero = np.tensordot(lagrange(w[:3], 0.0), values[:3], 1)
    zero = np.where(zero * values[0] > 0.0, np.clip(zero, -2.0 * np.abs(values[0]), 2.0 * np.abs(values[0])), 0.0)
    return np.concatenate([[0.0], w]), np.concatenate([zero[None], values])
