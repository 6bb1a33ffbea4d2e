"""Levenberg-Marquardt for small dense problems, with equalities held along a feasible path.

scipy's least_squares stops early here: the port-Hamiltonian parameters are redundant, so J is rank-deficient, and the
damping must be allowed to fall to nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from radiation_ss.arrays import FloatArray

Residual = Callable[[FloatArray, bool], tuple[FloatArray, FloatArray | None]]
"""theta, whether the Jacobian is wanted -> residual vector, Jacobian."""


def minimise(residual: Residual, theta: FloatArray, *, iterations: int = 300,
             tolerance: float = 1e-5) -> tuple[FloatArray, float, bool]:
    """Return (theta, sum of squares, converged) of min ||r(theta)||^2.

    Parameters
    ----------
    residual : callable
    theta : ndarray, shape (size,)
    iterations : int
    tolerance : float
        Stop when the cost has fallen by less than this part over five iterations, or cannot fall.
    """
    damping = 1e-2
    r, J = residual(theta, True)
    cost, history = float(r @ r), [np.inf] * 5
    for _ in range(iterations):
        assert J is not None
        H, g = J.T @ J, J.T @ r
        while True:
            step = -np.linalg.solve(H + damping * np.eye(theta.size), g)
            new, _none = residual(theta + step, False)
            new_cost = float(new @ new)
            if new_cost < cost:
                break
            damping *= 4.0
            if damping > 1e12:
                return theta, cost, True
        theta, damping = theta + step, max(damping / 3.0, 1e-12)
        history = history[1:] + [cost]
        cost = new_cost
        if history[0] - cost < tolerance * cost:
            return theta, cost, True
        r, J = residual(theta, True)
    return theta, cost, False


def minimise_subject_to(residual: Residual, equality: Residual, theta: FloatArray, *, iterations: int = 150,
                        tolerance: float = 1e-5) -> tuple[FloatArray, float, float]:
    """Return (theta, sum of squares, largest violation) of min ||r||^2 subject to h(theta) = 0.

    A feasible path: each damped Gauss-Newton step lies in the tangent of h = 0 and is then moved onto it.
    """
    theta = _onto(equality, theta)
    damping = 1e-2
    (r, J), (_h, A) = residual(theta, True), equality(theta, True)
    cost, history = float(r @ r), [np.inf] * 5
    for _ in range(iterations):
        assert J is not None and A is not None
        # An orthonormal basis of the tangent: the null space of A.
        _, size, vt = np.linalg.svd(A)
        basis = vt[int(np.sum(size > 1e-10 * size[0])):].T
        T = J @ basis
        H, g = T.T @ T, T.T @ r
        while damping <= 1e12:
            step = basis @ np.linalg.solve(H + damping * np.eye(H.shape[0]), -g)
            trial = _onto(equality, theta + step)
            new, _none = residual(trial, False)
            if float(new @ new) < cost and np.abs(equality(trial, False)[0]).max() < 1e-10:
                break
            damping *= 4.0
        else:
            break
        theta, damping = trial, max(damping / 3.0, 1e-12)
        history = history[1:] + [cost]
        cost = float(new @ new)
        if history[0] - cost < tolerance * cost:
            break
        (r, J), (_h, A) = residual(theta, True), equality(theta, True)
    return theta, cost, float(np.abs(equality(theta, False)[0]).max())


def _onto(equality: Residual, theta: FloatArray) -> FloatArray:
    """Return theta moved onto h = 0 by Newton steps of least norm, as far as they go."""
    for _ in range(40):
        h, A = equality(theta, True)
        if np.abs(h).max() < 1e-14:
            break
        assert A is not None
        step = np.linalg.lstsq(A, h, rcond=1e-12)[0]
        theta = theta - step * min(1.0, 0.3 * float(np.linalg.norm(theta)) / max(float(np.linalg.norm(step)), 1e-300))
    return theta
