"""Candidates: fitted sets of effects, weighed under one noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.gap.posterior.evidence import log_evidence
from radiation_ss.gap.posterior.fitting import LONG, PATIENCE, Fit, refit, residual_energy
from radiation_ss.gap.posterior.noise import Noise
from radiation_ss.gap.posterior.noise_left import noise_left
from radiation_ss.gap.posterior.problem import whitened
from radiation_ss.gap.posterior.setting import Term

FAR = 200.0  # a fit this much worse in BIC is not polished
BEYOND = 50.0  # nats by which a fit whose cost still falls must beat all that have settled


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted set of effects.

    Parameters
    ----------
    fit : Fit
    evidence : float
        Log evidence plus log prior probability, up to a common constant.
    """

    fit: Fit
    evidence: float

    @property
    def terms(self) -> tuple[Term, ...]:
        """The effects."""
        return self.fit.problem.terms

    @property
    def key(self) -> tuple[tuple[str, str, str], ...]:
        """What tells candidates apart, whatever the order of their effects."""
        return tuple(sorted(term.key for term in self.terms))


def sound(fits: list[Fit], floors: tuple[float, ...]) -> Noise:
    """Return the noise that the best fit leaves.

    The best of each number of effects compete, each with the noise that it leaves itself: under white noise any slow
    force would win where a sensor drifts.
    """
    counts = {len(item.problem.terms) for item in fits}
    leading = [min((item for item in fits if len(item.problem.terms) == count), key=information_criterion)
               for count in sorted(counts)]
    found = [noise_left(item, floors) for item in leading]
    return min(zip(leading, found), key=lambda pair: criterion_under(pair[1], pair[0]))[1]


def weigh(fits: list[Fit], noise: Noise, library: int) -> list[Candidate]:
    """Weigh all fits under one noise, those that it leaves far behind as they are.

    Of a fit whose cost still falls the evidence is not known, only that it is more: it counts where it is beyond doubt
    the best, else it is left out.
    """
    ranked = sorted(((criterion_under(noise, item), item) for item in fits), key=lambda pair: pair[0])
    levels, ordered = [level for level, _ in ranked], [item for _, item in ranked]
    racing = [level <= levels[0] + FAR for level in levels]
    patience = LONG if sum(racing) > 1 else PATIENCE
    weighed = [candidate(item, noise, library, patience if close else 0) for item, close in zip(ordered, racing)]
    top = weighed[0].evidence
    # Where derivatives are nothing but rounding, so is what they say of the volume: BIC bounds it.
    weighed = [c if close else replace(c, evidence=min(c.evidence, top - 0.5 * (level - levels[0])))
               for c, close, level in zip(weighed, racing, levels)]
    falling = [c for c, close in zip(weighed, racing) if close and c.terms and not c.fit.settled]
    settled = [c for c in weighed if c not in falling]
    highest = max((c.evidence for c in settled), default=-np.inf)
    counted = [*settled, *(c for c in falling if c.evidence > highest + BEYOND)]
    best_of_each = {c.key: c for c in sorted(counted, key=lambda c: c.evidence)}
    return sorted(best_of_each.values(), key=lambda c: -c.evidence)


def candidate(item: Fit, noise: Noise, library: int, patience: int) -> Candidate:
    """Return a fit polished under the noise, with its evidence; without patience it stays as it is."""
    again = refit(item, noise, passes=25 if patience else 0, patience=patience or PATIENCE)
    if item.problem.terms and patience and not again.settled:
        again = refit(again, noise, passes=40, patience=patience)
    return Candidate(again, log_evidence(again) + log_prior(len(item.problem.terms), library))


def information_criterion(found: Fit) -> float:
    """Return BIC of a fit with free noise."""
    count = sum(r.size for r in found.point.residuals)
    return residual_energy(found) + float(np.log(count)) * numbers_of(found)


def criterion_under(noise: Noise, found: Fit) -> float:
    """Return BIC of a fit as it is under a given noise, up to a constant that all fits of the same records share."""
    r, _ = whitened(replace(found.point, slopes=None), noise)
    scale = 2.0 * sum(v.size * np.log(d) for v, d in zip(found.point.residuals, noise.deviation))
    return float(r @ r + found.q @ found.q) + scale + float(np.log(r.size)) * numbers_of(found)


def numbers_of(found: Fit) -> int:
    """Return how many numbers the effects of a fit have, those of each record counted."""
    return sum(len(found.problem.columns(k)) for k in range(len(found.problem.terms)))


def log_prior(effects: int, library: int) -> float:
    """Return the log prior probability of one set: .5 none, .4 shared by singles, .1 by pairs."""
    if effects == 0:
        return float(np.log(0.5))
    if effects == 1:
        return float(np.log(0.4 / library))
    return float(np.log(0.1 / (0.5 * library * (library - 1))))
