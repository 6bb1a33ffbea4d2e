"""BEMIO .h5: the state_space groups that WEC-Sim reads."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.atomic import write_whole
from radiation_ss.errors import InputError
from radiation_ss.export.places import six_names, six_places
from radiation_ss.fit.rational import minimal, side_by_side
from radiation_ss.fit.result import RadiationFit
from radiation_ss.reading import check_size

STATE_SPACE = "hydro_coeffs/radiation_damping/state_space"


def _entry(fit: RadiationFit, i: int, j: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the smallest realisation of one entry, or None where it is zero."""
    if not np.any(fit.b[:, j]) or not np.any(fit.c[i]):
        return None
    a, b, c = minimal(fit.a, fit.b[:, [j]], fit.c[[i]], tolerance=1e-10)
    return (a, b, c) if a.size else None


def write_bemio(fit: RadiationFit, path: Path) -> None:
    """Write BEMIO's state_space groups, one subsystem for each entry; C over rho, as WEC-Sim expects."""
    import h5py

    places, bodies = six_places(fit.dofs, path)
    rho = 1000.0 if fit.data is None else fit.data.rho
    n = 6 * len(bodies)
    entries = {(places[i], places[j]): part for i in range(len(places)) for j in range(len(places))
               if (part := _entry(fit, i, j)) is not None}
    most = max(part[0].shape[0] for part in entries.values())
    # In memory, for on a disk that is full the HDF5 library ends the process.
    raw = BytesIO(path.read_bytes() if path.exists() else b"")
    with h5py.File(raw, "r+" if path.exists() else "w") as file:
        _same_density(file, rho, path)
        for k, name in enumerate(bodies):
            A, B = np.zeros((6, n, most, most)), np.zeros((6, n, most, 1))
            C, it = np.zeros((6, n, 1, most)), np.zeros((6, n))
            for (i, j), (a, b, c) in entries.items():
                if i // 6 == k:
                    states = a.shape[0]
                    A[i % 6, j, :states, :states], B[i % 6, j, :states] = a, b
                    C[i % 6, j, :, :states], it[i % 6, j] = c / rho, states
            group = f"body{k + 1}/{STATE_SPACE}"
            if group in file:
                del file[group]
            for field, values in (("A/all", A), ("B/all", B), ("C/all", C), ("D/all", np.zeros((6, n))), ("it", it)):
                file[f"{group}/{field}"] = values
            if f"body{k + 1}/properties/name" not in file:
                file[f"body{k + 1}/properties/name"] = name or f"body{k + 1}"
    write_whole(path, raw.getvalue())


def _same_density(file: Any, rho: float, path: Path) -> None:
    """Write the density, or check the one that is there."""
    if "simulation_parameters/rho" not in file:
        file["simulation_parameters/rho"] = np.array([[rho]])
        return
    have = float(np.ravel(file["simulation_parameters/rho"][()])[0])
    if abs(have - rho) > 1e-6 * rho:
        raise InputError(f"{path.name}: density {have:g} kg/m^3 in the file, {rho:g} in the fit's data; "
                         "write to a new file")


def read_bemio(path: Path) -> RadiationFit:
    """Read BEMIO's state_space groups: K = rho C (s I - A)^-1 B, entry by entry; D is left out, as WEC-Sim does.

    Raises
    ------
    InputError
        If the file is not HDF5 or has no state_space groups.
    """
    import h5py

    check_size(path)
    with h5py.File(path, "r") as file:
        groups = sorted((g for g in file if g.startswith("body") and f"{g}/{STATE_SPACE}/A/all" in file),
                        key=lambda g: int(g[4:]))
        if not groups:
            raise InputError(f"{path.name}: no state_space group; fit_radiation makes one")
        rho = float(_numbers(file, "simulation_parameters/rho").ravel()[0])
        bodies = [_name(file, g) for g in groups]
        parts, rows, columns = [], [], []
        for k, g in enumerate(groups):
            A, B, C, it = (_numbers(file, f"{g}/{STATE_SPACE}/{field}") for field in ("A/all", "B/all", "C/all", "it"))
            if it.shape != (6, 6 * len(groups)) or not np.isin(it, np.arange(A.shape[-1] + 1)).all():
                raise InputError(f"{path.name}: {g}/{STATE_SPACE}/it: numbers of states of 6 times "
                                 f"{6 * len(groups)} entries are needed, at most {A.shape[-1]} each")
            for i, j in zip(*np.nonzero(it)):
                states = int(it[i, j])
                parts.append((A[i, j, :states, :states], B[i, j, :states].reshape(-1, 1),
                              rho * C[i, j].reshape(1, -1)[:, :states]))
                rows.append([6 * k + int(i)])
                columns.append([int(j)])
    names = six_names(bodies)
    a, b, c = side_by_side(parts, rows, columns, len(names))
    return RadiationFit(tuple(names), a, b, c, order=max(part[0].shape[0] for part in parts),
                        method=f"read from {path.name}")


def _numbers(file: Any, name: str) -> FloatArray:
    """Return a data set of finite numbers."""
    values = np.asarray(file[name][()])
    if values.dtype.kind not in "fiu" or not np.isfinite(values).all() or values.size == 0:
        raise InputError(f"{name} holds {values.dtype}, finite numbers are needed")
    return values.astype(float)


def _name(file: Any, group: str) -> str:
    """Return the name of a body."""
    path = f"{group}/properties/name"
    value = np.ravel(file[path][()])[0] if path in file else group
    return value.decode() if isinstance(value, bytes) else str(value)
