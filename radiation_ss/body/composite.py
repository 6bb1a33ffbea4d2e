"""Composite (Cummins) systems as ct.StateSpace, assembled directly: A_inf sits in the inertia; rigid bodies, masses."""

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, listed, positive, read_only
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.clean import rigid_inertia
from radiation_ss.hydro.data import RIGID, ROTATIONS, HydroData, body, mode, signal

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


def mass_matrix(mass: float, centre_of_gravity: Sequence[float], *, gyradii: ArrayLike | None = None,
                inertia: ArrayLike | None = None, dofs: Sequence[str] = RIGID,
                reference_point: Sequence[float] = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return the rigid-body mass matrix about a reference point, shape (n, n) [kg, kg m, kg m^2].

    M = [[m I, -m S], [m S, I_G - m S S]] with S the cross-product matrix of the arm from the point to G.

    Parameters
    ----------
    mass : float
        [kg]
    centre_of_gravity : sequence of float
        (x, y, z) [m], z up from the still water surface.
    gyradii : array_like, shape (3,), optional
        Radii of gyration about G in roll, pitch and yaw [m].
    inertia : array_like, shape (3, 3), optional
        Inertia tensor about G [kg m^2] instead of gyradii (products with their sign: -int x y dm).
    dofs : sequence of str
        Degrees of freedom of this one body; all six by default.
    reference_point : sequence of float
        (x, y, z) [m] that rotations are about.

    Raises
    ------
    InputError
        If a value is not positive, a rotation is asked for without inertia, or a degree of freedom is not rigid.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> rss.mass_matrix(10.0, (0.0, 0.0, 0.2), gyradii=(0.3, 0.5, 0.5), dofs=("Sway", "Roll")).round(3).tolist()
    [[10.0, -2.0], [-2.0, 1.3]]
    """
    mass = positive(mass, "mass", "kg")
    unknown = [dof for dof in dofs if mode(dof) not in RIGID]
    if unknown or len({body(dof) for dof in dofs}) > 1:
        raise InputError(f"dofs: {list(dofs)} must be rigid modes of one body ({', '.join(RIGID)})")
    if gyradii is not None and inertia is not None:
        raise InputError("gyradii, inertia: give one of the two")
    if gyradii is not None:
        tensor = mass * np.diag(read_only(gyradii, "gyradii", (3,)) ** 2)
    elif inertia is not None:
        tensor = read_only(inertia, "inertia", (3, 3))
    elif any(mode(dof) in ROTATIONS for dof in dofs):
        raise InputError("gyradii: needed for rotations [m], or the inertia tensor about G")
    else:
        tensor = np.zeros((3, 3))
    if not np.allclose(tensor, tensor.T) or np.linalg.eigvalsh(tensor)[0] < 0.0:
        raise InputError("inertia: must be symmetric and not negative")
    arm = read_only(centre_of_gravity, "centre_of_gravity", (3,)) - read_only(reference_point, "reference_point", (3,))
    pick = [RIGID.index(mode(dof)) for dof in dofs]
    return rigid_inertia(mass, tensor, arm)[np.ix_(pick, pick)]
