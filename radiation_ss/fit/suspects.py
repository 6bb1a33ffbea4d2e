"""Samples that a passive body cannot have, or that stand apart from their neighbours: listed, and weighted down."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.problem import scales
from radiation_ss.hydro.data import HydroData

REACH, SPIKE, FLOOR = 4, 6.0, 0.02
NEGATIVE, TOLERATED = 1e-3, 0.03
WEIGHT, FEW = 0.03, 0.2


@dataclass(frozen=True)
class Suspect:
    """One sample that was weighted down.

    Parameters
    ----------
    kind : str
        "spike" (irregular frequency, reading error) or "negative damping".
    force, velocity : str
        Degrees of freedom of the entry.
    omega : float
        Frequency [rad/s].
    size : float
        Distance from the neighbours, or the negative damping, relative to the largest |K| of the entry's rows.
    """

    kind: str
    force: str
    velocity: str
    omega: float
    size: float

    def __str__(self) -> str:
        return f"{self.kind} of {self.force}, {self.velocity} at {self.omega:.4g} rad/s ({self.size:.1%})"


def suspects_of(data: HydroData) -> tuple[Suspect, ...]:
    """Return the suspicious samples of B and w (A - A_inf).

    A spike is a sample that lies `SPIKE` robust standard deviations, and `FLOOR` of the largest value, off the line
    through its two neighbours (Hampel's test over `REACH` neighbours on each side, so that slopes and peaks pass).
    Negative damping is B_ii below -`NEGATIVE` of its maximum.
    """
    pairs = np.outer(scales(data), scales(data))
    found = []
    for i, j in combinations_with_replacement(range(data.n), 2):
        for part in (data.K[:, i, j].real, data.K[:, i, j].imag):
            apart = _spikes(data.omega, part / pairs[i, j])
            found += [Suspect("spike", data.dofs[i], data.dofs[j], float(data.omega[k]), float(apart[k]))
                      for k in np.flatnonzero(apart)]
    for i in range(data.n):
        damping = data.B[:, i, i] / pairs[i, i]
        found += [Suspect("negative damping", data.dofs[i], data.dofs[i], float(data.omega[k]), float(-damping[k]))
                  for k in np.flatnonzero(damping < -NEGATIVE)]
    unique = {(s.kind, s.force, s.velocity, s.omega): s for s in sorted(found, key=lambda s: s.size)}
    return tuple(sorted(unique.values(), key=lambda s: (s.omega, s.force, s.velocity)))


def weights_of(data: HydroData, suspects: tuple[Suspect, ...]) -> FloatArray:
    """Return weights of the squared misfits, shape (nw, n, n): 1, and `WEIGHT` for spikes.

    Negative damping of size z has 1 / (1 + (z / `TOLERATED`)^2): what is round-off keeps its say in the added mass.
    Where more than `FEW` of an entry's samples are suspicious they are no outliers but the data, and count in full.
    """
    weight = np.ones(data.B.shape)
    at = {omega: k for k, omega in enumerate(data.omega.tolist())}
    counts = Counter((suspect.force, suspect.velocity) for suspect in suspects)
    for suspect in suspects:
        if counts[suspect.force, suspect.velocity] > FEW * data.omega.size:
            continue
        i, j = data.dofs.index(suspect.force), data.dofs.index(suspect.velocity)
        share = WEIGHT if suspect.kind == "spike" else max(WEIGHT, 1.0 / (1.0 + (suspect.size / TOLERATED) ** 2))
        k = at[suspect.omega]
        weight[k, [i, j], [j, i]] = min(share, float(weight[k, i, j]))
    return weight


def _spikes(omega: FloatArray, values: FloatArray) -> FloatArray:
    """Return how far each sample lies off the line through its neighbours where that is a spike, else 0."""
    if values.size < 2 * REACH + 1:
        return np.zeros(values.size)
    off = np.zeros(values.size)
    share = (omega[1:-1] - omega[:-2]) / (omega[2:] - omega[:-2])
    off[1:-1] = values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))
    padded = np.pad(off, REACH, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1)
    deviation = 1.4826 * np.median(np.abs(windows - np.median(windows, axis=1, keepdims=True)), axis=1)
    largest = np.abs(windows).argmax(axis=1) == REACH
    # The line through the neighbours of a spike is off by half the spike on both sides: keep the largest only.
    return np.where(largest & (np.abs(off) > SPIKE * deviation) & (np.abs(off) > FLOOR), np.abs(off), 0.0)
