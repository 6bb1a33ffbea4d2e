"""The iterated update: what a window of samples says about the parameters, linearised at its end, not its start.

An ensemble that starts 15 % wide takes its first seconds by a straight line through a curved relation, and a filter
without forgetting keeps that error for ever: parameters are sure and off. So the window is taken again from its start
with the tangents at the parameters found, until they stay (Gauss-Newton; the iterated ensemble Kalman smoother of
Sakov, Oliver and Bertino 2012, its members infinitely near). Prior and points enter as they are, not linearised.

The work comes in pieces, so that live samples are never kept waiting.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.marginal import FilterState, System
from radiation_ss.filter.marginal_loop import tangent_loop
from radiation_ss.filter.members import Drawing, Members
from radiation_ss.filter.pieces import Pieces
from radiation_ss.filter.plan import Samples
from radiation_ss.filter.prior import Evidence


class Window:
    """Samples since the start; refused ones are NaN."""

    def __init__(self, samples: Samples) -> None:
        self.count, self._arrays = samples.dts.size, samples

    @classmethod
    def empty(cls, channels: int) -> Window:
        """Return a window without samples."""
        return cls(Samples(np.zeros((0, channels)), np.zeros(0), np.zeros(0, dtype=np.int64)))

    def add(self, samples: Samples, taken: np.ndarray) -> None:
        """Append samples, of which some channels were taken."""
        here = slice(self.count, self.count + samples.dts.size)
        if here.stop > self._arrays.dts.size:
            self._arrays = Samples(*(_grown(a, here.stop) for a in self._arrays))
        for ours, theirs in zip(self._arrays, samples._replace(y=np.where(taken, samples.y, np.nan))):
            ours[here] = theirs
        self.count = here.stop

    def samples(self, first: int = 0, last: int | None = None) -> Samples:
        """Return the samples from number `first` on."""
        return self._arrays.part(first, self.count if last is None else last)


def _grown(values: np.ndarray, needed: int) -> np.ndarray:
    return np.concatenate([values, np.zeros((max(needed, 2 * len(values)) - len(values), *values.shape[1:]),
                                            dtype=values.dtype)])


class Run(NamedTuple):
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
    run: Run
    samples: int  # taken by the run so far


@dataclass(frozen=True, eq=False)
class IteratedUpdate:
    """What a window is taken again with.

    Parameters
    ----------
    start : ndarray
        P at the window's start, where all states are zero.
    learn : int
        1: where the force of every degree of freedom is known; 2: always.
    passes : int
        Most Gauss-Newton steps.
    settled : float
        Size of a step, in posterior standard deviations, that ends them.
    work : int
        Products of samples, states and columns in one piece.
    """

    system: System
    start: FloatArray
    learn: int
    drawing: Drawing
    passes: int = 10
    settled: float = 0.1
    work: int = 8000

    def learns(self, window: Window) -> bool:
        """Whether any sample of the window may teach the parameters."""
        known = np.isfinite(window.samples().y[:, 3 * self.system.plan.n:]).all(axis=1)
        return self.drawing.size > 0 and (self.learn == 2 or (self.learn == 1 and bool(known.any())))

    def first_guess(self, centre: FloatArray) -> FloatArray:
        """Return standardised parameters to begin at: the recursion's, or the model's where it went astray."""
        start = self.drawing.parts.theta
        sane = np.isfinite(centre).all() and np.all(centre * start > 0.0, where=start != 0.0)
        return self.drawing.u(centre if sane else start)

    def update(self, samples: Samples, u: FloatArray) -> Pieces[Updated | None]:
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

    def run_at(self, u: FloatArray, near: float = 1e-4) -> Run:
        """Return a run at parameters u, before the first sample."""
        d = u.size
        theta = self.drawing.prior.theta(np.vstack([u + near * np.eye(d), u, u])).T.copy()
        return Run(theta, np.zeros((self.start.shape[0], d + 2)), self.start.copy(), near, np.zeros((d, d)),
                   np.zeros(d))

    def take(self, run: Run, samples: Samples) -> Pieces[None]:
        """Move a run over samples."""
        piece = max(1, self.work // run.z.size)
        for first in range(0, samples.dts.size, piece):
            tangent_loop(self.system, self.learn, run, samples.part(first, first + piece))
            yield

    def place(self, found: Updated, window: Window, state: FilterState) -> Pieces[None]:
        """Put members, control and covariance of the filter's state where the update says, at the window's end."""
        yield from self.take(found.run, window.samples(found.samples))
        z, columns = found.run.z, np.column_stack([found.members.theta, found.members.centre])
        tangents = (z[:, :-2] - z[:, -1:]) / found.run.near
        state.theta[:, :-1] = columns
        state.z[:, :-1] = z[:, -1:] + tangents @ found.evidence.change(self.drawing.prior, self.drawing.u(columns.T)).T
        state.P[:] = found.run.P
