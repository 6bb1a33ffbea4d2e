"""From candidates to one answer: no_gap, effect, ambiguous or unknown_effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.search import HOME, MATERIAL, Candidate, Search, gap_left

SURE, WITHIN = 3.5, 3.0  # least gain of log evidence for an effect; distance of the rivals that stay in the set
LEFT_SHARE, LEFT_GAP = 0.35, 0.02  # unknown: this much of the gap is left, and at least this much of the motion


@dataclass(frozen=True, eq=False)
class Verdict:
    """The answer.

    Parameters
    ----------
    status : str
        no_gap, effect, ambiguous or unknown_effect.
    chosen : Candidate
        The best candidate; the one without effects in no_gap.
    rivals : list of Candidate
        Candidates that the records cannot tell from the best, the best first; empty unless ambiguous.
    probability : float
    left : float
        Share of the retuned gap's energy above the noise that the chosen candidate leaves.
    """

    status: str
    chosen: Candidate
    rivals: list[Candidate]
    probability: float
    left: float


def decide(found: Search, threshold: float = SURE) -> Verdict:
    """Apply the rules.

    Parameters
    ----------
    found : Search
    threshold : float
        Gain of log evidence, prior odds included, that an effect needs; fixed, no bootstrap of the null.
    """
    none = next(c for c in found.candidates if not c.terms)
    threshold = max(threshold, SURE)
    best = simplest(found, threshold)
    probabilities = posterior(found.candidates)
    if not best.terms:
        left = gap_left(none.fit, found.floors)
        if left > LEFT_GAP:
            return Verdict("unknown_effect", none, [], 1.0 - float(np.exp(-left / LEFT_GAP)), 1.0)
        # What would not matter counts as no gap, too.
        share = sum(probabilities[c.key] for c in found.candidates if c is none or not material(found, none, c))
        return Verdict("no_gap", none, [], share, 0.0)
    before, after = (gap_left(c.fit, found.floors) for c in (none, best))
    share = (after / before) ** 2 if before > 0.0 else 0.0
    if after > LEFT_GAP and share > LEFT_SHARE:
        return Verdict("unknown_effect", best, [], probabilities[best.key], share)
    rivals = [c for c in found.candidates if c.terms and abs(c.evidence - best.evidence) < WITHIN
              and len(c.terms) <= len(best.terms) and (c is best or material(found, none, c))]
    if len(rivals) > 1:
        return Verdict("ambiguous", best, rivals, sum(probabilities[c.key] for c in rivals), share)
    family = [c for c in found.candidates if set(best.key) <= set(c.key)]
    return Verdict("effect", best, [], min(1.0, sum(probabilities[c.key] for c in family)), share)


def simplest(found: Search, threshold: float) -> Candidate:
    """Return the candidate with the fewest effects that no larger one beats by evidence and by what it closes."""
    chosen = next(c for c in found.candidates if not c.terms)
    for count in (1, 2):
        better = [c for c in found.candidates if len(c.terms) == count and c.evidence > chosen.evidence + threshold]
        chosen = next((c for c in better if material(found, chosen, c)), chosen)
    return chosen


def material(found: Search, one: Candidate, other: Candidate) -> bool:
    """Whether the second candidate closes enough of the gap, or brings the nominal numbers back to their tolerance."""
    closed = gap_left(one.fit, found.floors) ** 2 - gap_left(other.fit, found.floors) ** 2
    count = len(found.null.problem.setting.nominal)
    home = float(np.sum(one.fit.q[:count] ** 2) - np.sum(other.fit.q[:count] ** 2))
    return closed > MATERIAL**2 or home > HOME


def posterior(candidates: list[Candidate]) -> dict[tuple[tuple[str, str, str], ...], float]:
    """Return the probability of each candidate."""
    logs: FloatArray = np.array([c.evidence for c in candidates])
    weights = np.exp(logs - logs.max())
    return {c.key: float(w) for c, w in zip(candidates, weights / weights.sum())}
