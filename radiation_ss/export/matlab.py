"""MATLAB .mat, and the arrays of the MSS toolbox."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import write_whole
from radiation_ss.errors import InputError
from radiation_ss.export.places import six_names
from radiation_ss.fit.rational import side_by_side
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.readers import mat5
from radiation_ss.reading import listed, read_arrays, texts, whole_number

MSS_AXES = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Forward-starboard-down of MSS's files becomes forward-port-up, as `read_hydro` turns the coefficients."""


def write_matlab(fit: RadiationFit, path: Path) -> None:
    """Write A, B, C, the names of the degrees of freedom and A_inf as a MATLAB file."""
    from scipy.io import savemat

    raw = BytesIO()
    savemat(raw, {"A": fit.a, "B": fit.b, "C": fit.c, "dofs": np.array(fit.dofs, dtype=object),
                  "order": fit.order, "A_inf": np.zeros((0, 0)) if fit.A_inf is None else fit.A_inf})
    # A head without the time, so that a fit gives the same file each time.
    write_whole(path, b"MATLAB 5.0 MAT-file, written by radiation_ss".ljust(116) + raw.getvalue()[116:])


def read_matlab(path: Path) -> RadiationFit:
    """Read a .mat or .npz: `write_matlab`'s A, B, C, or MSS's Ar, Br, Cr by entry.

    Raises
    ------
    InputError
        If neither is there.
    """
    content: dict[str, Any] = dict(read_arrays(path)) if path.suffix == ".npz" else mat5.load(path)
    if {"A", "B", "C", "dofs"} <= set(content):
        A_inf = content.get("A_inf", np.zeros((0, 0)))
        dofs = texts([str(np.ravel(dof)[0]) for dof in np.ravel(content["dofs"])] if path.suffix == ".npz"
                     else content["dofs"], "dofs")
        order = np.ravel(content["order"])
        return RadiationFit(dofs, content["A"], content["B"], content["C"], A_inf=A_inf if np.size(A_inf) else None,
                            order=whole_number(int(order[0]) if order.size == 1 and order[0] == int(order[0]) else
                                               order.tolist(), "order"), method=f"read from {path.name}")
    if "vesselABC" not in content:
        return from_arrays_matlab(content, path.name)
    fields = content["vesselABC"]
    # A cell is a list, column by column.
    found = from_arrays_matlab({f"{key}_{k % 6 + 1}{k // 6 + 1}": part for key in ("Ar", "Br", "Cr")
                                for k, part in enumerate(listed(fields[key], key)) if np.size(part)}, path.name)
    return found.replace(b=found.b * MSS_AXES, c=MSS_AXES[:, None] * found.c)


def from_arrays_matlab(arrays: Mapping[str, Any], name: str = "MSS") -> RadiationFit:
    """Return the model of MSS's arrays Ar_ij, Br_ij, Cr_ij (i, j from 1 to 6), one subsystem for each entry.

    The axes stay as they are; those of a vesselABC file are turned by `read_matlab`.

    Raises
    ------
    InputError
        If there are none.
    """
    keys = [key for key in arrays if key.startswith("Ar_")]
    if not keys:
        raise InputError(f"{name}: no radiation model; A, B, C and dofs, or MSS's Ar_ij, Br_ij, Cr_ij are needed")
    parts, rows, columns = [], [], []
    for key in keys:
        i, j = int(key[3]) - 1, int(key[-1]) - 1
        a = np.atleast_2d(np.asarray(arrays[key], dtype=float))
        parts.append((a, np.reshape(arrays[f"Br_{key[3:]}"], (-1, 1)).astype(float),
                      np.reshape(arrays[f"Cr_{key[3:]}"], (1, -1)).astype(float)))
        rows.append([i])
        columns.append([j])
    a, b, c = side_by_side(parts, rows, columns, 6)
    return RadiationFit(tuple(six_names([""])), a, b, c, order=max(part[0].shape[0] for part in parts),
                        method=f"read from {name}")
