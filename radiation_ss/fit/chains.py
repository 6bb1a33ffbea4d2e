"""Fits of many degrees of freedom: port-Hamiltonian chains side by side, quasi-Newton steps, merged as they converge.

    K(s) = sum_c W_c^T phi_c(s) W_c,   phi_c = the first block of (s I - A_c)^-1,   A_c as in `radiation_ss.fit.port`

Each chain is a small passive system that pushes on all degrees of freedom, so the sum is passive and reciprocal. The
gradient costs about as much as the response: the work grows with chains times the square of the degrees of freedom,
where the Jacobian of the one large form grows with their sixth power. Chains begin as one for each mode of the damping,
and are then merged, which frees the couplings between their states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.problem import Problem


@dataclass(frozen=True)
class Chains:
    """Sizes: `count` chains of k1 + k2 states for m degrees of freedom; `zero` leaves the second halves without loss.

    The parameters are one vector: roots of the losses (count, k1 + k2), G (count, k1, k2), W (count, k1, m).
    """

    count: int
    k1: int
    k2: int
    m: int
    zero: bool

    def unpack(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (roots of the losses, G, W)."""
        sizes = np.cumsum([self.count * (self.k1 + self.k2), self.count * self.k1 * self.k2])
        e, G, W = np.split(theta, sizes)
        e = e.reshape(self.count, self.k1 + self.k2).copy()
        if self.zero:
            e[:, self.k1:] = 0.0
        return e, G.reshape(self.count, self.k1, self.k2), W.reshape(self.count, self.k1, self.m)

    def systems(self, e: FloatArray, G: FloatArray) -> FloatArray:
        """Return A of each chain, shape (count, k, k)."""
        k1, k = self.k1, np.arange(self.k1 + self.k2)
        a = np.zeros((self.count, k.size, k.size))
        a[:, k, k] = -e**2
        a[:, :k1, k1:], a[:, k1:, :k1] = G, -G.swapaxes(1, 2)
        return a

    def realise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (A, B) of the whole; C = B^T."""
        e, G, W = self.unpack(theta)
        k = self.k1 + self.k2
        a, b = np.zeros((self.count * k, self.count * k)), np.zeros((self.count * k, self.m))
        for c, part in enumerate(self.systems(e, G)):
            at = slice(c * k, (c + 1) * k)
            a[at, at], b[c * k:c * k + self.k1] = part, W[c]
        return a, b

    def merged(self, theta: FloatArray, by: int) -> tuple[Chains, FloatArray]:
        """Return chains `by` times as long (a divisor of `count`), the same system, and its parameters."""
        e, G, W = self.unpack(theta)
        count, k1, k2 = self.count // by, self.k1, self.k2
        losses = np.concatenate([part.reshape(count, -1) for part in (e[:, :k1], e[:, k1:])], axis=1)
        wide = np.zeros((count, by, k1, by, k2))
        same = np.arange(by)
        wide[:, same, :, same] = G.reshape(count, by, k1, k2).swapaxes(0, 1)
        longer = Chains(count, by * k1, by * k2, self.m, self.zero)
        return longer, np.concatenate([losses.ravel(), wide.ravel(), W.ravel()])


@dataclass(frozen=True, eq=False)
class Samples:
    """Whole matrices of a problem: K and squared weights, shape (nw, m, m), real parts first along the frequencies."""

    x: FloatArray
    K: FloatArray
    weight: FloatArray
    narrowest: float
    norm: float

    @classmethod
    def of(cls, problem: Problem) -> Samples:
        """Return the samples; frequency points are heavy samples here."""
        i, j = np.triu_indices(problem.m)
        x = np.r_[problem.x, problem.x_points]
        half = np.where(i == j, 1.0, np.sqrt(2.0))
        stiff = np.full(problem.K_points.shape, 3.0 * problem.norm)
        upper = np.vstack([problem.K, problem.K_points]), np.vstack([problem.weight / half, stiff])
        K, weight = np.zeros((x.size, problem.m, problem.m), dtype=complex), np.zeros((x.size, problem.m, problem.m))
        for whole, part in zip((K, weight), upper):
            whole[:, i, j] = whole[:, j, i] = part
        return cls(x, np.concatenate([K.real, K.imag]), np.concatenate([weight, weight]) ** 2, problem.narrowest,
                   problem.norm)


def cost_of(chains: Chains, samples: Samples, theta: FloatArray) -> tuple[float, FloatArray]:
    """Return the weighted squared misfit over that of the data, and its gradient."""
    e, G, W = chains.unpack(theta)
    k1, nw, m = chains.k1, samples.x.size, chains.m
    a = chains.systems(e, G)
    F = np.linalg.inv(1j * samples.x[:, None, None, None] * np.eye(a.shape[1]) - a)
    flat = W.reshape(-1, m)
    PW = np.matmul(F[:, :, :k1, :k1], W).reshape(nw, -1, m)
    stacked = np.concatenate([PW.real, PW.imag])
    K = np.matmul(flat.T, stacked)
    miss = K - samples.K
    pull = samples.weight * miss
    g_W = 4.0 * np.tensordot(stacked, pull, axes=([0, 2], [0, 2]))
    # d cost = 2 Re sum conj(R) dphi, dphi = F dA F: A's gradient from the residual seen by each chain.
    seen = np.matmul(flat, pull[:nw] - 1j * pull[nw:]).reshape(nw, chains.count, k1, m)
    inner = np.matmul(seen, W.swapaxes(1, 2))
    g_A = 2.0 * np.einsum("wcik,wcjk->cij", np.matmul(F[:, :, :k1].swapaxes(2, 3), inner),
                          F[:, :, :, :k1], optimize=True).real
    k = np.arange(a.shape[1])
    narrow, slope = _too_narrow(a, samples)
    g_A += slope
    g_e = -2.0 * e * g_A[:, k, k]
    g_G = g_A[:, :k1, k1:] - g_A[:, k1:, :k1].swapaxes(1, 2)
    value = (float(np.sum(pull * miss)) + narrow) / samples.norm**2
    return value, np.concatenate([g_e.ravel(), g_G.ravel(), g_W.ravel()]) / samples.norm**2


def _too_narrow(a: FloatArray, samples: Samples) -> tuple[float, FloatArray]:
    """Return the penalty of oscillating poles that decay more slowly than the data resolve, and its gradient by A."""
    limit = max(samples.narrowest, 1e-12)
    poles, right = np.linalg.eig(a)
    short = np.where(np.abs(poles.imag) > limit, np.maximum(1.0 + poles.real / limit, 0.0), 0.0)
    slope = np.zeros(a.shape)
    gain = (0.3 * samples.norm) ** 2
    for c in np.flatnonzero(short.any(axis=1)):
        left: ComplexArray = np.linalg.inv(right[c])
        slope[c] = np.einsum("k,ki,jk->ij", 2.0 * gain / limit * short[c], left, right[c]).real
    return gain * float(np.sum(short**2)), slope


def start_of(chains: Chains, samples: Samples, seed: int) -> FloatArray:
    """Return chains for the modes of the damping, largest first, with resonances spread over the band."""
    rng = np.random.default_rng(seed)
    nw, k1, k2, m = samples.x.size, chains.k1, chains.k2, chains.m
    _, shapes = np.linalg.eigh(np.tensordot(np.linspace(1.0, 2.0, nw), samples.K[:nw], 1))
    mode = shapes[:, ::-1][:, np.arange(chains.count) % m].T
    size = np.sqrt(np.abs(np.einsum("ci,wij,cj->cw", mode, samples.K[:nw], mode, optimize=True)).max(axis=1))
    pairs, top = min(k1, k2), float(samples.x[-1])
    G = 0.2 * rng.normal(size=(chains.count, k1, k2))
    G[:, np.arange(pairs), np.arange(pairs)] += np.geomspace(min(0.4, 0.5 * top), 0.7 * top, pairs)
    W = 0.5 * size[:, None, None] * (1.0 + 0.1 * rng.normal(size=(chains.count, k1, 1))) * mode[:, None]
    losses = np.full((chains.count, k1 + k2), 0.7)
    return np.concatenate([losses.ravel(), G.ravel(), W.ravel()])


def fit_chains(problem: Problem, order: int, *, seed: int = 0, starts: int = 2, steps: int = 300,
               longest: int = 128) -> tuple[FloatArray, FloatArray, float, int]:
    """Return (A, B, relative error, steps taken) with `order` states for each degree of freedom, C = B^T.

    Parameters
    ----------
    problem : Problem
    order : int
    seed : int
    starts : int
        Random starts; the best goes on.
    steps : int
        Quasi-Newton steps between two merges.
    longest : int
        States of the longest chains.
    """
    samples = Samples.of(problem)
    half = max(order // 2, 1)
    chains = Chains(problem.m, order - half, half, problem.m, problem.zero)

    def descend(form: Chains, theta: FloatArray) -> tuple[float, FloatArray, int]:
        run = minimize(lambda v: cost_of(form, samples, v), theta, jac=True, method="L-BFGS-B",
                       options={"maxiter": steps, "maxfun": 2 * steps, "maxcor": 20, "ftol": 1e-6, "gtol": 1e-9})
        return float(run.fun), run.x, int(run.nit)

    runs = [descend(chains, start_of(chains, samples, seed + k)) for k in range(starts)]
    cost, theta, taken = min(runs, key=lambda run: run[0])
    rng = np.random.default_rng(seed)
    while chains.count > 1:
        by = next(k for k in range(2, chains.count + 1) if chains.count % k == 0)
        if by * (chains.k1 + chains.k2) > longest:
            break
        chains, theta = chains.merged(theta, by)
        # Couplings that are exactly zero have no slope where the chains see each other only through them.
        cost, theta, more = descend(chains, theta + 1e-3 * rng.normal(size=theta.size))
        taken += more
    a, b = chains.realise(theta)
    return a, b, float(np.sqrt(cost)), taken
