"""Capytaine's netCDF dataset: the interchange form of a whole linear model.

Capytaine has e^{-i w t}: exciting forces are conjugated on the way in and out. Matrices are [influenced, radiating],
whatever the order of dimensions in the file. Rows omega = 0 and omega = inf hold the limits of the added mass.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, HydroData, body, mode
from radiation_ss.hydro.readers.assemble import assemble, bodies, common_point, constants
from radiation_ss.reading import check_size, decoded, is_text
from radiation_ss.units import plain_unit

if TYPE_CHECKING:
    import xarray as xr

SQUARE = {"M": "inertia_matrix", "C": "hydrostatic_stiffness", "D": "friction"}
ENTRIES, MODES = "hydrostatic_S", ("Heave", "Roll", "Pitch")
FORCES = ("excitation_force", "diffraction_force", "Froude_Krylov_force")
FREQUENCIES = {"omega": "rad/s", "period": "s", "freq": "Hz"}
WORD = re.compile(r"[^\W\d_]+")
SI = ("kg", "m", "s", "rad", "N", "Nm", "Ns", "Nms", "and", "or", "per")
NAMES = {"rho": "rho", "g": "g", "depth": "water_depth"}


def read(path: Path, **given: float) -> HydroData:
    """Read a file of Capytaine's form; see `from_dataset`."""
    import xarray as xr

    def whole() -> xr.Dataset:
        content = path.read_bytes()
        if not content.startswith((b"\x89HDF", b"CDF", b"\x1f\x8b")):
            raise InputError(f"{path}: is text, not netCDF; a dataset of Capytaine's form is needed (other programs' "
                             "text files are told by the ends of their names)" if is_text(content) else
                             f"{path}: not a readable netCDF dataset (neither netCDF nor HDF5 by its first bytes)")
        if content.startswith(b"\x89HDF"):
            check_size(path)
        # From memory: xarray would keep a damaged file open, and locked.
        with xr.open_dataset(io.BytesIO(content), decode_times=False) as opened:
            return opened.load()

    return from_dataset(decoded(path, "netCDF dataset", whole), path, **given)


def from_dataset(dataset: xr.Dataset, path: Path | str, **given: float) -> HydroData:
    """Return the data of a dataset in Capytaine's form, called `path`; `given`: rho, g, depth that it lacks."""
    return decoded(path, "dataset of Capytaine's form", lambda: _from_dataset(dataset, path, given))


def _from_dataset(dataset: xr.Dataset, path: Path | str, given: dict[str, float]) -> HydroData:
    for name in (*FORCES, "added_mass", "radiation_damping", *SQUARE.values(), *NAMES.values()):
        unit = str(dataset[name].attrs.get("units", "")) if name in dataset.variables else ""
        if other := [word for word in WORD.findall(unit) if word not in SI]:
            raise InputError(f"{path}: {name} is in {unit!r}, and {other[0]!r} is no SI unit; products of "
                             f"{', '.join(SI[:5])} are needed")
    data = _merge_complex(path, dataset.copy())
    for name in ("added_mass", "radiation_damping"):
        if name not in data:
            raise InputError(f"{path}: variable {name} is missing; it holds {sorted(map(str, data.data_vars))}")
    constants, notes = _constants(path, data, given)
    data = data.isel({name: 0 for name in (*NAMES.values(), "forward_speed", "body_name") if name in data.dims})
    data, along = _along_frequency(path, data)
    data, dofs, more = _dofs(path, data)
    notes += more
    matrix = (along, "influenced_dof", "radiating_dof")
    A, B = (_values(path, data[name], matrix) for name in ("added_mass", "radiation_damping"))
    fields: dict[str, Any] = {field: _values(path, data[name], matrix[1:]) if name in data else None
                              for field, name in SQUARE.items() if name not in data or ENTRIES not in data[name].dims}
    if (inertia := fields.get("M")) is not None and np.isnan(inertia).any():  # Capytaine's of shapes of one's own
        unknown = ", ".join(dof for dof, row in zip(dofs, inertia) if np.isnan(row).all() or np.isnan(row).sum() > 1)
        notes.append(f"{path}: inertia_matrix is not known of {unknown or 'some motions'}; M is left out: give all "
                     "of it by data.replace(M=...)")
        fields["M"] = None
    if "C" not in fields:
        fields["C"] = _stiffness(path, data, dofs)
    force = data.get("excitation_force")
    if force is None and "diffraction_force" in data and "Froude_Krylov_force" in data:
        force = data["diffraction_force"] + data["Froude_Krylov_force"]
    elif force is None and (part := set(FORCES) & set(data.data_vars)):
        notes.append(f"{path}: of the wave force only {part.pop()} is there; X is left out")
    if force is not None:
        if "wave_direction" not in force.dims:
            force = force.expand_dims("wave_direction")
        fields["X"] = np.conj(_values(path, force.rename("excitation_force"),
                                      (along, "wave_direction", "influenced_dof")))
        fields["directions"] = _directions(path, force)
    point, more = _reference_point(path, data, dofs)
    return assemble(path, np.asarray(data["omega"].values, float), A, B, dofs, reference_point=point,
                    notes=notes + more, **constants, **fields)


