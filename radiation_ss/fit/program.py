"""Descents of a port-Hamiltonian model to its data, and the CasADi program that finishes the fit.

Levenberg-Marquardt, or L-BFGS where the Jacobian is too large; then by IPOPT

    min  sum weight^2 |K(i x) - K_data|^2     over theta of `radiation_ss.fit.port.Port`
    s.t. K(i x_c) = K_c at the frequency points, and no pole decays more slowly than the data resolve
         (linear in theta around the start, from which IPOPT moves little); no loss and no coupling is above
         `Problem.fastest`: a pole may be so fast that K has a feedthrough, which no body has

Passivity, reciprocity and K(0) = 0 hold for every theta. IPOPT starts where Levenberg-Marquardt ended.
"""

import io
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from threading import current_thread, main_thread
from types import FrameType
from typing import Any

import numpy as np
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.port import Port
from radiation_ss.fit.problem import Problem

Residual = Callable[[FloatArray], tuple[FloatArray, Callable[[], FloatArray]]]  # of theta, and of its Jacobian


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


def bounded(port: Port, problem: Problem, heavy: float = 10.0) -> Residual:
    """Return `misfit_of` and by how much losses and couplings exceed their bounds, which weighs `heavy`."""
    misfit, largest = misfit_of(port, problem, heavy), port.largest(problem.fastest)

    def residual(theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
        r, jacobian = misfit(theta)
        gain = np.where(np.abs(theta) > largest, heavy * problem.norm / largest, 0.0)
        over = gain * (np.abs(theta) - np.minimum(largest, np.abs(theta)))
        return np.r_[r, over], lambda: np.vstack([jacobian(), np.diag(gain * np.sign(theta))])

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


def finish(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, str]:
    """Return IPOPT's theta from a start, moved onto the frequency points to round-off, and its return status."""
    solver = _program(port, problem.x.size, problem.x_points.size)
    slopes, room = _resolved(port, problem, theta)
    keep, values = _rows(problem), _values(problem, theta, slopes)
    largest = port.largest(problem.fastest)
    solution, status = solved(solver["solve"], x0=theta, p=values, lbx=-largest, ubx=largest,
                              ubg=np.r_[np.where(keep, 0.0, np.inf), room],
                              lbg=np.r_[np.where(keep, 0.0, -np.inf), np.full(room.size, -np.inf)])
    return on_points(port, problem, np.asarray(solution["x"]).ravel()), status


def solved(solve: Any, **arguments: Any) -> tuple[Any, str]:
    """Return IPOPT's solution and its return status.

    A signal's exception, Ctrl-C's, is raised after it: IPOPT takes one for a stop of its own and returns as if done.
    """
    before, caught, stderr = signal.getsignal(signal.SIGINT), [], sys.stderr

    def handle(number: int, frame: FrameType | None) -> None:
        sys.stderr = io.StringIO()  # CasADi warns of what it caught
        try:
            before(number, frame)  # type: ignore[operator, misc]
        except BaseException as error:  # Ctrl-C by whatever exception the handler has: raised again after IPOPT
            caught.append(error)
            raise

    watched = callable(before) and current_thread() is main_thread()
    if watched:
        signal.signal(signal.SIGINT, handle)
    try:
        solution = solve(**arguments)
    except SystemError:  # Python 3.12 and newer: the call returned, with the exception set
        if not caught:
            raise
    finally:
        sys.stderr = stderr
        if watched:
            signal.signal(signal.SIGINT, before)
    if caught:
        raise caught[0]
    return solution, str(solve.stats()["return_status"])


def toward_points(port: Port, problem: Problem, theta: FloatArray, rounds: int = 10, heavy: float = 10.0) -> FloatArray:
    """Return theta of least misfit near the frequency points, within bounds, by the method of multipliers.

    The points are samples of weight `heavy`, whose targets move by what was missed (Powell 1969, in Fletcher,
    Optimization, 283).
    """
    largest, wanted = port.largest(problem.fastest), problem.K_points
    theta, target = np.clip(theta, -largest, largest), wanted
    for _ in range(rounds):
        theta = minimise(bounded(port, replace(problem, K_points=target), heavy), theta, 40)[0]
        missed = wanted - port.states_of(theta, problem.x_points)[0]
        if np.abs(missed).max() < 1e-6:
            break
        target = target + missed
    return theta


def on_points(port: Port, problem: Problem, theta: FloatArray, steps: int = 40) -> FloatArray:
    """Return theta moved onto the frequency points by Newton steps of least norm; theta itself where that cannot be."""
    if not problem.x_points.size:
        return theta
    points = _program(port, problem.x.size, problem.x_points.size)["points"]
    keep, moved = np.flatnonzero(_rows(problem)), theta
    values = _values(problem, theta, np.zeros((port.states, port.size)))
    for _ in range(steps):
        try:
            g, J = (np.asarray(part)[keep] for part in points(moved, values))
        except RuntimeError:  # CasADi's of a model with a pole at a point
            return theta
        if np.abs(g).max() < 1e-15:
            break
        step = np.linalg.lstsq(J, g[:, 0], rcond=1e-13)[0]
        moved = moved - step * min(1.0, 0.3 * float(np.linalg.norm(moved)) / max(float(np.linalg.norm(step)), 1e-300))
    return moved


def _values(problem: Problem, theta: FloatArray, slopes: FloatArray) -> FloatArray:
    K, w, Kc = problem.K, problem.weight / problem.norm, problem.K_points
    return np.concatenate([problem.x, *(u.ravel(order="F") for u in (K.real, K.imag, w)), problem.x_points,
                           Kc.real.ravel(order="F"), Kc.imag.ravel(order="F"), theta, slopes.ravel(order="F")])


def _rows(problem: Problem) -> np.ndarray:
    """Return which equations of the points count: K(0) is real, so its imaginary part is left out."""
    real = np.ones(problem.K_points.shape, dtype=bool)
    imag = np.broadcast_to(problem.x_points[:, None] > 0.0, real.shape)
    return np.concatenate([real.ravel(order="F"), imag.ravel(order="F")])


def _resolved(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the poles' real parts, and how far each pole may move to the right."""
    poles, slopes = port.poles(theta, lambda poles: np.ones(poles.size, dtype=bool))
    room = np.maximum(-problem.narrowest - poles.real, 0.0)
    counts = room < problem.narrowest
    return np.where(counts[:, None], slopes.real, 0.0), np.where(counts, room, 1.0)


@lru_cache(maxsize=32)
def _program(port: Port, samples: int, points: int) -> dict[str, Any]:
    import casadi as cs

    N, entries, size = port.states, port.m * (port.m + 1) // 2, port.size
    theta, x = cs.MX.sym("theta", size), cs.MX.sym("x")
    a, b = _matrices(cs, port, theta)
    # (i x I - A) Y = B in real arithmetic.
    eye = x * cs.MX.eye(N)
    Y = cs.solve(cs.blockcat([[-a, -eye], [eye, -a]]), cs.vertcat(b, cs.MX(N, port.m)))
    upper = np.ravel_multi_index(np.triu_indices(port.m), (port.m, port.m), order="F").tolist()
    response = cs.Function("response", [theta, x], [cs.vec(b.T @ Y[:N, :])[upper].T, cs.vec(b.T @ Y[N:, :])[upper].T])

    def along(at: Any, count: int) -> tuple[Any, Any]:
        re, im = response.map(count)(cs.repmat(theta, 1, count), at.T)
        return (cs.reshape(part, entries, count).T for part in (re, im))  # type: ignore[return-value]

    sizes = [samples, *[samples * entries] * 3, points, *[points * entries] * 2, size, N * size]
    data = cs.MX.sym("data", sum(sizes))
    x_all, re, im, weight, x_points, re_points, im_points, start, slopes = cs.vertsplit(
        data, np.r_[0, np.cumsum(sizes)].tolist())
    real, imag = along(x_all, samples)
    misfit = cs.vertcat(weight * (cs.vec(real) - re), weight * (cs.vec(imag) - im))
    rows = cs.MX(0, 1)
    if points:
        real, imag = along(x_points, points)
        rows = cs.vertcat(cs.vec(real) - re_points, cs.vec(imag) - im_points)
    g = cs.vertcat(rows, cs.reshape(slopes, N, size) @ (theta - start))
    options: dict[str, Any] = {"print_time": False, "ipopt": {
        "print_level": 0, "sb": "yes", "mu_init": 1e-6, "max_iter": 100 if points else 25, "tol": 1e-7,
        "constr_viol_tol": 1e-9, "hessian_approximation": "limited-memory", "limited_memory_max_history": 30,
        "acceptable_iter": 3, "acceptable_tol": 1e-2, "acceptable_constr_viol_tol": 1e-9,
        "acceptable_obj_change_tol": 1e-4}}
    nlp: dict[str, Any] = {"x": theta, "p": data, "f": 1e3 * cs.sumsqr(misfit), "g": g}
    return {"solve": cs.nlpsol("matrix", "ipopt", nlp, options),
            "points": cs.Function("points", [theta, data], [rows, cs.jacobian(rows, theta)])}


def _matrices(cs: Any, port: Port, theta: Any) -> tuple[Any, Any]:
    """Return (A, B) of `Port.realise` as CasADi expressions."""
    lossy, p = port.n2 - port.lossless, port.lossless
    e1, e2, G, W = cs.vertsplit(theta, np.r_[0, np.cumsum([port.n1, lossy, port.n1 * port.n2, port.inputs * port.m])])
    G, W = cs.reshape(G, port.n2, port.n1).T, cs.reshape(W, port.m, port.inputs).T
    d1, d2 = (e1, e2) if port.signed else (e1**2, e2**2)
    a = cs.blockcat([[-cs.diag(d1), G], [-G.T, -cs.diag(cs.vertcat(cs.MX(p, 1), d2))]])
    return a, cs.vertcat(G[:, :p] @ W if p else W, cs.MX(port.n2, port.m))
