"""One set of effects weighed by simulated trajectories: where its fit begins, its evidence, its neighbours."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import vector_of
from radiation_ss.errors import InputError, SolverError
from radiation_ss.inference.candidates import Candidate, Key, Keys, Term, from_regression, placed
from radiation_ss.inference.linear_model import Normal, Sizes
from radiation_ss.inference.neighbours import Neighbour, Proposing, neighbours
from radiation_ss.inference.odds import SearchRules, in_likelier_widths, log_prior
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.regression import solve
from radiation_ss.inference.score import gains
from radiation_ss.inference.search import Found, solve_set
from radiation_ss.inference.trajectory import Trajectories
from radiation_ss.inference.trajectory_fit import FitRules, covariance_of, likely_noise, log_noise, lowest, with_sizes

Number = tuple[Key, str]
"""An effect on its places, and the name of one of its parameters."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """A set with its log probability by trajectories and the numbers that fit best."""

    candidate: Candidate
    log_probability: float
    numbers: Mapping[Number, float]  # Nominal numbers and the effects' parameters
    own: Sequence[Mapping[Key | str, FloatArray]]  # Unknowns of each record
    noise: FloatArray  # Factors of the errors' standard deviations


@dataclass(frozen=True, eq=False)
class Start:
    """Where a fit may begin: the terms whose shapes are the middle of the prior, numbers, unknowns of each record."""

    terms: tuple[Term, ...]
    numbers: Mapping[Number, float]
    own: Sequence[Mapping[Key | str, FloatArray]]


@dataclass(frozen=True, eq=False)
class Proposal:
    """A set to be weighed, and where its fit may begin; by default where the equation error says."""

    candidate: Candidate
    starts: Sequence[Start] = ()


@dataclass(frozen=True, eq=False)
class Weighing:
    """What all sets are weighed with: the errors of readings and forces of `first` are those of all."""

    found: Found
    stated: dict[str, float]
    proposing: Proposing
    fit: FitRules
    first: Trajectories

    @property
    def rules(self) -> SearchRules:
        """What steers the search."""
        return self.proposing.rules

    def weigh(self, proposal: Proposal, least: float) -> Weighed | None:
        """Weigh a set from the best of some starts; None if it is far below `least`, or its motion grows."""
        candidate, problem = proposal.candidate, self.found.problem
        try:
            simulated = self.simulation(candidate).tolerating(0.0)
        except InputError:  # steps too short to be made, by numbers that the equation error has found
            return None
        tries = self.race(simulated, proposal)
        if not tries:
            return None
        trial, q, now = min(tries, key=lambda reached: reached[2].cost)
        if let_go(problem) and self.lost(trial, q):
            trial, q, now = min([(trial, q, now), *self.grown(simulated)], key=lambda reached: reached[2].cost)
        likely, agree = likely_noise(trial, now, self.rules), of_second_sensors(problem, candidate)
        if log_noise(trial, now, likely, self.rules, errors=True) + agree < least - self.rules.reach:
            return None
        trial, q, now = with_sizes(trial, *(lowest(trial, q, self.fit) or (q, now)), self.rules, self.fit)
        trial, q, now = self.in_likelier_widths(trial, q, now)
        if any(a.start is not b.start or a.active is not b.active
               for a, b in zip(trial.candidate.terms, candidate.terms)):
            candidate = self.by_equation(trial.candidate.terms, candidate.posterior.sizes)
        evidence = -0.5 * (now.cost + np.linalg.slogdet(now.information)[1]) + of_each_record(problem, candidate)
        evidence += log_within_bounds(trial, q, now) + log_noise(trial, now, trial.noise, self.rules) + agree
        # The shapes are unknowns of the trajectories: the prior is that of their starts.
        point = trial.parameters(q)
        prior = sum(log_prior(term, self.rules, self.proposing.present) - term.volume
                    for term in at_numbers(trial, trial.candidate.terms, point))
        prior -= 0.5 * (trial.tolerance / self.rules.sizes.tolerance) ** 2
        sizes = replace(candidate.posterior.sizes, tolerance=trial.tolerance)
        candidate = replace(candidate, terms=trial.candidate.terms, point=point,
                            posterior=replace(candidate.posterior, sizes=sizes))
        return Weighed(candidate, float(evidence + prior), dict(zip(names(trial), point.tolist())),
                       trial.of_records(q), trial.noise)

    def in_likelier_widths(self, trial: Trajectories, q: FloatArray,
                           now: Normal) -> tuple[Trajectories, FloatArray, Normal]:
        """Return a fit with each force in the part of its prior that is likelier of its numbers."""
        terms = trial.candidate.terms
        likelier = in_likelier_widths(at_numbers(trial, terms, trial.parameters(q)), terms, self.rules)
        if all(new is old for new, old in zip(likelier, terms)):
            return trial, q, now
        wider, start = trial.in_widths_of(likelier, q)
        reached = lowest(wider, start, self.fit)
        return with_sizes(wider, *reached, self.rules, self.fit) if reached else (trial, q, now)

    def race(self, simulated: Trajectories, proposal: Proposal) -> list[tuple[Trajectories, FloatArray, Normal]]:
        """Return the points that a step reaches from the lowest starts, until some of them agree on the lowest one."""
        found, costs = [], list[float]()
        starts = sorted(self.starts(simulated, proposal), key=lambda start: start[0].cost(start[1]))
        for trial, start in starts[: self.fit.starts]:
            if reached := lowest(trial, start, replace(self.fit, iterations=0)):
                found.append((trial, *reached))
                costs.append(reached[1].cost)
            if sum(cost < min(costs) + self.fit.alike for cost in costs) == self.fit.agreed:
                break
        return found

    def lost(self, trial: Trajectories, q: FloatArray, sure: float = 3.0, times: float = 2.0) -> bool:
        """Whether a force that the equation error is sure of is several times as strong by trajectories, or as weak.

        `sure`: standard deviations by which it differs from zero.
        """
        point = dict(zip(names(trial), trial.parameters(q)))
        for active, stds in zip(trial.first.effects, trial.first.effects_std):
            for (name, value), std in zip(active.values.items(), stds):
                own = point.get((active.key, name), value)
                if active.effect.parameters[name].strength and std > 0.0 and abs(value) > sure * std \
                        and not 1.0 / times < own / value < times:
                    return True
        return False

    def grown(self, simulated: Trajectories) -> list[tuple[Trajectories, FloatArray, Normal]]:
        """Return the point that is reached by way of the first part of all records, and twice as much each time.

        A free motion that slips by a period or more has fits in between that are as near as any around them.
        """
        q, most = simulated.start(), max(len(run.basis) for run in self.found.problem.runs)
        for blocks in (1 << k for k in range(most.bit_length())):
            reached = lowest(simulated.first_blocks(blocks), q, replace(self.fit, iterations=3))
            if reached is None:
                return []
            q = reached[0]
        reached = lowest(simulated, q, replace(self.fit, iterations=0))
        return [(simulated, *reached)] if reached else []

    def simulation(self, candidate: Candidate) -> Trajectories:
        """Return the simulation of a set."""
        return Trajectories(self.found.problem, candidate, self.stated, self.first)

    def starts(self, trial: Trajectories, proposal: Proposal) -> Iterator[tuple[Trajectories, FloatArray]]:
        """Yield the unknowns of the set that it comes from, by linear theory.

        If there is none, those by the equation error, at learned and at stated tolerances and in other shapes, and the
        model as it is given.
        """
        candidate = trial.candidate
        for start in proposal.starts:
            about = trial.about(start.terms)
            yield about, begun(about, start)
        if proposal.starts:
            return
        yield trial, trial.start()
        yield trial, trial.start(trial.parameters(np.zeros(trial.size)))
        if candidate.posterior.sizes.tolerance > 0.0:
            yield self.solved(trial, candidate.terms)
        for term in candidate.terms:
            for other in self.shapes(candidate, term):
                yield self.solved(trial, [other if t is term else t for t in candidate.terms])

    def shapes(self, candidate: Candidate, term: Term) -> list[Term]:
        """Return other shapes of an effect of a set, those that promise most by the equation error."""
        others = [other for other in self.found.terms
                  if other.kind == term.kind and other.active.values != (term.start or term.active).values]
        if len(others) <= self.fit.starts:
            return others
        problem, sizes = self.found.problem, replace(candidate.posterior.sizes, tolerance=0.0)
        columns = problem.with_columns(t.columns for t in candidate.terms if t is not term)
        worth = gains(problem.rows, columns, solve(problem.rows, columns, sizes), [t.columns for t in others])
        return [others[k] for k in np.argsort(-np.nan_to_num(worth, nan=-np.inf))[: self.fit.starts]]

    def solved(self, trial: Trajectories, terms: Sequence[Term]) -> tuple[Trajectories, FloatArray]:
        """Return a simulation about other shapes, and the numbers by the equation error at stated tolerances."""
        sizes = replace(trial.candidate.posterior.sizes, tolerance=0.0)
        found = self.by_equation(terms, sizes, learned=False)
        numbers = from_regression(self.found.problem, found, self.stated)
        start = vector_of((*numbers.nominal, *(numbers.effects[k] for k in trial.kept)))
        return (about := trial.about(found.terms)), about.start(start)

    def next_to(self, weighed: Weighed, known: Mapping[Keys, Candidate]) -> tuple[list[Proposal], list[Proposal]]:
        """Return the sets that differ by one effect and promise most by linear theory, and rivals with as many."""
        candidate = weighed.candidate
        trial = self.simulation(candidate).with_noise(weighed.noise)
        q = begun(trial, Start(candidate.terms, weighed.numbers, weighed.own))
        try:
            near = neighbours(trial, q, self.proposing)
        except (InputError, SolverError, np.linalg.LinAlgError):  # the fit is at the end of what can be simulated
            near = []
        variants: dict[Keys, list[Neighbour]] = {}
        for new in near:
            variants.setdefault(new.keys, []).append(new)
        promising = [some for some in variants.values() if some[0].log_odds >= self.fit.promise][: self.rules.beam]
        rivals = [some for keys, some in variants.items() if len(keys) == len(candidate.keys)][: self.rules.width]

        return ([Proposal(self.candidate(some[0].terms, candidate, known),
                          [self.start(trial, new) for new in some[: self.rules.beam]]) for some in promising],
                [Proposal(self.candidate(some[0].terms, candidate, known)) for some in rivals])

    def start(self, trial: Trajectories, new: Neighbour) -> Start:
        """Return where the fit of a neighbour of a set begins."""
        numbers = dict(zip(names(trial), trial.parameters(new.start).tolist()))
        if new.new is not None:
            values = {**new.new.active.values, **dict(zip(new.new.strengths, new.strengths.tolist()))}
            numbers |= {(new.new.key, n): v for n, v in values.items()}
        return Start(new.terms, numbers, trial.of_records(new.start))

    def by_equation(self, terms: Sequence[Term], sizes: Sizes, learned: bool = True) -> Candidate:
        """Return a set solved by the equation error."""
        return solve_set(self.found.problem, terms, sizes, self.rules, self.proposing.present, learned)

    def candidate(self, terms: Sequence[Term], near: Candidate, known: Mapping[Keys, Candidate]) -> Candidate:
        """Return a set solved by the equation error, as it was found if it was."""
        keys = frozenset(t.key for t in terms)
        return known.get(keys) or self.by_equation(terms, near.posterior.sizes)


def let_go(problem: EquationError) -> bool:
    """Whether all free motions are decays: no force keeps them in phase."""
    return all(run.record.kind == "decay" for run in problem.runs if not run.prescribed)


def names(trial: Trajectories) -> list[Number]:
    """Return whose number each parameter of a simulation is."""
    return [(a.key, name) for a in trial.actives for name in a.effect.parameters]


def at_numbers(trial: Trajectories, terms: Sequence[Term], point: FloatArray) -> list[Term]:
    """Return the terms with their numbers among nominal numbers and effects' parameters."""
    ends = trial.rollout.offsets
    found = {a.key: a.with_values(point[i:j].tolist())
             for a, i, j in zip(trial.actives, ends[:-1], ends[1:])}
    return [replace(term, active=found.get(term.key, term.active)) for term in terms]


