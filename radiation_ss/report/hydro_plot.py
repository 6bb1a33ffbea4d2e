"""Pictures of coefficients and of their quality."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss import style
from radiation_ss.arrays import FloatArray
from radiation_ss.hydro.data import HydroData, motion_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.hydro.quality import QualityReport

UNITS = {"m": ("kg", "kg/s", "N/m"), "rad": ("kg m$^2$", "kg m$^2$/s", "N m/m")}


def plot_hydro(data: HydroData, dofs: Sequence[str] | str | None = None) -> Figure:
    """Draw a row for each degree of freedom: added mass, damping and, where present, |X| of the wave excitation.

    Parameters
    ----------
    data : HydroData
    dofs : sequence of str, optional
        Which; by default all.

    Returns
    -------
    matplotlib Figure
    """
    if dofs is not None:
        data = data.select(dofs)
    columns = 2 if data.X is None else 3
    with style.look():
        figure, axes = style.figure(data.n, columns, size=(3.2 * columns + 0.4, 1.75 * data.n + 0.5), share_x=True)
        for i, dof in enumerate(data.dofs):
            mass, damping, force = UNITS[motion_unit(dof)]
            _added_mass(axes[i, 0], data, i)
            axes[i, 0].set_ylabel(f"A [{mass}]")
            axes[i, 1].plot(data.omega, data.B[:, i, i], color=style.BLUE)
            axes[i, 1].axhline(0.0, color=style.GREY, linewidth=0.8)
            axes[i, 1].set_ylabel(f"B [{damping}]")
            axes[i, 0].set_title(style.literal(dof.replace("__", " ")), loc="left")
            if data.X is not None and data.directions is not None:
                _force(axes[i, 2], data, i)
                axes[i, 2].set_ylabel(f"|X| [{force}]")
        for axis in axes[-1]:
            axis.set_xlabel(r"$\omega$ [rad/s]")
        if data.X is not None:
            axes[0, 2].legend(title="direction", fontsize=7, title_fontsize=7)
        if any(axis.get_legend_handles_labels()[0] for axis in axes[:, 0]):
            axes[0, 0].legend(fontsize=7)
    return figure


def _added_mass(axis: Any, data: HydroData, i: int) -> None:
    axis.plot(data.omega, data.A[:, i, i], color=style.BLUE)
    if data.A_inf is not None:
        axis.axhline(data.A_inf[i, i], color=style.VERMILION, linestyle="--", linewidth=1.0, label=r"$A_\infty$")


def _force(axis: Any, data: HydroData, i: int) -> None:
    assert data.X is not None and data.directions is not None
    shown = range(0, data.X.shape[1], max(1, data.X.shape[1] // 4))
    for h, colour in zip(shown, style.COLOURS):
        axis.plot(data.omega, np.abs(data.X[:, h, i]), color=colour,
                  label=f"{np.degrees(data.directions[h]):.0f}°")
    axis.set_ylim(bottom=0.0)


def plot_quality(report: QualityReport) -> Figure:
    """Draw damping, its smallest eigenvalue, Kramers-Kronig residual, asymmetry and spikes over frequency.

    Bands where negative damping or a spike was found are shaded.
    """
    data, w = report.data, report.data.omega
    percent = 100.0 * report.tolerance
    with style.look():
        figure, axes = style.figure(2, 2, size=(8.2, 5.6), share_x=True)
        top, eigen, causal, rough = axes.ravel()
        scaled = np.einsum("kii->ki", data.B) / np.maximum(np.abs(np.einsum("kii->ki", data.B)).max(axis=0), 1e-300)
        silent = {dof for f in report.findings if f.kind == "silent mode" for dof in f.dofs}
        shown = [i for i, dof in enumerate(data.dofs) if dof not in silent]
        for i, colour in zip(shown, 2 * style.COLOURS):
            dashed = shown.index(i) >= len(style.COLOURS)
            top.plot(w, 100.0 * scaled[:, i], color=colour, linestyle="--" if dashed else "-",
                     label=style.literal(data.dofs[i].replace("__", " ")), linewidth=1.0)
        top.set_title("Damping [% of its largest]")
        top.legend(fontsize=6.5, ncols=2)
        eigen.plot(w, 100.0 * report.smallest_eigenvalue, color=style.BLUE)
        eigen.fill_between(w, 0.0, 100.0 * np.minimum(report.smallest_eigenvalue, 0.0), color=style.VERMILION,
                           alpha=0.5, linewidth=0)
        eigen.set_ylim(min(-2.0 * percent, 110.0 * report.smallest_eigenvalue.min()),
                       max(2.0 * percent, 110.0 * report.smallest_eigenvalue.max()))
        eigen.set_title("Smallest eigenvalue of scaled B [%]")
        residual = np.abs(report.kramers_kronig).max(axis=(1, 2))
        causal.set_title("Causality and reciprocity [%]")
        _logarithmic(causal, w, percent, {"Kramers-Kronig residual": residual, "asymmetry": report.asymmetry})
        rough.set_title("Departure from neighbours [%]")
        _logarithmic(rough, w, percent, {"spikes": report.spikes})
        _shade(report, top, ("negative damping",), style.VERMILION)
        _shade(report, rough, ("spike", "irregular frequency"), style.ORANGE)
        verdict = "no problem found" if report.ok else ", ".join(dict.fromkeys(f.kind for f in report.problems))
        figure.suptitle(f"{data.source.rsplit('/', 1)[-1] or 'coefficients'}: {verdict}", fontsize=10)
    return figure


def _logarithmic(axis: Any, w: FloatArray, percent: float, curves: dict[str, FloatArray]) -> None:
    """Draw shares in per cent on a logarithmic axis that holds the tolerance."""
    axis.set_yscale("log")
    axis.set_ylim(1e-3, max(10.0 * percent, *(150.0 * float(c.max()) for c in curves.values())))
    for (label, curve), colour in zip(curves.items(), (style.BLUE, style.ORANGE)):
        axis.plot(w, 100.0 * np.maximum(curve, 1e-6), color=colour, label=label)
    axis.axhline(percent, color=style.GREY, linestyle="--", linewidth=0.9, label="tolerance")
    axis.legend(fontsize=7, frameon=True, framealpha=0.8, edgecolor="none")
    axis.set_xlabel(r"$\omega$ [rad/s]")


def _shade(report: QualityReport, axis: Any, kinds: tuple[str, ...], colour: str) -> None:
    """Mark the bands of findings; a band of one frequency gets the width of a spacing."""
    width = float(np.median(np.diff(report.data.omega))) if report.data.omega.size > 1 else 0.0
    for finding in report.findings:
        if finding.kind in kinds and finding.value > report.tolerance:
            for low, high in finding.bands:
                axis.axvspan(low - 0.5 * width, high + 0.5 * width, color=colour, alpha=0.15, linewidth=0)