def _merge_complex(path: Path | str, data: xr.Dataset) -> xr.Dataset:
    """Join real and imaginary parts of Capytaine's `complex` dimension."""
    for name in [n for n in data.data_vars if "complex" in data[n].dims]:
        parts = data[name]
        labels = [str(v) for v in parts["complex"].values] if "complex" in parts.coords else ["re", "im"]
        if sorted(labels) != ["im", "re"]:
            raise InputError(f"{path}: dimension complex of {name} is {labels}; ['re', 'im'] is needed")
        data[name] = (parts.isel(complex=labels.index("re"), drop=True)
                      + 1j * parts.isel(complex=labels.index("im"), drop=True))
    return data.drop_vars("complex", errors="ignore")


def _constants(path: Path | str, data: xr.Dataset, given: dict[str, float]) -> tuple[dict[str, Any], list[str]]:
    in_file: dict[str, float] = {}
    notes: list[str] = []
    for field, name in NAMES.items():
        if name in data.variables:
            values = np.atleast_1d(np.asarray(data[name].values, float))
            if values.size != 1:
                raise InputError(f"{path}: {name} has {values.size} values {values.tolist()}; one is needed")
            in_file[field] = float(values[0])
    found = constants(path, in_file, given, notes)
    if (speeds := np.atleast_1d(data.variables.get("forward_speed", np.zeros(1))).astype(float)).any():
        rest = "; take ds.sel(forward_speed=0)" if speeds.size > 1 and np.any(speeds == 0.0) else ""
        raise InputError(f"{path}: forward_speed = {', '.join(f'{v:g}' for v in speeds)} m/s; only zero speed is "
                         f"supported{rest}")
    return found, notes


