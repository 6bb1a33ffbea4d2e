"""Evidence of a fit by Laplace's method, with sign limits and the number of starts accounted for."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from radiation_ss.gap.posterior.fitting import Fit


def log_evidence(found: Fit) -> float:
    """Return the log evidence up to a constant that all fits of the same records and noise share.

    The prior is standard normal, so its normalisation cancels against Laplace's. A parameter that cannot be negative
    has twice the density, and only the mass of its posterior above the limit counts.
    """
    problem = found.problem
    value = -found.cost - 0.5 * found.log_determinant
    lower = problem.limits()
    limited = np.flatnonzero(np.isfinite(lower))
    if limited.size:
        covariance = found.covariance
        for k in limited:
            deviation = np.sqrt(covariance[k, k])
            centre = free_optimum(found, int(k))
            value += float(log_ndtr((centre - lower[k]) / deviation) - log_ndtr(-lower[k]))
            value += 0.5 * ((centre - found.q[k]) / deviation) ** 2
    return value - sum(np.log(term.alternatives) for term in problem.terms)


def free_optimum(found: Fit, k: int) -> float:
    """Return where a parameter at its limit would go without the limit, to first order."""
    if found.q[k] > found.problem.limits()[k] + 1e-9:
        return float(found.q[k])
    r, J = found.whitened()
    gradient = J.T @ r - found.q
    return float(found.q[k] + found.covariance[k] @ gradient)
