"""Radiation and diffraction by a section, deep water or finite depth, all frequencies of a block at once."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.section import green
from radiation_ss.hydro.section.checks import FarField, SectionChecks, check
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
from radiation_ss.hydro.section.shapes import Section, SectionLike, as_section

DOFS = ("Sway", "Heave", "Roll")
BLOCK = 25  # frequencies solved together


@dataclass(frozen=True, eq=False)
class SectionSolution:
    """All that `solve_section` finds.

    Parameters
    ----------
    hydro : HydroData
        Coefficients per unit length; `.hydro.times(length)` for a body.
    checks : SectionChecks
    section : Section
    panels : int
        Panels on the whole contour.
    far_field : FarField
        Radiated and scattered waves.
    """

    hydro: HydroData
    checks: SectionChecks
    section: Section
    panels: int
    far_field: FarField


@dataclass(frozen=True, eq=False)
class _Geometry:
    """What does not depend on frequency: mesh, lid points, Rankine layers by parity, near rules of the wave part."""

    mesh: Mesh
    targets: ComplexArray
    rankine: dict[bool, tuple[FloatArray, FloatArray]]
    wave_rules: tuple[NearRule, NearRule]
    depth: green.DepthTerm | None


def section_2d(section: SectionLike, omega: ArrayLike, depth: float = np.inf, **options: float) -> HydroData:
    """Return added mass, damping and exciting force of a section in Sway, Heave and Roll; see `solve_section`."""
    return solve_section(section, omega, depth, **options).hydro  # type: ignore[arg-type]


def solve_section(section: SectionLike, omega: ArrayLike, depth: float = np.inf, *, panels: int = 60,
                  rho: float = 1000.0, g: float = 9.81, centre_of_gravity: float = 0.0,
                  gyradius: float | None = None, progress: bool | None = None) -> SectionSolution:
    """Solve the linear radiation and diffraction problems of a symmetric section.

    Boundary-integral equation for the potential with the free-surface source, curved panels of high order; points on
    the water surface inside the body are added as equations, which removes the irregular frequencies.

    Parameters
    ----------
    section : Section, array_like (n, 2), or path
        A shape, offsets (y, z) [m], or a file of offsets.
    omega : array_like, shape (nw,)
        Circular frequencies [rad/s], positive, ascending.
    depth : float
        Water depth [m]; inf for deep water.
    panels : int
        Unknowns on the whole contour; taken up to whole elements of 5 on each half.
    rho, g : float
        Water density [kg/m^3] and gravity [m/s^2].
    centre_of_gravity : float
        Height z [m], z up from the still water surface; enters C44 and M.
    gyradius : float, optional
        Roll radius of gyration about the centre of gravity [m]; M is given only with it (mass = displacement).
    progress : bool, optional
        Show a progress bar; by default only on a terminal and for long sweeps.

    Returns
    -------
    SectionSolution
        `.hydro` per unit length about the point (0, 0, 0): Sway along y, Heave up, Roll by the right-hand rule about x,
        with A_inf, C and X for a wave running towards +y (direction pi/2).

    Raises
    ------
    InputError
        If the section, depth, frequencies or another argument make no sense.
    """
    shape = as_section(section)
    w = _frequencies(omega)
    depth = _scalars(shape, depth, panels, {"rho": rho, "g": g})
    geometry = _prepare(shape, panels, depth, float(w[0] ** 2 / g))
    starts = range(0, w.size, BLOCK)
    blocks = [_solve_block(geometry, w[i:i + BLOCK], depth, g) for i in tracked(starts, progress)]
    forces, per_density, H, H_scattered = (np.concatenate(parts) for parts in zip(*blocks))
    A, B = -rho * forces.real, rho * w[:, None, None] * forces.imag  # p = -i w rho phi
    X: ComplexArray = (rho * per_density).astype(complex)
    field = FarField.build(w, depth, rho, g, H, H_scattered)
    C, M = _hydrostatics(shape, rho, g, centre_of_gravity, gyradius)
    hydro = HydroData(
        omega=w, A=_symmetric(A), B=_symmetric(B), dofs=DOFS, rho=rho, g=g, depth=depth,
        A_inf=-rho * _symmetric(_infinite_frequency(geometry).real),
        M=M, C=C, X=X[:, None, :], directions=np.array([0.5 * np.pi]),
        source=f"section_2d: {shape.name}")
    return SectionSolution(hydro, check(w, A, B, X, field), shape, 2 * geometry.mesh.size, field)


def tracked(items: Sequence[int], progress: bool | None) -> Iterable[int]:
    """Return the blocks, with a progress bar if asked for or if there are many and somebody is watching."""
    if progress is None:
        progress = len(items) >= 8 and sys.stderr.isatty()
    if not progress:
        return items
    from rich.console import Console
    from rich.progress import track

    return track(items, description="section", console=Console(stderr=True))


def _symmetric(matrix: FloatArray) -> FloatArray:
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def _frequencies(omega: ArrayLike) -> FloatArray:
    try:
        w = np.atleast_1d(np.array(omega, dtype=float))
    except (TypeError, ValueError):
        raise InputError("omega: not an array of numbers (rad/s)") from None
    if w.ndim != 1 or w.size == 0 or not np.isfinite(w).all() or w.min() <= 0.0 or np.any(np.diff(w) <= 0.0):
        raise InputError("omega: must be finite, positive and ascending frequencies in rad/s")
    return w


def _scalars(section: Section, depth: float, panels: int, positive: dict[str, float]) -> float:
    """Check the numbers; return the depth, infinite where no wave or body can feel it."""
    for name, value in positive.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: must be positive and finite, found {value}")
    if not float(depth) > 0.0:
        raise InputError(f"depth: must be positive (inf for deep water), found {depth} m")
    if section.draft >= depth:
        raise InputError(f"depth: {depth:g} m is not more than the draft {section.draft:g} m of {section.name}")
    if not 10 <= panels <= 2000:
        raise InputError(f"panels: between 10 and 2000 needed, found {panels}")
    return float(depth)


def _hydrostatics(section: Section, rho: float, g: float, z_G: float,
                  gyradius: float | None) -> tuple[FloatArray, FloatArray | None]:
    """Return C and M about (0, 0, 0) per unit length of a freely floating section of mass rho S."""
    if not np.isfinite(z_G):
        raise InputError(f"centre_of_gravity: must be finite, found {z_G}")
    S, b = section.area, section.half_breadth
    C = np.diag([0.0, 2.0 * b, 2.0 / 3.0 * b ** 3 + S * (section.centre_of_buoyancy - z_G)]) * rho * g
    if gyradius is None:
        return C, None
    if not (np.isfinite(gyradius) and gyradius > 0.0):
        raise InputError(f"gyradius: must be positive and finite, found {gyradius}")
    M = np.diag([1.0, 1.0, gyradius ** 2 + z_G ** 2])
    M[0, 2] = M[2, 0] = -z_G
    return C, rho * S * M


def _prepare(section: Section, panels: int, depth: float, K_min: float) -> _Geometry:
    mesh = build_mesh(section, panels)
    lid_points = max(6, mesh.size // 3)
    t, _ = np.polynomial.legendre.leggauss(lid_points)
    lid = 0.46 * section.half_breadth * (t + 1.0) + 0j
    targets = np.concatenate([mesh.points, lid])
    parts = []
    for mirror in (same, across, above, opposite):
        rule = near_rule(mesh, targets, mirror, levels=20, nodes=10, on=mirror is same)
        parts.append(layers(green.rankine, mesh, targets, mirror, rule))
    rankine = {}
    for even, signs in ((True, (1, 1, -1, -1)), (False, (1, -1, -1, 1))):
        rankine[even] = (sum(s * part[0] for s, part in zip(signs, parts)),
                         sum(s * part[1] for s, part in zip(signs, parts)))
    wave_rules = (near_rule(mesh, targets, above, levels=6, nodes=8),
                  near_rule(mesh, targets, opposite, levels=6, nodes=8))
    term = None if np.isinf(depth) else green.DepthTerm.build(depth, section.draft, 0.5 * section.breadth, K_min)
    return _Geometry(mesh, targets, rankine, wave_rules, term)  # type: ignore[arg-type]


def _layers(geometry: _Geometry, K: FloatArray) -> dict[bool, tuple[ComplexArray, ComplexArray]]:
    """Return single and double layer by parity, (nw, nt, n)."""
    mesh, targets = geometry.mesh, geometry.targets
    totals: dict[bool, list[ComplexArray]] = {even: [part.astype(complex)[None] for part in parts]
                                              for even, parts in geometry.rankine.items()}
    if np.isfinite(K).all():
        def kernel(P: ComplexArray, Q: ComplexArray, n: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
            return green.wave(K[:, None, None], P, Q, n)

        own = layers(kernel, mesh, targets, same, geometry.wave_rules[0])
        other = layers(kernel, mesh, targets, across, geometry.wave_rules[1])
        for even, sign in ((True, 1.0), (False, -1.0)):
            totals[even] = [total + a + sign * b for total, a, b in zip(totals[even], own, other)]
    if geometry.depth is not None:
        minus, plus, weight = (part[:, None, :] for part in geometry.depth.spectrum(K))
        for even in (True, False):
            a, c = geometry.depth.factors(targets, even)
            at_targets = weight * (minus * a + plus * c)
            for i, normal in enumerate((None, mesh.normals)):
                a, c = geometry.depth.factors(mesh.points, even, normal)
                matrix = np.matmul(at_targets, np.swapaxes(minus * a + plus * c, 1, 2))
                totals[even][i] = totals[even][i] + matrix * mesh.weights
    return {even: (total[0], total[1]) for even, total in totals.items()}


def _solve(geometry: _Geometry, system: tuple[ComplexArray, ComplexArray], velocity: ComplexArray) -> ComplexArray:
    """Return the potential on the panels for given normal velocities, (nw, n, right-hand sides).

    pi phi + int phi dG/dn ds = int G phi_n ds on the body; the same without pi phi at the points of the lid. Least
    squares by the normal equations: the matrix is of the second kind and well conditioned.
    """
    single, double = system
    size = geometry.mesh.size
    matrix = double.copy()
    matrix[:, np.arange(size), np.arange(size)] += np.pi
    adjoint = np.conj(np.swapaxes(matrix, 1, 2))
    return np.asarray(np.linalg.solve(adjoint @ matrix, adjoint @ (single @ velocity)), dtype=complex)


def _radiation(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Return the normal velocities of heave (n, 1) and of sway and roll (n, 2)."""
    sway, heave, roll = mesh.modes
    return heave[:, None], np.stack([sway, roll], axis=1)


