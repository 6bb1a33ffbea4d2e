"""AQWA's .AH1: SI, moments about each body's centre of gravity, phases of e^{-i w t} relative to the wave there."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import about_points, constants, log

MOST = 10_000
# By its heading what a block is labelled by (structure b, heading h, frequency k), and its rows and columns.
BLOCKS: dict[str, tuple[str, int, int]] = {
    "COG": ("b", 1, 3), "COB": ("b", 1, 3), "DRAFT": ("b", 1, 1), "DISPLACEMENT": ("b", 1, 1), "FIDD": ("b", 1, 6),
    "MASS": ("b", 6, 6), "HYDSTIFFNESS": ("b", 6, 6), "ADDEDMASS": ("bbk", 6, 6), "DAMPING": ("bbk", 6, 6),
    "ADDEDMASS_LF": ("bb", 6, 6), "DAMPING_LF": ("bb", 6, 6), "ADDEDMASS_HF": ("bb", 6, 6), "FORCERAO": ("bhk", 2, 6)}


class Blocks(text.Lines):
    """The lines of the file: headings, and below each the numbers of its block."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, comment=lambda line: line.startswith("*"))
        self.comments = [line for line in self.text if line.startswith("*")]
        # Older files state no version: then their one head begins with the number of structures.
        self.older = not any("VERSION" in line for line in self.comments)

    def heading(self) -> str | None:
        """Return the heading ahead, '' where numbers are, None at the end of the file."""
        line = self.ahead()
        return line if line is None or (line.replace("_", "").isalpha() and line.isupper()) else ""

    def many(self, count: int, what: str) -> FloatArray:
        """Return `count` numbers spread over lines."""
        values: list[float] = []
        while len(values) < count:
            values += self.row(range(1, count - len(values) + 1), what)
        return np.array(values)

    def labelled(self, sizes: tuple[int, ...], shape: tuple[int, int], what: str) -> FloatArray:
        """Return an array (*sizes, *shape) of labelled rows; blocks between structures computed apart stay NaN."""
        block = np.full((*sizes, *shape), np.nan)
        while self.heading() == "":
            first = self.row(len(sizes) + shape[1], f"{what}: labels and {shape[1]} values")
            at = tuple(self.index(v, most, f"{what}: label") - 1 for v, most in zip(first, sizes))
            if not np.isnan(block[at]).all():
                raise self.wrong(f"{what}: labels {[k + 1 for k in at]} are there twice")
            block[at] = [first[len(sizes):]] + [self.row(shape[1], what) for _ in range(shape[0] - 1)]
        alone = BLOCKS[what][0].startswith("bb") and sizes[0] > 1
        own = np.eye(sizes[0], dtype=bool)
        between = np.isnan(block[~own]) if alone else np.zeros(1)
        if np.isnan(block[own] if alone else block).any() or between.any() != between.all():
            raise self.wrong(f"{what} is cut off: labels up to {list(sizes)} needed")
        return block


def read(path: Path, **given: float) -> HydroData:
    """Read an .AH1 file."""
    file = Blocks(path)
    headings, omega, count = _heads(file)
    found = _blocks(file, {"b": count, "h": headings.size, "k": omega.size})
    for name in ("GENERAL", "COG", "ADDEDMASS", "DAMPING"):
        if name not in found:
            raise InputError(f"{path}: block {name} is missing")
    notes: list[str] = []
    if np.isnan(found["ADDEDMASS"]).any():
        notes.append(f"{path}: the structures were computed each alone; the terms between them are zero")
    stated = constants(path, dict(zip(("depth", "rho", "g"), found["GENERAL"])), given, notes)
    fields: dict[str, Any] = {field: block_diag(*found[name])
                              for field, name in (("M", "MASS"), ("C", "HYDSTIFFNESS")) if name in found}
    if "ADDEDMASS_HF" in found:
        fields["A_inf"] = joined(found["ADDEDMASS_HF"])
        notes.append(f"{path}: A_inf is AQWA's added mass at 100 rad/s")
    if "ADDEDMASS_LF" in found:
        notes.append(f"{path}: added mass at 0.001 rad/s is left out (it is no limit: in finite depth heave grows)")
    if np.any(found.get("FIDD", 0.0)):
        notes.append(f"{path}: the damping of block FIDD, the same at every frequency (largest "
                     f"{np.abs(found['FIDD']).max():.3g}), is no radiation and is left out (effect linear_damping has "
                     "it)")
        log.warning(notes[-1])
    notes += [f"{path}: no block {name}, so no {what}" for name, what in (("ADDEDMASS_HF", "A_inf"), ("FORCERAO", "X"))
              if name not in found]
    return about_points(path, omega, joined(found["ADDEDMASS"]), joined(found["DAMPING"]), found["COG"][:, 0], headings,
                        found.get("FORCERAO"), notes=notes, **stated, **fields)


