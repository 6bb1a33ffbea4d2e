"""Pictures of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.diagnosis.prediction import Error, energy
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import force_unit, motion_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.diagnosis.result import Diagnosis

UNITS = {"displacement": "", "velocity": "/s", "acceleration": "/s²"}
FIXED = {"recalibration": style.GREEN, "offset": style.SKY, "unexplained": style.BLACK, "noise": style.GREY}
EFFECTS = (style.BLUE, style.VERMILION, style.ORANGE, style.PURPLE, style.YELLOW)


@style.look()
def overview(found: Diagnosis) -> Figure:
    """Draw the budget, one unseen record as measured and predicted, and its error.

    Raises
    ------
    InputError
        If no unseen record can be predicted.
    """
    if not found.predictions:
        raise InputError("no record with a known force is left to be predicted, so there is nothing to draw")
    bars = len(found.budget.by_record)
    figure, axes = style.figure(3, 1, size=(7.6, 4.6 + 0.32 * bars))
    stacked(found, axes[0, 0])
    motion(found, axes[1, 0], axes[2, 0])
    return figure


@style.look()
def budget_picture(found: Diagnosis) -> Figure:
    """Draw one stacked bar for each unseen record and degree of freedom."""
    figure, axes = style.figure(1, 1, size=(7.6, 1.2 + 0.36 * len(found.budget.by_record)))
    stacked(found, axes[0, 0])
    return figure


@style.look()
def motion_picture(found: Diagnosis) -> Figure:
    """Draw one unseen record as measured and predicted, and its error."""
    figure, axes = style.figure(2, 1, size=(7.6, 4.2), share_x=True)
    motion(found, axes[0, 0], axes[1, 0])
    return figure


def stacked(found: Diagnosis, axis: Axes) -> None:
    """Draw the budget's bars; what makes the gap larger stands left of zero."""
    causes = [style.literal(f"{row.cause} {row.dof}".strip()) for row in found.budget.rows]
    effects = [c for c in causes if c not in FIXED]
    colour = FIXED | {c: EFFECTS[k % len(EFFECTS)] for k, c in enumerate(effects)}
    names = [style.literal(f"{record}, {dof}") for record, dof in found.budget.by_record]
    right, left = np.zeros(len(names)), np.zeros(len(names))
    for cause in causes:
        values = np.array([100.0 * shares.get(cause, 0.0) for shares in found.budget.by_record.values()])
        start = np.where(values >= 0.0, right, left)
        axis.barh(range(len(names)), values, left=start, color=colour[cause], label=cause.replace("_", " "), height=0.6)
        right, left = right + np.maximum(values, 0.0), left + np.minimum(values, 0.0)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xlabel("share of the gap's energy on unseen data [%]")
    axis.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=7)


def motion(found: Diagnosis, top: Axes, bottom: Axes) -> None:
    """Draw the measured and predicted signal with the largest gap above, the errors below."""
    given, corrected = found.predictions["given"], found.predictions["corrected"]
    pick = int(np.argmax(energy(given)))
    before, after = given[pick], corrected[pick]
    dof = found.dofs[before.dof]
    unit = force_unit(dof) if before.quantity == "force" else motion_unit(dof) + UNITS[before.quantity]
    top.plot(before.time, before.measured, color=style.BLACK, label="measured")
    top.plot(before.time, before.measured - before.error, color=style.VERMILION, label="model as given")
    top.plot(after.time, after.measured - after.error, "--", color=style.BLUE, label="corrected model")
    top.set_ylabel(f"{style.literal(dof)} {'' if before.quantity == 'displacement' else before.quantity} [{unit}]")
    top.set_title(style.literal(f"{before.record}, unseen"), loc="left")
    top.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.99), fontsize=8)
    errors(before, after, bottom, unit)


def errors(before: Error, after: Error, axis: Axes, unit: str) -> None:
    """Draw errors before and after."""
    axis.plot(before.time, before.error, color=style.VERMILION)
    axis.plot(after.time, after.error, color=style.BLUE)
    axis.set_ylabel(f"error [{unit}]")
    axis.set_xlabel("time [s]")


@style.look()
def ledger(found: Diagnosis) -> Figure:
    """Draw the gaps from the model as given to the noise."""
    figure, axes = style.figure(1, 1, size=(5.6, 2.2))
    h = found.how_far
    bars(axes[0, 0], ["as given", "recalibrated, no effect", "corrected", "noise"],
         100.0 * np.array([h.gap_before, h.gap_retuned, h.gap_after, h.noise_floor]))
    axes[0, 0].set_xlabel("gap on unseen data [% of the motion's rms]; shorter is better")
    return figure


def bars(axis: Axes, names: Sequence[str], values: np.ndarray) -> None:
    """Draw horizontal bars with their numbers."""
    axis.barh(names, values, color=[style.VERMILION, style.ORANGE, style.BLUE, style.GREY])
    for k, value in enumerate(values):
        axis.text(value, k, f" {value:.2g} %", va="center")
    axis.set_xlim(0.0, 1.15 * max(float(np.nan_to_num(values).max()), 1e-9))
    axis.invert_yaxis()
