"""A record in ten lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.records.columns import channel_unit

if TYPE_CHECKING:
    from radiation_ss.records.record import Record

MOST_CHANNELS = 8


def text(record: Record) -> str:
    """Return the record in ten lines at most: what it is, and the range of each channel."""
    steps = np.diff(record.time)
    speed = f", speed {record.speed:g} m/s" if record.speed else ""
    name = " ".join(record.name.split())[:60]
    lines = [f"Record {name}: {record.kind}{speed}; {record.time.size} samples from {record.time[0]:.6g} to "
             f"{record.time[-1]:.6g} s, every {np.median(steps):.4g} s"]
    names = list(record.channels)
    for name in names[:MOST_CHANNELS]:
        values = record.channels[name]
        there = values[np.isfinite(values)]
        span = f"{there.min():.4g} to {there.max():.4g} {unit_of(name)}" if there.size else "no samples"
        missing = f", {values.size - there.size} missing" if there.size < values.size else ""
        lines.append(f"  {name[:60]}  {span}{missing}")
    if len(names) > MOST_CHANNELS:
        lines.append(f"  and {len(names) - MOST_CHANNELS} more: {', '.join(names[MOST_CHANNELS:])[:80]}")
    return "\n".join(lines)


def unit_of(channel: str) -> str:
    """Return the unit of a channel, nothing where its name is none that a file may hold."""
    try:
        return channel_unit(channel)
    except InputError:
        return ""
