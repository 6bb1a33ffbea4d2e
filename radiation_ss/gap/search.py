"""Which effect: null fit, score test, refits in the full model, evidence; pairs by forward search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from radiation_ss.errors import SolverError
from radiation_ss.gap.evidence import log_evidence
from radiation_ss.gap.fitting import Fit, fit, fit_free_noise, refit, residual_energy
from radiation_ss.gap.noise import Noise, coloured, floor_of, mean_square, white
from radiation_ss.gap.null_law import NullLaw, null_law
from radiation_ss.gap.problem import Problem
from radiation_ss.gap.scan import scan
from radiation_ss.gap.score import Score, scores, shortlist, strength_columns
from radiation_ss.gap.setting import Setting, Term
from radiation_ss.gap.tolerated import discrepancy

SHORTLIST, PAIR_ROOTS, PAIRS = 6, 4, 5
TYPICAL = 0.3  # of the prior's standard deviation
FAR = 200.0  # a fit this much worse in BIC is not polished
MATERIAL = 0.005  # an effect must close this much of the motion, or bring the nominal numbers back
HOME = 6.0  # by this much of the sum of their squared pulls,
ODD = 0.01  # where that sum is one that tolerances give with less than this probability
Progress = Callable[[str, float], None]


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


def channel_omegas(setting: Setting) -> list[float]:
    """Return the typical frequency of each channel's degree of freedom, in the order of residuals."""
    dofs = setting.model.dofs
    return [setting.scales[dofs[c.dof]].omega for record in setting.records for c in record.channels]


def floors_of(setting: Setting, found: Fit) -> tuple[float, ...]:
    """Return the white noise of each channel, of alike channels in different records together."""
    channels = [c for record in setting.records for c in record.channels]
    own = [floor_of(c, r, w) for c, r, w in zip(channels, found.point.residuals, channel_omegas(setting))]
    groups: dict[tuple[int, str], list[float]] = {}
    for channel, value in zip(channels, own):
        groups.setdefault((channel.dof, channel.quantity), []).append(value)
    return tuple(max(value, 0.1 * float(np.median(groups[c.dof, c.quantity]))) for c, value in zip(channels, own))


def tolerant(setting: Setting) -> tuple[Fit, tuple[float, ...]]:
    """Converge the model without effects, free in what its tolerances allow that no nominal number describes, too."""
    bare, floors = null_fit(setting)
    wider = replace(setting, discrepancy=discrepancy(bare, floors, np.random.default_rng(0)))
    if not wider.unnamed:
        return bare, floors
    problem = Problem(wider)
    found = fit_free_noise(problem, floors, bare.noise, problem.extend(bare.q, bare.problem))
    return (found, floors_of(wider, found)) if found.settled else (bare, floors)


def null_fit(setting: Setting) -> tuple[Fit, tuple[float, ...]]:
    """Converge the model without effects, its noise as large as its own residual."""
    problem = Problem(setting)
    channels = [c for record in setting.records for c in record.channels]
    noise = white([0.1 * max(float(np.std(c.value)), 1e-300) for c in channels])
    rough = fit(problem, noise, np.zeros(problem.size), tolerance=0.1)
    found = fit_free_noise(problem, floors_of(setting, rough), noise, rough.q)
    if not found.converged:  # the noise was still shrinking: go on under the last one
        found = refit(found, found.noise, passes=80)
    if not found.settled:
        raise SolverError("the fit without effects did not converge")
    return found, floors_of(setting, found)


def nominal_fit(setting: Setting, null: Fit) -> Fit:
    """Fit only the starts; the model stays as given."""
    bare = Problem(replace(setting, nominal=(), discrepancy=()))
    return fit(bare, null.noise, bare.extend(null.q, null.problem))


def refit_term(root: Fit, item: Score, floors: tuple[float, ...], ceiling: float = np.inf) -> Fit | None:
    """Fit the root's effects and one more in the full model.

    It starts from the better of the root's own nominal numbers and the untouched ones.
    None if the motion grows without bounds from both: such a candidate is dropped.
    """
    setting, terms = root.problem.setting, (*root.problem.terms, item.term)
    problem = Problem(setting, terms)
    first = problem.extend(root.q, root.problem)
    first[strength_columns(problem, len(terms) - 1, item.term)] = item.strength
    second = first.copy()
    second[: len(setting.nominal)] = 0.0
    results = []
    for start in (first, second):
        try:
            results.append(fit(problem, root.noise, start, passes=1))
        except SolverError:
            continue
    if not results:
        return None
    best = min(results, key=lambda f: f.cost)
    return fit_free_noise(problem, floors, root.noise, best.q, ceiling=ceiling, known=best.point)


def gap_left(found: Fit, floors: tuple[float, ...]) -> float:
    """Return the relative residual above the noise that a fit leaves on its own records."""
    channels = [c for item in found.problem.setting.records for c in item.channels]
    ratios = [max(mean_square(r) - floor**2, 0.0) / max(mean_square(c.value), 1e-300)
              for c, r, floor in zip(channels, found.point.residuals, floors)]
    return float(np.sqrt(np.mean(ratios)))


