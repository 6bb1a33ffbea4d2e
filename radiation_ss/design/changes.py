"""What sensors of planned tests would read more or less: exact first derivatives about the linear model's motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Active
from radiation_ss.errors import InputError
from radiation_ss.inference.effect_features import Symbols, features
from radiation_ss.inference.motion import MeasuredMotion, Resolution, measured_motion
from radiation_ss.inference.readings import QUANTITIES
from radiation_ss.records.record import Record


@dataclass(frozen=True, eq=False)
class Simulated:
    """Records without noise, and what to weigh changes of their readings with."""

    model: Model
    runs: tuple[MeasuredMotion, ...]
    sizes: FloatArray  # (3, n): Rms of displacement, velocity and acceleration at full amplitude
    noise: float  # Standard deviation of a sensor at each of the record's samples, of what it reads at full amplitude

    def weighed(self, r: int, change: FloatArray) -> list[FloatArray]:
        """Return changes in standard deviations for each quantity that record r holds, shapes (rows, K)."""
        run, found = self.runs[r], []
        keep = np.sqrt(max(run.dt / float(np.median(np.diff(run.record.time))), 1.0))
        for order, quantity in enumerate(QUANTITIES):
            rows = [change[order, i] / (self.noise * self.sizes[order, i] / keep) for i, dof in
                    enumerate(self.model.dofs) if self.sizes[order, i] > 0.0
                    and (order == 0 or run.record.get(quantity, [dof]) is not None)]
            found.append(np.concatenate([*rows, np.zeros((0, change.shape[-1]))]))
        return found

    def by(self, active: Active, per_record: bool = False, symbols: Symbols | None = None) -> list[FloatArray]:
        """Return changes of displacement, velocity and acceleration by each strength, (3, n, nt, K) of each record.

        With `per_record` one column for each strength and record.
        """
        strengths = features(self.model, active, self.runs, symbols)
        found = []
        for r, run in enumerate(self.runs):
            force = np.stack([by_record[r].force for by_record in strengths], axis=-1)
            change = response(self.model, force, run.dt)
            change[0] += np.stack([by_record[r].reading for by_record in strengths], axis=-1)
            if per_record:
                spread = np.zeros((*change.shape, len(self.runs)))
                spread[..., r] = change
                change = spread.reshape(*change.shape[:-1], -1)
            found.append(change)
        return found

    def unknown(self, r: int, wide: float = 30.0) -> FloatArray:
        """Return changes by the unknown start, shape (3, n, nt, K): place, velocity, and what was before a record.

        `wide` is the prior standard deviation of place and velocity at the start, of the rms at full amplitude.
        """
        run, n, m = self.runs[r], self.model.n, self.model.fit.states
        start = np.zeros((m + 2 * n, 2 * n))
        start[m:] = np.diag(wide * np.concatenate([self.sizes[0], self.sizes[1]]))
        free = response(self.model, np.zeros((n, run.time.size, 2 * n)), run.dt, start)
        if not len(run.transients):
            return free
        return np.concatenate([free, response(self.model, np.moveaxis(run.transients, 0, -1), run.dt)], axis=-1)


def simulated(model: Model, records: Sequence[Record], full: Sequence[bool], noise: float) -> Simulated:
    """Return simulated records; the size of readings is that of the records at full amplitude, or of all.

    Raises
    ------
    InputError
        If a record's force is unknown, or its motion is prescribed.
    """
    runs = [differentiated(measured_motion(model, record, Resolution(noise_floor=0.0))) for record in records]
    for run in runs:
        if run.force is None or run.prescribed:
            said = "no known force" if run.force is None else "a given motion"
            raise InputError(f"test {run.record.name}: kind {run.record.kind!r} with {said}; a planned test is a "
                             "decay, or the body moves freely under a known force or wave elevation")
    large = [run for run, is_full in zip(runs, full) if is_full] or runs
    sizes = np.stack([np.sqrt(np.mean([np.mean(getattr(run, name) ** 2, axis=1) for run in large], axis=0))
                      for name in "xva"])
    return Simulated(model, tuple(runs), sizes, noise)


def differentiated(run: MeasuredMotion) -> MeasuredMotion:
    """Return a run whose motion is the displacement itself: it has no noise."""
    spline = make_interp_spline(run.time, run.raw, k=5, axis=1)
    return replace(run, x=run.raw, v=spline(run.time, 1), a=spline(run.time, 2))


def response(model: Model, force: FloatArray, dt: float, start: FloatArray | None = None) -> FloatArray:
    """Return displacement, velocity and acceleration of the linear model, shape (3, n, nt, K).

    Exact for forces that are cubic splines of their samples.

    Parameters
    ----------
    force : ndarray, shape (n, nt, K)
    start : ndarray, shape (m + 2 n, K), optional
        State at the first sample, radiation states first; 0 if absent.
    """
    F, G = model.matrices()
    n, (size, count) = model.n, (F.shape[0], force.shape[1])
    block = np.zeros((size + 4 * n, size + 4 * n))
    block[:size, :size], block[:size, size:size + n] = F, G
    block[size:-n, size + n:] = np.eye(3 * n)
    step = expm(block * dt)
    pieces = CubicSpline(dt * np.arange(count), force, axis=1).c  # (4, nt - 1, n, K), highest power first
    drive = sum(np.einsum("sn,tnk->tsk", step[:size, size + p * n:size + (p + 1) * n], factorial(p) * pieces[3 - p])
                for p in range(4))
    states = np.zeros((count, size, force.shape[2]))
    if start is not None:
        states[0] = start
    for k in range(count - 1):
        states[k + 1] = step[:size, :size] @ states[k] + drive[k]
    m = model.fit.states
    x, v = states[:, m:m + n], states[:, m + n:]
    a = np.einsum("ns,tsk->tnk", F[m + n:], states) + np.einsum("nj,jtk->tnk", G[m + n:], force)
    return np.stack([np.moveaxis(part, 0, 1) for part in (x, v, a)])
