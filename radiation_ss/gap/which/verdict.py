"""From candidates to one answer: no_gap, effect, ambiguous or unknown_effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.red_noise import noise_with_drift
from radiation_ss.gap.posterior.setting import Term
from radiation_ss.gap.which.candidates import BEYOND, Candidate, numbers_of
from radiation_ss.gap.which.material import (
    HALF,
    HOME,
    MATERIAL,
    gap_left,
    imitable,
    out_of_tolerance,
    pulled,
    sprung,
    unusual,
)
from radiation_ss.gap.which.score import strength_columns
from radiation_ss.gap.which.search import Search

SURE, WITHIN = 3.5, 3.0  # least gain of log evidence for an effect; distance of the rivals that stay in the set
# Of the gap that one effect closes: what a second one beside it must close at least, and what two others must.
PARTNER, OTHERS = 0.2, 0.1
SEEN = 2.0  # standard deviations
WHOLE = 0.9  # of the energy that the first effect leaves: what a small second one must take away
# Of 613 names that the evidence was sure of in opened seals 604 were right: the least share that this allows (95 %).
RELIABLE = 0.97
# Unknown: this share of the gap's energy is left, and at least this much of the motion; of what is plain to see, less.
LEFT_SHARE, LEFT_GAP = 0.35, 0.02
PLAIN, PLAIN_SHARE = 0.05, 0.15


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
        Candidates that the records cannot tell from the best, the best first; empty unless ambiguous. The one without
        effects is among them where an effect is only more probable than numbers far off within their tolerances.
    probability : float
        That the verdict is right.
    left : float
        Share of the retuned gap's energy above the noise that the chosen candidate leaves.
    """

    status: str
    chosen: Candidate
    rivals: list[Candidate]
    probability: float
    left: float


def decide(found: Search, threshold: float = SURE, most: int = 2) -> Verdict:
    """Apply the rules.

    Parameters
    ----------
    found : Search
    threshold : float
        Least gain of log evidence, prior odds included, that an effect needs; more where the simulated nulls of
        these records reach more (`Search.law`).
    most : int
        Most effects at once.
    """
    none = next(c for c in found.candidates if not c.terms)
    threshold = max(threshold, SURE)
    tolerated = max(LEFT_GAP, found.law.left)
    best = simplest(found, threshold, most)
    probabilities = posterior(found.candidates)
    if not best.terms:
        left = gap_left(none.fit, noise_with_drift(none.fit, found.floors))
        if left > tolerated:
            return Verdict("unknown_effect", none, [], beyond(left, tolerated), 1.0)
        likely = more_likely(found, none)
        if likely:
            rivals = [*likely, none]
            return Verdict("ambiguous", likely[0], rivals, sum(probabilities[c.key] for c in rivals), 1.0)
        if sprung(none.fit):
            return Verdict("unknown_effect", none, [], RELIABLE, 1.0)
        # What would not matter, and what simulated nulls claim as much, counts as no gap, too.
        share = sum(probabilities[c.key] for c in found.candidates if c is none or not material(found, none, c)
                    or none.evidence + threshold < c.evidence)
        return Verdict("no_gap", none, [], min(1.0, share), 0.0)
    before, after = gap_left(none.fit, found.floors), gap_left(best.fit, noise_with_drift(best.fit, found.floors))
    share = (after / before) ** 2 if before > 0.0 else 0.0
    if after > tolerated and share > (LEFT_SHARE if after < PLAIN else PLAIN_SHARE):
        return Verdict("unknown_effect", best, [], beyond(after, tolerated), share)
    if outlined(best):
        return Verdict("unknown_effect", best, [], probabilities[best.key], share)
    rivals = [c for c in found.candidates if c.terms and len(c.terms) <= len(best.terms)
              and (abs(c.evidence - best.evidence) < WITHIN or twins(best, c))
              and (c is best or material(found, none, c))]
    among = posterior([c for c in found.candidates if not another_formula(found, best, c)])
    if len(rivals) > 1:
        return Verdict("ambiguous", best, rivals, RELIABLE * sum(among[c.key] for c in rivals), share)
    family = [p for key, p in among.items() if set(best.key) <= set(key)]
    return Verdict("effect", best, [], RELIABLE * min(1.0, sum(family)), share)


def another_formula(found: Search, best: Candidate, other: Candidate) -> bool:
    """Whether other effects, more of them, explain too little more to be a cause: they are the same law refined.

    Their evidence may be large and says nothing against the best.
    """
    return (len(other.terms) > len(best.terms) and not set(best.key) <= set(other.key)
            and not material(found, best, other))


def more_likely(found: Search, none: Candidate) -> list[Candidate]:
    """Return single effects that are more probable than tolerances alone, though not beyond doubt; the best first.

    They must matter, or be as good as any set and bring nominal numbers back that are far off within their tolerances.
    """
    level = [c for c in found.candidates if len(c.terms) == 1 and not outlined(c)]
    best = found.candidates[0].evidence
    return [c for c in level if c.evidence > level[0].evidence - WITHIN and has_size(found, c)
            and (material(found, none, c)
                 or (c.evidence > best - WITHIN and imitable(c.fit, c.terms)
                     and pulled(none.fit, named=True) - pulled(c.fit, named=True) > HOME))
            and c.evidence > none.evidence + found.law.threshold(c.key, 0.0)]


