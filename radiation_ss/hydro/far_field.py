"""Haskind's relation: the damping of a body follows from the forces of waves from all headings on it.

B_ij = k / (8 pi rho g v_g) int_0^2pi Re(X_i X_j*) dbeta, v_g the group speed (Newman 1977, Marine Hydrodynamics,
chapter 6). It holds for every entry: a wrong unit, sign, column, heading or depth of a file breaks it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.hydro.data import HydroData, body, mode
from radiation_ss.hydro.findings import Finding
from radiation_ss.hydro.measures import damping_scale, named, pair, percent
from radiation_ss.hydro.section.green import group_velocity, wave_number


def haskind(data: HydroData, tolerance: float) -> Iterator[Finding]:
    """Name forces and damping that contradict each other, or that belong to another depth than the one given.

    Nothing is said where the headings do not go round. Entries count relative to sqrt(B_ii B_jj), the median over
    frequency; five times the tolerance is a problem.
    """
    force = over_headings(data)
    scale, silent = damping_scale(data)
    own = np.einsum("wii->wi", data.B) / scale**2
    if force is None or silent.all():
        return
    use = np.isfinite(force).any(axis=(1, 2)) & (own[:, ~silent] > 0.02).any(axis=1)
    if not use.any():
        return
    w, loud = data.omega[use], np.flatnonzero(~silent)
    total = np.einsum("wii,i->w", force[use], scale**-2.0) / np.maximum(own[use].sum(axis=1), 1e-300)

    def ratio(depth: float) -> FloatArray:
        return factor(w, depth, data.g) * total

    def spread(depth: float) -> float:
        return float(np.sqrt(np.mean(np.log(np.maximum(ratio(depth), 1e-6)) ** 2)))

    longest = 2.0 * np.pi / float(wave_number(w[:1] ** 2 / data.g, data.depth)[0])
    best = min(np.geomspace(0.005, 1.0, 200) * longest, key=spread)
    given, found = spread(data.depth), spread(best)
    if given > 5.0 * tolerance and found < min(0.3 * given, 2.0 * tolerance):
        yield Finding("depth", True, given, (), (), f"forces and damping agree in water of {best:.3g} m (within "
                      f"{percent(found)}), not of {data.depth:g} m ({percent(given)}); data.replace(depth=...) sets it")
        return
    size = np.sqrt(np.maximum(own[use], 0.02 * own.max(axis=0)))[:, loud]
    off = force[use] * factor(w, data.depth, data.g)[:, None, None] - data.B[use]
    off = (np.abs(off) / scale[:, None] / scale)[:, loud][:, :, loud] / size[:, :, None] / size[:, None, :]
    off = np.nan_to_num(np.median(off, axis=0))
    if off.max() > 5.0 * tolerance:
        i, j = (int(loud[k]) for k in np.unravel_index(off.argmax(), off.shape))
        yield Finding("Haskind", True, float(off.max()), (), pair(data, i, j), "wave excitation forces and damping "
                      f"contradict each other (Haskind's relation) by {percent(off.max())} of sqrt(B_ii B_jj) in "
                      f"{named(data, i, j)}")


def factor(omega: FloatArray, depth: float, g: float) -> FloatArray:
    """Return the part of the relation that depends on the depth, k / v_g."""
    k = wave_number(omega**2 / g, depth)
    return np.asarray(k / group_velocity(omega, k, depth))


def over_headings(data: HydroData, widest: float = np.pi / 4.0, sure: float = 0.05) -> FloatArray | None:
    """Return int Re(X_i X_j*) dbeta / (8 pi rho g), shape (nw, n, n); NaN where it is not known.

    Headings are enough at a frequency where every second of them gives the same diagonal within `sure`; None where they
    are more than `widest` apart. Half a circle of them is mirrored for one body with port like starboard: sway, roll
    and yaw change sign; their products with the others are not known then.
    """
    if data.X is None or data.directions is None:
        return None
    angle, first = np.unique(np.round(np.mod(data.directions, 2.0 * np.pi), 6), return_index=True)
    X, unknown = data.X[:, first], np.zeros((data.n, data.n), dtype=bool)
    if angle[-1] < np.pi + 1e-3:
        odd = np.array([-1.0 if mode(dof) in ("Sway", "Roll", "Yaw") else 1.0 for dof in data.dofs])
        scale, _ = damping_scale(data)
        unknown = odd[:, None] * odd < 0.0
        if len({body(dof) for dof in data.dofs}) > 1 or np.abs(data.B / scale[:, None] / scale)[:, unknown].max(
                initial=0.0) > 2.0 * sure:
            return None
        inner = (angle > 1e-3) & (angle < np.pi - 1e-3)
        angle = np.concatenate([angle, 2.0 * np.pi - angle[inner][::-1]])
        X = np.concatenate([X, (odd * X[:, inner])[:, ::-1]], axis=1)
    if angle.size % 2 or np.diff(np.append(angle, angle[0] + 2.0 * np.pi)).max() > widest + 1e-6:
        return None

    def integral(every: int) -> FloatArray:
        some, forces = angle[::every], X[:, ::every]
        step = np.diff(np.append(some, some[0] + 2.0 * np.pi))
        weight = (step + np.roll(step, 1)) / (16.0 * np.pi * data.rho * data.g)
        return np.asarray(np.einsum("b,wbi,wbj->wij", weight, forces, forces.conj()).real)

    found, rough = integral(1), integral(2)
    own = np.einsum("wii->wi", found)
    known = (np.abs(np.einsum("wii->wi", rough) - own) <= sure * own).all(axis=1)
    return np.where(known[:, None, None] & ~unknown, found, np.nan)
