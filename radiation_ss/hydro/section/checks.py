"""Physical relations that a solution must satisfy although its equations do not contain them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.section import green


@dataclass(frozen=True, eq=False)
class SectionChecks:
    """Physical relations that the solution does not use, largest violation over the frequencies.

    Parameters
    ----------
    energy : dict
        By mode: damping from pressures against damping from radiated waves (35), of the largest damping.
    haskind : dict
        By mode: exciting force from diffraction against the one from the radiation problem (Haskind), of the largest.
    damping_from_force : dict
        By mode: B against |X|^2 / (2 rho g c_g), of the largest damping.
    symmetry : float
        Largest |A24 - A42 - i (B24 - B42) / omega|, of A22 times the largest distance of the contour from the origin.
    wave_energy : float
        | |R|^2 + |T|^2 - 1 | of the reflected and transmitted wave.
    """

    energy: dict[str, float]
    haskind: dict[str, float]
    damping_from_force: dict[str, float]
    symmetry: float
    wave_energy: float

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


@dataclass(frozen=True, eq=False)
class FarField:
    """Waves far away from the section.

    Parameters
    ----------
    radiated : ndarray, shape (nw, 2, 3)
        Complex wave amplitude [m per m/s, m per rad/s] towards +y and -y of unit velocity in Sway, Heave and Roll, with
        the phase at y = 0.
    reflection, transmission : ndarray, shape (nw,)
        Complex coefficients of the fixed section.
    group_velocity : ndarray, shape (nw,)
        c_g [m/s].
    kochin : ndarray, shape (nw, 2, 3)
        int (phi_n - phi d/dn) cosh k0(z + h)/cosh k0 h e^{+-i k0 y} ds.
    rho, g : float
    """

    radiated: ComplexArray
    reflection: ComplexArray
    transmission: ComplexArray
    group_velocity: FloatArray
    kochin: ComplexArray
    rho: float
    g: float

    @classmethod
    def build(cls, omega: FloatArray, depth: float, rho: float, g: float, kochin: ComplexArray,
              scattered: ComplexArray) -> FarField:
        """Build it from Kochin functions of the radiation (nw, 2, 3) and scattering (nw, 2) potentials."""
        k0 = green.wave_number(omega ** 2 / g, depth)
        factor = omega * green.far_field_factor(k0, depth) / g
        return cls(factor[:, None, None] * kochin, factor * scattered[:, 1], 1.0 + factor * scattered[:, 0],
                   green.group_velocity(omega, k0, depth), kochin, rho, g)

    @property
    def damping(self) -> FloatArray:
        """Damping from the energy of the radiated waves (35), shape (nw, 3, 3)."""
        products = np.einsum("wsi,wsj->wij", self.radiated, np.conj(self.radiated)).real
        return self.rho * self.g * self.group_velocity[:, None, None] * products

    @property
    def haskind(self) -> ComplexArray:
        """Exciting force of a wave towards +y from the radiation problem by Haskind's relation, shape (nw, 3)."""
        return -self.rho * self.g * self.kochin[:, 1]


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
    worst = np.abs(difference).max(axis=0) / scale
    return {"Sway": float(worst[0]), "Heave": float(worst[1]), "Roll": float(worst[2])}
