"""What speaks for a set of effects before the records do: how often each is met, and how strong it is."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from radiation_ss.inference.candidates import Term
from radiation_ss.inference.linear_model import SizePrior


@dataclass(frozen=True)
class SearchRules:
    """What steers the search.

    Parameters
    ----------
    inclusion : float
        Prior probability that an effect acts on one place.
    rare : float
        The same of an effect that is met less often (`Effect.rare`).
    strong : float
        How rare strong forces are: their strengths' prior is a mixture of normal ones, each part rarer than the one
        before by this factor. So it falls by a power law.
    stronger : float
        What multiplies the standard deviations from one part to the next.
    parts : int
        Of the mixture.
    most : int
        Effects at once, wrong zeros of forces and sensors not counted.
    beam : int
        Sets that are extended in each round.
    width : int
        Extensions of a set that are solved.
    sizes : SizePrior
        Of the learned sizes.
    least : float
        Log Bayes factor by the score test below which they are not.
    slack : float
        Log evidence by which a set may trail, at its parent's sizes, for its own sizes to be learned.
    reach : float
        Log evidence by which a set may trail to be extended.
    """

    inclusion: float = 0.1
    rare: float = 0.01
    strong: float = 0.1
    stronger: float = 6.0
    parts: int = 3
    most: int = 6
    beam: int = 3
    width: int = 6
    sizes: SizePrior = field(default_factory=SizePrior)
    least: float = -3.0
    slack: float = 10.0
    reach: float = 200.0


def log_prior(term: Term, rules: SearchRules, present: Sequence[str] = ()) -> float:
    """Return the log odds that an effect acts with its shape: one of its starts, or what is about a refined one."""
    chance = rules.rare if term.active.rare else rules.inclusion
    odds = 0.0 if term.active.name in present else np.log(chance / (1.0 - chance))
    return float(odds - np.log(term.shapes) + term.volume + log_width(term, term.width, rules))


def in_likelier_widths(numbers: Sequence[Term], terms: Sequence[Term], rules: SearchRules) -> tuple[Term, ...]:
    """Return terms with their priors as wide as is likelier of the numbers, those of the same terms."""
    found = []
    for known, term in zip(numbers, terms):
        narrow = term.widened(1.0).columns.spread
        if forceful(term):
            strengths = np.maximum([known.active.values[name] for name in term.strengths], term.columns.lower) / narrow
            heights = {width: log_width(term, width, rules) - np.sum(np.log(width) + 0.5 * (strengths / width) ** 2)
                       for width in rules.stronger ** np.arange(rules.parts)}
            term = term.widened(max(heights, key=lambda width: heights[width]))
        found.append(term)
    return tuple(found)


def forceful(term: Term) -> bool:
    """Whether it is a force of one strength in all records."""
    return term.active.effect.force is not None and not term.active.effect.per_record


def log_width(term: Term, width: float, rules: SearchRules) -> float:
    """Return the log of how much rarer the part of the mixture is that a force's strengths come from."""
    part = np.log(width) / np.log(rules.stronger)
    return float(part * np.log(rules.strong)) if forceful(term) else 0.0
