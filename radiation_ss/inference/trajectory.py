"""Refit of a set of effects by simulated trajectories: noisy motion biases the equation error's strengths low."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Slab, slab, vector_of
from radiation_ss.effects.nominal import simulated_numbers
from radiation_ss.errors import SolverError
from radiation_ss.inference.candidates import Candidate, FittedSet, from_regression, own_force, scales_at
from radiation_ss.inference.equation import left_out, weights_of_motion
from radiation_ss.inference.linear_model import joined
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import Place
from radiation_ss.simulation.prepared import Channel, Prepared, prepare
from radiation_ss.simulation.rollout import Rollout, reading
from radiation_ss.simulation.run import alike
from radiation_ss.simulation.start import start_of, step_size


@dataclass(frozen=True)
class FitRules:
    """What stops a trajectory fit."""

    iterations: int = 12  # How often derivatives are taken at most
    gain: float = 1e-3  # Relative decrease of the cost below which it stops
    kept: float = 0.1  # Relative decrease of the cost above which derivatives serve for another step


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of a least-squares fit: cost, information and right side, and what they are made of.

    Of each record: weighted derivatives (rows, some unknowns) and these unknowns' positions.
    """

    cost: float
    information: FloatArray
    slope: FloatArray
    parts: list[tuple[FloatArray, np.ndarray]]


