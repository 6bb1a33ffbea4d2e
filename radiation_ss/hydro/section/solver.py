"""Radiation and diffraction by a section, deep water or finite depth, all frequencies of a block at once."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, check_height, positive, read_only
from radiation_ss.errors import InputError, SolverError
from radiation_ss.hydro.clean import rigid_inertia
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.linear_waves import depth_ratio, group_velocity, wave_number
from radiation_ss.hydro.section.equations import Flow, infinite_frequency, prepare, solve_flow
from radiation_ss.hydro.section.panels import build_mesh
from radiation_ss.hydro.section.shapes import Section, SectionLike, as_section

DOFS = ("Sway", "Heave", "Roll")
BLOCK = 25  # frequencies solved together, fewer where the matrices are large


@dataclass(frozen=True, eq=False)
class SectionSolution:
    """All that `solve_section` finds."""

    hydro: HydroData  # Coefficients per unit length; `.hydro.times(length)` for a body
    checks: "SectionChecks"
    section: Section
    far_field: "FarField"  # Radiated and scattered waves


def section_2d(section: SectionLike, omega: ArrayLike, depth: float = np.inf, **options: Any) -> HydroData:
    """Return added mass, damping and exciting force per unit length in Sway, Heave and Roll.

    Parameters
    ----------
    section : Section, array_like (n, 2), or path
        A shape (`lewis_section` makes one), offsets (y, z) [m], or a file of offsets.
    omega : array_like, shape (nw,)
        Circular frequencies [rad/s], positive, ascending.
    depth : float
        Water depth [m]; inf for deep water.
    **options
        panels : int
            Unknowns on the whole contour, 60 if absent; taken up to whole elements of 5 on each half.
        rho, g : float
            Water density [kg/m^3] and gravity [m/s^2].
        centre_of_gravity : float
            Height z [m], z up from the still water surface; enters C44 and M.
        gyradius : float
            Roll radius of gyration about the centre of gravity [m]; M is given only with it (mass = displacement).

    Returns
    -------
    HydroData
        Per unit length about the point (0, 0, 0): Sway along y, Heave up, Roll by the right-hand rule about x, with
        A_inf, C and X for a wave running towards +y (direction pi/2). `.notes` has the physical checks.

    Raises
    ------
    InputError
        If the section, depth, frequencies or another argument make no sense.
    SolverError
        If the result misses energy, Haskind's relation or symmetry by more than 2 %.

    Examples
    --------
    A half-immersed circle of 1 m radius: the stiffness is rho g times the breadth.

    >>> import radiation_ss as rss
    >>> data = rss.section_2d(rss.lewis_section(1.0, 1.0, 0.7853982), [0.5, 1.0, 2.0])
    >>> round(float(data.C[1, 1] / (1000.0 * 9.81 * 2.0)), 4)
    1.0
    """
    return solve_section(section, omega, depth, **options).hydro


def solve_section(section: SectionLike, omega: ArrayLike, depth: float = np.inf, *, panels: int = 60,
                  rho: float = 1000.0, g: float = 9.81, centre_of_gravity: float = 0.0,
                  gyradius: float | None = None) -> SectionSolution:
    """Solve the linear radiation and diffraction problems of a symmetric section.

    Boundary-integral equation for the potential with the free-surface source, curved panels of high order; points on
    the water surface inside the body are added as equations, which removes the irregular frequencies. Parameters,
    units and errors are those of `section_2d`, whose result is `.hydro`.
    """
    shape = as_section(section)
    rho, g = positive(rho, "rho", "kg/m^3"), positive(g, "g", "m/s^2")
    depth = _depth(shape, depth)
    if not 10 <= panels <= 2000:
        raise InputError(f"panels: between 10 and 2000 needed, found {panels}")
    w = _frequencies(omega, shape, g)
    C, M = _hydrostatics(shape, rho, g, centre_of_gravity, gyradius)
    K_range = w[[0, -1]] ** 2 / g
    mesh = build_mesh(shape, panels, float(K_range[1]))
    equations = prepare(shape, mesh, depth, K_range)
    block = max(1, min(BLOCK, 1_000_000 // mesh.size ** 2))
    starts = range(0, w.size, block)
    flow = Flow(*map(np.concatenate, zip(*(solve_flow(equations, w[i:i + block], g) for i in _tracked(starts)))))
    A, B = -rho * flow.forces.real, rho * w[:, None, None] * flow.forces.imag  # p = -i w rho phi
    X = rho * flow.exciting
    field = FarField.build(w, depth, rho, g, flow.kochin, flow.kochin_scattered)
    checks = check(w, A, B, X, field, lever=float(np.abs(mesh.points).max()))
    if checks.failed:
        raise SolverError(f"{shape.name}: {2 * mesh.size} panels do not resolve it up to {w[-1]:g} rad/s: "
                          f"{checks}; use more panels or look at the contour")
    hydro = HydroData(
        omega=w, A=_symmetric(A), B=_symmetric(B), dofs=DOFS, rho=rho, g=g, depth=depth,
        A_inf=-rho * _symmetric(infinite_frequency(equations)), M=M, C=C, X=X[:, None, :],
        directions=np.array([0.5 * np.pi]), source=f"section_2d: {shape.name}",
        notes=(f"2-D panel method, {2 * mesh.size} panels; {checks}",))
    return SectionSolution(hydro, checks, shape, field)


def _tracked(items: Sequence[int]) -> Iterable[int]:
    """Return the blocks, with a progress bar if there are many and somebody is watching."""
    if len(items) < 8 or not sys.stderr.isatty():
        return items
    from rich.console import Console
    from rich.progress import track

    return track(items, description="section", console=Console(stderr=True))


def _symmetric(matrix: FloatArray) -> FloatArray:
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def _frequencies(omega: ArrayLike, section: Section, g: float) -> FloatArray:
    w = read_only(np.atleast_1d(omega), "omega [rad/s]", (None,), finite=False)
    if w.size == 0 or not np.isfinite(w).all() or w.min() <= 0.0 or np.any(np.diff(w) <= 0.0):
        raise InputError("omega: must be finite, positive and ascending frequencies in rad/s")
    if w[0] < 1e-6 * np.sqrt(g / section.draft):
        raise InputError(f"omega: {w[0]:g} rad/s is below 1e-6 sqrt(g / draft), where A is lost beside B / omega")
    return w


def _depth(section: Section, depth: float) -> float:
    depth = positive(depth, "depth", "m", or_infinite=True)
    if 1e9 * section.draft < depth < np.inf:
        raise InputError(f"depth: {depth:g} m is deep water for this section; use inf")
    if section.draft >= depth:
        raise InputError(f"depth: {depth:g} m is not more than the draft {section.draft:g} m of {section.name}")
    return depth


def _hydrostatics(section: Section, rho: float, g: float, z_G: float,
                  gyradius: float | None) -> tuple[FloatArray, FloatArray | None]:
    """Return C and M about (0, 0, 0) per unit length of a freely floating section of mass rho S."""
    check_height(z_G, "centre_of_gravity")
    S, b = section.area, section.half_breadth
    C = np.diag([0.0, 2.0 * b, 2.0 / 3.0 * b ** 3 + S * (section.centre_of_buoyancy - z_G)]) * rho * g
    if gyradius is None:
        return C, None
    square = np.diag([positive(gyradius, "gyradius", "m") ** 2, 0.0, 0.0])
    return C, rho * S * rigid_inertia(1.0, square, np.array([0.0, 0.0, z_G]))[1:4, 1:4]


@dataclass(frozen=True, eq=False)
class FarField:
    """Waves far away from the section."""

    # (nw, 2, 3): Complex wave amplitude [m per m/s, m per rad/s] towards +y and -y of unit velocity in Sway, Heave and
    # Roll, with the phase at y = 0
    radiated: ComplexArray
    # reflection, transmission (nw,): Complex coefficients of the fixed section
    reflection: ComplexArray
    transmission: ComplexArray
    group_velocity: FloatArray  # (nw,): c_g [m/s]
    kochin: ComplexArray  # (nw, 2, 3): int (phi_n - phi d/dn) cosh k0(z + h)/cosh k0 h e^{+-i k0 y} ds
    rho: float
    g: float

    @classmethod
    def build(cls, omega: FloatArray, depth: float, rho: float, g: float, kochin: ComplexArray,
              scattered: ComplexArray) -> "FarField":
        """Build it from Kochin functions of the radiation (nw, 2, 3) and scattering (nw, 2) potentials."""
        k0 = wave_number(omega ** 2 / g, depth)
        # Far away G -> 2 pi i Z(z_P) Z(z_Q) e^{-i k0 |X|} g / omega times this factor, Z = `profile`.
        factor = omega / (g * np.tanh(k0 * depth) * (1.0 + depth_ratio(k0, depth)))
        return cls(factor[:, None, None] * kochin, factor * scattered[:, 1], 1.0 + factor * scattered[:, 0],
                   group_velocity(omega, k0, depth), kochin, rho, g)

    @property
    def damping(self) -> FloatArray:
        """Damping from the energy of the radiated waves (35), shape (nw, 3, 3)."""
        products = np.einsum("wsi,wsj->wij", self.radiated, np.conj(self.radiated)).real
        return self.rho * self.g * self.group_velocity[:, None, None] * products

    @property
    def haskind(self) -> ComplexArray:
        """Exciting force of a wave towards +y from the radiation problem by Haskind's relation, shape (nw, 3)."""
        return -self.rho * self.g * self.kochin[:, 1]


