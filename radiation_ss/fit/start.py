"""Rational functions of one entry: Sanathanan-Koerner starts, spectral factors, and the paper's own fit (8)."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.optimize import minimize

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.rational import impulse_response, observer_form


def sanathanan_koerner(x: FloatArray, K: ComplexArray, weight: FloatArray, order: int, *, zero: bool = False,
                       passes: int = 6, first: FloatArray | None = None) -> list[tuple[float, FloatArray, FloatArray]]:
    """Return (misfit, den, num) of stable rational starts, one a pass, constant term first, den without its leading 1.

    Each pass solves the linear least squares P K = Q with rows divided by |P| of the pass before (Sanathanan and
    Koerner 1963, IEEE Trans. Autom. Control 8, 56); unstable poles are mirrored into the left half plane, and the
    numerator is fitted anew, with `zero` without its constant, so that K(0) = 0. `first` (order,): denominator that the
    first pass divides by; it comes first among those returned. x, K, weight (nw,), frequencies scaled.
    """
    low = int(zero)
    powers = (1j * x[:, None]) ** np.arange(order + 1)
    columns = np.hstack([powers[:, low:order], -K[:, None] * powers[:, :order]])
    target = K * powers[:, order]

    divide = weight if first is None else weight / _size(powers, first)
    found = [] if first is None else [_numerator(x, K, weight, first, zero)]
    for _ in range(passes):
        den = _stabilised(least_squares(columns * divide[:, None], target * divide)[order - low:], x)
        divide = weight / _size(powers, den)
        found.append(_numerator(x, K, weight, den, zero))
    return found


def _numerator(x: FloatArray, K: ComplexArray, weight: FloatArray, den: FloatArray,
               zero: bool) -> tuple[float, FloatArray, FloatArray]:
    """Return (misfit, den, num) with the numerator of least squares over den."""
    low = int(zero)
    powers = (1j * x[:, None]) ** np.arange(den.size + 1)
    rows = powers[:, low:-1] * (weight / (powers @ np.r_[den, 1.0]))[:, None]
    num = least_squares(rows, weight * K)
    return float(np.linalg.norm(rows @ num - weight * K)), den, np.r_[np.zeros(low), num]


def _size(powers: NDArray, den: FloatArray) -> FloatArray:
    """Return |P(ix)|, kept from zero."""
    size = np.abs(powers[:, :-1] @ den + powers[:, -1])
    return np.asarray(np.maximum(size, 1e-9 * size.max()))


def spread(x: FloatArray, order: int) -> FloatArray:
    """Return a denominator of resonances over the band and, of odd order, a real pole."""
    factors = [np.array([1.0, 0.6 * at, at**2]) for at in np.geomspace(max(x[0], 0.15 * x[-1]), x[-1], order // 2)]
    return reduce(np.convolve, [*factors, *[np.array([1.0, 0.5 * x[-1]])] * (order % 2)], np.ones(1))[:0:-1]


def least_squares(rows: NDArray, target: NDArray) -> FloatArray:
    """Return the real solution of real or complex least squares, columns scaled to unit length."""
    if np.iscomplexobj(rows):
        rows, target = np.vstack([rows.real, rows.imag]), np.r_[target.real, target.imag]
    norms = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(rows / norms, target, rcond=None)[0] / norms)


def passive_numerator(den: FloatArray, num: FloatArray, zero: bool) -> FloatArray:
    """Return num moved towards a passive numerator over the same den as far as it takes.

    P'(s) / P(s) = sum 1 / (s - p_k) is positive real, and so is the sum of s / (s^2 + c1 s + c0) over the sections,
    which vanishes at s = 0.
    """
    full = np.r_[den, 1.0]
    if zero:
        safe = np.zeros(den.size)
        for c1, c0 in zip(*sections(den)):
            safe[1:] += np.polydiv(full[::-1], [1.0, c1, c0])[0][::-1]
    else:
        safe = full[1:] * np.arange(1, full.size)
    reach = 10.0 * max(float(np.abs(np.roots(full[::-1])).max()), 1.0)
    s = 1j * np.r_[np.geomspace(1e-4, 1.0, 400) * reach, np.abs(np.roots(full[::-1]).imag)]
    P = np.polyval(full[::-1], s)
    have, add = (np.real(np.polyval(q[::-1], s) / P) for q in (num, safe))
    short = np.max(np.where(add > 0.0, -have / np.maximum(add, 1e-300), 0.0))
    return np.asarray(num + max(1.05 * short, 0.0) * safe)


def _stabilised(den: FloatArray, x: FloatArray) -> FloatArray:
    """Return the denominator with every pole in the left half plane and within reach of the band."""
    roots = np.roots(np.r_[1.0, den[::-1]]).astype(complex)
    size = np.clip(np.abs(roots), 0.2 * x[0] + 1e-3, 5.0 * x[-1])
    angle = np.abs(np.angle(roots))
    angle = np.where(angle < np.pi / 2, np.pi - angle, angle)
    # Light damping is capped: a start on the imaginary axis cannot leave it.
    angle = np.where(roots.imag == 0.0, np.pi, np.maximum(angle, np.pi / 2 + 0.02))
    moved = size * np.exp(1j * angle * np.where(roots.imag < 0.0, -1.0, 1.0))
    return np.asarray(np.real(np.poly(moved))[:0:-1])


def sections(den: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (c1, c0) of the sections s^2 + c1 s + c0 of den; real poles are paired from both ends, an odd one left."""
    roots = np.roots(np.r_[1.0, den[::-1]])
    pairs = roots[roots.imag > 1e-12]
    real = np.sort(roots[np.abs(roots.imag) <= 1e-12].real)
    half = real.size // 2
    slow, fast = real[real.size - half:][::-1], real[:half]
    return np.r_[-2.0 * pairs.real, -(slow + fast)], np.r_[np.abs(pairs) ** 2, slow * fast]


