"""Is the filter's own uncertainty right? Innovations, rank histograms, spread against error, coverage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.estimate import Band, Estimate


@dataclass(frozen=True)
class InnovationTest:
    """Normalised innovations of a run: a filter that knows its noise has mean 1.

    Parameters
    ----------
    mean : float
        Mean of the squared normalised innovations, per channel and sample.
    lower, upper : float
        Interval of 95 % for a consistent filter with independent innovations.
    """

    mean: float
    lower: float
    upper: float

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in the interval."""
        return self.lower <= self.mean <= self.upper


def innovations(estimate: Estimate, skip: float = 0.0) -> InnovationTest:
    """Return the innovation test of a run, after `skip` seconds."""
    late = estimate.time >= estimate.time[0] + skip
    count = max(int(estimate.used[late].sum()), 1)
    low, high = chi2.ppf((0.025, 0.975), count) / count
    return InnovationTest(float(estimate.nis[late].sum() / count), float(low), float(high))


def rank_histogram(truths: ArrayLike, ensembles: ArrayLike) -> np.ndarray:
    """Return how often the truth takes each rank among the members, shape (members + 1,).

    Parameters
    ----------
    truths : array_like, shape (cases,)
    ensembles : array_like, shape (cases, members)
        Flat where the ensemble is drawn from the truth's distribution; heaped at the ends where it is too narrow.
    """
    members = np.asarray(ensembles, dtype=float)
    ranks = (members < np.asarray(truths, dtype=float)[:, None]).sum(axis=1)
    return np.bincount(ranks, minlength=members.shape[1] + 1)


def spread_over_error(errors: ArrayLike, stds: ArrayLike) -> float:
    """Return rms of the standard deviations over rms of the errors: 1 is right, below 1 is overconfident."""
    return float(np.sqrt(np.mean(np.square(stds)) / np.mean(np.square(errors))))


def coverage(truth: ArrayLike, band: Band) -> FloatArray:
    """Return the share of samples (last axis) that a band covers."""
    values = np.asarray(truth, dtype=float)
    return np.mean((values >= band.lower) & (values <= band.upper), axis=-1)
