"""The default filter as an object with state; see `marginal` for its step, `iterated_update` for the rest."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.engines import Outcome
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.iterated_update import IteratedUpdate, Updated, Window
from radiation_ss.filter.marginal import FilterState, Rules, start_covariance, system_of
from radiation_ss.filter.marginal_loop import marginal_loop, tangent_loop
from radiation_ss.filter.members import Drawing
from radiation_ss.filter.pieces import Job, finish
from radiation_ss.filter.plan import Plan, Samples
from radiation_ss.inference.scales import Scales

LEARN = {"never": 0, "known-force": 1, "always": 2}


class DefaultEngine:
    """The default filter.

    Parameters
    ----------
    pace : int
        Pieces of an iterated update (some .3 ms each) that are done with each sample while one is under way.
    first, last : int
        Samples after which the window is taken again; doubled each time, up to the last.
    """

    def __init__(self, plan: Plan, drawing: Drawing, scales: Scales, force: ForceModel, rules: Rules, *, pace: int = 4,
                 first: int = 64, last: int = 2**16) -> None:
        self.system, self.rules, self.pace, self.next, self.last = (system_of(plan, force, scales.noise), rules, pace,
                                                                    first, last)
        self.placed = finish(drawing.members())
        self.counts = np.array([self.placed.unstable, self.placed.not_passive])
        theta = np.column_stack([self.placed.theta, self.placed.centre, drawing.parts.theta])
        P = start_covariance(plan, theta[:, -1], scales, force)
        self.state = FilterState.at_rest(theta, P, 4 * plan.n)
        self.iterated = IteratedUpdate(self.system, P, rules.learn, drawing)
        self.information = np.zeros((drawing.size, drawing.size))
        self.window = Window.empty(4 * plan.n) if rules.learn and drawing.size else None
        self.job: Job[Updated | None] | None = None
        self.job_start, self.job_guess = 0, np.zeros(drawing.size)
        self._compile(rules.learn == LEARN["always"] or bool(np.isfinite(scales.noise[3]).any()))

    def _compile(self, learning: bool) -> None:
        """Have the loops compiled or loaded before the first sample comes."""
        none, n = Window.empty(self.system.H.shape[0]).samples(), self.system.plan.n
        marginal_loop(self.system, self.rules, self.state, none, Outcome.empty(0, n, self.state.theta.shape[0]),
                      np.zeros(none.y.shape, dtype=np.bool_))
        if learning:
            tangent_loop(self.system, self.rules.learn, self.iterated.run_at(self.job_guess), none)

    def advance(self, samples: Samples) -> Outcome:
        """Take samples; an iterated update goes on in the background and moves the state at a certain sample."""
        out = Outcome.empty(samples.dts.size, self.system.plan.n, self.state.theta.shape[0])
        first = 0
        while first < samples.dts.size:
            last = first + self._free(samples.dts.size - first)
            part = samples.part(first, last)
            taken = np.zeros(part.y.shape, dtype=np.bool_)
            marginal_loop(self.system, self.rules, self.state, part, out.part(first, last), taken)
            if self.window is not None:
                self.window.add(part, taken)
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
        """Return the number of samples at which the result of the job, finished by now, takes effect."""
        assert self.job is not None
        return self.job_start - (-self.job.done // self.pace)

    def _update(self, window: Window) -> None:
        """Begin an iterated update, or let its result take effect, where that is due."""
        if self.job is None and window.count < self.next:
            return
        if self.job is None and self.iterated.learns(window):
            self._begin(window.count, self.iterated.first_guess(self.state.theta[:, self.state.members]))
            return
        if self.job is not None:
            if not self.job.finished or window.count < self._due():
                return
            self._place(self.job.result)
        while self.next <= window.count:
            self.next *= 2
        if self.next > self.last:
            self.window = None

    def _begin(self, start: int, guess: FloatArray) -> None:
        assert self.window is not None
        self.job_start, self.job_guess = start, guess
        self.job = Job(self.iterated.update(self.window.samples(0, start), guess))

    def _place(self, found: Updated | None) -> None:
        self.job = None
        if found is not None and self.window is not None:
            finish(self.iterated.place(found, self.window, self.state))
            self.placed, self.information = found.members, found.evidence.information
            self.counts += self.placed.unstable, self.placed.not_passive

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Take the window again at once."""
        centre = self.state.theta[:, self.state.members]
        if self.window is not None and self.iterated.learns(self.window):
            self._place(finish(self.iterated.update(self.window.samples(), self.iterated.first_guess(centre))))
        return centre.copy(), self.drawn().std(axis=1, ddof=1)

    def members(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.state.theta[:, :self.state.members]

    def drawn(self) -> FloatArray:
        """Return the members before they were made physical; as they are, where the recursion has moved them since.

        That puts a member onto the boundary of the physical region. It is no condition on the region: it takes spread
        away without telling anything.
        """
        return self.placed.drawn if np.array_equal(self.placed.theta, self.members()) else self.members()

    def projected(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble with members that have left the physical region put back."""
        found = finish(self.iterated.drawing.physical(self.members(), self.state.theta[:, self.state.members],
                                                      self.information))
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
        self.state = FilterState(*(np.ascontiguousarray(arrays[key]) for key in FilterState._fields))
        self.counts, self.information = arrays["counts"], arrays["information"]
        self.placed = self.placed._replace(theta=self.members().copy(), drawn=arrays["drawn"])
        self.window, self.job = None, None
        if "window_y" in arrays:
            self.window = Window(Samples(*(arrays[f"window_{key}"] for key in Samples._fields)))
        self.next, start, done = (int(k) for k in arrays["job"])
        if done >= 0:
            self._begin(start, arrays["job_guess"])
            assert self.job is not None
            self.job.run(done)
