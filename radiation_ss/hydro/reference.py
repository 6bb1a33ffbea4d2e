"""Change of the point that rotations and moments are taken about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, HydroData, body, mode

_UNIT = {name: np.eye(3)[i] for i, name in enumerate(("Roll", "Pitch", "Yaw"))}


def at(data: HydroData, reference_point: Sequence[float]) -> HydroData:
    """Return the data about another reference point P: force = T^T force_O, matrices T^T (.) T (A.1)-(A.11).

    Velocities at the old point O follow from those at P: v_O = v_P + Omega x (O - P), that is v_O = T v_P. The
    congruence keeps passivity. In two dimensions with z up, T = [[1, -(z_O - z_P)], [0, 1]] for (Sway, Roll); the
    paper's [[1, l_G], [0, 1]] has y down. C is moved as the stiffness of a body in equilibrium. The phase of X stays at
    the origin.

    Parameters
    ----------
    reference_point : sequence of float
        The new point (x, y, z) [m], z up from the still water surface; for several bodies the same for each.

    Raises
    ------
    InputError
        If the point is not three finite numbers, a mode is no rigid-body mode, or a translation is missing that a
        rotation about the new point brings in.
    """
    point = np.asarray(reference_point, dtype=float)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError("reference_point: three finite coordinates (x, y, z) in metres needed, "
                         f"found {reference_point}")
    if not np.isfinite(data.reference_point).all():
        raise InputError(f"{data.source or 'data'}: its own reference point is not known (or each body has its own); "
                         "set it with data.replace(reference_point=(x, y, z)) if you know it")
    T = velocity_transform(data.dofs, np.asarray(data.reference_point) - point)
    changes: dict[str, object] = {"reference_point": tuple(float(v) for v in point)}
    for name in ("A", "B", "A_inf", "A_zero", "M", "C", "D"):
        value = getattr(data, name)
        changes[name] = None if value is None else T.T @ value @ T
    changes["X"] = None if data.X is None else data.X @ T
    return data.replace(**changes)


def velocity_transform(dofs: Sequence[str], arm: FloatArray) -> FloatArray:
    """Return T of v_O = T v_P for arm = O - P, shape (n, n); see `at`."""
    T = np.eye(len(dofs))
    for column, dof in enumerate(dofs):
        if mode(dof) in TRANSLATIONS:
            continue
        if mode(dof) not in ROTATIONS:
            raise InputError(f"degree of freedom {dof!r}: only the six rigid-body modes can be moved to another point")
        for name, value in zip(TRANSLATIONS, np.cross(_UNIT[mode(dof)], arm)):
            if value == 0.0:
                continue
            partner = f"{body(dof)}__{name}" if body(dof) else name
            if partner not in dofs:
                raise InputError(f"reference_point: {dof!r} about the new point brings in {partner!r}, which the data "
                                 f"{list(dofs)} do not hold")
            T[list(dofs).index(partner), column] += value
    return T
