"""Where fits start: the modes of the damping, rational functions of one entry; and the paper's own fit (8)."""

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.optimize import minimize

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.port import Start, beside, port_of
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.program import minimise, misfit_of
from radiation_ss.fit.rational import impulse_response, observer_form, response_of


def modal(problem: Problem, order: int, motions: int, rng: np.random.Generator, slight: float = 1e-2) -> Start:
    """Return the damping's modes, each fitted alone, side by side, disturbed by `slight`: zeros may have no slope."""
    K, weight = problem.whole(problem.K), problem.whole(problem.weight)
    U = np.linalg.eigh(K.real.sum(axis=0))[1][:, ::-1][:, :motions]
    parts = []
    for k in range(motions):
        mode = replace(problem.along(U[:, [k]]), weight=np.sqrt((weight**2 @ U[:, k] ** 2) @ U[:, k] ** 2)[:, None])
        size = float(np.abs(mode.K).max())
        mode = replace(mode, K=mode.K / size, K_points=mode.K_points / size)
        form, theta = alone(mode, order, rng, tried=2 if motions > 1 else 8)
        e1, e2, G, _ = form.unpack(theta)
        parts.append((e1, e2, G, np.sqrt(size) * form.realise(theta)[1][:form.n1] @ U[:, [k]].T))
    form, theta = beside(parts, problem.zero)
    return form, theta + slight * rng.normal(size=theta.size)


def alone(problem: Problem, order: int, rng: np.random.Generator, tried: int, steps: int = 10,
          slight: float = 1e-3) -> Start:
    """Return the model of one motion that is best after `steps` from each of the best `tried` rational starts."""
    rational = sorted(_rational(problem, order), key=lambda run: run[0])[:tried]
    forms = [beside([port_of(den, num)], problem.zero) for _, den, num in rational]
    runs = [(form, *minimise(misfit_of(form, problem), theta + slight * rng.normal(size=theta.size), steps))
            for form, theta in forms]
    form, theta, _ = min(runs, key=lambda run: run[2])
    return form, theta


def _rational(problem: Problem, order: int) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    """Yield (misfit, den, num) of passive Q / P by Sanathanan-Koerner from two starts on all samples and each half."""
    near = np.flatnonzero(problem.x <= problem.end)
    parts = [near, near[::2], near[1::2]][: 3 if near.size > 4 * order else 1]
    for part, first in product(parts, (None, spread(problem.x[near], order))):
        runs = sanathanan_koerner(problem.x[part], problem.K[part, 0], problem.weight[part, 0], order,
                                  zero=problem.zero, first=first)
        for _, den, num in (runs[2], min(runs, key=lambda run: run[0])):
            passive = passive_numerator(den, num, problem.zero)
            yield problem.misfit(response_of(den, passive, problem.x)[:, None]), den, passive


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
