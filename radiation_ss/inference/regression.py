"""Gaussian linear model of an equation error: learned sizes, limits of sign, the Jacobian of the data, evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.inference.own import Arrow, Marginal, Own, Packed


@dataclass(frozen=True, eq=False)
class Rows:
    """The equation error and what is known of its noise.

    Parameters
    ----------
    error : ndarray, shape (N,)
    noise : ndarray, shape (N,)
        Variance by the sensors.
    scale : ndarray, shape (N,)
        Size of the model's own forces around each row: the unexplained force is a share of it.
    steady : ndarray, shape (N,)
        The same over the whole record.
    group : ndarray of int, shape (N,)
        Which of the shares applies.
    sensor : ndarray of int, shape (N,)
        Which factor of the noise applies.
    share, ambient : ndarray, shape (groups,)
        Prior medians of the unexplained force's shares of `scale` and of `steady`.
    power : ndarray, shape (N,)
        Power to which the likelihood of each row is taken.
    weight : ndarray, shape (J,)
        Weight of each term of the log determinant of the data's Jacobian.
    fine : ndarray of int, shape (kinds, k)
        Terms of the Jacobian in one bin: the sensors' noise reaches the error through the same impedance.
    kind : ndarray of int, shape (N,)
        Which of these bins a row is in; `kinds` where the impedance does not matter.
    parts : tuple of slice
        Rows of one motion in one record each, which few of the unknowns reach; empty: all rows are one part.
    spectra : int
        How many of the last groups are an exciting force's that nothing is known of.
    own : tuple of Own
        Unknowns that one record has for itself, in every model of the rows.
    """

    error: FloatArray
    noise: FloatArray
    scale: FloatArray
    steady: FloatArray
    group: np.ndarray
    sensor: np.ndarray
    share: FloatArray
    ambient: FloatArray
    power: FloatArray
    weight: FloatArray
    fine: np.ndarray
    kind: np.ndarray
    parts: tuple[slice, ...] = ()
    spectra: int = 0
    own: tuple[Own, ...] = ()

    @cached_property
    def telling(self) -> np.ndarray:
        """Positions of the terms of the Jacobian that count, those of one bin after the other."""
        return np.asarray(self.fine).ravel()

    def averaged(self, values: FloatArray) -> FloatArray:
        """Return the mean of `telling` values in each bin."""
        return np.asarray(values.reshape(*self.fine.shape, *values.shape[1:]).mean(axis=1))

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Bins of each part of the rows that has any."""
        kinds, found = self.fine.shape[0], []
        for part in self.parts or (slice(0, self.error.size),):
            kind = self.kind[part]
            if np.any(kind < kinds):
                found.append(slice(int(kind.min()), int(kind[kind < kinds].max()) + 1))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class Columns:
    """Unknowns that the error is linear in.

    Parameters
    ----------
    values : ndarray, shape (N, K)
        Error for each unit of the unknowns.
    spread : ndarray, shape (K,)
        Prior standard deviations; the prior mean is 0.
    positive : ndarray of bool, shape (K,)
    learned : ndarray of bool, shape (K,)
        Whether the common scale of the stated tolerances applies.
    relative : ndarray, shape (J, K)
        Relative change of the data's impedance for each unit.
    """

    values: FloatArray
    spread: FloatArray
    positive: np.ndarray
    learned: np.ndarray
    relative: ComplexArray

    def __add__(self, other: Columns) -> Columns:
        return joined([self, other])

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.spread.size

    @cached_property
    def curved(self) -> np.ndarray:
        """Which unknowns change the Jacobian."""
        return np.any(self.relative, axis=0)


def joined(parts: Sequence[Columns]) -> Columns:
    """Return the columns of all parts side by side."""
    return Columns(*(np.concatenate([getattr(part, f) for part in parts], axis=-1) for f in
                     ("values", "spread", "positive", "learned", "relative")))


@dataclass(frozen=True, eq=False)
class Sizes:
    """Learned sizes: shares of unexplained force, factors of the noise, scale of the tolerances (all logarithms)."""

    share: FloatArray
    ambient: FloatArray
    noise: FloatArray
    tolerance: float

    @property
    def vector(self) -> FloatArray:
        """All of them in one array."""
        return np.concatenate([self.share, self.ambient, self.noise, [self.tolerance]])

    @classmethod
    def of(cls, vector: FloatArray, groups: int) -> Sizes:
        """Take an array apart."""
        return cls(vector[:groups], vector[groups:2 * groups], vector[2 * groups:-1], float(vector[-1]))