class Trajectories:
    """Simulated readings of all records as a function of standardised unknowns.

    Effects with numbers of each record's own (slow forces) act as the equation error found them.
    Where the records show radiation that its fit leaves out, strengths stay those of the equation error, which has it.

    Parameters
    ----------
    problem : EquationError
    candidate : Candidate
    tolerance : mapping of str to float
    zero : float
        Prior standard deviation of a sensor's zero, of the motion's.
    rough : float
        Derivatives are taken in the longest steps that leave this share of the motion: their error shifts the numbers
        by about as small a share of their own standard deviations, at a cost that falls with the number of steps.

    The unknowns are nominal numbers and effects' parameters, then of each record its start, errors of its readings and
    of its force.
    """

    def __init__(self, problem: EquationError, candidate: Candidate, tolerance: dict[str, float],
                 zero: float = 0.05, rough: float = 1e-2) -> None:
        self.problem, self.candidate = problem, candidate
        first = self.first = from_regression(problem, candidate, tolerance)
        scale = float(np.exp(candidate.posterior.sizes.tolerance))
        own = simulated_numbers(problem.model, tolerance, force=problem.forced)
        self.kept = [k for k, term in enumerate(candidate.terms) if not term.active.effect.per_record]
        terms, effects = [candidate.terms[k] for k in self.kept], [first.effects[k] for k in self.kept]
        self.actives = (*first.nominal, *effects)
        self.records = [r for r, run in enumerate(problem.runs) if run.force is not None and not run.prescribed]
        halvings = max((a.effect.halvings for a in effects), default=0)
        h, least = (step_size(problem.model, [problem.runs[r].record for r in self.records], actives) / 2**halvings
                    for actives in ((), effects))
        self.base = vector_of(self.actives)
        coarse = 0.0
        while h > 2.0 * least and not self._followed(h, 1e-3):
            coarse = coarse or h * self._followed(h, rough)
            h *= 0.5
        coarse, h = coarse or h, max(0.5 * h, least)
        self.rollout, self.rough = (Rollout(problem.model, self.actives, step) for step in (h, coarse))
        slabs: list[Slab | None] = [Slab((0.0,), o.spread * scale, -np.inf, np.inf) for o in own]
        more = left_out(problem, candidate.posterior)  # a force that no simulation has
        slabs += [None if p.fixed or (more and p.strength) else slab(a.effect, name, scales_at(problem, a.dof, a.other))
                  for a in (term.active for term in terms) for name, p in a.effect.parameters.items()]
        self.free = np.array([k for k, s in enumerate(slabs) if s is not None and s.sd > 0.0], dtype=int)
        self.sd, self.lower, self.upper = (np.array([getattr(slabs[k], bound) for k in self.free], dtype=float)
                                           for bound in ("sd", "lower", "upper"))
        strengths = [p.strength for term in terms for p in term.active.effect.parameters.values()]
        strength = np.array([True] * len(own) + strengths, dtype=bool)[self.free]
        starts = [term.start or term.active for term in terms]
        self.mean = np.where(strength, 0.0, vector_of((*first.nominal, *starts))[self.free])
        self.prepared = [self._prepared(r, h) for r in self.records]
        self.coarse = self.prepared if coarse == h else [replace(p, grid=np.arange(
            p.grid[0], p.grid[-1] + 1.5 * coarse, coarse)) for p in self.prepared]
        self.starts = [start_of(problem.model, p, self.rollout.ns) for p in self.prepared]
        # Of many long records the force itself is large.
        self.prepared, self.coarse = ([p.settled() for p in some] for some in (self.prepared, self.coarse))
        self.added = [self._reading_errors(problem.runs[r], p, zero) for r, p in zip(self.records, self.prepared)]
        self.forces = np.array([k for k, o in enumerate(own) if o.active.name.startswith("nominal_force")], dtype=int)
        self.forces_sd = np.array([problem.discrepancy.by_record * own[k].spread * scale for k in self.forces])
        counts = [s.shape[1] + len(a) + self.forces.size for s, a in zip(self.starts, self.added)]
        self.offsets = np.cumsum([self.free.size, *counts])
        self.size = int(self.offsets[-1])
        columns = joined([problem.base, *(term.columns for term in candidate.terms)])
        self.weights = weights_of_motion(problem, columns, candidate.posterior)

    def _followed(self, h: float, share: float) -> bool:
        """Whether steps of h leave the motion that begins as measured as in steps of half their length, to a share."""
        paths = []
        for rollout in (Rollout(self.problem.model, self.actives, step) for step in (h, 0.5 * h)):
            path = []
            for r in self.records:
                prepared = self._prepared(r, rollout.h)
                drive, state = rollout.drive(prepared, self.base), self._begun(rollout, r)
                try:
                    path.append(rollout.run(state, drive, prepared.grid, self.base, acceleration=False))
                except SolverError:
                    return False
            paths.append(path)
        return all(alike(coarse, fine, self.problem.model, share) for coarse, fine in zip(*paths))

    def _begun(self, rollout: Rollout, r: int) -> FloatArray:
        """Return the state in which a record begins by its measured motion."""
        m, n, run = self.problem.model.fit.states, self.problem.model.n, self.problem.runs[r]
        state = np.zeros(rollout.ns)
        state[m:m + n], state[m + n:m + 2 * n] = run.x[:, 0], run.v[:, 0]
        return state

    def _prepared(self, r: int, h: float) -> Prepared:
        run, slow = self.problem.runs[r], own_force(self.problem, self.candidate, r)
        channels = tuple(Channel(int(i), "displacement", run.time, run.raw[i], under_way=run.record.kind != "decay")
                         for i in np.flatnonzero(run.free))
        found = replace(prepare(self.problem.model, run.record, h), channels=channels)
        if found.force is None or not slow.any():
            return found
        both = [(f.x if f.x.size > run.time.size else run.time, f, row) for f, row in zip(found.force, slow)]
        return replace(found, force=tuple(CubicSpline(t, f(t) + np.interp(t, run.time, row)) for t, f, row in both))

    def _reading_errors(self, run: MeasuredMotion, prepared: Prepared, zero: float) -> list[FloatArray]:
        """Return errors of the readings, one standard deviation each, of shape (channels, nt): zeros, slow motions."""
        flat = np.array([zero * np.std(c.value) for c in prepared.channels])
        zeros = [np.broadcast_to(np.where(np.arange(flat.size) == c, flat, 0.0)[:, None], (flat.size, run.time.size))
                 for c in range(flat.size)]
        return [*zeros, *run.lost[:, [c.dof for c in prepared.channels]]]

    def parameters(self, q: FloatArray) -> FloatArray:
        """Return all parameters in their own units."""
        p = self.base.copy()
        p[self.free] = self.mean + self.sd * q[: self.free.size]
        return p

    def start(self) -> FloatArray:
        """Return the unknowns of the equation error's numbers, starts at the measured motion."""
        q = np.r_[(self.base[self.free] - self.mean) / self.sd, np.zeros(self.size - self.free.size)]
        for k, (r, basis) in enumerate(zip(self.records, self.starts)):
            state = self._begun(self.rollout, r)
            q[self.offsets[k]:self.offsets[k] + basis.shape[1]] = np.linalg.lstsq(basis, state, rcond=None)[0]
        return self.inside(q)

    def inside(self, q: FloatArray) -> FloatArray:
        """Return the unknowns with every parameter within its physical bounds."""
        found = q.copy()
        count = self.free.size
        found[:count] = (np.clip(self.mean + self.sd * q[:count], self.lower, self.upper) - self.mean) / self.sd
        return found

    def near(self, q: FloatArray, known: Normal) -> Normal:
        """Return the normal equations with the derivatives of another point: the cost (the prior's among it) is exact.

        Raises
        ------
        SolverError
            If the motion grows without bounds.
        """
        errors = [self._record(k, q, slopes=False)[0] for k in range(len(self.records))]
        return self._normal(q, errors, known.parts, known.information)

    def at(self, q: FloatArray) -> Normal:
        """Return the normal equations; SolverError if the motion grows without bounds."""
        errors, parts, information = [], [], np.eye(self.size)
        for k in range(len(self.records)):
            error, rows, at = self._record(k, q, slopes=True)
            errors.append(error)
            parts.append((rows, at))
            information[np.ix_(at, at)] += rows.T @ rows
        return self._normal(q, errors, parts, information)

    def _normal(self, q: FloatArray, errors: list[FloatArray], parts: list[tuple[FloatArray, np.ndarray]],
                information: FloatArray) -> Normal:
        slope = -q
        for error, (rows, at) in zip(errors, parts):
            slope[at] += rows.T @ error
        return Normal(float(q @ q) + sum(float(error @ error) for error in errors), information, slope, parts)

    def _record(self, k: int, q: FloatArray, slopes: bool) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Return weighted errors and their derivatives (of no rows without `slopes`) by some unknowns, and which."""
        count, r, prepared, basis = self.free.size, self.records[k], self.prepared[k], self.starts[k]
        own = slice(self.offsets[k], self.offsets[k] + basis.shape[1])
        errors = slice(own.stop, own.stop + len(self.added[k]))
        forces = slice(errors.stop, errors.stop + self.forces.size)
        into = np.zeros((self.rollout.np, count + basis.shape[1] + self.forces.size))
        into[self.free, np.arange(count)] = self.sd
        into[self.forces, count + basis.shape[1] + np.arange(self.forces.size)] = self.forces_sd
        begin = np.zeros((self.rollout.ns, into.shape[1]))
        begin[:, count:count + basis.shape[1]] = basis
        p = self.parameters(q)
        p[self.forces] += self.forces_sd * q[forces]
        drive = self.rollout.drive(prepared, p)
        motion = self.rollout.run(basis @ q[own], drive, prepared.grid, p, acceleration=False)
        if slopes:
            coarse = self.coarse[k]
            turning = self.rough.run(basis @ q[own], self.rough.drive(coarse, p), coarse.grid, p, columns=into,
                                     d_start=begin, acceleration=False)
        found = []
        for c, channel in enumerate(prepared.channels):
            value, _ = reading(self.rollout, motion, prepared.grid, channel, p)
            slope = reading(self.rough, turning, coarse.grid, channel, p, into)[1] if slopes else None
            place = next(x for x in self.problem.places if (x.record, x.dof, x.order) == (r, channel.dof, -1))
            weight = self.weights[place]
            added = np.array([series[c] for series in self.added[k]])
            error = weight * self._project(r, place, (channel.value - value - q[errors] @ added)[None])[0]
            changes = np.zeros((0, value.size)) if slope is None else np.concatenate([slope.T, added])
            found.append((error, weight[:, None] * self._project(r, place, changes).T))
        weighted, derivatives = (np.concatenate(part) for part in zip(*found))
        return weighted, derivatives, np.r_[0:count, own, forces, errors]

    def _project(self, r: int, place: Place, values: FloatArray) -> FloatArray:
        return projected_on(self.problem.runs[r].basis, values, bins=place.bins).reshape(
            len(values), place.rows.stop - place.rows.start)

    def estimate(self, q: FloatArray, covariance: FloatArray) -> FittedSet:
        """Return the numbers at a point."""
        p, std = self.parameters(q), np.zeros(self.base.size)
        std[self.free] = self.sd * np.sqrt(np.diag(covariance)[: self.free.size])
        ends = np.cumsum([0] + [len(a.effect.parameters) for a in self.actives])
        actives = [a.with_values(p[i:j].tolist()) for a, i, j in zip(self.actives, ends[:-1], ends[1:])]
        spreads = [tuple(std[i:j].tolist()) for i, j in pairwise(ends)]
        own, effects, stds = len(self.first.nominal), list(self.first.effects), list(self.first.effects_std)
        for k, active, own_std in zip(self.kept, actives[own:], spreads[own:]):
            effects[k], stds[k] = active, own_std
        return FittedSet(tuple(actives[:own]), tuple(effects), tuple(s[0] for s in spreads[:own]), tuple(stds))


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
    try:
        q, damping = trial.start(), 1.0
        now = trial.at(q)
        for _ in range(rules.iterations):
            before, (q, now, damping) = now.cost, better(trial, q, now, damping)
            if before - now.cost < rules.gain * now.cost:
                break
            while before - now.cost > rules.kept * now.cost:
                before, (q, now, _) = now.cost, better(trial, q, now, damping, tries=1)
            now = trial.at(q)
        return trial.estimate(q, np.asarray(np.linalg.inv(now.information), dtype=np.float64))
    except (SolverError, np.linalg.LinAlgError):
        return fallback


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
