"""Numbers and evidence of sets of effects by simulated trajectories.

The equation error takes its columns along the measured motion, which noise and sampling blur, most where a force sets
in at once. A simulation has no such error. So the search proposes sets by the equation error; where all forces are
known, the best of each number of effects and those next to the best are weighed anew, by Laplace's approximation about
the trajectories that fit best, with the same noise, unexplained forces and priors for every set.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import vector_of
from radiation_ss.errors import SolverError
from radiation_ss.inference.candidates import Candidate, FittedSet, Key, Keys, from_regression
from radiation_ss.inference.equation import left_out
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.search import Found, SearchRules, log_prior, solve_set, with_inclusion
from radiation_ss.inference.trajectory import Normal, Trajectories


@dataclass(frozen=True)
class FitRules:
    """What stops a trajectory fit."""

    iterations: int = 12  # How often derivatives are taken at most
    race: int = 2  # How often at each of several starts, before the lowest goes on
    gain: float = 1e-3  # Relative decrease of the cost below which it stops
    kept: float = 0.1  # Relative decrease of the cost above which derivatives serve for another step


@dataclass(frozen=True, eq=False)
class Weighed:
    """A set with its log probability by trajectories and the numbers that fit best."""

    candidate: Candidate
    log_probability: float
    point: FloatArray  # (parameters,): Nominal numbers and the effects' parameters
    own: FloatArray  # Unknowns of each record
    numbers: Mapping[tuple[Key, str], float]  # The parameters by their names


@dataclass(frozen=True, eq=False)
class Weighing:
    """What all sets are weighed with: `first` is the set whose noise and unexplained forces are those of all."""

    problem: EquationError
    tolerance: dict[str, float]
    rules: SearchRules
    fit: FitRules
    present: Sequence[str]
    first: Trajectories

    def weigh(self, candidate: Candidate, known: Iterable[Weighed]) -> Weighed | None:
        """Weigh a set from the best of some starts; None if it is far behind, or its motion grows without bounds."""
        known = list(known)
        trial = Trajectories(self.problem, candidate, self.tolerance, self.first)
        few = replace(self.fit, iterations=self.fit.race)
        tries = [reached for start in self.starts(trial, known) if (reached := lowest(trial, start, few))]
        if not tries:
            return None
        q, now = min(tries, key=lambda reached: reached[1].cost)
        if -0.5 * now.cost < max((w.log_probability for w in known), default=-np.inf) - self.rules.reach:
            return None
        q, now = lowest(trial, q, self.fit) or (q, now)
        evidence = -0.5 * (now.cost + np.linalg.slogdet(now.information)[1]) + of_each_record(self.problem, candidate)
        # The shapes are unknowns of the trajectories: the prior is that of their starts.
        prior = sum(log_prior(term, self.rules, self.present) - term.volume for term in candidate.terms)
        prior -= 0.5 * (candidate.posterior.sizes.tolerance / self.rules.sizes.tolerance) ** 2
        point = trial.parameters(q)
        return Weighed(candidate, float(evidence + prior), point, q[trial.free.size:],
                       dict(zip(names(trial), point.tolist())))

    def starts(self, trial: Trajectories, known: Iterable[Weighed]) -> list[FloatArray]:
        """Return unknowns by the equation error at learned and at stated tolerances, and those of the nearest set."""
        candidate, found = trial.candidate, [trial.start()]
        sizes = candidate.posterior.sizes
        if sizes.tolerance > 0.0:
            stated = solve_set(self.problem, candidate.terms, replace(sizes, tolerance=0.0), self.rules, self.present,
                               learned=False)
            numbers = from_regression(self.problem, stated, self.tolerance)
            found.append(trial.start(vector_of((*numbers.nominal, *(numbers.effects[k] for k in trial.kept)))))
        near = [w for w in known if 0 < apart(w.candidate, candidate.keys) <= 2]
        if near:
            found.append(like(trial, min(near, key=lambda w: (apart(w.candidate, candidate.keys), -w.log_probability))))
        return found

    def next_to(self, sets: Iterable[Candidate], best: Candidate) -> list[Candidate]:
        """Return the sets without one effect of the best, and the likeliest others that differ by one."""
        near = [c for c in sets if 0 < apart(c, best.keys) <= 2 and abs(len(c.keys) - len(best.keys)) <= 1]
        near.sort(key=lambda c: -c.log_probability)
        return [*(c for c in near if c.keys < best.keys), *near[: self.rules.beam]]


def by_trajectories(found: Found, tolerance: dict[str, float], rules: SearchRules, fit: FitRules,
                    present: Sequence[str] = ()) -> Found:
    """Return the likeliest sets with their probabilities by trajectories; what was found where these cannot tell.

    That is where a force is not known or the motion is prescribed, and where the records show radiation that its fit
    leaves out.
    """
    problem, best = found.problem, found.candidates[0]
    if left_out(problem, best.posterior) or any(run.force is None or run.prescribed for run in problem.runs):
        return found
    weighing = Weighing(problem, tolerance, rules, fit, present,
                        Trajectories(problem, best, tolerance, unexplained=True))
    tried: dict[Keys, Weighed | None] = {}
    ranked: list[Weighed] = []
    leaders = {len(c.keys): c for c in reversed(found.candidates) if len(c.keys) <= len(best.keys)}
    wanted = [best, *leaders.values()]
    while wanted := [c for c in wanted if c.keys not in tried]:
        for candidate in wanted:
            if candidate.keys not in tried:
                tried[candidate.keys] = weighing.weigh(candidate, [w for w in tried.values() if w is not None])
        ranked = sorted((w for w in tried.values() if w is not None), key=lambda w: -w.log_probability)
        wanted = weighing.next_to(found.candidates, ranked[0].candidate) if ranked else []
    return averaged(found, ranked, rules.slack) if ranked else found


def averaged(found: Found, ranked: Sequence[Weighed], slack: float) -> Found:
    """Return the sets with the mean of their probabilities by the equation error and by trajectories.

    Two approximations of one evidence, and neither is always the better one: what only one of them sees is not sure.
    The first is the likeliest of those that trail by at most `slack` by trajectories.
    """
    sets = {w.candidate.keys: replace(w.candidate, point=w.point, log_probability=w.log_probability) for w in ranked}
    simulated = Found(found.problem, tuple(sets.values()))
    chance = dict(zip(sets, 0.5 * simulated.probabilities()))
    for candidate, p in zip(found.candidates, 0.5 * found.probabilities()):
        sets.setdefault(candidate.keys, candidate)
        chance[candidate.keys] = chance.get(candidate.keys, 0.0) + p
    least = ranked[0].log_probability - slack
    first = max((w.candidate.keys for w in ranked if w.log_probability >= least), key=lambda keys: chance[keys])
    order = sorted(sets, key=lambda keys: (keys != first, -chance[keys]))
    return with_inclusion(found.problem, [replace(sets[keys], log_probability=float(np.log(chance[keys] + 1e-300)))
                                          for keys in order])


def apart(candidate: Candidate, keys: Keys) -> int:
    """Return how many effects are in one of two sets only."""
    return len(candidate.keys ^ keys)


def names(trial: Trajectories) -> list[tuple[Key, str]]:
    """Return whose number each parameter of a simulation is."""
    return [((a.name, a.dof, a.other), name) for a in trial.actives for name in a.effect.parameters]


def like(trial: Trajectories, near: Weighed) -> FloatArray:
    """Return the unknowns of another set's trajectories; what it does not have acts with no strength."""
    strong = [p.strength for a in trial.actives for p in a.effect.parameters.values()]
    numbers = [near.numbers.get(name, 0.0 if strength else value)
               for name, strength, value in zip(names(trial), strong, trial.base)]
    q = trial.start(np.array(numbers))
    if near.own.size == q.size - trial.free.size:
        q[trial.free.size:] = near.own
    return trial.inside(q)


