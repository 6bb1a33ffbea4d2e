"""Pictures of coefficients and their checks, fits, models and records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss import style
from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import natural_modes
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData, force_unit, mode, motion_unit
from radiation_ss.records.record_files import unit_of
from radiation_ss.style import BLUE, GREY, VERMILION, figure, literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.body.model import Model
    from radiation_ss.hydro.findings import QualityReport
    from radiation_ss.records.record import Record


def plot_fit(fit: RadiationFit, entries: list[tuple[str, str]] | None = None) -> Figure:
    """Draw added mass, damping, Nyquist plot and kernel of entries (the diagonal), data as points, fit as lines."""
    data, A_inf = fit.data, fit.A_inf
    if entries is not None and not (isinstance(entries, list | tuple) and all(
            isinstance(pair, list | tuple) and [*map(type, pair)] == [str, str] for pair in entries)):
        raise InputError("plot: entries: pairs of names (force, velocity) needed, [('Surge', 'Pitch')]; found "
                         f"{type(entries).__name__} {' '.join(str(entries).split())[:60]}")
    if data is None or A_inf is None:
        raise InputError("plot: this fit was read from a file without its data; use fit.replace(data=..., A_inf=...)")
    wanted = entries or [(dof, dof) for block in fit.blocks or (fit.dofs,) for dof in block]
    figure_, axes = figure(len(wanted), 4, size=(13.0, 2.3 * len(wanted) + 0.5))
    omega = np.linspace(1e-3 * data.omega[-1], 1.15 * data.omega[-1], 500)
    K = fit.frequency_response(omega)
    slow = max(-float(np.linalg.eigvals(fit.a).real.max()), 0.05 * data.omega[-1])
    t = np.linspace(0.0, min(8.0 / slow, 150.0 / data.omega[-1]), 400)
    kernel, samples = fit.kernel(t), data.kernel(t)
    for row, (force, velocity) in zip(axes, wanted):
        i, j = data.index(force), data.index(velocity)
        unit = _units(force, velocity)
        _pair(row[0], data.omega, data.A[:, i, j], omega, A_inf[i, j] + K[:, i, j].imag / omega)
        row[0].axhline(A_inf[i, j], color=GREY, lw=0.8, ls=":")
        _pair(row[1], data.omega, data.B[:, i, j], omega, K[:, i, j].real)
        row[1].axhline(0.0, color=GREY, lw=0.6)
        _pair(row[2], data.K[:, i, j].real, data.K[:, i, j].imag, K[:, i, j].real, K[:, i, j].imag)
        row[2].axvline(0.0, color=GREY, lw=0.8)
        _pair(row[3], t[::4], samples[::4, i, j], t, kernel[:, i, j])
        label = mode(force) if force == velocity else f"{mode(force)}-{mode(velocity)}"
        row[0].set(ylabel=f"{label}\nA [{unit[0]}]", xlabel="ω [rad/s]")
        row[1].set(ylabel=f"B [{unit[1]}]", xlabel="ω [rad/s]")
        row[2].set(ylabel=f"Im K [{unit[1]}]", xlabel=f"Re K [{unit[1]}]")
        row[3].set(ylabel=f"L [{unit[2]}]", xlabel="t [s]")
    for axis, title in zip(axes[0], ("added mass", "damping", "Nyquist", "kernel")):
        axis.set_title(title)
    axes[0, 0].legend(["data", f"fit, order {fit.order}"], loc="best")
    return figure_


def plot_path(fit: RadiationFit) -> Figure:
    """Draw the error of each order that was tried, on fitted and held-out frequencies."""
    if not fit.path:
        raise InputError("plot_path: the order of this fit was given, not chosen; fit with order=None")
    figure_, axes = figure(1, len(fit.path), size=(3.2 * len(fit.path) + 0.4, 2.8))
    for axis, block, path in zip(axes[0], fit.blocks, fit.path):
        orders = [trial.order for trial in path]
        axis.semilogy(orders, [trial.error for trial in path], "o-", color=BLUE, label="fitted")
        axis.semilogy(orders, [trial.held_out for trial in path], "s--", color=VERMILION, label="held out")
        axis.set(title=", ".join(mode(dof) for dof in block), xlabel="order", ylabel="relative error")
        axis.legend()
    return figure_


def _pair(axis: Axes, x: np.ndarray, y: np.ndarray, fine: np.ndarray, line: np.ndarray) -> None:
    """Draw data as points and the fit as a line."""
    axis.plot(x, y, ".", color=GREY, ms=2.5)
    axis.plot(fine, line, color=BLUE)


def _units(force: str, velocity: str) -> tuple[str, str, str]:
    """Return the units of added mass, damping and kernel of an entry."""
    mass = ("kg", "kg m", "kg m²")[(force_unit(force) == "N m") + (motion_unit(velocity) == "rad")]
    return mass, f"{mass}/s", f"{mass}/s²"


def plot_record(record: Record, most: int = 2000) -> Figure:
    """Draw the channels over time, a row a unit; of more than `most` samples every so many."""
    rows: dict[str, list[str]] = {}
    for name in record.channels:
        rows.setdefault(unit_of(record, name), []).append(name)
    drawing, axes = figure(max(len(rows), 1), 1, size=(7.4, 1.7 * max(len(rows), 1) + 0.4), share_x=True)
    every = max(1, record.time.size // most)
    for axis, (unit, names) in zip(axes[:, 0], rows.items()):
        for name in names:
            axis.plot(record.time[::every], record.channels[name][::every], lw=0.9, label=literal(name))
        axis.set(ylabel=f"[{unit}]" if unit else "")
        axis.legend(loc="upper right", fontsize=7)
    axes[-1, 0].set(xlabel="time [s]")
    return drawing


def plot_model(model: Model) -> Figure:
    """Draw motion per force over frequency and the damping, a row for translations and one for rotations."""
    modes = natural_modes(model)
    finite = modes.period[np.isfinite(modes.period)]
    own = 2.0 * np.pi / finite if finite.size else np.abs(np.linalg.eigvals(model.matrices()[0]))
    own = own[own > 0.0] if np.any(own > 0.0) else np.ones(1)
    omega = np.geomspace(own.min() / 5.0, own.max() * 5.0, 400)
    F, G = model.matrices()
    motion = np.abs(frequency_response(F, G, np.eye(len(F))[model.fit.states:][:model.n], omega))
    damping = model.fit.frequency_response(omega).real + model.D
    rows = [[i for i, dof in enumerate(model.dofs) if motion_unit(dof) == unit] for unit in ("m", "rad")]
    rows = [row for row in rows if row]
    drawing, axes = figure(len(rows), 2, size=(7.4, 2.3 * len(rows) + 0.4))
    for (left, right), row in zip(axes, rows):
        unit = (motion_unit(model.dofs[row[0]]), force_unit(model.dofs[row[0]]))
        for i in row:
            left.loglog(omega, motion[:, i, i], label=literal(model.dofs[i]))
            right.semilogx(omega, damping[:, i, i], label=literal(model.dofs[i]))
            if np.isfinite(modes.period[i]):
                left.axvline(2.0 * np.pi / modes.period[i], color=GREY, lw=0.8, ls=":")
        left.set(ylabel=f"motion per force [{unit[0]}/({unit[1]})]", xlabel="ω [rad/s]")
        right.set(ylabel=f"damping [{unit[1]} s/{unit[0]}]", xlabel="ω [rad/s]")
        left.legend(loc="lower left", fontsize=7)
    return drawing


@style.look()
def plot_hydro(data: HydroData, dofs: Sequence[str] | str | None = None) -> Figure:
    """Draw a row for each degree of freedom: added mass, damping and, where present, |X| of the wave excitation."""
    if dofs is not None:
        data = data.select(dofs)
    columns = 2 if data.X is None else 3
    drawing, axes = figure(data.n, columns, size=(3.2 * columns + 0.4, 1.75 * data.n + 0.5), share_x=True)
    for i, (dof, row) in enumerate(zip(data.dofs, axes)):
        mass, damping, _ = _units(dof, dof)
        row[0].plot(data.omega, data.A[:, i, i], color=BLUE)
        if data.A_inf is not None:
            row[0].axhline(data.A_inf[i, i], color=VERMILION, linestyle="--", linewidth=1.0, label=r"$A_\infty$")
        row[0].set(ylabel=f"A [{mass}]")
        row[0].set_title(literal(dof.replace("__", " ")), loc="left")
        row[1].plot(data.omega, data.B[:, i, i], color=BLUE)
        row[1].axhline(0.0, color=GREY, linewidth=0.8)
        row[1].set(ylabel=f"B [{damping}]")
        if data.X is not None and data.directions is not None:
            for h, colour in zip(range(0, data.X.shape[1], max(1, data.X.shape[1] // 4)), style.COLOURS):
                row[2].plot(data.omega, np.abs(data.X[:, h, i]), color=colour,
                            label=f"{np.degrees(data.directions[h]):.0f}°")
            row[2].set(ylabel=f"|X| [{force_unit(dof)}/m]")
            row[2].set_ylim(bottom=0.0)
    for axis in axes[-1]:
        axis.set(xlabel=r"$\omega$ [rad/s]")
    if data.X is not None:
        axes[0, 2].legend(title="direction", fontsize=7, title_fontsize=7)
    if data.A_inf is not None:
        axes[0, 0].legend(fontsize=7)
    return drawing


@style.look()
def plot_quality(report: QualityReport) -> Figure:
    """Draw damping, its smallest eigenvalue, Kramers-Kronig residual, asymmetry and spikes over frequency."""
    data, w = report.data, report.data.omega
    percent, smallest = 100.0 * report.tolerance, 100.0 * report.smallest_eigenvalue
    drawing, axes = figure(2, 2, size=(8.2, 5.6), share_x=True)
    top, eigen, causal, rough = axes.ravel()
    diagonal = np.einsum("kii->ki", data.B)
    silent = {dof for f in report.findings if f.kind == "non-radiating mode" for dof in f.dofs}
    shown = [i for i, dof in enumerate(data.dofs) if dof not in silent]
    looks = [(colour, line) for line in ("-", "--") for colour in style.COLOURS]
    for i, (colour, line) in zip(shown, looks):
        top.plot(w, 100.0 * diagonal[:, i] / max(np.abs(diagonal[:, i]).max(), 1e-300), color=colour, linestyle=line,
                 label=literal(data.dofs[i].replace("__", " ")), linewidth=1.0)
    top.set_title("Damping [% of its largest]")
    top.legend(fontsize=6.5, ncols=2)
    eigen.plot(w, smallest, color=BLUE)
    eigen.fill_between(w, 0.0, np.minimum(smallest, 0.0), color=VERMILION, alpha=0.5, linewidth=0)
    eigen.set_ylim(min(-2.0 * percent, 1.1 * smallest.min()), max(2.0 * percent, 1.1 * smallest.max()))
    eigen.set_title("Smallest eigenvalue of scaled B [%]")
    causal.set_title("Causality and reciprocity [%]")
    _logarithmic(causal, w, percent, {"Kramers-Kronig residual": np.abs(report.kramers_kronig).max(axis=(1, 2)),
                                      "asymmetry": report.asymmetry})
    rough.set_title("Departure from neighbours [%]")
    _logarithmic(rough, w, percent, {"spikes": report.spikes})
    _shade(report, top, ("negative damping",), VERMILION)
    _shade(report, rough, ("spike", "irregular frequency"), style.ORANGE)
    verdict = "no problem found" if report.ok else ", ".join(dict.fromkeys(f.kind for f in report.problems))
    drawing.suptitle(f"{data.source.rsplit('/', 1)[-1] or 'coefficients'}: {verdict}", fontsize=10)
    return drawing


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
