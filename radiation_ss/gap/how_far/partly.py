"""What is beyond doubt a part of a gap whose whole cause is unknown."""

from __future__ import annotations

from collections.abc import Callable

from radiation_ss.gap.how_far.unseen import Shrunk, bounded
from radiation_ss.gap.which.candidates import Candidate
from radiation_ss.gap.which.material import MATERIAL, gap_left
from radiation_ss.gap.which.search import Search
from radiation_ss.gap.which.verdict import SURE, Verdict, outlined, posterior

INCLUDED = 0.99  # posterior probability of the sets that hold an effect
SHARE = 0.1  # of the gap's energy on unseen data that a part must close at least


def part_of(found: Search) -> Candidate | None:
    """Return the candidate of those effects that are in (nearly) every probable set; None if they close nothing.

    Evidence compares sets with one another; that one of them is the whole cause it does not say. What of them closes
    next to nothing is left out.
    """
    none = next(c for c in found.candidates if not c.terms)
    probabilities = posterior(found.candidates)
    sure = {term.key for term in found.candidates[0].terms
            if sum(p for key, p in probabilities.items() if term.key in key) > INCLUDED}
    inside = sorted((c for c in found.candidates if set(c.key) <= sure), key=lambda c: (len(c.terms), -c.evidence))
    left = {c.key: gap_left(c.fit, found.floors) ** 2 for c in inside}
    part = next(c for c in inside if left[c.key] < min(left.values()) + MATERIAL**2)
    beyond_doubt = part.evidence > none.evidence + found.law.threshold(part.key, SURE)
    return part if part.terms and beyond_doubt and not outlined(part) else None


def told_part(found: Search, answer: Verdict, gap: float, predicted: Callable[[Verdict], Shrunk]) -> tuple[str, ...]:
    """Return a remark on the part of an unknown cause that evidence is sure of and unseen data confirm.

    Parameters
    ----------
    found : Search
    answer : Verdict
    gap : float
        On unseen data, without it.
    predicted : callable
        Measures a verdict on unseen data.
    """
    part = part_of(found) if answer.status == "unknown_effect" else None
    if part is None:
        return ()
    result = bounded(Verdict("effect", part, [], 1.0, 1.0), predicted)
    if result is None or result[0].gap_after ** 2 > (1.0 - SHARE) * gap**2:
        return ()
    names = " and ".join(term.active.label for term in part.terms)
    return (f"A part of the gap is {names}: every probable set of effects has it, and on unseen data the gap goes from "
            f"{gap:.1%} to {result[0].gap_after:.1%} with it. The whole cause it is not.",)
