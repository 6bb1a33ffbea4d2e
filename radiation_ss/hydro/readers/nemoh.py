"""A NEMOH run's folder: Nemoh.cal, RadiationCoefficients.tec, ExcitationForce.tec, Inertia.dat, KH.dat.

SI; e^{-i w t}, so forces are conjugated; the incident wave is measured at the point (XEFF, YEFF) of Nemoh.cal.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import Points, assemble, constants, delay

UNITS = {"rad/s": lambda x: x, "hz": lambda x: 2.0 * np.pi * x, "(s)": lambda x: 2.0 * np.pi / x}


class NemohCase(NamedTuple):
    """What Nemoh.cal says."""

    rho: float
    g: float
    depth: float
    wave_at: tuple[float, ...]
    dofs: tuple[str, ...]
    points: Points
    bodies: int
    directions: int


def read(path: Path, **given: float) -> HydroData:
    """Read the folder of a run (or its Nemoh.cal); files may lie in it or in Results, Mesh and Mechanics."""
    folder = path if path.is_dir() else path.parent
    case = _case(_needed(folder, "Nemoh.cal"))
    n = len(case.dofs)
    notes: list[str] = []
    stated = constants(folder, case._asdict(), given, notes)
    omega, A, B = _radiation(_needed(folder, "RadiationCoefficients.tec"), n)
    fields: dict[str, Any] = {}
    if (forces := _find(folder, "ExcitationForce.tec")) is not None:
        angle, X = _forces(forces, n, omega)
        if angle.size != case.directions:
            raise InputError(f"{forces}: {angle.size} directions found, {case.directions} needed as Nemoh.cal says")
        fields["X"] = np.conj(X) * delay(omega, angle, case.wave_at, stated["g"], stated["depth"])[:, :, None]
        fields["directions"] = angle
    for field, name in (("M", "Inertia.dat"), ("C", "KH.dat")):
        fields[field] = _hydrostatic(_find(folder, name), case, notes)
    beside = {"Km.dat": "model.attached(stiffness=...)", "Badd.dat": "model.attached(damping=...)"}
    beside |= {f"KH_{b}.dat": "data.replace(C=...)" for b in range(case.bodies)}
    notes += [f"{folder}: {name} is not read; give it by {way}" for name, way in beside.items() if _find(folder, name)]
    return assemble(folder, omega, A, B, case.dofs, points=case.points, notes=notes, **stated, **fields)


def is_run(folder: Path) -> bool:
    """Return whether a folder holds files of a NEMOH run."""
    return any(_find(folder, name) for name in ("Nemoh.cal", "RadiationCoefficients.tec"))


def _find(folder: Path, name: str) -> Path | None:
    """Return the path of a file of the run, whatever the case of its letters."""
    try:
        places = [folder, *(p for p in sorted(folder.iterdir()) if p.is_dir()
                            and p.name.lower() in ("results", "mesh", "mechanics"))]
        return next((file for place in places for file in sorted(place.iterdir())
                     if file.name.lower() == name.lower() and file.is_file()), None)
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror})") from None


def _needed(folder: Path, name: str) -> Path:
    if (path := _find(folder, name)) is None:
        raise InputError(f"{folder}: {name} is missing; a NEMOH run's folder is needed")
    return path


def _case(path: Path) -> NemohCase:
    file = text.Lines(path, comment=lambda line: line.strip().startswith("---"))

    def whole(what: str, most: int = 100) -> int:
        value = file.leading(1, what)[0]
        return 0 if value == 0 else file.index(value, most, what)

    rho, g, depth = (file.leading(1, what)[0] for what in ("density", "gravity", "depth"))
    wave_at = tuple(file.leading(2, "wave measurement point"))
    dofs: list[str] = []
    points: dict[str, tuple[float, ...]] = {}
    count = whole("number of bodies")
    for b in range(count):
        mesh = file.take("name of the mesh file").partition("!")[0].strip()
        body = re.split(r"[\\/]", mesh)[-1].rsplit(".", 1)[0] or f"body{b + 1}"
        file.take("number of points and panels")
        modes, forces = ([file.leading(7, f"{what}: kind, direction, point") for _ in range(whole(f"number of {many}"))]
                         for what, many in (("degree of freedom", "degrees of freedom"), ("force", "resulting forces")))
        if modes != forces:
            raise InputError(f"{path}: body {b + 1}: its resulting forces are not those of its degrees of freedom")
        for _ in range(whole("number of lines of additional information")):
            file.take("additional information")
        dofs += [f"{body}__" * (count > 1) + _mode_name(mode, k) for k, mode in enumerate(modes, 1)]
        turning = {tuple(mode[4:]) for mode in modes if mode[0] == 2.0}
        if len(turning) == 1:
            points[body] = turning.pop()
    if not dofs or len(set(dofs)) < len(dofs):
        raise InputError(f"{path}: degrees of freedom {dofs} are empty or there twice")
    file.take("frequencies")
    return NemohCase(rho, g, depth or np.inf, wave_at, tuple(dofs), points, count,
                     whole("number of wave directions", 10_000))


def _mode_name(mode: list[float], k: int) -> str:
    """Return the name of `kind, direction, point`; a direction that is no axis has none of the six names."""
    kind, direction = mode[0], mode[1:4]
    if kind in (1.0, 2.0) and sorted(direction) == [0.0, 0.0, 1.0]:
        return RIGID[direction.index(1.0) + (3 if kind == 2.0 else 0)]
    return f"Mode{k}"


def _zones(path: Path, pairs: int) -> tuple[FloatArray, list[tuple[str, int]], FloatArray]:
    """Return rad/s, title and line of each zone of a Tecplot file, and its values [zone, frequency, column]."""
    head: list[str] = []
    found: list[tuple[str, int, list[list[float]]]] = []
    for k, line in enumerate(text.lines(path)):
        if line.lower().lstrip().startswith("zone"):
            found.append((line.strip(), k, []))
        elif found and line.strip():
            found[-1][2].append(text.row(path, k, line, 2 * pairs + 1, "frequency and pairs of values"))
        elif line.strip() and text.number(line.split()[0]) is not None:
            raise InputError(f"{path}, line {k + 1}: numbers before the first Zone; its heading is lost")
        else:
            head.append(line)
    if not found:
        raise InputError(f"{path}: no Zone in it")
    first = found[0][2]
    for _, k, rows in found:
        if len(rows) != len(first) or not rows:
            raise InputError(f"{path}, line {k + 1}: this zone has {len(rows)} rows, the first {len(first)}; the file "
                             "is cut off")
        if any(row[0] != other[0] for row, other in zip(rows, first)):
            raise InputError(f"{path}, line {k + 1}: frequencies of this zone are not those of the first")
    values = np.array([rows for _, _, rows in found])
    return _omega(path, " ".join(head), values[0, :, 0]), [zone[:2] for zone in found], values[:, :, 1:]


def _omega(path: Path, head: str, column: FloatArray) -> FloatArray:
    """Return rad/s of the first column, whose unit the head names."""
    if (column <= 0.0).any():
        raise InputError(f"{path}: frequency {column[column <= 0.0][0]:g} is not positive")
    if (unit := next((u for u in UNITS if u in head.lower()), None)) is None:
        raise InputError(f"{path}: the unit of the first column (rad/s, Hz or s) is not in the head {head[:40]!r}")
    return UNITS[unit](column)


def _radiation(path: Path, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return omega, A, B; a zone is one motion (column j), its columns the forces (row i)."""
    omega, titles, values = _zones(path, n)
    if len(titles) != n:
        raise InputError(f"{path}: {len(titles)} zones found, {n} needed (one for each degree of freedom)")
    return omega, values[:, :, 0::2].transpose(1, 2, 0), values[:, :, 1::2].transpose(1, 2, 0)


