"""Fit of one entry with CasADi and IPOPT: exact passivity without a frequency grid, stable by construction.

    K(s) = Q(s) / P(s),   P = prod (s^2 + c1 s + c0) (s + c),   Q free, of lower degree

With y = w^2, Re K(iw) |P(iw)|^2 = Re[Q(iw) conj P(iw)] = r(y) is a polynomial of degree n - 1. It is not negative for
y >= 0 exactly if r(y) = f(y)^2 + y g(y)^2 (Lukacs; Szegoe 1939, theorem 1.21.1), that is r(w^2) = |h(iw)|^2 with
h(s) = f(-s^2) + s g(-s^2). These n equations are the passivity constraint, and nothing is
redundant. Frequency points (25)-(27) are P K_c = Q at i w_c. IPOPT starts where cheap descents from many starts
(`radiation_ss.fit.descent`) end lowest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.fit.descent import Descent
from radiation_ss.fit.problem import Problem, check_size
from radiation_ss.fit.program import onto, solved
from radiation_ss.fit.rational import minimal, observer_form
from radiation_ss.fit.start import passive_numerator, sanathanan_koerner, sections, spectral_factor


@dataclass(frozen=True)
class Kind:
    """What one compiled program is for; programs are built once per kind and reused."""

    order: int
    samples: int
    points: int
    zero: bool
    passive: bool


@dataclass(frozen=True, eq=False)
class Rational:
    """A scaled fit: den and num, constant term first, and the weighted sum of squares over that of the data."""

    den: FloatArray
    num: FloatArray
    cost: float

    def response(self, x: FloatArray) -> ComplexArray:
        """Return Q(ix) / P(ix)."""
        s = 1j * x
        return np.asarray(np.polyval(self.num[::-1], s) / np.polyval(np.r_[1.0, self.den[::-1]], s))


def fit_single(problem: Problem, order: int, *, passive: bool = True, starts: Sequence[FloatArray] | None = None,
               tried: int = 2, near: float = 1.1) -> Rational:
    """Return the best fit over the starts, scaled.

    Parameters
    ----------
    problem : Problem
        Of one degree of freedom.
    starts : sequence of ndarray, shape (order,), optional
        Denominators that Sanathanan-Koerner starts from; by default its own start and resonances over the band.
    tried : int
        IPOPT's most runs from descents.
    near : float
        IPOPT runs from a further descent whose squared error is at most this factor of that of the first fit.

    Raises
    ------
    InputError
        If the order cannot carry K(0) = 0 or the points.
    SolverError
        If IPOPT reaches no solution from any start.
    """
    check_size(problem, order, order, 2 * order - int(problem.zero))
    thin = problem.thinned(600)
    alone = problem.x_points.size or starts is not None
    descents: dict[int, Rational] = {}
    best: list[Rational] = []
    for n in range(order if alone else 1 + int(problem.zero), order + 1):
        kind = Kind(n, 64 * -(-thin.x.size // 64), problem.x_points.size, problem.zero, passive)
        found: list[Rational] = []
        reasons: list[str] = []
        for guess in descended(thin, n, passive, descents, starts, steps=60)[:tried]:
            if found and guess.cost > near * found[0].cost:
                break
            solution, reason = _solve(kind, thin, guess.den, guess.num)
            if solution is None:
                reasons.append(reason)
            else:
                found.append(solution)
        best += found
    if not found:
        raise SolverError(f"{problem.dofs[0]}: IPOPT found no fit of order {order} ({', '.join(sorted(set(reasons)))})"
                          + ("; the frequency points may contradict a passive model" if problem.x_points.size else ""))
    # By all samples: what more states gain at those that were fitted they may lose between them.
    best += [] if alone else descents.values()
    return min(best, key=lambda fit: problem.misfit(fit.response(problem.x)[:, None]))


def descended(problem: Problem, order: int, passive: bool, smaller: dict[int, Rational],
              firsts: Sequence[FloatArray] | None = None, same: float = 1.001, steps: int = 0) -> list[Rational]:
    """Return the different local best fits that descents from all starts find, best first.

    Starts are Sanathanan-Koerner passes, and the fits of order - 1 and - 2 with factors that cancel, at two places, so
    that more states are never worse. `smaller` keeps the best of each order; descents within a factor `same` of their
    squared errors are one. The best three take up to `steps` more.
    """
    low, high = _bounds(problem, order)
    descent = Descent.of(problem, order, low, high, passive)
    guesses = []
    for first in (None, _spread(problem.x, order)) if firsts is None else firsts:
        runs = sanathanan_koerner(problem.x, problem.K[:, 0], problem.weight[:, 0], order, zero=problem.zero,
                                  first=first)
        guesses += [runs[2][1:], min(runs, key=lambda run: run[0])[1:]]
    guesses += _grown(problem, order, passive, smaller, steps)
    starts = []
    for den, num in guesses:
        other = spectral_factor(den, passive_numerator(den, num, problem.zero)) if passive else num
        starts.append(descent.variables(np.concatenate(sections(den)), other))
    v, cost = descent.descend(np.array(starts), 20)
    best = np.argsort(cost)[:3]
    v[best], cost[best] = descent.descend(v[best], steps, 1e-7)
    kept: list[Rational] = []
    for k in np.argsort(cost):
        if np.isfinite(cost[k]) and (not kept or cost[k] > same * kept[-1].cost):
            kept.append(Rational(*descent.polynomials(v[k]), float(cost[k])))
    if kept:
        smaller[order] = kept[0]
    return kept


def _bounds(problem: Problem, order: int) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of c1, c0 and c: poles from 1e-4 to ten times the band, no slower than the data resolve."""
    slow, top = max(problem.narrowest, 1e-4), problem.fastest
    sizes = order // 2, order // 2, order % 2
    return np.repeat([2.0 * slow, 1e-4, slow], sizes), np.repeat([top, top**2, top], sizes)


