"""Where the gap lies: records, degrees of freedom, bands, phase, amplitude."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import projected


@dataclass(frozen=True)
class Where:
    """Place of a gap.

    Parameters
    ----------
    records : mapping of record to float
        Relative equation error beyond the noise.
    dofs : mapping of degree of freedom to share
    bands : tuple of (low, high, share)
        Circular frequencies [rad/s], octaves that all records have in common.
    phase : str
        stiffness, damping, inertia, input, offset or mixed: what goes along with most of it.
    amplitude_dependent : bool
        Whether the part in phase grows otherwise than linearly with the motion.
    """

    records: Mapping[str, float] = field(default_factory=dict)
    dofs: Mapping[str, float] = field(default_factory=dict)
    bands: tuple[tuple[float, float, float], ...] = ()
    phase: str = "mixed"
    amplitude_dependent: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"records": dict(self.records), "dofs": dict(self.dofs), "bands": [list(b) for b in self.bands],
                "phase": self.phase, "amplitude_dependent": self.amplitude_dependent}


def where(problem: EquationError, effects: list[str]) -> Where:
    """Say where the nominal model's equation error is."""
    dofs = dict.fromkeys(problem.model.dofs, 0.0)
    records: dict[str, float] = {}
    edges = octaves(problem)
    bands = np.zeros(edges.size - 1)
    for place in problem.places:
        if place.order >= 0:
            continue
        run, rows = problem.runs[place.record], place.rows
        excess = np.maximum(problem.rows.error[rows] ** 2 - problem.rows.noise[rows], 0.0)
        own = np.sum(problem.rows.scale[rows] ** 2) / max(place.bins, 1)
        name = run.record.name
        records[name] = max(records.get(name, 0.0), float(np.sqrt(excess.sum() / max(own, 1e-300))))
        share = float(excess.sum() / max(own, 1e-300))
        dofs[problem.model.dofs[place.dof]] += share
        omega = np.concatenate([b.omega[: place.bins] for b in run.basis])
        bands += share * np.histogram(omega, edges, weights=excess)[0] / max(excess.sum(), 1e-300)
    total, wide = max(sum(dofs.values()), 1e-300), max(float(bands.sum()), 1e-300)
    phase = in_phase(problem, max(dofs, key=lambda d: dofs[d]))
    nonlinear = any(name.startswith(("quadratic", "cubic", "coulomb", "slack", "hysteresis", "bouc", "morison", "slam"))
                    for name in effects)
    told = tuple((float(a), float(b), float(v)) for a, b, v in zip(edges[:-1], edges[1:], bands / wide) if v > 0.0)
    return Where(records, {d: v / total for d, v in dofs.items()}, told, phase, nonlinear)


def octaves(problem: EquationError) -> FloatArray:
    """Return edges of the frequency bands of all records [rad/s]: octaves about the slowest motion's frequency."""
    slowest = min(scale.omega for scale in problem.scales.values())
    highest = max(float(block.omega[-1]) for run in problem.runs for block in run.basis)
    count = int(np.ceil(np.log2(max(highest / slowest, 1.0)) + 0.5)) + 1
    return np.concatenate([[0.0], slowest * 2.0 ** (np.arange(count) - 0.5)])


def in_phase(problem: EquationError, dof: str) -> str:
    """Return which signal goes along with most of the error of a degree of freedom."""
    i = problem.model.dofs.index(dof)
    error: list[FloatArray] = []
    table: dict[str, list[FloatArray]] = {k: [] for k in ("stiffness", "damping", "inertia", "input", "offset")}
    for place in problem.places:
        if place.dof != i or place.order >= 0:
            continue
        run = problem.runs[place.record]
        error.append(problem.rows.error[place.rows])
        force = run.force if run.force is not None and not run.prescribed else np.zeros_like(run.x)
        for name, values in zip(table, (run.x, run.v, run.a, force, np.ones_like(run.x))):
            table[name].append(projected(problem.model, run, place, values))
    if not error:
        return "mixed"
    e = np.concatenate(error)
    shares = {name: explained(e, np.concatenate(rows)) for name, rows in table.items()}
    best = max(shares, key=lambda name: shares[name])
    return best if shares[best] > 0.5 else "mixed"


def explained(error: FloatArray, column: FloatArray) -> float:
    """Return the share of an error that goes along with one column."""
    power = float(column @ column) * float(error @ error)
    return float((error @ column) ** 2 / power) if power > 0.0 else 0.0