@dataclass(frozen=True)
class SizePrior:
    """Standard deviations of the logarithms of the learned sizes.

    Parameters
    ----------
    share, ambient, noise, tolerance : float
        Of the unexplained shares (with the motion, and steady), of the noise's standard deviation, of the tolerances'
        common factor.
    largest : float
        What the tolerances' common factor is at most: what the user states holds but for this factor; at least it is 1.
    cut : float
        Prior standard deviations beyond which a strength is impossible.
    spectrum : float
        Of the logarithm of an unknown exciting force's size at one frequency.
    """

    share: float = 1.0
    ambient: float = 1.5
    noise: float = 0.7
    tolerance: float = 0.55
    largest: float = 3.0
    cut: float = 4.0
    spectrum: float = 5.0


@dataclass(frozen=True, eq=False)
class Posterior:
    """Unknowns given the error.

    Parameters
    ----------
    mean : ndarray, shape (K,)
    covariance : ndarray, shape (K, K)
    sizes : Sizes
    log_evidence : float
    residual : ndarray, shape (N,)
    variance : ndarray, shape (N,)
        Of noise and unexplained force together.
    noise : ndarray, shape (N,)
        Variance by the sensors alone.
    own_mean, own_std : ndarray, shape (sum of counts,)
        Means and standard deviations of what each record has for itself.
    arrow : Arrow, optional
        Information on all standardised unknowns.
    """

    mean: FloatArray
    covariance: FloatArray
    sizes: Sizes
    log_evidence: float
    residual: FloatArray = field(repr=False)
    variance: FloatArray = field(repr=False)
    noise: FloatArray = field(repr=False)
    own_mean: FloatArray = field(repr=False)
    own_std: FloatArray = field(repr=False)
    arrow: Arrow | None = field(default=None, repr=False)


