"""A model in ten lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.body.modes import natural_modes
from radiation_ss.hydro.data import force_unit, motion_unit

if TYPE_CHECKING:
    from radiation_ss.body.model import Model

MOST_DOFS = 6


def text(model: Model) -> str:
    """Return the model in ten lines at most: a line a degree of freedom, its radiation, its tolerances."""
    modes = natural_modes(model)
    lines = [f"Model {' '.join(model.name.split())[:60]}"]
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
