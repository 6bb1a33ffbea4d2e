"""Pictures of a diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.page import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.gap.answer.diagnosis import Diagnosis

UNITS = {"displacement": "", "velocity": "/s", "acceleration": "/s²"}


@style.look()
def overview(found: Diagnosis) -> Figure:
    """Draw one unseen record as measured and predicted, its error, and the ledger of gaps."""
    figure, axes = style.figure(2, 1, size=(7.6, 4.8), share_x=True)
    motion_panel(found, axes[0, 0], axes[1, 0])
    return figure


def motion_panel(found: Diagnosis, top: Axes, bottom: Axes) -> None:
    """Draw measured and predicted motion above, the errors below."""
    nominal, corrected = found.predictions["nominal"], found.predictions["corrected"]
    size = {e.dof: max(mean_square(o.measured) for o in nominal if o.dof == e.dof) for e in nominal}
    pick = int(np.argmax([mean_square(e.error) / max(size[e.dof], 1e-300) for e in nominal]))
    before, after = nominal[pick], corrected[pick]
    dof = list(found.where.dofs)[before.dof]
    unit = motion_unit(dof) + UNITS[before.quantity]
    top.plot(before.time, before.measured, color=style.BLACK, label="measured")
    top.plot(before.time, before.measured - before.error, color=style.VERMILION, label="model as given")
    top.plot(before.time, after.measured - after.error, "--", color=style.BLUE, label="corrected model")
    top.set_ylabel(f"{dof} {before.quantity if before.quantity != 'displacement' else ''} [{unit}]")
    top.set_title(f"{before.record}, unseen", loc="left")
    top.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.99), fontsize=8)
    bottom.plot(before.time, before.error, color=style.VERMILION)
    bottom.plot(after.time, after.error, color=style.BLUE)
    bottom.set_ylabel(f"error [{unit}]")
    bottom.set_xlabel("time [s]")


@style.look()
def missing(found: Diagnosis) -> Figure:
    """Draw the missing force where it is largest, over displacement and over velocity."""
    pick = max(found.missing, key=lambda m: mean_square(m.force))
    figure, axes = style.figure(1, 2, size=(7.2, 2.7))
    unit = motion_unit(pick.dof)
    colour = np.abs(pick.v), np.abs(pick.x)
    names = f"{pick.dof} [{unit}]", f"its velocity [{unit}/s]"
    for axis, signal, name, other in zip(axes[0], (pick.x, pick.v), names, colour):
        axis.scatter(signal, pick.force, c=other, s=4, cmap="viridis", linewidths=0)
        axis.axhline(0.0, color=style.GREY, linewidth=0.6)
        axis.set_xlabel(name)
    axes[0, 0].set_ylabel(f"missing force [{force_unit(pick.dof)}]")
    axes[0, 0].set_title(pick.record, loc="left")
    return figure


@style.look()
def ledger(found: Diagnosis) -> Figure:
    """Draw the gaps from the model as given to the noise floor."""
    figure, axes = style.figure(1, 1, size=(5.6, 2.2))
    h, a = found.how_far, axes[0, 0]
    names = ["as given", "retuned, no effect", "corrected", "noise"]
    values = np.array([h.gap_before, h.gap_retuned, h.gap_after, h.noise_floor]) * 100.0
    a.barh(names, values, color=[style.VERMILION, style.ORANGE, style.BLUE, style.GREY])
    for k, value in enumerate(values):
        a.text(value, k, f" {value:.2g} %", va="center")
    a.set_xlim(0.0, 1.15 * float(values.max()))
    a.invert_yaxis()
    a.set_xlabel(f"gap on {'unseen data' if h.on else 'the records of the fit'} [% of the motion's rms]")
    return figure


@style.look()
def candidates(found: Diagnosis) -> Figure:
    """Draw the log evidence of the candidates against the best."""
    rows = found.which[:8]
    figure, axes = style.figure(1, 1, size=(6.4, 0.6 + 0.32 * len(rows)))
    a = axes[0, 0]
    names = [" + ".join(f"{e.name} {e.dof}".strip() for e in c.effects) or "none" for c in rows]
    below = [max(-c.log_evidence, 0.0) for c in rows]
    a.barh(names, below, color=style.SKY)
    for k, (value, c) in enumerate(zip(below, rows)):
        place = "best" if value == 0.0 else number(value, 2)
        a.text(value, k, f" {place}, gap {c.gap_after:.2%}", va="center", fontsize=7)
    right = 20.0 * max(*below, 1.0)
    a.axvline(3.0, color=style.GREY, linewidth=0.6)
    a.set_xscale("symlog", linthresh=5.0)
    a.set_xticks([0.0, *(10.0 ** np.arange(1, np.ceil(np.log10(right))))])  # a one would touch the zero
    a.set_xlim(0.0, right)
    a.invert_yaxis()
    a.set_xlabel("worse than the best by [nats of log evidence]")
    return figure


@style.look()
def bands(found: Diagnosis) -> Figure:
    """Draw the shares of the retuned gap by frequency band, where there are any, and the gaps of the records."""
    known = bool(found.where.bands)
    figure, axes = style.figure(1, 1 + known, size=(3.8 + 3.4 * known, 2.3))
    if known:
        labels = [f"{number(a, 2)} to\n{number(b, 2)}" for a, b, _ in found.where.bands]
        axes[0, 0].bar(labels, [100.0 * s for _, _, s in found.where.bands], color=style.BLUE)
        axes[0, 0].set_xlabel("frequency band [rad/s]")
        axes[0, 0].set_ylabel("share of the gap [%]")
        axes[0, 0].tick_params(axis="x", labelsize=7)
    last = axes[0, -1]
    names = list(found.where.records)
    gaps = np.array([found.where.records[n] for n in names]) * 100.0
    at = np.arange(len(names))
    last.bar(at - 0.2, gaps[:, 0], 0.4, color=style.VERMILION, label="as given")
    last.bar(at + 0.2, gaps[:, 1], 0.4, color=style.ORANGE, label="retuned")
    last.set_xticks(at, names, rotation=20, fontsize=7)
    last.set_ylabel("gap [%]")
    last.legend()
    return figure