def variance(rows: Rows, sizes: Sizes, change: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the variance of noise and of the two kinds of unexplained force in each row.

    `change` is the squared relative change of the impedance in each bin, shape (kinds,); none if absent.
    """
    noise = rows.noise * np.exp(2 * sizes.noise)[rows.sensor]
    if change is not None:
        noise = noise * np.append(change, 1.0)[rows.kind]
    return (noise, (np.exp(sizes.share)[rows.group] * rows.scale) ** 2,
            (np.exp(sizes.ambient)[rows.group] * rows.steady) ** 2)


def spreads(rows: Rows, columns: Columns, tolerance: float) -> FloatArray:
    """Return prior standard deviations of all unknowns, the records' own last, for a logarithm of the tolerances."""
    spread = np.concatenate([columns.spread, *(own.spread for own in rows.own)])
    return np.asarray(np.where(learned_of(rows, columns), np.exp(tolerance), 1.0) * spread)


def learned_of(rows: Rows, columns: Columns) -> np.ndarray:
    """Return which of all unknowns the common scale of the stated tolerances applies to."""
    return np.concatenate([columns.learned, *(own.learned for own in rows.own)])


def solve(rows: Rows, columns: Columns, sizes: Sizes, iterations: int = 12, start: FloatArray | None = None,
          packed: Packed | None = None, accuracy: float = 1e-3) -> Posterior:
    """Return the Laplace approximation at given sizes, climbing from the unknowns `start`, the records' own last.

    The unknowns change the impedance, and with it the Jacobian of the data and what the sensors' noise does to the
    error. Newton's method with Fisher's information of both; a step is halved until it climbs. Without a start it is
    zero or the least squares' solution with the model's numbers as they are, whichever is higher: between them the
    impedance may vanish somewhere, as that of a body which only its mooring restores. It ends where less than
    `accuracy` of log likelihood is to be gained.
    """
    spread, n = spreads(rows, columns, sizes.tolerance), columns.count
    packed, curved = packed or Packed(rows.parts, columns.values, rows.own), np.flatnonzero(columns.curved)
    q = columns.relative[np.ix_(rows.telling, curved)] * spread[curved]

    def at(beta: FloatArray) -> Point:
        point = Point.at(rows, sizes, q @ beta[curved], rows.error - packed.times(spread * beta))
        return replace(point, height=point.height - 0.5 * float(beta @ beta))

    def curvature(point: Point, beta: FloatArray) -> tuple[Arrow, FloatArray]:
        W = rows.power / point.variance
        head, sides, blocks = packed.information(W, spread)
        slope = spread * packed.back(W * point.residual) - beta
        gradient, added = point.impedance_terms(rows, q)
        head[np.ix_(curved, curved)] += added
        slope[curved] += gradient
        return Arrow.of(head, sides, blocks), slope

    beta = np.zeros(spread.size) if start is None else start / spread
    point = at(beta)
    if start is None:
        W, free = rows.power / point.variance, np.where(learned_of(rows, columns), 0.0, spread)
        flat = Arrow.of(*packed.information(W, free)).solve(free * packed.back(W * rows.error))
        point, beta = max((point, beta), (at(flat), flat), key=lambda pair: pair[0].height)
    for _ in range(iterations):
        arrow, slope = curvature(point, beta)
        step = arrow.solve(slope)
        if slope @ step < accuracy:  # twice what is still to be gained
            break
        higher = next(((p, b) for b in (beta + step * 0.5**k for k in range(8)) if (p := at(b)).height > point.height),
                      None)
        if higher is None:
            break
        point, beta = higher
    else:
        arrow, _ = curvature(point, beta)
    covariance = np.asarray(np.linalg.inv(arrow.schur), dtype=np.float64)
    own_std = np.sqrt(np.maximum(packed.variances(covariance, arrow)[n:], 0.0)) * spread[n:]
    return Posterior((beta * spread)[:n], covariance * np.outer(spread[:n], spread[:n]), sizes,
                     float(point.height - 0.5 * arrow.log_determinant), point.residual, point.variance, point.noise,
                     (beta * spread)[n:], own_std, arrow)


@dataclass(frozen=True, eq=False)
class Point:
    """The error at one value of the unknowns: relative impedance s where it counts, noise, all variance, residual."""

    s: ComplexArray
    noise: FloatArray
    variance: FloatArray
    residual: FloatArray
    height: float = 0.0
    _pulls: list[tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=list, repr=False)

    @classmethod
    def at(cls, rows: Rows, sizes: Sizes, change: ComplexArray, residual: FloatArray) -> Point:
        """Return the point of some unknowns that change the impedance by 1 - `change`; its height is log likelihood."""
        s = safe(1.0 - change)
        noise, unexplained, ambient = variance(rows, sizes, rows.averaged(np.abs(s) ** 2))
        v = noise + unexplained + ambient
        height = -0.5 * float(np.sum(rows.power * (np.log(2 * np.pi * v) + residual**2 / v)))
        height += float(np.sum(rows.weight[rows.telling] * np.log(np.abs(s))))
        return cls(s, noise, v, residual, height)

    def pulls(self, rows: Rows) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return each bin's change of the impedance, and slope and curvature of the log likelihood by its logarithm."""
        if not self._pulls:
            kinds, share = rows.fine.shape[0], rows.power * self.noise / self.variance
            pulling = -0.5 * share * (1.0 - self.residual**2 / self.variance)
            slope, curve = (np.asarray(np.bincount(rows.kind, w, kinds + 1), dtype=np.float64)
                            for w in (pulling, 0.5 * share * self.noise / self.variance))
            change = np.maximum(rows.averaged(np.abs(self.s) ** 2), 1e-12)
            self._pulls.append((change, slope[:kinds], curve[:kinds]))
        return self._pulls[0]

    def impedance_terms(self, rows: Rows, q: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Return gradient and information of log Jacobian and log variance by unknowns with relative changes q."""
        count, size = rows.fine.shape[1], q.shape[1]
        gradient, fisher, added = np.zeros(size), np.zeros((size, size)), np.zeros((size, size))
        change, pull, stiff = self.pulls(rows)
        for span in rows.spans:
            fine = slice(span.start * count, span.stop * count)
            at = np.flatnonzero(np.any(q[fine], axis=0))
            if not at.size:
                continue
            s, weight = self.s[fine, None], rows.weight[rows.telling[fine]]
            scaled, square = q[fine][:, at] / s, np.ix_(at, at)
            real, imaginary = scaled.real, scaled.imag
            fisher[square] += real.T @ (weight[:, None] * real) - imaginary.T @ (weight[:, None] * imaginary)
            slope = -2.0 * (np.abs(s) ** 2 * real).reshape(-1, count, at.size).mean(axis=1) / change[span, None]
            gradient[at] += slope.T @ pull[span] - weight @ real
            added[square] += slope.T @ (stiff[span, None] * slope)
        values, vectors = np.linalg.eigh(0.5 * (fisher + fisher.T))
        return gradient, (vectors * np.maximum(values, 0.0)) @ vectors.T + added

    def single_terms(self, rows: Rows, q: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Return the same for unknowns each by itself: gradient and information of each, shape (k,)."""
        if not np.any(q):
            return np.zeros(q.shape[1]), np.zeros(q.shape[1])
        (change, pull, stiff), count = self.pulls(rows), rows.fine.shape[1]
        at = np.flatnonzero(np.any(q, axis=1).reshape(-1, count).any(axis=1))  # bins that are reached
        fine = (at[:, None] * count + np.arange(count)).ravel()
        s, weight = self.s[fine, None], rows.weight[rows.telling[fine]]
        scaled = q[fine] / s
        slope = -2.0 * (np.abs(s) ** 2 * scaled.real).reshape(at.size, count, -1).mean(axis=1) / change[at, None]
        fisher = weight @ (scaled.real**2 - scaled.imag**2)
        return (np.asarray(pull[at] @ slope - weight @ scaled.real),
                np.asarray(np.maximum(fisher, 0.0) + stiff[at] @ slope**2))


def safe(values: ComplexArray) -> ComplexArray:
    """Keep away from zero what is a divisor."""
    return np.where(np.abs(values) < 1e-3, 1e-3, values)


def learn(rows: Rows, columns: Columns, start: Sizes, prior: SizePrior | None = None, steps: int = 15,
          accuracy: float = 0.03) -> Posterior:
    """Return the posterior at the most probable sizes, its evidence with their prior and with limits of sign.

    The sizes are climbed to by at most `steps` steps, until one gains less than about `accuracy` of log evidence; with
    no step they stay.
    """
    prior = prior or SizePrior()
    groups = rows.share.size
    centre = np.concatenate([np.log(rows.share), np.log(rows.ambient), np.zeros(start.noise.size), [0.0]])
    known = groups - rows.spectra
    width = np.concatenate([np.full(known, prior.share), np.full(rows.spectra, prior.spectrum),
                            np.full(groups, prior.ambient),
                            np.full(start.noise.size, prior.noise), [prior.tolerance]])

    means: list[FloatArray | None] = [None]
    packed = Packed(rows.parts, columns.values, rows.own)

    def negative(x: FloatArray) -> tuple[float, FloatArray]:
        found = solve(rows, columns, Sizes.of(x, groups), start=means[0], packed=packed)
        means[0] = np.concatenate([found.mean, found.own_mean])
        slope = size_gradient(rows, columns, found, packed) - (x - centre) / width**2
        return -(found.log_evidence - 0.5 * np.sum(((x - centre) / width) ** 2)), -slope

    bounds = [(c - 5 * w, c + 5 * w) for c, w in zip(centre[:-1], width[:-1])] + [(0.0, np.log(prior.largest))]
    x = start.vector if steps == 0 else minimize(
        negative, start.vector, jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxiter": steps, "ftol": accuracy / max(rows.error.size, 1)}).x
    found = solve(rows, columns, Sizes.of(x, groups), start=means[0], packed=packed)
    value = found.log_evidence - 0.5 * np.sum(((x - centre) / width) ** 2) + log_allowed(
        rows, found, columns, prior.cut)
    return replace(found, log_evidence=float(value), arrow=None)


def size_gradient(rows: Rows, columns: Columns, found: Posterior, packed: Packed | None = None) -> FloatArray:
    """Return the derivative of the log evidence by the logarithms of the sizes, the curvature's own left out."""
    _, unexplained, ambient = variance(rows, found.sizes)
    noise, v = found.noise, found.variance
    assert found.arrow is not None
    packed = packed or Packed(rows.parts, columns.values, rows.own)
    spread, n = spreads(rows, columns, found.sizes.tolerance), columns.count
    covariance = found.covariance / np.outer(spread[:n], spread[:n])
    explained = packed.explained(covariance, found.arrow, spread)
    slope = rows.power * ((found.residual**2 + explained) / v - 1.0) / v
    share = np.bincount(rows.group, slope * unexplained, rows.share.size)
    steady = np.bincount(rows.group, slope * ambient, rows.share.size)
    sensor = np.bincount(rows.sensor, slope * noise, found.sizes.noise.size)
    learned, mean = learned_of(rows, columns), np.concatenate([found.mean, found.own_mean])
    variances = np.concatenate([np.diag(found.covariance), found.own_std**2])
    second = (mean[learned] ** 2 + variances[learned]) / spread[learned] ** 2
    return np.concatenate([share, steady, sensor, [np.sum(second - 1.0)]])


def log_allowed(rows: Rows, found: Posterior, columns: Columns, cut: float) -> float:
    """Return the log of the posterior probability of the allowed region over that of the prior.

    Allowed are positive values where only those make sense, and values within `cut` prior standard deviations.
    """
    limited = np.flatnonzero(columns.positive)
    total = 0.0
    if limited.size:
        deviation = np.sqrt(np.diag(found.covariance)[limited])
        if limited.size == 1:
            total += float(log_ndtr(found.mean[limited[0]] / deviation[0]))
        else:
            from scipy.stats import multivariate_normal

            C = found.covariance[np.ix_(limited, limited)] / np.outer(deviation, deviation)
            chance = multivariate_normal(np.zeros(limited.size), C, allow_singular=True, seed=0).cdf(
                found.mean[limited] / deviation)
            lower = float(log_ndtr(found.mean[limited] / deviation).sum())
            total += float(np.log(chance)) if chance > 1e-8 else lower
        total += limited.size * np.log(2.0)
    ranged = np.flatnonzero(~learned_of(rows, columns))
    spread = np.concatenate([columns.spread, *(own.spread for own in rows.own)])[ranged]
    mean = np.concatenate([found.mean, found.own_mean])[ranged]
    std = np.concatenate([np.sqrt(np.maximum(np.diag(found.covariance), 0.0)), found.own_std])[ranged]
    return total + float(log_ndtr((cut * spread - np.abs(mean)) / np.maximum(std, 1e-150)).sum())


def gains(rows: Rows, columns: Columns, found: Posterior, candidates: Sequence[Columns],
          cut: float = SizePrior.cut, largest: int = 4_000_000) -> FloatArray:
    """Return the log Bayes factor of each set of columns added, at the sizes of `found`: a score test with a prior.

    As many sets are taken at once as have `largest` numbers together, 64 at most.
    """
    W = rows.power / found.variance
    beside = Marginal(rows.own, W, float(np.exp(found.sizes.tolerance)))
    rest, weighted = W * found.residual, beside.times(columns.values)
    point = Point(safe(1.0 - columns.relative[rows.telling] @ found.mean), found.noise, found.variance, found.residual)
    result, chunk = np.empty(len(candidates)), int(np.clip(largest // rows.error.size, 1, 64))
    for first in range(0, len(candidates), chunk):
        some = candidates[first:first + chunk]
        X, ends = np.concatenate([new.values for new in some], axis=1), np.cumsum([0] + [new.count for new in some])
        q = np.concatenate([new.relative[rows.telling] for new in some], axis=1)
        cross, score = weighted.T @ X, X.T @ rest
        known, heavy = found.covariance @ cross, beside.times(X)
        gradient, own = point.single_terms(rows, q)
        for k, (new, i, j) in enumerate(zip(some, ends[:-1], ends[1:])):
            A = X[:, i:j].T @ heavy[:, i:j] - cross[:, i:j].T @ known[:, i:j]
            b = score[i:j] + gradient[i:j]
            A += np.diag(own[i:j]) if j - i == 1 else point.impedance_terms(rows, q[:, i:j])[1]
            result[first + k] = log_factor(A, b, new, cut)
    return result


def log_factor(A: FloatArray, b: FloatArray, new: Columns, cut: float) -> float:
    """Return the log Bayes factor of columns whose information is A and score b, within their limits."""
    s = new.spread
    P = A * np.outer(s, s) + np.eye(s.size)
    mean, deviation = np.linalg.solve(P, s * b), np.sqrt(np.diag(np.linalg.inv(P)))
    value = 0.5 * mean @ (s * b) - 0.5 * np.linalg.slogdet(P)[1]
    value += np.sum(np.where(new.positive, log_ndtr(mean / deviation) + np.log(2.0), 0.0))
    return float(value + log_ndtr((cut - np.abs(mean)) / deviation).sum())
