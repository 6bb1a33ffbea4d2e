"""AQWA's .AH1: SI, moments about each body's centre of gravity, phases of e^{-i w t} relative to the wave there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import assemble, bodies, common_point, constant, six_dofs
from radiation_ss.hydro.section.green import wave_number

MOST = 10_000


class Lines:
    """The lines of the file with a place in it; every number that is taken is checked."""

    def __init__(self, path: Path) -> None:
        self.path, self.text = path, text.lines(path)
        self.at = 0

    def skip_to(self, heading: str) -> bool:
        """Go behind the line that is `heading`; False where there is none."""
        for k, line in enumerate(self.text):
            if line.split()[:1] == [heading]:
                self.at = k + 1
                return True
        return False

    def row(self, columns: int | tuple[int, ...], what: str) -> list[float]:
        """Return the numbers of the next line."""
        if self.at >= len(self.text):
            raise InputError(f"{self.path}, line {self.at}: the file ends where {what} is expected")
        values = text.row(self.path, self.at, self.text[self.at], columns, what)
        self.at += 1
        return values

    def many(self, count: int, what: str) -> FloatArray:
        """Return `count` numbers spread over lines."""
        values: list[float] = []
        while len(values) < count:
            values += self.row(range_of(count - len(values)), what)
        return np.array(values)

    def tell(self) -> int:
        """Return the line last taken, counted from 0."""
        return self.at - 1


def range_of(most: int) -> tuple[int, ...]:
    """Return the counts of columns that a continued line may have."""
    return tuple(range(1, most + 1))


def read(path: Path, **given: float) -> HydroData:
    """Read an .AH1 file.

    Raises
    ------
    InputError
        If a block is missing or cut off, or a line has other columns than its block needs.
    """
    file = Lines(path)
    count, headings, omega = _first_block(file)
    rho, g, depth, notes = _general(file, given)
    points = _centres(file, count)
    dofs = six_dofs([f"body{k}" for k in range(1, count + 1)])
    A, B = (_matrices(file, name, count, omega.size) for name in ("ADDEDMASS", "DAMPING"))
    fields: dict[str, Any] = {"M": _per_body(file, "MASS", count), "C": _per_body(file, "HYDSTIFFNESS", count)}
    if file.skip_to("ADDEDMASS_HF"):
        fields["A_inf"] = _limit(file, count)
        notes.append(f"{path}: A_inf is AQWA's added mass at 100 rad/s")
    if file.skip_to("ADDEDMASS_LF"):
        notes.append(f"{path}: added mass at 0.001 rad/s is left out (it is no limit: in finite depth heave grows)")
    X = _forces(file, count, headings.size, omega.size)
    if X is not None:
        k = wave_number(omega ** 2 / g, depth)[:, None]
        for b, (x, y, _) in enumerate(points):
            along = x * np.cos(headings) + y * np.sin(headings)
            X[:, :, 6 * b:6 * b + 6] *= np.exp(-1j * k * along)[:, :, None]
        fields["X"], fields["directions"] = X, headings
    point, more = common_point(path, dofs, dict(zip(bodies(dofs), points)))
    return assemble(path, omega, A, B, dofs, rho=rho, g=g, depth=depth, reference_point=point,
                    notes=notes + more, **fields)


def _first_block(file: Lines) -> tuple[int, FloatArray, FloatArray]:
    """Return number of bodies, headings [rad] and frequencies [rad/s]."""
    while file.at < len(file.text) and (file.text[file.at].startswith("*") or not file.text[file.at].strip()):
        file.at += 1
    what = "number of bodies, of headings, of frequencies, headings [deg]"
    start = file.row(range_of(9), what)
    if len(start) < 3:
        raise InputError(f"{file.path}, line {file.tell() + 1}: {len(start)} columns found, 3 or more needed ({what})")
    count, many, frequencies = (text.index(file.path, file.tell(), v, MOST, "count") for v in start[:3])
    if count > 100:
        raise InputError(f"{file.path}, line {file.tell() + 1}: {count} bodies; up to 100 are read")
    heading = np.array(start[3:])
    if heading.size < many:
        heading = np.concatenate([heading, file.many(many - heading.size, "headings [deg]")])
    omega = file.many(frequencies, "frequencies [rad/s]")
    if (omega <= 0.0).any():
        raise InputError(f"{file.path}, line {file.tell() + 1}: frequency {omega.min():g} rad/s is not positive")
    return count, np.deg2rad(heading[:many]), omega


def _general(file: Lines, given: dict[str, float]) -> tuple[float, float, float, list[str]]:
    """Return density, gravity, depth; versions from 18.2 on (their head speaks of LHFR) put the body's number first."""
    if not file.skip_to("GENERAL"):
        raise InputError(f"{file.path}: block GENERAL (depth, density, gravity) is missing")
    values = file.row(range_of(12), "depth, density, gravity")
    skip = 1 if any("LHFR" in line for line in file.text if line.startswith("*")) else 0
    if len(values) < skip + 3:
        raise InputError(f"{file.path}, line {file.tell() + 1}: {len(values)} columns found, {skip + 3} needed "
                         "(depth, density, gravity)")
    notes: list[str] = []
    depth, rho, g = (constant(file.path, name, value, given, value, notes)
                     for name, value in zip(("depth", "rho", "g"), values[skip:]))
    return rho, g, depth, notes


