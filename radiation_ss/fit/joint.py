"""Joint fit of a symmetric K(s): passive and reciprocal by construction, poles shared by all entries.

Gauss-Newton with growth finds the start, CasADi states the program with its constraints and finishes it
(`radiation_ss.fit.program`); many degrees of freedom at once are for `radiation_ss.fit.chains`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.fit.chains import fit_chains
from radiation_ss.fit.levenberg import Residual, minimise
from radiation_ss.fit.port import Port
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.program import finish, on_points

MET = 1e-9
"""Largest violation of an equality, relative to the largest |K_ii|."""
STIFF = 0.3
"""Cost of an undamped resonance, as a relative error."""
STIFF_POINTS = 100.0
"""Weight of a frequency point before the model is moved onto it; all samples together have 1."""
INDEPENDENT = 0.1
"""Directions of motion whose K is below this part of the largest singular value add no states."""
LARGEST = 800
"""Parameters of the largest form whose Jacobian is formed; beyond, chains take over."""

Run = tuple[float, Port, FloatArray]
"""Cost, form and parameters of what was found."""


@dataclass(frozen=True)
class Search:
    """How a joint fit is searched for.

    Parameters
    ----------
    passive : bool
        False goes on from the passive model without the sign of the losses.
    seed : int
        Of the random starts.
    screened : int
        Gauss-Newton iterations after which the best start of a size goes on alone.
    iterations : int
        Most iterations of a size.
    known : dict
        What fits of the same or nearly the same samples found, by number of states; what is found here is added.
    """

    passive: bool = True
    seed: int = 0
    screened: int = 15
    iterations: int = 150
    known: dict[int, Run] = field(default_factory=dict)


def fit_joint(problem: Problem, order: int, search: Search | None = None,
              ) -> tuple[FloatArray, FloatArray, FloatArray, str]:
    """Return (A, B, C, how it was solved) of the best reciprocal model found; passive ones have C = B^T.

    Parameters
    ----------
    problem : Problem
    order : int
        States for each independent motion.
    search : Search, optional

    Raises
    ------
    InputError
        If K(0) = 0 or the frequency points ask for more states.
    SolverError
        If the frequency points cannot be met.
    """
    search = search or Search()
    motions = independent(problem)
    form = Port.of(order * motions, problem.m, problem.zero)
    _check_size(form, problem)
    if form.size > LARGEST and search.passive and not problem.x_points.size:
        a, b, _error, steps = fit_chains(problem, order, seed=search.seed)
        how = f"{b.shape[0]} states in chains, {steps} quasi-Newton steps"
    else:
        _cost, form, theta = _grow(problem, order * motions, motions, search)
        if not search.passive:
            form, theta = _released(form, problem, theta)
        theta, how = _finished(form, problem, theta)
        a, b = form.realise(theta)
    b = np.sqrt(problem.rate) * b * problem.scale
    return problem.rate * a, b, b.T, how


def _grow(problem: Problem, states: int, step: int, search: Search) -> Run:
    """Return the best model with so many states, grown by `step` states at a time, never worse than a smaller one."""
    known = search.known
    best: Run | None = None
    for n in range(states - step * ((states - 1) // step), states + 1, step):
        forms = Port.all_of(n, problem.m, problem.zero)
        if not forms or n < 2:
            continue
        if n not in known or n == states:
            known[n] = _sized(problem, forms, best, known.get(n), search)
        best = known[n]
    assert best is not None
    return best


def _sized(problem: Problem, forms: tuple[Port, ...], smaller: Run | None, known: Run | None, search: Search) -> Run:
    """Return the best model of one size over all signatures, spread starts, the smaller model and `known`."""
    rng = np.random.default_rng([search.seed, forms[0].n1 + forms[0].n2])
    tried: list[Run] = []
    for form in forms:
        residual = _residual(form, problem)
        starts = [_start(form, problem, rng)]
        if smaller is not None and smaller[1].n1 <= form.n1 and smaller[1].n2 <= form.n2:
            starts += [_grown(smaller[1], form, smaller[2], problem, rng, loose) for loose in (1.0, 1.0)]
        if known is not None:
            starts = [known[2]] if known[1] == form else []
        for start in starts:
            theta, cost, _ = minimise(residual, start, iterations=search.screened)
            tried.append((cost, form, theta))
    best = min(tried, key=lambda run: run[0])
    theta, cost, _ = minimise(_residual(best[1], problem), best[2], iterations=search.iterations)
    if smaller is None or cost <= smaller[0]:
        return cost, best[1], theta
    # New states that hardly couple: the smaller model itself, and downhill from there.
    form = next(form for form in forms if smaller[1].n1 <= form.n1 and smaller[1].n2 <= form.n2)
    theta, cost, _ = minimise(_residual(form, problem), _grown(smaller[1], form, smaller[2], problem, rng, 1e-3),
                              iterations=search.iterations)
    if cost > smaller[0]:
        theta = _grown(smaller[1], form, smaller[2], problem, rng, 0.0)
        cost = float(np.sum(_residual(form, problem)(theta, False)[0] ** 2))
    return cost, form, theta


def _finished(form: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, str]:
    """Return CasADi's answer from this start where it is no worse, and which solver did what.

    Raises
    ------
    SolverError
        If the frequency points are not met.
    """
    residual = _residual(form, problem, 0.0)
    if problem.x_points.size:
        theta = on_points(form, problem, minimise(_residual(form, problem, STIFF_POINTS), theta)[0])
    found, status = finish(form, problem, theta)
    sound = [(float(np.sum(residual(v, False)[0] ** 2)), k) for k, v in enumerate((theta, found))
             if _met(form, problem, v) and not (form.signed and _unstable(form, v))]
    if not sound:
        where = ", ".join(f"{x * problem.rate:g}" for x in problem.x_points)
        raise SolverError(f"{', '.join(problem.dofs)}: no passive model with {form.n1 + form.n2} states was found that "
                          f"meets K exactly at {where} rad/s ({status}); raise the order, or check that the values are "
                          "passive")
    first = "Gauss-Newton with growth" + (" and steps onto the points" if problem.x_points.size else "")
    new, chosen = min(sound)
    if chosen == 0:
        return theta, f"{first}; IPOPT found no lower cost ({status})"
    before = sound[0][0] if len(sound) == 2 else np.inf
    return found, f"{first}, then IPOPT ({status}; cost lower by {1.0 - new / max(before, 1e-300):.1e})"


def _met(form: Port, problem: Problem, theta: FloatArray) -> bool:
    """Whether the frequency points are met."""
    miss = form.states_of(theta, problem.x_points)[0] - problem.K_points
    return bool(np.abs(miss).max(initial=0.0) <= MET)


def _unstable(form: Port, theta: FloatArray) -> bool:
    return bool(np.linalg.eigvals(form.realise(theta)[0]).real.max() >= 0.0)


def independent(problem: Problem) -> int:
    """Return how many combinations of motions radiate on their own: surge and pitch of a sphere are one."""
    m = problem.m
    full = np.zeros((problem.x.size, m, m), dtype=complex)
    upper = np.triu_indices(m)
    full[:, upper[0], upper[1]] = problem.K
    full[:, upper[1], upper[0]] = problem.K
    sizes = np.linalg.svd(full.reshape(-1, m), compute_uv=False)
    return int(np.sum(sizes > INDEPENDENT * sizes[0]))


def _grown(small: Port, large: Port, theta: FloatArray, problem: Problem, rng: np.random.Generator,
           loose: float) -> FloatArray:
    """Return a start for a larger form: the smaller model and, coupled to it with strength `loose`, new resonances."""
    e1, e2, G, W = small.unpack(theta)
    n1, n2, p = large.n1, large.n2, large.lossless
    old, new = np.arange(small.n2), np.arange(small.n2)
    new[small.lossless:] += p - small.lossless  # lossless states come first
    top = float(problem.x[-1])
    H = 0.03 * loose * rng.normal(size=(n1, n2))
    H[:small.n1, new] = G[:, old]
    fresh = np.setdiff1d(np.arange(n2), new)
    for row, column in zip(range(small.n1, n1), fresh):
        H[row, column] = top * np.exp(rng.uniform(np.log(0.08), np.log(0.9)))
    f1, f2 = np.full(n1, np.sqrt(0.3)), np.full(n2, np.sqrt(0.3))
    f1[:small.n1], f2[new] = e1, e2
    V = 0.1 * loose * rng.normal(size=(large.inputs, large.m))
    V[:W.shape[0]] = W
    return np.concatenate([f1, f2[p:], H.ravel(), V.ravel()])


def _released(port: Port, problem: Problem, theta: FloatArray) -> tuple[Port, FloatArray]:
    """Return the free fit from a passive one: D1 and D2 may turn negative as long as all poles stay stable."""
    free = port.released()
    misfit = _residual(free, problem)
    squared = theta.copy()
    losses = port.n1 + port.n2 - port.lossless
    squared[:losses] **= 2

    def residual(theta: FloatArray, jacobian: bool) -> tuple[FloatArray, FloatArray | None]:
        if _unstable(free, theta):
            return np.full(2 * problem.K.size + 2 * problem.K_points.size + port.n1 + port.n2, 1e3), None
        return misfit(theta, jacobian)

    return free, minimise(residual, squared)[0]


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
        W = 0.5 * np.eye(port.inputs, port.m) + 0.1 * rng.normal(size=(port.inputs, port.m))
    else:
        W = 0.3 * rng.normal(size=(port.n1, port.m))
    return np.concatenate([losses, G.ravel(), W.ravel()])


def _residual(port: Port, problem: Problem, heavy: float = 3.0) -> Residual:
    """Return the weighted misfit over the samples, real parts first, and what resonances are too narrow.

    Frequency points are samples of weight `heavy` here, all others together having 1; the program that finishes the fit
    meets them exactly.
    """
    x, data = np.r_[problem.x, problem.x_points], np.vstack([problem.K, problem.K_points])
    weight = np.vstack([problem.weight, np.full(problem.K_points.shape, heavy * problem.norm)])

    def residual(theta: FloatArray, jacobian: bool) -> tuple[FloatArray, FloatArray | None]:
        K, Y = port.states_of(theta, x)
        r = (weight * (K - data)).ravel()
        short, slope = _too_narrow(port, problem, theta)
        value = np.concatenate([r.real, r.imag, short])
        if not jacobian:
            return value, None
        J = port.jacobian(theta, Y)
        J *= weight[:, :, None]
        return value, np.vstack([J.reshape(2 * r.size, -1), slope])

    return residual


def _too_narrow(port: Port, problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by how much each oscillating pole decays more slowly than the data resolve, and the derivatives."""
    limit, N = max(problem.narrowest, 1e-12), port.n1 + port.n2
    poles, slopes = port.poles(theta)
    short = 1.0 + poles.real / limit
    counts = (short > 0.0) & (np.abs(poles.imag) > limit)
    if not counts.any():
        return np.zeros(N), np.zeros((N, port.size))
    gain = STIFF * problem.norm
    return np.where(counts, gain * short, 0.0), np.where(counts[:, None], gain / limit * slopes().real, 0.0)
