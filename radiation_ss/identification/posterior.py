"""Posterior of standardised parameters: Fisher scoring to its peak, then adaptive importance sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.passivity import LEAST

TAIL = 6.0          # degrees of freedom of the Student proposal
MAX_STEPS, MANY_STEPS = 50, 300      # of scoring: up to LARGE parameters, and beyond
CLOSE, ENOUGH = 1e-3, 0.1     # squared distance to the mode, in posterior standard deviations: aimed at, and accepted
LEAST_EFFECTIVE = 50.0     # effective draws; with fewer the bands are widened
FARTHEST = 30.0     # prior standard deviations; nothing lies beyond
LARGE = 40          # parameters beyond which importance sampling is hopeless and Laplace's approximation is kept


Normal: TypeAlias = tuple[FloatArray, FloatArray]     # mean and covariance


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
        good = np.isfinite(phi).all(axis=1) & (np.abs(phi) < FARTHEST).all(axis=1)
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
    for _ in range(MAX_STEPS if phi.size <= LARGE else MANY_STEPS):
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
    where it is below passivity.LEAST. `evidence` is the log of the integral of likelihood times prior, up to a constant
    of the data, before passivity was made a condition.
    """

    draws: FloatArray
    effective: float
    share: float = 1.0
    evidence: float = 0.0


def sample(target: Target, peaks: Sequence[Peak], rng: np.random.Generator, *, draws: int = 400, rounds: int = 30,
           size: int = 300, enough: float = 250.0) -> Sample:
    """Draw from the posterior by adaptive multiple importance sampling, from Laplace approximations at its modes on.

    Cornuet et al. (2012): each round proposes from a mixture of Student distributions, one for each mode, with the
    weighted mean and covariance so far (Cappe et al. 2008); all points are weighted by the mixture of all proposals;
    the draws are a systematic resample. Stops once the effective number of draws is `enough`, or after `rounds` rounds
    of `size` points; then, if it is below `LEAST_EFFECTIVE`, weights are flattened until it is that many, which widens
    the result. Weights that shape the next proposal are cut at sqrt(N) of their mean (Ionides 2008), so that one point
    far out cannot draw it to itself.
    """
    if target.size > LARGE:
        return _laplace(target, peaks[0], rng, draws)
    points, values, inside = np.empty((0, target.size)), np.empty(0), np.empty(0, dtype=bool)
    first = [(peak.phi, np.asarray(np.linalg.inv(peak.fisher), dtype=float)) for peak in peaks]
    components, counts = first, np.full(len(first), -(-size // len(first)), dtype=np.int64)
    density = np.full(0, -np.inf)           # log of the sum over all proposals so far, each by its number of points
    used: list[tuple[Normal, int]] = []
    for number in range(rounds):
        fresh = np.vstack([_student(*c, int(n), rng) for c, n in zip(components, counts)])
        density = np.r_[density, _mixture(fresh, used)] if used else np.full(fresh.shape[0], -np.inf)
        points = np.vstack([points, fresh])
        values = np.concatenate([values, target.values(fresh)])
        inside = np.concatenate([inside, _inside(target, fresh)])
        new = [(c, int(n)) for c, n in zip(components, counts)]
        density, used = np.logaddexp(density, _mixture(points, new)), used + new
        log_weights = values - density + np.log(values.size)
        weights, effective, share = _weights(log_weights, inside)
        if effective > enough and number >= 1:
            break
        if number < rounds - 1:
            components, counts = _next(points, weights, components, first, size)
    evidence = float(logsumexp(log_weights)) - np.log(values.size) - 0.5 * target.size * np.log(2.0 * np.pi)
    position = (rng.random() + np.arange(draws)) / draws
    chosen = np.minimum(np.searchsorted(np.cumsum(_flattened(weights)), position), values.size - 1)
    return Sample(points[chosen], effective, share, evidence)


def _mixture(points: FloatArray, proposals: Sequence[tuple[Normal, int]]) -> FloatArray:
    """Return the log of the sum of proposal densities, each times its number of points, shape (S,)."""
    return np.asarray(logsumexp([_student_log_density(points, *c) + np.log(n) for c, n in proposals], axis=0))


def _next(points: FloatArray, weights: FloatArray, components: list[Normal], first: list[Normal],
          size: int) -> tuple[list[Normal], NDArray[np.int64]]:
    """Return the next components and their numbers of points: half shared alike, half by the weight they hold."""
    logs = np.array([_student_log_density(points, *c) for c in components])
    held = weights * np.exp(logs - logsumexp(logs, axis=0)) + 1e-300
    mass = held.sum(axis=1)
    counts = np.ceil(size * (0.5 / len(first) + 0.5 * mass / mass.sum())).astype(np.int64)
    return [_moments(points, _cut(row / row.sum()), start) for row, start in zip(held, first)], counts


def _flattened(weights: FloatArray) -> FloatArray:
    """Return the weights to the largest power up to 1 that leaves LEAST_EFFECTIVE effective draws."""
    low, high = 0.0, 1.0
    if np.count_nonzero(weights) <= LEAST_EFFECTIVE or 1.0 / np.sum(weights**2) >= LEAST_EFFECTIVE:
        return weights
    logs = np.log(np.where(weights > 0.0, weights, 1.0))
    for _ in range(30):
        middle = 0.5 * (low + high)
        flat = np.where(weights > 0.0, np.exp(middle * logs), 0.0)
        low, high = (middle, high) if flat.sum() ** 2 / np.sum(flat**2) >= LEAST_EFFECTIVE else (low, middle)
    flat = np.where(weights > 0.0, np.exp(low * logs), 0.0)
    return np.asarray(flat / flat.sum(), dtype=np.float64)


def _inside(target: Target, points: FloatArray) -> np.ndarray:
    """Return which points are passive, shape (S,)."""
    if target.passive is None:
        return np.ones(points.shape[0], dtype=bool)
    return target.passive(points[:, :target.n_u])


def _laplace(target: Target, peak: Peak, rng: np.random.Generator, draws: int) -> Sample:
    """Return draws of the Laplace approximation within the domain."""
    cloud = rng.multivariate_normal(peak.phi, np.linalg.inv(peak.fisher), size=4 * draws)
    cloud = cloud[target.allowed(cloud[:, :target.n_u])]
    if cloud.shape[0] < min(draws, 20):
        raise SolverError("identify: hardly any draw around the mode is stable; use a smaller prior")
    inside = _inside(target, cloud)
    share = float(inside.mean())
    kept = (cloud[inside] if share > LEAST else cloud)[:draws]
    return Sample(kept, float(kept.shape[0]), share, peak.evidence)


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
