"""WAMIT's formatted .out, rows of its files as arrays without dimension, and what their first column is."""

import itertools
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.transforms import added_mass_from_damping


@dataclass
class Header:
    """What only .out tells: gravity, length scale, depth, body axes, stiffness / (rho g L^k)."""

    g: float | None = None
    length: float | None = None
    depth: float | None = None
    points: list[tuple[float, float, float]] = field(default_factory=list)
    stiffness: FloatArray | None = None
    notes: list[str] = field(default_factory=list)


def parse_out(path: Path) -> "tuple[Header, Radiation, Forces | None]":
    """Return header, radiation rows and force rows (or None) of a .out file."""
    lines = _lines(path)
    header = parse_header(path, lines)
    end = next((k for k, line in enumerate(lines) if line.startswith("2nd-order period")), len(lines))
    if end < len(lines):
        header.notes.append(f"{path}: second-order forces (from line {end + 1}) are not read")
    radiation, forces = _tables(path, lines[:end])
    start = next((k for k, line in enumerate(lines) if line.startswith("Period Time")), len(lines))
    # The head lists each period with the time of its run; none where that was another run.
    listed = len(list(itertools.takewhile(re.compile(r"\S+ \d+:\d+:\d+").match, lines[start + 1:])))
    if listed not in (0, len(radiation)):
        raise InputError(f"{path}: its head lists {listed} periods, {len(radiation)} are there; the file is cut off")
    if not listed:
        header.notes.append(f"{path}: no list of periods at its head; whether the file is whole cannot be told")
    rows = matrices(path, radiation, len(lines) - 1)
    if forces:
        header.notes.append(f"{path}: phases of the exciting force are whole degrees here (1 % of its size)")
    return header, rows, force_array(path, forces, rows.modes) if forces else None


def _tables(path: Path, lines: list[str]) -> "tuple[Table, Table]":
    """Return the radiation of each period and the forces, from diffraction where both tables are there."""
    radiation: Table = {}
    forces: dict[str, Table] = {"DIFFRACTION": {}, "HASKIND": {}}
    begun: dict[str, set[float]] = {"DIFFRACTION": set(), "HASKIND": set()}
    period, kind, heading = 0.0, "", None
    for k, line in enumerate(lines):
        if "Wave period" in line and "=" in line:
            period, kind = _period(path, k, line), ""
            if period in radiation:
                raise InputError(f"{path}, line {k + 1}: this period is there twice")
            radiation[period] = {}
        elif "ADDED-MASS" in line:
            kind = "radiation"
        elif "EXCITING FORCES AND MOMENTS" in line:
            kind, heading = "HASKIND" if "HASKIND" in line else "DIFFRACTION", None
            begun[kind].add(period)
        elif "Wave Heading" in line and kind in forces:
            heading = text.leading(path, k, line.partition(":")[2], 1, "wave heading [deg]")[0]
        elif line.startswith("***") or "RESPONSE AMPLITUDE" in line or "DRIFT FORCES" in line:
            kind = ""
        elif kind and line and text.number(line.split()[0]) is not None:
            if not radiation:
                raise InputError(f"{path}, line {k + 1}: coefficients without a line 'Wave period' above them")
            if kind == "radiation":
                values = text.row(path, k, line, 4 if period > 0.0 else 3, "i, j, added mass, and of no limit damping")
                add(path, k, radiation[period], values[:2], (*values[2:], 0.0)[:2])
            elif heading is None:
                raise InputError(f"{path}, line {k + 1}: exciting forces without a line 'Wave Heading' above them")
            else:
                mode, size, phase = text.row(path, k, line, 3, "i, modulus, phase [deg]")
                add(path, k, forces[kind].setdefault((period, heading), {}), [abs(mode)],
                    size * complex(np.exp(1j * np.deg2rad(phase))))
    for name in forces:
        if begun[name] != {period for period, _ in forces[name]}:
            raise InputError(f"{path}: a table of {name} exciting forces has no rows; the file is cut off")
    return radiation, forces["DIFFRACTION"] or forces["HASKIND"]


def _lines(path: Path) -> list[str]:
    """Return the lines with one blank between words, whatever stood there."""
    return [" ".join(line.split()) for line in text.lines(path)]


def add(path: Path, k: int, entries: "Entries", modes: Sequence[float], value: Any) -> None:
    """Add what line `k` says of modes (i, j), or of mode (i,), to the entries of a period, or of one with a heading."""
    at = tuple(text.index(path, k, mode, MOST_MODES, "mode") for mode in modes)
    if at in entries:
        raise InputError(f"{path}, line {k + 1}: entry {', '.join(map(str, at))} is there twice for this period"
                         f"{' and heading' * (len(at) == 1)}")
    entries[at] = value


