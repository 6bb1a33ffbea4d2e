"""AQWA's .AH1: SI, moments about each body's centre of gravity, phases of e^{-i w t} relative to the wave there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import assemble, bodies, constants, lags_to_origin, six_dofs

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


def read(path: Path, **given: float) -> HydroData:
    """Read an .AH1 file.

    InputError if a block is missing or cut off, or a line has other columns than its block needs.
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
    stated = constants(path, dict(zip(("depth", "rho", "g"), found["GENERAL"])), given, notes)
    points = [tuple(row) for row in found["COG"][:, 0]]
    dofs = six_dofs([f"body{k}" for k in range(1, count + 1)])
    fields: dict[str, Any] = {field: block_diag(*found[name])
                              for field, name in (("M", "MASS"), ("C", "HYDSTIFFNESS")) if name in found}
    if "ADDEDMASS_HF" in found:
        fields["A_inf"] = joined(found["ADDEDMASS_HF"])
        notes.append(f"{path}: A_inf is AQWA's added mass at 100 rad/s")
    if "ADDEDMASS_LF" in found:
        notes.append(f"{path}: added mass at 0.001 rad/s is left out (it is no limit: in finite depth heave grows)")
    if "FORCERAO" in found:
        fields["X"] = lags_to_origin(found["FORCERAO"], omega, headings, points, stated["g"], stated["depth"])
        fields["directions"] = headings
    return assemble(path, omega, joined(found["ADDEDMASS"]), joined(found["DAMPING"]), dofs, notes=notes,
                    points=dict(zip(bodies(dofs), points)), **stated, **fields)


def joined(blocks: FloatArray) -> FloatArray:
    """Return [..., i, j] of blocks [body, body, ..., 6, 6]."""
    whole = np.moveaxis(np.nan_to_num(blocks), (0, 1), (-4, -2))
    return whole.reshape(*whole.shape[:-4], 6 * len(blocks), 6 * len(blocks))


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
