"""Known frequency points as observations of the parameters (25)-(27)."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.inference.subsystems import Subsystems


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