def _period(path: Path, k: int, line: str) -> float:
    """Return the period [s]; WAMIT's own marks for the limits: -1 infinite, 0 zero."""
    value = line.partition("=")[2]
    for word, mark in (("infinite", -1.0), ("zero", 0.0)):
        if value.split()[:1] == [word]:
            return mark
    period = text.leading(path, k, value, 1, "wave period [s]")[0]
    if period <= 0.0:
        raise InputError(f"{path}, line {k + 1}: wave period {period:g} s is not positive")
    return period


def parse_header(path: Path, lines: list[str] | None = None) -> Header:
    """Return what the head of a .out file says, whose lines may be known."""
    header, lines = Header(), _lines(path) if lines is None else lines
    blocks: list[FloatArray] = []
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
            turned = line.partition("PHIBODY")[2].replace("=", " ")
            if turned and (angle := text.leading(path, k, turned, 1, "PHIBODY [deg]")[0]):
                raise InputError(f"{path}, line {k + 1}: PHIBODY = {angle:g} deg: modes along turned axes are not "
                                 "read; 0 is needed, run WAMIT with XBODY(4) = 0 and a turned mesh")
        elif line.startswith("RHOTANK"):
            header.notes.append(f"{path}: interior tanks; their own restoring (line {k + 1}) is not in C")
        elif line.startswith("C(3,3)"):
            blocks.append(_stiffness(path, k, lines))
    for name, absent in (("gravity and length scale", header.g is None), ("water depth", header.depth is None),
                         ("XBODY", not header.points)):
        if absent:
            raise InputError(f"{path}: no line with {name} at its head")
    rows = sum("C(4,4)" in line for line in lines), sum("C(5,5)" in line for line in lines)
    if {*rows, len(blocks)} - {0, len(header.points)} or len({*rows, len(blocks)}) > 1:
        raise InputError(f"{path}: restoring coefficients of {len(blocks)} bodies, body axes of {len(header.points)}")
    header.stiffness = block_diag(*blocks) if blocks else None
    return header


def _stiffness(path: Path, k: int, lines: list[str]) -> FloatArray:
    """Read the three lines of the upper triangle; C(4,6) and C(5,6) have no symmetric partner."""
    C = np.zeros((6, 6))
    for row, (i, count) in enumerate(((2, 3), (3, 3), (4, 2))):
        line = lines[k + row] if k + row < len(lines) else ""
        if f"C({i + 1},{i + 1})" not in line:
            raise InputError(f"{path}, line {k + row + 1}: restoring coefficients C({i + 1},{i + 1}) ... needed here")
        # C(3,.) starts at heave, C(4,.) at roll, C(5,.) at pitch: the diagonal.
        for step, value in enumerate(text.leading(path, k + row, line.partition(":")[2], count, "stiffness")):
            C[i, i + step] = value
            if i + step < 5:
                C[i + step, i] = value
    return C


MOST_MODES = 600
Entries = dict[tuple[int, ...], Any]  # by modes: added mass and damping of (i, j), force of (i,)
Table = dict[Any, Entries]            # by period, forces by period and heading


class Radiation(NamedTuple):
    """Rows of a .1 file: period column, and for each period the entries (i, j) -> (A, B)."""

    period: FloatArray
    A: FloatArray
    B: FloatArray
    modes: list[int]


class Forces(NamedTuple):
    """Rows of a .3 file: period column, headings [deg], X [period, heading, mode], other modes it has forces of."""

    period: FloatArray
    heading: FloatArray
    X: ComplexArray
    beyond: list[int]


def usual_modes(path: Path | str, table: Mapping[str, Entries], what: str) -> frozenset[tuple[int, ...]]:
    """Return the modes of the entries, which must be the same in each part of a file; parts go by their names."""
    if not any(table.values()):
        raise InputError(f"{path}: no {what} in it")
    usual = Counter(map(frozenset, table.values())).most_common(1)[0][0]
    for name, entries in table.items():
        if set(entries) != usual:
            raise InputError(f"{path}: {name} has {len(entries)} entries, the others {len(usual)}; the file is cut "
                             "off or mixed")
    return usual