@dataclass(frozen=True, eq=False)
class SectionChecks:
    """Physical relations that the solution does not use, largest violation over the frequencies."""

    # By mode: damping from pressures against damping from radiated waves (35), of the largest damping
    energy: dict[str, float]
    # By mode: exciting force from diffraction against the one from the radiation problem (Haskind), of the largest
    haskind: dict[str, float]
    damping_from_force: dict[str, float]  # By mode: B against |X|^2 / (2 rho g c_g), of the largest damping
    # Largest |A24 - A42 - i (B24 - B42) / omega|, of A22 times the largest distance of the contour from the origin
    symmetry: float
    wave_energy: float  # Distance of |R|^2 + |T|^2, the reflected and the transmitted wave, from 1

    @property
    def failed(self) -> bool:
        """True if energy, Haskind's relation or symmetry is missed by more than 2 %: the solution is not one."""
        return max(*self.energy.values(), *self.haskind.values(), self.symmetry) > 0.02

    def __str__(self) -> str:
        return (f"energy relation within {max(self.energy.values()):.1e}, Haskind's within "
                f"{max(self.haskind.values()):.1e}, symmetry within {self.symmetry:.1e}")

    @property
    def worst(self) -> float:
        """Largest violation of all."""
        return max(*self.energy.values(), *self.haskind.values(), *self.damping_from_force.values(), self.symmetry,
                   self.wave_energy)


