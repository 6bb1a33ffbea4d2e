"""Descent from many starts at once to single-entry fits that are passive by construction: finds where IPOPT starts.

    K = Q / P,   P = prod (s^2 + c1 s + c0) (s + c),   Q P* + Q* P = 2 h h*

P* is P(-s). For a stable P and any real h the last line is one linear system for Q with one solution, and
Re K(iw) = |h(iw)|^2 / |P(iw)|^2 >= 0. With c1, c0 and c as sigmoids between their bounds nothing is constrained, and
Newton's method runs on them and h with all second derivatives: where Re K touches zero, and where the misfit is large,
Gauss-Newton crawls. Arrays run over the starts first. The free fit has Q in place of h.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.problem import Problem


@dataclass(frozen=True, eq=False)
class Sections:
    """Places of the coefficients (c1, c0, c) of the sections in their product, for one order."""

    order: int

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Section of each coefficient."""
        pairs = np.arange(self.order // 2)
        return np.concatenate([pairs, pairs, np.full(self.order % 2, pairs.size)])

    @cached_property
    def power(self) -> NDArray[np.intp]:
        """Power of s that each coefficient multiplies."""
        return np.repeat(np.array([1, 0]), [self.order // 2, self.order - self.order // 2])

    @cached_property
    def left_out(self) -> NDArray[np.intp]:
        """Sections left out of each product, shape (products, 2): all pairs, and at last none (-1)."""
        return np.array([*zip(*np.triu_indices((self.order + 1) // 2)), (-1, -1)])

    @cached_property
    def number(self) -> NDArray[np.intp]:
        """Product that leaves out the sections of two coefficients, shape (n, n)."""
        low, high = np.minimum.outer(self.owner, self.owner), np.maximum.outer(self.owner, self.owner)
        return np.asarray(low * ((self.order + 1) // 2) - low * (low - 1) // 2 + high - low)

    def products(self, c: FloatArray) -> FloatArray:
        """Return the products of sections without those of `left_out`, constant term first, (S, n + 1, products)."""
        n = self.order
        out = np.zeros((c.shape[0], n + 1, self.left_out.shape[0]))
        out[:, 0] = 1.0
        for k in range((n + 1) // 2):
            kept = (self.left_out != k).all(axis=1)
            old, pair = out[:, :, kept], k < n // 2
            new = c[:, n // 2 + k if pair else n - 1, None, None] * old
            new[:, 1:] += (c[:, k, None, None] if pair else 1.0) * old[:, :-1]
            if pair:
                new[:, 2:] += old[:, :-2]
            out[:, :, kept] = new
        return out


class Models(NamedTuple):
    """Polynomials of S models, constant term first, and what their derivatives are made of."""

    den: FloatArray
    num: FloatArray
    products: FloatArray
    inside: FloatArray
    """Where the coefficients are between their bounds, 0 to 1."""
    rise: FloatArray
    """d coefficient / d variable."""
    slope: FloatArray
    """d (Q, P) / d (variables), shape (S, 2 n, 2 n)."""
    inverse: FloatArray
    """Of the matrix of Q -> Re[Q conj P]; unused in the free fit."""


@dataclass(frozen=True, eq=False)
class Descent:
    """The cost of one problem for models of one order, with its derivatives."""

    order: int
    # zero, passive: K(0) = 0; h among the variables, not Q
    zero: bool
    passive: bool
    # floor, ceiling (order,): Bounds of c1, c0 and c
    floor: FloatArray
    ceiling: FloatArray
    powers: ComplexArray  # (2 order, nw): Powers of ix
    # K, weight (nw,)
    K: ComplexArray
    weight: FloatArray

    @classmethod
    def of(cls, problem: Problem, order: int, floor: FloatArray, ceiling: FloatArray, passive: bool,
           heavy: float = 10.0) -> Descent:
        """Return the descent of a problem; frequency points are samples of weight `heavy`, all others have 1."""
        weight = np.r_[problem.weight[:, 0] / problem.norm, np.full(problem.x_points.size, heavy)]
        x, K = np.r_[problem.x, problem.x_points], np.r_[problem.K[:, 0], problem.K_points[:, 0]]
        powers = (1j * x) ** np.arange(2 * order)[:, None]
        return cls(order, problem.zero, passive, floor, ceiling, powers, K, weight)

    @cached_property
    def sections(self) -> Sections:
        """The places of the coefficients."""
        return Sections(self.order)

    def variables(self, coefficients: FloatArray, other: FloatArray) -> FloatArray:
        """Return the variables of (c1, c0, c), shape (order,), and h (or Q)."""
        inside = np.clip((coefficients - self.floor) / (self.ceiling - self.floor), 1e-7, 0.99)
        return np.r_[np.log(inside / (1.0 - inside)), other[int(self.zero):]]

    def polynomials(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (den, num) of one vector of variables, den without its leading 1."""
        models = self._models(v[None])
        return models.den[0, :-1], models.num[0]

    def descend(self, v: FloatArray, iterations: int, tolerance: float = 1e-4) -> tuple[FloatArray, FloatArray]:
        """Return the variables and the costs after damped Newton steps from each start, shapes (S, size), (S,).

        A start is left when an accepted step lowers its cost by less than `tolerance` of itself, or none does.
        """
        cost, g, H = self.expand(v)
        damping, live, v = np.full(cost.size, 1e-2), np.flatnonzero(np.isfinite(cost)), v.copy()
        for _ in range(iterations if live.size else 0):
            step = self._step(g[live], H[live], damping[live])
            found = self.expand(v[live] + step)
            better = found[0] < cost[live]
            done = better & (found[0] > (1.0 - tolerance) * cost[live])
            went = live[better]
            v[went] += step[better]
            cost[went], g[went], H[went] = (part[better] for part in found)
            damping[live] *= np.where(better, 0.2, 5.0)
            live = live[~done & (damping[live] < 1e8)]
            if not live.size:
                break
        return v, cost

    def expand(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the cost and half its gradient and Hessian, shapes (S,), (S, size) and (S, size, size)."""
        n = self.order
        with np.errstate(all="ignore"):  # a step too long has a cost that is not finite, and is refused
            models = self._models(v)
            P, Q = models.den @ self.powers[:n + 1], models.num @ self.powers[:n]
            K, share = Q / P, self.weight / P
            r = self.weight * (K - self.K)
            rows = self.powers[:n] * share[:, None, :]
            rows = np.concatenate([rows, -K[:, None, :] * rows], axis=1)
            A = np.concatenate([rows.real, rows.imag], axis=2)
            b = np.concatenate([r.real, r.imag], axis=1)
            q = (A @ b[:, :, None])[:, :, 0]
            C = A @ A.swapaxes(1, 2)
            turn = r.conj() * share / P
            s, t = ((part @ self.powers[:2 * n - 1].T).real for part in (turn, turn * K))
            at = np.arange(n)[:, None] + np.arange(n)
            C[:, :n, n:] -= s[:, at]
            C[:, n:, :n] -= s[:, at]
            C[:, n:, n:] += 2.0 * t[:, at]
            g = (models.slope.swapaxes(1, 2) @ q[:, :, None])[:, :, 0]
            H = self._curved(models, q, C)
        keep = np.r_[:n, n + int(self.zero):2 * n]
        return np.sum(b * b, axis=1), g[:, keep], H[:, keep][:, :, keep]

    def _models(self, v: FloatArray) -> Models:
        """Return the polynomials of the variables, shape (S, size)."""
        n, places = self.order, self.sections
        inside = 1.0 / (1.0 + np.exp(-v[:, :n]))
        rise = (self.ceiling - self.floor) * inside * (1.0 - inside)
        products = places.products(self.floor + (self.ceiling - self.floor) * inside)
        den = products[:, :, -1]
        d_den = products[:, :n, np.diagonal(places.number)]
        d_den = np.where(places.power == 1, np.roll(d_den, 1, axis=1), d_den) * rise[:, None, :]
        other = np.concatenate([np.zeros((v.shape[0], int(self.zero))), v[:, n:]], axis=1)
        slope = np.zeros((v.shape[0], 2 * n, 2 * n))
        slope[:, n:, :n] = d_den
        if not self.passive:
            slope[:, :n, n:] = np.eye(n)
            return Models(den, other, products, inside, rise, slope, np.zeros(0))
        inverse, E = np.asarray(np.linalg.inv(_even(den, n)), dtype=float), _even(other, n)
        num = (inverse @ (E @ other[:, :, None]))[:, :, 0]
        slope[:, :n, :n] = -inverse @ (_even(num, n) @ d_den)
        slope[:, :n, n:] = 2.0 * inverse @ E
        return Models(den, num, products, inside, rise, slope, inverse)

    def _curved(self, models: Models, q: FloatArray, C: FloatArray) -> FloatArray:
        """Return half the Hessian by the variables from half the gradient q and Hessian C by (Q, P)."""
        n, places, i = self.order, self.sections, np.arange(self.order)
        y, M = q[:, n:], np.zeros((1, n, n))
        if self.passive:
            # Q is what solves Re[Q conj P] = |h|^2: mu are that equation's multipliers, M its bilinear form.
            mu = (models.inverse.swapaxes(1, 2) @ q[:, :n, None])
            y = y - (_even(models.num, n).swapaxes(1, 2) @ mu)[:, :, 0]
            total = i[:, None] + i
            even = total % 2 == 0
            M = np.where(even, (-1.0) ** (i[:, None] + total // 2), 0.0) * mu[:, np.where(even, total // 2, 0), 0]
            C[:, :n, n:] -= M
            C[:, n:, :n] -= M
        H = models.slope.swapaxes(1, 2) @ C @ models.slope
        H[:, n:, n:] += 2.0 * M
        # Second derivatives of P: two coefficients of different sections, and the sigmoids.
        padded = np.concatenate([y, np.zeros((y.shape[0], 1))], axis=1)
        along = np.stack([(padded[:, None, m:] @ models.products[:, :n + 1 - m])[:, 0] for m in range(min(3, n + 1))],
                         axis=2)
        power = np.minimum(places.power[:, None] + places.power, n)
        apart = places.owner[:, None] != places.owner
        twice = np.where(apart, along[:, places.number, power], 0.0)
        H[:, :n, :n] += models.rise[:, :, None] * models.rise[:, None, :] * twice
        H[:, i, i] += (1.0 - 2.0 * models.inside) * (y[:, None] @ models.slope[:, n:, :n])[:, 0]
        return np.asarray(H)

    def _step(self, g: FloatArray, H: FloatArray, damping: FloatArray, most: float = 1.5) -> FloatArray:
        """Return damped Newton steps, scaled by the curvature, which is taken as positive; a sigmoid's is at `most`."""
        size = np.sqrt(np.abs(np.einsum("sii->si", H)))
        scale = 1.0 / np.maximum(size, np.maximum(1e-6 * size.max(axis=1, keepdims=True), 1e-150))
        values, vectors = np.linalg.eigh(H * scale[:, :, None] * scale[:, None, :])
        along = (vectors.swapaxes(1, 2) @ (g * scale)[:, :, None])[:, :, 0]
        step = -scale * (vectors @ (along / (np.abs(values) + damping[:, None] + 1e-9))[:, :, None])[:, :, 0]
        longest = np.abs(step[:, :self.order]).max(axis=1, keepdims=True)
        return np.asarray(step * np.minimum(1.0, most / np.maximum(longest, most)))


def _even(left: FloatArray, n: int) -> FloatArray:
    """Return the matrix, shape (S, n, n), of b -> coefficients of Re[left(iw) conj b(iw)] in powers of w^2."""
    k, j = np.arange(n)[:, None], np.arange(n)[None, :]
    at = 2 * k - j
    inside = (at >= 0) & (at < left.shape[1])
    return np.asarray(np.where(inside, (-1.0) ** (j + k), 0.0) * left[:, np.where(inside, at, 0)])
