"""Radiation models in the file forms of other tools: OpenFAST, BEMIO, MATLAB."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.atomic import write_rows, write_whole
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import Realisation, minimal, modes, side_by_side
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import RIGID
from radiation_ss.hydro.readers.assemble import MSS_AXES, body_groups, six_dofs, six_places
from radiation_ss.hydro.readers.text import head_and_rows, index, leading, lines, row
from radiation_ss.reading import check_size, listed, read_arrays, read_mat, texts, whole_number, within


def write_openfast(fit: RadiationFit, path: Path) -> None:
    """Write HydroDyn's state-space radiation: six columns for each body, and the force -K v as output.

    The first line names what moves, and several bodies in their order, which is that of the fit: the form itself only
    counts bodies, and HydroDyn takes no file with a degree of freedom that is not enabled.
    """
    places, bodies = six_places(fit.dofs, path)
    N, n = fit.states, 6 * len(bodies)
    b, c = np.zeros((N, n)), np.zeros((n, N))
    b[:, places], c[places] = fit.b, -fit.c
    # A state is of the degree of freedom that reads it, itself or through others: |c| (1 + q + q^2 + ...) with q < 1.
    through = np.abs(fit.a) / (2.0 * max(float(np.linalg.norm(fit.a)), 1e-300))
    read = np.abs(c) @ np.linalg.inv(np.eye(N) - through)
    owned = np.bincount((read / np.maximum(read.max(axis=1, keepdims=True, initial=0.0), 1e-300)).argmax(axis=0),
                        minlength=n)
    order = f"; bodies in this order: {', '.join(bodies)}" if len(bodies) > 1 else ""
    of = ", ".join(six_dofs([""] * len(bodies))[k] for k in sorted(places))
    lines = [f"radiation_ss: state-space radiation model, y = C x is the force on the body; of {of}{order}",
             f"{' '.join('1' * n)}    %Enabled DoFs", f"{N}    %Radiation states",
             f"{' '.join(map(str, owned))}    %Radiation states per DoF"]
    write_rows(path, lines, (fit.a, b, c))


def read_openfast(path: Path) -> RadiationFit:
    """Read HydroDyn's .ss as K = -C (s I - A)^-1 B.

    Degrees of freedom are those that are enabled, in this package's own files those that the first line names; one
    whose column of B and row of C are zero does not radiate.
    """
    if "SS_Excitation" in next(iter(lines(path)), ""):
        raise InputError(f"{path.name}: a model of the wave excitation by its first line; read_excitation reads it")
    head, rows = head_and_rows(path, 4, "an OpenFAST .ss file")
    enabled = row(path, 1, head[1].split("%")[0], None, "enabled degrees of freedom")
    N = index(path, 2, leading(path, 2, head[2].split("%")[0], 1, "radiation states")[0], 10_000, "number of states")
    n = len(enabled)
    if n % 6 or n == 0 or [len(row) for row in rows] != [N] * N + [n] * N + [N] * n:
        raise InputError(f"{path.name}: {len(rows)} rows of numbers; {N} states and {n} degrees of freedom need "
                         f"{N} rows of {N}, {N} rows of {n}, {n} rows of {N}")
    names = six_dofs([""] * (n // 6))
    b, c = np.reshape(rows[N:2 * N], (N, n)), np.reshape(rows[2 * N:], (n, N))
    own = re.search(r"^radiation_ss: .*?; of ([^;]+)", " ".join(head[0].split()))
    keep = [k for k in range(n) if (names[k] in own[1].strip().split(", ") if own else enabled[k])]
    if not (b[:, keep].any() or c[keep].any()):
        raise InputError(f"{path.name}: no enabled degree of freedom has a column of B or a row of C other than zero")
    return RadiationFit(tuple(names[k] for k in keep), np.reshape(rows[:N], (N, N)), b[:, keep], -c[keep], order=N,
                        method=f"read from {path.name}")


Parts = dict[tuple[int, int], Realisation]  # by row and column
STATE_SPACE = "hydro_coeffs/radiation_damping/state_space"


def write_bemio(fit: RadiationFit, path: Path) -> None:
    """Write BEMIO's state_space groups, a subsystem an entry, for all bodies of a file that is there; C over rho."""
    import h5py

    places, bodies = six_places(fit.dofs, path)
    if path.exists():
        places, bodies = _places_in(path, places, bodies)
    n = 6 * len(bodies)
    entries = {(places[i], places[j]): part for (i, j), part in _entries(fit).items()}
    if not entries:
        raise InputError(f"{path.name}: a model without radiation has no states to write; this form needs one at least")
    nothing = -np.eye(1), np.zeros((1, 1)), np.zeros((1, 1))  # motions are told by their states, still ones too
    entries |= {(at, at): nothing for at in places if all(at not in entry for entry in entries)}
    most = max(part[0].shape[0] for part in entries.values())
    # In memory, for on a disk that is full the HDF5 library ends the process.
    raw = BytesIO(path.read_bytes() if path.exists() else b"")
    with h5py.File(raw, "r+" if path.exists() else "w") as file:
        rho = _density(file, fit, path)
        for k, name in enumerate(bodies):
            group = f"body{k + 1}/{STATE_SPACE}"
            if group in file:
                del file[group]
            B, C, it = np.zeros((6, n, most, 1)), np.zeros((6, n, 1, most)), np.zeros((6, n))
            A = file.create_dataset(f"{group}/A/all", (6, n, most, most), "f8", chunks=(1, 1, most, most),
                                    compression="gzip")  # of entries without states there is nothing in the file
            for (i, j), (a, b, c) in entries.items():
                if i // 6 == k:
                    states = a.shape[0]
                    A[i % 6, j, :states, :states], B[i % 6, j, :states] = a, b
                    C[i % 6, j, :, :states], it[i % 6, j] = c / rho, states
            for field, values in (("B/all", B), ("C/all", C), ("D/all", np.zeros((6, n))), ("it", it)):
                file.create_dataset(f"{group}/{field}", data=values, compression="gzip")
            if f"body{k + 1}/properties/name" not in file:
                file[f"body{k + 1}/properties/name"] = name or f"body{k + 1}"
    write_whole(path, raw.getvalue())


