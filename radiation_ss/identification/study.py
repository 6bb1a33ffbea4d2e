"""What every identification method is given and what it hands back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.identification.passivity import passive
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.settings import Settings
from radiation_ss.inference.laplace import Likelihood, Target
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
    given_points: Points | None
    seed: int
    rng: np.random.Generator
    rules: Settings

    @property
    def n_u(self) -> int:
        """Number of radiation parameters that may move."""
        return self.form.size

    @property
    def draws(self) -> int:
        """Number of draws kept of the posterior."""
        return self.rules.draws

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
        return stable[inside] if inside.mean() > self.rules.least_passive and inside.sum() > 20 else stable


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Parameters
    ----------
    u : ndarray, shape (S, d_u)
        Equally weighted draws of the standardised radiation parameters.
    baseline : dict
        Of the prior model.
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


def cautious(study: Study, u: FloatArray, bands: Sequence[tuple[float, float]], close: float = 0.1) -> FloatArray:
    """Return an estimate of the body, shape (n_u,), between the prior's mean and that of draws u, shape (S, n_u).

    Of the way between them the place with the least expected ratio of its error to that of the model, in K where the
    motion has power. The draws' own mean errs least on average, but makes bodies worse that the model happens to hit.
    A body nearer to the model than a share `close` of the draws' usual distance counts as that far.
    """
    form, omega = study.form, np.linspace(min(low for low, _ in bands), max(high for _, high in bands), 20)
    mean, bodies = u.mean(axis=0), form.K(form.theta(u), omega)
    tried = np.linspace(0.0, 1.0, 21)[:, None] * mean
    K = form.K(form.theta(tried), omega)
    # Entries of different units count alike.
    size = np.maximum(np.abs(K[0]).max(axis=0), 1e-300)
    away = np.array([np.linalg.norm(((row - bodies) / size).reshape(u.shape[0], -1), axis=1) for row in K])
    before = np.maximum(away[0], close * np.sqrt(np.mean(away[0] ** 2)))
    return np.asarray(tried[np.argmin(np.mean(away / before, axis=1))])
