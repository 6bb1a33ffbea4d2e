"""Posterior of standardised parameters: Fisher scoring to its peak, then adaptive importance sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.identification.passivity import LEAST

TAIL = 6.0          # degrees of freedom of the Student proposal
MAX_STEPS = 50
CLOSE, ENOUGH = 1e-3, 0.1     # squared distance to the mode, in posterior standard deviations: aimed at, and accepted
LARGE = 40          # parameters beyond which importance sampling is hopeless and Laplace's approximation is kept


class Likelihood(Protocol):
    """What data say of u (radiation parameters) and v (their own nuisance parameters), all standardised to N(0, 1)."""

    @property
    def size(self) -> int:
        """Return the number of nuisance parameters."""

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood; -inf outside the domain."""

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
        Whether u, shape (n_u,), is stable.
    passive : callable, optional
        Which of u, shape (S, n_u), are passive: a constraint of the prior that draws keep and the climb does not.
    """

    n_u: int
    likelihoods: Sequence[Likelihood]
    allowed: Callable[[FloatArray], bool]
    passive: Callable[[FloatArray], np.ndarray] | None = None

    @property
    def size(self) -> int:
        """Dimension of phi."""
        return self.n_u + sum(part.size for part in self.likelihoods)

    def parts(self, phi: FloatArray) -> list[FloatArray]:
        """Return the nuisance parameters of each likelihood."""
        ends = self.n_u + np.cumsum([part.size for part in self.likelihoods], dtype=int)
        return [phi[end - part.size:end] for part, end in zip(self.likelihoods, ends)]

    def value(self, phi: FloatArray) -> float:
        """Return log posterior up to a constant."""
        u = phi[:self.n_u]
        if not np.isfinite(phi).all() or not self.allowed(u):
            return -np.inf
        total = -0.5 * float(phi @ phi)
        for part, v in zip(self.likelihoods, self.parts(phi)):
            total += part.value(u, v)
        return total

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


def find_peak(target: Target, start: FloatArray) -> Peak:
    """Climb to the mode by Fisher scoring with Levenberg-Marquardt damping.

    Raises
    ------
    SolverError
        If the start is outside the domain or the mode is not reached.
    """
    phi, damping = np.array(start, dtype=float), 0.0
    value, gradient, fisher = target.local(phi)
    if not np.isfinite(value):
        raise SolverError("identify: the likelihood is not finite at the prior mean; check units of records and model")
    for _ in range(MAX_STEPS):
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
    if decrement < ENOUGH:
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
    """Equally weighted draws of phi, shape (S, d), the effective number behind them, and the share that is passive.

    `share` is the posterior probability of passivity before draws that are not passive were left out; they are kept
    where it is below passivity.LEAST.
    """

    draws: FloatArray
    effective: float
    share: float = 1.0


def sample(target: Target, peak: Peak, rng: np.random.Generator, *, draws: int = 400, rounds: int = 30,
           size: int = 300, enough: float = 250.0) -> Sample:
    """Draw from the posterior by adaptive multiple importance sampling started from the Laplace approximation.

    Cornuet et al. (2012): each round proposes from a Student distribution with the weighted mean and covariance so far;
    all points are weighted by the mixture of all proposals; the draws are a systematic resample. Stops once the
    effective number of draws is `enough`, or after `rounds` rounds of `size` points. Weights that shape the next
    proposal are cut at sqrt(N) of their mean (Ionides 2008), so that one point far out cannot draw it to itself.
    """
    if target.size > LARGE:
        return _laplace(target, peak, rng, draws)
    points, values, inside = np.empty((0, target.size)), np.empty(0), np.empty(0, dtype=bool)
    proposals: list[tuple[FloatArray, FloatArray]] = [(peak.phi, np.asarray(np.linalg.inv(peak.fisher), dtype=float))]
    for number in range(rounds):
        fresh = _student(*proposals[-1], size, rng)
        points = np.vstack([points, fresh])
        values = np.concatenate([values, [target.value(point) for point in fresh]])
        inside = np.concatenate([inside, _inside(target, fresh)])
        mixture = logsumexp([_student_log_density(points, *p) for p in proposals], axis=0) - np.log(len(proposals))
        weights, effective, share = _weights(values - mixture, inside)
        if effective > enough and number >= 1:
            break
        if number < rounds - 1:
            proposals.append(_moments(points, _cut(weights), proposals[0]))
    position = (rng.random() + np.arange(draws)) / draws
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), position), values.size - 1)
    return Sample(points[chosen], effective, share)


def _inside(target: Target, points: FloatArray) -> np.ndarray:
    """Return which points are passive, shape (S,)."""
    if target.passive is None:
        return np.ones(points.shape[0], dtype=bool)
    return target.passive(points[:, :target.n_u])


def _laplace(target: Target, peak: Peak, rng: np.random.Generator, draws: int) -> Sample:
    """Return draws of the Laplace approximation within the domain."""
    cloud = rng.multivariate_normal(peak.phi, np.linalg.inv(peak.fisher), size=4 * draws)
    cloud = cloud[[target.allowed(row[:target.n_u]) for row in cloud]]
    if cloud.shape[0] < min(draws, 20):
        raise SolverError("identify: hardly any draw around the mode is stable; use a smaller prior")
    inside = _inside(target, cloud)
    share = float(inside.mean())
    kept = (cloud[inside] if share > LEAST else cloud)[:draws]
    return Sample(kept, float(kept.shape[0]), share)


def _cut(weights: FloatArray) -> FloatArray:
    """Return weights none of which is above sqrt(N) times their mean, normalised."""
    cut = np.minimum(weights, 1.0 / np.sqrt(weights.size))
    return np.asarray(cut / cut.sum(), dtype=np.float64)


def _moments(points: FloatArray, weights: FloatArray,
             first: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return weighted mean and covariance, drawn towards the first proposal while few points carry the weight."""
    effective = 1.0 / float(np.sum(weights**2))
    trust = effective / (effective + 2.0 * points.shape[1])
    mean = weights @ points
    spread = (points - mean).T @ ((points - mean) * weights[:, None])
    offset = first[0] - mean
    covariance = trust * spread + (1.0 - trust) * (first[1] + np.outer(offset, offset) * trust)
    return trust * mean + (1.0 - trust) * first[0], covariance


