"""corrected.json read, and records predicted with it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.effects import activate
from radiation_ss.effects.nominal import nominal_effects, tolerances
from radiation_ss.errors import InputError
from radiation_ss.reading import listed, named_numbers, number, read_json, text
from radiation_ss.records.columns import RATES
from radiation_ss.records.faults import drives
from radiation_ss.records.record import Record
from radiation_ss.simulation.corrected import SCHEMA, Corrected
from radiation_ss.simulation.driven import prescribed_force
from radiation_ss.simulation.run import simulate


def read_corrected(path: str | Path, model: Model) -> Corrected:
    """Read corrected.json; InputError if it is of another body, or for nominal numbers that the model does not have."""
    def pairs(content: dict[str, Any], name: str) -> dict[str, tuple[float, float]]:
        return {dof: (number(listed(pair, name)[0], name), number(pair[1], name))
                for dof, pair in content.get(name, {}).items()}

    def build(content: dict[str, Any]) -> Corrected:
        Corrected({}, (), body=pairs(content, "body")).check_body(model)
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
        return Corrected(nominal, activate(effects, model.dofs), tolerance, pairs(content, "motion"),
                         pairs(content, "body"))

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
        channels |= {name: values for name, values in record.channels.items() if drives(name)}
    return replace(record, channels=channels, meta={**record.meta, "source": "predicted"})