def matrices(path: Path, table: Table, last: int) -> Radiation:
    """Return arrays of the entries, read up to line `last`; absent ones are zero by symmetry."""
    usual = usual_modes(f"{path}, up to line {last + 1}",
                        {f"first column {per:g}": entries for per, entries in table.items()}, "added mass")
    modes = sorted(i for i, j in usual if i == j)
    if not modes:
        raise InputError(f"{path}: no diagonal entry of the added mass in it")
    if (lone := next(((i, j) for i, j in sorted(usual) if (j, i) not in usual), None)) is not None:
        raise InputError(f"{path}: added mass of modes {lone[0]}, {lone[1]} is there and that of {lone[1]}, {lone[0]} "
                         "is not; the whole matrix is needed, both triangles")
    pairs = np.array([[[entries.get((i, j), (0.0, 0.0)) for j in modes] for i in modes] for entries in table.values()])
    return Radiation(np.array(list(table)), pairs[..., 0], pairs[..., 1], modes)


def force_array(path: Path, table: Table, modes: list[int]) -> Forces:
    """Return X [period, heading, mode] of the entries; every period needs the same headings and all modes."""
    periods, headings = (list(dict.fromkeys(key[k] for key in table)) for k in (0, 1))
    every = {(per, h): table.get((per, h), {}) for per in periods for h in headings}
    there = usual_modes(path, {f"first column {per:g}, heading {h:g}": entries for (per, h), entries in every.items()},
                        "exciting force")
    if lost := ", ".join(str(m) for m in modes if (m,) not in there):
        raise InputError(f"{path}: no exciting force of mode {lost}, whose added mass is there")
    X = np.array([[entries[m,] for m in modes] for entries in every.values()], dtype=complex)
    beyond = sorted(m for (m,) in there if m not in modes)
    return Forces(np.array(periods), np.array(headings), X.reshape(len(periods), len(headings), len(modes)), beyond)


READINGS = ("period", "omega", "wavenumber", "deep_wavenumber", "wavelength")


def to_omega(column: FloatArray, reading: str, g: float, depth: float, length: float) -> FloatArray:
    """Return circular frequencies [rad/s].

    A period or wavelength 0 is w = inf and a negative one w = 0; for frequencies and wavenumbers the reverse.
    `wavenumber` is that of the water's depth, `deep_wavenumber` w^2 / g; both are multiplied by WAMIT's length scale.
    """
    if reading not in READINGS:
        raise InputError(f"first_column: {reading!r} is none of {list(READINGS)}")
    inverse = reading in ("period", "wavelength")
    size = np.abs(column)
    with np.errstate(divide="ignore"):
        k = 2.0 * np.pi / size if inverse else size / length
    if reading == "omega":
        omega = size
    elif reading == "period":
        omega = k
    else:
        finite = np.isfinite(k)
        deep = reading == "deep_wavenumber" or np.isinf(depth)
        share = np.ones_like(k) if deep else np.tanh(np.where(finite, k, 1.0) * depth)
        omega = np.sqrt(g * k * np.where(finite, share, 1.0))
    return np.where(column < 0.0, 0.0 if inverse else np.inf, omega)


def recognise(rows: Radiation, g: float, depth: float, length: float, clear: float = 5.0) -> tuple[str, str]:
    """Return the reading of the first column and a note: a period unless another fits Kramers-Kronig much better."""
    column = rows.period
    inside = column > 0.0
    if inside.sum() < 8:
        return "period", (f"first column taken as a period: {int(inside.sum())} frequencies are too few to tell it "
                          "from others (option first_column=)")
    residual = {}
    for reading in READINGS:
        if reading != "deep_wavenumber" or np.isfinite(depth):
            omega = to_omega(column[inside], reading, g, depth, length)
            residual[reading] = _residual(omega, rows.A[inside], rows.B[inside])
    best = min(residual, key=lambda reading: residual[reading])
    if not clear * residual[best] < residual["period"]:
        return "period", ""
    return best, (f"first column taken as {best}: added mass and damping then satisfy Kramers-Kronig within "
                  f"{100 * residual[best]:.2g} % of the change of the added mass, as a period within "
                  f"{100 * residual['period']:.2g} % (option first_column=)")


def _residual(omega: FloatArray, A: FloatArray, B: FloatArray) -> float:
    """Return the median over frequencies and modes of |A - A_inf - (what B implies)|, relative to the range of A."""
    order = np.argsort(omega)
    w = omega[order]
    mass, damping = np.einsum("kii->ki", A[order]), np.einsum("kii->ki", B[order]) * w[:, None]
    radiates = np.ptp(mass, axis=0) > 1e-3 * np.abs(mass).max(axis=0)
    if not radiates.any() or not (np.diff(w) > 0.0).all():
        return np.inf
    implied = added_mass_from_damping(w, damping[:, None, radiates])[:, 0]
    middle = (w > w[0]) & (w < 0.9 * w[-1])
    off = (mass[:, radiates] - implied)[middle]
    return float(np.median(np.abs(off - np.median(off, axis=0)) / np.ptp(mass[:, radiates], axis=0)))
