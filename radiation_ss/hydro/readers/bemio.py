"""BEMIO's .h5, the form of WEC-Sim: one group for each body, coefficients as WAMIT leaves them.

A / rho, B / (rho w), X / (rho g), C / (rho g); e^{+i w t}; directions in degrees, phases in rad; moments about each
body's `cg`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.measures import horizontal_lead, is_reversed
from radiation_ss.hydro.readers.assemble import assemble, body_groups, constants, six_dofs
from radiation_ss.reading import check_size, decoded, hdf5_text

HEAD = "simulation_parameters"


def read(path: Path, **given: float) -> HydroData:
    """Read a file written by WEC-Sim's BEMIO (or by the older Python BEMIO)."""
    import h5py

    def whole() -> HydroData:
        check_size(path)
        with h5py.File(path, "r") as file:
            return _read(path, file, given)

    return decoded(path, "HDF5 file", whole)


def _read(path: Path, file: Any, given: dict[str, float]) -> HydroData:
    groups, bodies = body_groups(file)
    if not groups or HEAD not in file:
        raise InputError(f"{path}: not a BEMIO file: groups {HEAD} and body1 are needed, found {sorted(file)[:6]}")

    def there(name: str) -> bool:
        return all(f"{b}/hydro_coeffs/{name}" in file for b in groups)

    def stacked(name: str, *size: int) -> FloatArray:
        return np.concatenate([_array(path, file, f"{b}/hydro_coeffs/{name}", (6, *size)) for b in groups])

    notes: list[str] = []
    omega = _array(path, file, f"{HEAD}/w").ravel()
    places = {"rho": f"{HEAD}/rho", "g": f"{HEAD}/g", "depth": f"{HEAD}/water_depth"}
    stated = constants(path, {field: _scalar(path, file, place) for field, place in places.items()}, given, notes)
    scaled = _scalar(path, file, f"{HEAD}/scaled") or 0.0
    if scaled:
        notes.append(f"{path}: marked as scaled; coefficients taken as SI as they stand")
    unit, weight, rate = (1.0, 1.0, 1.0) if scaled else (stated["rho"], stated["rho"] * stated["g"], omega)
    n, nw = 6 * len(groups), omega.size
    A, B = stacked("added_mass/all", n, nw) * unit, stacked("radiation_damping/all", n, nw) * unit * rate
    fields: dict[str, Any] = {}
    code = hdf5_text(file, "bem_data/code").upper()
    if there("added_mass/inf_freq"):
        fields["A_inf"] = unit * stacked("added_mass/inf_freq", n)
        if code not in ("", "WAMIT"):
            notes.append(f"{path}: from {code}, so BEMIO's inf_freq may be its estimate, not a computed limit")
    if there("linear_restoring_stiffness"):
        fields["C"] = block_diag(*np.split(weight * stacked("linear_restoring_stiffness", 6), len(groups)))
    force = f"{groups[0]}/hydro_coeffs/excitation"
    parts = ("re", "im") if f"{force}/re" in file or f"{force}/im" in file else ("mag", "phase")
    halves = [f"{b}/hydro_coeffs/excitation/{part}" for b in groups for part in parts]
    absent = [name for name in halves if name not in file]
    if 0 < len(absent) < len(halves):
        notes.append(f"{path}: {', '.join(absent)} missing; X is left out")
    if not absent:
        angle = _directions(path, file, notes)
        one, other = (stacked(f"excitation/{part}", angle.size, nw) for part in parts)
        X = one + 1j * other if parts == ("re", "im") else one * np.exp(1j * other)
        fields |= {"X": weight * X.transpose(2, 1, 0), "directions": angle}
    if code == "NEMOH":  # whose file has a zone for each motion, which BEMIO takes as a row
        A, B = A.swapaxes(0, 1), B.swapaxes(0, 1)
        fields |= {"A_inf": fields["A_inf"].T} if "A_inf" in fields else {}
    dofs = six_dofs(bodies)
    if code == "NEMOH" and is_reversed(horizontal_lead(fields.get("X"), fields.get("C"), dofs,
                                                       fields.get("directions"))):
        fields["X"] = fields["X"].conj()
        notes.append(f"{path}: X has NEMOH's phases, exp(-i w t), as old versions of BEMIO left them; converted")
    points = {b: _point(path, file, f"{b}/properties/cg") for b in groups if f"{b}/properties/cg" in file}
    return assemble(path, omega, np.moveaxis(A, -1, 0), np.moveaxis(B, -1, 0), dofs, notes=notes,
                    points=points if len(points) == len(groups) else None, **stated, **fields)


def _directions(path: Path, file: Any, notes: list[str]) -> FloatArray:
    """Return the directions [rad]: degrees, unless they are labelled as radians and can be some.

    Capytaine's writer labels so what it writes; the older Python BEMIO what are degrees.
    """
    angle, unit = _array(path, file, f"{HEAD}/wave_dir").ravel(), file[f"{HEAD}/wave_dir"].attrs.get("units", b"deg")
    unit = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
    if not unit.strip(" []").lower().startswith("rad") or not angle.any():
        return np.deg2rad(angle)
    if np.abs(angle).max() > 2.0 * np.pi + 1e-6:
        notes.append(f"{path}: wave_dir is labelled {unit}, and {np.abs(angle).max():g} is too much; taken as degrees")
        return np.deg2rad(angle)
    notes.append(f"{path}: wave_dir is labelled {unit}, and taken so; the older Python BEMIO labels degrees so")
    return angle


def _array(path: Path, file: Any, name: str, shape: tuple[int, ...] | None = None) -> FloatArray:
    if name not in file or not hasattr(file[name], "dtype"):
        raise InputError(f"{path}: not a whole BEMIO file: {name} is missing")
    value = file[name][()]
    if getattr(value, "dtype", np.dtype(object)).kind not in "fiub":
        raise InputError(f"{path}: {name} does not hold numbers")
    array = np.asarray(value, dtype=float)
    if shape is not None and array.shape != shape:
        raise InputError(f"{path}: {name} has shape {array.shape}; {shape} needed (6 rigid modes a body)")
    return array


def _scalar(path: Path, file: Any, name: str) -> float | None:
    if name not in file:
        return None
    if hasattr(file[name], "dtype") and hdf5_text(file, name).lower().startswith("inf"):
        return np.inf
    array = _array(path, file, name)
    if array.size != 1:
        raise InputError(f"{path}: {name} has {array.size} values; one is needed")
    return float(array.ravel()[0])


def _point(path: Path, file: Any, name: str) -> tuple[float, ...]:
    array = _array(path, file, name)
    if array.size != 3 or not np.isfinite(array).all():
        raise InputError(f"{path}: {name} has {array.size} values; a point (x, y, z) [m] is needed")
    return tuple(array.ravel().tolist())
