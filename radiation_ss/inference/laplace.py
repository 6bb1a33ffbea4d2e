"""Posterior of standardised parameters: damped Gauss-Newton to a mode, Laplace's approximation at each of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError


class Likelihood(Protocol):
    """What data say of u (shared parameters) and v (their own nuisance parameters), all standardised to N(0, 1)."""

    @property
    def size(self) -> int:
        """Return the number of nuisance parameters."""

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood; -inf outside the domain."""

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information in [u, v]."""


@dataclass(frozen=True, eq=False)
class Target:
    """log posterior of phi = [u; v_1; v_2; ...]: standard normal prior times independent likelihoods."""

    n_u: int  # Number of shared parameters
    likelihoods: Sequence[Likelihood]
    allowed: Callable[[FloatArray], np.ndarray]  # Which of u, shape (B, n_u), lie in the domain, shape (B,)
    # Which of u, shape (S, n_u), meet a constraint of the prior that draws keep and the climb does
    # not
    kept: Callable[[FloatArray], np.ndarray] | None = None

    @property
    def size(self) -> int:
        """Dimension of phi."""
        return self.n_u + sum(part.size for part in self.likelihoods)

    @property
    def places(self) -> list[slice]:
        """Where the nuisance parameters of each likelihood stand in phi."""
        ends = self.n_u + np.cumsum([part.size for part in self.likelihoods], dtype=int)
        return [slice(end - part.size, end) for part, end in zip(self.likelihoods, ends)]

    def value(self, phi: FloatArray, farthest: float = 30.0) -> float:
        """Return the log posterior up to a constant; nothing lies beyond `farthest` prior standard deviations."""
        u = phi[:self.n_u]
        if not np.isfinite(phi).all() or np.abs(phi).max(initial=0.0) > farthest or not self.allowed(u[None])[0]:
            return -np.inf
        return -0.5 * float(phi @ phi) + sum(part.value(u, phi[at]) for part, at in zip(self.likelihoods, self.places))

    def local(self, phi: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log posterior, gradient, and prior precision plus Fisher information."""
        n = self.n_u
        total, gradient, fisher = -0.5 * float(phi @ phi), -phi.copy(), np.eye(phi.size)
        for part, at in zip(self.likelihoods, self.places):
            value, g, F = part.local(phi[:n], phi[at])
            where = np.r_[0:n, at]
            total += value
            gradient[where] += g
            fisher[np.ix_(where, where)] += F
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

    def near(self, other: "Peak", distance: float) -> bool:
        """Return whether two modes are closer than a distance in posterior standard deviations."""
        away = self.phi - other.phi
        return bool(away @ other.fisher @ away < distance**2)

    def with_zeros(self, columns: Sequence[int], narrow: float = 1e-9) -> "Peak":
        """Return a mode with more parameters, in these columns, that are zero: priors of the deviation `narrow`."""
        size = self.phi.size + len(columns)
        there, phi, fisher = np.setdiff1d(np.arange(size), columns), np.zeros(size), np.eye(size) / narrow**2
        phi[there], fisher[np.ix_(there, there)] = self.phi, self.fisher
        return Peak(phi, fisher, self.value - len(columns) * float(np.log(narrow)))


@dataclass(frozen=True)
class Climb:
    """How a mode is looked for."""

    steps: int = 200  # Gauss-Newton steps at most
    close: float = 1e-3  # Squared distance to the mode, in posterior standard deviations, that ends the climb
    # patience, gain: So does a gain in log posterior of less than `gain` over `patience` steps
    patience: int = 15
    gain: float = 0.1
    longest: float = 1.5  # Longest step in any parameter, in prior standard deviations
    rough: bool = False  # Whether the place that is reached after all steps will do


def find_peak(target: Target, start: FloatArray, rules: Climb | None = None) -> Peak:
    """Climb to a mode by Gauss-Newton steps (Fisher scoring) with Levenberg's damping, in units of the priors.

    SolverError if the likelihood is not finite at the start, or the mode is not reached.
    """
    rules = rules or Climb()
    phi, damping = np.array(start, dtype=float), 0.0
    value, gradient, fisher = target.local(phi)
    gained = [value]
    if not np.isfinite(value):
        raise SolverError("identify: the likelihood is not finite at the prior mean; check units of records and model")
    for _ in range(rules.steps):
        step = np.linalg.solve(fisher + damping * np.eye(phi.size), gradient)
        step *= min(1.0, rules.longest / max(np.abs(step).max(), 1e-300))
        decrement, trial = float(gradient @ step), phi + step
        reached = target.value(trial)
        if reached > value - 1e-9 * abs(value):
            phi, damping = trial, damping / 5.0 if damping > 1e-2 else 0.0
            value, gradient, fisher = target.local(phi)
        elif decrement >= rules.close:
            damping = max(4.0 * damping, 1.0)
        if decrement < rules.close or damping > 1e8:
            return Peak(phi, fisher, value)
        gained.append(value)
        if len(gained) > rules.patience and gained[-1] - gained[-1 - rules.patience] < rules.gain:
            return Peak(phi, fisher, value)
    if rules.rough:
        return Peak(phi, fisher, value)
    raise SolverError("identify: the most probable parameters were not reached; check that records and model belong "
                      "together (units, scale, degrees of freedom), and by `diagnose` what the model lacks")


def sample(target: Target, peaks: Sequence[Peak], rng: np.random.Generator, draws: int,
           least: float) -> tuple[FloatArray, float]:
    """Draw from the Laplace approximations at the modes, mixed by their evidence, within the domain.

    Return the draws (draws, size), equally weighted, and the posterior probability of `target.kept` before those that
    do not meet it were left out, which is done where they leave the share `least`. SolverError if hardly any draw is in
    the domain.
    """
    logs = np.array([peak.evidence for peak in peaks])
    weights = np.exp(logs - logs.max())
    counts = np.ceil(6 * draws * weights / weights.sum()).astype(int)
    cloud = np.vstack([peak.phi + solve_triangular(np.linalg.cholesky(peak.fisher).T,
                                                   rng.standard_normal((target.size, count))).T
                       for peak, count in zip(peaks, counts)])
    cloud = rng.permutation(cloud[target.allowed(cloud[:, :target.n_u])])
    if cloud.shape[0] < min(draws, 20):
        raise SolverError("identify: hardly any draw around the mode is stable; use a smaller prior")
    if target.kept is None:
        return cloud[np.arange(draws) % cloud.shape[0]], 1.0
    inside = np.empty(0, dtype=bool)
    while inside.size < cloud.shape[0] and inside.sum() < draws:
        inside = np.r_[inside, target.kept(cloud[inside.size:inside.size + draws, :target.n_u])]
    share, cloud = float(inside.mean()), cloud[:inside.size]
    kept = cloud[inside] if share > least else cloud
    return kept[np.arange(draws) % kept.shape[0]], share
