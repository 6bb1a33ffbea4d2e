"""Where the gap lies: records, degrees of freedom, bands, phase, amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.gap.posterior.setting import Setting
from radiation_ss.gap.which.search import Search
from radiation_ss.simulation.prepare import Channel

EDGES = (0.0, 0.5, 1.5, 2.5, 3.5)  # bands in multiples of the typical frequency
PHASES = ("stiffness", "damping", "inertia", "input", "sensor", "offset")


@dataclass(frozen=True)
class Where:
    """Shares of the gap after retuning within tolerance.

    Parameters
    ----------
    records : mapping of name to (gap nominal, gap retuned, noise)
    dofs : mapping of dof to share of the residual energy above the noise
    bands : list of (from, to, share) [rad/s]
    phase : str
        stiffness, damping, inertia, input, sensor, offset or mixed.
    amplitude_dependent : bool
    pulls : mapping of nominal number to its move in tolerances
    """

    records: dict[str, tuple[float, float, float]]
    dofs: dict[str, float]
    bands: list[tuple[float, float, float]]
    phase: str
    amplitude_dependent: bool
    pulls: dict[str, float] = field(default_factory=dict)


def locate(setting: Setting, found: Search) -> Where:
    """Resolve the residual of the fit without effects."""
    channels = [(k, c) for k, item in enumerate(setting.records) for c in item.channels]
    nominal, null = found.nominal.point.residuals, found.null.point.residuals
    records = {}
    for k, item in enumerate(setting.records):
        mine = [j for j, (r, _) in enumerate(channels) if r == k]
        measured = [channels[j][1].value for j in mine]
        noise = [np.full(m.size, found.floors[j]) for j, m in zip(mine, measured)]
        records[item.record.name] = (relative([nominal[j] for j in mine], measured),
                                     relative([null[j] for j in mine], measured), relative(noise, measured))
    energy = np.zeros(setting.model.n)
    bands: dict[tuple[float, float], float] = {}
    for j, (_, channel) in enumerate(channels):
        size = max(float(np.mean(channel.value**2)), 1e-300)
        energy[channel.dof] += max(float(np.mean(null[j] ** 2)) - found.floors[j] ** 2, 0.0) / size
        for band, value in band_energy(channel, null[j], reference(setting)).items():
            bands[band] = bands.get(band, 0.0) + value / size
    share = energy / energy.sum() if energy.sum() > 0.0 else np.full(energy.size, 1.0 / energy.size)
    total = sum(bands.values()) or 1.0
    return Where(records, dict(zip(setting.model.dofs, map(float, share))),
                 [(a, b, value / total) for (a, b), value in sorted(bands.items())], phase_of(found),
                 amplitude_dependent(found), found.null.pulls)


def relative(errors: Sequence[FloatArray], measured: Sequence[FloatArray]) -> float:
    """Return the pooled ratio of root mean squares."""
    return float(np.sqrt(np.mean([mean_square(e) / max(mean_square(m), 1e-300) for e, m in zip(errors, measured)])))


def reference(setting: Setting) -> float:
    """Return one typical frequency for the bands [rad/s]."""
    return float(np.mean([scales.omega for scales in setting.scales.values()]))


def band_energy(channel: Channel, residual: FloatArray, omega: float) -> dict[tuple[float, float], float]:
    """Return the residual's mean square in each band."""
    dt = float(np.median(np.diff(channel.time)))
    power = np.abs(np.fft.rfft(residual)) ** 2 / residual.size**2
    power[1:] *= 2.0
    at = 2.0 * np.pi * np.fft.rfftfreq(residual.size, dt)
    edges = [edge * omega for edge in EDGES if edge * omega < np.pi / dt] + [np.pi / dt]
    return {(low, high): float(power[(at >= low) & (at < high)].sum()) for low, high in pairwise(edges)}


def phase_of(found: Search) -> str:
    """Return the family of effects that explains most of the residual; mixed where two families explain alike."""
    gains: dict[str, float] = {}
    for candidate in found.candidates:
        if len(candidate.terms) == 1:
            family = candidate.terms[0].active.effect.family
            gains[family] = max(gains.get(family, -np.inf), candidate.evidence)
    ordered = sorted(gains, key=lambda name: -gains[name])
    clear = len(ordered) == 1 or (len(ordered) > 1 and gains[ordered[0]] > gains[ordered[1]] + 3.0)
    return ordered[0] if ordered and clear and ordered[0] in PHASES else "mixed"


def amplitude_dependent(found: Search) -> bool:
    """Whether an effect that is not linear explains the residual better than every linear one."""
    best = {True: -np.inf, False: -np.inf}
    for candidate in found.candidates:
        linear = all(t.active.effect.linear or t.active.effect.family in ("offset", "sensor") for t in candidate.terms)
        best[linear] = max(best[linear], candidate.evidence)
    return bool(best[False] > best[True] + 3.0)
