"""Joint fit of a symmetric K(s): passive and reciprocal by construction, poles shared by all entries.

1. Motions that the data do not couple by symmetry (bodies of an array, mirrored) are fitted apart.
2. The modes of the damping are fitted each alone (`radiation_ss.fit.single`); side by side they are a passive start
   without couplings between them.
3. Levenberg-Marquardt frees the couplings, also from the fit with one state less for each motion, so that more states
   are never worse; large forms take L-BFGS, whose gradient costs about as much as the response.
4. CasADi states the program with its constraints and finishes it (`radiation_ss.fit.program`), but for large forms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.fit.port import Port, minimise, misfit_of, port_of, too_narrow
from radiation_ss.fit.problem import Problem, check_size
from radiation_ss.fit.program import finish, on_points, toward_points
from radiation_ss.fit.rational import connected
from radiation_ss.fit.single import Rational, descended

Run = tuple[float, Port, FloatArray]
"""Cost, form and parameters of what was found."""
Realised = tuple[FloatArray, FloatArray, str]
"""A, B with C = B^T, and how it was solved."""


@dataclass(frozen=True)
class Search:
    """How a joint fit is searched for."""

    passive: bool = True  # False goes on from the passive model without the sign of the losses
    seed: int = 0  # Of the small disturbance of the starts: couplings that are exactly zero may have no slope
    screened: int = 15  # Iterations after which the best start of a size goes on alone
    iterations: int = 150  # Most iterations of a size
    largest: int = 320  # Parameters of the largest form whose Jacobian is formed
    descents: int = 600  # Most L-BFGS steps of a larger form, in place of `iterations`
    # What fits of the same samples found, by order; what is found here is added
    known: dict[int, Run] = field(default_factory=dict)
    modes: dict[int, dict[int, Rational]] = field(default_factory=dict)  # The same for each mode of the damping alone


def fit_joint(problem: Problem, order: int, search: Search) -> tuple[FloatArray, FloatArray, FloatArray, str]:
    """Return (A, B, C, how it was solved) of the best reciprocal model found; passive ones have C = B^T.

    `order`: states for each independent motion. InputError if K(0) = 0 or the frequency points ask for more states.
    SolverError if the frequency points cannot be met.
    """
    parts = symmetric_parts(problem)
    if len(parts) == 1:
        a, b, how = _fit_part(problem, order, search)
    else:
        found = [_fit_part(part, order, replace(search, known={}, modes={})) for part, _ in parts]
        a, b = block_diag(*[f[0] for f in found]), np.vstack([f[1] @ V.T for f, (_, V) in zip(found, parts)])
        how = f"{len(parts)} parts that symmetry decouples: " + "; ".join(dict.fromkeys(f[2] for f in found))
    b = np.sqrt(problem.rate) * b * problem.scale
    return problem.rate * a, b, b.T, how


def symmetric_parts(problem: Problem, exact: float = 1e-6) -> list[tuple[Problem, FloatArray]]:
    """Return the parts, each with its orthonormal motions V (m, k), between which V^T K V is zero within `exact`.

    The eigenvectors of one combination of all samples lie in the parts: each sample commutes with the symmetry.
    """
    samples = np.concatenate([problem.whole(problem.K), problem.whole(problem.K_points)])
    share = np.random.default_rng(0).uniform(0.5, 1.5, (2, samples.shape[0]))
    _, V = np.linalg.eigh(np.tensordot(share[0], samples.real, 1) + np.tensordot(share[1], samples.imag, 1))
    coupled = np.abs(V.T @ samples @ V).max(axis=0)
    floor = exact * float(coupled.max())
    groups = [group for group in connected(coupled > floor) if coupled[np.ix_(group, group)].max() > floor]
    if len(groups) == 1 and len(groups[0]) == problem.m:
        return [(problem, np.eye(problem.m))]
    return [(problem.along(V[:, group]), V[:, group]) for group in groups]


def independent(problem: Problem, least: float = 0.1) -> int:
    """Return how many combinations of motions radiate on their own: surge and pitch of a sphere are one.

    Directions of motion whose K is below `least` of the largest singular value add no states.
    """
    sizes = np.linalg.svd(problem.whole(problem.K).reshape(-1, problem.m), compute_uv=False)
    return int(np.sum(sizes > least * sizes[0]))


def _fit_part(problem: Problem, order: int, search: Search) -> Realised:
    motions = independent(problem)
    n2 = order * motions // 2
    form = Port(order * motions - n2, n2, problem.m, min(problem.m, n2) if problem.zero else 0)
    free = form.size - form.n1 * (form.n1 - 1) // 2 - max(form.n2 - form.lossless, 0) * (form.n2 - 1) // 2
    check_size(problem, order, order * motions, min(free, form.size))
    large = form.size > search.largest and search.passive and not problem.x_points.size
    least = 2 if problem.zero or (large and order > 1) else 1
    unbound = problem.without_points()
    thin = unbound.thinned()
    for n in range(least, order + 1):
        if n not in search.known or n == order:
            search.known[n] = _sized(thin, n, motions, search, large)
    form, theta = _by_all_samples(unbound, order, search, large)
    if large:
        narrow = too_narrow(form, problem, theta)[0].size
        return *form.realise(theta), ("modes of the damping, then L-BFGS"
                                      + f", {narrow} poles narrower than the frequencies resolve" * bool(narrow))
    if not search.passive:
        form, theta = _released(form, thin, theta)
    theta, how = _finished(form, problem, theta)
    fewer = f"; {form.states} states do no worse than {order * motions}" if form.states < order * motions else ""
    return *form.realise(theta), how + fewer


def _by_all_samples(problem: Problem, order: int, search: Search, large: bool) -> tuple[Port, FloatArray]:
    """Return the model that is best at all samples: what more states gain at the fitted ones they may lose between.

    Where samples were left out every order goes on with more of them: which of two is better then, it is not before.
    """
    runs = {n: (form, theta) for n, (_, form, theta) in search.known.items() if n <= order}
    if not large and problem.thinned() is not problem:
        dense = problem.thinned(800, 240)
        runs = {n: (form, minimise(misfit_of(form, dense), theta, search.screened)[0])
                for n, (form, theta) in runs.items()}
    best = min(runs, key=lambda n: (problem.misfit(runs[n][0].states_of(runs[n][1], problem.x)[0]), -n))
    return runs[best]


def _modal(problem: Problem, order: int, motions: int, search: Search) -> tuple[Port, FloatArray]:
    """Return the modes of the damping, each fitted alone, side by side; disturbed a little."""
    K, weight = problem.whole(problem.K), problem.whole(problem.weight)
    U = np.linalg.eigh(K.real.sum(axis=0))[1][:, ::-1][:, :motions]
    parts = []
    for k in range(motions):
        mode = replace(problem.along(U[:, [k]]), x_points=np.zeros(0), K_points=np.zeros((0, 1), dtype=complex),
                       weight=np.sqrt((weight**2 @ U[:, k] ** 2) @ U[:, k] ** 2)[:, None])
        size = float(np.abs(mode.K).max())
        fit = descended(replace(mode, K=mode.K / size), order, True, search.modes.setdefault(k, {}))[0]
        *rest, b = port_of(fit.den, fit.num)
        parts.append((*rest, np.sqrt(size) * b @ U[:, [k]].T))
    e1, e2, G, W = (np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]),
                    block_diag(*[part[2] for part in parts]), np.concatenate([part[3] for part in parts]))
    lossless = min(problem.m, *G.shape) if problem.zero else 0
    if lossless:
        rising = np.argsort(e2, kind="stable")
        e2, G = e2[rising], G[:, rising]
        W = np.linalg.lstsq(G[:, :lossless], W, rcond=1e-6)[0]
    form = Port(G.shape[0], G.shape[1], problem.m, lossless)
    theta = form.pack(e1, e2, G, W)
    return form, theta + 1e-2 * np.random.default_rng([search.seed, order]).normal(size=theta.size)


def _sized(problem: Problem, order: int, motions: int, search: Search, large: bool) -> Run:
    """Return the best model of one order: from its modes, the order below, or what is known."""
    rng = np.random.default_rng([search.seed, order])
    starts = [search.known[order][1:]] if order in search.known else [_modal(problem, order, motions, search)]
    smaller = search.known.get(order - 1)
    if smaller is not None and order not in search.known:
        starts.append(_grown(smaller, motions, problem, rng, 0.1))

    def lowered(form: Port, theta: FloatArray, iterations: int) -> tuple[FloatArray, float]:
        if large:
            return _descend(form, theta, problem, search.descents * iterations // search.iterations)
        return minimise(misfit_of(form, problem), theta, iterations)

    # Large forms are not screened: from the modes they start slowly and often end lowest.
    runs = [(form, *lowered(form, theta, search.iterations if large else search.screened)) for form, theta in starts]
    form, theta, cost = min(runs, key=lambda run: run[2])
    if not large:
        theta, cost = lowered(form, theta, search.iterations)
    if smaller is None or cost <= smaller[0]:
        return cost, form, theta
    # New states that hardly couple: the smaller model itself, and downhill from there.
    form, theta = _grown(smaller, motions, problem, rng, 1e-3)
    theta, cost = lowered(form, theta, search.iterations)
    return (cost, form, theta) if cost <= smaller[0] else (smaller[0], *_grown(smaller, motions, problem, rng, 0.0))


def _grown(smaller: Run, more: int, problem: Problem, rng: np.random.Generator,
           loose: float) -> tuple[Port, FloatArray]:
    """Return a model with `more` states more, resonances coupled to the smaller one with strength `loose`."""
    _, small, theta = smaller
    e1, e2, G, W = small.unpack(theta)
    n1 = min(small.n1 + more, max(small.n1, (small.states + more + 1) // 2))
    n2 = small.states + more - n1
    H = loose * problem.x[-1] * rng.normal(size=(n1, n2))
    H[:small.n1, :small.n2] = G
    top = float(problem.x[-1])
    for k in range(min(n1 - small.n1, n2 - small.n2)):
        H[small.n1 + k, small.n2 + k] = top * np.exp(rng.uniform(np.log(0.08), np.log(0.9)))
    V = loose * rng.normal(size=(small.lossless or n1, small.m))
    V[:W.shape[0]] = W
    form = replace(small, n1=n1, n2=n2)
    return form, form.pack(np.r_[e1, np.full(n1 - small.n1, 0.5)], np.r_[e2, np.full(n2 - small.n2, 0.5)], H, V)


def _descend(form: Port, theta: FloatArray, problem: Problem, steps: int) -> tuple[FloatArray, float]:
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


def _finished(form: Port, problem: Problem, theta: FloatArray, met: float = 1e-9) -> tuple[FloatArray, str]:
    """Return CasADi's answer from this start where it is no worse, and which solver did what.

    SolverError if the frequency points are not met within `met` of the largest |K_ii| by a model without poles far
    beyond the band.
    """
    residual, thin = misfit_of(form, problem, 0.0), problem.thinned()

    def cost(v: FloatArray) -> float:
        missed = np.abs(form.states_of(v, problem.x_points)[0] - problem.K_points).max(initial=0.0)
        fast = problem.x_points.size and np.any(np.abs(v) > (1.0 + 1e-6) * form.largest(problem.fastest))
        if missed > met or fast or (form.signed and _unstable(form, v)):
            return np.inf
        return float(np.sum(residual(v)[0] ** 2))

    starts = [theta]
    if problem.x_points.size:
        rng = np.random.default_rng(0)
        near = [theta * (1.0 + spread * rng.normal(size=theta.size)) for spread in (0.0, 0.1, 0.3)]
        starts = [on_points(form, thin, toward_points(form, thin, start)) for start in near]
    runs = [(start, *finish(form, thin, start)) for start in starts]
    theta, found, status = min(runs, key=lambda run: min(cost(run[0]), cost(run[1])))
    before, new = cost(theta), cost(found)
    if np.isinf(min(before, new)):
        where = ", ".join(f"{x * problem.rate:g}" for x in problem.x_points)
        raise SolverError(f"{', '.join(problem.dofs)}: no passive model with {form.states} states was found that meets "
                          f"K exactly at {where} rad/s with poles below {problem.fastest * problem.rate:.3g} rad/s "
                          f"({status}); raise the order, or check the values' damping")
    first = "Levenberg-Marquardt from the modes" + (" and onto the points" if problem.x_points.size else "")
    if before <= new:
        return theta, f"{first}; IPOPT found no lower cost ({status})"
    return found, f"{first}, then IPOPT ({status}; cost lower by {1.0 - new / max(before, 1e-300):.1e})"


def _unstable(form: Port, theta: FloatArray) -> bool:
    return bool(np.linalg.eigvals(form.realise(theta)[0]).real.max() >= 0.0)


def _released(port: Port, problem: Problem, theta: FloatArray) -> tuple[Port, FloatArray]:
    """Return the free fit from a passive one: D1 and D2 may turn negative as long as all poles stay stable."""
    free, start = port.released(theta)
    misfit = misfit_of(free, problem)

    def residual(theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
        value, jacobian = misfit(theta)
        return (np.full(1, np.inf) if _unstable(free, theta) else value), jacobian

    return free, minimise(residual, start, 300)[0]
