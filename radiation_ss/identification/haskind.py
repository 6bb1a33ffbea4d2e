"""Haskind's relation: how the damping B fixes the size of the exciting force X."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.inference.points import interpolate
from radiation_ss.waves.dispersion import group_speed


@dataclass(frozen=True, eq=False)
class Haskind:
    """|X_j(w)|^2 = ratio_j(w) B_jj(w), with the phase of X taken as known.

    Parameters
    ----------
    omega : ndarray, shape (nw,)
    ratio : ndarray, shape (nw, n)
        Of a section between two infinite water surfaces, both sides alike: 2 rho g c_g times the length.
    phase : ndarray, shape (nw, n)
        X / |X|.
    source : str
        Where the ratio is from.
    """

    omega: FloatArray
    ratio: FloatArray
    phase: ComplexArray
    source: str

    def exciting_force(self, B: FloatArray) -> ComplexArray:
        """Return X for the dampings B_jj, shape (..., nw, n); dampings at or below zero give almost none."""
        size = np.sqrt(self.ratio * positive(B, 1e-3 * np.abs(B).max(axis=-2, keepdims=True)))
        return np.asarray(self.phase * size)


def positive(values: FloatArray, floor: FloatArray) -> FloatArray:
    """Return values above `floor` as they are, below it a smooth positive continuation."""
    below = np.minimum(values / floor - 1.0, 0.0)
    return np.where(values > floor, values, floor * np.exp(below))


def relation(model: Model, omega: FloatArray, floor: float = 1e-4) -> tuple[Haskind, tuple[str, ...]]:
    """Return Haskind's relation at omega [rad/s], with warnings.

    Where the model carries X, the ratio is the file's own |X|^2 / B (first direction), so that it holds for a section
    and for a body in three dimensions alike. Else the two-dimensional relation per metre of length is used: then the
    wave height is only known up to the root of the length. Damping below `floor` of the largest tells no ratio.
    """
    n = model.n
    table = model.hydro
    rho, g, depth = (table.rho, table.g, table.depth) if table is not None else (1000.0, 9.81, np.inf)
    plane = 2.0 * rho * g * group_speed(omega, depth, g)
    if table is None or table.X is None:
        water = "" if table is not None else " in deep water"
        warning = (f"the model has no exciting force X: Haskind's two-dimensional relation{water} is used for a length "
                   "of 1 m, so the wave heights are in units of the square root of the length")
        ratio = np.repeat(plane[:, None], n, axis=1)
        return Haskind(omega, ratio, np.ones((omega.size, n), complex), "2-D"), (warning,)
    ratio, phase = np.empty((omega.size, n)), np.empty((omega.size, n), complex)
    sources = []
    for j in range(n):
        B, X = table.B[:, j, j], table.X[:, 0, j]
        good = (B > floor * np.abs(B).max()) & (np.abs(X) > 0.0)
        if good.sum() < 3:
            ratio[:, j], phase[:, j] = 1e-300, 1.0
            sources.append(f"{model.dofs[j]}: no exciting force")
            continue
        own = np.abs(X[good]) ** 2 / B[good]
        section = own / (2.0 * rho * g * group_speed(table.omega[good], depth, g))
        inside = np.clip(omega, table.omega[good][0], table.omega[good][-1])
        turn = interpolate(table.omega[good], X[good] / np.abs(X[good]), inside)
        phase[:, j] = turn / np.maximum(np.abs(turn), 1e-12)
        if np.std(section) < 0.05 * np.mean(section):
            ratio[:, j] = plane * float(np.median(section))
            sources.append(f"{model.dofs[j]}: section of length {np.median(section):.4g} m")
        else:
            ratio[:, j] = np.exp(interpolate(table.omega[good], np.log(own), inside).real)
            sources.append(f"{model.dofs[j]}: |X|^2 / B of the model")
    return Haskind(omega, ratio, phase, "; ".join(sources)), ()