def open_case(found: Fit, floors: tuple[float, ...]) -> bool:
    """Whether an effect could still matter: something is left above the noise, or nominal numbers are pulled."""
    return gap_left(found, floors) > MATERIAL or out_of_tolerance(found)


def pulled(found: Fit, *, named: bool = False) -> float:
    """Return the sum of the squared pulls of all that the tolerances leave free, or of the nominal numbers only."""
    return float(np.sum(found.q[within_tolerance(found, named=named)] ** 2))


def out_of_tolerance(found: Fit, *, named: bool = False) -> bool:
    """Whether the pulls together are larger than tolerances explain.

    Of the numbers that the records inform the pulls are standard normal, those of the others stay at zero: the sum of
    squares is chi-squared with as many degrees of freedom as the records inform.
    """
    free = within_tolerance(found, named=named)
    informed = float(np.sum(1.0 - np.diag(found.covariance)[free]))
    return pulled(found, named=named) > max(HOME, float(chi2.isf(ODD, max(informed, 1e-3))))


def within_tolerance(found: Fit, *, named: bool = False) -> NDArray[np.intp]:
    """Return the positions in q of nominal numbers and, unless only named ones are wanted, of the discrepancy."""
    setting = found.problem.setting
    unnamed = 0 if named else setting.unnamed
    return np.concatenate([np.arange(len(setting.nominal)), np.arange(found.q.size - unnamed, found.q.size)])


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
    setting = null.problem.setting
    nominal = nominal_fit(setting, null)
    progress("score test", 0.15)
    ranked = scores(null, scan(null, terms))
    singles: list[Fit] = []
    listed = shortlist(ranked, SHORTLIST if open_case(null, floors) else 2)
    if open_case(null, floors):
        listed += at_size(ranked, {item.term.key for item in listed})
    for k, item in enumerate(listed):
        progress(f"refit {item.term.active.label}", 0.25 + 0.4 * k / len(listed))
        ceiling = min((residual_energy(one) for one in singles), default=np.inf) + FAR
        single = refit_term(null, item, floors, ceiling)
        singles += [] if single is None else [single]
    singles.sort(key=residual_energy)
    fits = [null, *singles]
    if pairs and all(open_case(one, floors) for one in singles[:2]):
        progress("pairs", 0.65)
        together = pair_fits(singles[:PAIR_ROOTS], terms, floors)
        fits += together + members(together, floors)
    progress("evidence", 0.95)
    library = len({t.key for t in terms})
    noise = sound(fits, floors)
    law = null_law(null, ranked, noise, log_prior(1, library) - log_prior(0, library), np.random.default_rng(seed))
    return Search(nominal, null, ranked, weigh(fits, noise, library), floors, law)


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
        count = sum(r.size for r in root.point.residuals)
        for item in shortlist(scores(root, scan(root, [t for t in terms if t.key != there])), PAIRS):
            key = tuple(sorted([there, item.term.key]))
            # The residual is as large as its noise, so its whitened energy is the number of samples.
            promise = residual_energy(root) + count * float(np.log(max(1.0 - 2.0 * item.gain / count, 1e-6)))
            if item.gain > 2.0 and promise < promising.get(key, (np.inf,))[0]:
                promising[key] = (promise, root, item)
    best = sorted(promising.values(), key=lambda entry: entry[0])[:PAIRS]
    found: list[Fit] = []
    for _, root, item in best:
        ceiling = min((residual_energy(one) for one in found), default=np.inf) + FAR
        pair = refit_term(root, item, floors, ceiling)
        found += [] if pair is None else [pair]
    return found


def members(together: list[Fit], floors: tuple[float, ...]) -> list[Fit]:
    """Return the fits of each effect of the best pair alone, started where the pair has it.

    From the null's numbers a right effect may not have got there by itself.
    """
    if not together:
        return []
    best, found = min(together, key=residual_energy), []
    for term in best.problem.terms:
        problem = Problem(best.problem.setting, (term,))
        try:
            found.append(fit_free_noise(problem, floors, best.noise, problem.extend(best.q, best.problem)))
        except SolverError:
            continue
    return found


def sound(fits: list[Fit], floors: tuple[float, ...]) -> Noise:
    """Return the noise that the best fit leaves."""
    best = min(fits, key=information_criterion)
    return coloured(best.point.residuals, tuple(0.9 * f for f in floors))


def weigh(fits: list[Fit], noise: Noise, library: int) -> list[Candidate]:
    """Weigh all fits under one noise."""
    best = min(fits, key=information_criterion)
    found: dict[tuple[tuple[str, str, str], ...], Candidate] = {}
    for item in fits:
        hopeless = information_criterion(item) > information_criterion(best) + FAR
        again = refit(item, noise, passes=0 if hopeless else 25)
        if item.problem.terms and not hopeless and not again.settled:
            again = refit(again, noise, passes=40)
            if not again.settled:
                continue  # no evidence can be read off where the cost still falls
        candidate = Candidate(again, log_evidence(again) + log_prior(len(item.problem.terms), library))
        if candidate.key not in found or candidate.evidence > found[candidate.key].evidence:
            found[candidate.key] = candidate
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
