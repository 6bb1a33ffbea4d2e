"""What every identification method is given and what it hands back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.identification.passivity import LEAST, passive
from radiation_ss.identification.posterior import Likelihood, Peak, Target, find_peak, sample
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import PointLikelihood, Points
from radiation_ss.records.record import Record


@dataclass(frozen=True, eq=False)
class Study:
    """Model, prior, records and known points of one identification."""

    model: Model
    form: Parametrisation
    records: tuple[Record, ...]
    points: PointLikelihood | None
    rng: np.random.Generator
    draws: int
    seed: int = 0
    prior: float = 0.15
    given_points: Points | None = None
    point_tolerance: float = 1e-3
    error_of_X: float = 0.02

    @property
    def n_u(self) -> int:
        """Number of radiation parameters that may move."""
        return self.form.size

    def target(self, likelihoods: Sequence[Likelihood]) -> Target:
        """Return the posterior of these likelihoods with prior, stability, passivity and points."""
        known: list[Likelihood] = [] if self.points is None else [self.points]
        return Target(self.n_u, [*known, *likelihoods], self.allowed, self.passive)

    def allowed(self, u: FloatArray) -> np.ndarray:
        """Return which of u, shape (..., n_u), give a stable subsystem."""
        return self.form.stable(self.form.theta(u))

    def passive(self, u: FloatArray) -> np.ndarray:
        """Return which of u, shape (S, n_u), give a passive subsystem, shape (S,)."""
        return passive(self.form, self.form.theta(u))

    def kept(self, u: FloatArray) -> FloatArray:
        """Return the draws u, shape (S, n_u), that are stable, and passive where enough of them are."""
        stable = u[self.allowed(u)]
        stable = stable if stable.shape[0] > 20 else u
        inside = self.passive(stable)
        return stable[inside] if inside.mean() > LEAST and inside.sum() > 20 else stable

    def infer(self, likelihoods: Sequence[Likelihood]) -> Inference:
        """Climb to the mode and draw from the posterior of these likelihoods."""
        target = self.target(likelihoods)
        return self.drawn(target, [find_peak(target, np.zeros(target.size))])

    def drawn(self, target: Target, peaks: Sequence[Peak]) -> Inference:
        """Draw from a posterior with these modes, the most probable first."""
        found = sample(target, peaks, self.rng, self.draws)
        return Inference(target, peaks[0], found.draws, found.share)


@dataclass(frozen=True, eq=False)
class Inference:
    """A posterior: its target, mode, and equally weighted draws of phi.

    `share` is the probability that the memory is passive, before that was made a condition of the draws.
    """

    target: Target
    peak: Peak
    draws: FloatArray
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Parameters
    ----------
    u : ndarray, shape (S, d_u)
        Equally weighted draws of the standardised radiation parameters.
    baseline : dict
        Of doing nothing.
    passive : float, optional
        Probability that the memory is passive, before that was made a condition of the draws.
    centre : ndarray, shape (d_u,), optional
        The estimate, where it is not the mean of the draws.
    bands : tuple of (float, float)
        Lowest and highest frequency [rad/s] at which each record has power.
    """

    u: FloatArray
    baseline: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    sea: Mapping[str, Any] = field(default_factory=dict)
    force: Mapping[str, ForceEstimate] = field(default_factory=dict)
    passive: float | None = None
    centre: FloatArray | None = None
    bands: tuple[tuple[float, float], ...] = ()


def cautious(study: Study, u: FloatArray, bands: Sequence[tuple[float, float]], risk: float = 0.1,
             harm: float = 1.1, points: int = 20, steps: int = 21) -> FloatArray:
    """Return an estimate of the body, shape (n_u,), between the prior's mean and that of draws u, shape (S, n_u).

    It goes as far as it can while being farther from the body than the prior's mean is, by a factor of `harm` in K
    where the motion has power, has a probability of at most `risk` under the draws. The draws' own mean errs least on
    average, but of bodies that the prior happens to hit it makes worse.
    """
    form, omega = study.form, np.linspace(min(low for low, _ in bands), max(high for _, high in bands), points)
    mean, bodies = u.mean(axis=0), form.K(form.theta(u), omega)
    tried = form.K(form.theta(np.linspace(0.0, 1.0, steps)[:, None] * mean), omega)
    # Entries of different units count alike.
    size = np.maximum(np.abs(tried[0]).max(axis=0), 1e-300)
    idle = np.linalg.norm(((tried[0] - bodies) / size).reshape(u.shape[0], -1), axis=1)
    worse = [float(np.mean(np.linalg.norm(((row - bodies) / size).reshape(u.shape[0], -1), axis=1) > harm * idle))
             for row in tried]
    return np.asarray(np.linspace(0.0, 1.0, steps)[np.flatnonzero(np.array(worse) <= risk)[-1]] * mean)