def twins(one: Candidate, other: Candidate) -> bool:
    """Whether two candidates of as many numbers predict the same readings with the same pulls.

    Then it is not the records that tell them apart but the priors of their numbers.
    """
    noise = one.fit.noise
    difference = [noise.whiten(k, a - b) for k, (a, b) in
                  enumerate(zip(one.fit.point.residuals, other.fit.point.residuals))]
    return (numbers_of(one.fit) == numbers_of(other.fit)
            and sum(float(d @ d) for d in difference) < 2.0 * WITHIN
            and abs(pulled(one.fit) - pulled(other.fit)) < 2.0 * WITHIN)


def outlined(candidate: Candidate) -> bool:
    """Whether a candidate is the outline of an unknown law."""
    return any(term.active.effect.outline for term in candidate.terms)


def beyond(left: float, tolerated: float) -> float:
    """Return the probability that a gap is more than what tolerances leave: exponential with that as its mean."""
    return 1.0 - float(np.exp(-left / tolerated))


def simplest(found: Search, threshold: float, most: int = 2) -> Candidate:
    """Return the candidate with the fewest effects that no larger one beats by evidence and by what it closes."""
    chosen = next(c for c in found.candidates if not c.terms)
    for count in range(1, most + 1):
        level = [c for c in found.candidates if len(c.terms) == count and has_size(found, c)]
        # What the best of them cannot claim, one that explains the records worse cannot claim either; nor can one that
        # explains them worse than fewer effects do, be these material or not.
        fewer = max(c.evidence for c in found.candidates if len(c.terms) < count)
        better = [c for c in level if c.evidence > max(level[0].evidence - WITHIN, fewer)
                  and c.evidence > chosen.evidence + found.law.threshold(added(chosen, c), threshold)]
        chosen = next((c for c in better if material(found, chosen, c)), chosen)
    return chosen


def has_size(found: Search, candidate: Candidate) -> bool:
    """Whether each effect's strength is beyond chance, or no set without the effect comes near.

    One that may as well be zero is no cause. But the standard deviation is a local one: where a law has no slope at its
    own strength (a force that is cut off altogether) it says nothing of zero.
    """
    return all(seen(candidate, k, term) or needed(found, candidate, term) for k, term in enumerate(candidate.terms))


def seen(candidate: Candidate, k: int, term: Term) -> bool:
    """Whether a strength of the k-th effect is beyond chance."""
    q, variance = candidate.fit.q, np.diag(candidate.fit.covariance)
    at = strength_columns(candidate.fit.problem, k, term)
    return bool(np.any(np.abs(q[at]) > SEEN * np.sqrt(np.maximum(variance[at], 0.0))))


def needed(found: Search, candidate: Candidate, term: Term) -> bool:
    """Whether a candidate is beyond doubt better than all that lack one of its effects."""
    return candidate.evidence > BEYOND + max(c.evidence for c in found.candidates if term.key not in c.key)


def added(one: Candidate, other: Candidate) -> list[tuple[str, str, str]]:
    """Return the effects of the second candidate that the first does not have."""
    return [key for key in other.key if key not in one.key]


def material(found: Search, one: Candidate, other: Candidate) -> bool:
    """Whether the second candidate closes enough of the gap, or brings the nominal numbers back to their tolerance.

    A second effect must also close a fair share of what the first one has closed: what a slightly different formula of
    the first leaves is no second cause. The first must explain more than it leaves.
    """
    left = gap_left(one.fit, found.floors) ** 2
    closed = left - gap_left(other.fit, found.floors) ** 2
    first = max(gap_left(found.null, found.floors) ** 2 - left, 0.0) if one.terms else 0.0
    # Beside a first effect only named numbers count: the discrepancy takes up what a slightly other formula leaves.
    named = bool(one.terms)
    drop = pulled(one.fit, named=named) - pulled(other.fit, named=named)
    back = (not out_of_tolerance(other.fit, named=named)
            or unusual(other.fit, named=named) < HALF * unusual(one.fit, named=named))
    home = (closed > -(MATERIAL**2) and out_of_tolerance(one.fit, named=named) and drop > HOME and back
            and imitable(other.fit, [term for term in other.terms if term.key not in one.key]))
    whole = named and closed > WHOLE * left and brought_home(one, other)
    share = PARTNER if set(one.key) <= set(other.key) else OTHERS
    return closed > max(MATERIAL**2, share**2 * first if one.terms else HALF * left) or home or whole


def brought_home(one: Candidate, other: Candidate) -> bool:
    """Whether the first candidate needs more than the tolerances allow, and the second does not."""
    return (out_of_tolerance(one.fit) and not out_of_tolerance(other.fit)
            and pulled(one.fit) - pulled(other.fit) > HOME)


def posterior(candidates: list[Candidate]) -> dict[tuple[tuple[str, str, str], ...], float]:
    """Return the probability of each candidate."""
    logs: FloatArray = np.array([c.evidence for c in candidates])
    weights = np.exp(logs - logs.max())
    return {c.key: float(w) for c, w in zip(candidates, weights / weights.sum())}
