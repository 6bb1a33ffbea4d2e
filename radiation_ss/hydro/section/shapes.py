"""Shapes of symmetric ship sections: Lewis form, circle, box with bilge radius, offsets in points or a text file."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray, positive, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers.text import lines, number, row
from radiation_ss.hydro.transforms import composite
from radiation_ss.units import in_si, is_unit, understood


@dataclass(frozen=True, eq=False)
class Arc:
    """Smooth piece of the half contour: `curve(t)` = y + i z for t in [0, 1], and its derivative `slope(t)`."""

    curve: Callable[[FloatArray], ComplexArray]
    slope: Callable[[FloatArray], ComplexArray]


@dataclass(frozen=True, eq=False)
class Section:
    """Underwater part of a section symmetric about the centre line; y to the side, z up from the still water."""

    # The half contour y >= 0, from the keel (0, -draft) to the waterline (half_breadth, 0), piece by piece [m]
    arcs: tuple[Arc, ...]
    name: str = "section"

    def __post_init__(self) -> None:
        t = np.linspace(0.0, 1.0, max(5, min(81, 400 // max(1, len(self.arcs)))))
        if wrong := _wrong([arc.curve(t) for arc in self.arcs]):
            raise InputError(f"{self.name}: {wrong}")

    @property
    def half_breadth(self) -> float:
        """Half-breadth at the waterline [m]."""
        return float(self.arcs[-1].curve(np.array([1.0]))[0].real)

    @property
    def draft(self) -> float:
        """Largest depth of the contour [m]."""
        return float(-min(arc.curve(np.linspace(0.0, 1.0, 401)).imag.min() for arc in self.arcs))

    @property
    def breadth(self) -> float:
        """Largest breadth under water [m]."""
        return float(2.0 * max(arc.curve(np.linspace(0.0, 1.0, 401)).real.max() for arc in self.arcs))

    @property
    def area(self) -> float:
        """Underwater area of the whole section [m^2]."""
        return self._moments()[0]

    @property
    def centre_of_buoyancy(self) -> float:
        """Height z of the centroid of the underwater area [m], negative."""
        area, moment = self._moments()
        return moment / area

    def _moments(self) -> tuple[float, float]:
        """Return area and its first moment about the waterline, by Green's theorem: 2 int y dz and 2 int y z dz."""
        t, w = composite(np.linspace(0.0, 1.0, 41), np.ones(40, dtype=int))
        pieces = [(arc.curve(t), arc.slope(t).imag) for arc in self.arcs]
        return (sum(2.0 * float(w @ (point.real * dz)) for point, dz in pieces),
                sum(2.0 * float(w @ (point.real * point.imag * dz)) for point, dz in pieces))


def _wrong(pieces: Sequence[ComplexArray]) -> str:
    """Return what keeps the pieces from being the half contour of a section, '' where nothing does."""
    contour = np.concatenate(pieces)
    size = float(np.ptp(contour.real) + np.ptp(contour.imag))
    if not np.isfinite(size) or size <= 0.0:
        return "the contour has no extent"
    small, keel, end, inner = 1e-6 * size, contour[0], contour[-1], contour[1:-1]
    for before, after in pairwise(pieces):
        if abs(before[-1] - after[0]) > small:
            return f"open contour, a gap between {text(before[-1])} and {text(after[0])}"
    if abs(keel.real) > small:
        return f"open contour, it must start on the centre line (y = 0) at the keel, found {text(keel)}"
    if abs(end.imag) > small:
        return f"open contour, it must end on the waterline (z = 0), found {text(end)}"
    if end.real <= small or keel.imag >= -small:
        return (f"half-breadth at the waterline and draft must be positive, found {end.real:g} m and "
                f"{-keel.imag:g} m")
    if inner.imag.max() > small:
        return f"the contour leaves the water at {text(inner[inner.imag.argmax()])}; z <= 0 needed"
    if inner.real.min() < -small:
        return f"the half contour crosses the centre line at {text(inner[inner.real.argmin()])}"
    crossing = _self_crossing(np.concatenate([pieces[0], *[piece[1:] for piece in pieces[1:]]]))
    return "" if crossing is None else f"the contour crosses itself near {text(crossing)}"


def lewis_section(half_breadth: float, draft: float, area_ratio: float) -> Section:
    """Return the Lewis form of given half-breadth, draft and area ratio.

    Parameters
    ----------
    half_breadth, draft : float
        b and d [m].
    area_ratio : float
        Sectional area coefficient sigma = area / (2 b d).

    Returns
    -------
    Section

    Raises
    ------
    InputError
        If no Lewis form of these proportions exists or it is not a ship-like contour.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> rss.section_2d(rss.lewis_section(1.0, 1.0, 0.7854), [0.5, 1.0]).dofs
    ('Sway', 'Heave', 'Roll')
    """
    b, d = positive(half_breadth, "half_breadth", "m"), positive(draft, "draft", "m")
    sigma = positive(area_ratio, "area_ratio")
    # z = M (w + a1/w + a3/w^3)
    p = (b - d) / (b + d)
    c = 3.0 + 4.0 * sigma / np.pi + (1.0 - 4.0 * sigma / np.pi) * p**2
    if 9.0 - 2.0 * c < 0.0:
        raise InputError(f"area_ratio: no Lewis form has H0 = {b / d:g} and sigma = {sigma:g}; a smaller area ratio is "
                         "needed")
    a3 = (3.0 - c + np.sqrt(9.0 - 2.0 * c)) / c
    a1 = (1.0 + a3) * p
    scale = b / (1.0 + a1 + a3)

    def contour(t: FloatArray) -> ComplexArray:
        angle = 0.5 * np.pi * t  # from the keel
        y = (1.0 + a1) * np.sin(angle) - a3 * np.sin(3.0 * angle)
        return np.asarray(scale * (y - 1j * ((1.0 - a1) * np.cos(angle) + a3 * np.cos(3.0 * angle))), dtype=complex)

    return Section((_arc(contour),), f"Lewis form b = {b:g} m, d = {d:g} m, sigma = {sigma:g}")


