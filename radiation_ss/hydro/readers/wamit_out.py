"""WAMIT's formatted .out file, as plain entries without dimension."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.wamit_tables import (
    MOST_MODES,
    Entries,
    Forces,
    Radiation,
    force_array,
    matrices,
)


@dataclass
class Header:
    """What only .out tells: gravity, length scale, depth, body axes, stiffness / (rho g L^k)."""

    g: float | None = None
    length: float | None = None
    depth: float | None = None
    points: list[tuple[float, float, float]] = field(default_factory=list)
    stiffness: FloatArray | None = None
    notes: list[str] = field(default_factory=list)


def parse_out(path: Path) -> tuple[Header, Radiation, Forces | None]:
    """Return header, radiation rows and force rows (or None) of a .out file."""
    lines = text.lines(path)
    header = _header(path, lines)
    radiation: dict[float, Entries] = {}
    forces: dict[str, dict[tuple[float, float], dict[int, complex]]] = {"HASKIND": {}, "DIFFRACTION": {}}
    period: float | None = None
    kind, heading = "", 0.0
    for k, line in enumerate(lines):
        if "Wave period" in line and "=" in line:
            period, kind = _period(path, k, line), ""
        elif "ADDED-MASS" in line:
            kind = "radiation"
        elif "EXCITING FORCES AND MOMENTS" in line:
            kind = "HASKIND" if "HASKIND" in line else "DIFFRACTION"
        elif "Wave Heading" in line and kind in forces:
            heading = text.leading(path, k, line.partition(":")[2], 1, "wave heading [deg]")[0]
        elif line.strip().startswith("***") or "RESPONSE AMPLITUDE" in line or "DRIFT FORCES" in line:
            kind = ""
        elif kind and period is not None and _starts_with_number(line):
            if kind == "radiation":
                _radiation_row(path, k, line, radiation.setdefault(period, {}))
            else:
                _force_row(path, k, line, forces[kind].setdefault((period, heading), {}))
    rows = matrices(path, radiation, len(lines) - 1)
    table = forces["DIFFRACTION"] or forces["HASKIND"]
    if table:
        header.notes.append(f"{path}: phases of the exciting force are whole degrees here (1 % of its size)")
    return header, rows, force_array(path, table, rows.modes) if table else None


def parse_header(path: Path) -> Header:
    """Return what the head of a .out file says."""
    return _header(path, text.lines(path))


def _starts_with_number(line: str) -> bool:
    tokens = line.split()
    return bool(tokens) and text.number(tokens[0]) is not None


def _radiation_row(path: Path, k: int, line: str, entries: Entries) -> None:
    values = text.row(path, k, line, (3, 4), "i, j, added mass, damping")
    i, j = (text.index(path, k, v, MOST_MODES, "mode") for v in values[:2])
    if (i, j) in entries:
        raise InputError(f"{path}, line {k + 1}: this period with modes {i}, {j} is there twice")
    entries[i, j] = (values[2], values[3] if len(values) == 4 else 0.0)


def _force_row(path: Path, k: int, line: str, entries: dict[int, complex]) -> None:
    values = text.row(path, k, line, 3, "i, modulus, phase [deg]")
    i = text.index(path, k, abs(values[0]), MOST_MODES, "mode")
    entries[i] = values[1] * complex(np.exp(1j * np.deg2rad(values[2])))


def _period(path: Path, k: int, line: str) -> float:
    """Return the period [s]; WAMIT's own marks for the limits: -1 infinite, 0 zero."""
    value = line.partition("=")[2].split()
    if value[:1] == ["infinite"]:
        return -1.0
    if value[:1] == ["zero"]:
        return 0.0
    period = text.leading(path, k, " ".join(value), 1, "wave period [s]")[0]
    if period <= 0.0:
        raise InputError(f"{path}, line {k + 1}: wave period {period:g} s is not positive")
    return period


def _header(path: Path, lines: list[str]) -> Header:
    header = Header()
    for k, line in enumerate(lines):
        if "Gravity:" in line and "Length scale:" in line:
            header.g = text.leading(path, k, line.partition("Gravity:")[2], 1, "gravity")[0]
            header.length = text.leading(path, k, line.partition("Length scale:")[2], 1, "length scale")[0]
        elif "Water depth:" in line:
            value = line.partition("Water depth:")[2]
            header.depth = np.inf if "infinite" in value else text.leading(path, k, value, 1, "water depth")[0]
        elif "XBODY" in line:
            found = [text.number(token) for token in re.findall(r"[XYZ]BODY\s*=\s*(\S+)", line)]
            point = [value for value in found if value is not None]
            if len(point) != 3:
                raise InputError(f"{path}, line {k + 1}: XBODY, YBODY, ZBODY are not three numbers")
            header.points.append((point[0], point[1], point[2]))
        elif "C(3,3),C(3,4),C(3,5):" in line:
            _stiffness(path, k, lines, header)
    return header


def _stiffness(path: Path, k: int, lines: list[str], header: Header) -> None:
    """Read the three lines of the upper triangle; C(4,6) and C(5,6) have no symmetric partner."""
    first = 6 * max(len(header.points) - 1, 0)
    C = np.zeros((first + 6, first + 6))
    if header.stiffness is not None:
        old = min(len(header.stiffness), first)
        C[:old, :old] = header.stiffness[:old, :old]
    for row, (i, j) in enumerate(((2, 2), (3, 3), (4, 4))):
        if k + row >= len(lines):
            raise InputError(f"{path}, line {k + row}: the file ends within the restoring coefficients")
        count = (3, 3, 2)[row]
        for step, value in enumerate(text.leading(path, k + row, lines[k + row].partition(":")[2], count, "stiffness")):
            C[first + i, first + j + step] = value
            if j + step < 5:
                C[first + j + step, first + i] = value
    header.stiffness = C
