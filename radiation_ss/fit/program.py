"""The matrix fit as a CasADi program: port-Hamiltonian form, frequency points and resolved resonances; IPOPT finishes.

    min  sum weight^2 |K(i x) - K_data|^2     over theta of `radiation_ss.fit.port.Port`
    s.t. K(i x_c) = K_c at the frequency points, and no pole decays more slowly than the data resolve
         (linear in theta around the start, from which IPOPT moves little); with points no loss and no coupling is
         above `Problem.fastest`: a point may be met by a pole so fast that K has a feedthrough, which no body has

Passivity, reciprocity and K(0) = 0 hold for every theta. IPOPT starts where Levenberg-Marquardt ended.
"""

from __future__ import annotations

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

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.descent import Residual, minimise, misfit_of
from radiation_ss.fit.port import Port
from radiation_ss.fit.problem import Problem


def finish(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, str]:
    """Return IPOPT's theta from a start, moved onto the frequency points to round-off, and its return status."""
    solver = _program(port, problem.x.size, problem.x_points.size)
    slopes, room = _resolved(port, problem, theta)
    keep, values = _rows(problem), _values(problem, theta, slopes)
    largest = port.largest(problem.fastest) if problem.x_points.size else np.full(theta.size, np.inf)
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
        except BaseException as error:
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
    theta = np.clip(theta, -largest, largest)

    def bounded(target: ComplexArray) -> Residual:
        misfit = misfit_of(port, replace(problem, K_points=target), heavy)

        def residual(theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
            r, jacobian = misfit(theta)
            gain = np.where(np.abs(theta) > largest, heavy * problem.norm / largest, 0.0)
            over = gain * (np.abs(theta) - np.minimum(largest, np.abs(theta)))
            return np.r_[r, over], lambda: np.vstack([jacobian(), np.diag(gain * np.sign(theta))])

        return residual

    target = wanted
    for _ in range(rounds):
        theta = minimise(bounded(target), theta, 40)[0]
        missed = wanted - port.states_of(theta, problem.x_points)[0]
        if np.abs(missed).max() < 1e-6:
            break
        target = target + missed
    return theta


def on_points(port: Port, problem: Problem, theta: FloatArray) -> FloatArray:
    """Return theta moved onto the frequency points; theta itself where that cannot be."""
    if not problem.x_points.size:
        return theta
    points = _program(port, problem.x.size, problem.x_points.size)["points"]
    keep = np.flatnonzero(_rows(problem))
    values = _values(problem, theta, np.zeros((port.states, port.size)))
    try:
        return onto(lambda v: tuple(np.asarray(u)[keep] for u in points(v, values)), theta)
    except RuntimeError:  # CasADi's of a model with a pole at a point
        return theta


def _values(problem: Problem, theta: FloatArray, slopes: FloatArray) -> FloatArray:
    K, w, Kc = problem.K, problem.weight / problem.norm, problem.K_points
    return np.concatenate([problem.x, *(u.ravel(order="F") for u in (K.real, K.imag, w)), problem.x_points,
                           Kc.real.ravel(order="F"), Kc.imag.ravel(order="F"), theta, slopes.ravel(order="F")])


def onto(equations: Any, v: FloatArray, steps: int = 40) -> FloatArray:
    """Return the variables moved onto equations to round-off, by damped Newton steps of least norm.

    `equations`: v -> values, shape (rows, 1), and their Jacobian. `steps`: at most.
    """
    for _ in range(steps):
        g, J = equations(v)
        if g.size == 0 or np.abs(g).max() < 1e-15:
            break
        step = np.linalg.lstsq(J, g[:, 0], rcond=1e-13)[0]
        v = v - step * min(1.0, 0.3 * float(np.linalg.norm(v)) / max(float(np.linalg.norm(step)), 1e-300))
    return v


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
