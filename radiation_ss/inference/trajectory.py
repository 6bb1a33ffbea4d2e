"""Simulated readings of records with a set of effects: noisy motion biases the equation error's strengths low."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Slab, vector_of
from radiation_ss.effects.nominal import simulated_numbers
from radiation_ss.effects.slabs import slab
from radiation_ss.errors import SolverError
from radiation_ss.inference.candidates import (
    Candidate,
    Key,
    Term,
    from_regression,
    scales_at,
    unseen_strengths,
)
from radiation_ss.inference.given_motion import GivenMotion
from radiation_ss.inference.linear_model import Normal
from radiation_ss.inference.motion_rows import weights_of_motion
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import Place
from radiation_ss.inference.simulated import SimulatedRecords, begun, blocks_of, on_rows
from radiation_ss.simulation.rollout import Motion, reading


def cost_of(q: FloatArray, errors: list[FloatArray]) -> float:
    """Return the sum of squares of the unknowns and of the weighted errors."""
    return float(q @ q) + sum(float(error @ error) for error in errors)


class Trajectories:
    """Simulated readings of all records as a function of standardised unknowns.

    Effects with numbers of each record's own (slow forces) act as the equation error found them, and so do those of
    second sensors, which are not simulated. The unknowns are nominal numbers and effects' parameters, then of each
    record its start, errors of its readings and of its force. Records whose motion is given stand behind the others,
    by the rows of their equation. `like`: of another set, whose weights and errors of
    readings and forces are taken: sets are compared with the same ones. `unexplained`: whether forces that no effect
    explains move the body, too: numbers are those that predict without them. `zero`: prior standard deviation of a
    sensor's zero, of the motion's. `rough`: derivatives are taken in the longest steps that leave this share of the
    motion: their error shifts the numbers by about as small a share of their own standard deviations, at a cost that
    falls with the number of steps. `told`: information on an unknown, in units of its prior, below which a record
    tells nothing of it. InputError if effects set in so sharply that too many steps are needed.
    """

    given: list[GivenMotion]

    def __init__(self, problem: EquationError, candidate: Candidate, tolerance: dict[str, float],
                 like: Trajectories | None = None, unexplained: bool = False,
                 zero: float = 0.05, rough: float = 1e-2, told: float = 1e-5) -> None:
        self.problem, self.candidate, self.stated = problem, candidate, tolerance
        first = self.first = from_regression(problem, candidate, tolerance)
        self.tolerance = candidate.posterior.sizes.tolerance
        scale = float(np.exp(self.tolerance))
        own = simulated_numbers(problem.model, tolerance, force=problem.forced)
        self.kept = [k for k, term in enumerate(candidate.terms) if term.simulated]
        terms, effects = [candidate.terms[k] for k in self.kept], [first.effects[k] for k in self.kept]
        self.actives = (*first.nominal, *effects)
        self.records = [r for r, run in enumerate(problem.runs) if run.driven]
        self.base = vector_of(self.actives)
        simulated = SimulatedRecords(problem, candidate, self.actives, effects, self.records)
        h, coarse = simulated.steps(rough)
        made = {step: simulated.rollout(step) for step in {h, *coarse}}
        self.rollout, self.rough = made[h], [made[step] for step in coarse]
        slabs: list[Slab | None] = [Slab((0.0,), o.spread * scale, -np.inf, np.inf) for o in own]
        slabs += [None if p.fixed or name in unseen else slab(a.effect, name, scales_at(problem, a.dof, a.other))
                  for a, unseen in ((term.active, unseen_strengths(problem, term)) for term in terms)
                  for name, p in a.effect.parameters.items()]
        self.free = np.array([k for k, s in enumerate(slabs) if s is not None and s.sd > 0.0], dtype=int)
        self.sd, self.lower, self.upper = (np.array([getattr(slabs[k], bound) for k in self.free], dtype=float)
                                           for bound in ("sd", "lower", "upper"))
        strengths = [p.strength for term in terms for p in term.active.effect.parameters.values()]
        self.strength = np.array([True] * len(own) + strengths, dtype=bool)[self.free]
        self.sd *= self._widths(candidate)
        self.mean = self._middle(candidate)
        self.prepared = [simulated.prepared(r, h) for r in self.records]
        self.coarse = [p if step == h else replace(p, grid=np.arange(p.grid[0], p.grid[-1] + 1.5 * step, step))
                       for p, step in zip(self.prepared, coarse)]
        begins = [simulated.begins(r, self.rollout, p) for r, p in zip(self.records, self.prepared)]
        self.starts = [np.hstack(list(parts.values())) for parts in begins]
        # Of many long records the force itself is large.
        self.prepared, self.coarse = ([p.settled() for p in some] for some in (self.prepared, self.coarse))
        self.places = simulated.places
        self.added: list[list[FloatArray]] = like.added if like else [
            simulated.errors(r, p, zero, np.concatenate([simulated.moved(r, unexplained),
                                                         simulated.moved_by_waves(r, scale * tolerance["force"])]))
            for r, p in zip(self.records, self.prepared)]
        self.forces = np.array([k for k, o in enumerate(own) if o.active.name.startswith("nominal_force")], dtype=int)
        self.forces_sd = np.array([problem.discrepancy.by_record * own[k].spread * scale for k in self.forces])
        given = [r for r, run in enumerate(problem.runs) if run.prescribed]
        known: Sequence[GivenMotion | None] = like.given if like else [None] * len(given)
        self.given = [GivenMotion(problem, candidate, self.actives, r, self.tolerance, k) for r, k in zip(given, known)]
        counts = [s.shape[1] + a[0].shape[1] + self.forces.size for s, a in zip(self.starts, self.added)]
        counts += [given.own.shape[1] for given in self.given]
        self.offsets = np.cumsum([self.free.size, *counts])
        # Of each record where its start's parts and its errors stand
        self.blocks = [blocks_of(parts, first, last)
                       for parts, first, last in zip([*begins, *({} for _ in self.given)],
                                                     self.offsets[:-1], self.offsets[1:])]
        self.size = int(self.offsets[-1])
        # The unknowns whose prior is a tolerance
        self.tolerated = np.concatenate([
            self.free < len(own), *(np.arange(k) >= k - self.forces.size for k in counts[: len(self.records)]),
            *(given.tolerated for given in self.given)])
        columns = problem.with_columns(term.columns for term in candidate.terms)
        self.weights: dict[Place, FloatArray] = (
            like.weights if like else weights_of_motion(problem, columns, candidate.posterior))
        # What the errors' standard deviations are multiplied by, of simulated motions and then of given ones
        self.noise = np.ones(2 * problem.model.n)
        self.told, self.telling = told, dict[int, np.ndarray]()  # of each record the unknowns that it tells, once known

    def _middle(self, candidate: Candidate) -> FloatArray:
        """Return the middle of the prior of each free parameter: of a strength 0, of a shape its start."""
        starts = [term.start or term.active for term in candidate.terms if term.simulated]
        return np.where(self.strength, 0.0, vector_of((*self.first.nominal, *starts))[self.free])

    def _widths(self, candidate: Candidate) -> FloatArray:
        """Return what multiplies the prior standard deviation of each free parameter by the widths of a candidate."""
        widths = [term.width for term in candidate.terms if term.simulated]
        own = len(self.first.nominal)
        sizes = [len(a.effect.parameters) for a in self.actives[own:]]
        return np.where(self.strength, np.r_[np.ones(own), np.repeat(widths, sizes)][self.free], 1.0)

    def changed(self, **attributes: Any) -> Trajectories:
        """Return the same simulation with other attributes."""
        found = copy(self)
        vars(found).update(attributes)
        return found

    def about(self, terms: Sequence[Term]) -> Trajectories:
        """Return the same simulation with the shapes' priors about the starts of the same effects' other terms."""
        others = {term.key: term for term in terms}
        own = tuple(others[t.key].widened(t.width) for t in self.candidate.terms)
        candidate = replace(self.candidate, terms=own)
        return self.changed(candidate=candidate, mean=self._middle(candidate))

    def in_widths_of(self, terms: Sequence[Term], q: FloatArray) -> tuple[Trajectories, FloatArray]:
        """Return the same simulation with the strengths' priors as wide as those of terms, and the unknowns of q."""
        candidate, point = replace(self.candidate, terms=tuple(terms)), q.copy()
        wider = self._widths(candidate) / self._widths(self.candidate)
        point[: wider.size] = q[: wider.size] / wider
        return self.changed(candidate=candidate, sd=wider * self.sd), point

    def in_units_of(self, tolerance: float) -> FloatArray:
        """Return the unknowns that are one of those with another log of the common factor of the tolerances."""
        return np.where(self.tolerated, np.exp(tolerance - self.tolerance), 1.0)

    def tolerating(self, tolerance: float) -> Trajectories:
        """Return the same simulation with another log of the common factor of the tolerances."""
        return self.changed(tolerance=tolerance, sd=self.in_units_of(tolerance)[: self.free.size] * self.sd,
                            forces_sd=float(np.exp(tolerance - self.tolerance)) * self.forces_sd,
                            given=[given.tolerating(tolerance) for given in self.given])

    def with_noise(self, noise: FloatArray) -> Trajectories:
        """Return the same simulation with the errors' standard deviations multiplied by factors (2 n,), see `noise`."""
        return self.changed(noise=noise)

    def first_blocks(self, count: int) -> Trajectories:
        """Return the same simulation with errors in the first blocks of each record alone, `count` of them."""
        weights = {place: np.where(np.arange(w.size) < count * place.bins, w, 0.0) for place, w in self.weights.items()}
        return self.changed(weights=weights, telling={})

    def parameters(self, q: FloatArray) -> FloatArray:
        """Return all parameters in their own units."""
        p = self.base.copy()
        p[self.free] = self.mean + self.sd * q[: self.free.size]
        return p

    def of_records(self, q: FloatArray) -> list[dict[Key | str, FloatArray]]:
        """Return the unknowns of each record by what they are of: of the motion's start, effects' starts, errors."""
        return [{part: q[at] for part, at in blocks.items()} for blocks in self.blocks]

    def with_records(self, q: FloatArray, own: Sequence[Mapping[Key | str, FloatArray]]) -> FloatArray:
        """Return the unknowns with those of each record as in another set, where both have them."""
        found = q.copy()
        for blocks, known in zip(self.blocks, own):
            for part in blocks.keys() & known.keys():
                if known[part].size == q[blocks[part]].size:
                    found[blocks[part]] = known[part]
        return found

    def start(self, vector: FloatArray | None = None) -> FloatArray:
        """Return the unknowns of some numbers, by default the equation error's, starts at the measured motion."""
        p = self.base if vector is None else vector
        q = np.r_[(p[self.free] - self.mean) / self.sd, np.zeros(self.size - self.free.size)]
        for k, (r, basis) in enumerate(zip(self.records, self.starts)):
            state = begun(self.problem, self.rollout, r)
            q[self.offsets[k]:self.offsets[k] + basis.shape[1]] = np.linalg.lstsq(basis, state, rcond=None)[0]
        return self.inside(q)

    def inside(self, q: FloatArray) -> FloatArray:
        """Return the unknowns with every parameter within its physical bounds."""
        found = q.copy()
        count = self.free.size
        found[:count] = (np.clip(self.mean + self.sd * q[:count], self.lower, self.upper) - self.mean) / self.sd
        return found

    def held(self, q: FloatArray) -> Trajectories:
        """Return the same simulation with nominal numbers and effects' parameters held as they are in q."""
        at = self.parameters(q)[self.free]
        return self.changed(lower=at, upper=at)

    def near(self, q: FloatArray, known: Normal) -> Normal:
        """Return the normal equations with the derivatives of another point: the cost (the prior's among it) is exact.

        SolverError if the motion grows without bounds.
        """
        return self._normal(q, self.errors(q), known.parts, known.information)

    def cost(self, q: FloatArray) -> float:
        """Return the cost, the prior's among it; infinite where the motion grows without bounds."""
        try:
            return cost_of(q, self.errors(q))
        except SolverError:
            return np.inf

    def weighted(self, k: int, readings: FloatArray) -> FloatArray:
        """Return the rows of what is read in a record, (n, nt), as errors are weighted."""
        return np.concatenate([weight * on_rows(self.problem, place, readings[place.dof][None])[0]
                               for place, weight in self._placed(k)])

    def motion(self, k: int, q: FloatArray) -> tuple[FloatArray, Motion]:
        """Return the times of a record's simulation, and its motion."""
        prepared, p = self.prepared[k], self._own_parameters(k, q)
        drive = self.rollout.drive(prepared, p)
        return prepared.grid, self.rollout.run(self.starts[k] @ q[self._parts(k)[0]], drive, prepared.grid, p)

    def at(self, q: FloatArray, known: list[FloatArray] | None = None) -> Normal:
        """Return the normal equations, of known errors where they are given.

        SolverError if the motion, or its derivatives, grow without bounds.
        """
        errors, parts, information = known or self.errors(q), [], np.eye(self.size)
        for k in range(len(self.records)):
            rows, at = self.derivatives(k, q)
            parts.append((rows, at))
        parts += [self._given_derivatives(k, q) for k in range(len(self.given))]
        for rows, at in parts:
            information[np.ix_(at, at)] += rows.T @ rows
        if not np.isfinite(information).all():
            raise SolverError("the derivatives of the motion grow without bounds")
        return self._normal(q, errors, parts, information)

    def _normal(self, q: FloatArray, errors: list[FloatArray], parts: list[tuple[FloatArray, np.ndarray]],
                information: FloatArray) -> Normal:
        slope = -q
        for error, (rows, at) in zip(errors, parts):
            slope[at] += rows.T @ error
        return Normal(cost_of(q, errors), information, slope, errors, parts)

    def errors(self, q: FloatArray) -> list[FloatArray]:
        """Return the weighted errors of each record."""
        found = []
        for k, (prepared, added) in enumerate(zip(self.prepared, self.added)):
            own, errors, _ = self._parts(k)
            p = self._own_parameters(k, q)
            motion = self.rollout.run(self.starts[k] @ q[own], self.rollout.drive(prepared, p), prepared.grid, p,
                                      acceleration=False)
            missed = [c.value - reading(self.rollout, motion, prepared.grid, c, p)[0] for c in prepared.channels]
            found.append(np.concatenate([weight * (on_rows(self.problem, place, miss[None])[0] - by @ q[errors])
                                         for (place, weight), miss, by in zip(self._placed(k), missed, added)]))
        p = self.parameters(q) if self.given else self.base
        return found + [given.errors(p, q[self._own_of(k)]) / self.noise[given.noise]
                        for k, given in enumerate(self.given)]

    def derivatives(self, k: int, q: FloatArray) -> tuple[FloatArray, np.ndarray]:
        """Return the derivatives of a record's weighted errors, less their sign, by some unknowns, and which."""
        count, basis, prepared, rollout = self.free.size, self.starts[k], self.coarse[k], self.rough[k]
        own, errors, forces = self._parts(k)
        into = np.zeros((rollout.np, count + basis.shape[1] + self.forces.size))
        into[self.free, np.arange(count)] = self.sd
        into[self.forces, count + basis.shape[1] + np.arange(self.forces.size)] = self.forces_sd
        begin = np.zeros((rollout.ns, into.shape[1]))
        begin[:, count:count + basis.shape[1]] = basis
        telling = self.telling.get(k, np.arange(into.shape[1]))
        into, begin, at = into[:, telling], begin[:, telling], np.r_[0:count, own, forces][telling]
        p = self._own_parameters(k, q)
        motion = rollout.run(basis @ q[own], rollout.drive(prepared, p), prepared.grid, p, columns=into, d_start=begin,
                             acceleration=False)
        found = []
        for channel, (place, weight), added in zip(prepared.channels, self._placed(k), self.added[k]):
            _, slope = reading(rollout, motion, prepared.grid, channel, p, into)
            assert slope is not None
            moved = np.hstack([on_rows(self.problem, place, slope.T).T, added])
            found.append(weight[:, None] * moved)
        derivatives = np.concatenate(found)
        if k not in self.telling:
            known = np.sum(derivatives[:, :at.size] ** 2, axis=0) > self.told
            kept = np.r_[known, np.ones(derivatives.shape[1] - at.size, dtype=bool)]
            self.telling[k], derivatives, at = np.flatnonzero(known), derivatives[:, kept], at[known]
        return derivatives, np.r_[at, errors]

    def _given_derivatives(self, k: int, q: FloatArray) -> tuple[FloatArray, np.ndarray]:
        """Return the same as `derivatives` of a record whose motion is given."""
        given, own = self.given[k], self._own_of(k)
        rows = np.hstack([given.derivatives(self.parameters(q), self.free, self.sd), given.added])
        return rows / self.noise[given.noise, None], np.r_[0:self.free.size, own]

    def _own_of(self, k: int) -> slice:
        """Return where the own unknowns of a record stand whose motion is given."""
        first = len(self.records) + k
        return slice(self.offsets[first], self.offsets[first + 1])

    def _parts(self, k: int) -> tuple[slice, slice, slice]:
        """Return where the unknowns of a record stand: its start, errors of its readings, and of its force."""
        start = self.offsets[k] + self.starts[k].shape[1]
        force = self.offsets[k + 1] - self.forces.size
        return slice(self.offsets[k], start), slice(start, force), slice(force, self.offsets[k + 1])

    def _own_parameters(self, k: int, q: FloatArray) -> FloatArray:
        """Return all parameters as a record has them."""
        p = self.parameters(q)
        p[self.forces] += self.forces_sd * q[self._parts(k)[2]]
        return p

    def counted(self) -> Iterator[tuple[np.ndarray, FloatArray]]:
        """Yield of each record the factor of the errors that each row has, and the power of its likelihood."""
        for k, prepared in enumerate(self.prepared):
            places = [self.places[self.records[k], c.dof] for c in prepared.channels]
            yield (np.repeat([p.dof for p in places], [p.rows.stop - p.rows.start for p in places]),
                   np.concatenate([self.problem.rows.power[p.rows] for p in places]))
        for given in self.given:
            yield given.noise, given.power

    def _placed(self, k: int) -> list[tuple[Place, FloatArray]]:
        """Return the rows of each channel of a record, and their weights."""
        places = [self.places[self.records[k], channel.dof] for channel in self.prepared[k].channels]
        return [(place, self.weights[place] / self.noise[place.dof]) for place in places]
