"""What sets next to one that is fitted by trajectories are worth: one effect more, less, or in another's place.

Forces are taken along the simulated motion, which has no noise, and move the corrected body in linear theory. All that
an effect would change follows from its response by linear algebra; only what promises most has to be simulated.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.candidates import Key, Term, twins
from radiation_ss.inference.effect_features import features_of
from radiation_ss.inference.linear_model import Normal
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.odds import SearchRules, log_prior
from radiation_ss.inference.score import Score, alike, products
from radiation_ss.inference.trajectory import Trajectories
from radiation_ss.inference.trajectory_fit import Added, Theory, numbers_at
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.linear import Kernel, exact_step

LARGEST = 5_000_000  # Numbers of a record's columns that are held at once


@dataclass(frozen=True, eq=False)
class Neighbour:
    """A set next to another one."""

    log_odds: float  # Predicted log probability, less that of the set itself
    terms: tuple[Term, ...]
    start: FloatArray  # Predicted unknowns of the set itself, without those of a new effect
    new: Term | None = None
    strengths: FloatArray = field(default_factory=lambda: np.zeros(0))  # Of the new effect

    @property
    def keys(self) -> frozenset[Key]:
        """The effects."""
        return frozenset(t.key for t in self.terms)


@dataclass(frozen=True, eq=False)
class Proposing:
    """What sets are proposed from: the terms and the log odds asked."""

    terms: Sequence[Term]
    rules: SearchRules
    promise: float
    present: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Base:
    """A set that a term may be put beside: linear theory of it at some tolerances, and the log probability to pass."""

    terms: tuple[Term, ...]
    theories: Sequence[Theory]
    least: float

    def alone(self) -> Neighbour:
        """Return the set as it is."""
        best = max(self.theories, key=lambda theory: theory.evidence)
        return Neighbour(best.evidence - self.least, self.terms, best.scale * best.optimum)

    def beside(self, added: Added, terms: Sequence[Term], q: FloatArray, known: Proposing) -> Iterator[Neighbour]:
        """Yield the sets with one of some terms more that promise what is asked."""
        results = [theory.beside(added, q) for theory in self.theories]
        odds = [log_prior(term, known.rules, known.present) for term in terms]
        value, k = np.array([result[0] for result in results]) + odds - self.least, added.lower.shape[1]
        for j in map(int, np.flatnonzero(value.max(axis=0) >= known.promise)):
            at = int(np.argmax(value[:, j]))
            _, strengths, moved = results[at]
            start = self.theories[at].moved_by(strengths[j], moved[:, j * k:(j + 1) * k])
            yield Neighbour(float(value[at, j]), (*self.terms, terms[j]), start, terms[j],
                            strengths[j] * terms[j].columns.spread[:k])


def neighbours(trial: Trajectories, q: FloatArray, known: Proposing) -> list[Neighbour]:
    """Return the sets next to one that is fitted at q, in each start of a new shape, the most promising first."""
    now, own, rules = trial.at(q), trial.candidate.terms, known.rules
    theories = [Theory.about(trial, q, now, t, rules) for t in sorted({0.0, trial.tolerance})]
    base, at = theories[-1].evidence, places_of_effects(trial)
    less = [Base(tuple(t for t in own if t is not out), [theory.without(at[out.key]) for theory in theories],
                 base + log_prior(out, rules, known.present))
            for out in own if out.key in at and out.active.name not in known.present]
    found = [b.alone() for b in less]
    new = [t for t in known.terms if t.key not in trial.candidate.keys and t.simulated]
    for added in columns(trial, q, now, new):
        some = [new[i] for i in added.score.at]
        for b in [Base(own, theories, base)] * (len(own) < rules.most) + less:
            found += b.beside(added, some, q, known)
    same = twins(known.terms)
    promising = (n for n in found if n.log_odds >= known.promise)
    return sorted((n for n in promising if not any(pair <= {t.kind for t in n.terms} for pair in same)),
                  key=lambda n: -n.log_odds)


def places_of_effects(trial: Trajectories) -> dict[Key, np.ndarray]:
    """Return the positions of each effect's parameters among the unknowns."""
    ends = trial.rollout.offsets
    return {a.key: np.flatnonzero((i <= trial.free) & (trial.free < j))
            for a, i, j in list(zip(trial.actives, ends[:-1], ends[1:]))[len(trial.first.nominal):]}


def columns(trial: Trajectories, q: FloatArray, now: Normal, terms: Sequence[Term]) -> Iterator[Added]:
    """Yield what the terms add to the readings of a fit, those of as many strengths together."""
    symbols = trial.problem.symbols
    runs, kernels = simulated(trial, q), linear_theory(trial, q)
    for some in alike([len(t.strengths) for t in terms], LARGEST // max(run.time.size for run in runs)):
        k = len(terms[some[0]].strengths)
        slope, information = np.zeros(len(some) * k), np.zeros((len(some), k, k))
        cross = np.zeros((q.size, len(some) * k))
        made = [features_of(symbols(terms[i].active), terms[i].active, runs, responses=False) for i in some]
        for r, (kernel, (J, at)) in enumerate(zip(kernels, now.parts)):
            X = np.stack([spread * trial.weighted(r, kernel.respond(feature.force) + feature.reading)
                          for i, of_records in zip(some, made)
                          for feature, spread in zip(next(of_records), terms[i].columns.spread[:k])], axis=1)
            slope += X.T @ now.errors[r]
            information += products(X, X, k)
            cross[at] += J.T @ X
        for given, error, (J, at) in zip(trial.given, now.errors[len(kernels):], now.parts[len(kernels):]):
            X = given.beside([terms[i] for i in some], trial.parameters(q)) / trial.noise[given.noise, None]
            slope += X.T @ error
            information += products(X, X, k)
            cross[at] += J.T @ X
        lower = np.stack([(terms[i].columns.lower / terms[i].columns.spread)[:k] for i in some])
        yield Added(Score(tuple(some), slope.reshape(-1, k), information), cross, lower)


def simulated(trial: Trajectories, q: FloatArray) -> list[MeasuredMotion]:
    """Return the records with the motion that is simulated."""
    model, found = trial.problem.model, []
    m, n = model.fit.states, model.n
    for k, r in enumerate(trial.records):
        run, (grid, motion) = trial.problem.runs[r], trial.motion(k, q)
        assert motion.acceleration is not None
        states = CubicSpline(grid, motion.state)(run.time).T
        a = CubicSpline(grid, motion.acceleration)(run.time).T
        found.append(replace(run, x=states[m:m + n], v=states[m + n:m + 2 * n], a=a, radiation=states[:m],
                             memory=model.fit.c @ states[:m]))
    return found


def linear_theory(trial: Trajectories, q: FloatArray) -> list[Kernel]:
    """Return the displacements of the corrected model by a unit of each force in each record."""
    problem, numbers = trial.problem, numbers_at(trial, q, np.eye(q.size))
    corrected = Corrected({(a.name, a.dof): float(a.vector[0]) for a in numbers.nominal}, numbers.effects,
                          trial.stated, {dof: (s.x, s.omega) for dof, s in problem.scales.items()})
    plant = corrected.to_ss(problem.model)
    A, B, C = (np.asarray(part) for part in (plant.A, plant.B, plant.C))
    runs = [problem.runs[r] for r in trial.records]
    return [Kernel.of(exact_step(A, B, run.dt), C[: problem.model.n], run.time.size) for run in runs]
