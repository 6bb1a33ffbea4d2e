"""Evidence of sets of effects by simulated trajectories.

The equation error takes its columns along the measured motion, which noise and sampling blur, most where a force sets
in at once. A simulation has no such error. So where all forces are known the equation error proposes the best set of
each number of effects, and from the best of these the search goes on by trajectories: sets that differ by one effect
are proposed by linear theory about the fit. Each set has Laplace's approximation about the trajectories that fit best,
its own factors of the tolerances and of each motion's errors, and the same unexplained forces and priors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.inference.candidates import Candidate, Keys
from radiation_ss.inference.neighbours import Proposing
from radiation_ss.inference.odds import SearchRules
from radiation_ss.inference.search import Found, best_first, with_inclusion
from radiation_ss.inference.trajectory import Trajectories
from radiation_ss.inference.trajectory_fit import FitRules
from radiation_ss.inference.weighing import Proposal, Weighed, Weighing, let_go


def by_trajectories(found: Found, tolerance: dict[str, float], rules: SearchRules, fit: FitRules,
                    present: Sequence[str]) -> Found:
    """Return sets of effects with their probabilities by trajectories, if all free motions are simulated.

    The errors' standard deviations are, but for a factor, those that the equation error has found for its best set;
    where no set follows the motions with these, for the one that follows them best.
    """
    runs = found.problem.runs
    if not any(run.driven for run in runs) or not all(run.driven or run.prescribed for run in runs):
        return found
    known, best = {c.keys: c for c in found.candidates}, found.candidates[0]
    leaders = {len(c.keys): c for c in reversed(found.candidates) if len(c.keys) <= len(best.keys)}
    proposed, ranked = [best, *leaders.values()], list[Weighed]()
    proposing = Proposing(found.terms, rules, fit.rival, present)
    for _ in range(2):
        try:
            first = Trajectories(found.problem, proposed[0], tolerance, unexplained=True)
        except InputError:  # steps too short to be made, by numbers that the equation error has found
            break
        proposals = [Proposal(c) for c in {c.keys: c for c in proposed}.values()]
        ranked = climbed(Weighing(found, tolerance, proposing, fit, first), proposals, known)
        if not ranked or follows(ranked, fit):
            break
        proposed = [known[w.candidate.keys] for w in ranked[: rules.width]]
    whole = replace(found, candidates=tuple(best_first(known)))
    return averaged(whole, ranked, rules.slack) if follows(ranked, fit) else found


def follows(ranked: Sequence[Weighed], fit: FitRules) -> bool:
    """Whether the likeliest set follows the motions."""
    return bool(ranked) and bool(ranked[0].noise.max() < fit.misfit)


def climbed(weighing: Weighing, wanted: Sequence[Proposal], known: dict[Keys, Candidate]) -> list[Weighed]:
    """Return the sets that a climb by trajectories from some sets weighs, the likeliest first.

    `known` takes the sets as the equation error solves them.
    """
    ranked, tried, rivals = list[Weighed](), set[Keys](), dict[Keys, list[Proposal]]()
    while wanted := ([p for p in wanted if p.candidate.keys not in tried]
                     or [p for p in denied(weighing, ranked, known) if p.candidate.keys not in tried]):
        if len(tried) >= weighing.fit.sets:
            break
        for proposal in wanted:
            known.setdefault(proposal.candidate.keys, proposal.candidate)
            tried.add(proposal.candidate.keys)
            new = weighing.weigh(proposal, max((w.log_probability for w in ranked), default=-np.inf))
            ranked += [new] if new else []
        ranked.sort(key=lambda w: -w.log_probability)
        if not ranked:
            break
        best = ranked[0].candidate.keys
        if best in rivals:  # nothing next to the best set is better: what may stand for one of its effects
            wanted = rivals[best]
        else:
            near, rivals[best] = weighing.next_to(ranked[0], known)
            wanted = [*near, *known_next_to(ranked[0], known, weighing.rules)] or rivals[best]
    return ranked


def denied(weighing: Weighing, ranked: Sequence[Weighed], known: Mapping[Keys, Candidate]) -> list[Proposal]:
    """Return the likeliest sets by the equation error where the best one by trajectories is far from all of them.

    Without an effect that is there a free motion may slip out of phase with any other, so that none looks better.
    """
    likely, rules = best_first(known), weighing.rules
    if not ranked or not let_go(weighing.found.problem):
        return []
    far = known[ranked[0].candidate.keys].log_probability < likely[0].log_probability - rules.slack
    return [Proposal(c) for c in likely[: rules.width]] if far else []


def known_next_to(weighed: Weighed, known: Mapping[Keys, Candidate], rules: SearchRules) -> list[Proposal]:
    """Return the known sets without one effect of a set, and the likeliest others by the equation error next to it."""
    best = weighed.candidate
    near = [c for c in known.values() if 0 < len(c.keys ^ best.keys) <= 2 and abs(len(c.keys) - len(best.keys)) <= 1]
    near.sort(key=lambda c: -c.log_probability)
    return [Proposal(c) for c in (*(c for c in near if c.keys < best.keys), *near[: rules.beam])]


def averaged(found: Found, ranked: Sequence[Weighed], slack: float) -> Found:
    """Return the sets with the mean of their probabilities by the equation error and by trajectories.

    Two approximations of one evidence, and neither is always the better one: what only one of them sees is not sure.
    The first is the likeliest of those that trail by at most `slack` by trajectories.
    """
    sets = {w.candidate.keys: replace(w.candidate, log_probability=w.log_probability) for w in ranked}
    simulated = replace(found, candidates=tuple(sets.values()))
    chance = dict(zip(sets, 0.5 * simulated.probabilities()))
    for candidate, p in zip(found.candidates, 0.5 * found.probabilities()):
        sets.setdefault(candidate.keys, candidate)
        chance[candidate.keys] = chance.get(candidate.keys, 0.0) + p
    least = ranked[0].log_probability - slack
    first = max((w.candidate.keys for w in ranked if w.log_probability >= least), key=lambda keys: chance[keys])
    order = sorted(sets, key=lambda keys: (keys != first, -chance[keys]))
    ordered = [replace(sets[keys], log_probability=float(np.log(chance[keys] + 1e-300))) for keys in order]
    return with_inclusion(found.problem, ordered, found.terms)