def log_within_bounds(trial: Trajectories, q: FloatArray, now: Normal) -> float:
    """Return the log probability that the effects' parameters are within their bounds, over that of the prior."""
    k = np.flatnonzero(~trial.tolerated[: trial.free.size])
    low, high = ((bound[k] - trial.mean[k]) / trial.sd[k] for bound in (trial.lower, trial.upper))
    std = np.sqrt(np.diag(covariance_of(now))[k])
    prior, posterior = norm.cdf(high) - norm.cdf(low), norm.cdf((high - q[k]) / std) - norm.cdf((low - q[k]) / std)
    return float(np.sum(np.log(np.maximum(posterior, 1e-3)) - np.log(np.maximum(prior, 1e-3))))


def begun(trial: Trajectories, start: Start) -> FloatArray:
    """Return the unknowns where a fit begins."""
    q = trial.start(np.array([start.numbers.get(name, value) for name, value in zip(names(trial), trial.base)]))
    return trial.inside(trial.with_records(q, start.own))


def of_second_sensors(problem: EquationError, candidate: Candidate) -> float:
    """Return the log probability of second sensors given the first by the equation error: simulations predict these."""
    second = [place.rows for place in problem.places if place.order >= 0]
    if not second:
        return 0.0
    columns, power = problem.with_columns(t.columns for t in candidate.terms), problem.rows.power.copy()
    for rows in second:
        power[rows] = 0.0
    whole, first = (solve(rows, columns, candidate.posterior.sizes).log_evidence
                    for rows in (problem.rows, replace(problem.rows, power=power)))
    return float(whole - first)


def of_each_record(problem: EquationError, candidate: Candidate) -> float:
    """Return the log evidence of strengths that each record has for itself: simulations take them as they are."""
    total = 0.0
    for term, mine in placed(problem, candidate.terms):
        if term.active.effect.per_record:
            spread, covariance = term.columns.spread, candidate.posterior.covariance[mine, mine]
            total -= 0.5 * float(np.sum((candidate.posterior.mean[mine] / spread) ** 2))
            total += 0.5 * float(np.linalg.slogdet(covariance / np.outer(spread, spread))[1])
    return total
