"""Joint fit of a symmetric K(s): passive and reciprocal by construction, poles shared by all entries.

1. Motions that the data do not couple by symmetry (bodies of an array, mirrored) are fitted apart.
2. The modes of the damping are fitted each alone; side by side they are a passive start without couplings between
   them (`radiation_ss.fit.start`).
3. Levenberg-Marquardt frees the couplings, also from the fit with one state less for each motion, so that more states
   are never worse; large forms take L-BFGS, whose gradient costs about as much as the response, and the largest start
   from the modes alone.
4. CasADi states the program with its constraints and finishes it (`radiation_ss.fit.program`), but for large forms.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.fit.port import Port, Start, grown
from radiation_ss.fit.problem import Problem, check_size, independent, own_order, symmetric_parts
from radiation_ss.fit.program import (
    bounded,
    finish,
    minimise,
    misfit_of,
    on_points,
    quasi_newton,
    too_narrow,
    toward_points,
)
from radiation_ss.fit.rational import frequency_response
from radiation_ss.fit.start import modal, sanathanan_koerner

Run = tuple[float, Port, FloatArray]  # cost, form and parameters of what was found
Realised = tuple[FloatArray, FloatArray, str]  # A, B with C = B^T, and how it was solved


@dataclass(frozen=True)
class Search:
    """How a joint fit is searched for."""

    passive: bool = True  # False goes on from the passive model without the sign of the losses
    seed: int = 0  # Of the small disturbance of the starts: couplings that are exactly zero may have no slope
    screened: int = 15  # Iterations after which the best start of a size goes on alone
    iterations: int = 150  # Most iterations of a size
    largest: int = 320  # Parameters of the largest form whose Jacobian is formed
    descents: int = 600  # Most L-BFGS steps of a larger form, in place of `iterations`
    grown: int = 1000  # Parameters of the largest form that is also grown from fits of smaller orders
    # What fits of the same samples found, by order; what is found here is added
    known: dict[int, Run] = field(default_factory=dict)


def fit_joint(problem: Problem, order: int, search: Search) -> tuple[FloatArray, FloatArray, FloatArray, str]:
    """Return (A, B, C, how it was solved) of the best reciprocal model, `order` states a motion; C = B^T if passive."""
    motions, signs = own_order(problem)
    problem = problem.turned(motions, signs)
    parts = symmetric_parts(problem.rounded())
    parts = [(problem if len(parts) == 1 else problem.along(V), V) for _, V in parts]
    if len(parts) == 1:
        a, b, how = _fit_part(problem, order, search)
    else:
        found = [_fit_part(part, order, replace(search, known={})) for part, _ in parts]
        a, b = block_diag(*[f[0] for f in found]), np.vstack([f[1] @ V.T for f, (_, V) in zip(found, parts)])
        how = f"{len(parts)} parts that symmetry decouples: " + "; ".join(dict.fromkeys(f[2] for f in found))
    b = (np.sqrt(problem.rate) * b * problem.scale * signs)[:, np.argsort(motions)]
    return problem.rate * a, b, b.T, how


def order_of(problem: Problem, states: int) -> int:
    """Return the order that so many states are: the most of one motion."""
    return -(-states // sum(independent(part) for part, _ in symmetric_parts(problem)))


def _fit_part(problem: Problem, order: int, search: Search, worse: float = 1.5, share: float = 0.03) -> Realised:
    """Return the fit; of samples continued above the band where it has a resonance there and that costs little error.

    At most a factor `worse` within the band, and a `share` of K: more is asked for by the data, whose A_inf may be off.
    """
    found = _fit_samples(problem, order, search)
    at = _invented(problem, found)
    if not at.size:
        return found
    other = _fit_samples(problem.continued(), order, replace(search, known={}))
    error, new = (np.sqrt(problem.misfit(_upper(model, problem.x))) for model in (found, other))
    where = f"a resonance at {', '.join(f'{x * problem.rate:.3g}' for x in at)} rad/s, above the band"
    if new > min(worse * error, error + share * problem.norm):
        return *found[:2], f"{found[2]}; the data ask for {where}: is A_inf theirs (data.check())?"
    return *other[:2], f"{other[2]}; without {where}"


def _upper(model: Realised, x: FloatArray) -> ComplexArray:
    """Return the upper triangles (nx, p) of K at frequencies."""
    a, b, _ = model
    i, j = np.triu_indices(b.shape[1])
    return frequency_response(a, b, b.T, x)[:, i, j]


def _invented(problem: Problem, found: Realised, light: float = 0.1, higher: float = 1.5) -> FloatArray:
    """Return where lightly damped resonances above the band make K of a motion `higher` than it is within it."""
    poles, own = np.linalg.eigvals(found[0]).astype(complex), np.equal(*np.triu_indices(problem.m))
    x = np.sort(poles.imag[(poles.imag > problem.end) & (-poles.real < light * np.abs(poles))])
    if not x.size or _as_told(problem, found[0].shape[0]).narrowest == 0.0:
        return x[:0]
    return x[(np.abs(_upper(found, x)) > higher * np.abs(problem.K).max(axis=0))[:, own].any(axis=1)]


def _fit_samples(problem: Problem, order: int, search: Search) -> Realised:
    problem, motions = _as_told(problem, order), independent(problem)
    n2 = order * motions // 2
    form = Port(order * motions - n2, n2, problem.m, min(problem.m, n2) if problem.zero else 0)
    # A reciprocal K of so many poles, each with a residue of rank one.
    free = form.states * (form.m + 1) - problem.zero * problem.K.shape[1]
    check_size(problem, order, form.states, min(free, form.size))
    large = form.size > search.largest and search.passive and not problem.x_points.size
    least = 2 if problem.zero or (large and order > 1) else 1
    least = order if large and form.size > search.grown else least
    seen, orders = problem.rounded() if problem.narrowest else problem, range(least, order + 1)
    form, theta = _grown_up(seen.without_points(), orders, motions, search, large)
    if large:
        narrow = too_narrow(form, problem, theta)[0].size
        return *form.realise(theta), ("modes of the damping, then L-BFGS"
                                      + f", {narrow} poles narrower than the frequencies resolve" * bool(narrow))
    starts = [(form, theta)]
    if _too_fast(form, theta, problem):  # fewer states may do better within the band
        starts.append(_grown_up(seen.without_points(), orders, motions, search, large, slow=True))
    if problem.x_points.size:  # the points, as samples of large weight, may lead elsewhere
        starts.append(_grown_up(seen, orders, motions, replace(search, known={}), large))
    form, theta, how = _finished(starts, problem)
    if not search.passive:  # the passive model is one of the free ones
        starts = [form.released(theta), *(_released(*start, problem.thinned()) for start in [*starts, (form, theta)])]
        form, theta, how = _finished(starts, problem)
    fewer = f"; {form.states} states do no worse than {order * motions}" if form.states < order * motions else ""
    return *form.realise(theta), how + fewer + _held(form, theta, problem)


def _as_told(problem: Problem, order: int, exact: float = 1e-6) -> Problem:
    """Return the problem without a bound of resonances where a rational function meets more samples than it must.

    Samples that are those of a system tell its poles, however narrow or far.
    """
    if problem.m > 1:
        return problem
    order = min(order, problem.x.size - 1)
    runs = sanathanan_koerner(problem.x, problem.K[:, 0], problem.weight[:, 0], order, zero=problem.zero)
    told = min(run[0] for run in runs) < exact * problem.norm
    return replace(problem, narrowest=0.0) if told else problem


def _held(form: Port, theta: FloatArray, problem: Problem, near: float = 1.05) -> str:
    """Say at which frequencies resonances would be narrower than the data resolve, were they not held."""
    poles = np.asarray(np.linalg.eigvals(form.realise(theta)[0]), dtype=complex)
    held = np.sort(poles.imag[(-poles.real < near * problem.narrowest) & (poles.imag > 0.0)])
    at = ", ".join(f"{x * problem.rate:.3g}" for x in held)
    return f"; at {at} rad/s as narrow a resonance as the frequencies there resolve" * bool(held.size)


def _too_fast(form: Port, theta: FloatArray, problem: Problem) -> bool:
    """Whether losses or couplings make poles far beyond the band: feedthroughs, which no body has."""
    return bool(np.any(np.abs(theta) > (1.0 + 1e-6) * form.largest(problem.fastest)))


def _slowed(form: Port, theta: FloatArray, problem: Problem) -> FloatArray:
    """Return theta without poles far beyond the band; a state that loses less is driven less, W^2 / D1 as it was."""
    largest = form.largest(problem.fastest)
    new = np.clip(theta, -largest, largest)
    if not form.lossless:
        lost, kept = (np.abs(form.unpack(part)[0]) ** (0.5 if form.signed else 1.0) for part in (theta, new))
        e1, e2, G, W = form.unpack(new)
        new = form.pack(e1, e2, G, W * np.divide(kept, lost, out=np.ones_like(kept), where=lost > 0.0)[:, None])
    return new


def _within_bounds(form: Port, theta: FloatArray, problem: Problem) -> list[Start]:
    """Return a start as it is; without poles far beyond the band, by descents from there and from beyond, if it has."""
    if not _too_fast(form, theta, problem):
        return [(form, theta)]
    near = _slowed(form, theta, problem)
    runs = [minimise(bounded(form, problem), start, 150)[0] for start in (near, theta)]
    return [(form, _slowed(form, run, problem)) for run in (near, *runs)]


def _grown_up(problem: Problem, orders: range, motions: int, search: Search, large: bool, slow: bool = False) -> Start:
    """Return the model that is best at all samples; `slow`: of those without poles far beyond the band, if any."""
    for n in orders:
        if n not in search.known or n == orders[-1]:
            search.known[n] = _sized(problem.thinned(), n, motions, search, large)
    runs = {n: search.known[n][1:] for n in orders}
    if problem.x_points.size:
        return runs[orders[-1]]
    if not large and problem.thinned() is not problem:
        dense = problem.thinned(800, 240)
        runs = {n: (form, minimise(misfit_of(form, dense), theta, search.screened)[0])
                for n, (form, theta) in runs.items()}
    best = min(runs, key=lambda n: (slow and _too_fast(*runs[n], problem),
                                    problem.misfit(runs[n][0].states_of(runs[n][1], problem.x)[0]), -n))
    return runs[best]


def _sized(problem: Problem, order: int, motions: int, search: Search, large: bool) -> Run:
    """Return the best model of one order: from its modes, from smaller orders, or what is known."""
    rng, top = np.random.default_rng([search.seed, order]), problem.end
    smaller = search.known.get(order - 1)
    if order in search.known:
        starts = [search.known[order][1:]]
    else:
        starts = [modal(problem, order, motions, rng)]
        starts += [grown(search.known[n][1:], (order - n) * motions, top, rng, 0.1, second)
                   for n in (order - 1, order - 2) if n in search.known
                   for second in ((False, True) if order * motions % 2 else (False,))]

    def lowered(form: Port, theta: FloatArray, iterations: int) -> Run:
        if large:
            theta, cost = quasi_newton(form, theta, problem, search.descents * iterations // search.iterations)
        else:
            theta, cost = minimise(misfit_of(form, problem), theta, iterations)
        return cost, form, theta

    # Large forms are not screened: from the modes they start slowly and often end lowest.
    runs = [lowered(*start, search.iterations if large else search.screened) for start in starts]
    best = min(runs, key=lambda run: run[0])
    if not large:
        best = lowered(*best[1:], search.iterations)
    if smaller is None or best[0] <= smaller[0]:
        return best
    # New states that hardly couple: the smaller model itself, and downhill from there.
    best = lowered(*grown(smaller[1:], motions, top, rng, 1e-3), search.iterations)
    return best if best[0] <= smaller[0] else (smaller[0], *grown(smaller[1:], motions, top, rng, 0.0))


def _finished(starts: list[Start], problem: Problem, met: float = 1e-9) -> tuple[Port, FloatArray, str]:
    """Return CasADi's answer from the best start where it is no worse, points `met`, and which solver did what."""
    dense = problem.thinned(800, 60)

    def cost(form: Port, v: FloatArray) -> float:
        missed = np.abs(form.states_of(v, problem.x_points)[0] - problem.K_points).max(initial=0.0)
        if missed > met or _too_fast(form, v, problem) or (form.signed and _unstable(form, v)):
            return np.inf
        return float(np.sum(misfit_of(form, problem, 0.0)(v)[0] ** 2))

    if problem.x_points.size:
        rng, thin = np.random.default_rng(0), problem.thinned()
        near = [(form, theta * (1.0 + spread * rng.normal(size=theta.size)))
                for form, theta in starts for spread in (0.0, 0.1, 0.3)]
        near = [(form, on_points(form, thin, toward_points(form, thin, theta))) for form, theta in near]
        starts = sorted([*near, *starts], key=lambda start: cost(*start))[:2]
    starts = [start for form, theta in starts for start in _within_bounds(form, theta, dense)]
    runs = [(form, theta, *finish(form, dense, theta)) for form, theta in starts]
    form, theta, found, status = min(runs, key=lambda run: min(cost(run[0], run[1]), cost(run[0], run[2])))
    before, new = cost(form, theta), cost(form, found)
    if np.isinf(min(before, new)):
        where = ", ".join(f"{x * problem.rate:g}" for x in problem.x_points)
        raise SolverError(f"{', '.join(problem.dofs)}: no passive model with {form.states} states was found that meets "
                          f"K exactly at {where} rad/s with poles below {problem.fastest * problem.rate:.3g} rad/s "
                          f"({status}); raise the order, or check the values' damping")
    first = "Levenberg-Marquardt from the modes" + (" and onto the points" if problem.x_points.size else "")
    if before <= new:
        return form, theta, f"{first}; IPOPT found no lower cost ({status})"
    return form, found, f"{first}, then IPOPT ({status}; cost lower by {1.0 - new / max(before, 1e-300):.1e})"


def _unstable(form: Port, theta: FloatArray) -> bool:
    return bool(np.linalg.eigvals(form.realise(theta)[0]).real.max() >= 0.0)


def _released(port: Port, theta: FloatArray, problem: Problem) -> tuple[Port, FloatArray]:
    """Return the free fit from a passive one: D1 and D2 may turn negative as long as all poles stay stable and near."""
    free, start = port.released(_slowed(port, theta, problem))
    misfit = misfit_of(free, problem)

    def residual(theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
        value, jacobian = misfit(theta)
        left = _unstable(free, theta) or _too_fast(free, theta, problem)
        return (np.full(1, np.inf) if left else value), jacobian

    return free, minimise(residual, start, 300)[0]
