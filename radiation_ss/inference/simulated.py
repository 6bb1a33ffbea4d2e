"""Records made ready for a simulation with a set of effects: its steps, its forces, and the forces that it lacks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Active, vector_of
from radiation_ss.errors import InputError, SolverError
from radiation_ss.inference.candidates import Candidate, Key, placed
from radiation_ss.inference.effect_features import features
from radiation_ss.inference.equation import LEFT_OUT, radiation_left_out, unexplained_forces
from radiation_ss.inference.force_errors import noise_at_resonance, shape_errors
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion_rows import changes_of_impedance, stiffened
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import Place
from radiation_ss.records.record import Record
from radiation_ss.simulation.linear import exact_step, propagate
from radiation_ss.simulation.prepared import Channel, Prepared, prepare
from radiation_ss.simulation.rollout import Motion, Rollout, TooManySteps
from radiation_ss.simulation.start import start_of, step_size, unrest_of


@dataclass(frozen=True, eq=False)
class SimulatedRecords:
    """Some records as effects make them move; those with numbers of each record's own act as the regression has them.

    `actives`: all that is simulated, the model's own numbers and `effects`. `records`: positions. `most`: number of
    steps into which those of the records may be split.
    """

    problem: EquationError
    candidate: Candidate
    actives: Sequence[Active]
    effects: Sequence[Active]
    records: Sequence[int]
    most: int = 500_000

    @cached_property
    def places(self) -> dict[tuple[int, int], Place]:
        """The rows of each record's motions."""
        return {(p.record, p.dof): p for p in self.problem.places if p.order < 0}

    def steps(self, rough: float) -> tuple[float, list[float]]:
        """Return the integrator's step [s], half the longest that the model allows, and each record's for derivatives.

        See `Trajectories`. InputError if the effects set in so sharply that steps are split into too many.
        """
        runs = [self.problem.runs[r] for r in self.records]
        h = max(0.5 * self.allowed([run.record for run in runs], ()), self.least)
        if sum(float(np.ptp(run.time)) for run in runs) > self.most * self.least \
                and self.split(h) > self.most:
            raise InputError(f"effects: their forces set in so sharply that more than {self.most} steps are needed")
        return h, [self.longest(r, h, rough) for r in self.records]

    def split(self, h: float) -> int:
        """Return into how many parts steps of h [s] are split; 0 where the motion grows: fits do not end there."""
        try:
            return sum(len(self.path(r, h, vector_of(self.actives))[1]) for r in self.records)
        except TooManySteps:
            return self.most + 1
        except SolverError:
            return 0

    def allowed(self, records: Sequence[Record], effects: Sequence[Active]) -> float:
        """Return the step [s] that effects ask for in some records."""
        halvings = max((a.effect.halvings for a in self.effects), default=0)
        return step_size(self.problem.model, records, effects) / 2**halvings

    @cached_property
    def least(self) -> float:
        """The shortest step [s] that the effects ask for."""
        return self.allowed([self.problem.runs[r].record for r in self.records], self.effects)

    def rollout(self, h: float) -> Rollout:
        """Return the integrator in steps of h [s], split down to the shortest where effects set in."""
        halvings = int(np.ceil(np.log2(max(h / self.least, 1.0))))
        return Rollout(self.problem.model, self.actives, h, halvings, most=self.most)

    def longest(self, r: int, h: float, share: float) -> float:
        """Return the longest step [s] for derivatives in a record: h, doubled while its force and motion allow it.

        Effects allow what they ask for by their rates, and the force what the model itself follows.
        """
        model, record = self.problem.model, self.problem.runs[r].record
        unforced = replace(record, channels={d: record.channels[d] for d in model.dofs if d in record.channels})
        most = self.allowed([unforced], self.effects)
        while 2.0 * h <= most and self.followed(r, 2.0 * h, share):
            h *= 2.0
        return h

    def followed(self, r: int, h: float, share: float) -> bool:
        """Whether steps of h leave a record's motion without effects as steps of half their length do, to a share."""
        try:
            coarse, fine = (self.path(r, step, 0.0 * vector_of(self.actives))[0] for step in (h, 0.5 * h))
        except SolverError:
            return False
        moved = slice(self.problem.model.fit.states, self.problem.model.fit.states + self.problem.model.n)
        one, other = coarse.state[:, moved], fine.state[::2, moved]
        count = min(len(one), len(other))
        error = np.mean((one[:count] - other[:count]) ** 2, axis=0)
        return bool(np.all(error <= share**2 * np.mean(other**2, axis=0)))

    def path(self, r: int, h: float, p: FloatArray) -> tuple[Motion, np.ndarray]:
        """Return a record's motion that begins as measured, in steps of h [s], and the parts into which these split."""
        rollout, prepared = self.rollout(h), self.prepared(r, h)
        states, (_, parts) = rollout.path(begun(self.problem, rollout, r), rollout.drive(prepared, p), prepared.grid, p,
                                          kept=False)
        return Motion(states), parts

    def prepared(self, r: int, h: float) -> Prepared:
        """Return a record for steps of h [s]: its readings, and its force with that of effects of its own numbers."""
        run, slow = self.problem.runs[r], own_force(self.problem, self.candidate, r)
        channels = tuple(Channel(int(i), "displacement", run.time, run.raw[i], under_way=run.record.kind != "decay")
                         for i in np.flatnonzero(run.free))
        found = replace(prepare(self.problem.model, run.record, h), channels=channels)
        if found.force is None or not slow.any():
            return found
        both = [(f.x if f.x.size > run.time.size else run.time, f, row) for f, row in zip(found.force, slow)]
        return replace(found, force=tuple(CubicSpline(t, f(t) + np.interp(t, run.time, row)) for t, f, row in both))

    def begins(self, r: int, rollout: Rollout, prepared: Prepared) -> dict[Key | str, FloatArray]:
        """Return the directions in which a record's start is unknown: the motion's, and under way effects' own."""
        motion = start_of(self.problem.model, prepared, rollout.ns)
        return {"motion": motion} | (unrest_of(rollout, prepared) if self.problem.runs[r].under_way() else {})

    def errors(self, r: int, prepared: Prepared, zero: float, moved: FloatArray) -> list[FloatArray]:
        """Return what errors of readings and forces add to each channel's rows, one standard deviation each.

        Zeros, slow motions that a sensor cannot tell, and the motion by the forces that no effect explains.
        Each channel's has the shape (rows, errors).
        """
        run, channels = self.problem.runs[r], [c.dof for c in prepared.channels]
        flat = np.diag([zero * np.std(c.value) for c in prepared.channels])
        zeros = np.broadcast_to(flat[:, :, None], (*flat.shape, run.time.size))
        series = np.concatenate([zeros, run.lost[:, channels], moved[:, channels]])
        return [on_rows(self.problem, self.places[r, dof], series[:, c]).T for c, dof in enumerate(channels)]

    def moved(self, r: int, unexplained: bool) -> FloatArray:
        """Return motions from rest (k, n, nt) by forces that the simulation lacks, of one standard deviation each."""
        problem, run = self.problem, self.problem.runs[r]
        (F, G), n, sizes = problem.model.matrices(), problem.model.n, self.candidate.posterior.sizes
        step, first, at_rest = exact_step(F, G, run.dt), F.shape[0] - 2 * n, np.zeros(F.shape[0])
        free = [int(i) for i in np.flatnonzero(run.free)]
        acting = [(i, values) for i in free if unexplained for values in unexplained_forces(problem, run, i, sizes)]
        acting += [(i, values) for i in free for values in noise_at_resonance(problem.model, run, i)]
        forces = [np.where(np.arange(n) == i, values[:, None], 0.0) for i, values in acting]
        if LEFT_OUT in problem.labels:
            forces.append(radiation_left_out(problem.model, run).force.T)
        moved = [propagate(step, force, at_rest)[:, first:first + n].T for force in forces]
        return np.array(moved).reshape(-1, n, run.time.size)

    def moved_by_waves(self, r: int, tolerance: float) -> FloatArray:
        """Return motions of the corrected body (k, n, nt) by errors of X, of one standard deviation each.

        `tolerance`: relative standard deviation of the force.
        """
        problem, run, n = self.problem, self.problem.runs[r], self.problem.model.n
        forces = [np.where(np.arange(n)[:, None] == i, values, 0.0) for i in map(int, np.flatnonzero(run.free))
                  for _, values in shape_errors(problem.model, run, i)]
        if not forces:
            return np.zeros((0, n, run.time.size))
        columns = problem.with_columns(term.columns for term in self.candidate.terms)
        change = changes_of_impedance(problem, columns, self.candidate.posterior)[r]
        size = 4 * run.time.size
        at = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, run.dt), dtype=np.float64)
        Z = stiffened(problem.model, run, at, change)
        moved = np.linalg.solve(Z, np.fft.rfft(np.array(forces), size).transpose(2, 1, 0))
        share = problem.discrepancy.by_record * tolerance
        return np.asarray(share * np.fft.irfft(moved.transpose(2, 1, 0), size)[..., : run.time.size])


