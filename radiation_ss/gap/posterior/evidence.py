"""Evidence of a fit by Laplace's method, with sign limits, bounds of the model's own numbers, the number of starts."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from radiation_ss.gap.posterior.bounds import log_bounded
from radiation_ss.gap.posterior.fitting import Fit


def log_evidence(found: Fit) -> float:
    """Return the log evidence up to a constant that all fits of the same records and noise share.

    The prior is standard normal, so its normalisation cancels against Laplace's; numbers with bounds have another one,
    which `bounds` accounts for. A parameter that cannot be negative has twice the density, and only the mass of its
    posterior above the limit counts.
    """
    problem = found.problem
    value = -found.cost - 0.5 * found.log_determinant
    lower = problem.limits()
    limited = np.flatnonzero(np.isfinite(lower))
    if limited.size:
        covariance = found.covariance
        for k in limited:
            deviation = np.sqrt(covariance[k, k])
            # Inside the limit it has not got there yet: what it would gain by that is no evidence.
            centre = min(free_optimum(found, int(k)), float(found.q[k]))
            value += float(log_ndtr((centre - lower[k]) / deviation) - log_ndtr(-lower[k]))
            value += 0.5 * ((centre - found.q[k]) / deviation) ** 2
    return value + within_bounds(found) - sum(np.log(term.alternatives) for term in problem.terms)


def within_bounds(found: Fit) -> float:
    """Return the log evidence that the bounds of the model's own numbers add to that with their normal prior."""
    bounds = np.array([term.bound for term in found.problem.setting.nominal])
    kept = np.flatnonzero(np.isfinite(bounds))
    return log_bounded(found.q[kept], found.covariance[np.ix_(kept, kept)], bounds[kept])


def free_optimum(found: Fit, k: int) -> float:
    """Return where a parameter at its limit would go without the limit, to first order."""
    if found.q[k] > found.problem.limits()[k] + 1e-9:
        return float(found.q[k])
    r, J = found.whitened()
    gradient = J.T @ r - found.q
    return float(found.q[k] + found.covariance[k] @ gradient)
