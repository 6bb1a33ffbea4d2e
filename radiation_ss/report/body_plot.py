"""The picture of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.body.modes import natural_modes
from radiation_ss.fit.rational import frequency_response
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.style import GREY, figure, literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.body.model import Model


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
