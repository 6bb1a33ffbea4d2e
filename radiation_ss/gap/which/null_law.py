"""How much evidence chance and tolerated errors of the model give each effect where nothing is missing.

A parametric bootstrap of the null, by linearisation: the null fit's own model, the records' inputs and the noise make
new residuals (noise, nominal numbers at or within the edges of their tolerances, a memory and an exciting force that
are off within tolerance in ways that no nominal number describes); the score of each effect on them, with the nominal
numbers retuned, gives the evidence that it would have claimed. What an effect claims of the real records has to exceed
that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import log_ndtr

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.noise import Noise
from radiation_ss.gap.posterior.setting import Term
from radiation_ss.gap.tolerance.tolerated import tolerated
from radiation_ss.gap.which.score import Score, definite, posterior_covariance

REPLICATES = 400
QUANTILE = 0.99  # of the evidence in the replicates; two effects in a hundred may still exceed theirs in one of them
Key = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class NullLaw:
    """What the null gives.

    Parameters
    ----------
    evidence : mapping of (name, dof, other) to float
        Log evidence over no effect, prior odds included, that each effect reaches in one of a hundred replicates.
    left : float
        Gap after retuning that the tolerated errors leave in one of a hundred replicates.
    replicates : int
        0 if no null was simulated.
    refits : int
        How many simulated nulls were fitted anew (`bootstrap.refitted_law`).
    """

    evidence: Mapping[Key, float] = field(default_factory=dict)
    left: float = 0.0
    replicates: int = 0
    refits: int = 0

    def threshold(self, keys: Sequence[Key], floor: float) -> float:
        """Return the evidence that these effects must gain together, at least `floor`."""
        return max([floor, *(self.evidence.get(key, floor) for key in keys)])


def null_law(null: Fit, ranked: Sequence[Score], noise: Noise, odds: float, rng: np.random.Generator,
             replicates: int = REPLICATES) -> NullLaw:
    """Simulate the null by linearisation at its fit.

    Parameters
    ----------
    null : Fit
    ranked : sequence of Score
        Of every effect at the null fit.
    noise : Noise
        Of the sensors.
    odds : float
        Log prior odds of one effect against none.
    rng : Generator
    replicates : int
    """
    errors = tolerated(null, rng, replicates)
    J = whiten(noise, null.slopes)
    inverse = cho_factor(J.T @ J + np.eye(J.shape[1]))
    clean = whiten(noise, errors)
    y = clean + rng.standard_normal(clean.shape)
    y = y - J @ cho_solve(inverse, J.T @ y)
    claims: dict[Key, FloatArray] = {}
    for item in ranked:
        C = whiten(noise, item.slopes)
        information = definite(C.T @ C - C.T @ J @ cho_solve(inverse, J.T @ C))
        claim = claimed(item.term, information, C.T @ y) + odds
        claims[item.term.key] = np.maximum(claims.get(item.term.key, claim), claim)
    return NullLaw({key: float(np.quantile(values, QUANTILE)) for key, values in claims.items()},
                   float(np.quantile(gap_of(null, errors), QUANTILE)), replicates)


def whiten(noise: Noise, values: Sequence[FloatArray]) -> FloatArray:
    """Return all channels' columns in units of the noise, stacked."""
    return np.concatenate([noise.whiten(k, value) for k, value in enumerate(values)])


def claimed(term: Term, information: FloatArray, gradient: FloatArray) -> FloatArray:
    """Return the log evidence of a term in each replicate, gradient of shape (strengths, replicates), to first order.

    A Gaussian posterior of precision `information + 1`; a strength that cannot be negative counts the mass above zero
    of its posterior and prior, and each of the starts of its shape is as probable as the others.
    """
    inverse, log_determinant = posterior_covariance(information)
    mean = inverse @ gradient
    value = 0.5 * np.sum(gradient * mean, axis=0) - 0.5 * log_determinant - np.log(term.alternatives)
    signs = [term.signs[j] for j in term.strengths]
    for k, sign in enumerate(np.repeat(signs, information.shape[0] // len(signs))):
        if sign > 0:
            value = value + log_ndtr(mean[k] / np.sqrt(inverse[k, k])) + np.log(2.0)
    return np.asarray(value)


def gap_of(null: Fit, errors: Sequence[FloatArray]) -> FloatArray:
    """Return the gap that tolerated errors leave in each replicate once the null is retuned, under its own noise.

    The sensors' noise, where they drift, would give slow errors no weight, and leave what the null fit does not.
    """
    J = whiten(null.noise, null.slopes)
    moved = cho_solve(cho_factor(J.T @ J + np.eye(J.shape[1])), J.T @ whiten(null.noise, errors))
    channels = [c for item in null.problem.setting.records for c in item.channels]
    rest = [e - s @ moved for e, s in zip(errors, null.slopes)]
    return np.asarray(np.sqrt(np.mean([np.mean(r**2, axis=0) / max(float(np.mean(c.value**2)), 1e-300)
                                       for r, c in zip(rest, channels)], axis=0)))
