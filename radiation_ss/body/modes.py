"""Natural periods and damping ratios of a model, the degree of freedom that each belongs to; the model as text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.hydro.measures import statically_unstable


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes, one for each degree of freedom."""

    dofs: tuple[str, ...]
    period: FloatArray  # (n,): Of the damped oscillation [s]; inf where a degree of freedom does not oscillate
    ratio: FloatArray  # (n,): Damping ratio, share of critical; nan where a degree of freedom does not oscillate


def natural_modes(model: Model) -> Modes:
    """Return period and damping ratio of the oscillation in which each degree of freedom takes the largest part.

    The part of a state in a mode is the product of its entries in the right and the left eigenvector (participation
    factor: Perez-Arriaga, Verghese & Schweppe 1982). Each oscillation is given to one degree of freedom.

    >>> import radiation_ss as rss
    >>> modes = natural_modes(rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.1))
    >>> round(float(modes.period[0]), 4), round(float(modes.ratio[0]), 4)
    (3.1574, 0.1)
    """
    F = model.matrices()[0]
    n, m = model.n, model.fit.states
    scale = np.sqrt(np.maximum(np.diag(model.M + model.A_inf), 1e-300))
    size = np.concatenate([np.ones(m), scale, scale])
    poles, right = np.linalg.eig(F * (size[:, None] / size))
    period, ratio = np.full(n, np.inf), np.full(n, np.nan)
    loose = statically_unstable(model.M, model.C, model.dofs)
    swinging = np.flatnonzero(poles.imag > 1e-6 * np.abs(poles))
    if swinging.size == 0:
        return Modes(model.dofs, period, ratio)
    left = np.linalg.pinv(right)
    part = np.abs(right.T * left)[swinging]
    share = part[:, m:m + n] + part[:, m + n:]
    for row, dof in zip(*linear_sum_assignment(-share)):
        s = poles[swinging[row]]
        # A body without stiffness takes a small part in an oscillation of its radiation states.
        if (share[row, dof] > 0.1 * share[:, dof].max() and model.C[dof, dof] != 0.0
                and model.dofs[dof] not in loose):
            period[dof], ratio[dof] = 2.0 * np.pi / s.imag, np.round(-s.real / abs(s), 12) + 0.0
    return Modes(model.dofs, period, ratio)


def text(model: Model, most: int = 6) -> str:
    """Return the model in ten lines at most: a line a degree of freedom, its radiation, its tolerances."""
    modes, loose = natural_modes(model), statically_unstable(model.M, model.C, model.dofs)
    lines = [f"Model {' '.join(model.name.split())[:60]}"]
    for i, dof in enumerate(model.dofs[:most]):
        swing = (f"period {modes.period[i]:.4g} s, damping ratio {modes.ratio[i]:.2g}" if np.isfinite(modes.period[i])
                 else "statically unstable (C < 0)" if dof in loose else "no oscillation")
        D = f", D {model.D[i, i]:.4g} {force_unit(dof)} s/{motion_unit(dof)}" if model.D[i, i] else ""
        mass = "kg m^2" if motion_unit(dof) == "rad" else "kg"
        lines.append(f"  {dof}  M {model.M[i, i]:.4g}, A_inf {model.A_inf[i, i]:.4g} {mass}, C {model.C[i, i]:.4g} "
                     f"{force_unit(dof)}/{motion_unit(dof)}{D}; {swing}")
    if model.n > most:
        lines.append(f"  and {model.n - most} more: {', '.join(model.dofs[most:])[:80]}")
    fit = model.fit
    error = "" if np.isnan(fit.relative_error) else f", relative error {fit.relative_error:.3g}"
    lines.append(f"  radiation: {fit.states} states{error}" if fit.states else "  radiation: none")
    if model.tolerance:
        said = ", ".join(f"{name} {100.0 * value:.4g} %" for name, value in model.tolerance.items())
        lines.append(f"  tolerance: {said}")
    return "\n".join(lines)
