"""Steps of a fit: the linearised problem with the discrepancy eliminated, and its damped and limited solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.eliminated import Eliminated
from radiation_ss.gap.posterior.noise import Noise
from radiation_ss.gap.posterior.problem import Point, Problem, whitened
from radiation_ss.gap.posterior.setting import filled


@dataclass(frozen=True, eq=False)
class Place:
    """Where a fit is, with the discrepancy at its optimum.

    Parameters
    ----------
    q : ndarray, shape (nq,)
    point : Point
    r : ndarray, shape (nk,)
        Whitened residuals.
    cost : float
        Half the sum of squares of residuals and prior.
    """

    q: FloatArray
    point: Point
    r: FloatArray
    cost: float


def placed(problem: Problem, noise: Noise, free: Eliminated | None, q: FloatArray, point: Point) -> Place:
    """Return a point, whose residuals belong to q, after the discrepancy has gone to its optimum."""
    r, _ = whitened(Point(point.residuals), noise)
    if free is not None:
        step = free.step(r, q[problem.rolled:])
        q = np.concatenate([q[: problem.rolled], q[problem.rolled:] + step])
        ends = np.cumsum([part.size for part in point.residuals])[:-1]
        taken = np.split(problem.setting.stacked @ step, ends)
        point = replace(point, residuals=[a - b for a, b in zip(point.residuals, taken)])
        r, _ = whitened(Point(point.residuals), noise)
    return Place(q, point, r, 0.5 * float(r @ r + q @ q))


@dataclass(frozen=True, eq=False)
class Curvature:
    """The linearised problem min |b - R step|^2 in the parameters other than the discrepancy, prior included.

    Parameters
    ----------
    root : ndarray, shape (rolled, rolled)
        R, upper triangular.
    right : ndarray, shape (rolled,)
        b.
    cross : ndarray, shape (nd, rolled)
        `Eliminated.cross` of the derivatives.
    """

    root: FloatArray
    right: FloatArray
    cross: FloatArray

    def promise(self, step: FloatArray) -> float:
        """Return how much a step lowers the cost of the linearised problem."""
        return 0.5 * float(self.right @ self.right - np.sum((self.right - self.root @ step) ** 2))


def curvature(place: Place, noise: Noise, free: Eliminated | None) -> Curvature:
    """Return the linearised problem at a place, by normal equations or, near collinearity, an orthogonal reduction."""
    _, J = whitened(place.point, noise)
    assert J is not None
    count, r = J.shape[1], place.r
    q = place.q[:count]
    # At the discrepancy's optimum the gradient by it is zero, so only the curvature changes.
    cross = free.cross(J) if free is not None else np.zeros((0, count))
    square, right = np.eye(count), J.T @ r - q
    ends = np.cumsum([part.size for part in place.point.residuals])[:-1]
    for moving, part in filled(np.split(J, ends)):
        square[np.ix_(moving, moving)] += part.T @ part
    size = np.sqrt(np.diag(square))
    try:
        upper: FloatArray = cholesky((square - cross.T @ cross) / np.outer(size, size))
    except LinAlgError:
        upper = np.zeros((1, 1))
    if np.abs(np.diag(upper)).min() > 1e-5:
        return Curvature(upper * size, solve_triangular(upper, right / size, trans="T"), cross)
    D = free.columns * free.weights[:, None] if free is not None else np.zeros((r.size, 0))
    prior = -np.concatenate([place.q[count:], q])[:, None]
    table = np.block([[D, J, r[:, None]], [np.eye(prior.size), prior]])
    triangle: FloatArray = np.linalg.qr(table, mode="r")  # type: ignore[assignment]
    kept = slice(D.shape[1], D.shape[1] + count)
    return Curvature(triangle[kept, kept], triangle[kept, -1], cross)


def limited_step(q: FloatArray, curve: Curvature, lower: FloatArray, damping: float) -> FloatArray:
    """Return the damped Newton step that keeps to the lower limits: entries that run into one are held there.

    Of q and its limits only as many entries count as the curvature has.
    """
    root, right = curve.root, curve.right
    q, lower = q[: right.size], lower[: right.size]
    held = (q <= lower) & (root.T @ right < 0.0)
    size = np.sqrt(damping * np.sum(root**2, axis=0))
    step = np.zeros(q.size)
    for _ in range(q.size):
        free = ~held
        step[free] = least_squares(root[:, free], size[free], right - root[:, held] @ step[held])
        beyond = free & (q + step < lower)
        if not beyond.any():
            return step
        step[beyond] = lower[beyond] - q[beyond]
        held = held | beyond
    return step


def least_squares(matrix: FloatArray, size: FloatArray, right: FloatArray) -> FloatArray:
    """Return x that minimises |right - matrix x|^2 + |size x|^2; the matrix has full rank."""
    count = size.size
    table = np.block([[matrix, right[:, None]], [np.diag(size), np.zeros((count, 1))]])
    triangle: FloatArray = np.linalg.qr(table, mode="r")  # type: ignore[assignment]
    return np.asarray(solve_triangular(triangle[:count, :count], triangle[:count, count]))
