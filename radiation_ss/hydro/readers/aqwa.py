"""AQWA: .AH1, and the listing .LIS of one structure, with fewer digits.

SI, moments about each body's centre of gravity, phases of e^{-i w t} relative to the wave there.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import (
    SIX,
    assemble,
    block_diagonal,
    bodies,
    common_point,
    constant,
    delay,
    six_dofs,
)

LABELS = ("X", "Y", "Z", "RX", "RY", "RZ")
SECTION = "HYDRODYNAMICPARAMETERS"
TABLES = {"STIFFNESSMATRIX": "C", "ADDEDMASS": "A", "DAMPING": "B"}
VARIATION = "FORCES-VARIATIONWITHWAVEPERIOD/FREQUENCY"
FORCES, PART = "FROUDEKRYLOV+DIFFRACTION" + VARIATION, "FROUDEKRYLOV" + VARIATION
CONSTANTS = {"depth": "WATERDEPTH", "rho": "DENSITYOFWATER", "g": "ACCELERATIONDUETOGRAVITY"}


def read_listing(path: Path, **given: float) -> HydroData:
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
    fields["X"] = at_origin(rows[None], omega, angle, [point], given_or_found["g"], given_or_found["depth"])
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


MOST = 10_000
PLAIN = {"COG": 4, "COB": 4, "DRAFT": 2, "DISPLACEMENT": 2, "FIDD": 7}  # a row for each structure, its number first
MATRICES = {"MASS": "b", "HYDSTIFFNESS": "b", "ADDEDMASS": "bbk", "DAMPING": "bbk", "ADDEDMASS_LF": "bb",
            "DAMPING_LF": "bb", "ADDEDMASS_HF": "bb"}  # 6 x 6 for each structure b, pair bb, frequency k


class Lines:
    """The lines of the file with a place in it; every number that is taken is checked."""

    def __init__(self, path: Path) -> None:
        self.path, self.text = path, text.lines(path)
        self.at = 0

    def older(self) -> bool:
        """Return whether the file states no version: then its one head begins with the number of structures."""
        return not any(line.startswith("*") and "VERSION" in line for line in self.text)

    def name(self) -> str | None:
        """Return the heading of the line ahead, '' where it holds numbers, None at the end of the file."""
        while self.at < len(self.text) and (self.text[self.at].startswith("*") or not self.text[self.at].strip()):
            self.at += 1
        if self.at >= len(self.text):
            return None
        line = self.text[self.at].strip()
        return line if line.replace("_", "").isalpha() and line.isupper() else ""

    def row(self, columns: int | tuple[int, ...], what: str) -> list[float]:
        """Return the numbers of the next line."""
        if self.at >= len(self.text):
            raise InputError(f"{self.path}, line {self.at}: the file ends where {what} is expected")
        self.at += 1
        return text.row(self.path, self.at - 1, self.text[self.at - 1], columns, what)

    def many(self, count: int, what: str) -> FloatArray:
        """Return `count` numbers spread over lines."""
        values: list[float] = []
        while len(values) < count:
            values += self.row(tuple(range(1, count - len(values) + 1)), what)
        return np.array(values)

    def labelled(self, sizes: tuple[int, ...], shape: tuple[int, int], what: str) -> FloatArray:
        """Return an array (*sizes, *shape): before the first of `shape[0]` rows stand the labels, from 1 on.

        Structures that were computed without each other have no blocks between them; those stay NaN.
        """
        block = np.full((*sizes, *shape), np.nan)
        while self.name() == "":
            first = self.row(len(sizes) + shape[1], f"{what}: labels and {shape[1]} values")
            at = tuple(text.index(self.path, self.at - 1, v, most, f"{what}: label") - 1
                       for v, most in zip(first, sizes))
            if not np.isnan(block[at]).all():
                raise InputError(f"{self.path}, line {self.at}: {what}: labels {[k + 1 for k in at]} are there twice")
            block[at] = [first[len(sizes):]] + [self.row(shape[1], what) for _ in range(shape[0] - 1)]
        alone = MATRICES.get(what, "").startswith("bb") and sizes[0] > 1
        needed = block[np.arange(sizes[0]), np.arange(sizes[0])] if alone else block
        between = np.isnan(block[~np.eye(sizes[0], dtype=bool)]) if alone else np.zeros(1)
        if np.isnan(needed).any() or between.any() != between.all():
            raise InputError(f"{self.path}, line {self.at}: {what} is cut off: labels up to {list(sizes)} needed")
        return block


def read_ah1(path: Path, **given: float) -> HydroData:
    """Read an .AH1 file.

    Raises
    ------
    InputError
        If a block is missing or cut off, or a line has other columns than its block needs.
    """
    file = Lines(path)
    headings, omega, count = _heads(file)
    found = _blocks(file, {"b": count, "h": headings.size, "k": omega.size})
    for name in ("GENERAL", "COG", "ADDEDMASS", "DAMPING"):
        if name not in found:
            raise InputError(f"{path}: block {name} is missing")
    notes: list[str] = []
    if np.isnan(found["ADDEDMASS"]).any():
        notes.append(f"{path}: the structures were computed each alone; the terms between them are zero")
    depth, rho, g = (constant(path, name, value, given, value, notes)
                     for name, value in zip(("depth", "rho", "g"), found["GENERAL"]))
    points = [tuple(row) for row in found["COG"][:, 0]]
    dofs = six_dofs([f"body{k}" for k in range(1, count + 1)])
    fields: dict[str, Any] = {field: block_diagonal(found[name])
                              for field, name in (("M", "MASS"), ("C", "HYDSTIFFNESS")) if name in found}
    if "ADDEDMASS_HF" in found:
        fields["A_inf"] = joined(found["ADDEDMASS_HF"])
        notes.append(f"{path}: A_inf is AQWA's added mass at 100 rad/s")
    if "ADDEDMASS_LF" in found:
        notes.append(f"{path}: added mass at 0.001 rad/s is left out (it is no limit: in finite depth heave grows)")
    if "FORCERAO" in found:
        fields["X"] = at_origin(found["FORCERAO"], omega, headings, points, g, depth)
        fields["directions"] = headings
    point, more = common_point(path, dofs, dict(zip(bodies(dofs), points)))
    return assemble(path, omega, joined(found["ADDEDMASS"]), joined(found["DAMPING"]), dofs, rho=rho, g=g,
                    depth=depth, reference_point=point, notes=notes + more, **fields)


def joined(blocks: FloatArray) -> FloatArray:
    """Return [..., i, j] of blocks [body, body, ..., 6, 6]."""
    whole = np.moveaxis(np.nan_to_num(blocks), (0, 1), (-4, -2))
    return whole.reshape(*whole.shape[:-4], 6 * len(blocks), 6 * len(blocks))


def at_origin(rows: FloatArray, omega: FloatArray, headings: FloatArray, points: list[tuple[float, ...]], g: float,
              depth: float) -> ComplexArray:
    """Return X [frequency, heading, i] of rows [body, heading, frequency, (amplitude, phase in deg), i].

    AQWA's phases are lags behind the wave at each centre of gravity: here leads over the wave at the origin.
    """
    force = rows[..., 0, :] * np.exp(-1j * np.deg2rad(rows[..., 1, :]))
    for b, point in enumerate(points):
        force[b] *= delay(omega, headings, point, g, depth).T[:, :, None]
    return np.concatenate(list(force), axis=-1).swapaxes(0, 1)


def _heads(file: Lines) -> tuple[FloatArray, FloatArray, int]:
    """Return headings [rad], frequencies [rad/s] and the number of structures: the head is there for each of them.

    Older files state no version: one head, which begins with the number of structures.
    """
    older = file.older()
    what = "number of the structure, of headings, of frequencies, headings [deg]"
    found: list[tuple[FloatArray, FloatArray]] = []
    label = 0
    while file.name() == "":
        start = file.row(tuple(range(3, 10)), what)
        label, many, frequencies = (text.index(file.path, file.at - 1, v, MOST, what) for v in start[:3])
        if (label != len(found) + 1 and not (older and not found)) or len(start) - 3 > many:
            raise InputError(f"{file.path}, line {file.at}: found {start[:3]}; structure {len(found) + 1}, its number "
                             "of headings and of frequencies needed")
        heading = np.concatenate([start[3:], file.many(many - len(start[3:]), "headings [deg]")])
        found.append((heading, file.many(frequencies, "frequencies [rad/s]")))
        if not all(np.array_equal(a, b) for a, b in zip(found[0], found[-1])):
            raise InputError(f"{file.path}, line {file.at}: structure {label} has other headings or frequencies than "
                             "structure 1; the same are needed")
        if (found[-1][1] <= 0.0).any():
            raise InputError(f"{file.path}, line {file.at}: frequency {found[-1][1].min():g} rad/s is not positive")
    count = label if older and len(found) == 1 else len(found)
    if not found or count > 100:
        raise InputError(f"{file.path}: {count} structures at its head; 1 to 100 are read ({what})")
    return np.deg2rad(found[0][0]), found[0][1], count


def _blocks(file: Lines, sizes: dict[str, int]) -> dict[str, Any]:
    """Return the blocks by their headings; a block that is longer than its heading says is refused."""
    found: dict[str, Any] = {}
    last = "the head"
    while (name := file.name()) is not None:
        if not name:
            raise InputError(f"{file.path}, line {file.at + 1}: more numbers than {last} has; a heading is needed")
        if name in found:
            raise InputError(f"{file.path}, line {file.at + 1}: block {name} is there twice")
        file.at += 1
        last = f"block {name}"
        if name == "GENERAL":
            found[name] = _general(file, sizes["b"])
        elif name in PLAIN:
            found[name] = file.labelled((sizes["b"],), (1, PLAIN[name] - 1), name)
        elif name in MATRICES:
            found[name] = file.labelled(tuple(sizes[letter] for letter in MATRICES[name]), (6, 6), name)
        elif name == "FORCERAO":
            found[name] = file.labelled(tuple(sizes[letter] for letter in "bhk"), (2, 6), name)
        else:
            while file.name() == "":
                file.at += 1
    return found


def _general(file: Lines, count: int) -> list[float]:
    """Return depth, density, gravity; versions from 18.2 on (their head speaks of LHFR) put the structure first."""
    skip = 1 if any("LHFR" in line for line in file.text if line.startswith("*")) else 0
    columns = (3, 4, 5) if file.older() else (skip + 3, skip + 5)
    rows = []
    while file.name() == "":
        rows.append(file.row(columns, "depth, density, gravity")[skip:skip + 3])
    if not rows or any(row != rows[0] for row in rows) or len(rows) not in (1, count):
        raise InputError(f"{file.path}, line {file.at}: GENERAL: depth, density, gravity needed, the same for each of "
                         f"{count} structures")
    return rows[0]