def _weights(log_weights: FloatArray, inside: np.ndarray) -> tuple[FloatArray, float, float]:
    """Return weights, their effective number, and the weight inside; if that is enough, outside gets none."""
    if not np.isfinite(log_weights).any():
        raise SolverError("identify: no draw of the posterior is in the domain; the prior may be too wide for this fit")
    weights = np.exp(log_weights - logsumexp(log_weights))
    share = float(weights[inside].sum())
    if share > LEAST:
        weights = np.where(inside, weights, 0.0) / share
    return weights, float(1.0 / np.sum(weights**2)), share


def _student(mean: FloatArray, covariance: FloatArray, size: int, rng: np.random.Generator) -> FloatArray:
    root = np.linalg.cholesky(covariance * (TAIL - 2.0) / TAIL)
    normal = rng.standard_normal((size, mean.size)) @ root.T
    return mean + normal * np.sqrt(TAIL / rng.chisquare(TAIL, (size, 1)))


def _student_log_density(points: FloatArray, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    root = np.linalg.cholesky(covariance * (TAIL - 2.0) / TAIL)
    d = mean.size
    squared = np.sum(solve_triangular(root, (points - mean).T, lower=True) ** 2, axis=0)
    constant = gammaln(0.5 * (TAIL + d)) - gammaln(0.5 * TAIL) - 0.5 * d * np.log(TAIL * np.pi)
    return np.asarray(constant - np.log(np.diag(root)).sum() - 0.5 * (TAIL + d) * np.log1p(squared / TAIL))
