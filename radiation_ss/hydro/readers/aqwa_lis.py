"""AQWA's listing .LIS, with fewer digits than the .AH1, and of the same conventions.

The pages of structure k hold its own matrices and, under "H/I ... FOR FORCE ON STR# j", the force on structure j by the
motion of structure k.
"""

import re
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import about_points, constants

LABELS = ["X", "Y", "Z", "RX", "RY", "RZ"]
SECTION = "HYDRODYNAMICPARAMETERS"
TABLE = re.compile(r"(STIFFNESSMATRIX|ADDEDMASS|DAMPING)$|H/I(ADDEDMASS|DAMPING)FORFORCEONSTR#(\d+)$")
TABLES = {"STIFFNESSMATRIX": "C", "ADDEDMASS": "A", "DAMPING": "B"}
VARIATION = "FORCES-VARIATIONWITHWAVEPERIOD/FREQUENCY"
FORCES, PART = "FROUDEKRYLOV+DIFFRACTION" + VARIATION, "FROUDEKRYLOV" + VARIATION
CONSTANTS = {"depth": "WATERDEPTH", "rho": "DENSITYOFWATER", "g": "ACCELERATIONDUETOGRAVITY"}

# At each frequency (0: stiffness, inf: the high one) the 6 x 6 tables by name, structure of force, of motion
Tables = dict[float, dict[tuple[str, int, int], FloatArray]]
Point = tuple[float, ...]


def read(path: Path, **given: float) -> HydroData:
    """Read the results of a listing."""
    lines = text.lines(path)
    bare = ["".join(line.split()).upper() for line in lines]
    notes = [f"{path}: frequencies have four decimals, forces three digits here; the .AH1 beside it has more"]
    stated = constants(path, {field: _constant(path, bare, name) for field, name in CONSTANTS.items()}, given, notes)
    found, centres = _tables(path, lines, bare)
    omega = np.array([w for w in found if 0.0 < w < np.inf])
    count = len(centres)
    coupled = _complete(path, found, count)
    fields: dict[str, Any] = {"M": block_diag(*[_mass(path, lines, bare, k) for k in centres]),
                              "C": _whole(found[0.0], "C", count)}
    high = "A_inf is AQWA's added mass at 100 rad/s"
    if np.inf not in found:
        high = "no section on low and high frequencies (or cut off before it); A_inf is not known"
    elif coupled and count > 1 and len(found[np.inf]) == count:
        high = "the high frequency has no coupling between the structures; A_inf is not known"
    else:
        fields["A_inf"] = _whole(found[np.inf], "A", count)
    alone = "the structures were computed each alone; the terms between them are zero"
    notes += [f"{path}: {note}" for note in [alone] * (not coupled) + [high]]
    A, B = ([_whole(found[w], name, count) for w in omega] for name in "AB")
    headings, force = _forces(path, lines, bare, omega, count)
    return about_points(path, omega, A, B, np.array(list(centres.values())), headings, force, notes=notes, **stated,
                        **fields)


def _complete(path: Path, found: Tables, count: int) -> bool:
    """Return whether the structures are coupled; refuse a listing where a table is missing."""
    own = [(k, k) for k in range(1, count + 1)]
    between = list(permutations(range(1, count + 1), 2))
    coupled = any((i, j) in between for tables in found.values() for _, i, j in tables)

    def wanted(w: float) -> set[tuple[str, int, int]]:
        names = "C" if w == 0.0 else "AB" if w < np.inf else "A"
        here = coupled and 0.0 < w and (w < np.inf or any(i != j for _, i, j in found[w]))
        return {(name, *pair) for name in names for pair in own + between * here}

    incomplete = [w for w in found if set(found[w]) != wanted(w)]
    if incomplete or 0.0 not in found or not any(0.0 < w < np.inf for w in found):
        what = ("a stiffness, or any added mass" if not incomplete else
                f"stiffness, or added mass or damping at {incomplete[:4]} rad/s")
        raise InputError(f"{path}: {what} is missing; cut off?")
    return coupled or count == 1


def _whole(tables: dict[tuple[str, int, int], FloatArray], name: str, count: int) -> FloatArray:
    """Return the matrix of all structures; blocks that are not there are zero."""
    numbers = range(1, count + 1)
    return np.block([[tables.get((name, i, j), np.zeros((6, 6))) for j in numbers] for i in numbers])


def _constant(path: Path, bare: list[str], name: str) -> float:
    line = next((line for line in bare if line.startswith(name + ".")), "")
    if (value := text.number(line.rpartition("=")[2])) is None:
        raise InputError(f"{path}: no line '{name} . . . = number'; an AQWA-LINE listing is needed")
    return value


