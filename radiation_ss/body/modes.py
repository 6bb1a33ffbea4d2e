"""Natural periods and damping ratios of a model, and the degree of freedom that each belongs to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from radiation_ss.arrays import FloatArray

if TYPE_CHECKING:
    from radiation_ss.body.model import Model


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes, one for each degree of freedom.

    Parameters
    ----------
    dofs : tuple of str
    period : ndarray, shape (n,)
        Of the damped oscillation [s]; inf where a degree of freedom does not oscillate.
    ratio : ndarray, shape (n,)
        Damping ratio, share of critical; nan where a degree of freedom does not oscillate.
    """

    dofs: tuple[str, ...]
    period: FloatArray
    ratio: FloatArray


def natural_modes(model: Model) -> Modes:
    """Return period and damping ratio of the oscillation in which each degree of freedom takes the largest part.

    The part of a state in a mode is the product of its entries in the right and the left eigenvector (participation
    factor: Perez-Arriaga, Verghese & Schweppe 1982). Each oscillation is given to one degree of freedom.

    Examples
    --------
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
    swinging = np.flatnonzero(poles.imag > 1e-6 * np.abs(poles))
    if swinging.size == 0:
        return Modes(model.dofs, period, ratio)
    left = np.linalg.pinv(right)
    part = np.abs(right.T * left)[swinging]
    share = part[:, m:m + n] + part[:, m + n:]
    for row, dof in zip(*linear_sum_assignment(-share)):
        s = poles[swinging[row]]
        # A body without stiffness takes a small part in an oscillation of its radiation states.
        if share[row, dof] > 0.1 * share[:, dof].max() and model.C[dof, dof] != 0.0:
            period[dof], ratio[dof] = 2.0 * np.pi / s.imag, -s.real / abs(s)
    return Modes(model.dofs, period, ratio)
