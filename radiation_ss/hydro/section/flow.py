"""Radiation and diffraction potentials of a block of frequencies, and the integrals of them that are wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.section import green
from radiation_ss.hydro.section.equations import Equations, layers_by_parity, solve
from radiation_ss.hydro.section.panels import Mesh


@dataclass(frozen=True, eq=False)
class Flow:
    """Integrals over the whole contour, for unit density; modes in the order Sway, Heave, Roll.

    Parameters
    ----------
    forces : ndarray, shape (nw, 3, 3)
        int phi_j n_i ds of unit velocity in mode j.
    exciting : ndarray, shape (nw, 3)
        i omega int (phi_incident + phi_scattered) n_i ds for a wave of unit amplitude towards +y.
    kochin : ndarray, shape (nw, 2, 3)
        int (phi_n - phi d/dn) Z e^{+-i k0 y} ds of the radiation potentials, Z = cosh k0(z + h) / cosh k0 h.
    kochin_scattered : ndarray, shape (nw, 2)
        The same of the scattered potential.
    """

    forces: ComplexArray
    exciting: ComplexArray
    kochin: ComplexArray
    kochin_scattered: ComplexArray

    @classmethod
    def join(cls, blocks: Sequence[Flow]) -> Flow:
        """Return the blocks one after the other."""
        return cls(*(np.concatenate([getattr(block, field.name) for block in blocks]) for field in fields(cls)))


def solve_flow(equations: Equations, omega: FloatArray, g: float) -> Flow:
    """Solve radiation and diffraction for a block of frequencies.

    Even motion (heave, the cosine part of the wave) and odd motion (sway, roll, the sine part) are apart.
    """
    mesh = equations.mesh
    K = omega ** 2 / g
    systems = layers_by_parity(equations, K)
    waves = _standing_waves(mesh, green.wave_number(K, equations.depth), equations.depth)
    amplitude = (1j * g / omega)[:, None]
    phase = {True: amplitude, False: -1j * amplitude}  # e^{-i k0 y} = cos - i sin
    radiated, total, kochin = {}, {}, {}
    for even, modes in _parities(mesh):
        value, slope = waves[even]
        velocity = np.concatenate([np.broadcast_to(modes, (omega.size, *modes.shape)),
                                   (-phase[even] * slope)[..., None]], axis=2)
        phi = solve(systems[even], velocity)
        kochin[even] = 2.0 * (np.einsum("wn,wnr->wr", mesh.weights * value, velocity)
                              - np.einsum("wn,wnr->wr", mesh.weights * slope, phi))
        radiated[even], total[even] = phi[..., :-1], phi[..., -1] + phase[even] * value
    both = [(kochin[True], sign * 1j * kochin[False]) for sign in (1.0, -1.0)]  # e^{+-i k0 y} = cos +- i sin
    n = 2.0 * mesh.modes * mesh.weights
    exciting = np.stack([total[False] @ n[0], total[True] @ n[1], total[False] @ n[2]], axis=1)
    return Flow(_forces(mesh, radiated), 1j * omega[:, None] * exciting,
                np.stack([_in_order(a[:, :-1], b[:, :-1]) for a, b in both], axis=1),
                np.stack([a[:, -1] + b[:, -1] for a, b in both], axis=1))


def infinite_frequency(equations: Equations) -> FloatArray:
    """Return int phi_j n_i ds with phi = 0 on the water surface, (3, 3)."""
    systems = layers_by_parity(equations, np.array([np.inf]))
    radiated = {even: solve(systems[even], modes.astype(complex)) for even, modes in _parities(equations.mesh)}
    return _forces(equations.mesh, radiated)[0].real


def _parities(mesh: Mesh) -> list[tuple[bool, FloatArray]]:
    """Return (even?, normal velocities): heave (n, 1); sway and roll (n, 2)."""
    sway, heave, roll = mesh.modes
    return [(True, heave[:, None]), (False, np.stack([sway, roll], axis=1))]


def _in_order(heave: ComplexArray, lateral: ComplexArray) -> ComplexArray:
    """Join heave and (sway, roll) on the last axis as (Sway, Heave, Roll)."""
    return np.concatenate([lateral[..., :1], heave, lateral[..., 1:]], axis=-1)


def _forces(mesh: Mesh, radiated: dict[bool, ComplexArray]) -> ComplexArray:
    """Return int phi_j n_i ds over the whole contour, (nw, i, j); even and odd motions do not meet."""
    forces = np.matmul(2.0 * mesh.modes * mesh.weights, _in_order(radiated[True], radiated[False]))
    forces[:, 1, 0::2] = 0.0
    forces[:, 0::2, 1] = 0.0
    return forces


def _standing_waves(mesh: Mesh, k0: FloatArray, depth: float) -> dict[bool, tuple[FloatArray, FloatArray]]:
    """Return Z cos k0 y (even) and Z sin k0 y (odd) on the panels with their normal derivatives, (nw, n) each."""
    k = k0[:, None]
    y, z = mesh.points.real, mesh.points.imag
    ny, nz = mesh.normals.real, mesh.normals.imag
    Z, dZ = green.profile(k, depth, z), green.profile_slope(k, depth, z)
    c, s = np.cos(k * y), np.sin(k * y)
    return {True: (Z * c, dZ * c * nz - k * Z * s * ny), False: (Z * s, dZ * s * nz + k * Z * c * ny)}
