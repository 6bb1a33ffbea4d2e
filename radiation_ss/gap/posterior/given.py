"""What of the records that are given says something of the gap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.effects import Effect
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.gap.posterior.noise import floor_of
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import suspicions
from radiation_ss.simulation.measured import measured_freely
from radiation_ss.simulation.prepare import QUANTITIES, Channel

FLAT = 0.7  # a channel is noise where its white noise is this much of its rms
ABOVE = 5.0  # times its noise: a decay ends where its motion is below that


def check_some(effects: Sequence[str | Effect] | None) -> None:
    """Refuse a library without effects, in which no name would ever be right.

    Raises
    ------
    InputError
    """
    if effects is not None and not len(effects):
        raise InputError("effects: an empty list; name at least one, or leave it out for the whole library")


def force_known(model: Model, record: Record) -> bool:
    """Whether a record's exciting force is known: recorded, zero, or from the elevation."""
    if record.kind == "motion-only":
        return False
    has_x = model.hydro is not None and model.hydro.X is not None
    return record.get("force", model.dofs) is not None or ("wave_elevation" in record.channels and has_x)


def usable(model: Model, records: Sequence[Record]) -> tuple[list[Record], tuple[str, ...]]:
    """Return the records that hold motion, and notes on what looks wrong with them.

    Raises
    ------
    InputError
        If every record is noise.
    """
    kept, notes = [], tuple(text for record in records for text in suspicions(record))
    for raw in records:
        record, said = measured_freely(model, raw)
        notes += said
        measured = [(i, dof) for i, dof in enumerate(model.dofs) if any(
            record.get(quantity, [dof]) is not None for quantity in QUANTITIES)]
        if measured and all(noise_only(model, record, i, dof) for i, dof in measured):
            notes += (f"Record {record.name} holds only noise and is left out.",)
        else:
            kept.append(record)
    if not kept:
        raise InputError(f"record {records[0].name}: only noise is measured (flat spectrum); nothing to diagnose")
    return kept, notes


def noise_only(model: Model, record: Record, i: int, dof: str) -> bool:
    """Whether no channel of a degree of freedom stands out of its own noise."""
    for quantity in QUANTITIES:
        values = record.get(quantity, [dof])
        if values is None:
            continue
        there = np.isfinite(values[0])
        time, x = record.time[there], values[0][there]
        if x.size < 64 or floor_of(Channel(i, quantity, time, x), x, natural_frequency(model, i)) < FLAT * np.std(x):
            return False
    return True


def alive(model: Model, record: Record) -> Record:
    """Return a decay up to where its motion sinks into the noise: what comes after shows nothing."""
    values = record.get("displacement", model.dofs)
    if record.kind != "decay" or values is None:
        return record
    end = record.time[0]
    for i in range(model.n):
        there = np.isfinite(values[i])
        if there.sum() < 64:
            return record
        time, x = record.time[there], values[i][there] - np.nanmean(values[i][there][-int(there.sum()) // 5:])
        noise = floor_of(Channel(i, "displacement", time, x), x, natural_frequency(model, i))
        loud = np.flatnonzero(np.abs(x) > ABOVE * noise)
        end = max(end, time[loud[-1]] if loud.size else end)
    return record.window(-np.inf, end) if end > record.time[0] + 0.2 * np.ptp(record.time) else record