def _tables(path: Path, lines: list[str], bare: list[str]) -> tuple[Tables, dict[int, Point]]:
    """Return the tables, but for those of low and high frequencies, and the point of each structure's rotations."""
    found: Tables = {}
    points: dict[int, Point] = {}
    floating: dict[int, Point] = {}  # on the page of hydrostatics; version 14 gives the point nowhere else
    inside = limits = False
    structure = 1
    omega: float | None = 0.0
    for k, line in enumerate(bare):
        if line.startswith("****"):
            inside, limits, omega = SECTION in line, "ATLOW&HIGH" in line, 0.0
        if match := re.search(r"FORSTRUCTURE(\d+)", line):
            structure = int(match[1])
        elif match := re.search(r"C\.O\.G\.?GX=(.+)GY=(.+)GZ=(.+)", line):
            x, y, z = text.row(path, k, " ".join(match.groups()), 3, "centre of gravity [m]")
            floating[structure] = (x, y, z)
        elif inside and "THECENTREOFGRAVITYAT(" in line:
            x, y, z = text.leading(path, k, lines[k].partition("(")[2].replace(",", " ").replace(")", " "), 3, "point")
            if structure in points:
                raise InputError(f"{path}, line {k + 1}: a second centre of gravity of structure {structure}")
            points[structure] = (x, y, z)
        elif inside and (match := re.search(r"WAVEFREQUENCY=([\d.]+)", line)):
            omega = float(match[1])
            if limits:
                omega = np.inf if omega > max(w for w in found if w < np.inf) else None
        elif inside and (match := TABLE.match(line)) and omega is not None:
            name, force = TABLES[match[1] or match[2]], int(match[3] or structure)
            if limits and name == "B":
                continue
            if (name, force, structure) in found.setdefault(omega, {}):
                raise InputError(f"{path}, line {k + 1}: {line} of structure {structure} at {omega:g} rad/s is there "
                                 "twice")
            found[omega][name, force, structure] = _six(path, lines, k)
    if omega is None or (any("ATLOW&HIGH" in line for line in bare) and np.inf not in found):
        raise InputError(f"{path}: the high frequency of the section on low and high ones is missing; cut off?")
    points = floating | points
    if not points or sorted(points) != list(range(1, len(points) + 1)):
        of = f"of structures {sorted(points)} only" if points else "of no structure"
        raise InputError(f"{path}: centres of gravity (C.O.G. GX= GY= GZ=, or AT (x, y, z)) {of}; each from 1 on is "
                         "needed: cut off, or no AQWA-LINE listing?")
    return found, dict(sorted(points.items()))


def _six(path: Path, lines: list[str], k: int) -> FloatArray:
    """Return the matrix below heading `k`: six rows, each with its label, blank lines between them."""
    rows: list[list[float]] = []
    for at in range(k + 1, min(k + 30, len(lines))):
        words = lines[at].split()
        if len(words) == 7 and words[0] == LABELS[len(rows)]:
            rows.append(text.row(path, at, " ".join(words[1:]), 6, "6 values"))
            if len(rows) == 6:
                return np.array(rows)
        elif words and (rows or (words[0] in LABELS and words != LABELS)):
            break
    raise InputError(f"{path}, line {k + 1}: rows {', '.join(LABELS)} of 6 numbers needed below; the table is cut off")


def _mass(path: Path, lines: list[str], bare: list[str], structure: int) -> FloatArray:
    """Return the rigid-body mass matrix of a structure about its centre of gravity."""
    title = re.compile(rf"MASSANDINERTIAPROPERTIESOFSTRUCTURE{structure}(?!\d)")
    k = next((k for k, line in enumerate(bare) if title.search(line)), len(bare))
    total, start = (next((at for at in range(k, len(bare)) if bare[at].startswith(word)), None)
                    for word in ("TOTAL", "INERTIAMATRIX"))
    if total is None or start is None:
        raise InputError(f"{path}: no mass (T O T A L) or INERTIA MATRIX of structure {structure}")
    mass = text.row(path, total, " ".join(lines[total].split()[5:]), 3, "elements, mass, weight")[1]
    rows = [at for at in range(start, len(bare)) if bare[at]][:3]
    inertia = [text.row(path, at, " ".join(lines[at].split()[2 * (at == start):]), 3, "inertia") for at in rows]
    return block_diag(mass * np.eye(3), np.array(inertia))


def _forces(path: Path, lines: list[str], bare: list[str], omega: FloatArray,
            count: int) -> tuple[FloatArray, FloatArray]:
    """Return headings [rad] and rows [structure, heading, frequency, (amplitude, phase [deg]), i] of the force."""
    groups: dict[tuple[str, int], dict[float, list[list[float]]]] = {
        (name, k): {} for name in (FORCES, PART) for k in range(1, count + 1)}
    inside, name, heading, structure = False, "", None, 1
    for k, line in enumerate(lines):
        words = line.split()
        if bare[k].startswith("****"):
            inside, name, heading = SECTION in bare[k], "", None
            if match := re.search(r"FORSTRUCTURE(\d+)", bare[k]):
                structure = int(match[1])
        elif "VARIATIONWITHWAVE" in bare[k]:
            name, heading = bare[k], None
        elif inside and len(words) in (14, 15) and text.number(words[0]) is not None and name in (FORCES, PART, ""):
            if not name:
                raise InputError(f"{path}, line {k + 1}: forces without a heading above them")
            values = text.row(path, k, line, (14, 15), "period, frequency, direction, 6 amplitudes and phases")
            group = groups.get((name, structure), {})
            if len(values) == 15:
                heading = values.pop(2)
                if heading in group:
                    raise InputError(f"{path}, line {k + 1}: direction {heading:g} is there twice")
                group[heading] = []
            rows = [] if heading is None else group[heading]
            if heading is None or len(rows) >= omega.size or abs(values[1] - omega[len(rows)]) > 6e-4:
                raise InputError(f"{path}, line {k + 1}: force at {values[1]:g} rad/s where the next frequency of the "
                                 "added mass, or a direction, is needed")
            rows.append(values[2:])
    found = list(groups[FORCES, 1])
    if not found or any(list(group) != found or any(len(rows) != omega.size for rows in group.values())
                        for group in groups.values()):
        raise InputError(f"{path}: exciting forces in {len(found)} directions, their Froude-Krylov part in "
                         f"{len(groups[PART, 1])}; all frequencies of the added mass are needed in each, for "
                         f"{count} structure(s): cut off?")
    table = np.array([list(groups[FORCES, k].values()) for k in range(1, count + 1)])
    return np.deg2rad(found), np.stack([table[..., 0::2], table[..., 1::2]], axis=3)
