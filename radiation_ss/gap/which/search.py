"""Which effect: score test, refits in the full model, evidence; pairs by forward search, then each member alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from radiation_ss.gap.posterior.evidence import within_bounds
from radiation_ss.gap.posterior.fitting import Fit, residual_energy
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.tolerance.null_fit import nominal_fit, tolerant
from radiation_ss.gap.which.along import pairs_along
from radiation_ss.gap.which.candidates import FAR, Candidate, information_criterion, log_prior, sound, weigh
from radiation_ss.gap.which.material import MATERIAL, gap_left, open_case
from radiation_ss.gap.which.null_law import NullLaw, null_law
from radiation_ss.gap.which.refits import HALVINGS, in_fine_steps, members, refit_term
from radiation_ss.gap.which.scan import scan
from radiation_ss.gap.which.score import Score, scores, shortlist

SHORTLIST, PAIR_ROOTS, PAIRS = 6, 4, 5
TYPICAL = 0.3  # of the prior's standard deviation
UNEXPLAINED = 0.02  # of the motion
COMMON = 2  # halvings of the step, at most, that all candidates share where the null's motion needs them
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Search:
    """All candidates under one noise.

    Parameters
    ----------
    nominal : Fit
        Nothing retuned: only starts.
    null : Fit
        Retuned within tolerance, no effect; the noise is its own residual.
    ranked : list of Score
        Score test at the null fit.
    candidates : list of Candidate
        Best first; the one without effects is among them.
    floors : tuple of float
        White noise of each channel, from its high frequencies.
    law : NullLaw
        What evidence each effect would claim if nothing were missing.
    """

    nominal: Fit
    null: Fit
    ranked: list[Score]
    candidates: list[Candidate]
    floors: tuple[float, ...]
    law: NullLaw = field(default_factory=NullLaw)


def search(setting: Setting, terms: list[Term], *, pairs: bool = True,
           progress: Progress = lambda text, share: None, seed: int = 0) -> Search:
    """Run the whole search.

    Parameters
    ----------
    setting : Setting
    terms : list of Term
        The library at every place and from every start.
    pairs : bool
        Look for two effects at once.
    progress : callable (text, share)
    seed : int
        Of the simulated nulls.
    """
    progress("fit without effects", 0.0)
    null, floors = tolerant(setting)
    null = in_fine_steps(null, floors, COMMON)
    setting = null.problem.setting
    nominal = nominal_fit(setting, null)
    progress("score test", 0.15)
    ranked = scores(null, scan(null, terms))
    singles: list[Fit] = []
    listed = shortlist(ranked, SHORTLIST if open_case(null, floors) else 2)
    if gap_left(null, floors) > MATERIAL:
        listed += at_size(ranked, {item.term.key for item in listed})
    for k, item in enumerate(listed):
        progress(f"refit {item.term.active.label}", 0.25 + 0.4 * k / len(listed))
        ceiling = min((residual_energy(one) for one in singles), default=np.inf) + FAR
        single = refit_term(null, item, floors, ceiling)
        singles += [] if single is None else [single]
    singles.sort(key=lambda one: residual_energy(one) - 2.0 * within_bounds(one))
    fits = [null, *singles]
    if pairs and all(open_case(one, floors) for one in singles[:2]):
        progress("pairs", 0.65)
        lawful = [one for one in singles if not one.problem.terms[0].active.effect.outline]
        laws = [t for t in terms if not t.active.effect.outline]
        together = pair_fits(lawful[:PAIR_ROOTS], laws, floors)
        if all(open_case(one, floors) for one in together):
            together += pairs_along(null, laws, floors, [*singles, *together])
        if lawful and all(gap_left(one, floors) > UNEXPLAINED for one in [*singles, *together]):
            together += with_bent_inputs(lawful[0], laws, floors, [*singles, *together])
        fits += together + members(together, floors)
    progress("evidence", 0.95)
    best = min(map(information_criterion, fits))
    racing = [information_criterion(one) < best + FAR for one in fits]
    halvings = HALVINGS if sum(racing) > 1 else HALVINGS - 1  # the last decides between rivals
    fits = [in_fine_steps(one, floors, halvings) if close else one for one, close in zip(fits, racing)]
    fits += members_as_fine(fits, floors)
    library = len({t.key for t in terms})
    noise = sound(fits, floors)
    law = null_law(null, ranked, noise, log_prior(1, library) - log_prior(0, library), np.random.default_rng(seed))
    return Search(nominal, null, ranked, weigh(fits, noise, library), floors, law)


def members_as_fine(fits: list[Fit], floors: tuple[float, ...]) -> list[Fit]:
    """Return each effect of the best pair alone, from the pair's place and in its steps, where it has coarser ones.

    There a right effect loses to the pair by the integrator's error, not by what it lacks. One that leaves much more
    lacks something.
    """
    best = min(fits, key=information_criterion)
    if len(best.problem.terms) < 2:
        return []
    wanted, keys = best.problem.setting.halvings, {term.key for term in best.problem.terms}
    most = 2.0 * gap_left(best, floors) + MATERIAL
    alone = [one for one in fits if len(one.problem.terms) == 1 and one.problem.terms[0].key in keys
             and gap_left(one, floors) < most]
    return members([best], floors) if any(one.problem.setting.halvings < wanted for one in alone) else []


def at_size(ranked: list[Score], listed: set[tuple[str, str, str]]) -> list[Score]:
    """Return the nonlinear dampings that the score test has not listed, to be fitted from a typical strength.

    Along the null's motion, which dies away, the slope at zero strength says little of a friction that stops the body.
    """
    rest = [item for item in shortlist(ranked, len(ranked)) if item.term.key not in listed]
    return [replace(item, strength=np.full(item.strength.size, TYPICAL)) for item in rest
            if item.term.active.effect.family == "damping" and not item.term.active.effect.linear
            and item.term.active.effect.states == 0]


def pair_fits(roots: list[Fit], terms: list[Term], floors: tuple[float, ...]) -> list[Fit]:
    """Return fits of the most promising pairs: every root, and what the score test adds to it."""
    promising: dict[tuple[tuple[str, str, str], ...], tuple[float, Fit, Score]] = {}
    for root in roots:
        there = root.problem.terms[0].key
        ranked = scores(root, scan(root, [t for t in terms if t.key != there]))
        for item in shortlist(ranked if credible(root, ranked) else [], PAIRS):
            key = tuple(sorted([there, item.term.key]))
            promise = promised_energy(root, item.gain, floors)
            if item.gain > 2.0 and promise < promising.get(key, (np.inf,))[0]:
                promising[key] = (promise, root, item)
    best = sorted(promising.values(), key=lambda entry: entry[0])[:PAIRS]
    found: list[Fit] = []
    for _, root, item in best:
        ceiling = min(residual_energy(one) for one in (*roots, *found)) + FAR
        pair = refit_term(root, item, floors, ceiling)
        found += [] if pair is None else [pair]
    return found


def with_bent_inputs(root: Fit, terms: list[Term], floors: tuple[float, ...], known: list[Fit]) -> list[Fit]:
    """Return fits of the root and each nonlinear input from every start of its shape, where much is left unexplained.

    A force cut off beyond its limit has next to no slope where the root's own numbers have made up for it, and no
    motion along which it could be weighed.
    """
    bent = [t for t in terms if t.active.effect.input is not None and not t.active.effect.linear
            and t.key != root.problem.terms[0].key]
    found: list[Fit] = []
    for item in scores(root, bent) if bent else []:
        ceiling = min(residual_energy(one) for one in (*known, *found)) + FAR
        pair = refit_term(root, replace(item, strength=np.full(item.strength.size, TYPICAL)), floors, ceiling)
        found += [] if pair is None else [pair]
    return found


def credible(root: Fit, ranked: list[Score]) -> bool:
    """Whether the gains promised beside a root can be true: none is more than the whole cost, residuals and pulls.

    To first order the cost is half a sum of squares, which more columns cannot bring below zero. A larger gain shows
    that derivatives have grown (along a stiff friction, say) until rounding is all that is left of their projections.
    """
    return all(item.gain <= root.cost for item in ranked)


def promised_energy(root: Fit, gain: float, floors: tuple[float, ...]) -> float:
    """Return the `residual_energy` of a root after a gain of log posterior; it cannot fall below the sensors' noise.

    The residual is as large as its noise, so its whitened energy is the number of samples. Far from the optimum the
    gain to first order counts pulls that go and noise that no effect explains.
    """
    sizes = np.array([r.size for r in root.point.residuals])
    least = float(sizes @ (np.array(floors) / root.noise.deviation) ** 2 / sizes.sum())
    return residual_energy(root) + float(sizes.sum() * np.log(max(1.0 - 2.0 * gain / sizes.sum(), least)))
