"""Curved panels of high order on the half contour, and the quadrature of near-singular kernels on them.

The contour is cut into elements; on each the potential is a polynomial through ORDER Gauss-Legendre points. One such
point is one unknown, called a panel here: 60 panels are 60 unknowns on the whole section, 30 on the half.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from radiation_ss.arrays import ComplexArray, FloatArray, lagrange
from radiation_ss.hydro.section.shapes import Arc, Section
from radiation_ss.hydro.transforms import gauss

ORDER = 5  # nodes of an element

Kernel = Callable[[ComplexArray, ComplexArray, ComplexArray], tuple[np.ndarray, np.ndarray]]
Mirror = Callable[[ComplexArray], ComplexArray]
Piece = tuple[Arc, float, float]

# The points themselves, their mirror images about the still water surface, and about that and the centre line.
same: Mirror = np.positive
above: Mirror = np.conj
opposite: Mirror = np.negative


def across(z: ComplexArray) -> ComplexArray:
    """Return the mirror image about the centre line."""
    return -np.conj(z)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Panels of the half contour: node points, unit normals out of the body, quadrature weights ds; shape (n,).

    `pieces` holds (arc, t0, t1) of each element, `local` the Gauss-Legendre nodes on [0, 1].
    """

    points: ComplexArray
    normals: ComplexArray
    weights: FloatArray
    pieces: tuple[Piece, ...]
    local: FloatArray

    @property
    def size(self) -> int:
        """Number of panels on the half contour."""
        return self.points.size

    @property
    def modes(self) -> FloatArray:
        """Generalised normals of sway, heave and roll about the origin, shape (3, n)."""
        n, P = self.normals, self.points
        return np.array([n.real, n.imag, P.real * n.imag - P.imag * n.real])


@dataclass(frozen=True, eq=False)
class NearRule:
    """Quadrature of near target-element pairs: points graded towards the target, and interpolation to them."""

    target: np.ndarray  # (pairs,)
    columns: np.ndarray  # (pairs, ORDER): The element's unknowns
    # Q, n (pairs, nq): Points (on the element itself) and normals
    Q: ComplexArray
    n: ComplexArray
    weights: FloatArray  # (pairs, nq, ORDER): ds times the element's basis functions


def build_mesh(section: Section, panels: int, K_max: float) -> Mesh:
    """Cut the half contour into elements and place the nodes."""
    pieces = _elements(section, max(1, round(panels / (2 * ORDER))), K_max)
    t, w = gauss(ORDER)
    points, normals, speeds = map(np.concatenate, zip(*(_along(piece, t) for piece in pieces)))
    return Mesh(points, normals, np.tile(w, len(pieces)) * speeds, tuple(pieces), t)