def _entries(fit: RadiationFit, share: float = 1e-13) -> Parts:
    """Return a subsystem for each entry of K, of the modes that it shows where these are far apart.

    A mode's part in an entry counts relative to its largest, motions scaled.
    """
    found = modes(fit.a, fit.b, fit.c)
    if found is None:
        return {(i, j): minimal(fit.a, fit.b[:, [j]], fit.c[[i]], tolerance=1e-10)
                for i in range(len(fit.dofs)) for j in range(len(fit.dofs)) if fit.b[:, j].any() and fit.c[i].any()}
    poles, R = (part[found[0].imag >= 0.0] for part in found)
    size = np.abs(R) / np.maximum(np.abs(poles.real), 1e-300)[:, None, None]
    row, column = (size.max(axis=axis, initial=0.0) for axis in ((0, 2), (0, 1)))
    size = size / np.maximum(row[:, None] * column, 1e-300)
    shown = size > share * np.maximum(size.max(axis=(1, 2), keepdims=True, initial=0.0), 1e-2 * size.max(initial=0.0))
    return {(i, j): in_modes(poles[at], R[at, i, j]) for i, j in np.ndindex(R.shape[1:])
            if (at := shown[:, i, j]).any()}


def in_modes(poles: ComplexArray, residues: ComplexArray) -> Realisation:
    """Return the sum of r / (s - p), with the conjugate where p is not real, a block for each."""
    pairs = [bool(p.imag) for p in poles]
    a = block_diag(*([[p.real, p.imag], [-p.imag, p.real]] if p.imag else [[p.real]] for p in poles))
    b = np.concatenate([[1.0, 0.0] if pair else [1.0] for pair in pairs])
    c = np.concatenate([[2.0 * r.real, 2.0 * r.imag] if pair else [r.real] for pair, r in zip(pairs, residues)])
    return a, b[:, None], c[None]


