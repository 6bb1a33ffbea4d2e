"""Candidates: fitted sets of effects, weighed under one noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.gap.posterior.evidence import log_evidence
from radiation_ss.gap.posterior.fitting import LONG, PATIENCE, Fit, refit, residual_energy
from radiation_ss.gap.posterior.noise import Noise, coloured
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
    """Return the noise that the best fit leaves."""
    best = min(fits, key=information_criterion)
    return coloured(best.point.residuals, tuple(0.9 * f for f in floors))


def weigh(fits: list[Fit], noise: Noise, library: int) -> list[Candidate]:
    """Weigh all fits under one noise.

    Of a fit whose cost still falls the evidence is not known, only that it is more: it counts where it is beyond doubt
    the best, else it is left out.
    """
    levels = [information_criterion(item) for item in fits]
    racing = sum(level <= min(levels) + FAR for level in levels)
    patience = LONG if racing > 1 else PATIENCE
    top = np.inf
    found: dict[tuple[tuple[str, str, str], ...], Candidate] = {}
    falling: list[Candidate] = []
    for level, item in sorted(zip(levels, fits), key=lambda pair: pair[0]):
        hopeless = level > min(levels) + FAR
        again = refit(item, noise, passes=0 if hopeless else 25, patience=patience)
        if item.problem.terms and not hopeless and not again.settled:
            again = refit(again, noise, passes=40, patience=patience)
        evidence = log_evidence(again) + log_prior(len(item.problem.terms), library)
        top = evidence if level == min(levels) else top
        # Where derivatives are nothing but rounding, so is what they say of the volume: BIC bounds it.
        candidate = Candidate(again, min(evidence, top - 0.5 * (level - min(levels))) if hopeless else evidence)
        if item.problem.terms and not hopeless and not again.settled:
            falling.append(candidate)
        elif candidate.key not in found or candidate.evidence > found[candidate.key].evidence:
            found[candidate.key] = candidate
    settled = max((c.evidence for c in found.values()), default=-np.inf)
    found |= {c.key: c for c in falling if c.evidence > settled + BEYOND}
    return sorted(found.values(), key=lambda c: -c.evidence)


def information_criterion(found: Fit) -> float:
    """Return BIC of a fit with free noise."""
    count = sum(r.size for r in found.point.residuals)
    return residual_energy(found) + float(np.log(count)) * sum(len(term.free) for term in found.problem.terms)


def log_prior(effects: int, library: int) -> float:
    """Return the log prior probability of one set: .5 none, .4 shared by singles, .1 by pairs."""
    if effects == 0:
        return float(np.log(0.5))
    if effects == 1:
        return float(np.log(0.4 / library))
    return float(np.log(0.1 / (0.5 * library * (library - 1))))
