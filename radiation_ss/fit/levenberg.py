"""Levenberg-Marquardt for small dense problems, with equalities by the augmented Lagrangian.

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


def minimise_subject_to(residual: Residual, equality: Residual, theta: FloatArray, *, iterations: int = 60,
                        ) -> tuple[FloatArray, float, float]:
    """Return (theta, sum of squares, largest violation) of min ||r||^2 subject to h(theta) = 0.

    Augmented Lagrangian (Hestenes, Powell) with `minimise` inside, then Newton steps of least norm onto h = 0.
    """
    penalty, shift = 30.0, np.zeros(equality(theta, False)[0].size)
    for _ in range(5):
        def augmented(t: FloatArray, jacobian: bool, penalty: float = penalty,
                      shift: FloatArray = shift) -> tuple[FloatArray, FloatArray | None]:
            (r, J), (h, H) = residual(t, jacobian), equality(t, jacobian)
            both = None if J is None or H is None else np.vstack([J, penalty * H])
            return np.concatenate([r, penalty * (h + shift)]), both

        theta, _cost, _ = minimise(augmented, theta, iterations=iterations)
        h, _none = equality(theta, False)
        if np.abs(h).max() < 1e-9:
            break
        shift = shift + h
    for _ in range(30):
        h, H = equality(theta, True)
        if np.abs(h).max() < 1e-13:
            break
        assert H is not None
        theta = theta - np.linalg.lstsq(H, h, rcond=1e-12)[0]
    r, _none = residual(theta, False)
    return theta, float(r @ r), float(np.abs(equality(theta, False)[0]).max())
