"""What a fit chooses: samples that count less, points that K can be met at, and the order, by held-out frequencies."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, read_only
from radiation_ss.errors import InputError, SolverError
from radiation_ss.fit.causal import not_causal, scales, together, wrong_values
from radiation_ss.fit.problem import Problem, joint_error, symmetric
from radiation_ss.fit.rational import Realisation, frequency_response
from radiation_ss.hydro.band_end import beyond_band
from radiation_ss.hydro.data import HydroData


@dataclass(frozen=True)
class Trial:
    """One order of the path: states of the model and relative errors on the frequencies fitted and held out."""

    order: int
    states: int
    error: float
    held_out: float


def choose_order(problem: Problem, quick: Callable[[Problem, int], Realisation],
                 full: Callable[[Problem, int], Realisation], floor: int = 6, good: float = 1e-3,
                 ) -> tuple[int, tuple[Trial, ...]]:
    """Return the order chosen on held-out frequencies, and the path.

    An order below `floor` is taken only where the fit to all samples is no worse than that of `floor`, or its relative
    error is at most `good`. `quick`, `full`: fits a problem with an order: on the path of orders, and for the
    comparison with `floor`.
    """
    # Every third of 24 bands of consecutive frequencies is held out. Bands and not single samples: a resonance that an
    # order too high puts between the fitted samples shows.
    out = np.arange(problem.x.size) * min(24, problem.x.size) // problem.x.size % 3 == 1
    training = replace(problem, x=problem.x[~out], K=problem.K[~out], weight=problem.weight[~out])

    def errors(part: Realisation, *sides: Any) -> list[float]:
        K = frequency_response(*part, problem.x * problem.rate) / np.outer(problem.scale, problem.scale)
        miss = problem.weight * (K[:, *np.triu_indices(problem.m)] - problem.K)
        size = problem.weight * problem.K
        return [float(np.linalg.norm(miss[side]) / np.linalg.norm(size[side])) for side in sides]

    def trial(order: int) -> Trial:
        part = quick(training, order)
        return Trial(order, part[0].shape[0], *errors(part, ~out, out))

    fewest = max(2 if problem.zero else 1, problem.x_points.size + 1 if problem.x_points.size else 1)
    orders = [order for order in ((2, 3, 4, 5, 6, 8, 10) if problem.m == 1 else (2, 3, 4, 6, 8))
              if fewest <= order <= problem.x.size]
    chosen, path = _walk(trial, orders)
    floor = max(floor, fewest)
    if chosen < floor <= problem.x.size:
        everything = slice(None)
        limit = max(good, *errors(full(problem, floor), everything))
        chosen = next(order for order in (*(n for n in orders if chosen <= n < floor), floor)
                      if order == floor or errors(full(problem, order), everything)[0] <= limit)
    return chosen, path


def _walk(trial: Callable[[int], Trial], orders: Sequence[int], good: float = 0.01,
          near: float = 1.25) -> tuple[int, tuple[Trial, ...]]:
    """Try orders upwards; return the one chosen and the path.

    Chosen is the smallest order whose held-out error is at most `near` times the smallest of the path, or at most
    `good`; the path ends there, or two orders after the last that improved by a twentieth.
    """
    path: list[Trial] = []
    failure = "no order was tried"
    for order in orders:
        try:
            path.append(trial(order))
        except SolverError as error:
            failure = str(error)
            continue
        best = min(t.held_out for t in path)
        if best <= good or (len(path) > 2 and min(t.held_out for t in path[-2:]) > 0.95 * min(
                t.held_out for t in path[:-2])):
            break
    if not path:
        raise SolverError(f"no order could be fitted: {failure}")
    limit = max(near * min(t.held_out for t in path), good)
    return next(t.order for t in path if t.held_out <= limit), tuple(path)


@dataclass(frozen=True)
class Suspect:
    """One sample that was weighted down."""

    kind: str  # "spike" (irregular frequency, wrong value), "not causal" (what else breaks Kramers-Kronig), or
    # "negative damping"
    # force, velocity: Degrees of freedom of the entry
    force: str
    velocity: str
    omega: float  # Frequency [rad/s]
    size: float  # What breaks Kramers-Kronig, or the negative damping, relative to the largest |K| of the entry's rows

    def __str__(self) -> str:
        return f"{self.kind} of {self.force}, {self.velocity} at {self.omega:.4g} rad/s ({self.size:.1%})"


def suspects_of(data: HydroData, weight: FloatArray, less: float = 0.5) -> tuple[Suspect, ...]:
    """Return the samples of K that count `less` by their weights (nw, n, n) and are spikes, not causal, or negative."""
    off, spike = np.maximum(not_causal(data), beginning(data)), wrong_values(data) > 0.0
    lacking, found = negative(data), list[Suspect]()
    for i, j in combinations_with_replacement(range(data.n), 2):
        for k in np.flatnonzero(weight[:, i, j] < less):
            low = lacking[k, i] if i == j else 0.0
            kinds = {"spike" if spike[k, i] or spike[k, j] else "not causal": off[k, i, j], "negative damping": low}
            found += [Suspect(kind, data.dofs[i], data.dofs[j], float(data.omega[k]), float(size))
                      for kind, size in kinds.items() if size > 0.0]
    return tuple(sorted(found, key=lambda s: (s.omega, s.force, s.velocity)))


def beginning(data: HydroData) -> FloatArray:
    """Return the part of |K| that a resonance just above the band makes, over s_i s_j, (nw, n, n): of rank one."""
    size = scales(data) ** 2
    parts = np.stack([beyond_band(data.omega, data.K[:, i, i] / size[i])[1] for i in range(data.n)], axis=1)
    return np.asarray(np.sqrt(parts[:, :, None] * parts[:, None, :]))


def negative(data: HydroData, rounding: float = 1e-3) -> FloatArray:
    """Return by how much each B_ii is below zero, over s_i^2, (nw, n); 0 up to `rounding`."""
    low = np.maximum(-np.einsum("wii->wi", data.B) / scales(data) ** 2, 0.0)
    return np.asarray(np.where(low > rounding, low, 0.0))


def weights_of(data: HydroData, tolerated: float = 0.03, least: float = 0.03, few: float = 0.25) -> FloatArray:
    """Return weights of the squared misfits, shape (nw, n, n): 1, and less for what no causal, reciprocal body has.

    A sample that is off by z has 1 / (1 + (z / `tolerated`)^2). It is off by what breaks Kramers-Kronig, and samples in
    a row that do so share one error. A coupling is off by half of what it differs from its transpose: damping that a
    passive model must have to follow it would be put on the motions themselves. Negative damping is off by its size and
    has `least` at least, so that what is round-off keeps its say in the added mass. Where less than `few` of the energy
    of a motion's own samples would be left, or more than `few` of its damping is negative, they are no outliers but the
    data, and count in full, without spikes.
    """
    skew = 0.5 * np.abs(data.K - np.swapaxes(data.K, 1, 2)) / np.outer(scales(data), scales(data))
    wrong, calm = np.maximum(not_causal(data), beginning(data)), wrong_values(data) == 0.0
    weight = 1.0 / (1.0 + (skew**2 + together(wrong > tolerated) * wrong**2) / tolerated**2)
    for i, low in enumerate(negative(data).T):
        own, energy = weight[:, i, i], np.abs(data.K[:, i, i]) ** 2 * calm[:, i]
        if own @ energy < few * energy.sum():
            weight[:, i, i] = own = np.where(calm[:, i], 1.0, own)
        if np.count_nonzero(low) <= few * low.size:
            shared = np.where(low > 0.0, np.maximum(1.0 / (1.0 + (low / tolerated) ** 2), least), 1.0)
            weight[:, i, i] = np.minimum(own, shared)
    return weight


def nearest_possible(data: HydroData) -> ComplexArray:
    """Return the reciprocal K without negative damping nearest to each sample, scaled by `scales`; silent motions 0."""
    pairs = np.outer(scales(data), scales(data))
    K = symmetric(data) / pairs
    values, vectors = np.linalg.eigh(K.real)
    lifted = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray((lifted + 1j * K.imag) * np.where(np.isinf(pairs), 0.0, pairs))


def left_out(data: HydroData, weight: FloatArray, error: float, suspects: Sequence[Suspect]) -> Iterator[str]:
    """Say which motions have no states, which hardly count, and of what error more than half is in the data."""
    if silent := [dof for dof, scale in zip(data.dofs, scales(data)) if np.isinf(scale)]:
        yield f"{', '.join(silent)}: no radiation but numerical noise; left out of the model and its error"
    own = Counter(dof for dof, _ in {(s.force, s.omega) for s in suspects if s.force == s.velocity})
    if wrong := [dof for dof in data.dofs if own[dof] > 0.5 * data.omega.size]:
        yield (f"{', '.join(wrong)}: more than half of the samples break Kramers-Kronig or have negative damping, and "
               "count less (see data.check())")
    least = joint_error(data, nearest_possible(data), weight)
    if least > 0.5 * error:
        yield (f"of the error {error:.2g} the data themselves hold {least:.2g}: K_ij and K_ji differ, or damping is "
               "negative, which no reciprocal and passive model has (see data.check())")


def points_within(points: ArrayLike | None, data: HydroData) -> FloatArray:
    """Return the frequency points, checked."""
    if isinstance(points, Mapping):
        raise InputError("points: frequencies, as [7.0], are needed; K is met there as the data have it")
    wanted = np.unique(read_only(np.atleast_1d([] if points is None else points), "points", (None,)))
    if (outside := ~((wanted >= data.omega[0]) & (wanted <= data.omega[-1]))).any():
        raise InputError(f"points: {wanted[outside][0]:g} rad/s lies outside the data "
                         f"({data.omega[0]:g} to {data.omega[-1]:g} rad/s)")
    return wanted


def notes_on_points(data: HydroData, points: FloatArray) -> list[str]:
    """Return notes on points between the data's frequencies, and where K of the data is not symmetric."""
    between = [w for w in points if not np.isclose(data.omega, w, rtol=1e-9, atol=0.0).any()]
    said = [f"points: {', '.join(f'{w:g}' for w in between)} rad/s lie between the frequencies of the data; K is "
            "interpolated there by a cubic, and met as that has it"] if between else []
    at = np.array([np.abs(data.omega - w).argmin() for w in points], dtype=int)
    K = data.K[at]
    half, mean = np.abs(K - np.swapaxes(K, 1, 2)) / 2.0, np.abs(K + np.swapaxes(K, 1, 2)) / 2.0
    share = np.divide(half, mean, out=np.zeros(half.shape), where=half > 1e-9 * mean.max(initial=0.0))
    if not share.any():
        return said
    _, i, j = np.unravel_index(share.argmax(), share.shape)
    return [*said, f"points: K of the data is not symmetric there, {data.dofs[i]}-{data.dofs[j]} by up to "
                   f"{share.max():.1%} of its mean with the transpose; the mean of both is what is met"]
