"""The boundary-integral equations of a section: set up, and solved for a block of frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.section import green
from radiation_ss.hydro.section.panels import (
    Mesh,
    NearRule,
    above,
    across,
    build_mesh,
    layers,
    near_rule,
    opposite,
    same,
)
from radiation_ss.hydro.section.shapes import Section

LID = 0.92  # the lid's points keep off the contour: part of the half-breadth that they take up


@dataclass(frozen=True, eq=False)
class Equations:
    """What does not depend on frequency.

    Parameters
    ----------
    mesh : Mesh
    targets : ndarray, shape (nt,)
        The panels' nodes, then points on the water surface inside the body (the lid).
    rankine : dict
        By parity (True: even): single and double layer of ln r - ln r', (nt, n) each.
    rules : tuple of NearRule
        Quadrature of the wave part near the images above the water surface.
    depth : float
    depth_term : DepthTerm or None
        None in deep water.
    """

    mesh: Mesh
    targets: ComplexArray
    rankine: dict[bool, tuple[FloatArray, FloatArray]]
    rules: tuple[NearRule, NearRule]
    depth: float
    depth_term: green.DepthTerm | None


def prepare(section: Section, panels: int, depth: float, K_range: FloatArray) -> Equations:
    """Place panels and lid, and integrate the part that all frequencies share.

    Parameters
    ----------
    section : Section
    panels : int
        Number on the whole contour.
    depth : float
    K_range : ndarray, shape (2,)
        Smallest and largest omega^2 / g.
    """
    mesh = build_mesh(section, panels, float(K_range[1]))
    t, _ = np.polynomial.legendre.leggauss(max(6, mesh.size // 3))
    targets = np.concatenate([mesh.points, 0.5 * LID * section.half_breadth * (t + 1.0)])
    kernel = partial(green.rankine, float(mesh.weights.sum()))
    parts = []
    for mirror in (same, across, above, opposite):
        rule = near_rule(mesh, targets, mirror, levels=10, nodes=10, on=mirror is same)
        parts.append(layers(kernel, mesh, targets, mirror, rule))
    own, other, image, other_image = (np.array(part) for part in parts)
    even, odd = own + other - image - other_image, own - other - image + other_image
    rules = (near_rule(mesh, targets, above, levels=6, nodes=8), near_rule(mesh, targets, opposite, levels=6, nodes=8))
    term = None
    if np.isfinite(depth):
        term = green.DepthTerm.build(depth, section.draft, 0.5 * section.breadth, float(K_range[0]))
    return Equations(mesh, targets, {True: (even[0], even[1]), False: (odd[0], odd[1])}, rules, depth, term)


def layers_by_parity(equations: Equations, K: FloatArray) -> dict[bool, tuple[ComplexArray, ComplexArray]]:
    """Return single and double layer of the free-surface source for even and odd motion, (nw, nt, n) each.

    K = [inf] gives phi = 0 on the water surface.
    """
    total = {even: [part.astype(complex)[None] for part in parts] for even, parts in equations.rankine.items()}
    wave = _wave_layers(equations, K) if np.isfinite(K).all() else {}
    depth = _depth_layers(equations, K) if equations.depth_term is not None else {}
    for more in (wave, depth):
        for even, parts in more.items():
            total[even] = [a + b for a, b in zip(total[even], parts)]
    return {even: (parts[0], parts[1]) for even, parts in total.items()}


def _wave_layers(equations: Equations, K: FloatArray) -> dict[bool, tuple[ComplexArray, ComplexArray]]:
    kernel = partial(green.wave, K[:, None, None])
    own, other = (layers(kernel, equations.mesh, equations.targets, mirror, rule)
                  for mirror, rule in zip((same, across), equations.rules))
    return {True: (own[0] + other[0], own[1] + other[1]), False: (own[0] - other[0], own[1] - other[1])}


def _depth_layers(equations: Equations, K: FloatArray) -> dict[bool, tuple[ComplexArray, ComplexArray]]:
    mesh, term = equations.mesh, equations.depth_term
    assert term is not None
    minus, plus, weight = (part[:, None, :] for part in term.spectrum(K))
    found = {}
    for even in (True, False):
        a, c = term.factors(equations.targets, even)
        left = weight * (minus * a + plus * c)
        single, double = (np.matmul(left, np.swapaxes(minus * a + plus * c, 1, 2)) * mesh.weights for a, c in
                          (term.factors(mesh.points, even), term.factors(mesh.points, even, mesh.normals)))
        found[even] = (single, double)
    return found


def solve(system: tuple[ComplexArray, ComplexArray], velocity: ComplexArray) -> ComplexArray:
    """Return the potential on the panels for given normal velocities, (nw, n, right-hand sides).

    pi phi + int phi dG/dn ds = int G phi_n ds on the body; the same without pi phi at the points of the lid. Least
    squares by the normal equations: the matrix is of the second kind and well conditioned.
    """
    single, double = system
    size = double.shape[-1]
    matrix = double.copy()
    matrix[:, np.arange(size), np.arange(size)] += np.pi
    adjoint = np.conj(np.swapaxes(matrix, 1, 2))
    return np.asarray(np.linalg.solve(adjoint @ matrix, adjoint @ (single @ velocity)), dtype=complex)