def _along(piece: Piece, x: FloatArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Return points, normals and speed |d(y + i z)/dx| of an element for x in [0, 1]."""
    arc, t0, t1 = piece
    slope = (t1 - t0) * arc.slope(t0 + (t1 - t0) * x)
    return arc.curve(t0 + (t1 - t0) * x), -1j * slope / np.abs(slope), np.abs(slope)


def _elements(section: Section, number: int, K_max: float, largest: float = 1.6) -> list[Piece]:
    """Cut the arcs into elements that shrink towards the waterline, corners and tight bilges.

    They grow with distance from these up to `largest` l/n, for n of them on a half contour of length l.
    """
    t = np.linspace(0.0, 1.0, 401)
    speeds = [np.abs(arc.slope(t)) for arc in section.arcs]
    along = [cumulative_trapezoid(v, t, initial=0.0) for v in speeds]
    starts = np.concatenate([[0.0], np.cumsum([length[-1] for length in along])])
    total = float(starts[-1])
    features = _features(section, starts, number, K_max)
    needs = []
    for start, length in zip(starts, along):
        size = np.min([least + np.abs(start + length - place) for place, least in features], axis=0)
        density = 1.0 / np.minimum(size, largest / number * total)
        needs.append(cumulative_trapezoid(density, length, initial=0.0))
    counts = np.ones(len(needs), dtype=int)
    while counts.sum() < number:
        counts[np.argmax([need[-1] / count for need, count in zip(needs, counts)])] += 1
    pieces = []
    for arc, need, count in zip(section.arcs, needs, counts):
        cuts = np.interp(np.linspace(0.0, need[-1], count + 1), need, t)
        pieces += [(arc, float(a), float(b)) for a, b in pairwise(cuts)]
    return pieces


def _features(section: Section, starts: FloatArray, number: int, K_max: float, waterline: float = 0.3,
              wave: float = 2.0, sharp: float = 0.3) -> list[tuple[float, float]]:
    """Return (position along the contour, element size wanted there) of waterline, corners and ends of bends.

    At the waterline `waterline` l/n or, in short waves, `wave`/K; at a corner `sharp` l/n^2.
    """
    total = float(starts[-1])
    ends = np.array([0.0, 1.0])
    slopes = [arc.slope(ends) for arc in section.arcs]
    features = [(total, float(np.clip(wave / K_max, 0.01 * total, waterline / number * total)))]
    for place, before, after in zip(starts[1:], slopes, slopes[1:]):
        if abs(np.angle(after[0] / before[1])) > 0.1:
            features.append((float(place), sharp / number ** 2 * total))
    for (first, last), slope in zip(pairwise(starts), slopes):
        turn = abs(np.angle(slope[1] / slope[0]))
        if turn > 0.1:
            radius = (last - first) / turn
            features += [(float(first), radius), (float(last), radius)]
    return features


def near_rule(mesh: Mesh, targets: ComplexArray, mirror: Mirror, levels: int, nodes: int, *,
              on: bool = False, near_by: float = 1.2) -> NearRule:
    """Collect the pairs of target (nt,) and element that are near under the mirror, and their dyadic quadrature.

    `mirror` gives the element's image; it is linear, so it mirrors normals too. `levels` halvings towards the nearest
    point, `nodes` of Gauss on each interval. `on`: the first `mesh.size` targets are the nodes themselves and the
    mirror is the identity: the kernel is singular. A point nearer than `near_by` element lengths is near.
    """
    unit, unit_weight = _dyadic(levels, nodes)
    fine, nq = np.linspace(0.0, 1.0, 65), unit.size
    found: list[tuple[np.ndarray, ...]] = [(np.zeros(0, int), np.zeros((0, ORDER), int), np.zeros((0, nq), complex),
                                            np.zeros((0, nq), complex), np.zeros((0, nq, ORDER)))]
    for element, piece in enumerate(mesh.pieces):
        columns = element * ORDER + np.arange(ORDER)
        distance = np.abs(targets[:, None] - mirror(_along(piece, fine)[0]))
        length = mesh.weights[columns].sum()
        near = np.flatnonzero(distance.min(axis=1) < near_by * length)
        split = fine[distance[near].argmin(axis=1)]
        if on:
            split = np.where((near >= columns[0]) & (near <= columns[-1]),
                             mesh.local[np.clip(near - columns[0], 0, ORDER - 1)], split)
        for end in (0.0, 1.0):
            reach = end - split
            keep = np.abs(reach) > 1e-12
            if not keep.any():
                continue
            x = split[keep, None] + reach[keep, None] * unit
            Q, n, speed = _along(piece, x)
            ds = speed * np.abs(reach[keep, None]) * unit_weight
            found.append((near[keep], np.tile(columns, (len(x), 1)), Q, n, ds[..., None] * lagrange(mesh.local, x)))
    return NearRule(*map(np.concatenate, zip(*found)))


def layers(kernel: Kernel, mesh: Mesh, targets: ComplexArray, mirror: Mirror,
           rule: NearRule) -> tuple[np.ndarray, np.ndarray]:
    """Return single- and double-layer matrices (..., nt, n) of a kernel(P, Q, n) -> (G, dG/dn at Q) under a mirror."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a target on its own node: replaced by the near rule below
        single, double = kernel(targets[:, None], mirror(mesh.points), mirror(mesh.normals))
    single, double = single * mesh.weights, double * mesh.weights
    G, dG = kernel(targets[rule.target][:, None], mirror(rule.Q), mirror(rule.n))
    at: Any = (..., rule.target[:, None], rule.columns)
    for matrix, values in ((single, G), (double, dG)):
        matrix[at] = 0.0
        # A pair appears once for each side of its nearest point: both are added.
        np.add.at(matrix, at, np.matmul(values[..., None, :], rule.weights)[..., 0, :])
    return single, double


def _dyadic(levels: int, nodes: int) -> tuple[FloatArray, FloatArray]:
    """Return Gauss points on [0, 1] with intervals halving towards 0.

    On the interval at 0 the weights are exact for ln t beside polynomials. Without that more halvings were needed, and
    the kernels lose their digits there: rounding of P - Q, over its square.
    """
    t, w = gauss(nodes)
    cuts = np.concatenate([[0.0], 0.5 ** np.arange(levels, -1.0, -1.0)])
    size = np.diff(cuts)
    weights = size[:, None] * w
    basis = np.polynomial.legendre.legvander(2.0 * t - 1.0, nodes - 1)
    basis[:, -1] = np.log(t)
    integrals = np.zeros(nodes)
    integrals[0], integrals[-1] = 1.0, -1.0
    weights[0] = size[0] * np.linalg.solve(basis.T, integrals)
    return (cuts[:-1, None] + size[:, None] * t).ravel(), weights.ravel()