def _along_frequency(path: Path | str, data: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the dataset with a variable omega [rad/s], and the dimension along which it runs."""
    if (name := next((name for name in FREQUENCIES if name in data.variables), None)) is None:
        raise InputError(f"{path}: no coordinate omega [rad/s], period [s] or freq [Hz]")
    unit = str(data[name].attrs.get("units", FREQUENCIES[name]))
    if plain_unit(unit.replace(" per ", "/")).lower() != FREQUENCIES[name].lower():
        raise InputError(f"{path}: {name} is in {unit!r}; {FREQUENCIES[name]} needed (omega is in rad/s, period in s, "
                         "freq in Hz)")
    if name != "omega":
        with np.errstate(divide="ignore"):
            values = 2.0 * np.pi / data[name] if name == "period" else 2.0 * np.pi * data[name]
        data = data.assign_coords(omega=values)
    if data["omega"].ndim == 0:
        data = data.drop_vars("omega").expand_dims(omega=[float(data["omega"])])
    if data["omega"].ndim != 1:
        raise InputError(f"{path}: omega has dimensions {data['omega'].dims}; one is needed")
    return data, str(data["omega"].dims[0])


def _dofs(path: Path | str, data: xr.Dataset) -> tuple[xr.Dataset, tuple[str, ...], list[str]]:
    """Bring influenced and radiating degrees of freedom into one order."""
    names = {}
    for dim in ("radiating_dof", "influenced_dof"):
        if dim not in data.variables:
            raise InputError(f"{path}: no coordinate {dim}; it names the degrees of freedom, for example 'Heave'")
        if dim not in data.dims:
            data = data.expand_dims(dim)
        labels = [v.decode() if isinstance(v, bytes) else str(v) for v in np.atleast_1d(data[dim].values)]
        if len(set(labels)) < len(labels):
            raise InputError(f"{path}: {dim} {labels} holds a name twice")
        data = data.assign_coords({dim: labels})
        names[dim] = labels
    moving, feeling = names["radiating_dof"], names["influenced_dof"]
    if absent := [dof for dof in moving if dof not in feeling]:
        raise InputError(f"{path}: radiating_dof {absent} are not among influenced_dof {feeling}")
    order, rest = [dof for dof in feeling if dof in moving], [dof for dof in feeling if dof not in moving]
    notes = [f"{path}: {', '.join(rest)}: no radiation computed; only {', '.join(order)} read"] if rest else []
    return data.sel(radiating_dof=order, influenced_dof=order), tuple(order), notes


def _values(path: Path | str, variable: xr.DataArray, dims: tuple[str, ...]) -> Any:
    """Return a variable's array in the order `dims`; size-one dimensions that are not asked for go."""
    extra = [d for d in variable.dims if d not in dims]
    many = [d for d in extra if variable.sizes[d] > 1]
    missing = [d for d in dims if d not in variable.dims]
    if many or missing:
        raise InputError(f"{path}: {variable.name} has dimensions {tuple(variable.dims)}; {dims} needed")
    values = variable.isel({d: 0 for d in extra}).transpose(*dims).values
    if values.dtype.kind not in "fciu":
        raise InputError(f"{path}: {variable.name} holds {values.dtype}, not numbers")
    return values


def _stiffness(path: Path | str, data: xr.Dataset, dofs: tuple[str, ...]) -> FloatArray:
    """Return the stiffness of entries S33 to S55, one row for each of `bodies`, as datasets of 2020 have it (MECC)."""
    entries = data["hydrostatic_stiffness"]
    labels = [str(v) for v in entries[ENTRIES].values] if ENTRIES in entries.coords else []
    groups = [[f"{name}__{m}" if name else m for m in MODES] for name in dict.fromkeys(body(dof) for dof in dofs)]
    absent = [dof for group in groups for dof in group if dof not in dofs]
    rows = entries.expand_dims("bodies") if "bodies" not in entries.dims else entries
    if sorted(labels) != ["S33", "S34", "S35", "S44", "S45", "S55"] or absent or rows.sizes["bodies"] != len(groups):
        raise InputError(f"{path}: hydrostatic_stiffness has entries {labels} for {rows.sizes['bodies']} bodies; S33, "
                         f"S34, S35, S44, S45, S55 for each of {len(groups)} bodies with Heave, Roll, Pitch needed")
    C = np.zeros((len(dofs), len(dofs)))
    for group, row in zip(groups, _values(path, rows, ("bodies", ENTRIES))):
        at = [dofs.index(dof) for dof in group]
        for label, value in zip(labels, row):
            i, j = (at[int(digit) - 3] for digit in label[1:])
            C[i, j] = C[j, i] = value
    return C


def _directions(path: Path | str, force: xr.DataArray) -> FloatArray:
    if "wave_direction" not in force.coords:
        return np.zeros(force.sizes["wave_direction"])
    coordinate = force["wave_direction"]
    angle = np.atleast_1d(np.asarray(coordinate.values, float))
    if str(coordinate.attrs.get("units", "rad")).startswith("deg"):
        return np.deg2rad(angle)
    if np.abs(angle).max(initial=0.0) > 2.0 * np.pi + 1e-6:
        raise InputError(f"{path}: wave_direction reaches {angle[np.abs(angle).argmax()]:g}, too much for radians, "
                         "and no unit says deg; set ds['wave_direction'].attrs['units'] = 'deg'")
    return angle


def _reference_point(path: Path | str, data: xr.Dataset, dofs: tuple[str, ...]) -> tuple[tuple[float, ...], list[str]]:
    """Capytaine turns about `rotation_center`, and where none was set about the centre of mass."""
    if (name := next((n for n in ("rotation_center", "center_of_mass") if n in data.variables), None)) is None:
        return common_point(path, dofs, None)
    center = data[name]
    points = center.values.reshape(-1, 3) if center.size % 3 == 0 and center.size else np.full((1, 3), np.nan)
    names = bodies(dofs) if center.ndim > 1 else ["all"]
    if "body" in center.dims and "body" in data.coords:
        names = [str(v) for v in data["body"].values]
    if len(points) != len(names) or np.isnan(points).any():
        return common_point(path, dofs, None)
    point, notes = common_point(path, dofs, {body: tuple(p) for body, p in zip(names, points)})
    if name == "center_of_mass" and any(mode(dof) in ROTATIONS for dof in dofs):
        notes.append(f"{path}: no rotation_center; rotations taken about the centre of mass, as Capytaine does then")
    return point, notes


def to_dataset(data: HydroData) -> xr.Dataset:
    """Return a dataset in Capytaine's form; limits of the added mass are rows omega = 0 and inf, without B and X."""
    import xarray as xr

    low, high = data.A_zero is not None, data.A_inf is not None
    omega = np.concatenate([[0.0] * low, data.omega, [np.inf] * high])
    A = np.stack([matrix for matrix in (data.A_zero, *data.A, data.A_inf) if matrix is not None])
    B = np.pad(data.B, ((low, high), (0, 0), (0, 0)))
    square, names = ("influenced_dof", "radiating_dof"), list(data.dofs)
    out = xr.Dataset({"added_mass": (("omega", *square), A), "radiation_damping": (("omega", *square), B)},
                     coords={"omega": omega, "influenced_dof": names, "radiating_dof": names, "rho": data.rho,
                             "g": data.g, "water_depth": data.depth, "forward_speed": 0.0})
    for field, name in SQUARE.items():
        if (value := getattr(data, field)) is not None:
            out[name] = (square, value)
    if data.X is not None:
        X = np.pad(data.X.conj(), ((low, high), (0, 0), (0, 0)), constant_values=complex(np.nan, -np.nan))
        out["excitation_force"] = (("complex", "omega", "wave_direction", "influenced_dof"), np.stack([X.real, X.imag]))
        out = out.assign_coords(complex=["re", "im"], wave_direction=data.directions)
        out["wave_direction"].attrs["units"] = "rad"
    if np.isfinite(data.reference_point).all():
        out = out.assign_coords(rotation_center=("space_coordinate", list(data.reference_point)),
                                space_coordinate=["x", "y", "z"])
    with np.errstate(divide="ignore"):
        out = out.assign_coords(period=("omega", 2.0 * np.pi / omega))  # Capytaine's own writers ask for it
    out["omega"].attrs["units"], out["period"].attrs["units"] = "rad/s", "s"
    return out


def netcdf(data: HydroData) -> bytes:
    """Return `to_dataset(data)` as a netCDF file; checksums keep a damaged one from being read as other numbers.

    In memory, for on a disk that is full the HDF5 library ends the process.
    """
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    out, raw = to_dataset(data), io.BytesIO()
    checked = {name: {"fletcher32": True} for name, part in out.variables.items()
               if part.ndim and part.dtype.kind in "fc"}
    with h5netcdf.File(raw, "w") as file:
        out.dump_to_store(H5NetCDFStore(file), encoding=checked)
    return raw.getvalue()

