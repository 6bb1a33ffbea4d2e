"""Radiation models in the forms of other tools: OpenFAST .ss, BEMIO .h5, MATLAB .mat."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import minimal, side_by_side
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import body, mode

ORDER_OF_MODES = {name: k for k, name in enumerate(("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"))}
STATE_SPACE = "hydro_coeffs/radiation_damping/state_space"


def six_positions(fit: RadiationFit, path: Path) -> tuple[list[int], list[str]]:
    """Return the place of each degree of freedom among 6 for each body, and the bodies."""
    bodies = list(dict.fromkeys(body(dof) for dof in fit.dofs))
    foreign = [dof for dof in fit.dofs if mode(dof) not in ORDER_OF_MODES]
    if foreign:
        raise InputError(f"{path.name}: degree of freedom {foreign[0]!r} has no place in this form; only "
                         f"{', '.join(ORDER_OF_MODES)} have (write .json instead)")
    return [6 * bodies.index(body(dof)) + ORDER_OF_MODES[mode(dof)] for dof in fit.dofs], bodies


def six_names(bodies: list[str]) -> list[str]:
    """Return the names of 6 degrees of freedom for each body."""
    return [f"{name}__{dof}" if len(bodies) > 1 else dof for name in bodies for dof in ORDER_OF_MODES]


def write_openfast(fit: RadiationFit, path: Path) -> None:
    """Write HydroDyn's state-space radiation (RdtnMod = 2): six columns for each body."""
    places, bodies = six_positions(fit, path)
    N, n = fit.states, 6 * len(bodies)
    b, c = np.zeros((N, n)), np.zeros((n, N))
    b[:, places], c[places] = fit.b, fit.c
    enabled, owned = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
    enabled[places] = 1
    for k in range(N):
        owned[int(np.argmax(np.abs(c[:, k])))] += 1
    lines = ["radiation_ss: state-space radiation model", f"{_row(enabled)}    %Enabled DoFs",
             f"{N}    %Radiation states", f"{_row(owned)}    %Radiation states per DOFs"]
    lines += [" ".join(f"{value:.16e}" for value in row) for matrix in (fit.a, b, c) for row in matrix]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(values: FloatArray) -> str:
    return " ".join(str(int(value)) for value in values)


