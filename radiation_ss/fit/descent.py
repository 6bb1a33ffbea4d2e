"""Descents of a port-Hamiltonian model to its data: Levenberg-Marquardt; L-BFGS where the Jacobian is too large."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.port import Port
from radiation_ss.fit.problem import Problem

Residual = Callable[[FloatArray], tuple[FloatArray, Callable[[], FloatArray]]]
"""theta -> residual vector, and what returns its Jacobian."""


def misfit_of(port: Port, problem: Problem, heavy: float = 3.0) -> Residual:
    """Return the weighted misfit over the samples, real parts first, and what resonances are too narrow.

    Frequency points are samples of weight `heavy` here, all others together having 1; the program that finishes the fit
    meets them exactly.
    """
    x, data = np.r_[problem.x, problem.x_points], np.vstack([problem.K, problem.K_points])
    weight = np.vstack([problem.weight, np.full(problem.K_points.shape, heavy * problem.norm)])

    def residual(theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
        K, Y = port.states_of(theta, x)
        r = (weight * (K - data)).ravel()
        short, slope = too_narrow(port, problem, theta)

        def jacobian() -> FloatArray:
            J = port.jacobian(theta, Y)
            J *= weight[:, :, None]
            return np.vstack([J.reshape(2 * r.size, -1), slope])

        return np.concatenate([r.real, r.imag, short]), jacobian

    return residual


def too_narrow(port: Port, problem: Problem, theta: FloatArray, cost: float = 0.3) -> tuple[FloatArray, FloatArray]:
    """Return by how much poles decay more slowly than the data resolve, and the derivatives.

    An undamped resonance costs as much as a relative error of `cost` of one of the m motions.
    """
    limit = max(problem.narrowest, 1e-12)
    if min(part.min(initial=np.inf) for part in port.parts(theta)[:2]) > limit:  # no pole decays slower than all losses
        return np.zeros(0), np.zeros((0, port.size))
    poles, slopes = port.poles(theta, lambda poles: poles.real > -limit)
    gain = cost * problem.norm / np.sqrt(problem.m)
    return gain * (1.0 + poles.real / limit), gain / limit * slopes.real


def minimise(residual: Residual, theta: FloatArray, iterations: int = 300,
             tolerance: float = 1e-5) -> tuple[FloatArray, float]:
    """Return (theta, sum of squares) of min ||r(theta)||^2 by Levenberg-Marquardt.

    The parameters are redundant, so J is rank-deficient, and the damping must be allowed to fall to nothing, which
    scipy's least_squares does not. Stops when the cost has fallen by less than `tolerance` over five iterations.
    """
    damping, growth = 1e-2, 2.0
    r, jacobian = residual(theta)
    cost, history = float(r @ r), [np.inf] * 5
    for _ in range(iterations):
        J = jacobian()
        H, g = J.T @ J, J.T @ r
        rounding = 1e-15 * float(np.trace(H))
        while True:
            step = -np.linalg.solve(H + (damping + rounding) * np.eye(theta.size), g)
            new, jacobian = residual(theta + step)
            gain = (cost - float(new @ new)) / max(float(step @ (damping * step - g)), 1e-300)
            if gain > 0.0:
                break
            damping, growth = damping * growth, 2.0 * growth
            if damping > 1e12:
                return theta, cost
        # Nielsen's rule: the better the model predicts, the less damping.
        damping, growth = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), 1e-12), 2.0
        theta, r, history, cost = theta + step, new, history[1:] + [cost], float(new @ new)
        if history[0] - cost < tolerance * cost:
            break
    return theta, cost


def quasi_newton(form: Port, theta: FloatArray, problem: Problem, steps: int) -> tuple[FloatArray, float]:
    """Return (theta, cost) after L-BFGS steps, parameters scaled by the curvature at the start."""
    size = form.curvature(theta, form.states_of(theta, problem.x)[1])
    scale = np.maximum(np.sqrt(size / size.max()), 1e-2)

    def cost(v: FloatArray) -> tuple[float, FloatArray]:
        K, Y = form.states_of(v / scale, problem.x)
        pull = problem.weight**2 * (K - problem.K)
        return problem.misfit(K) / problem.norm**2, 2.0 * form.gradient(v / scale, Y, pull) / scale / problem.norm**2

    run = minimize(cost, theta * scale, jac=True, method="L-BFGS-B", options={
        "maxiter": steps, "maxfun": 2 * steps, "maxcor": 30, "ftol": 1e-9, "gtol": 1e-12})
    return run.x / scale, float(run.fun) * problem.norm**2
