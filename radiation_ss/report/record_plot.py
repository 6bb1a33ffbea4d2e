"""The picture of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from radiation_ss.records.printed import unit_of
from radiation_ss.style import figure, literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.records.record import Record


def plot_record(record: Record, most: int = 2000) -> Figure:
    """Draw the channels over time, a row a unit; of more than `most` samples every so many."""
    rows: dict[str, list[str]] = {}
    for name in record.channels:
        rows.setdefault(unit_of(name), []).append(name)
    drawing, axes = figure(max(len(rows), 1), 1, size=(7.4, 1.7 * max(len(rows), 1) + 0.4), share_x=True)
    every = max(1, record.time.size // most)
    for axis, (unit, names) in zip(axes[:, 0], rows.items()):
        for name in names:
            axis.plot(record.time[::every], record.channels[name][::every], lw=0.9, label=literal(name))
        axis.set(ylabel=f"[{unit}]" if unit else "")
        axis.legend(loc="upper right", fontsize=7)
    axes[-1, 0].set(xlabel="time [s]")
    return drawing
