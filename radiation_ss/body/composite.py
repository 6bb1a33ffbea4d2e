"""Composite (Cummins) systems as ct.StateSpace, assembled directly: the added mass at infinity sits in the inertia."""

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, listed
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData, signal

if TYPE_CHECKING:
    import control as ct

Linear = Mapping[str, float] | ArrayLike | None


def cummins(body: Model | HydroData | Sequence[ArrayLike], fit: RadiationFit | str | Path | None = None, *,
            stiffness: Linear = None, damping: Linear = None, name: str | None = None) -> "ct.StateSpace":
    """Return the composite system (9)-(13): inputs `<dof>_force`, outputs `<dof>`, `<dof>_vel`, `<dof>_acc`.

    Parameters
    ----------
    body : Model, HydroData, path or (M, C, A_inf)
        A model; or data with inertia and hydrostatics; or the three matrices, shape (n, n), SI, ordered as `fit.dofs`.
    fit : RadiationFit or path, optional
        The memory. Needed unless `body` is a Model (which has one).
    stiffness, damping : mapping of dof to number, or array_like of shape (n, n), optional
        Linear mooring or power take-off, added to what the body has [N/m, N s/m; N m/rad, N m s/rad].
    name : str, optional
        The system's name; the model's if absent.

    Returns
    -------
    control.StateSpace
        States `rad1` .. `radN`, then displacements, then velocities. Outputs ordered as all displacements, all
        velocities, all accelerations. Acceleration has feed-through of the force.

    Raises
    ------
    InputError
        If the fit is missing, names differ, or M + A_inf is not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), gyradius=0.07)
    >>> data = section.select("Heave").times(0.3)
    >>> plant = rss.cummins(data, rss.fit_radiation(data, 3))
    >>> plant.input_labels, plant.output_labels
    (['heave_force'], ['heave', 'heave_vel', 'heave_acc'])
    """
    import control as ct

    model = as_model(body, fit)
    if stiffness is not None or damping is not None:
        model = model.attached(stiffness=stiffness, damping=damping)
    F, G, H, J = system_matrices(model)
    inputs, outputs = signal_names(model.dofs)
    states = [*(f"rad{i + 1}" for i in range(model.fit.states)), *outputs[:2 * model.n]]
    return ct.ss(F, G, H, J, inputs=list(inputs), outputs=list(outputs), states=states,
                 name=re.sub(r"\W+", "_", name or model.name))


@lru_cache(maxsize=256)
def signal_names(dofs: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of a composite's inputs and outputs; InputError if two are the same."""
    stems = [signal(dof) for dof in dofs]
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        alike = [dof for dof in dofs if signal(dof) == twice[0]]
        raise InputError(f"degrees of freedom {' and '.join(alike)} would both be the signal {twice[0]!r}: names have "
                         "to differ by more than case, blanks, dots and underscores")
    return tuple(f"{s}_force" for s in stems), tuple(s + tail for tail in ("", "_vel", "_acc") for s in stems)


def system_matrices(model: Model) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (F, G, H, J) of x' = F x + G f, y = H x + J f with y = [displacement; velocity; acceleration]."""
    F, G = model.matrices()
    n, m = model.n, model.fit.states
    H, J = np.zeros((3 * n, m + 2 * n)), np.zeros((3 * n, n))
    np.fill_diagonal(H[:, m:], 1.0)
    H[2 * n:], J[2 * n:] = F[m + n:], G[m + n:]
    return F, G, H, J


def rigid_body(body: Model | HydroData | Sequence[ArrayLike], dofs: Sequence[str] | None = None, *,
               stiffness: Linear = None, damping: Linear = None, name: str = "rigid_body") -> "ct.StateSpace":
    """Return the body without memory, (M + A_inf) xi'' + D xi' + C xi = f, with the signals of `cummins`.

    `ct.feedback` of this with the radiation subsystem on the velocities is the composite; `cummins` is faster.

    Parameters
    ----------
    body : Model, HydroData, control.StateSpace, path or (M, C, A_inf)
    dofs : sequence of str, optional
        Names, with matrices alone.
    stiffness, damping, name
        As for `cummins`.

    Raises
    ------
    InputError
        If matrices come without names, or another body with other names than its own.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> plant = rss.rigid_body(([[2.0]], [[8.0]], [[0.0]]), ["Heave"])
    >>> plant.input_labels, plant.output_labels
    (['heave_force'], ['heave', 'heave_vel', 'heave_acc'])
    """
    if isinstance(body, tuple | list):
        if dofs is None:
            raise InputError("dofs: missing; name the degrees of freedom of (M, C, A_inf)")
    else:
        body = body if isinstance(body, HydroData) else as_model(body)
        if dofs is not None and tuple(listed(dofs)) != tuple(body.dofs):
            raise InputError(f"dofs: {list(dofs)}; the body's are {list(body.dofs)}; leave dofs out, or select them "
                             "from the data first")
        dofs = body.dofs
    return cummins(body, no_radiation(dofs), stiffness=stiffness, damping=damping, name=name)


def no_radiation(dofs: Sequence[str]) -> RadiationFit:
    """Return a radiation subsystem without states, K = 0."""
    dofs = listed(dofs)
    n = len(dofs)
    return RadiationFit(tuple(dofs), np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), 0, method="none")
