"""Sections from offsets: points or a text file."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers.text import lines, number
from radiation_ss.hydro.section.shapes import Arc, Section, line, text

CORNER = np.deg2rad(25.0)  # a bend sharper than this between two offsets is a chine, not a curve

SectionLike = Section | Sequence[Sequence[float]] | str | Path


def points_section(points: ArrayLike, name: str = "points") -> Section:
    """Return a section through offsets; bends sharper than 25 degrees are chines, the rest is a smooth spline.

    `points` (n, 2): offsets (y, z) [m] of the half section from the keel on the centre line to the waterline, or of the
    whole section from waterline to waterline; z up. InputError if the points are no such contour.
    """
    try:
        array = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: points must be numbers, two in a row (y, z)") from None
    if array.ndim != 2 or array.shape[1] != 2 or array.shape[0] < 2 or not np.isfinite(array).all():
        raise InputError(f"{name}: points must be finite, shape (n, 2) with n >= 2, found {array.shape}")
    z = array[:, 0] + 1j * array[:, 1]
    z = _half(z, name)
    if np.any(np.abs(np.diff(z)) == 0.0):
        at = int(np.flatnonzero(np.abs(np.diff(z)) == 0.0)[0])
        raise InputError(f"{name}: point {text(z[at])} is given twice in a row")
    bends = np.abs(np.angle(np.diff(z)[1:] / np.diff(z)[:-1]))
    breaks = [0, *(int(i) + 1 for i in np.flatnonzero(bends > CORNER)), z.size - 1]
    return Section(tuple(_spline(z[i:j + 1], first=i == 0) for i, j in pairwise(breaks)), name)


def read_section(path: str | Path) -> Section:
    """Read offsets from a text file of two columns y, z [m]; comma or blank separated, `#` comments, one header line.

    InputError naming file and line, if a line does not hold two numbers or the points are no section.
    """
    rows: list[list[float]] = []
    header = False
    for k, raw in enumerate(lines(Path(path)), start=1):
        entry = raw.split("#", 1)[0].strip()
        if not entry:
            continue
        cells = entry.split(",") if "," in entry else entry.split()
        row = [value for cell in cells if (value := number(cell.strip())) is not None]
        if len(row) < len(cells):
            if rows or header or number(cells[0].strip()) is not None:
                raise InputError(f"{path}, line {k}: {entry!r} is not two numbers")
            header = True
            continue
        if len(row) != 2:
            raise InputError(f"{path}, line {k}: {len(row)} columns found, y and z needed")
        rows.append(row)
    return points_section(rows, name=str(path))


def as_section(section: Section | ArrayLike | str | Path) -> Section:
    """Return a Section from one, from points (y, z), or from the path of an offsets file."""
    if isinstance(section, Section):
        return section
    return read_section(section) if isinstance(section, (str, Path)) else points_section(section)


def _spline(z: ComplexArray, *, first: bool) -> Arc:
    """Return the spline through points; horizontal at a smooth keel, free at chines and waterline."""
    if z.size == 2:
        return line(z[0], z[1])
    t = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(z)))])
    keel: object = "not-a-knot"
    if first and abs(np.angle(z[1] - z[0])) < CORNER:
        keel = (1, complex(t[-1]))
    spline = CubicSpline(t / t[-1], z, bc_type=(keel, "not-a-knot"))
    return Arc(spline, spline.derivative())


def _half(z: ComplexArray, name: str) -> ComplexArray:
    """Return the half contour from keel to waterline, whichever half or order the points come in."""
    size = np.ptp(z.real) + np.ptp(z.imag)
    small = 1e-6 * size
    if z.real.min() < -small and z.real.max() > small:  # whole section
        other = -np.conj(z[::-1])
        if np.abs(other - z).max() > 1e-3 * size:
            raise InputError(f"{name}: the section is not symmetric about y = 0 (by {np.abs(other - z).max():.3g} m)")
        if z[0].real > 0.0:
            z = z[::-1]
        upper = z[z.size // 2:]
        if z.size % 2 == 0:  # no point on the centre line: a flat keel between the two nearest
            upper = np.concatenate([[1j * upper[0].imag], upper])
        z = upper
    elif z.real.max() <= small:
        z = -np.conj(z)
    if abs(z[0].imag) < abs(z[-1].imag):
        z = z[::-1]
    return z