def on_rows(problem: EquationError, place: Place, values: FloatArray) -> FloatArray:
    """Return signals (k, nt) as the rows of a place see them, (k, rows)."""
    found = projected_on(problem.runs[place.record].basis, values, bins=place.bins)
    return found.reshape(len(values), place.rows.stop - place.rows.start)


def begun(problem: EquationError, rollout: Rollout, r: int) -> FloatArray:
    """Return the state in which a record begins by its measured motion."""
    m, n, run = problem.model.fit.states, problem.model.n, problem.runs[r]
    state = np.zeros(rollout.ns)
    state[m:m + n], state[m + n:m + 2 * n] = run.x[:, 0], run.v[:, 0]
    return state


def blocks_of(starts: Mapping[Key | str, FloatArray], first: int, last: int) -> dict[Key | str, slice]:
    """Return where the unknowns of parts of a start stand that begin at `first`, and the errors' after them."""
    ends = first + np.cumsum([0, *(basis.shape[1] for basis in starts.values())])
    return {part: slice(i, j) for part, i, j in zip(starts, ends, ends[1:])} | {"errors": slice(ends[-1], last)}


def own_force(problem: EquationError, candidate: Candidate, r: int) -> FloatArray:
    """Return the force in one record of effects with numbers of each record's own, shape (n, nt)."""
    run = problem.runs[r]
    force = np.zeros_like(run.x)
    rows = [p.rows for p in problem.places if p.record == r]
    for term, at in placed(problem, candidate.terms):
        if term.active.effect.per_record and term.active.effect.force is not None:
            mine = np.asarray(term.columns.values[rows[0].start:rows[-1].stop])
            found = features(problem.symbols(term.active), term.active, [run])
            for k, of_record in zip(np.flatnonzero(np.any(mine, axis=0)), found):
                force += candidate.posterior.mean[at.start + k] * of_record[0].force
    return force