def realise(problem: Problem, fit: Rational, balanced: bool = True) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a realisation (a, b, c) in SI units; balanced, or (where it may be unstable) in observer form."""
    a, b, c = observer_form(fit.den, fit.num)
    if balanced:
        a, b, c = minimal(a, b, c, tolerance=0.0)
    factor = np.sqrt(problem.rate) * problem.scale[0]
    return problem.rate * a, factor * b, factor * c


def _grown(problem: Problem, order: int, passive: bool,
           smaller: dict[int, Rational], steps: int) -> list[tuple[FloatArray, FloatArray]]:
    """Return starts from the fits of order - 1 and - 2 times a real pole or a section that cancels, at two places."""
    grown = []
    for less in (1, 2):
        size = order - less
        if size < 1 + int(problem.zero):
            continue
        if size not in smaller:
            descended(problem, size, passive, smaller, steps=steps)
        for at in problem.x[-1] * np.array([0.2, 0.7]) if size in smaller else ():
            factor = np.array([at, 1.0] if less == 1 else [at**2, at, 1.0])
            grown.append((np.convolve(np.r_[smaller[size].den, 1.0], factor)[:-1],
                          np.convolve(smaller[size].num, factor)))
    return grown


def _spread(x: FloatArray, order: int) -> FloatArray:
    """Return a denominator of resonances over the band and, of odd order, a real pole."""
    factors = [np.array([1.0, 0.6 * at, at**2]) for at in np.geomspace(max(x[0], 0.15 * x[-1]), x[-1], order // 2)]
    return reduce(np.convolve, [*factors, *[np.array([1.0, 0.5 * x[-1]])] * (order % 2)], np.ones(1))[:0:-1]


def _layout(kind: Kind) -> tuple[int, ...]:
    """Return the numbers of c1, c0, c, q and h among the variables."""
    n, low = kind.order, int(kind.zero)
    return n // 2, n // 2, n % 2, n - low, (n - low) * int(kind.passive)


@lru_cache(maxsize=64)
def _program(kind: Kind) -> dict[str, Any]:
    import casadi as cs

    n, M, sizes = kind.order, kind.samples, _layout(kind)
    v = cs.MX.sym("v", sum(sizes))
    c1, c0, c, q, h = cs.vertsplit(v, np.r_[0, np.cumsum(sizes)].tolist())
    data = cs.MX.sym("data", 4 * M + 3 * kind.points)
    x, re, im, weight, rest = cs.vertsplit(data, np.r_[np.arange(5) * M, data.numel()].tolist())
    p = cs.MX(1.0)
    for k in range(n // 2):
        p = _product(cs, p, cs.vertcat(c0[k], c1[k], 1.0))
    if n % 2:
        p = _product(cs, p, cs.vertcat(c, 1.0))
    num = cs.vertcat(0.0, q) if kind.zero else q

    def along(coefficients: Any, at: Any) -> tuple[Any, Any]:
        columns = cs.horzcat(*[at**k for k in range(coefficients.numel())])
        sign = np.array([1.0, 1.0, -1.0, -1.0] * (n + 1))[:coefficients.numel()]
        even = np.arange(sign.size) % 2 == 0
        return columns @ (coefficients * (sign * even)), columns @ (coefficients * (sign * ~even))

    (pr, pi), (qr, qi) = along(p, x), along(num, x)
    size = pr**2 + pi**2
    misfit = cs.vertcat(weight * ((qr * pr + qi * pi) / size - re), weight * ((qi * pr - qr * pi) / size - im))
    rows = [_positivity(cs, p, num, cs.vertcat(0.0, h) if kind.zero else h, kind)] if kind.passive else []
    if kind.points:
        xc, kr, ki = cs.vertsplit(rest, (np.arange(4) * kind.points).tolist())
        (pr, pi), (qr, qi) = along(p, xc), along(num, xc)
        rows += [pr * kr - pi * ki - qr, pr * ki + pi * kr - qi]
    nlp: dict[str, Any] = {"x": v, "p": data, "f": 1e3 * cs.sumsqr(misfit), "g": cs.vertcat(*rows)}
    polynomials = cs.Function("polynomials", [v], [p, num])
    g = nlp["g"]
    equations = cs.Function("equations", [v, data], [g, cs.jacobian(g, v)])
    options: dict[str, Any] = {"print_time": False, "ipopt": {
        "print_level": 0, "sb": "yes", "mu_init": 1e-6, "max_iter": 600, "tol": 1e-8, "constr_viol_tol": 1e-9,
        "acceptable_iter": 5, "acceptable_tol": 1e-4, "acceptable_constr_viol_tol": 1e-9,
        "acceptable_obj_change_tol": 1e-4}}
    return {"solve": cs.nlpsol("radiation", "ipopt", nlp, options), "polynomials": polynomials,
            "equations": equations}


def _product(cs: Any, left: Any, right: Any) -> Any:
    rows = left.numel() + right.numel() - 1
    out = [0.0] * rows
    for i in range(left.numel()):
        for j in range(right.numel()):
            out[i + j] = out[i + j] + left[i] * right[j]
    return cs.vertcat(*out)


def _positivity(cs: Any, p: Any, num: Any, h: Any, kind: Kind) -> Any:
    """Return the coefficients of Re[Q(iw) conj P(iw)] - |h(iw)|^2 in powers of w^2, without those that are always 0."""
    def even(left: Any, right: Any, k: int) -> Any:
        return sum(left[2 * k - j] * right[j] * (-1.0) ** (j + k) for j in range(right.numel())
                   if 0 <= 2 * k - j < left.numel())

    return cs.vertcat(*[even(num, p, k) - even(h, h, k) for k in range(int(kind.zero), kind.order)])


def _solve(kind: Kind, problem: Problem, den: FloatArray, num: FloatArray) -> tuple[Rational | None, str]:
    """Run IPOPT from one start; None and the reason if it does not succeed."""
    solver, sizes, low = _program(kind), _layout(kind), int(kind.zero)
    if kind.passive:
        num = passive_numerator(den, num, kind.zero)
    start = np.concatenate([*sections(den), num[low:], spectral_factor(den, num)[low:] if kind.passive else []])
    floor, ceiling = (np.r_[bound, np.full(sum(sizes[3:]), end)]
                      for bound, end in zip(_bounds(problem, kind.order), (-np.inf, np.inf)))
    pad = kind.samples - problem.x.size
    K, w = problem.K[:, 0], problem.weight[:, 0] / problem.norm
    values = np.concatenate([
        np.pad(problem.x, (0, pad), constant_values=1.0), *(np.pad(u, (0, pad)) for u in (K.real, K.imag, w)),
        problem.x_points, problem.K_points[:, 0].real, problem.K_points[:, 0].imag])
    solution, status = solved(solver["solve"], x0=np.clip(start, floor, ceiling), p=values, lbx=floor, ubx=ceiling,
                              lbg=0.0, ubg=0.0)
    if not solver["solve"].stats()["success"]:
        return None, status
    v = onto(lambda v: tuple(np.asarray(u) for u in solver["equations"](v, values)), np.asarray(solution["x"]).ravel())
    p, num = (np.asarray(u).ravel() for u in solver["polynomials"](v))
    return Rational(p[:-1], num, float(solution["f"]) / 1e3), ""