def read_openfast(path: Path) -> RadiationFit:
    """Read HydroDyn's .ss; degrees of freedom that are not enabled are left out.

    Raises
    ------
    InputError
        If the numbers of rows or columns do not fit the header.
    """
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    try:
        enabled = [int(float(word)) for word in lines[1].split("%")[0].split()]
        N = int(float(lines[2].split("%")[0]))
        rows = [[float(word) for word in line.split()] for line in lines[4:] if line.strip()]
    except (IndexError, ValueError) as error:
        raise InputError(f"{path.name}: not an OpenFAST .ss file: four header lines, then rows of numbers "
                         f"({error})") from None
    n = len(enabled)
    shape = [len(row) for row in rows]
    if n % 6 or n == 0 or shape != [N] * N + [n] * N + [N] * n:
        raise InputError(f"{path.name}: {len(rows)} rows of numbers; {N} states and {n} degrees of freedom need "
                         f"{N} rows of {N}, {N} rows of {n}, {n} rows of {N}")
    names = six_names([f"body{k + 1}" for k in range(n // 6)])
    keep = [k for k in range(n) if enabled[k]]
    return RadiationFit(tuple(names[k] for k in keep), np.reshape(rows[:N], (N, N)),
                        np.reshape(rows[N:2 * N], (N, n))[:, keep],
                        np.reshape(rows[2 * N:], (n, N))[keep], order=N, method=f"read from {path.name}")


def entry(fit: RadiationFit, i: int, j: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the smallest realisation of one entry, or None where it is zero."""
    if not np.any(fit.b[:, j]) or not np.any(fit.c[i]):
        return None
    a, b, c = minimal(fit.a, fit.b[:, [j]], fit.c[[i]], tolerance=1e-10)
    return (a, b, c) if a.size else None


def write_bemio(fit: RadiationFit, path: Path) -> None:
    """Write BEMIO's state_space groups, one subsystem for each entry; C over rho, as WEC-Sim expects."""
    import h5py

    places, bodies = six_positions(fit, path)
    rho = 1000.0 if fit.data is None else fit.data.rho
    n = 6 * len(bodies)
    entries = {(places[i], places[j]): part for i in range(len(places)) for j in range(len(places))
               if (part := entry(fit, i, j)) is not None}
    most = max(part[0].shape[0] for part in entries.values())
    with h5py.File(path, "a") as file:
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

    try:
        with h5py.File(path, "r") as file:
            groups = sorted((g for g in file if g.startswith("body") and f"{g}/{STATE_SPACE}/A/all" in file),
                            key=lambda g: int(g[4:]))
            if not groups:
                raise InputError(f"{path.name}: no state_space group; fit_radiation makes one")
            rho = float(np.ravel(file["simulation_parameters/rho"][()])[0])
            bodies = [_name(file, g) for g in groups]
            parts, rows, columns = [], [], []
            for k, g in enumerate(groups):
                A, B, C, it = (np.asarray(file[f"{g}/{STATE_SPACE}/{field}"][()], dtype=float)
                               for field in ("A/all", "B/all", "C/all", "it"))
                for i, j in zip(*np.nonzero(it)):
                    states = int(it[i, j])
                    parts.append((A[i, j, :states, :states], B[i, j, :states].reshape(-1, 1),
                                  rho * C[i, j].reshape(1, -1)[:, :states]))
                    rows.append([6 * k + int(i)])
                    columns.append([int(j)])
    except OSError as error:
        raise InputError(f"{path.name}: not an HDF5 file ({error})") from None
    names = six_names(bodies)
    a, b, c = side_by_side(parts, rows, columns, len(names))
    return RadiationFit(tuple(names), a, b, c, order=max(part[0].shape[0] for part in parts),
                        method=f"read from {path.name}")


def _name(file: Any, group: str) -> str:
    """Return the name of a body."""
    path = f"{group}/properties/name"
    value = np.ravel(file[path][()])[0] if path in file else group
    return value.decode() if isinstance(value, bytes) else str(value)


def write_matlab(fit: RadiationFit, path: Path) -> None:
    """Write A, B, C, the names of the degrees of freedom and A_inf as a MATLAB file."""
    from scipy.io import savemat

    savemat(path, {"A": fit.a, "B": fit.b, "C": fit.c, "dofs": np.array(fit.dofs, dtype=object), "order": fit.order,
                   "A_inf": np.zeros((0, 0)) if fit.A_inf is None else fit.A_inf})


def read_matlab(path: Path) -> RadiationFit:
    """Read a .mat or .npz: `write_matlab`'s A, B, C, or MSS's Ar, Br, Cr by entry.

    Raises
    ------
    InputError
        If neither is there.
    """
    from scipy.io import loadmat

    if path.suffix == ".npz":
        with np.load(path) as file:
            content: dict[str, Any] = {key: file[key] for key in file.files}
    else:
        try:
            content = loadmat(path, squeeze_me=False)
        except (ValueError, NotImplementedError, OSError) as error:
            raise InputError(f"{path.name}: not a MATLAB file up to version 7 ({error})") from None
    if {"A", "B", "C", "dofs"} <= set(content):
        A_inf = content.get("A_inf", np.zeros((0, 0)))
        dofs = tuple(str(np.ravel(dof)[0]) for dof in np.ravel(content["dofs"]))
        return RadiationFit(dofs, content["A"], content["B"], content["C"], A_inf=A_inf if np.size(A_inf) else None,
                            order=int(np.ravel(content["order"])[0]), method=f"read from {path.name}")
    if "vesselABC" in content:
        fields = content["vesselABC"][0, 0]
        content = {f"{key}_{i + 1}{j + 1}": fields[key][i, j] for key in ("Ar", "Br", "Cr")
                   for i in range(6) for j in range(6) if np.size(fields[key][i, j])}
    return from_mss(content, path.name)


def from_mss(arrays: Mapping[str, Any], name: str = "MSS") -> RadiationFit:
    """Return the model of MSS's arrays Ar_ij, Br_ij, Cr_ij (i, j from 1 to 6), one subsystem for each entry.

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
