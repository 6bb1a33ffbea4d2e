"""The corrected model: the nominal numbers retuned within tolerance, and the effects found. corrected.json."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radiation_ss.body.model import Model
from radiation_ss.effects import Active, activate
from radiation_ss.effects.nominal import nominal_effects, tolerances
from radiation_ss.errors import InputError
from radiation_ss.methods import later

if TYPE_CHECKING:
    import control as ct

SCHEMA = "radiation_ss.corrected/1"


@dataclass(frozen=True)
class Corrected:
    """What a diagnosis adds to a model.

    Parameters
    ----------
    nominal : mapping of (name, dof) to float
        Relative deviations of the model's own numbers.
    effects : tuple of Active
    tolerance : mapping of str to float
        Tolerances that the deviations belong to.
    motion : mapping of dof to (float, float)
        Root mean square [m or rad] and typical circular frequency [rad/s] of the motion in the records: where a
        nonlinear effect is linearised.
    """

    nominal: Mapping[tuple[str, str], float]
    effects: tuple[Active, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)
    motion: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def actives(self, model: Model) -> tuple[Active, ...]:
        """Return everything to be simulated: retuned nominal numbers first, then effects."""
        found = []
        for own in nominal_effects(model, tolerances(self.tolerance), force=True):
            value = self.nominal.get((own.active.name, own.active.dof), 0.0)
            if value != 0.0:
                found.append(own.active.with_values([value]))
        return (*found, *self.effects)

    def model(self, model: Model, amplitude: Mapping[str, float] | float | None = None) -> Model:
        """Return the corrected model as a linear one with better coefficients; see `linearised.corrected_model`."""
        return later(self, "model", model, amplitude)

    def to_ss(self, model: Model, amplitude: Mapping[str, float] | float | None = None) -> ct.StateSpace:
        """Return the corrected model as ct.StateSpace; see `linearised.corrected_plant`."""
        return later(self, "to_ss", model, amplitude)

    def to_nlsys(self, model: Model) -> ct.NonlinearIOSystem:
        """Return the corrected model as ct.NonlinearIOSystem, effects as they are; see `native.corrected_system`."""
        return later(self, "to_nlsys", model)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of corrected.json."""
        return {"schema": SCHEMA, "tolerance": dict(self.tolerance),
                "motion": {dof: list(pair) for dof, pair in self.motion.items()},
                "nominal": [{"name": name, "dof": dof, "share": value} for (name, dof), value in self.nominal.items()],
                "effects": [{"name": a.name, "dof": a.dof, "other": a.other, "parameters": dict(a.values)}
                            for a in self.effects]}

    def write(self, path: str | Path) -> None:
        """Write corrected.json."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def read_corrected(path: str | Path, model: Model) -> Corrected:
    """Read corrected.json.

    Raises
    ------
    InputError
        If the file is not one, or its degrees of freedom are not the model's.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not a corrected.json of diagnose ({error})") from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: not a corrected.json of diagnose; its schema must be {SCHEMA}")
    try:
        nominal = {(row["name"], row["dof"]): float(row["share"]) for row in content["nominal"]}
        foreign = sorted({dof for _, dof in nominal} - set(model.dofs))
        if foreign:
            raise InputError(f"{path}: degree of freedom {foreign[0]!r} is not among the model's {list(model.dofs)}")
        motion = {dof: (float(rms), float(omega)) for dof, (rms, omega) in content.get("motion", {}).items()}
        return Corrected(nominal, activate(content["effects"], model.dofs), content["tolerance"], motion)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: field {error} is missing or of the wrong kind") from None
