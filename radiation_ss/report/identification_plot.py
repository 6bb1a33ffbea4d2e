"""Pictures of an identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.hydro.data import force_unit, motion_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.identification.result import ForceEstimate, Identification


def coefficients(result: Identification) -> Figure:
    """Return a figure: B, A and the information shares, one row for each degree of freedom."""
    n, w = len(result.dofs), result.omega
    power = np.asarray(result.information.get("power", np.ones(w.size)), dtype=bool)
    figure, axes = style.figure(n, 3, size=(10.5, 2.7 * n + 0.3), share_x=True)
    for j, dof in enumerate(result.dofs):
        unit = "kg" if motion_unit(dof) == "m" else "kg m²"
        for column, (name, band, text) in enumerate((("B", result.B, f"damping B [{unit}/s]"),
                                                     ("A", result.A, f"added mass A [{unit}]"))):
            ax = axes[j, column]
            lower, upper, mean = (np.where(power, values[:, j, j], np.nan)
                                  for values in (band.lower, band.upper, band.mean))
            style.band(ax, w, lower, upper, style.BLUE, "95 % band")
            ax.plot(w, mean, color=style.BLUE, marker="." if power.sum() < 5 else "",
                    label="identified, where waves are")
            ax.plot(w, result.prior[name][:, j, j], color=style.VERMILION, linestyle="--",
                    label="prior model")
            ax.set_ylabel(text)
            ax.set_title(style.literal(dof))
        shares = result.information
        axes[j, 2].stackplot(w, shares["prior"], shares["points"], shares["data"], labels=["prior", "points", "data"],
                             colors=[style.GREY, style.ORANGE, style.GREEN], alpha=0.7)
        axes[j, 2].set(ylim=(0.0, 1.0), ylabel="share of the precision of K", title="sources of the estimate")
    axes[0, 0].margins(y=0.25)
    axes[0, 0].legend(frameon=False, fontsize="small")
    axes[0, 2].legend(loc="lower right", frameon=True)
    for ax in axes[-1]:
        ax.set_xlabel("ω [rad/s]")
    return figure


def force(dofs: tuple[str, ...], estimate: ForceEstimate, title: str, longest: float = 30.0) -> Figure:
    """Return a figure of the estimated force with its band over the first `longest` seconds."""
    figure, axes = style.figure(len(dofs), 1, size=(8.0, 2.2 * len(dofs) + 0.4), share_x=True)
    show = estimate.time <= estimate.time[0] + longest
    for j, dof in enumerate(dofs):
        ax, t = axes[j, 0], estimate.time[show]
        style.band(ax, t, estimate.lower[j, show], estimate.upper[j, show], style.BLUE, "95 % band")
        ax.plot(t, estimate.mean[j, show], color=style.BLUE, label="estimate from motion")
        ax.set_ylabel(f"{style.literal(dof)} force [{force_unit(dof)}]")
    axes[0, 0].set_title(style.literal(title))
    axes[0, 0].margins(y=0.3)
    axes[0, 0].legend(loc="upper right", frameon=False, fontsize="small", ncols=2)
    axes[-1, 0].set_xlabel("time [s]")
    return figure
