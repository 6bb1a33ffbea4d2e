"""Joint fit of a symmetric K(s): passive and reciprocal by construction, poles shared by all entries."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.fit.levenberg import Residual, minimise, minimise_subject_to
from radiation_ss.fit.port import Port
from radiation_ss.fit.problem import Problem

MET = 1e-9
"""Largest violation of an equality, relative to the largest |K_ii|."""
STIFF = 0.3
"""Cost of an undamped resonance, as a relative error."""
INDEPENDENT = 0.1
"""Directions of motion whose K is below this part of the largest singular value add no states."""


Runs = list[tuple[float, FloatArray]]
"""Costs and parameters of what was found."""


def fit_joint(problem: Problem, states: int, *, passive: bool = True, starts: int = 3, seed: int = 0,
              known: dict[int, Runs] | None = None, iterations: int = 300,
              ) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return (A, B, C, relative error) of the best reciprocal model with so many states; passive ones have C = B^T.

    The model grows: two states for each independent motion at a time, from the fit before and from random starts.

    Parameters
    ----------
    problem : Problem
    states : int
    passive : bool
        False goes on from the passive model without the sign of the losses.
    starts : int
        Random starts of each size, and as many grown ones; each runs for a few iterations, the best two to the end.
    seed : int
    known : dict, optional
        What fits of the same or nearly the same samples found, by number of states; what is found here is added. Sizes
        that are in it are not started anew.
    iterations : int
        Most iterations of the last size.

    Raises
    ------
    InputError
        If K(0) = 0 or the frequency points ask for more states.
    SolverError
        If the frequency points cannot be met.
    """
    known = {} if known is None else known
    port = Port.of(states, problem.m, problem.zero)
    _check_size(port, problem)
    rng = np.random.default_rng(seed)
    step = 2 * independent(problem)
    ladder = [Port.of(n, problem.m, problem.zero) for n in range((states - 1) % step + 1, states, step)
              if n > 1] + [port]
    found: Runs = []
    for k, rung in enumerate(ladder):
        last = found
        found = known.get(rung.n1 + rung.n2, [])
        if found and rung is not port:
            continue
        residual = _residual(rung, problem)
        if not found:
            few = starts if rung.size <= 200 else 1
            first = [_start(rung, problem, rng) for _ in range(few)]
            first += [_grown(ladder[k - 1], rung, theta, problem, rng) for _, theta in last for _ in range(few)]
            tried = sorted((minimise(residual, theta, iterations=30)[:2] for theta in first), key=lambda run: run[1])
            found = [(cost, theta) for theta, cost in tried[:2]]
        most = iterations if rung is port else min(60, iterations)
        runs = [minimise(residual, theta, iterations=most) for _, theta in found]
        found = known[rung.n1 + rung.n2] = [(cost, theta) for theta, cost, _ in runs]
    cost, theta = min(_exact(port, problem, found), key=lambda run: run[0])
    if not passive:
        theta, cost = _released(port, problem, theta)
        port = port.released()
    a, b = port.realise(theta)
    b = np.sqrt(problem.rate) * b * problem.scale
    return problem.rate * a, b, b.T, float(np.sqrt(cost)) / problem.norm


def independent(problem: Problem) -> int:
    """Return how many combinations of motions radiate on their own: surge and pitch of a sphere are one."""
    m = problem.m
    full = np.zeros((problem.x.size, m, m), dtype=complex)
    upper = np.triu_indices(m)
    full[:, upper[0], upper[1]] = problem.K
    full[:, upper[1], upper[0]] = problem.K
    sizes = np.linalg.svd(full.reshape(-1, m), compute_uv=False)
    return int(np.sum(sizes > INDEPENDENT * sizes[0]))


def _exact(port: Port, problem: Problem, found: Runs) -> Runs:
    """Return the runs moved onto the equalities, those that reach them.

    Raises
    ------
    SolverError
        If none does.
    """
    if not problem.x_points.size:
        return found
    residual, equality = _residual(port, problem), _equality(port, problem)
    runs = [minimise_subject_to(residual, equality, theta) for _, theta in found]
    exact = [(cost, theta) for theta, cost, violation in runs if violation <= MET]
    if not exact:
        where = ", ".join(f"{x * problem.rate:g}" for x in problem.x_points)
        raise SolverError(f"{', '.join(problem.dofs)}: no passive model with {port.n1 + port.n2} states was found that "
                          f"meets K exactly at {where} rad/s; raise the order, or check that the values are passive")
    return exact


def _grown(small: Port, large: Port, theta: FloatArray, problem: Problem, rng: np.random.Generator) -> FloatArray:
    """Return a start for a larger form: the smaller model and, loosely coupled to it, new resonances."""
    e1, e2, G, W = small.unpack(theta)
    n1, n2, p = large.n1, large.n2, large.lossless
    old, new = np.arange(small.n2), np.arange(small.n2)
    new[small.lossless:] += p - small.lossless  # lossless states come first
    top = float(problem.x[-1])
    H = 0.03 * rng.normal(size=(n1, n2))
    H[:small.n1, new] = G[:, old]
    fresh = np.setdiff1d(np.arange(n2), new)
    for row, column in zip(range(small.n1, n1), fresh):
        H[row, column] = top * np.exp(rng.uniform(np.log(0.08), np.log(0.9)))
    f1, f2 = np.full(n1, np.sqrt(0.3)), np.full(n2, np.sqrt(0.3))
    f1[:small.n1], f2[new] = e1, e2
    V = 0.1 * rng.normal(size=(p if p else n1, large.m))
    V[:W.shape[0]] = W
    return np.concatenate([f1, f2[p:], H.ravel(), V.ravel()])


