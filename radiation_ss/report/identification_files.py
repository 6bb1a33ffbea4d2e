"""Text and files of an identification: identify.json, one CSV of the force for each record, pictures."""

import json
import re
import warnings
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss import style
from radiation_ss.arrays import distinct
from radiation_ss.atomic import folder_written_whole, write_whole, written_whole
from radiation_ss.filter.estimate import LEVEL, Band
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.identification.result import Identification
from radiation_ss.identification.study import ForceEstimate
from radiation_ss.records.signals import stretches

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST_NAME = 80       # characters of a record's name in a file name


def save(result: Identification, folder: str | Path) -> Path:
    """Write identify.json, force_<record>.csv for each estimated force, and pictures; return the folder."""
    from matplotlib import pyplot as plt

    with folder_written_whole(folder) as place:
        stems = file_stems(result.force)
        for record, estimate in result.force.items():
            write_force(place / f"{stems[record]}.csv", result.dofs, estimate)
        text = json.dumps(result.to_dict({record: f"{stem}.csv" for record, stem in stems.items()}), indent=1,
                          allow_nan=False, ensure_ascii=False)
        write_whole(place / "identify.json", text + "\n")
        figures = {"coefficients": coefficients(result)}
        figures |= {stems[record]: force(result.dofs, estimate, record) for record, estimate in result.force.items()
                    if np.isfinite(estimate.mean).any()}
        for stem, figure in figures.items():
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Glyph .* missing")      # a title in a script that the font lacks
                figure.savefig(place / f"{stem}.png")
            plt.close(figure)
    return Path(folder)


def file_stems(records: Collection[str]) -> dict[str, str]:
    """Return a file name without ending for each record's force: letters of any script are kept, names differ."""
    stems = ("force_" + re.sub(r"[^\w.-]+", "_", record)[:LONGEST_NAME] for record in records)
    return dict(zip(records, distinct(stems, str.casefold)))


def write_force(path: Path, dofs: tuple[str, ...], estimate: ForceEstimate) -> None:
    """Write time and, for each degree of freedom, the force with its band."""
    header, columns = ["time"], [estimate.time]
    for j, dof in enumerate(dofs):
        header += [f"{dof}_force", f"{dof}_force_lower", f"{dof}_force_upper"]
        columns += [estimate.mean[j], estimate.lower[j], estimate.upper[j]]
    with written_whole(path) as beside:
        np.savetxt(beside, np.stack(columns, axis=1), fmt="%.8g", delimiter=",", header=",".join(header), comments="")


def to_dict(result: Identification, force_files: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the JSON form of the interface."""
    return {"schema": "radiation_ss.identification/1", "method": result.method, "dofs": list(result.dofs),
            "level": LEVEL, "omega": result.omega.tolist(), "A": plain(result.A), "B": plain(result.B),
            "K_zero": result.K_zero.mean.tolist(), "K_zero_band": plain(result.K_zero), "A_inf": result.A_inf.tolist(),
            "parameters": plain(result.parameters), "sea": plain(result.sea),
            "information": plain(result.information), "force": dict(force_files or {}),
            "baseline": plain(result.baseline), "warnings": list(result.warnings)}


def plain(value: Any) -> Any:
    """Return nested dicts, lists and numbers that JSON takes; a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Band):
        return {"mean": plain(value.mean), "lower": plain(value.lower), "upper": plain(value.upper)}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def text(result: Identification) -> str:
    """Return what the records tell, where, and with what warnings."""
    power = np.asarray(result.information["power"], dtype=bool)
    ranges = ", ".join(f"{result.omega[a]:.3g} to {result.omega[b - 1]:.3g}" for a, b in stretches(power))
    lines = [f"{result.method}: {', '.join(result.dofs)}; in brackets 95 % bands",
             f"  the data speak at {ranges or 'nowhere'} rad/s; elsewhere the answer is the model's, with the prior's "
             "band"]
    there = np.flatnonzero(power)
    picks = there[np.unique(np.linspace(0, there.size - 1, 5).astype(int)[1:4])] if there.size else there
    for j, dof in enumerate(result.dofs):
        for k in picks:
            values = "; ".join(f"{name} {band.mean[k, j, j]:.4g} ({band.lower[k, j, j]:.4g} to "
                               f"{band.upper[k, j, j]:.4g}) {inertia_unit(dof)}{per}, model "
                               f"{result.prior[name][k, j, j]:.4g}"
                               for name, per, band in (("A", "", result.A), ("B", "/s", result.B)))
            lines.append(f"  {dof} at {result.omega[k]:.3g} rad/s: {values}; {result.information['data'][k]:.0%} of it "
                         "from the data")
    rows = [f"  {name:>14s} {p['mean']:12.5g} +- {p['std']:.2g}  (" + (
        f"prior {p['prior_mean']:.5g} +- {p['prior_std']:.2g}, moved {p['moved']:+.2f} sd, resolved "
        f"{100 * p['resolved']:.0f} %)" if p["prior_std"] > 0.0 else
        f"model {p['prior_mean']:.5g}; {'K(0) = 0 makes it of the others' if p['std'] > 0.0 else 'fixed'})")
            for name, p in result.parameters.items()]
    return "\n".join([*lines, "  parameters:", *rows, *(f"warning: {said}" for said in result.warnings)])


def inertia_unit(dof: str) -> str:
    """Return the unit of a motion's added mass."""
    return "kg" if motion_unit(dof) == "m" else "kg m²"


def coefficients(result: Identification) -> "Figure":
    """Return a figure: B, A and the information shares, one row for each degree of freedom."""
    n, w = len(result.dofs), result.omega
    power = np.asarray(result.information.get("power", np.ones(w.size)), dtype=bool)
    figure, axes = style.figure(n, 3, size=(10.5, 2.7 * n + 0.3), share_x=True)
    for j, dof in enumerate(result.dofs):
        unit = inertia_unit(dof)
        for column, (name, band, text) in enumerate((("B", result.B, f"damping B [{unit}/s]"),
                                                     ("A", result.A, f"added mass A [{unit}]"))):
            ax = axes[j, column]
            lower, upper, mean = (np.where(power, values[:, j, j], np.nan)
                                  for values in (band.lower, band.upper, band.mean))
            style.band(ax, w, lower, upper, style.BLUE, "95 % band")
            ax.plot(w, mean, color=style.BLUE, marker="." if power.sum() < 5 else "",
                    label="identified, where waves are")
            ax.plot(w, result.prior[name][:, j, j], color=style.VERMILION, linestyle="--", label="prior model")
            ax.set(ylabel=text, title=style.literal(dof))
        shares = result.information
        axes[j, 2].stackplot(w, shares["prior"], shares["points"], shares["data"], labels=["prior", "points", "data"],
                             colors=[style.GREY, style.ORANGE, style.GREEN], alpha=0.7)
        axes[j, 2].set(ylim=(0.0, 1.0), ylabel="share of the precision of K", title="sources of the estimate")
    axes[0, 0].margins(y=0.25)
    axes[0, 0].legend(frameon=False, fontsize="small")
    axes[0, 2].legend(loc="lower right", frameon=True)
    for ax in axes[-1]:
        ax.set(xlabel="ω [rad/s]")
    return figure


def force(dofs: tuple[str, ...], estimate: ForceEstimate, title: str, longest: float = 30.0) -> "Figure":
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
