"""Where a record's waves go to: the direction of X that makes its force."""

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.records.csv_files import number_in
from radiation_ss.records.record import Record
from radiation_ss.waves.force import transfer


def heading(model: Model, record: Record, alike: float = 0.01) -> float:
    """Return the direction [rad] that the record's waves go to.

    That of its comment `# heading: 90` [deg]; else the only one of X, or the first of several whose forces differ by
    less than the share `alike` of the largest. InputError if X depends on a direction that the record does not state.
    """
    known = model.hydro
    stated = record.meta.get("heading")
    if stated is not None:
        degrees = number_in(str(stated), "deg")
        if not np.isfinite(degrees):
            raise InputError(f"record {record.name}: comment 'heading': {stated!r} is no direction in degrees")
        return float(np.radians(degrees))
    if known is None or known.X is None or known.directions is None:
        return 0.0
    if directional(model, alike):
        raise InputError(f"record {record.name}: X of the model is for waves to "
                         f"{', '.join(f'{np.degrees(v):.4g}' for v in known.directions)} deg; say where the record's "
                         "waves go to, by the comment `# heading: 90` (meta={'heading': '90'})")
    return float(known.directions[0])


def directional(model: Model, alike: float = 0.01) -> bool:
    """Whether X of a model differs with the direction by more than the share `alike` of the largest."""
    X = None if model.hydro is None else model.hydro.X
    if X is None:
        return False
    return bool(np.any(np.abs(X - X[:, :1]).max(axis=(0, 1)) > alike * np.abs(X).max(axis=(0, 1))))


def computed(model: Model, record: Record) -> bool:
    """Whether a record's force is some X times the waves, as no test measures it, in a column or not."""
    known = model.hydro is not None and model.hydro.X is not None
    return record.kind == "waves" and (known or "wave_elevation" in record.channels)


def force_of_waves(model: Model, record: Record) -> ComplexArray:
    """Return X (nw, n) of the direction that the record's waves go to; InputError if the body is under way."""
    known = model.hydro
    assert known is not None and known.X is not None
    if record.speed != 0.0:
        raise InputError(f"record {record.name}: speed {record.speed:g} m/s, but X makes the force of waves on a body "
                         "at rest, and one under way meets them at another frequency (encounter_frequency); give the "
                         "force in columns <Dof>_force [N, N m]")
    if known.X.shape[1] == 1 and "heading" not in record.meta:
        return known.X[:, 0]
    return transfer(known, known.omega, heading(model, record))


def along_waves(model: Model, records: Sequence[Record]) -> Model:
    """Return the model with X of the one direction that the waves of all records go to."""
    known = model.hydro
    if known is None or known.X is None or not records:
        return model
    found = {round(heading(model, record), 6): record for record in records}
    if len(found) > 1:
        names, ways = ", ".join(r.name for r in found.values()), ", ".join(f"{np.degrees(v):.4g}" for v in found)
        raise InputError(f"records {names}: their waves go to different directions, {ways} deg; identify from one at a "
                         "time")
    first = next(iter(found.values()))
    X = force_of_waves(model, first)[:, None]
    return model.replace(hydro=known.replace(X=X, directions=[heading(model, first)]))
