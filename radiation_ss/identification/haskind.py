"""Haskind's relation: how the damping B fixes the size of the exciting force X."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.inference.points import interpolate
from radiation_ss.waves.dispersion import group_speed


@dataclass(frozen=True, eq=False)
class Haskind:
    """|X_j(w)|^2 goes with B_jj(w) from the model's own values; the phase of X is taken as known."""

    X: ComplexArray  # (nw, n): The model's exciting force per metre wave amplitude
    damping: FloatArray  # (nw, n): The model's B_jj
    source: str  # Where X is from
    # Share of the largest damping below which X does not follow it: where a force changes sign, B_jj is next to nothing
    # and its relative change means nothing
    floor: float = 0.01

    def part(self, dofs: Sequence[int]) -> Haskind:
        """Return the relation of some degrees of freedom."""
        return replace(self, X=self.X[:, dofs], damping=self.damping[:, dofs])

    def exciting_force(self, B: FloatArray) -> ComplexArray:
        """Return X for the dampings B_jj, shape (..., nw, n); dampings at or below zero give almost none."""
        least = self.floor * np.abs(self.damping).max(axis=0)
        return np.asarray(self.X * np.sqrt(positive(B, least) / positive(self.damping, least)))


def positive(values: FloatArray, floor: FloatArray) -> FloatArray:
    """Return values above `floor` as they are, below it a smooth positive continuation."""
    below = np.minimum(values / floor - 1.0, 0.0)
    return np.where(values > floor, values, floor * np.exp(below))


def relation(model: Model, omega: FloatArray) -> tuple[Haskind, tuple[str, ...]]:
    """Return Haskind's relation at omega [rad/s], with warnings.

    Where the model carries X (first direction) it is the model's own, so that it holds for a section and for a body in
    three dimensions alike. Else the relation of a section between two infinite water surfaces is used, |X|^2 =
    2 rho g c_g B per metre of length: then the wave height is only known up to the root of the length.
    """
    table = model.hydro
    rho, g, depth = (table.rho, table.g, table.depth) if table is not None else (1000.0, 9.81, np.inf)
    damping = np.einsum("wjj->wj", model.fit.frequency_response(omega).real)
    if table is None or table.X is None:
        water = "" if table is not None else " in deep water"
        warning = (f"the model has no exciting force X: Haskind's two-dimensional relation{water} is used for a length "
                   "of 1 m, so the wave heights are in units of the square root of the length")
        size = positive(damping, 1e-4 * np.abs(damping).max(axis=0)) * group_speed(omega, depth, g)[:, None]
        return Haskind(np.sqrt(2.0 * rho * g * size).astype(complex), damping, "2-D"), (warning,)
    inside = np.clip(omega, table.omega[0], table.omega[-1])
    return Haskind(interpolate(table.omega, table.X[:, 0, :], inside), damping, "X of the model"), ()
