"""A model in ten lines, as text and as a page's fragment with its picture."""

from __future__ import annotations

import io
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.body.modes import natural_modes
from radiation_ss.fit.rational import frequency_response
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.style import GREY, figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.body.model import Model

MOST_DOFS = 6


def text(model: Model) -> str:
    """Return the model in ten lines at most: a line a degree of freedom, its radiation, its tolerances."""
    modes = natural_modes(model)
    lines = [f"Model {model.name[:60]}"]
    for i, dof in enumerate(model.dofs[:MOST_DOFS]):
        swing = (f"period {modes.period[i]:.4g} s, damping ratio {modes.ratio[i]:.2g}" if np.isfinite(modes.period[i])
                 else "no oscillation")
        D = f", D {model.D[i, i]:.4g} {force_unit(dof)} s/{motion_unit(dof)}" if model.D[i, i] else ""
        mass = "kg m^2" if motion_unit(dof) == "rad" else "kg"
        lines.append(f"  {dof}  M {model.M[i, i]:.4g}, A_inf {model.A_inf[i, i]:.4g} {mass}, C {model.C[i, i]:.4g} "
                     f"{force_unit(dof)}/{motion_unit(dof)}{D}; {swing}")
    if model.n > MOST_DOFS:
        lines.append(f"  and {model.n - MOST_DOFS} more: {', '.join(model.dofs[MOST_DOFS:])[:80]}")
    fit = model.fit
    error = "" if np.isnan(fit.relative_error) else f", relative error {fit.relative_error:.3g}"
    lines.append(f"  radiation: {fit.states} states{error}" if fit.states else "  radiation: none")
    if model.tolerance:
        said = ", ".join(f"{name} {100.0 * value:.4g} %" for name, value in model.tolerance.items())
        lines.append(f"  tolerance: {said}")
    return "\n".join(lines)


def html(model: Model) -> str:
    """Return the text with the picture below it, for a notebook."""
    from matplotlib import pyplot as plt

    picture, file = plot_model(model), io.StringIO()
    picture.savefig(file, format="svg")
    plt.close(picture)
    drawing = file.getvalue()
    return f"<pre>{escape(text(model))}</pre>{drawing[drawing.index('<svg'):]}"


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
            left.loglog(omega, motion[:, i, i], label=model.dofs[i])
            right.semilogx(omega, damping[:, i, i], label=model.dofs[i])
            if np.isfinite(modes.period[i]):
                left.axvline(2.0 * np.pi / modes.period[i], color=GREY, lw=0.8, ls=":")
        left.set(ylabel=f"motion per force [{unit[0]}/({unit[1]})]", xlabel="ω [rad/s]")
        right.set(ylabel=f"damping [{unit[1]} s/{unit[0]}]", xlabel="ω [rad/s]")
        left.legend(loc="lower left", fontsize=7)
    return drawing
