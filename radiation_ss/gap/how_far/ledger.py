"""How far the gap shrinks: prediction errors on records that no fit has seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.gap.posterior.noise import floor_of
from radiation_ss.records.record import Record
from radiation_ss.simulation.prepare import QUANTITIES, Channel
from radiation_ss.simulation.reading import reading
from radiation_ss.simulation.run import run


@dataclass(frozen=True)
class HowFar:
    """Gaps on records that no fit has seen: nominal, retuned, with the effect, and the noise.

    `sure` are the first and the third without the slow motion that an elevation says nothing of; None if all is sure.
    """

    gap_before: float
    gap_retuned: float
    gap_after: float
    noise_floor: float
    shrinkage: float
    interval: tuple[float, float]
    on: tuple[str, ...]
    sure: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Error:
    """Measured motion and what a model leaves of it, for one degree of freedom of one record.

    Parameters
    ----------
    record : str
    dof : int
    quantity : str
    time, measured, error : ndarray, shape (nk,)
    """

    record: str
    dof: int
    quantity: str
    time: FloatArray
    measured: FloatArray
    error: FloatArray


def errors_on(model: Model, actives: Sequence[Active], record: Record, start_at: float = -np.inf) -> list[Error]:
    """Predict a record from its start and return the errors from the time `start_at` [s] on.

    Of each degree of freedom the displacement counts; a velocity or acceleration only where there is none.
    """
    rollout, prepared, motion, p = run(model, record, tuple(actives), None)
    found = []
    for dof in range(model.n):
        channels = [c for q in QUANTITIES for c in prepared.channels if c.dof == dof and c.quantity == q]
        for channel in channels[:1]:
            value, _ = reading(rollout, motion, prepared.grid, channel, p)
            keep = channel.time >= start_at
            found.append(Error(record.name, dof, channel.quantity, channel.time[keep], channel.value[keep],
                               (channel.value - value)[keep]))
    return found


def pooled_gap(errors: Sequence[Error]) -> float:
    """Return the gap: rms error over rms measured, pooled over degrees of freedom each scaled by its own rms."""
    dofs = sorted({e.dof for e in errors})
    ratios = []
    for dof in dofs:
        top = np.concatenate([e.error for e in errors if e.dof == dof])
        bottom = np.concatenate([e.measured for e in errors if e.dof == dof])
        ratios.append(np.mean(top**2) / max(np.mean(bottom**2), 1e-300))
    return float(np.sqrt(np.mean(ratios)))


def noise_errors(errors: Sequence[Error], omega: Mapping[int, float]) -> list[Error]:
    """Return errors as large as the sensors' noise alone, estimated far above the motion's frequency omega[dof]."""
    found = []
    for e in errors:
        floor = floor_of(Channel(e.dof, e.quantity, e.time, e.measured), e.error, omega[e.dof])
        found.append(replace(e, error=np.full(e.error.size, min(floor, float(np.sqrt(np.mean(e.error**2)))))))
    return found


def shrinkage(before: float, after: float, noise: float) -> float:
    """Return 1 - (after^2 - noise^2) / (before^2 - noise^2); 0 where there was no gap above the noise."""
    room = before**2 - noise**2
    return 0.0 if room <= 0.1 * noise**2 else float(1.0 - (after**2 - noise**2) / room)


def shrinkage_interval(before: Sequence[Error], after: Sequence[Error], noise: Sequence[Error], block: float,
                       rng: np.random.Generator, draws: int = 400) -> tuple[float, float]:
    """Return a 95 % interval of the shrinkage by resampling blocks of time (bootstrap over blocks).

    Parameters
    ----------
    before, after, noise : sequences of Error
        On the same channels.
    block : float
        Length of a block [s], a few periods of the motion.
    """
    rows = []  # for each block: dof and sums of squares of before, after, noise, measured
    for b, a, n in zip(before, after, noise):
        index = ((b.time - b.time[0]) / block).astype(int)
        for k in np.unique(index):
            at = index == k
            rows.append([b.dof, *(float(np.sum(part[at] ** 2)) for part in (b.error, a.error, n.error, b.measured))])
    table = np.array(rows)
    values = []
    for _ in range(draws):
        pick = table[rng.integers(0, len(table), len(table))]
        totals = np.array([pick[pick[:, 0] == dof, 1:].sum(axis=0) for dof in np.unique(pick[:, 0])])
        gaps = np.sqrt(np.mean(totals[:, :3] / np.maximum(totals[:, 3:], 1e-300), axis=0))
        values.append(shrinkage(*map(float, gaps)))
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
