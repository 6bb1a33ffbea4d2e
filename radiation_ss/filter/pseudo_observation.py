"""Known frequency points as observations of the parameters (25)-(27)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.filter.subsystems import Subsystems
from radiation_ss.plant.model import Model

Points = Mapping[float, object] | Sequence[float]


def known_points(model: Model, points: Points | None) -> tuple[FloatArray, ComplexArray]:
    """Return (omega, K) of the known points, shapes (nc,) and (nc, n, n).

    Parameters
    ----------
    model : Model
        Its hydrodynamic data give K where only frequencies are listed.
    points : mapping of float to complex array, or sequence of float
        Frequencies [rad/s], each with K(iw) = B + i w (A - A_inf), or frequencies alone.

    Raises
    ------
    InputError
        If K is not given and the model has no data, or a frequency lies outside the data.
    """
    if points is None or len(points) == 0:
        return np.zeros(0), np.zeros((0, model.n, model.n), dtype=complex)
    omega = np.array(sorted(float(w) for w in points))
    if isinstance(points, Mapping):
        known = {float(w): np.reshape(np.asarray(K, dtype=complex), (model.n, model.n)) for w, K in points.items()}
        return omega, np.stack([known[w] for w in omega])
    if model.hydro is None:
        raise InputError("points: the model has no hydrodynamic data; give {omega: K} instead of frequencies")
    data = model.hydro.select(model.dofs)
    if omega[0] < data.omega[0] or omega[-1] > data.omega[-1]:
        raise InputError(f"points: the data cover {data.omega[0]:g} to {data.omega[-1]:g} rad/s, asked for "
                         f"{omega[0]:g} to {omega[-1]:g} rad/s")
    flat = data.K.reshape(data.omega.size, -1)
    K = np.stack([np.interp(omega, data.omega, column.real) + 1j * np.interp(omega, data.omega, column.imag)
                  for column in flat.T], axis=-1)
    return omega, K.reshape(omega.size, model.n, model.n)


def rows(parts: Subsystems, omega: FloatArray, K: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (H, y, scale) of the linear conditions H theta = y, real and imaginary parts (26), (27).

    K(i w) P(i w) - Q(i w) = 0 with P = s^n + sum a_l s^(l-1), Q = sum b_l s^(l-1). `scale` is |K P| at the start
    values: a relative error of K, times it, is the error of the row.
    """
    H, y, scale = [], [], []
    for w, matrix in zip(omega, K):
        for (j, k), offset, order in zip(parts.entries, parts.offsets, parts.orders):
            powers = (1j * w) ** np.arange(order)
            row = np.zeros(parts.theta.size, dtype=complex)
            row[offset:offset + order] = matrix[j, k] * powers
            row[offset + order:offset + 2 * order] = -powers
            right = -matrix[j, k] * (1j * w) ** order
            P = parts.theta[offset:offset + order] @ powers + (1j * w) ** order
            H += [row.real, row.imag]
            y += [right.real, right.imag]
            scale += 2 * [max(abs(matrix[j, k] * P), 1e-300)]
    return np.reshape(H, (-1, parts.theta.size)), np.array(y), np.array(scale)