def _centres(file: Lines, count: int) -> list[tuple[float, float, float]]:
    if not file.skip_to("COG"):
        raise InputError(f"{file.path}: block COG (centres of gravity) is missing")
    rows = [file.row(4, "body, x, y, z of the centre of gravity") for _ in range(count)]
    return [(x, y, z) for _, x, y, z in rows]


def _six_rows(file: Lines, labels: int, what: str) -> tuple[list[int], FloatArray]:
    """Return the labels before the first row, and a 6 x 6 matrix."""
    first = file.row(labels + 6, what)
    at = file.tell()
    marks = [text.index(file.path, at, v, MOST, "label") for v in first[:labels]]
    return marks, np.array([first[labels:]] + [file.row(6, what) for _ in range(5)])


def _per_body(file: Lines, name: str, count: int) -> FloatArray | None:
    if not file.skip_to(name):
        return None
    matrix = np.zeros((6 * count, 6 * count))
    for _ in range(count):
        (b,), block = _six_rows(file, 1, f"{name}: body, 6 values")
        _check(file, name, b, count)
        matrix[6 * b - 6:6 * b, 6 * b - 6:6 * b] = block
    return matrix


def _matrices(file: Lines, name: str, count: int, frequencies: int) -> FloatArray:
    """Return [frequency, i, j]; blocks are labelled body, body, frequency."""
    if not file.skip_to(name):
        raise InputError(f"{file.path}: block {name} is missing")
    matrix = np.full((frequencies, 6 * count, 6 * count), np.nan)
    for _ in range(count * count * frequencies):
        (b, c, k), block = _six_rows(file, 3, f"{name}: body, body, frequency, 6 values")
        _check(file, name, max(b, c), count)
        _check(file, name, k, frequencies)
        matrix[k - 1, 6 * b - 6:6 * b, 6 * c - 6:6 * c] = block
    _refuse_gap(file, name, matrix)
    return matrix


def _limit(file: Lines, count: int) -> FloatArray:
    matrix = np.full((6 * count, 6 * count), np.nan)
    for _ in range(count * count):
        (b, c), block = _six_rows(file, 2, "limit of the added mass: body, body, 6 values")
        _check(file, "limit of the added mass", max(b, c), count)
        matrix[6 * b - 6:6 * b, 6 * c - 6:6 * c] = block
    _refuse_gap(file, "limit of the added mass", matrix)
    return matrix


def _forces(file: Lines, count: int, headings: int, frequencies: int) -> ComplexArray | None:
    """Return X [frequency, heading, i] about the wave at each centre of gravity, conjugated to e^{+i w t}."""
    if not file.skip_to("FORCERAO"):
        return None
    X = np.full((frequencies, headings, 6 * count), complex(np.nan, np.nan))
    for _ in range(count * headings * frequencies):
        first = file.row(9, "FORCERAO: body, heading, frequency, 6 amplitudes")
        b, h, k = (text.index(file.path, file.tell(), v, MOST, "label") for v in first[:3])
        for value, most in ((b, count), (h, headings), (k, frequencies)):
            _check(file, "FORCERAO", value, most)
        phase = np.deg2rad(file.row(6, "FORCERAO: 6 phases [deg]"))
        X[k - 1, h - 1, 6 * b - 6:6 * b] = np.array(first[3:]) * np.exp(-1j * phase)
    _refuse_gap(file, "FORCERAO", X)
    return X


def _check(file: Lines, name: str, value: int, most: int) -> None:
    if value > most:
        raise InputError(f"{file.path}, line {file.tell() + 1}: {name}: label {value} is beyond {most}")


def _refuse_gap(file: Lines, name: str, matrix: FloatArray | ComplexArray) -> None:
    if np.isnan(matrix).any():
        raise InputError(f"{file.path}: {name}: a body, heading or frequency is there twice and another is missing")
