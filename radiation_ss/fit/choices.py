"""What a fit chooses: samples that count less, points that K can be met at, and the order, by held-out frequencies."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, lagrange, read_only
from radiation_ss.errors import InputError, SolverError
from radiation_ss.fit.problem import Problem, joint_error, scales, symmetric
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

    kind: str  # "spike" (irregular frequency, reading error), "negative damping" or "resonance above the band"
    # force, velocity: Degrees of freedom of the entry
    force: str
    velocity: str
    omega: float  # Frequency [rad/s]
    # Distance from the neighbours, or the negative damping, relative to the largest |K| of the entry's rows
    size: float

    def __str__(self) -> str:
        return f"{self.kind} of {self.force}, {self.velocity} at {self.omega:.4g} rad/s ({self.size:.1%})"


def suspects_of(data: HydroData, negative: float = 1e-3) -> tuple[Suspect, ...]:
    """Return the suspicious samples of B and w (A - A_inf).

    Spikes are those of `_spikes` in the diagonal entries; in the couplings only where a diagonal entry has one too
    (irregular frequencies) or where K_ij and K_ji differ by half of it (reading errors): couplings of far bodies swing
    faster than the frequencies are sampled. Negative damping is B_ii below -`negative` of its maximum. The part of a
    resonance just above the band is that of `beyond_band`; its residues, and so the couplings' parts, have rank one.
    """
    K = data.K / np.outer(scales(data), scales(data))
    own = [_spikes(data.omega, K[:, i, i]) for i in range(data.n)]
    found = []
    for i, j in combinations_with_replacement(range(data.n), 2):
        apart = own[i]
        if i != j:
            apart = np.maximum(*(_spikes(data.omega, entry) for entry in (K[:, i, j], K[:, j, i])))
            apart = apart * ((own[i] + own[j] > 0.0) | (np.abs(K[:, i, j] - K[:, j, i]) > 0.5 * apart))
        found += [Suspect("spike", data.dofs[i], data.dofs[j], float(data.omega[k]), float(apart[k]))
                  for k in np.flatnonzero(apart)]
    for i in range(data.n):
        damping = K[:, i, i].real
        found += [Suspect("negative damping", data.dofs[i], data.dofs[i], float(data.omega[k]), float(-damping[k]))
                  for k in np.flatnonzero(damping < -negative)]
    parts = [beyond_band(data.omega, K[:, i, i])[1] for i in range(data.n)]
    for i, j in combinations_with_replacement(range(data.n), 2):
        part = np.sqrt(parts[i] * parts[j])
        found += [Suspect("resonance above the band", data.dofs[i], data.dofs[j], float(data.omega[k]), float(part[k]))
                  for k in np.flatnonzero(part)]
    return tuple(sorted(found, key=lambda s: (s.omega, s.force, s.velocity)))


def above_band(data: HydroData, suspects: tuple[Suspect, ...]) -> Iterator[str]:
    """Say for which motions the beginning of a resonance above the band is weighted down."""
    first: dict[str, float] = {}
    for suspect in suspects:
        if suspect.kind == "resonance above the band" and suspect.force == suspect.velocity:
            first.setdefault(suspect.force, suspect.omega)
    for dof, omega in first.items():
        yield (f"{dof}: towards {data.omega[-1]:.3g} rad/s K rises as to a resonance just above the band, as of an "
               f"irregular frequency; samples from {omega:.3g} rad/s on count less, the more it has of them")


def weights_of(data: HydroData, suspects: tuple[Suspect, ...], least: float = 0.03, tolerated: float = 0.03,
               few: float = 0.2) -> FloatArray:
    """Return weights of the squared misfits, shape (nw, n, n): 1, and less for what is suspicious or not symmetric.

    A sample that is off by z has 1 / (1 + (z / `tolerated`)^2), and a coupling is off by half of what it differs from
    its transpose: damping that a passive model must have to follow it would be put on the motions themselves. But a
    spike has at most `least`, so that the largest does not rule the fit, and negative damping at least `least`: what is
    round-off keeps its say in the added mass. Where more than `few` of an entry's samples are such they are no outliers
    but the data, and count in full. The samples of a resonance above the band share its error: together they count
    as one.
    """
    skew = 0.5 * np.abs(data.K - np.swapaxes(data.K, 1, 2)) / np.outer(scales(data), scales(data))
    weight = 1.0 / (1.0 + (skew / tolerated) ** 2)
    limits = {"spike": (0.0, least), "negative damping": (least, 1.0)}
    counts = Counter((suspect.kind in limits, suspect.force, suspect.velocity) for suspect in suspects)
    for suspect in suspects:
        alone = suspect.kind in limits
        count = counts[alone, suspect.force, suspect.velocity]
        if alone and count > few * data.omega.size:
            continue
        i, j = data.dofs.index(suspect.force), data.dofs.index(suspect.velocity)
        share = 1.0 / (1.0 + (1 if alone else count) * (suspect.size / tolerated) ** 2)
        share = np.clip(share, *limits.get(suspect.kind, (0.0, 1.0)))
        k = int(np.searchsorted(data.omega, suspect.omega))
        weight[k, [i, j], [j, i]] = min(float(share), float(weight[k, i, j]))
    return weight


def nearest_possible(data: HydroData) -> ComplexArray:
    """Return the reciprocal K without negative damping nearest to each sample, scaled by `scales`; silent motions 0."""
    pairs = np.outer(scales(data), scales(data))
    K = symmetric(data) / pairs
    values, vectors = np.linalg.eigh(K.real)
    lifted = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray((lifted + 1j * K.imag) * np.where(np.isinf(pairs), 0.0, pairs))


def left_out(data: HydroData, weight: FloatArray, error: float) -> Iterator[str]:
    """Say which motions have no states, and of what error more than half is in the data."""
    if silent := [dof for dof, scale in zip(data.dofs, scales(data)) if np.isinf(scale)]:
        yield f"{', '.join(silent)}: no radiation but numerical noise; left out of the model and its error"
    least = joint_error(data, nearest_possible(data), weight)
    if least > 0.5 * error:
        yield (f"of the error {error:.2g} the data themselves hold {least:.2g}: K_ij and K_ji differ, or damping is "
               "negative, which no reciprocal and passive model has (see data.check())")


def _spikes(omega: FloatArray, K: ComplexArray, reach: int = 4, deviations: float = 6.0,
            floor: float = 0.02, step: float = 0.8) -> FloatArray:
    """Return how far each sample lies off the line through its neighbours where that is a spike, else 0.

    A spike is off by `deviations` robust standard deviations (Hampel's test over `reach` neighbours on each side, so
    that slopes and peaks pass) and by `floor` of the largest value, in the real or the imaginary part; and no
    neighbour is off by more than `step` of it.
    """
    apart = np.zeros(omega.size)
    if omega.size < 2 * reach + 1:
        return apart
    share = (omega[1:-1] - omega[:-2]) / (omega[2:] - omega[:-2])
    for values in (K.real, K.imag):
        off = np.zeros(values.size)
        off[1:-1] = values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(off, reach, mode="reflect"), 2 * reach + 1)
        deviation = 1.4826 * np.median(np.abs(windows - np.median(windows, axis=1, keepdims=True)), axis=1)
        # The line through the neighbours of a spike is off by half the spike on both sides: keep the largest only.
        # At a step two neighbours are off by as much, to opposite sides; that is no spike.
        largest = np.abs(windows).argmax(axis=1) == reach
        beside = np.maximum(np.abs(windows[:, reach - 1]), np.abs(windows[:, reach + 1]))
        spike = largest & (np.abs(off) > deviations * deviation) & (np.abs(off) > floor)
        spike &= beside < step * np.abs(off)
        apart = np.maximum(apart, np.where(spike, np.abs(off), 0.0))
    for k in np.flatnonzero(apart):
        _add_flanks(apart, omega, K, int(k), deviations, floor)
    return apart


def _add_flanks(apart: FloatArray, omega: FloatArray, K: ComplexArray, spike: int, deviations: float,
                floor: float, narrow: float = 0.5) -> None:
    """Add to `apart` the samples next to a spike that belong to it: an irregular frequency decays as 1 / |w - w0|.

    They are off the cubic through two samples on either side of what is taken out by `floor`, and by `deviations`
    robust standard deviations of what is as wide nearby. At a distance d a resonance of damping rate a has the shape
    1 / (a + i d). One with a > `narrow` d is resolved by the samples, as that of a moonpool may be, and is kept.
    """
    for h in range(1, (omega.size - 4) // 2):
        centres = np.arange(max(spike - 3 * (h + 2), h + 2), min(spike + 3 * (h + 2), omega.size - h - 3) + 1)
        if spike not in centres:
            return
        edges, outside = (centres[:, None] + np.array(steps) for steps in ([-h, h], [-h - 2, -h - 1, h + 1, h + 2]))
        off = np.stack([K[edge] - np.einsum("kj,kj->k", lagrange(omega[outside], omega[edge]), K[outside])
                        for edge in edges.T], axis=1)
        least, at = max(floor, deviations * 1.4826 * float(np.median(np.abs(off)))), off[centres == spike][0]
        own = np.where((np.abs(at) > least) & (np.abs(at.real) < narrow * np.abs(at.imag)), np.abs(at), 0.0)
        if not own.any():
            return
        apart[[spike - h, spike + h]] = np.maximum(apart[[spike - h, spike + h]], own)


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
