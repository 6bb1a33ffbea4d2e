"""The default filter with its state: the recursion of `marginal`, and iterated updates that take samples again.

An ensemble that starts 15 % wide takes its first seconds by a straight line through a curved relation, and a filter
without forgetting keeps that error for ever: parameters are sure and off. So whenever the number of samples has doubled
they are all taken again from the start with the tangents at the parameters found, until these stay (Gauss-Newton; the
iterated ensemble Kalman smoother of Sakov, Oliver and Bertino 2012, its members infinitely near). Prior and points
enter as they are, not linearised. The work comes in pieces, so that live samples are never kept waiting.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.marginal import FilterState, SampleRules, System, marginal_loop, tangent_loop
from radiation_ss.filter.members import Drawing, Members
from radiation_ss.filter.plan import Outcome, SampleBlock
from radiation_ss.filter.prior import Evidence, Job, Pieces, finish

LEARN = {"never": 0, "known-force": 1, "always": 2}


class TakenSamples:
    """Samples since the start; refused ones are NaN."""

    def __init__(self, samples: SampleBlock) -> None:
        self.count, self._blocks = samples.dts.size, [samples]

    def add(self, samples: SampleBlock, taken: np.ndarray) -> None:
        """Append samples, of which some channels were taken."""
        self.count += samples.dts.size
        self._blocks.append(samples._replace(y=np.where(taken, samples.y, np.nan)))

    def samples(self, first: int = 0) -> SampleBlock:
        """Return the samples from number `first` on."""
        self._blocks = [SampleBlock(*map(np.concatenate, zip(*self._blocks)))]
        return self._blocks[0].part(first, self.count)


class TangentRun(NamedTuple):
    """A Kalman filter with its tangents, moved in place; columns are neighbours along each parameter, then u twice."""

    theta: FloatArray        # (n_theta, d + 2)
    z: FloatArray            # (m + 4 n, d + 2)
    P: FloatArray
    near: float              # distance of the neighbours, in prior standard deviations
    information: FloatArray  # (d, d)
    gradient: FloatArray     # (d,)


class Updated(NamedTuple):
    """What an iterated update gives: members, the evidence they were drawn from, and the run at its parameters."""

    members: Members
    evidence: Evidence
    run: TangentRun
    samples: int  # taken by the run so far


@dataclass(frozen=True, eq=False)
class IteratedUpdate:
    """What a window is taken again with; `start` is P at its start, where all states are zero.

    At most `passes` Gauss-Newton steps, ended by one of `settled` posterior standard deviations; a piece of work is so
    many products of samples, states and columns.
    """

    system: System
    start: FloatArray
    learn: int
    drawing: Drawing
    passes: int = 10
    settled: float = 0.1
    work: int = 8000

    def learns(self, window: TakenSamples) -> bool:
        """Whether any sample of the window may teach the parameters."""
        known = np.isfinite(window.samples().y[:, 3 * self.system.plan.n:]).all(axis=1)
        return self.drawing.size > 0 and (self.learn == 2 or (self.learn == 1 and bool(known.any())))

    def first_guess(self, centre: FloatArray) -> FloatArray:
        """Return standardised parameters to begin at: the recursion's, or the model's where it went astray."""
        start = self.drawing.parts.theta
        sane = np.isfinite(centre).all() and np.all(centre * start > 0.0, where=start != 0.0)
        return self.drawing.prior.u(centre if sane else start)

    def update(self, samples: SampleBlock, u: FloatArray) -> Pieces[Updated | None]:
        """Take samples again and draw members; None where the passes do not settle, or end at an unstable model."""
        for _ in range(self.passes):
            run = self.run_at(u)
            yield from self.take(run, samples)
            data = Evidence(u, run.gradient.copy(), run.information.copy())
            if not (np.isfinite(data.information).all() and np.isfinite(data.gradient).all()):
                return None
            try:
                move = (yield from self.drawing.mode(data)) - u
                if move @ (np.eye(u.size) + data.information) @ move < self.settled**2:
                    return Updated((yield from self.drawing.members(data)), data, run, samples.dts.size)
            except (SolverError, np.linalg.LinAlgError):
                return None
            u = u + move
        return None

    def run_at(self, u: FloatArray, near: float = 1e-4) -> TangentRun:
        """Return a run at parameters u, before the first sample."""
        d = u.size
        theta = self.drawing.prior.theta(np.vstack([u + near * np.eye(d), u, u])).T.copy()
        return TangentRun(theta, np.zeros((self.start.shape[0], d + 2)), self.start.copy(), near, np.zeros((d, d)),
                          np.zeros(d))

    def take(self, run: TangentRun, samples: SampleBlock) -> Pieces[None]:
        """Move a run over samples."""
        piece = max(1, self.work // run.z.size)
        for first in range(0, samples.dts.size, piece):
            tangent_loop(self.system, self.learn, run, samples.part(first, first + piece))
            yield

    def place(self, found: Updated, window: TakenSamples, state: FilterState) -> Pieces[None]:
        """Put members, control and covariance of the filter's state where the update says, at the window's end."""
        yield from self.take(found.run, window.samples(found.samples))
        z, columns = found.run.z, np.column_stack([found.members.theta, found.members.centre])
        tangents, prior = (z[:, :-2] - z[:, -1:]) / found.run.near, self.drawing.prior
        state.theta[:, :-1] = columns
        state.z[:, :-1] = z[:, -1:] + tangents @ found.evidence.change(prior, prior.u(columns.T)).T
        state.P[:] = found.run.P


class DefaultEngine:
    """The default filter; `start` (m + 4 n, m + 4 n) is the covariance before the first sample.

    While an iterated update is under way, so many pieces of it as `pace` says (some .3 ms each) are done with each
    sample. The window is taken again after `first` samples, and when they have doubled, up to `last`.
    """

    def __init__(self, system: System, drawing: Drawing, start: FloatArray, rules: SampleRules, *, pace: int = 4,
                 first: int = 64, last: int = 2**16) -> None:
        self.system, self.rules, self.pace, self.next, self.last = system, rules, pace, first, last
        self.placed = finish(drawing.members())
        self.counts = np.array([self.placed.unstable, self.placed.not_passive])
        theta = np.column_stack([self.placed.theta, self.placed.centre, drawing.parts.theta])
        count = np.zeros(4 * system.plan.n, dtype=np.int64)
        self.state = FilterState(theta, np.zeros((len(start), theta.shape[1])), start.copy(), count,
                                 np.full(count.size, np.nan), count.copy(), np.zeros(count.size))
        self.iterated = IteratedUpdate(system, start, rules.learn, drawing)
        self.information = np.zeros((drawing.size, drawing.size))
        none = SampleBlock(np.zeros((0, 4 * system.plan.n)), np.zeros(0), np.zeros(0, dtype=np.int64))
        self.window = TakenSamples(none) if rules.learn and drawing.size else None
        self.job: Job[Updated | None] | None = None
        self.job_start, self.job_guess = 0, np.zeros(drawing.size)
        # The loops are compiled or loaded before the first sample comes.
        marginal_loop(system, rules, self.state, none, Outcome.empty(0, system.plan.n, len(theta)))
        if rules.learn:
            tangent_loop(system, rules.learn, self.iterated.run_at(self.job_guess), none)

    def advance(self, samples: SampleBlock) -> Outcome:
        """Take samples; an iterated update goes on in the background and moves the state at a certain sample."""
        out = Outcome.empty(samples.dts.size, self.system.plan.n, self.state.theta.shape[0])
        first = 0
        while first < samples.dts.size:
            last = first + self._free(samples.dts.size - first)
            part, here = samples.part(first, last), out.part(first, last)
            marginal_loop(self.system, self.rules, self.state, part, here)
            if self.window is not None:
                self.window.add(part, here.taken)
                self._update(self.window)
            first = last
        return out

    def _free(self, available: int) -> int:
        """Return how many samples can be taken before the iterated update is begun or its result is due."""
        if self.window is None:
            return available
        if self.job is None:
            return max(1, min(available, self.next - self.window.count))
        self.job.run(self.pace * available)
        return min(available, self._due() - self.window.count) if self.job.finished else available

    def _due(self) -> int:
        """Return the number of samples at which the result of the job, finished by now, takes effect.

        It waits for the next eighth of the samples taken again: rounding may make a loop of the job longer by one.
        """
        assert self.job is not None
        part = self.job_start // 8
        return self.job_start - part * (-self.job.done // (self.pace * part))

    def _update(self, window: TakenSamples) -> None:
        """Begin an iterated update, or let its result take effect, where that is due."""
        if self.job is not None and self.job.finished and window.count >= self._due():
            self._place(self.job.result)
        if self.job is None and window.count >= self.next:
            while self.next <= window.count:
                self.next *= 2
            if self.iterated.learns(window):
                guess = self.iterated.first_guess(self.state.theta[:, self.state.members])
                self.job = self._begin(window.samples(), guess)
        if self.job is None and self.next > self.last:
            self.window = None

    def _begin(self, samples: SampleBlock, guess: FloatArray) -> Job[Updated | None]:
        self.job_start, self.job_guess = samples.dts.size, guess
        return Job(self.iterated.update(samples, guess))

    def _place(self, found: Updated | None) -> None:
        self.job = None
        if found is not None and self.window is not None:
            finish(self.iterated.place(found, self.window, self.state))
            self.placed, self.information = found.members, found.evidence.information
            self.counts += self.placed.unstable, self.placed.not_passive

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Take the window again at once; return mean and standard deviation of the parameters, each (n_theta,)."""
        centre = self.state.theta[:, self.state.members]
        if self.window is not None and self.iterated.learns(self.window):
            self._place(finish(self.iterated.update(self.window.samples(), self.iterated.first_guess(centre))))
        return centre.copy(), self.drawn().std(axis=1, ddof=1)

    def members(self) -> FloatArray:
        """Return the ensemble of parameters, (n_theta, members)."""
        return self.state.theta[:, :self.state.members]

    def drawn(self) -> FloatArray:
        """Return the members before they were made physical; as they are, where the recursion has moved them since.

        That puts a member onto the boundary of the physical region. It is no condition on the region: it takes spread
        away without telling anything.
        """
        return self.placed.drawn if np.array_equal(self.placed.theta, self.members()) else self.members()

    def projected(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble with members that have left the physical region put back, and how many had to be."""
        centre = self.state.theta[:, self.state.members]
        found = finish(self.iterated.drawing.physical(self.members(), centre, self.information))
        unstable, not_passive = self.counts + (found.unstable, found.not_passive)
        return found.theta, {"repaired": int(unstable), "made_passive": int(not_passive)}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""
        job = np.array([self.next, self.job_start, self.job.done if self.job is not None else -1])
        window = {} if self.window is None else {f"window_{key}": value for key, value
                                                 in self.window.samples()._asdict().items()}
        return self.state._asdict() | window | {"counts": self.counts, "information": self.information, "job": job,
                                                "drawn": self.drawn(), "job_guess": self.job_guess}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back; the iterated update under way is done again as far as it was."""
        arrays = {"far": np.zeros(len(arrays["same"])), **arrays}   # files of before have none
        self.state = FilterState(*(np.ascontiguousarray(arrays[key]) for key in FilterState._fields))
        self.counts, self.information = arrays["counts"], arrays["information"]
        self.placed = self.placed._replace(theta=self.members().copy(), drawn=arrays["drawn"])
        self.window, self.job = None, None
        if "window_y" in arrays:
            self.window = TakenSamples(SampleBlock(*(arrays[f"window_{key}"] for key in SampleBlock._fields)))
        self.next, start, done = (int(k) for k in arrays["job"])
        if done >= 0 and self.window is not None:
            self.job = self._begin(self.window.samples().part(0, start), arrays["job_guess"])
            self.job.run(done)
