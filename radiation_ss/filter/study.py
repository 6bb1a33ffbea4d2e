"""What every identification method is given and what it hands back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.identification import ForceEstimate
from radiation_ss.filter.parameters import Parametrisation
from radiation_ss.filter.points import PointLikelihood, Points
from radiation_ss.filter.posterior import Likelihood, Peak, Target, find_peak, sample
from radiation_ss.plant.model import Model
from radiation_ss.simulation.record import Record


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

    @property
    def n_u(self) -> int:
        """Number of radiation parameters that may move."""
        return self.form.active.size

    def target(self, likelihoods: list[Likelihood]) -> Target:
        """Return the posterior of these likelihoods with prior, stability and points."""
        known: list[Likelihood] = [] if self.points is None else [self.points]
        return Target(self.n_u, [*known, *likelihoods], self.allowed)

    def allowed(self, u: FloatArray) -> bool:
        """Whether u gives a stable subsystem."""
        return self.form.stable(self.form.theta(u))

    def infer(self, likelihoods: list[Likelihood], start: FloatArray | None = None) -> Inference:
        """Climb to the mode and draw from the posterior of these likelihoods."""
        target = self.target(likelihoods)
        begin = np.zeros(target.size)
        if start is not None:
            begin[self.n_u:] = start
        peak = find_peak(target, begin)
        drawn = sample(target, peak, self.rng, draws=self.draws)
        return Inference(target, peak, drawn.draws, drawn.effective, begin)


@dataclass(frozen=True, eq=False)
class Inference:
    """A posterior: its target, mode, equally weighted draws of phi, effective number of draws, and the start."""

    target: Target
    peak: Peak
    draws: FloatArray
    effective: float
    start: FloatArray


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Parameters
    ----------
    u : ndarray, shape (S, d_u)
        Equally weighted draws of the standardised radiation parameters.
    baseline : dict
        Of doing nothing.
    """

    u: FloatArray
    baseline: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    sea: Mapping[str, Any] = field(default_factory=dict)
    force: Mapping[str, ForceEstimate] = field(default_factory=dict)
