"""The corrected model: the nominal numbers retuned within tolerance, and the effects found. corrected.json."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.atomic import write_whole
from radiation_ss.body.model import Model
from radiation_ss.effects import Active, activate
from radiation_ss.effects.nominal import nominal_effects, tolerances
from radiation_ss.errors import InputError
from radiation_ss.methods import Brief, later
from radiation_ss.reading import listed, named_numbers, number, read_json, text
from radiation_ss.records.columns import RATES
from radiation_ss.records.record import Record
from radiation_ss.simulation.driven import prescribed_force
from radiation_ss.simulation.run import simulate

if TYPE_CHECKING:
    import control as ct

SCHEMA = "radiation_ss.corrected/1"


@dataclass(frozen=True, repr=False)
class Corrected(Brief):
    """What a diagnosis adds to a model."""

    nominal: Mapping[tuple[str, str], float]  # By (name, dof): relative deviations of the model's own numbers
    effects: tuple[Active, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)  # That the deviations belong to
    # By dof: rms [m or rad] and typical frequency [rad/s] in the records, where a nonlinear effect is linearised
    motion: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [f"  {active.name} on {active.dof}: " + ", ".join(
            f"{name} {value:.4g}" for name, value in active.values.items())
            for active in self.effects]
        own = [f"  {name} of {dof} {value:+.2%}" for (name, dof), value in self.nominal.items()]
        return "\n".join(["Corrected: what a diagnosis adds to a model", *parts, *own])

    def actives(self, model: Model) -> tuple[Active, ...]:
        """Return everything to be simulated: retuned nominal numbers first, then effects."""
        own = [number.active for number in nominal_effects(model, tolerances(self.tolerance), force=True)]
        return (*(active.with_values([value]) for active in own
                  if (value := self.nominal.get((active.name, active.dof)))), *self.effects)

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
        write_whole(path, json.dumps(self.to_dict(), indent=1) + "\n")


def read_corrected(path: str | Path, model: Model) -> Corrected:
    """Read corrected.json; InputError for degrees of freedom or nominal numbers that the model does not have."""
    def build(content: dict[str, Any]) -> Corrected:
        tolerance = named_numbers(content["tolerance"], "tolerance")
        known = {(own.active.name, own.active.dof) for own in nominal_effects(model, tolerances(tolerance), force=True)}
        nominal: dict[tuple[str, str], float] = {}
        for row in listed(content["nominal"], "nominal"):
            name, dof, share = text(row["name"], "name"), text(row["dof"], "dof"), number(row["share"], "share")
            if (name, dof) in nominal:
                raise InputError(f"nominal number {name!r} of {dof!r} stands there twice")
            if share != 0.0 and (name, dof) not in known:
                raise InputError(f"nominal number {name!r} of {dof!r}: the model (degrees of freedom "
                                 f"{list(model.dofs)}, radiation of {model.fit.states} states) has none of that name; "
                                 "it must be the diagnosed one, with the same fit of its radiation")
            nominal[name, dof] = share
        effects = [{"name": text(row["name"], "name"), "dof": row.get("dof"), "other": row.get("other"),
                    "parameters": named_numbers(row.get("parameters", {}), "parameters")}
                   for row in listed(content["effects"], "effects")]
        motion = {dof: (number(listed(pair, "motion")[0], "motion"), number(pair[1], "motion"))
                  for dof, pair in content.get("motion", {}).items()}
        return Corrected(nominal, activate(effects, model.dofs), tolerance, motion)

    return read_json(path, "corrected.json of diagnose", build, SCHEMA)


def predict_record(model: Model, record: Record, corrected: str | Path | None = None) -> Record:
    """Return what the model, or the one of corrected.json, predicts for a record: motion, or force if prescribed."""
    actives = () if corrected is None else read_corrected(corrected, model).actives(model)
    if record.kind == "prescribed":
        force = prescribed_force(model, record, actives).outputs
        channels = {**record.channels, **{f"{dof}_force": row for dof, row in zip(model.dofs, np.asarray(force))}}
    else:
        names = (dof + suffix for suffix in RATES for dof in model.dofs)
        channels = {name: row for name, row in zip(names, simulate(model, record, actives).outputs)
                    if name in model.dofs or name in record.channels}
        channels |= {name: values for name, values in record.channels.items()
                     if name.endswith("_force") or name == "wave_elevation"}
    return replace(record, channels=channels, meta={**record.meta, "source": "predicted"})
