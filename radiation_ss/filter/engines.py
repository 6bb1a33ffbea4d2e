"""What the filters hand out sample by sample, and what every filter can do."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.plan import Samples


class Outcome(NamedTuple):
    """What the samples gave, time first; `baseline` is the force with the parameters at their start."""

    force: FloatArray
    force_std: FloatArray
    theta: FloatArray
    theta_std: FloatArray
    baseline: FloatArray
    nis: FloatArray
    used: np.ndarray

    @classmethod
    def empty(cls, samples: int, n: int, n_theta: int) -> Outcome:
        """Return room for some samples."""
        force, force_std, theta, theta_std = (np.empty((samples, size)) for size in (n, n, n_theta, n_theta))
        return cls(force, force_std, theta, theta_std, np.full((samples, n), np.nan), np.zeros(samples),
                   np.zeros(samples, dtype=np.int64))

    def part(self, first: int, last: int) -> Outcome:
        """Return some of them."""
        return Outcome(*(values[first:last] for values in self))


class Engine(Protocol):
    """A filter with state."""

    def advance(self, samples: Samples) -> Outcome:
        """Take samples (nt, 4 n): displacement, velocity, acceleration, known force; NaN where missing."""

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Learn again from all samples; return mean and standard deviation of the parameters, each (n_theta,)."""

    def members(self) -> FloatArray:
        """Return the ensemble of parameters, (n_theta, members)."""

    def drawn(self) -> FloatArray:
        """Return the ensemble as it was drawn, (n_theta, members): its spread is that of the parameters."""

    def projected(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble with its members made physical, and how many had to be, from the start."""

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""
