"""Posterior of standardised parameters: Fisher scoring to its modes, Laplace's approximation at each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.passivity import LEAST

MAX_STEPS = 100               # of scoring
CLOSE, ENOUGH = 1e-3, 0.1     # squared distance to the mode, in posterior standard deviations: aimed at, and accepted
FARTHEST = 30.0               # prior standard deviations; nothing lies beyond


class Likelihood(Protocol):
    """What data say of u (radiation parameters) and v (their own nuisance parameters), all standardised to N(0, 1)."""

    @property
    def size(self) -> int:
        """Return the number of nuisance parameters."""

    def values(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the log likelihood of many u (B, d_u) and v (B, size), shape (B,); -inf outside the domain."""

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information in [u, v]."""


@dataclass(frozen=True, eq=False)
class Target:
    """log posterior of phi = [u; v_1; v_2; ...]: standard normal prior times independent likelihoods.

    Parameters
    ----------
    n_u : int
        Number of radiation parameters.
    likelihoods : sequence of Likelihood
    allowed : callable
        Which of u, shape (B, n_u), are stable, shape (B,).
    passive : callable, optional
        Which of u, shape (S, n_u), are passive: a constraint of the prior that draws keep and the climb does not.
    """

    n_u: int
    likelihoods: Sequence[Likelihood]
    allowed: Callable[[FloatArray], np.ndarray]
    passive: Callable[[FloatArray], np.ndarray] | None = None

    @property
    def size(self) -> int:
        """Dimension of phi."""
        return self.n_u + sum(part.size for part in self.likelihoods)

    def parts(self, phi: FloatArray) -> list[FloatArray]:
        """Return the nuisance parameters of each likelihood, of phi (..., size)."""
        ends = self.n_u + np.cumsum([part.size for part in self.likelihoods], dtype=int)
        return [phi[..., end - part.size:end] for part, end in zip(self.likelihoods, ends)]

    def values(self, phi: FloatArray) -> FloatArray:
        """Return log posteriors up to a constant, shape (B,), of phi (B, size)."""
        out = np.full(phi.shape[0], -np.inf)
        good = np.asarray(np.isfinite(phi).all(axis=1) & (np.abs(phi) < FARTHEST).all(axis=1))
        good[good] = self.allowed(phi[good, :self.n_u])
        if good.any():
            inside = phi[good]
            out[good] = -0.5 * np.sum(inside**2, axis=1) + sum(
                part.values(inside[:, :self.n_u], v) for part, v in zip(self.likelihoods, self.parts(inside)))
        return out

    def value(self, phi: FloatArray) -> float:
        """Return log posterior up to a constant of one phi (size,)."""
        return float(self.values(phi[None])[0])

    def local(self, phi: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log posterior, gradient, and prior precision plus Fisher information."""
        u, n = phi[:self.n_u], self.n_u
        total, gradient, fisher = -0.5 * float(phi @ phi), -phi.copy(), np.eye(phi.size)
        at = n
        for part, v in zip(self.likelihoods, self.parts(phi)):
            value, g, F = part.local(u, v)
            where = np.r_[0:n, at:at + part.size]
            total += value
            gradient[where] += g
            fisher[np.ix_(where, where)] += F
            at += part.size
        return total, gradient, fisher


@dataclass(frozen=True, eq=False)
class Peak:
    """Mode of a posterior, its Fisher matrix there (prior included) and log posterior."""

    phi: FloatArray
    fisher: FloatArray
    value: float

    @property
    def evidence(self) -> float:
        """Laplace's log evidence up to a constant; the prior is standard normal in every parameter."""
        return self.value - 0.5 * float(np.linalg.slogdet(self.fisher)[1])


