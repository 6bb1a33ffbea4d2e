"""Mass matrix of rigid bodies from mass, centre of gravity and gyradii."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, body, mode

MODES = TRANSLATIONS + ROTATIONS


def mass_matrix(mass: float, centre_of_gravity: Sequence[float], *, gyradii: ArrayLike | None = None,
                inertia: ArrayLike | None = None, dofs: Sequence[str] = MODES,
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
    if not (mass > 0.0 and np.isfinite(mass)):
        raise InputError(f"mass: {mass:g} kg; a positive mass is needed")
    unknown = [dof for dof in dofs if mode(dof) not in MODES]
    if unknown or len({body(dof) for dof in dofs}) > 1:
        raise InputError(f"dofs: {list(dofs)} must be rigid modes of one body ({', '.join(MODES)})")
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
    S = np.cross(np.eye(3), arm)  # S v = arm x v
    whole = np.block([[mass * np.eye(3), -mass * S], [mass * S, tensor - mass * S @ S]])
    pick = [MODES.index(mode(dof)) for dof in dofs]
    return whole[np.ix_(pick, pick)]