def _forces(path: Path, n: int, omega: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Return directions [rad] and X [frequency, direction, i] as the file has it."""
    found, titles, values = _zones(path, n)
    if not np.array_equal(found, omega):
        raise InputError(f"{path}: its frequencies are not those of the radiation coefficients")
    angle = []
    for title, k in titles:
        beta = re.search(r"beta\s*=\s*(\S+)\s*deg", title)
        value = text.number(beta.group(1)) if beta else None
        if value is None:
            raise InputError(f"{path}, line {k + 1}: no direction 'beta = ... deg' in {title[:60]!r}")
        angle.append(value)
    return np.deg2rad(angle), (values[:, :, 0::2] * np.exp(1j * values[:, :, 1::2])).swapaxes(0, 1)


def _hydrostatic(path: Path | None, case: NemohCase, notes: list[str]) -> FloatArray | None:
    """Return a 6 x 6 matrix file for the degrees of freedom there are; several bodies are not put together."""
    if path is None:
        return None
    if case.bodies > 1 or any(dof not in RIGID for dof in case.dofs):
        notes.append(f"{path}: left out (it is of one body with the six rigid modes)")
        return None
    rows = [text.row(path, k, line, 6, "6 values") for k, line in enumerate(text.lines(path)) if line.strip()]
    if len(rows) != 6:
        raise InputError(f"{path}: {len(rows)} rows found, 6 needed")
    pick = [RIGID.index(dof) for dof in case.dofs]
    return np.array(rows)[np.ix_(pick, pick)]
