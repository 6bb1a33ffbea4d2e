"""The paper's own fit of (8), for comparison: kernel samples, quasi-Newton, numerical differences, no constraint.

Yu and Falnes 1995; Hanaki et al. 2022, section 2. It may be unstable or not passive, and depends on its start.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.rational import impulse_response, observer_form

SAMPLES = 120


def fit_kernel(problem: Problem, order: int, first: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return (den, num), scaled, that minimise sum (L(t_i) - c exp(a t_i) b)^2 from a start.

    Parameters
    ----------
    problem : Problem
        Of one degree of freedom.
    order : int
    first : tuple of ndarray, shape (order,)
        Start values (den, num), constant term first.
    """
    t, kernel = kernel_samples(problem)

    def misfit(theta: FloatArray) -> float:
        with np.errstate(over="ignore", invalid="ignore"):
            model = impulse_response(*observer_form(theta[:order], theta[order:]), t)[:, 0, 0]
            value = float(np.sum((kernel - model) ** 2) / np.sum(kernel**2))
        return value if np.isfinite(value) else 1e6

    best = minimize(misfit, np.concatenate(first), method="BFGS")
    return best.x[:order], best.x[order:]


def kernel_samples(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Return scaled times and L(t) = 2/pi int B cos(w t) dw over the band (2)."""
    t = np.linspace(0.0, 12.0 * np.pi / problem.x[-1], SAMPLES)
    x, damping = np.r_[0.0, problem.x], np.r_[0.0, problem.K[:, 0].real]
    if not problem.zero:
        damping[0] = damping[1]
    return t, np.asarray(2.0 / np.pi * trapezoid(damping * np.cos(np.outer(t, x)), x, axis=1))