def joined(blocks: FloatArray) -> FloatArray:
    """Return [..., i, j] of blocks [body, body, ..., 6, 6]."""
    whole = np.moveaxis(np.nan_to_num(blocks), (0, 1), (-4, -2))
    return whole.reshape(*whole.shape[:-4], 6 * len(blocks), 6 * len(blocks))


def _heads(file: Blocks) -> tuple[FloatArray, FloatArray, int]:
    """Return headings [rad], frequencies [rad/s] and the number of structures: the head is there for each of them."""
    what = "number of the structure, of headings, of frequencies, headings [deg]"
    found: list[tuple[FloatArray, FloatArray]] = []
    label = 0
    while file.heading() == "":
        start = file.row(range(3, 10), what)
        label, many, frequencies = (file.index(v, MOST, what) for v in start[:3])
        if (label != len(found) + 1 and not (file.older and not found)) or len(start) - 3 > many:
            raise file.wrong(f"found {start[:3]}; structure {len(found) + 1}, its number of headings and of "
                             "frequencies needed")
        angle = np.concatenate([start[3:], file.many(many - len(start[3:]), "headings [deg]")])
        found.append((angle, file.many(frequencies, "frequencies [rad/s]")))
        if not all(map(np.array_equal, found[0], found[-1])):
            raise file.wrong(f"structure {label} has other headings or frequencies than structure 1; the same are "
                             "needed")
        if (found[-1][1] <= 0.0).any():
            raise file.wrong(f"frequency {found[-1][1].min():g} rad/s is not positive")
    count = label if file.older and len(found) == 1 else len(found)
    if not found or count > 100:
        raise InputError(f"{file.path}: {count} structures at its head; 1 to 100 are read ({what})")
    return np.deg2rad(found[0][0]), found[0][1], count


def _blocks(file: Blocks, sizes: dict[str, int]) -> dict[str, Any]:
    """Return the blocks by their headings; a block that is longer than its heading says is refused."""
    found: dict[str, Any] = {}
    last = "the head"
    while (name := file.heading()) is not None:
        file.take("a heading")
        if not name:
            raise file.wrong(f"more numbers than {last} has; a heading is needed")
        if name in found:
            raise file.wrong(f"block {name} is there twice")
        last = f"block {name}"
        if name == "GENERAL":
            found[name] = _general(file, sizes["b"])
        elif name in BLOCKS:
            axes, *shape = BLOCKS[name]
            found[name] = file.labelled(tuple(sizes[axis] for axis in axes), (shape[0], shape[1]), name)
        else:
            while file.heading() == "":
                file.take(name)
    return found


def _general(file: Blocks, count: int) -> list[float]:
    """Return depth, density, gravity; with six columns or LHFR in their head (from 18.2) the structure is first."""
    head = 1 if any("LHFR" in line for line in file.comments) else 0
    columns = (3, 4, 5) if file.older else (head + 3, head + 5, 6)
    rows = []
    while file.heading() == "":
        row = file.row(columns, "depth, density, gravity")
        skip = 1 if len(row) == 6 else head
        rows.append(row[skip:skip + 3])
    if not rows or any(row != rows[0] for row in rows) or len(rows) not in (1, count):
        raise file.wrong(f"GENERAL: depth, density, gravity needed, the same for each of {count} structures")
    return rows[0]
