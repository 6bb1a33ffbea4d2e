"""Defaults of the dual filter that follow from the model, and the check of its choices."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.points import Points, point_values

PAPER_INERTIA, PAPER_STIFFNESS = 3.74, 2.0  # (m + a(inf))' and c' of the paper's tank by (A.4)-(A.6)


def points_or_none(model: Model, points: Points | None) -> tuple[FloatArray, ComplexArray]:
    """Return (omega, K) of the known points, empty where there are none."""
    if points is None or len(points) == 0:
        return np.zeros(0), np.zeros((0, model.n, model.n), dtype=complex)
    return point_values(model, points)


def frequencies_of(model: Model) -> FloatArray:
    """Return the frequencies of the model's data, or 60 from a fifth to five times its natural frequencies."""
    if model.hydro is not None:
        return model.hydro.omega
    natural = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(model.M + model.A_inf, model.C))))
    return np.geomspace(0.2 * natural.min(), 5.0 * natural.max(), 60)


def paper_units(model: Model) -> tuple[float, float]:
    """Return the mass and time units in which the body has the size that the paper's tank has by (A.4)-(A.6)."""
    natural = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(model.M + model.A_inf, model.C))).max())
    inertia = float(model.M[0, 0] + model.A_inf[0, 0])
    return inertia / PAPER_INERTIA, float(np.sqrt(PAPER_STIFFNESS / PAPER_INERTIA) / natural)


def choice(name: str, value: object, allowed: tuple[object, ...]) -> None:
    """Refuse a setting that is not one of those allowed."""
    if value not in allowed:
        raise InputError(f"{name}: {value!r} is unknown; use one of {', '.join(repr(v) for v in allowed)}")
