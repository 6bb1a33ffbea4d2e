"""Tolerances as bounds: what it says of a fit that the model's own numbers keep to them.

The fits use a normal prior, which least squares need. But who says that a stiffness is known to 2 % means that
it is not off by 5 %: the probability of a number is flat up to its bound b and falls off within a fraction of it,

    p(q) = (Phi((b - q) / s) - Phi((-b - q) / s)) / 2b.

The evidence under that prior is the one under the normal prior times the posterior mean of the product of p(q) / N(q).
Expectation propagation gives it (Minka 2001): each p is replaced by a normal shape that leaves mass, mean and variance
of the posterior as they are; p is log-concave, so the shapes have positive precisions.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from radiation_ss.arrays import FloatArray

EDGE = 0.25  # s: how soft a bound is, in tolerances
SWEEPS, SETTLED = 200, 1e-8
LEAST = 1e-8  # precision of what nothing but the bound says
FINEST = 1e-10  # variance: a hundred-thousandth of a tolerance is exact; derivatives that have grown claim 1e-86


def log_bounded(mean: FloatArray, covariance: FloatArray, bounds: FloatArray, edge: float = EDGE) -> float:
    """Return the log of the evidence with bounds over that with a standard normal prior.

    Parameters
    ----------
    mean, covariance : ndarray, shapes (n,) and (n, n)
        Of the posterior of the bounded numbers under the standard normal prior, in standard deviations of that prior.
    bounds : ndarray, shape (n,)
        b of each.
    edge : float
        s.

    Returns
    -------
    float
        About 0 where the numbers are well inside; far below 0 where they cannot be. Under the bounded prior it is below
        -t with a probability of at most exp(-t) (it is a ratio of evidences).
    """
    if not mean.size:
        return 0.0
    variances, axes = np.linalg.eigh(covariance)
    precision: FloatArray = np.asarray((axes / np.clip(variances, FINEST, 1.0)) @ axes.T, dtype=np.float64)
    shift = precision @ mean
    tau, nu = np.ones(mean.size), np.zeros(mean.size)  # the normal prior itself
    for _ in range(SWEEPS):
        before = np.concatenate([tau, nu])
        for k in range(mean.size):
            spread = np.linalg.inv(precision + np.diag(tau - 1.0))
            alone, lean = cavity(spread[k, k], (spread @ (shift + nu))[k], tau[k], nu[k])
            _, m, v = tilted(lean / alone, 1.0 / alone, bounds[k], edge)
            tau[k], nu[k] = max(1.0 / v - alone, LEAST), m / v - lean
        if np.abs(np.concatenate([tau, nu]) - before).max() < SETTLED * max(1.0, tau.max()):
            break
    return joint(precision, shift, tau, nu, bounds, edge)


def cavity(variance: float, mean: float, tau: float, nu: float) -> tuple[float, float]:
    """Return precision and precision times mean of a marginal without its own site."""
    return max(1.0 / variance - tau, LEAST), mean / variance - nu


def tilted(m: float, v: float, bound: float, edge: float) -> tuple[float, float, float]:
    """Return log mass, mean and variance of N(q; m, v) p(q)."""
    t = float(np.sqrt(v + edge**2))
    high, low = (bound - m) / t, (-bound - m) / t
    sign = 1.0
    if abs(low) < abs(high):  # by symmetry, to the tail in which the difference is exact
        high, low, sign = -low, -high, -1.0
    top, bottom = float(log_ndtr(high)), float(log_ndtr(low))
    log_mass = top + float(np.log1p(-np.exp(bottom - top)))
    a, b = (float(np.exp(-0.5 * x**2 - 0.5 * np.log(2.0 * np.pi) - log_mass)) for x in (high, low))
    slope = sign * (b - a) / t
    bend = -slope**2 - (high * a - low * b) / t**2
    return log_mass - float(np.log(2.0 * bound)), m + v * slope, max(v + v**2 * bend, 1e-12 * v)


def joint(precision: FloatArray, shift: FloatArray, tau: FloatArray, nu: FloatArray, bounds: FloatArray,
          edge: float) -> float:
    """Return the log of the integral of the posterior times all sites over all standard normal priors."""
    total = precision + np.diag(tau - 1.0)
    spread = np.linalg.inv(total)
    mean = spread @ (shift + nu)
    value = 0.5 * (np.linalg.slogdet(precision)[1] - np.linalg.slogdet(total)[1])
    value += 0.5 * float((shift + nu) @ mean - shift @ np.linalg.solve(precision, shift))
    value += 0.5 * mean.size * np.log(2.0 * np.pi)
    for k in range(mean.size):
        alone, lean = cavity(spread[k, k], mean[k], tau[k], nu[k])
        mass, _, _ = tilted(lean / alone, 1.0 / alone, bounds[k], edge)
        value += mass + 0.5 * np.log1p(tau[k] / alone)
        value += 0.5 * (lean**2 / alone - (lean + nu[k]) ** 2 / (alone + tau[k]))
    return float(value)