def check(omega: FloatArray, A: FloatArray, B: FloatArray, X: ComplexArray, field: FarField, *,
          lever: float) -> SectionChecks:
    """Compare pressures on the body with waves far away, and the two off-diagonal terms.

    Violations are relative to the largest value over the frequencies, but not to less than what a damping of 0.1 % of
    omega A amounts to; `lever` [m], the largest distance of the contour from the origin, does this for roll (a circle).
    """
    damping = np.diagonal(B, axis1=1, axis2=2)
    wave_power = 2.0 * field.rho * field.g * field.group_velocity[:, None]  # B = |X|^2 / (2 rho g c_g)
    inertia = omega[:, None] * np.abs(np.diagonal(A, axis1=1, axis2=2))
    inertia[:, 2] = np.maximum(inertia[:, 2], lever ** 2 * inertia[:, 0])
    least = 1e-3 * inertia
    scale = np.maximum(np.abs(damping), least).max(axis=0)
    force_scale = np.maximum(np.abs(X), np.sqrt(wave_power * least)).max(axis=0)
    unequal = np.abs(A[:, 0, 2] - A[:, 2, 0] - 1j * (B[:, 0, 2] - B[:, 2, 0]) / omega)
    balance = np.abs(np.abs(field.reflection) ** 2 + np.abs(field.transmission) ** 2 - 1.0)
    return SectionChecks(
        energy=_by_mode(damping - np.diagonal(field.damping, axis1=1, axis2=2), scale),
        haskind=_by_mode(X - field.haskind, force_scale),
        damping_from_force=_by_mode(damping - np.abs(X) ** 2 / wave_power, scale),
        symmetry=float(unequal.max() / (lever * np.abs(A[:, 0, 0]).max())),
        wave_energy=float(balance.max()))


def _by_mode(difference: np.ndarray, scale: FloatArray) -> dict[str, float]:
    return dict(zip(DOFS, (np.abs(difference).max(axis=0) / scale).tolist()))
