"""The boundary-integral equations of a section: their free-surface source, set up, solved, and integrals of them.

The source is that of deep water or finite depth, time factor e^{+i w t}, normalised to G ~ ln|P - Q|. Points are
complex numbers P = y + i z, z up from the still water surface; K = omega^2 / g. Wehausen & Laitone (1960), Surface
Waves, section 13; the factored finite-depth form is derived in docs/theory/section.md.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import exp1

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.linear_waves import profile, wave_number
from radiation_ss.hydro.section import panels
from radiation_ss.hydro.section.panels import Mesh, NearRule
from radiation_ss.hydro.section.shapes import Section


def rankine_part(unit: float, P: ComplexArray, Q: ComplexArray, n: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return ln(|P - Q| / unit) and its derivative along the normal n at Q; the unit of length [m] drops out of G."""
    r = P - Q
    return np.log(np.abs(r) / unit), -(n / r).real


def wave_part(K: FloatArray, P: ComplexArray, Q: ComplexArray, n: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return G - ln r + ln r' of deep water and its derivative along the normal n at Q; r' from the image of Q above.

    G = ln r - ln r' - 2 int_0^oo e^{k Y} cos(k X) / (k - K) dk, the path above the pole, X = y_P - y_Q, Y = z_P + z_Q
    = ln r - ln r' - 2 Re F(K w) + 2 pi i e^{K conj(w)},  w = Y + i|X|,  F(s) = e^s E1(s).
    """
    offset = P - np.conj(Q)
    w = offset.imag + 1j * np.abs(offset.real)
    step = n.imag - 1j * np.sign(offset.real) * n.real  # dw/dn
    F = scaled_exp1(K * w)
    outgoing = 2j * np.pi * np.exp(K * np.conj(w))
    return -2.0 * F.real + outgoing, -2.0 * ((K * F - 1.0 / w) * step).real + outgoing * K * np.conj(step)


def scaled_exp1(s: ComplexArray) -> ComplexArray:
    """Return e^s E1(s) without overflow; E1 is the exponential integral, principal branch."""
    far = np.abs(s) > 40.0
    if not far.any():
        return np.exp(s) * exp1(s)
    near = np.where(far, -1.0, s)
    inverse = -1.0 / np.where(far, s, 1e3)
    term = -inverse
    series = term.copy()
    for order in range(1, 20):  # asymptotic, 1e-14 at |s| = 40
        term = term * order * inverse
        series += term
    return np.where(far, series, np.exp(near) * exp1(near))


@dataclass(frozen=True, eq=False)
class DepthTerm:
    """G(finite depth) - G(deep), as a sum of products of a function of P and the same function of Q.

    D = -int_0^oo U_k(P) U_k(Q) / (k (k - K) [(k - K) - e^{-2kh}(k + K)]) dk for a source and its mirror image about the
    centre line, with U = ((k - K) e^{-k(h + z)} + (k + K) e^{-k(h - z)}) (cos k y for even motion, sin k y for odd),
    times two. The path is a ray above both poles, k = s e^{i alpha}; trapezoidal rule in ln s.
    """

    depth: float  # Water depth h [m]
    # k, weight (nk,): Nodes and weights dk
    k: ComplexArray
    weight: ComplexArray

    @classmethod
    def build(cls, depth: float, draft: float, half_breadth: float, K_min: float) -> "DepthTerm":
        """Choose the ray so that cos(k X) does not outgrow the depth factor, and its nodes for about 1e-10."""
        angle = min(0.25 * np.pi, 0.5 * np.arctan2(depth - draft, half_breadth))
        decay = 2.0 * ((depth - draft) * np.cos(angle) - half_breadth * np.sin(angle))
        low, high = np.log(min(1e-6 * K_min, 1e-6 / depth)), np.log(35.0 / decay)
        step = 2.0 * np.pi * angle / 25.0
        s = np.exp(np.arange(low, high + step, step))
        k = s * np.exp(1j * angle)
        return cls(depth, k, step * k)

    def factor(self, minus: ComplexArray, plus: ComplexArray, P: ComplexArray, even: bool,
               normal: ComplexArray | None = None) -> ComplexArray:
        """Return U at the points, or its normal derivative, (nw, np, nk); `minus`, `plus` as of `spectrum`."""
        k, y, z = self.k, P.real[:, None], P.imag[:, None]
        down, up = np.exp(-k * (self.depth + z)), np.exp(-k * (self.depth - z))
        across, slope = (np.cos(k * y), -k * np.sin(k * y)) if even else (np.sin(k * y), k * np.cos(k * y))
        if normal is None:
            return (minus * down + plus * up) * across
        ny, nz = normal.real[:, None], normal.imag[:, None]
        return minus * (down * (slope * ny - k * across * nz)) + plus * (up * (slope * ny + k * across * nz))

    def spectrum(self, K: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return (k - K, k + K, weight), each (nw, 1, nk); K = inf gives the limit of infinite frequency."""
        K = np.asarray(K, dtype=float)[:, None, None]
        image = np.exp(-2.0 * self.k * self.depth)
        with np.errstate(invalid="ignore"):
            minus, plus = self.k / K - 1.0, self.k / K + 1.0
        return minus, plus, -2.0 * self.weight / (self.k * minus * (minus - image * plus))


@dataclass(frozen=True, eq=False)
class SectionEquations:
    """What does not depend on frequency."""

    mesh: Mesh
    targets: ComplexArray  # (nt,): The panels' nodes, then points on the water surface inside the body (the lid)
    rankine: FloatArray  # (2, 2, nt, n): Of even and odd motion, the single and the double layer of ln r - ln r'
    rules: tuple[NearRule, NearRule]  # Quadrature of the wave part near the images above the water surface
    depth: float
    depth_term: DepthTerm | None  # None in deep water


def prepare(section: Section, mesh: Mesh, depth: float, K_range: FloatArray, lid: float = 0.92) -> SectionEquations:
    """Place the lid, and integrate the part that all frequencies share.

    `K_range` (2,): smallest and largest omega^2 / g. `lid`: part of the half-breadth that the lid's points take up:
    they keep off the contour.
    """
    t, _ = np.polynomial.legendre.leggauss(max(6, mesh.size // 3))
    targets = np.concatenate([mesh.points, 0.5 * lid * section.half_breadth * (t + 1.0)])
    kernel = partial(rankine_part, float(mesh.weights.sum()))
    parts = []
    for mirror in (panels.same, panels.across, panels.above, panels.opposite):
        rule = panels.near_rule(mesh, targets, mirror, levels=10, nodes=10, on=mirror is panels.same)
        parts.append(panels.layers(kernel, mesh, targets, mirror, rule))
    own, other, image, other_image = (np.array(part) for part in parts)
    rankine = np.stack([own + other - image - other_image, own - other - image + other_image])
    rules = (panels.near_rule(mesh, targets, panels.above, levels=6, nodes=8),
             panels.near_rule(mesh, targets, panels.opposite, levels=6, nodes=8))
    term = None if np.isinf(depth) else DepthTerm.build(depth, section.draft, 0.5 * section.breadth, float(K_range[0]))
    return SectionEquations(mesh, targets, rankine, rules, depth, term)


def layers_by_parity(equations: SectionEquations, K: FloatArray) -> ComplexArray:
    """Return of even and odd motion the single and the double layer of the free-surface source, (2, 2, nw, nt, n).

    K = [inf] gives phi = 0 on the water surface.
    """
    mesh, term = equations.mesh, equations.depth_term
    found = equations.rankine[:, :, None].astype(complex)
    if np.isfinite(K).all():
        kernel = partial(wave_part, K[:, None, None])
        own, other = (np.array(panels.layers(kernel, mesh, equations.targets, mirror, rule))
                      for mirror, rule in zip((panels.same, panels.across), equations.rules))
        found = found + np.stack([own + other, own - other])
    if term is not None:
        minus, plus, weight = term.spectrum(K)
        for parity, even in enumerate((True, False)):
            left = weight * term.factor(minus, plus, equations.targets, even)
            for layer, normals in enumerate((None, mesh.normals)):
                right = term.factor(minus, plus, mesh.points, even, normals)
                found[parity, layer] += np.matmul(left, np.swapaxes(right, 1, 2)) * mesh.weights
    return found


def solve(system: ComplexArray, velocity: ComplexArray) -> ComplexArray:
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


class Flow(NamedTuple):
    """Integrals over the whole contour, for unit density; modes in the order Sway, Heave, Roll."""

    forces: ComplexArray  # (nw, 3, 3): int phi_j n_i ds of unit velocity in mode j
    # (nw, 3): i omega int (phi_incident + phi_scattered) n_i ds for a wave of unit amplitude towards +y
    exciting: ComplexArray
    # (nw, 2, 3): int (phi_n - phi d/dn) Z e^{+-i k0 y} ds of the radiation potentials, Z = cosh k0(z + h) / cosh k0 h
    kochin: ComplexArray
    kochin_scattered: ComplexArray  # (nw, 2): The same of the scattered potential


def solve_flow(equations: SectionEquations, omega: FloatArray, g: float) -> Flow:
    """Solve radiation and diffraction for a block of frequencies, even (heave) and odd motion (sway, roll) apart."""
    mesh = equations.mesh
    K = omega ** 2 / g
    systems = layers_by_parity(equations, K)
    waves = _standing_waves(mesh, wave_number(K, equations.depth), equations.depth)
    amplitude = (1j * g / omega)[:, None]
    radiated, total, kochin = [], [], []
    for modes, system, (value, slope), phase in zip(_motions(mesh), systems, waves, (amplitude, -1j * amplitude)):
        velocity = np.concatenate([np.broadcast_to(modes, (omega.size, *modes.shape)),  # e^{-i k0 y} = cos - i sin
                                   (-phase * slope)[..., None]], axis=2)
        phi = solve(system, velocity)
        kochin.append(2.0 * (np.einsum("wn,wnr->wr", mesh.weights * value, velocity)
                             - np.einsum("wn,wnr->wr", mesh.weights * slope, phi)))
        radiated.append(phi[..., :-1])
        total.append(phi[..., -1] + phase * value)
    both = [(kochin[0], sign * 1j * kochin[1]) for sign in (1.0, -1.0)]  # e^{+-i k0 y} = cos +- i sin
    n = 2.0 * mesh.modes * mesh.weights
    exciting = np.stack([total[1] @ n[0], total[0] @ n[1], total[1] @ n[2]], axis=1)
    return Flow(_forces(mesh, *radiated), 1j * omega[:, None] * exciting,
                np.stack([_in_order(a[:, :-1], b[:, :-1]) for a, b in both], axis=1),
                np.stack([a[:, -1] + b[:, -1] for a, b in both], axis=1))


def infinite_frequency(equations: SectionEquations) -> FloatArray:
    """Return int phi_j n_i ds with phi = 0 on the water surface, (3, 3)."""
    systems = layers_by_parity(equations, np.array([np.inf]))
    radiated = (solve(system, modes.astype(complex)) for system, modes in zip(systems, _motions(equations.mesh)))
    return _forces(equations.mesh, *radiated)[0].real


def _motions(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Return normal velocities of even motion, heave (n, 1), and of odd motion, sway and roll (n, 2)."""
    return mesh.modes[1:2].T, mesh.modes[::2].T


def _in_order(heave: ComplexArray, lateral: ComplexArray) -> ComplexArray:
    """Join heave and (sway, roll) on the last axis as (Sway, Heave, Roll)."""
    return np.concatenate([lateral[..., :1], heave, lateral[..., 1:]], axis=-1)


def _forces(mesh: Mesh, even: ComplexArray, odd: ComplexArray) -> ComplexArray:
    """Return int phi_j n_i ds over the whole contour, (nw, i, j); even and odd motions do not meet."""
    forces = np.matmul(2.0 * mesh.modes * mesh.weights, _in_order(even, odd))
    forces[:, 1, 0::2] = 0.0
    forces[:, 0::2, 1] = 0.0
    return forces


def _standing_waves(mesh: Mesh, k0: FloatArray, depth: float) -> list[tuple[FloatArray, FloatArray]]:
    """Return Z cos k0 y (even) and Z sin k0 y (odd) on the panels with their normal derivatives, (nw, n) each."""
    k = k0[:, None]
    y, z = mesh.points.real, mesh.points.imag
    ny, nz = mesh.normals.real, mesh.normals.imag
    Z, dZ = profile(k, depth, z)
    c, s = np.cos(k * y), np.sin(k * y)
    return [(Z * c, dZ * c * nz - k * Z * s * ny), (Z * s, dZ * s * nz + k * Z * c * ny)]
