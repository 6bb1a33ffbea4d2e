"""AQWA's listing .LIS of one structure, with fewer digits than the .AH1, and of the same conventions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import SIX, assemble, constant, lags_to_origin

LABELS = ("X", "Y", "Z", "RX", "RY", "RZ")
SECTION = "HYDRODYNAMICPARAMETERS"
TABLES = {"STIFFNESSMATRIX": "C", "ADDEDMASS": "A", "DAMPING": "B"}
VARIATION = "FORCES-VARIATIONWITHWAVEPERIOD/FREQUENCY"
FORCES, PART = "FROUDEKRYLOV+DIFFRACTION" + VARIATION, "FROUDEKRYLOV" + VARIATION
CONSTANTS = {"depth": "WATERDEPTH", "rho": "DENSITYOFWATER", "g": "ACCELERATIONDUETOGRAVITY"}


def read(path: Path, **given: float) -> HydroData:
    """Read the results of a listing.

    Raises
    ------
    InputError
        If it is of several structures, or a table is missing or cut off.
    """
    lines = text.lines(path)
    bare = ["".join(line.split()).upper() for line in lines]
    several = next((k for k, line in enumerate(bare) if re.search(r"FORSTRUCTURE([2-9]|1\d)", line)), None)
    if several is not None:
        raise InputError(f"{path}, line {several + 1}: a listing of several structures; read the .AH1 beside it")
    notes = [f"{path}: frequencies have four decimals, forces three digits here; the .AH1 beside it has more"]
    given_or_found = {field: constant(path, field, _constant(path, bare, name), given, np.nan, notes)
                      for field, name in CONSTANTS.items()}
    found, point = _tables(path, lines, bare)
    omega = np.array([w for w in found if 0.0 < w < np.inf])
    incomplete = [w for w in found if set(found[w]) != ({"C"} if w == 0.0 else {"A", "B"} if w < np.inf else {"A"})]
    if incomplete or 0.0 not in found or not omega.size:
        raise InputError(f"{path}: stiffness, or added mass or damping at {incomplete[:4]} rad/s is missing; "
                         "cut off?")
    fields: dict[str, Any] = {"M": _mass(path, lines, bare)}
    fields["C"] = found[0.0]["C"]
    if np.inf in found:
        fields["A_inf"] = found[np.inf]["A"]
        notes.append(f"{path}: A_inf is AQWA's added mass at 100 rad/s")
    else:
        notes.append(f"{path}: no section on low and high frequencies (or cut off before it); A_inf is not known")
    degrees, rows = _forces(path, lines, bare, omega)
    fields["directions"] = angle = np.deg2rad(degrees)
    fields["X"] = lags_to_origin(rows[None], omega, angle, [point], given_or_found["g"], given_or_found["depth"])
    return assemble(path, omega, [found[w]["A"] for w in omega], [found[w]["B"] for w in omega], SIX, notes=notes,
                    reference_point=point, **given_or_found, **fields)


def _constant(path: Path, bare: list[str], name: str) -> float:
    line = next((line for line in bare if line.startswith(name + ".")), "")
    value = text.number(line.rpartition("=")[2])
    if value is None:
        raise InputError(f"{path}: no line '{name} . . . = number'; an AQWA-LINE listing is needed")
    return value


def _tables(path: Path, lines: list[str], bare: list[str]) -> tuple[dict[float, dict[str, FloatArray]],
                                                                     tuple[float, float, float]]:
    """Return the 6 x 6 tables at each frequency (0: stiffness, inf: the high one), and the point of the rotations.

    The low frequency of the section on low and high ones is no limit; its tables are left out.
    """
    found: dict[float, dict[str, FloatArray]] = {}
    points: list[tuple[float, float, float]] = []
    inside = limits = False
    omega: float | None = 0.0
    for k, line in enumerate(bare):
        if line.startswith("****"):
            inside, limits, omega = SECTION in line, "ATLOW&HIGH" in line, 0.0
        elif inside and "THECENTREOFGRAVITYAT(" in line:
            x, y, z = text.leading(path, k, lines[k].partition("(")[2].replace(",", " ").replace(")", " "), 3, "point")
            points.append((x, y, z))
        elif inside and (match := re.search(r"WAVEFREQUENCY=([\d.]+)", line)):
            omega = float(match[1])
            if limits:
                omega = np.inf if omega > max(found) else None
            if omega in found:
                raise InputError(f"{path}, line {k + 1}: {omega:g} rad/s is there twice")
            if omega is not None:
                found[omega] = {}
        elif inside and line in TABLES and omega is not None and not (limits and TABLES[line] == "B"):
            name = TABLES[line]
            if name in found.setdefault(omega, {}):
                raise InputError(f"{path}, line {k + 1}: {line} at {omega:g} rad/s is there twice")
            found[omega][name] = _six(path, lines, k)
    if omega is None or (any("ATLOW&HIGH" in line for line in bare) and np.inf not in found):
        raise InputError(f"{path}: the high frequency of the section on low and high ones is missing; cut off?")
    if len(set(points)) != 1:
        raise InputError(f"{path}: {len(set(points))} lines THE CENTRE OF GRAVITY AT (x, y, z); one is needed")
    return found, points[0]


def _six(path: Path, lines: list[str], k: int) -> FloatArray:
    """Return the matrix below heading `k`: six rows, each with its label, blank lines between them."""
    rows: list[list[float]] = []
    for at in range(k + 1, min(k + 30, len(lines))):
        words = lines[at].split()
        if len(words) == 7 and words[0] == LABELS[len(rows)]:
            rows.append(text.row(path, at, " ".join(words[1:]), 6, "6 values"))
            if len(rows) == 6:
                return np.array(rows)
        elif words and (rows or (words[0] in LABELS and words != list(LABELS))):
            break
    raise InputError(f"{path}, line {k + 1}: rows {', '.join(LABELS)} of 6 numbers needed below; the table is cut off")


def _mass(path: Path, lines: list[str], bare: list[str]) -> FloatArray:
    """Return the rigid-body mass matrix about the centre of gravity."""
    k = next((k for k, line in enumerate(bare) if "MASSANDINERTIAPROPERTIES" in line), len(bare))
    total = next((at for at in range(k, len(bare)) if bare[at].startswith("TOTAL")), None)
    start = next((at for at in range(k, len(bare)) if bare[at].startswith("INERTIAMATRIX")), None)
    if total is None or start is None:
        raise InputError(f"{path}: no mass (T O T A L) or INERTIA MATRIX")
    mass = text.row(path, total, " ".join(lines[total].split()[5:]), 3, "elements, mass, weight")[1]
    rows = [at for at in range(start, len(bare)) if bare[at]][:3]
    inertia = [text.row(path, at, " ".join(lines[at].split()[2 * (at == start):]), 3, "inertia") for at in rows]
    return np.asarray(np.block([[mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), np.array(inertia)]]))


def _forces(path: Path, lines: list[str], bare: list[str], omega: FloatArray) -> tuple[list[float], FloatArray]:
    """Return headings [deg] and rows [heading, frequency, (amplitude, phase in deg), i] of the total exciting force.

    The Froude-Krylov part, a table above, tells which directions must be there.
    """
    groups: dict[str, dict[float, list[list[float]]]] = {FORCES: {}, PART: {}}
    inside, name, heading = False, "", None
    for k, line in enumerate(lines):
        words = line.split()
        if bare[k].startswith("****"):
            inside, name, heading = SECTION in bare[k], "", None
        elif "VARIATIONWITHWAVE" in bare[k]:
            name, heading = bare[k], None
        elif inside and len(words) in (14, 15) and text.number(words[0]) is not None and name in (FORCES, PART, ""):
            if not name:
                raise InputError(f"{path}, line {k + 1}: forces without a heading above them")
            values = text.row(path, k, line, (14, 15), "period, frequency, direction, 6 amplitudes and phases")
            if len(values) == 15:
                heading = values.pop(2)
                if heading in groups[name]:
                    raise InputError(f"{path}, line {k + 1}: direction {heading:g} is there twice")
                groups[name][heading] = []
            rows = [] if heading is None else groups[name][heading]
            if heading is None or len(rows) >= omega.size or abs(values[1] - omega[len(rows)]) > 6e-4:
                raise InputError(f"{path}, line {k + 1}: force at {values[1]:g} rad/s where the next frequency of the "
                                 "added mass, or a direction, is needed")
            rows.append(values[2:])
    found = groups[FORCES]
    if not found or list(found) != list(groups[PART]) or any(len(rows) != omega.size for rows in found.values()):
        raise InputError(f"{path}: exciting forces in {len(found)} directions, their Froude-Krylov part in "
                         f"{len(groups[PART])}; all frequencies of the added mass are needed in each: cut off?")
    table = np.array(list(found.values()))
    return list(found), np.stack([table[:, :, 0::2], table[:, :, 1::2]], axis=2)
