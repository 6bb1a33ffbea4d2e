"""Sections from offsets: points or a text file."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers.text import lines, number, row
from radiation_ss.hydro.section.shapes import Arc, Section, line, text

CORNER = np.deg2rad(25.0)  # a bend sharper than this between two offsets is a chine, not a curve

SectionLike = Section | Sequence[Sequence[float]] | str | Path


def points_section(points: ArrayLike, name: str = "points") -> Section:
    """Return a section through offsets; bends sharper than 25 degrees are chines, the rest is a smooth spline.

    `points` (n, 2): offsets (y, z) [m] of the half section from the keel on the centre line to the waterline, or of the
    whole section from waterline to waterline; z up. InputError if the points are no such contour.
    """
    array = read_only(points, f"{name}: points (y, z) [m]", (None, 2))
    if len(array) < 2:
        raise InputError(f"{name}: points must be of shape (n, 2) with n >= 2, found {array.shape}")
    z = _half(array[:, 0] + 1j * array[:, 1], name)
    steps = np.diff(z)
    if (steps == 0.0).any():
        raise InputError(f"{name}: point {text(z[int(np.argmin(np.abs(steps)))])} is given twice in a row")
    bends = np.abs(np.angle(steps[1:] / steps[:-1]))
    breaks = [0, *(int(i) + 1 for i in np.flatnonzero(bends > CORNER)), z.size - 1]
    return Section(tuple(_spline(z[i:j + 1], first=i == 0) for i, j in pairwise(breaks)), name)


def read_section(path: str | Path) -> Section:
    """Read offsets from a text file of two columns y, z [m]; comma or blank separated, `#` comments, one header line.

    InputError naming file and line, if a line does not hold two numbers or the points are no section.
    """
    entries = [(k, entry) for k, line in enumerate(lines(Path(path))) if (entry := line.split("#", 1)[0].strip())]
    rows = [(k, " ".join(cell.strip() or "(empty)" for cell in entry.split("," if "," in entry else None)))
            for k, entry in entries]
    if rows and number(rows[0][1].split()[0]) is None:
        rows = rows[1:]
    return points_section([row(Path(path), k, entry, 2, "y, z") for k, entry in rows], name=str(path))


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
