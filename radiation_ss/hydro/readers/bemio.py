"""BEMIO's .h5, the form of WEC-Sim: one group for each body, coefficients as WAMIT leaves them.

A / rho, B / (rho w), X / (rho g), C / (rho g); e^{+i w t}; angles in degrees; moments about each body's `cg`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.measures import horizontal_lead, is_reversed
from radiation_ss.hydro.readers.assemble import assemble, common_point, constant, six_dofs
from radiation_ss.reading import check_size, decoded, hdf5_text

if TYPE_CHECKING:
    import h5py


def read(path: Path, **given: float) -> HydroData:
    """Read a file written by WEC-Sim's BEMIO (or by the older Python BEMIO).

    InputError if the file is not HDF5, is not BEMIO's, or bodies and sizes do not fit.
    """
    import h5py

    def whole() -> HydroData:
        check_size(path)
        with h5py.File(path, "r") as file:
            return _read(path, file, given)

    return decoded(path, "HDF5 file", whole)


def _read(path: Path, file: h5py.File, given: dict[str, float]) -> HydroData:
    groups = sorted((name for name in file if name.startswith("body") and name[4:].isdigit()),
                    key=lambda name: int(name[4:]))
    if not groups or "simulation_parameters" not in file:
        raise InputError(f"{path}: not a BEMIO file: groups simulation_parameters and body1 are needed, "
                         f"found {sorted(file)[:6]}")
    notes: list[str] = []
    omega = _array(path, file, "simulation_parameters/w").ravel()
    rho = constant(path, "rho", _scalar(path, file, "simulation_parameters/rho"), given, 1000.0, notes)
    g = constant(path, "g", _scalar(path, file, "simulation_parameters/g"), given, 9.81, notes)
    place = "simulation_parameters/water_depth"
    stated = np.inf if hdf5_text(file, place).lower().startswith("inf") else _scalar(path, file, place)
    depth = constant(path, "depth", stated, given, np.inf, notes)
    scaled = _scalar(path, file, "simulation_parameters/scaled") or 0.0
    if scaled:
        notes.append(f"{path}: marked as scaled; coefficients taken as SI as they stand")
    unit, weight = (1.0, 1.0) if scaled else (rho, rho * g)
    n, nw = 6 * len(groups), omega.size
    inner = "hydro_coeffs/"
    A = np.concatenate([_array(path, file, f"{b}/{inner}added_mass/all", (6, n, nw)) for b in groups]) * unit
    B = np.concatenate([_array(path, file, f"{b}/{inner}radiation_damping/all", (6, n, nw)) for b in groups]) * unit
    if not scaled:
        B = B * omega
    fields: dict[str, Any] = {}
    if all(f"{b}/{inner}added_mass/inf_freq" in file for b in groups):
        fields["A_inf"] = unit * np.concatenate([_array(path, file, f"{b}/{inner}added_mass/inf_freq", (6, n))
                                                 for b in groups])
        code = hdf5_text(file, "bem_data/code")
        if code and code.upper() != "WAMIT":
            notes.append(f"{path}: from {code}, so BEMIO's inf_freq may be its estimate, not a computed limit")
    if all(f"{b}/{inner}linear_restoring_stiffness" in file for b in groups):
        fields["C"] = np.zeros((n, n))
        for k, b in enumerate(groups):
            block = slice(6 * k, 6 * k + 6)
            fields["C"][block, block] = weight * _array(path, file, f"{b}/{inner}linear_restoring_stiffness", (6, 6))
    fields |= _excitation(path, file, [f"{b}/{inner}excitation/" for b in groups], nw, weight)
    dofs = six_dofs([hdf5_text(file, f"{b}/properties/name") or b for b in groups])
    if hdf5_text(file, "bem_data/code").upper() == "NEMOH" and is_reversed(horizontal_lead(
            fields.get("X"), fields.get("C"), dofs, fields.get("directions"))):
        fields["X"] = fields["X"].conj()
        notes.append(f"{path}: X has NEMOH's phases, exp(-i w t), as old versions of BEMIO left them; converted")
    points = {b: _point(path, file, f"{b}/properties/cg") for b in groups if f"{b}/properties/cg" in file}
    point, more = common_point(path, dofs, points if len(points) == len(groups) else None)
    return assemble(path, omega, np.moveaxis(A, -1, 0), np.moveaxis(B, -1, 0), dofs, rho=rho, g=g, depth=depth,
                    reference_point=point, notes=notes + more, **fields)


def _excitation(path: Path, file: h5py.File, places: list[str], nw: int, weight: float) -> dict[str, Any]:
    if not all(f"{place}{part}" in file for place in places for part in ("re", "im")):
        return {}
    angle = _array(path, file, "simulation_parameters/wave_dir").ravel()
    size = (6, angle.size, nw)
    X = np.concatenate([_array(path, file, place + "re", size) + 1j * _array(path, file, place + "im", size)
                        for place in places])
    return {"X": weight * X.transpose(2, 1, 0), "directions": np.deg2rad(angle)}


def _array(path: Path, file: h5py.File, name: str, shape: tuple[int, ...] | None = None) -> FloatArray:
    if name not in file or not hasattr(file[name], "dtype"):
        raise InputError(f"{path}: not a whole BEMIO file: {name} is missing")
    value = file[name][()]
    if getattr(value, "dtype", np.dtype(object)).kind not in "fiub":
        raise InputError(f"{path}: {name} does not hold numbers")
    array = np.asarray(value, dtype=float)
    if shape is not None and array.shape != shape:
        raise InputError(f"{path}: {name} has shape {array.shape}; {shape} needed (6 rigid modes a body)")
    return array


def _scalar(path: Path, file: h5py.File, name: str) -> float | None:
    if name not in file:
        return None
    array = _array(path, file, name)
    if array.size != 1:
        raise InputError(f"{path}: {name} has {array.size} values; one is needed")
    return float(array.ravel()[0])


def _point(path: Path, file: h5py.File, name: str) -> tuple[float, ...]:
    array = _array(path, file, name)
    if array.size != 3 or not np.isfinite(array).all():
        raise InputError(f"{path}: {name} has {array.size} values; a point (x, y, z) [m] is needed")
    return tuple(array.ravel().tolist())