def spectral_factor(den: FloatArray, num: FloatArray) -> FloatArray:
    """Return h, shape (n,), constant term first, with |h(iw)|^2 near Re[Q(iw) conj P(iw)]: exact where that is passive.

    Where the real part changes sign, the two ends of the negative interval become one double root between them.
    """
    n = den.size
    full, sign = np.r_[den, 1.0], (-1.0) ** np.arange(n + 1)
    even = np.convolve(num, full * sign)[::2]  # coefficients of s^0, s^2, ...
    if not np.any(even):
        return np.full(n, 1e-3)
    roots = np.sqrt(np.roots(even[::-1]).astype(complex))
    roots = np.where(roots.real > 0.0, -roots, roots)
    crossing = np.abs(roots.real) < 1e-7 * np.abs(roots)
    ends = np.sort(np.abs(roots[crossing]))
    paired = np.repeat(np.sqrt(ends[:-1:2] * ends[1::2]), 2) * np.tile([1j, -1j], ends.size // 2)
    kept = np.r_[roots[~crossing], paired, -ends[ends.size - ends.size % 2:]]
    lead = np.sqrt(abs(even[even.size - 1 - int(np.argmax(even[::-1] != 0.0))]))
    h = lead * np.atleast_1d(np.real(np.poly(kept)))[::-1]  # np.poly of no roots is a bare 1.0
    return np.r_[h, np.zeros(n - h.size)][:n]


def fit_kernel(problem: Problem, order: int, first: tuple[FloatArray, FloatArray],
               samples: int = 120) -> tuple[FloatArray, FloatArray]:
    """Return (den, num), scaled, that minimise sum (L(t_i) - c exp(a t_i) b)^2 from a start: the paper's fit.

    Kernel samples, quasi-Newton, numerical differences, no constraint (Yu and Falnes 1995; Hanaki et al. 2022, section
    2). It may be unstable or not passive, and depends on its start. `problem`: of one degree of freedom. `first`
    (order,): start values (den, num), constant term first.
    """
    t = np.linspace(0.0, 12.0 * np.pi / problem.x[-1], samples)
    x, damping = np.r_[0.0, problem.x], np.r_[0.0, problem.K[:, 0].real]
    if not problem.zero:
        damping[0] = damping[1]
    kernel = 2.0 / np.pi * trapezoid(damping * np.cos(np.outer(t, x)), x, axis=1)  # (2), over the band

    def misfit(theta: FloatArray) -> float:
        with np.errstate(over="ignore", invalid="ignore"):
            model = impulse_response(*observer_form(theta[:order], theta[order:]), t)[:, 0, 0]
            value = float(np.sum((kernel - model) ** 2) / np.sum(kernel**2))
        return value if np.isfinite(value) else 1e6

    best = minimize(misfit, np.concatenate(first), method="BFGS")
    return best.x[:order], best.x[order:]
