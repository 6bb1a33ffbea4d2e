"""The fitting problem of one block of degrees of freedom, scaled to numbers of order one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData

COUPLED, STRONG = 5e-3, 0.2
"""A coupling matters where max_w |K_ij| exceeds this part of the geometric mean of the diagonal's maxima,"""
RECIPROCAL = 2.0
"""and, unless strong, what K_ij and K_ji share is so many times what they differ by: noise is not reciprocal."""
RESOLVED = 0.5
"""Smallest damping rate of a resonance, relative to the spacing of the frequencies: narrower ones would be invented."""
CROSS = np.sqrt(2.0)
"""Weight of an entry above the diagonal: it stands for two."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Samples of a symmetric K(iw) of m degrees of freedom, scaled: s = rate x, K = scale_i scale_j K'.

    Parameters
    ----------
    dofs : tuple of str
    x : ndarray, shape (nw,)
        Frequencies over `rate`.
    K : ndarray, shape (nw, p)
        Upper triangle of the scaled samples, p = m (m + 1) / 2, row by row.
    weight : ndarray, shape (nw, p)
        Weight of each residual; `CROSS` of entries off the diagonal included.
    rate : float
        Geometric mean of the band [rad/s].
    scale : ndarray, shape (m,)
    x_points, K_points : ndarray, shapes (q,), (q, p)
        Where K is to be met exactly, x = 0 among them if a value of K(0) was asked.
    zero : bool
        K(0) = 0.
    narrowest : float
        Smallest damping rate (-Re of a pole) that the spacing of the frequencies can resolve, over `rate`.
    """

    dofs: tuple[str, ...]
    x: FloatArray
    K: ComplexArray
    weight: FloatArray
    rate: float
    scale: FloatArray
    x_points: FloatArray
    K_points: ComplexArray
    zero: bool
    narrowest: float = 0.0

    @property
    def m(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    @property
    def norm(self) -> float:
        """Weighted norm of the samples."""
        return float(np.linalg.norm(self.weight * self.K))


def symmetric(data: HydroData) -> ComplexArray:
    """Return K(iw) with K_ij and K_ji averaged, shape (nw, n, n): radiation is reciprocal."""
    K = data.K
    return 0.5 * (K + np.swapaxes(K, 1, 2))


def blocks_of(data: HydroData) -> list[list[int]]:
    """Return the groups of coupled degrees of freedom as ascending positions; one without K is in none."""
    K = data.K
    size = np.abs(symmetric(data)).max(axis=0)
    own = np.sqrt(np.diag(size))
    mean, half = (np.linalg.norm(K + sign * np.swapaxes(K, 1, 2), axis=0) for sign in (1.0, -1.0))
    pairs = np.outer(own, own)
    linked = (size > COUPLED * pairs) & (pairs > 0.0) & ((mean > RECIPROCAL * half) | (size > STRONG * pairs))
    free, groups = [i for i in range(data.n) if own[i] > 0.0], []
    while free:
        group, border = {free[0]}, [free[0]]
        while border:
            found = set(np.flatnonzero(linked[border.pop()]).tolist()) - group
            group |= found
            border += sorted(found)
        groups.append(sorted(group))
        free = [i for i in free if i not in group]
    return groups


def block_problem(data: HydroData, block: list[int], *, at_zero: str | float | ArrayLike = "free",
                  points: FloatArray | None = None, weight: FloatArray | None = None) -> Problem:
    """Return the scaled problem of one block.

    Parameters
    ----------
    data : HydroData
    block : list of int
        Positions of its degrees of freedom.
    at_zero : "free", "zero" or array_like
        K(0); a value in SI for each entry.
    points : ndarray, shape (q,), optional
        Frequencies [rad/s] where K, interpolated between the data, is to be met exactly.
    weight : ndarray, shape (nw,) or (nw, n, n), optional

    Raises
    ------
    InputError
        If a value of K(0) is not positive semidefinite.
    """
    square = np.ix_(block, block)
    upper = np.triu_indices(len(block))
    samples = symmetric(data)[:, square[0], square[1]]
    size = np.abs(np.einsum("wii->wi", samples)).max(axis=0)
    scale = np.sqrt(size)
    rate = 0.5 * float(data.omega[-1])
    pairs = np.outer(scale, scale)[upper]
    K = samples[:, upper[0], upper[1]] / pairs
    weights = np.ones(K.shape) if weight is None else _weights(weight, block, upper, K.shape)
    weights = weights * np.where(upper[0] == upper[1], 1.0, CROSS)
    thin = np.arange(0, data.omega.size, -(-data.omega.size // max(60, 200 // len(block))))
    x_points = np.zeros(0) if points is None else np.asarray(points) / rate
    K_points = np.array([[np.interp(x, data.omega / rate, K[:, p]) for p in range(K.shape[1])] for x in x_points],
                        dtype=complex).reshape(x_points.size, K.shape[1])
    if not isinstance(at_zero, str):
        value = _value_at_zero(at_zero, data, block)
        x_points = np.r_[0.0, x_points]
        K_points = np.vstack([(value[upper] / pairs)[None, :], K_points])
    return Problem(tuple(data.dofs[i] for i in block),
                   data.omega[thin] / rate, K[thin], weights[thin], rate, scale, x_points, K_points,
                   isinstance(at_zero, str) and at_zero == "zero",
                   RESOLVED * _spacing(data.omega, samples / size) / rate)


def _spacing(omega: FloatArray, samples: ComplexArray) -> float:
    """Return the mean spacing of the frequencies [rad/s], weighted by |K|^2: how finely the curve is sampled."""
    power = np.sum(np.abs(samples) ** 2, axis=(1, 2))
    return float(np.sum(np.gradient(omega) * power) / np.sum(power))


def _weights(weight: FloatArray, block: list[int], upper: tuple, shape: tuple[int, ...]) -> FloatArray:
    """Return the square roots of the weights of the upper triangle."""
    root = np.sqrt(weight)
    if root.ndim == 1:
        return np.broadcast_to(root[:, None], shape)
    return np.asarray(root[:, block][:, :, block][:, upper[0], upper[1]])


def _value_at_zero(value: float | ArrayLike, data: HydroData, block: list[int]) -> FloatArray:
    """Return the value asked for K(0) of a block, checked."""
    matrix = np.asarray(value, dtype=float)
    if matrix.ndim == 0 and data.n == 1:
        matrix = matrix.reshape(1, 1)
    if matrix.shape != (data.n, data.n):
        raise InputError(f"at_zero: shape {matrix.shape} found; a number for one degree of freedom, "
                         f"else ({data.n}, {data.n}) [N s/m and so on]")
    part = matrix[np.ix_(block, block)]
    if np.linalg.eigvalsh(0.5 * (part + part.T))[0] < 0.0:
        raise InputError("at_zero: K(0) must be positive semidefinite, or no passive model can meet it")
    return part
