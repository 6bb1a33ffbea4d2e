"""Levenberg-Marquardt for small dense problems.

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
             tolerance: float = 1e-5) -> tuple[FloatArray, float, int]:
    """Return (theta, sum of squares, iterations taken) of min ||r(theta)||^2.

    Parameters
    ----------
    residual : callable
    theta : ndarray, shape (size,)
    iterations : int
    tolerance : float
        Stop when the cost has fallen by less than this part over five iterations, or cannot fall.
    """
    damping, growth = 1e-2, 2.0
    r, J = residual(theta, True)
    cost, history = float(r @ r), [np.inf] * 5
    for taken in range(iterations):
        assert J is not None
        H, g = J.T @ J, J.T @ r
        while True:
            step = -np.linalg.solve(H + damping * np.eye(theta.size), g)
            new, _none = residual(theta + step, False)
            gain = (cost - float(new @ new)) / max(float(step @ (damping * step - g)), 1e-300)
            if gain > 0.0:
                break
            damping, growth = damping * growth, 2.0 * growth
            if damping > 1e12:
                return theta, cost, taken
        # Nielsen's rule: the better the model predicts, the less damping.
        damping, growth = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), 1e-12), 2.0
        theta, history, cost = theta + step, history[1:] + [cost], float(new @ new)
        if history[0] - cost < tolerance * cost:
            return theta, cost, taken + 1
        r, J = residual(theta, True)
    return theta, cost, iterations