def _released(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, float]:
    """Return the free fit from a passive one: D1 and D2 may turn negative as long as all poles stay stable."""
    free = port.released()
    misfit, equality = _residual(free, problem), _equality(free, problem)
    squared = theta.copy()
    losses = port.n1 + port.n2 - port.lossless
    squared[:losses] **= 2

    def residual(theta: FloatArray, jacobian: bool) -> tuple[FloatArray, FloatArray | None]:
        if np.linalg.eigvals(free.realise(theta)[0]).real.max() >= 0.0:
            return np.full(2 * problem.K.size + port.n1 + port.n2, 1e3), None
        return misfit(theta, jacobian)

    if problem.x_points.size:
        found, cost, violation = minimise_subject_to(residual, equality, squared)
        return (found, cost) if violation <= MET else (squared, float(np.sum(misfit(squared, False)[0] ** 2)))
    found, cost, _ = minimise(residual, squared)
    return found, cost


def _check_size(port: Port, problem: Problem) -> None:
    """Refuse orders that cannot carry what is asked."""
    name = ", ".join(problem.dofs)
    if problem.zero and port.n2 < 1:
        raise InputError(f"{name}: K(0) = 0 needs order 2 at least")
    equations = problem.K_points.size * 2 - (problem.x_points == 0.0).sum() * problem.K.shape[1]
    free = port.size - port.n1 * (port.n1 - 1) // 2 - max(port.n2 - port.lossless, 0) * (port.n2 - 1) // 2
    if equations > min(free, port.size):
        raise InputError(f"{name}: {problem.x_points.size} frequency point(s) are {equations} equations, more than "
                         f"{port.n1 + port.n2} states can carry; raise the order or drop points")


def _start(port: Port, problem: Problem, rng: np.random.Generator) -> FloatArray:
    """Return resonances spread over the band, loosely coupled at random."""
    pairs = min(port.n1, port.n2)
    top = float(problem.x[-1])
    G = 0.2 * rng.normal(size=(port.n1, port.n2))
    G[np.arange(pairs), np.arange(pairs)] += np.geomspace(min(0.4, 0.5 * top), 0.7 * top, pairs) if pairs else 0.0
    losses = np.full(port.n1 + port.n2 - port.lossless, np.sqrt(0.5))
    if port.lossless:
        W = 0.5 * np.eye(port.lossless, port.m) + 0.1 * rng.normal(size=(port.lossless, port.m))
    else:
        W = 0.3 * rng.normal(size=(port.n1, port.m))
    return np.concatenate([losses, G.ravel(), W.ravel()])


def _residual(port: Port, problem: Problem) -> Residual:
    """Return the weighted misfit over the samples, real parts first, and what resonances are too narrow."""
    weight = problem.weight

    def residual(theta: FloatArray, jacobian: bool) -> tuple[FloatArray, FloatArray | None]:
        K, Y = port.states_of(theta, problem.x)
        r = (weight * (K - problem.K)).ravel()
        short, slope = _too_narrow(port, problem, theta)
        value = np.concatenate([r.real, r.imag, short])
        if not jacobian:
            return value, None
        J = (weight[:, :, None] * port.jacobian(theta, Y)).reshape(r.size, -1)
        return value, np.vstack([J.real, J.imag, slope])

    return residual


def _too_narrow(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by how much each oscillating pole decays more slowly than the data resolve, and the derivatives."""
    poles, slopes = port.poles(theta)
    limit = max(problem.narrowest, 1e-12)
    short = 1.0 + poles.real / limit
    counts = (short > 0.0) & (np.abs(poles.imag) > limit)
    gain = STIFF * problem.norm
    return np.where(counts, gain * short, 0.0), np.where(counts[:, None], gain / limit * slopes.real, 0.0)


def _equality(port: Port, problem: Problem) -> Residual:
    """Return the misfit at the frequency points; K(0) is real, so its imaginary part is left out."""
    keep = np.concatenate([np.ones(problem.K_points.size, dtype=bool),
                           np.repeat(problem.x_points > 0.0, problem.K.shape[1])])

    def equality(theta: FloatArray, jacobian: bool) -> tuple[FloatArray, FloatArray | None]:
        K, Y = port.states_of(theta, problem.x_points)
        h = (K - problem.K_points).ravel()
        value = np.concatenate([h.real, h.imag])[keep]
        if not jacobian:
            return value, None
        J = port.jacobian(theta, Y).reshape(h.size, -1)
        return value, np.vstack([J.real, J.imag])[keep]

    return equality