def of_each_record(problem: EquationError, candidate: Candidate) -> float:
    """Return the log evidence of strengths that each record has for itself: simulations take them as they are."""
    at, total = problem.base.count, 0.0
    for term in candidate.terms:
        mine = slice(at, at + term.columns.count)
        at += term.columns.count
        if term.active.effect.per_record:
            spread, covariance = term.columns.spread, candidate.posterior.covariance[mine, mine]
            total -= 0.5 * float(np.sum((candidate.posterior.mean[mine] / spread) ** 2))
            total += 0.5 * float(np.linalg.slogdet(covariance / np.outer(spread, spread))[1])
    return total


def fit_trajectories(problem: EquationError, candidate: Candidate, tolerance: dict[str, float],
                     rules: FitRules | None = None) -> FittedSet:
    """Return a candidate's numbers fitted by trajectories; those of the equation error where that fails.

    Levenberg's method with exact derivatives, which are kept as long as they serve, and physical bounds by projection.
    Records whose motion is prescribed are predicted by the equation error itself.
    """
    rules = rules or FitRules()
    fallback = from_regression(problem, candidate, tolerance)
    if not any(run.force is not None and not run.prescribed for run in problem.runs):
        return fallback
    trial = Trajectories(problem, candidate, tolerance)
    reached = lowest(trial, trial.start(candidate.point), rules)
    if reached is None:
        return fallback
    try:
        return trial.estimate(reached[0], np.asarray(np.linalg.inv(reached[1].information), dtype=np.float64))
    except np.linalg.LinAlgError:
        return fallback


def lowest(trial: Trajectories, q: FloatArray, rules: FitRules) -> tuple[FloatArray, Normal] | None:
    """Return the lowest point that is reached from one, and its normal equations; None if the motion grows."""
    try:
        damping, now = 1.0, trial.at(q)
        for _ in range(rules.iterations):
            before, (q, now, damping) = now.cost, better(trial, q, now, damping)
            if before - now.cost < rules.gain * now.cost:
                break
            while before - now.cost > rules.kept * now.cost:
                before, (q, now, _) = now.cost, better(trial, q, now, damping, tries=1)
            now = trial.at(q)
    except (SolverError, np.linalg.LinAlgError):
        return None
    return q, now


def better(trial: Trajectories, q: FloatArray, now: Normal, damping: float,
           tries: int = 8) -> tuple[FloatArray, Normal, float]:
    """Return a better point, its normal equations and the damping to go on with; the point itself if there is none."""
    for _ in range(tries):
        # The unknowns are in units of their priors: what the data hardly tell is not held back more than by its prior.
        new = trial.inside(q + np.linalg.solve(now.information + damping * np.eye(q.size), now.slope))
        try:
            found = trial.near(new, now)
        except SolverError:
            found = now
        if found.cost < now.cost:
            return new, found, max(damping / 10.0, 1e-9)
        damping *= 10.0
    return q, now, damping