def find_peak(target: Target, start: FloatArray, steps: int = MAX_STEPS, *, rough: bool = False) -> Peak:
    """Climb to the mode by Fisher scoring with Levenberg-Marquardt damping.

    Parameters
    ----------
    steps : int
        Scoring steps at most.
    rough : bool
        Whether the place that is reached by then will do; else BFGS goes on from there.

    Raises
    ------
    SolverError
        If the start is outside the domain or the mode is not reached.
    """
    phi, damping = np.array(start, dtype=float), 0.0
    value, gradient, fisher = target.local(phi)
    if not np.isfinite(value):
        raise SolverError("identify: the likelihood is not finite at the prior mean; check units of records and model")
    for _ in range(steps):
        step = np.linalg.solve(fisher + damping * np.diag(np.diag(fisher)), gradient)
        longest = np.abs(step).max()
        step *= min(1.0, 1.5 / longest) if longest > 0.0 else 1.0
        decrement = float(gradient @ step)
        trial = target.value(phi + step)
        if trial > value - 1e-9 * abs(value):
            phi, damping = phi + step, damping / 5.0 if damping > 1e-4 else 0.0
            if decrement < CLOSE:
                return Peak(phi, target.local(phi)[2], trial)
            value, gradient, fisher = target.local(phi)
        elif decrement < CLOSE or damping > 1e8:
            return Peak(phi, fisher, value)
        else:
            damping = max(4.0 * damping, 1e-2)
    if rough or decrement < ENOUGH:
        return Peak(phi, fisher, value)
    return _by_quasi_newton(target, phi, fisher)


def _by_quasi_newton(target: Target, start: FloatArray, fisher: FloatArray) -> Peak:
    """Climb on by BFGS, whitened by the information, where scoring runs to and fro.

    That happens where the model does not fit well: then the curvature is not the expected one, and BFGS learns it.
    """
    root = np.linalg.cholesky(fisher)

    def phi_of(x: FloatArray) -> FloatArray:
        return np.asarray(start + solve_triangular(root.T, x), dtype=np.float64)

    def downhill(x: FloatArray) -> tuple[float, FloatArray]:
        phi = phi_of(x)
        if not np.isfinite(target.value(phi)):
            return 1e30, np.zeros(x.size)
        value, gradient, _ = target.local(phi)
        return -value, -solve_triangular(root, gradient, lower=True)

    found = minimize(downhill, np.zeros(start.size), jac=True, method="BFGS",
                     options={"gtol": 0.5 * float(np.sqrt(ENOUGH)), "maxiter": 4 * MAX_STEPS})
    if not float(found.jac @ found.jac) < ENOUGH:
        raise SolverError("identify: the most probable parameters were not reached; check that records and model "
                          "belong together (units, scale, degrees of freedom)")
    phi = phi_of(found.x)
    value, _, fisher = target.local(phi)
    return Peak(phi, fisher, value)


@dataclass(frozen=True, eq=False)
class Sample:
    """Equally weighted draws of phi, shape (S, d), and the share of the posterior that is passive.

    `share` is the posterior probability of passivity before draws that are not passive were left out; they are kept
    where it is below passivity.LEAST.
    """

    draws: FloatArray
    share: float = 1.0


def sample(target: Target, peaks: Sequence[Peak], rng: np.random.Generator, draws: int) -> Sample:
    """Draw from the Laplace approximations at the modes, mixed by their evidence, within the domain.

    Raises
    ------
    SolverError
        If hardly any draw is in the domain.
    """
    weights = np.exp(np.array([peak.evidence for peak in peaks]) - max(peak.evidence for peak in peaks))
    counts = np.ceil(6 * draws * weights / weights.sum()).astype(int)
    cloud = np.vstack([peak.phi + solve_triangular(np.linalg.cholesky(peak.fisher).T,
                                                   rng.standard_normal((target.size, count))).T
                       for peak, count in zip(peaks, counts)])
    cloud = rng.permutation(cloud[target.allowed(cloud[:, :target.n_u])])
    if cloud.shape[0] < min(draws, 20):
        raise SolverError("identify: hardly any draw around the mode is stable; use a smaller prior")
    inside = np.ones(cloud.shape[0], bool) if target.passive is None else target.passive(cloud[:, :target.n_u])
    share = float(inside.mean())
    kept = cloud[inside] if share > LEAST else cloud
    return Sample(kept[np.arange(draws) % kept.shape[0]], share)