def _places_in(path: Path, places: Sequence[int], bodies: Sequence[str]) -> tuple[list[int], list[str]]:
    """Return the places of a fit's degrees of freedom among the bodies of a file, and these by name."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            there = body_groups(file)[1]
    except OSError:
        raise InputError(f"{path.name}: exists and is not an HDF5 file; write to a new one") from None
    if not there or (len(there) == len(bodies) == 1 and not bodies[0]):
        return list(places), list(bodies)
    for name in bodies:
        if name not in there:
            raise InputError(f"{path.name}: {f'body {name!r}' if name else 'a body without a name'} in the fit, "
                             f"{', '.join(there)} in the file; write to a new file, or name the fit's degrees of "
                             f"freedom after them ({there[0]}__Heave)")
    return [6 * there.index(bodies[place // 6]) + place % 6 for place in places], there


def _density(file: Any, fit: RadiationFit, path: Path) -> float:
    """Return the density of a file, put down if it is not there: the fit's, 1000 kg/m^3 if it has none."""
    if "simulation_parameters/rho" not in file:
        file["simulation_parameters/rho"] = np.array([[fit.density or 1000.0]])
    have = float(np.ravel(file["simulation_parameters/rho"][()])[0])
    if fit.density is not None and abs(have - fit.density) > 1e-6 * fit.density:
        raise InputError(f"{path.name}: density {have:g} kg/m^3 in the file, {fit.density:g} in the fit's data; "
                         "write to a new file")
    return have


def read_bemio(path: Path) -> RadiationFit:
    """Read BEMIO's state_space groups: K = rho C (s I - A)^-1 B, entry by entry; D is left out, as WEC-Sim does.

    Degrees of freedom without states are left out; one whose states have no input or no output does not radiate.
    """
    import h5py

    check_size(path)
    with h5py.File(path, "r") as file:
        bodies = {g: name for g, name in zip(*body_groups(file)) if f"{g}/{STATE_SPACE}/A/all" in file}
        if not bodies:
            raise InputError(f"{path.name}: no state_space group; fit_radiation makes one")
        rho = float(_numbers(file, "simulation_parameters/rho").ravel()[0])
        names = six_dofs(list(bodies.values()))
        parts: Parts = {}
        for k, g in enumerate(bodies):
            B, C, it = (_numbers(file, f"{g}/{STATE_SPACE}/{field}") for field in ("B/all", "C/all", "it"))
            most = min(file[f"{g}/{STATE_SPACE}/A/all"].shape[-1], 10_000)
            if it.shape != (6, 6 * len(bodies)) or not np.isin(it, np.arange(most + 1)).all():
                raise InputError(f"{path.name}: {g}/{STATE_SPACE}/it: numbers of states of 6 times "
                                 f"{6 * len(bodies)} entries are needed, at most {most} each")
            within(path, 8 * int((it**2).sum()))
            for i, j in zip(*np.nonzero(it)):
                states = int(it[i, j])
                A = _numbers(file, f"{g}/{STATE_SPACE}/A/all", (i, j, slice(states), slice(states)))
                parts[6 * k + int(i), int(j)] = (A, B[i, j, :states].reshape(-1, 1),
                                                 rho * C[i, j].reshape(1, -1)[:, :states])
    told = {i for pair in parts for i in pair}
    parts = {pair: part for pair, part in parts.items() if part[1].any() and part[2].any()}
    if not parts:
        raise InputError(f"{path.name}: no entry of its state_space groups has states with an input and an output")
    found = _joined(names, parts, path.name).select([name for i, name in enumerate(names) if i in told])
    return replace(found, rho=rho)


def _joined(dofs: Sequence[str], parts: Parts, name: str) -> RadiationFit:
    """Return the model of one subsystem for each entry."""
    joint = _by_modes(parts, len(dofs))
    if joint is None:
        within(name, 8 * sum(part[0].shape[0] for part in parts.values()) ** 2)
        joint = side_by_side(list(parts.values()), [[i] for i, _ in parts], [[j] for _, j in parts], len(dofs))
    a, b, c = joint
    return RadiationFit(tuple(dofs), a, b, c, order=max(part[0].shape[0] for part in parts.values()),
                        method=f"read from {name}")


