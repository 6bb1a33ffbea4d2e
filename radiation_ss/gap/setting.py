"""What stays the same through a diagnosis: model, prepared records, tolerances, typical sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.plant.model import Model
from radiation_ss.simulation.effects import Active, Effect, Scales, library, prior_scale
from radiation_ss.simulation.effects.nominal import nominal_effects
from radiation_ss.simulation.prepare import Prepared, prepare, step_size
from radiation_ss.simulation.record import Record
from radiation_ss.simulation.start import Start, motion_size, start_of


@dataclass(frozen=True, eq=False)
class Term:
    """An effect as a term of a fit: where its parameters start, how far the prior lets them go.

    Parameters
    ----------
    active : Active
        With strengths 0 and shapes at their start.
    spread : tuple of float
        Prior standard deviation of each parameter; 0 for one that is not fitted.
    alternatives : int
        Number of starts that the shape was chosen from.
    """

    active: Active
    spread: tuple[float, ...]
    alternatives: int = 1

    @property
    def key(self) -> tuple[str, str, str]:
        """What names the term apart from its start."""
        return self.active.name, self.active.dof, self.active.other

    @property
    def signs(self) -> tuple[int, ...]:
        """Sign limit of each parameter."""
        return tuple(p.sign for p in self.active.effect.parameters.values())

    @property
    def free(self) -> list[int]:
        """Positions of the fitted parameters."""
        return [k for k, spread in enumerate(self.spread) if spread > 0.0]

    @property
    def strengths(self) -> list[int]:
        """Positions of the parameters with which the effect vanishes."""
        return [k for k, p in enumerate(self.active.effect.parameters.values()) if p.strength]


@dataclass(frozen=True, eq=False)
class Setting:
    """Everything that the fits share.

    Parameters
    ----------
    model : Model
    records : tuple of Prepared
    starts : tuple of Start
    nominal : tuple of Term
        The model's own numbers within tolerance.
    scales : mapping of dof to Scales
    h : float
        Integrator step [s].
    """

    model: Model
    records: tuple[Prepared, ...]
    starts: tuple[Start, ...]
    nominal: tuple[Term, ...]
    scales: Mapping[str, Scales]
    h: float

    @property
    def forced(self) -> bool:
        """Whether any record has a known exciting force that is not zero."""
        return any(record.forced for record in self.records)


def setting_of(model: Model, records: Sequence[Record], tolerance: Mapping[str, float]) -> Setting:
    """Prepare records with known force (or none acting) for fitting."""
    h = step_size(model, list(records))
    prepared = tuple(prepare(model, record, h) for record in records)
    for item in prepared:
        if item.force is None:
            raise InputError(f"record {item.record.name}: the exciting force is unknown; use it as motion-only")
    forced = any(item.forced for item in prepared)
    nominal = tuple(Term(active, (spread,)) for active, spread in nominal_effects(model, tolerance, force=forced))
    return Setting(model, prepared, tuple(start_of(model, item) for item in prepared), nominal,
                   {dof: scales_of(model, prepared, i) for i, dof in enumerate(model.dofs)}, h)


def scales_of(model: Model, records: Sequence[Prepared], i: int) -> Scales:
    """Return typical sizes of one degree of freedom over the records."""
    sizes = [motion_size(model, record, i) for record in records]
    x = float(np.sqrt(np.mean([size**2 for size, _ in sizes])))
    omega = float(np.mean([omega for _, omega in sizes]))
    u = [np.sqrt(np.mean(r.force[i](r.grid[r.grid <= r.force[i].x[-1]]) ** 2)) for r in records if r.force is not None]
    duration = float(np.mean([r.grid[-1] - r.grid[0] for r in records]))
    inertia = model.M[i, i] + model.A_inf[i, i]
    force = max(model.C[i, i], inertia * omega**2) * x
    return Scales(x, omega * x, omega**2 * x, float(np.sqrt(np.mean(np.square(u)))) if u else 0.0, float(force), omega,
                  duration)


def terms_of(setting: Setting, effects: Sequence[Effect] | None = None) -> list[Term]:
    """Return every effect on every place it can act and from every start of its shape."""
    dofs = setting.model.dofs
    found = []
    for effect in library().values() if effects is None else effects:
        if effect.needs == "force" and not setting.forced:
            continue
        places = {"dof": [(d, "") for d in dofs], "body": [("", "")],
                  "pair": [(a, b) for a in dofs for b in dofs if a != b]}[effect.scope]
        if effect.scope == "pair" and effect.force is not None:
            places = [(a, b) for a, b in places if dofs.index(a) < dofs.index(b)]  # reciprocal
        for dof, other in places:
            found += shapes_of(effect, dof, other, setting.scales[dof or dofs[0]])
    return found


def shapes_of(effect: Effect, dof: str, other: str, scales: Scales) -> list[Term]:
    """Return one term for each combination of starts of the shape parameters."""
    grids = [list(p.starts(scales)) if p.starts is not None else [0.0] for p in effect.parameters.values()]
    combinations = np.stack([g.ravel() for g in np.meshgrid(*grids, indexing="ij")], axis=1)
    spreads = tuple(0.0 if p.fixed else prior_scale(effect, name, scales) for name, p in effect.parameters.items())
    return [Term(Active(effect, dof, dict(zip(effect.parameters, map(float, values))), other), spreads,
                 len(combinations)) for values in combinations]
