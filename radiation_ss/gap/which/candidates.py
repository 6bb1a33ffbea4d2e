"""Candidates: fitted sets of effects, weighed under one noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    ordered = sorted(fits, key=information_criterion)
    levels = [information_criterion(item) for item in ordered]
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
    return residual_energy(found) + float(np.log(count)) * sum(len(term.free) for term in found.problem.terms)


def log_prior(effects: int, library: int) -> float:
    """Return the log prior probability of one set: .5 none, .4 shared by singles, .1 by pairs."""
    if effects == 0:
        return float(np.log(0.5))
    if effects == 1:
        return float(np.log(0.4 / library))
    return float(np.log(0.1 / (0.5 * library * (library - 1))))
