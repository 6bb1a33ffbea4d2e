"""What sets next to one that is fitted by trajectories are worth: one effect more, less, or in another's place.

Forces are taken along the simulated motion, which has no noise, and move the corrected body in linear theory. All that
an effect would change follows from its response by linear algebra; only what promises most has to be simulated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.candidates import Key, Term, twins
from radiation_ss.inference.effect_features import Feature, Symbols, features_of
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.search import SearchRules, log_prior
from radiation_ss.inference.trajectory import Normal, Trajectories
from radiation_ss.inference.trajectory_fit import Column, Theory
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.linear import ExactStep, exact_step, propagate
from radiation_ss.simulation.linearised import corrected_plant


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


def neighbours(trial: Trajectories, q: FloatArray, terms: Sequence[Term], symbols: dict[Key, Symbols],
               rules: SearchRules, present: Sequence[str] = ()) -> list[Neighbour]:
    """Return the sets next to one that is fitted at q, in each start of a new shape, the most promising first.

    `symbols` keeps what is made of an effect on its place.
    """
    now, own = trial.at(q), trial.candidate.terms
    theories = [Theory.about(trial, q, now, t, rules) for t in sorted({0.0, trial.tolerance})]
    base, at = theories[-1].evidence, trial.of_effects()
    prior = {t: log_prior(t, rules, present) for t in own if t.key in at and t.active.name not in present}
    kept = {out: [theory.without(at[out.key]) for theory in theories] for out in prior}
    found = []
    for out, reduced in kept.items():
        best = max(reduced, key=lambda theory: theory.evidence)
        found.append(Neighbour(best.evidence - base - prior[out], tuple(t for t in own if t is not out),
                               best.scale * best.optimum))
    same = twins(terms)
    for term, column in columns(trial, q, now, [t for t in terms if t.key not in trial.candidate.keys], symbols):
        for rest, left, odds in [(own, theories, 0.0)] * (len(own) < rules.most) + [
                (tuple(t for t in own if t is not out), kept[out], prior[out]) for out in kept]:
            value, strengths, start = max((theory.beside(column, term, q, rules.sizes.cut) for theory in left),
                                          key=lambda result: result[0])
            new = Neighbour(value - base - odds + log_prior(term, rules, present), (*rest, term), start, term,
                            strengths)
            if not any(pair <= new.keys for pair in same):
                found.append(new)
    return sorted(found, key=lambda n: -n.log_odds)


def columns(trial: Trajectories, q: FloatArray, now: Normal, terms: Sequence[Term],
            symbols: dict[Key, Symbols]) -> Iterator[tuple[Term, Column]]:
    """Yield what each term adds to the readings of a fit."""
    errors, model = trial.errors(q), trial.problem.model
    runs, (steps, where) = simulated(trial, q), linear_theory(trial, q)
    for term in terms:
        if term.active.effect.per_record:
            continue
        made = symbols.setdefault(term.key, Symbols(model, term.active))
        count = term.columns.count
        slope, information, cross = np.zeros(count), np.zeros((count, count)), np.zeros((q.size, count))
        for k, (run, (J, at), features) in enumerate(zip(runs, now.parts, features_of(model, term.active, runs, made))):
            X = np.stack([trial.weighted(k, response(run, f, steps[k], where)) for f in features], axis=1)
            X = X * term.columns.spread
            slope += X.T @ errors[k]
            information += X.T @ X
            cross[at] += J.T @ X
        yield term, Column(slope, information, cross)


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


def linear_theory(trial: Trajectories, q: FloatArray) -> tuple[list[ExactStep], FloatArray]:
    """Return the exact steps of the corrected model in each record, and the rows of its displacements."""
    problem, numbers = trial.problem, trial.estimate(q, np.eye(q.size))
    corrected = Corrected({(a.name, a.dof): float(a.vector[0]) for a in numbers.nominal}, numbers.effects,
                          trial.stated, {dof: (s.x, s.omega) for dof, s in problem.scales.items()})
    plant = corrected_plant(corrected, problem.model)
    steps = [exact_step(np.asarray(plant.A), np.asarray(plant.B), problem.runs[r].dt) for r in trial.records]
    return steps, np.asarray(plant.C)[: problem.model.n]


def response(run: MeasuredMotion, feature: Feature, step: ExactStep, where: FloatArray) -> FloatArray:
    """Return what one strength adds to the readings, shape (n, nt)."""
    moved = propagate(step, feature.force.T, np.zeros(where.shape[1]))
    return np.asarray(where @ moved.T + feature.reading)