def _by_modes(parts: Parts, n: int, share: float = 1e-12) -> Realisation | None:
    """Return the model of subsystems in the form of `in_modes`, each mode once; None if any has another form."""
    R: dict[complex, ComplexArray] = {}
    for at, (a, b, c) in parts.items():
        if not b.size or a.shape != (b.size, b.size) or c.size != b.size:
            return None
        up = np.r_[0.0, np.diag(a, 1), 0.0]
        first = np.flatnonzero(up[:-1] == 0.0)
        poles, pair = np.diag(a)[first] + 1j * up[first + 1], up[first + 1] != 0.0
        residues = np.where(pair, 0.5 * (c[0][first] + 1j * np.append(c[0], 0.0)[first + 1]), c[0][first])
        if not all(map(np.array_equal, in_modes(poles, residues)[:2], (a, b))):
            return None
        for pole, residue in zip(poles.tolist(), residues):
            R.setdefault(pole, np.zeros((n, n), dtype=complex))[at] += residue
    found = []
    for pole, entries in R.items():
        matrix = entries if pole.imag else entries.real
        row, column = (np.maximum(np.abs(matrix).max(axis=axis), 1e-300) for axis in (1, 0))
        u, s, v = np.linalg.svd(matrix / row[:, None] / column)
        for k in range(int((s > share * s[0]).sum())):
            left, right = row * u[:, k] * s[k], column * v[k]
            if not pole.imag:
                found.append((np.array([[pole.real]]), right[None], left[:, None]))
                continue
            found.append((np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
                          np.stack([right.real, right.imag]), np.stack([2.0 * left.real, -2.0 * left.imag], axis=1)))
    return side_by_side(found, [range(n)] * len(found), [range(n)] * len(found), n)


def _numbers(file: Any, name: str, where: tuple[Any, ...] = ()) -> FloatArray:
    """Return a data set of finite numbers, or the part of it `where`."""
    values = np.asarray(file[name][where])
    if values.dtype.kind not in "fiu" or not np.isfinite(values).all() or values.size == 0:
        raise InputError(f"{name} holds {values.dtype}, finite numbers are needed")
    return values.astype(float)


def write_matlab(fit: RadiationFit, path: Path) -> None:
    """Write A, B, C, the names of the degrees of freedom and A_inf as a MATLAB file."""
    from scipy.io import savemat

    raw = BytesIO()
    savemat(raw, {"A": fit.a, "B": fit.b, "C": fit.c, "dofs": np.array(fit.dofs, dtype=object),
                  "order": fit.order, "A_inf": np.zeros((0, 0)) if fit.A_inf is None else fit.A_inf})
    # A head without the time, so that a fit gives the same file each time.
    write_whole(path, b"MATLAB 5.0 MAT-file, written by radiation_ss".ljust(116) + raw.getvalue()[116:])


def read_matlab(path: Path) -> RadiationFit:
    """Read a .mat or .npz: `write_matlab`'s A, B, C, or MSS's Ar, Br, Cr by entry; InputError without either."""
    content: dict[str, Any] = dict(read_arrays(path)) if path.suffix == ".npz" else read_mat(path)
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
    """Return the model of MSS's arrays Ar_ij, Br_ij, Cr_ij (i, j from 1 to 6), axes as they are, by entries."""
    keys = [key for key in arrays if key.startswith("Ar_")]
    if not keys:
        raise InputError(f"{name}: no radiation model; A, B, C and dofs, or MSS's Ar_ij, Br_ij, Cr_ij are needed")
    return _joined(RIGID, {(int(key[3]) - 1, int(key[-1]) - 1): (
        np.atleast_2d(np.asarray(arrays[key], dtype=float)), np.reshape(arrays[f"Br_{key[3:]}"], (-1, 1)).astype(float),
        np.reshape(arrays[f"Cr_{key[3:]}"], (1, -1)).astype(float)) for key in keys}, name)