def circle_section(radius: float, draft: float | None = None) -> Section:
    """Return a circular cylinder of given radius, floating at a draft (default: half immersed)."""
    a = positive(radius, "radius", "m")
    d = a if draft is None else positive(draft, "draft", "m")
    if d >= 2.0 * a:
        raise InputError(f"draft: {d:g} m submerges a circle of radius {a:g} m; less than {2 * a:g} m needed")
    end = np.arccos((a - d) / a)
    return Section((_arc(lambda t: 1j * (a - d) - 1j * a * np.exp(1j * end * t)),), f"circle a = {a:g} m, d = {d:g} m")


def box_section(half_breadth: float, draft: float, bilge_radius: float = 0.0) -> Section:
    """Return a rectangular section with rounded bilges."""
    b, d = positive(half_breadth, "half_breadth", "m"), positive(draft, "draft", "m")
    r = float(bilge_radius)
    if not 0.0 <= r <= min(b, d):
        raise InputError(f"bilge_radius: {r:g} m must lie between 0 and {min(b, d):g} m")
    arcs = []
    if b > r:
        arcs.append(line(-1j * d, b - r - 1j * d))
    if r > 0.0:
        arcs.append(_arc(lambda t: b - r + 1j * (r - d) - 1j * r * np.exp(0.5j * np.pi * t)))
    if d > r:
        arcs.append(line(b + 1j * (r - d), complex(b)))
    return Section(tuple(arcs), f"box b = {b:g} m, d = {d:g} m, bilge radius {r:g} m")


def _arc(contour: Callable[[FloatArray], ComplexArray]) -> Arc:
    """Return an analytic curve as a Chebyshev series exact to rounding (so that a Section pickles)."""
    series = Chebyshev.interpolate(contour, 40, domain=[0.0, 1.0])
    return Arc(series, series.deriv())


def line(start: complex, end: complex) -> Arc:
    """Return a straight piece."""
    series = Chebyshev(np.array([0.5 * (start + end), 0.5 * (end - start)]), domain=[0.0, 1.0])
    return Arc(series, series.deriv())


def _self_crossing(z: ComplexArray) -> complex | None:
    """Return a point where the polygon through `z` crosses itself, or None."""
    start, step = z[:-1], np.diff(z)
    gap = start[None, :] - start[:, None]
    cross = (np.conj(step[:, None]) * step[None, :]).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (np.conj(gap) * step[None, :]).imag / cross
        t = (np.conj(gap) * step[:, None]).imag / cross
    i, j = np.indices(cross.shape)
    hit = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0) & (j > i + 1)
    if not hit.any():
        return None
    first, other = np.argwhere(hit)[0]
    return complex(start[first] + s[first, other] * step[first])


def text(z: complex) -> str:
    """Return a point for a message."""
    return f"(y, z) = ({z.real:.4g}, {z.imag:.4g}) m"


SectionLike = Section | Sequence[Sequence[float]] | str | Path


def points_section(points: ArrayLike, name: str = "points", corner: float = 25.0) -> Section:
    """Return a section through offsets; bends sharper than `corner` [deg] are chines, the rest is a smooth spline.

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
    bends = np.abs(np.angle(steps[1:] / steps[:-1], deg=True))
    breaks = [0, *(int(i) + 1 for i in np.flatnonzero(bends > corner)), z.size - 1]
    return Section(tuple(_spline(z[i:j + 1], corner if i == 0 else 0.0) for i, j in pairwise(breaks)), name)


def read_section(path: str | Path) -> Section:
    """Read offsets from a text file of two columns y, z [m]; comma or blank separated, `#` comments, one header line.

    A unit that the header states in brackets, one of both columns or two, is converted.
    """
    entries = [(k, entry) for k, line in enumerate(lines(Path(path))) if (entry := line.split("#", 1)[0].strip())]
    rows = [(k, " ".join(cell.strip() or "(empty)" for cell in entry.split("," if "," in entry else None)))
            for k, entry in entries]
    head = rows.pop(0) if rows and number(rows[0][1].split()[0]) is None else (0, "")
    stated = re.findall(r"\[([^\]]*)\]", head[1]) or list(filter(is_unit, re.findall(r"\(([^)]*)\)", head[1])))
    metres = [factor for unit in stated if (factor := in_si(unit, "m"))]
    if len(metres) < len(stated) or len(metres) > 2:
        raise InputError(f"{path}, line {head[0] + 1}: the units of y and z in {head[1]!r} are not understood; they "
                         f"may be in {understood('m')}")
    points = np.array([row(Path(path), k, entry, 2, "y, z") for k, entry in rows])
    return points_section(points * (metres or 1.0), name=str(path))


def as_section(section: Section | ArrayLike | str | Path) -> Section:
    """Return a Section from one, from points (y, z), or from the path of an offsets file."""
    if isinstance(section, Section):
        return section
    return read_section(section) if isinstance(section, (str, Path)) else points_section(section)


def _spline(z: ComplexArray, flat: float) -> Arc:
    """Return the spline through points: horizontal at a start that is `flat` [deg] at most, else free at both ends."""
    if z.size == 2:
        return line(z[0], z[1])
    t = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(z)))])
    keel: object = "not-a-knot"
    if abs(np.angle(z[1] - z[0], deg=True)) < flat:
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
