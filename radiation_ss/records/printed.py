"""A record in ten lines, as text and as a page's fragment with its picture."""

from __future__ import annotations

import io
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.records.columns import channel_unit
from radiation_ss.style import figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.records.record import Record

MOST_CHANNELS = 8
MOST_POINTS = 2000


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


def html(record: Record) -> str:
    """Return the text with the picture below it, for a notebook."""
    from matplotlib import pyplot as plt

    picture, file = plot_record(record), io.StringIO()
    picture.savefig(file, format="svg")
    plt.close(picture)
    drawing = file.getvalue()
    return f"<pre>{escape(text(record))}</pre>{drawing[drawing.index('<svg'):]}"


def plot_record(record: Record) -> Figure:
    """Draw the channels over time, a row a unit; of many samples every so many."""
    rows: dict[str, list[str]] = {}
    for name in record.channels:
        rows.setdefault(unit_of(name), []).append(name)
    drawing, axes = figure(max(len(rows), 1), 1, size=(7.4, 1.7 * max(len(rows), 1) + 0.4), share_x=True)
    every = max(1, record.time.size // MOST_POINTS)
    for axis, (unit, names) in zip(axes[:, 0], rows.items()):
        for name in names:
            axis.plot(record.time[::every], record.channels[name][::every], lw=0.9, label=name.replace("$", r"\$"))
        axis.set(ylabel=f"[{unit}]" if unit else "")
        axis.legend(loc="upper right", fontsize=7)
    axes[-1, 0].set(xlabel="time [s]")
    return drawing
