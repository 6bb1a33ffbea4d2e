"""The iterated update: what a window of samples says about the parameters, linearised at its end, not its start.

An ensemble that starts 15 % wide takes its first seconds by a straight line through a curved relation, and a filter
without forgetting keeps that error for ever: parameters are sure and off. So the window is taken again from its start
with the tangents at the parameters found, until they stay (Gauss-Newton; the iterated ensemble Kalman smoother of
Sakov, Oliver and Bertino 2012, its members infinitely near). Prior and points enter as they are, not linearised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.marginal import Cloud
from radiation_ss.filter.members import Drawing, Members
from radiation_ss.filter.plan import Plan
from radiation_ss.filter.prior import Evidence
from radiation_ss.filter.tangent_loop import tangent_loop

FIRST, LAST = 64, 2**16     # samples after which the window is taken again; doubled each time, up to LAST
PASSES = 10
SETTLED = 0.1               # of a posterior standard deviation
NEAR = 1e-4                 # of a prior standard deviation: distance of the tangents' columns


@dataclass(eq=False)
class Window:
    """Samples since the start, kept until there are LAST of them; refused ones are NaN."""

    y: FloatArray
    dts: FloatArray
    steps: np.ndarray
    count: int = 0

    @classmethod
    def empty(cls, channels: int, size: int = FIRST) -> Window:
        """Return a window with room for `size` samples."""
        return cls(np.full((size, channels), np.nan), np.zeros(size), np.zeros(size, dtype=np.int64))

    @property
    def room(self) -> int:
        """Samples until it is full."""
        return self.dts.size - self.count

    def add(self, y: FloatArray, dts: FloatArray, steps: np.ndarray, taken: np.ndarray) -> None:
        """Append samples."""
        here = slice(self.count, self.count + dts.size)
        self.y[here], self.dts[here], self.steps[here] = np.where(taken, y, np.nan), dts, steps
        self.count += dts.size

    def doubled(self) -> Window | None:
        """Return the window with twice the room; None if it is long enough."""
        if self.dts.size >= LAST:
            return None
        wider = Window.empty(self.y.shape[1], 2 * self.dts.size)
        here, wider.count = slice(0, self.count), self.count
        wider.y[here], wider.dts[here], wider.steps[here] = self.y, self.dts, self.steps
        return wider


@dataclass(frozen=True, eq=False)
class Relearning:
    """What a window is taken again with.

    Parameters
    ----------
    start : ndarray
        P at the window's start, where all states are zero.
    learn : int
        1: where the force of every degree of freedom is known; 2: always.
    """

    plan: Plan
    force: ForceModel
    q: FloatArray
    H: FloatArray
    r: FloatArray
    start: FloatArray
    learn: int
    drawing: Drawing

    def learns(self, window: Window) -> bool:
        """Whether any sample of the window may teach the parameters."""
        known = np.isfinite(window.y[:window.count, 3 * self.plan.n:]).all(axis=1)
        return self.drawing.size > 0 and (self.learn == 2 or (self.learn == 1 and bool(known.any())))

    def take(self, window: Window, u: FloatArray) -> tuple[Evidence, FloatArray, FloatArray]:
        """Return what the window says near u, the columns' states at its end (tangents, then the control), and P."""
        d = u.size
        theta = self.drawing.prior.theta(np.vstack([u + NEAR * np.eye(d), u, u])).T.copy()
        z, P = np.zeros((self.H.shape[1], d + 2)), self.start.copy()
        information, gradient, here = np.zeros((d, d)), np.zeros(d), slice(0, window.count)
        tangent_loop(self.plan.plant, self.force.A, self.q, self.H, self.r, self.learn, theta, z, P, window.y[here],
                     window.dts[here], window.steps[here], NEAR, information, gradient)
        return Evidence(u, gradient, information), z[:, :d + 1], P

    def __call__(self, window: Window, cloud: Cloud) -> tuple[Members, FloatArray] | None:
        """Put members, control and covariance of the cloud where the whole window says.

        Returns
        -------
        tuple of Members, ndarray (d, d), or None
            The members and the window's information; None where the passes do not settle, and nothing is changed.
        """
        centre, start = cloud.theta[:, cloud.members], self.drawing.parts.theta
        # A recursion that went astray may have turned a sign, or lost its numbers: begin at the model again.
        sane = np.isfinite(centre).all() and np.all(centre * start > 0.0, where=start != 0.0)
        try:
            found = self._settle(window, self.drawing.u(centre if sane else start))
            members = None if found is None else self.drawing.members(found[0])
        except (SolverError, np.linalg.LinAlgError):
            return None
        if found is None or members is None:
            return None
        data, z, P = found
        tangents = (z[:, :-1] - z[:, -1:]) / NEAR
        columns = np.column_stack([members.theta, members.centre])
        cloud.theta[:, :-1] = columns
        cloud.z[:, :-1] = z[:, -1:] + tangents @ data.change(self.drawing.prior, self.drawing.u(columns.T)).T
        cloud.P[:] = P
        return members, data.information

    def _settle(self, window: Window, u: FloatArray) -> tuple[Evidence, FloatArray, FloatArray] | None:
        """Take the window again until the most probable parameters stay; None where they do not."""
        for _ in range(PASSES):
            data, z, P = self.take(window, u)
            if not (np.isfinite(data.information).all() and np.isfinite(data.gradient).all()):
                return None
            move = self.drawing.mode(data) - u
            if move @ (np.eye(u.size) + data.information) @ move < SETTLED**2:
                return data, z, P
            u = u + move
        return None
