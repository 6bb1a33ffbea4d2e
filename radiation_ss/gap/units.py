"""Whether a model and a record can be of the same body in the same units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.errors import InputError, SolverError
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.plant.model import Model
from radiation_ss.simulation.record import Record
from radiation_ss.simulation.run import simulate

FACTOR = 25.0  # between predicted and measured motion; degrees for radians are 57, millimetres 1000


def check_units(model: Model, records: Sequence[Record]) -> None:
    """Compare the size of each displacement with the model's motion under the record's force, from rest.

    A decay says nothing: a linear model is right at any size.

    Raises
    ------
    InputError
        If they differ by more than any missing effect explains.
    """
    for record in records:
        measured = {i: record.channels[dof] for i, dof in enumerate(model.dofs) if dof in record.channels}
        if record.kind in ("decay", "motion-only") or not measured:
            continue
        try:
            moved = simulate(model, record, start=np.zeros(model.fit.states + 2 * model.n)).outputs
        except SolverError:
            continue
        for i, values in measured.items():
            there = np.isfinite(values)
            size, predicted = float(np.std(values[there])), float(np.std(moved[i][there]))
            if predicted > 0.0 and not 1.0 / FACTOR < size / predicted < FACTOR:
                dof = model.dofs[i]
                raise InputError(f"record {record.name}: {dof} moves {size:.3g} {motion_unit(dof)} (rms) where the "
                                 f"model moves {predicted:.3g} under the recorded force, a factor of "
                                 f"{size / predicted:.3g}; check the units "
                                 f"({motion_unit(dof)}, {force_unit(dof)}) and that the record is of "
                                 "this body")