def _in_order(heave: ComplexArray, lateral: ComplexArray) -> ComplexArray:
    """Join a heave column and sway, roll columns on the last axis as (Sway, Heave, Roll)."""
    return np.concatenate([lateral[..., :1], heave, lateral[..., 1:]], axis=-1)


def _forces(mesh: Mesh, potentials: ComplexArray) -> ComplexArray:
    """Return int phi_j n_i ds over the whole contour, (nw, i, j), modes of the same parity only."""
    weighted = 2.0 * mesh.modes * mesh.weights
    forces = np.matmul(weighted, potentials)
    forces[:, 1, 0::2] = 0.0
    forces[:, 0::2, 1] = 0.0
    return forces


def _infinite_frequency(geometry: _Geometry) -> ComplexArray:
    """Return int phi_j n_i ds with phi = 0 on the free surface, (3, 3)."""
    systems = _layers(geometry, np.array([np.inf]))
    parts = [_solve(geometry, systems[even], velocity.astype(complex))
             for even, velocity in zip((True, False), _radiation(geometry.mesh))]
    return _forces(geometry.mesh, _in_order(*parts))[0]


def _solve_block(geometry: _Geometry, omega: FloatArray, depth: float, g: float) -> tuple[ComplexArray, ...]:
    """Return int phi_j n_i (nw, 3, 3), X/rho (nw, 3), Kochin functions: radiation (nw, 2, 3), scattering (nw, 2)."""
    mesh = geometry.mesh
    K = omega ** 2 / g
    k0 = green.wave_number(K, depth)
    systems = _layers(geometry, K)
    wave = _standing_waves(mesh, k0, depth)
    amplitude = (1j * g / omega)[:, None]
    phase = {True: amplitude, False: -1j * amplitude}  # e^{-i k0 y} = cos - i sin
    potentials, scattered, total, kochin = [], [], [], []
    for even, modes in zip((True, False), _radiation(mesh)):
        value, slope = phase[even] * wave[even][0], phase[even] * wave[even][1]
        velocity = np.concatenate([np.broadcast_to(modes, (omega.size, *modes.shape)), -slope[..., None]], axis=2)
        phi = _solve(geometry, systems[even], velocity)
        field, its_slope = (2.0 * mesh.weights * part for part in wave[even])
        kochin.append(np.einsum("wn,wnr->wr", field, velocity) - np.einsum("wn,wnr->wr", its_slope, phi))
        potentials.append(phi[..., :-1])
        scattered.append(phi[..., -1])
        total.append(phi[..., -1] + value)
    # e^{+-i k0 y} = cos +- i sin
    even_part, odd_part = kochin[0], 1j * kochin[1]
    H = np.stack([_in_order(even_part[:, :-1], sign * odd_part[:, :-1]) for sign in (1, -1)], axis=1)
    H_scattered = np.stack([even_part[:, -1] + sign * odd_part[:, -1] for sign in (1, -1)], axis=1)
    n = 2.0 * mesh.modes * mesh.weights
    X = 1j * omega[:, None] * np.stack([total[1] @ n[0], total[0] @ n[1], total[1] @ n[2]], axis=1)
    return _forces(mesh, _in_order(*potentials)), X, H, H_scattered


def _standing_waves(mesh: Mesh, k0: FloatArray, depth: float) -> dict[bool, list[FloatArray]]:
    """Return Z cos k0 y (even) and Z sin k0 y (odd) on the panels with their normal derivatives, (nw, n) each."""
    k = k0[:, None]
    y, z = mesh.points.real, mesh.points.imag
    ny, nz = mesh.normals.real, mesh.normals.imag
    Z, dZ = green.profile(k, depth, z), green.profile_slope(k, depth, z)
    c, s = np.cos(k * y), np.sin(k * y)
    return {True: [Z * c, dZ * c * nz - k * Z * s * ny], False: [Z * s, dZ * s * nz + k * Z * c * ny]}
