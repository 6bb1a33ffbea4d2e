"""Gaussian linear model of an equation error: learned sizes, limits of sign, the Jacobian of the data, evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr

from radiation_ss.arrays import ComplexArray, FloatArray


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

    @cached_property
    def telling(self) -> np.ndarray:
        """Positions of the terms of the Jacobian that count."""
        return np.flatnonzero(self.weight)

    @cached_property
    def averaging(self) -> Any:
        """Sparse matrix that takes the mean of `telling` terms in each bin."""
        from scipy.sparse import csr_array

        place = np.zeros(self.weight.size, dtype=int)
        place[self.telling] = np.arange(self.telling.size)
        kinds, k = self.fine.shape
        return csr_array((np.full(kinds * k, 1.0 / max(k, 1)), place[self.fine].ravel(),
                          k * np.arange(kinds + 1)), shape=(kinds, self.telling.size))


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
        return Columns(*(np.concatenate([getattr(self, f), getattr(other, f)], axis=-1) for f in
                         ("values", "spread", "positive", "learned", "relative")))

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.spread.size

    @cached_property
    def curved(self) -> np.ndarray:
        """Which unknowns change the Jacobian."""
        return np.any(self.relative, axis=0)


@dataclass(frozen=True, eq=False)
class Packed:
    """Columns without their zeros: rows, positions of the unknowns that reach them, and values of each part."""

    parts: tuple[tuple[slice, np.ndarray, FloatArray], ...]
    shape: tuple[int, int]

    @classmethod
    def of(cls, rows: Rows, columns: Columns) -> Packed:
        """Pack the columns by the parts of the rows."""
        found = []
        for part in rows.parts or (slice(0, rows.error.size),):
            at = np.flatnonzero(np.any(columns.values[part], axis=0))
            found.append((part, at, np.ascontiguousarray(columns.values[part][:, at])))
        return cls(tuple(found), columns.values.shape)

    def gram(self, weights: FloatArray) -> FloatArray:
        """Return values.T diag(weights) values."""
        found = np.zeros((self.shape[1], self.shape[1]))
        for part, at, values in self.parts:
            found[np.ix_(at, at)] += values.T @ (weights[part, None] * values)
        return found

    def times(self, unknowns: FloatArray) -> FloatArray:
        """Return values @ unknowns."""
        found = np.zeros(self.shape[0])
        for part, at, values in self.parts:
            found[part] = values @ unknowns[at]
        return found

    def back(self, error: FloatArray) -> FloatArray:
        """Return values.T @ error."""
        found = np.zeros(self.shape[1])
        for part, at, values in self.parts:
            found[at] += values.T @ error[part]
        return found

    def spread_of(self, covariance: FloatArray) -> FloatArray:
        """Return the diagonal of values covariance values.T."""
        found = np.zeros(self.shape[0])
        for part, at, values in self.parts:
            found[part] = np.sum((values @ covariance[np.ix_(at, at)]) * values, axis=1)
        return found


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
        common factor (between 1 and two of its deviations: what the user states holds but for a factor of three).
    """

    share: float = 1.0
    ambient: float = 1.5
    noise: float = 0.7
    tolerance: float = 0.55


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
    """

    mean: FloatArray
    covariance: FloatArray
    sizes: Sizes
    log_evidence: float
    residual: FloatArray = field(repr=False)
    variance: FloatArray = field(repr=False)
    noise: FloatArray = field(repr=False)


def variance(rows: Rows, sizes: Sizes, change: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the variance of noise and of the two kinds of unexplained force in each row.

    `change` is the squared relative change of the impedance in each bin, shape (kinds,); none if absent.
    """
    noise = rows.noise * np.exp(2 * sizes.noise)[rows.sensor]
    if change is not None:
        noise = noise * np.append(change, 1.0)[rows.kind]
    return (noise, (np.exp(sizes.share)[rows.group] * rows.scale) ** 2,
            (np.exp(sizes.ambient)[rows.group] * rows.steady) ** 2)


def solve(rows: Rows, columns: Columns, sizes: Sizes, iterations: int = 12, start: FloatArray | None = None,
          packed: Packed | None = None, accuracy: float = 1e-3) -> Posterior:
    """Return the Laplace approximation at given sizes, climbing from the unknowns `start`.

    The unknowns change the impedance, and with it the Jacobian of the data and what the sensors' noise does to the
    error. Newton's method with Fisher's information of both; a step is halved until it climbs. Without a start it is
    zero or the least squares' solution, whichever is higher: between them the impedance may vanish somewhere, as that
    of a body which only its mooring restores. It ends where less than `accuracy` of log likelihood is to be gained.
    """
    spread = np.where(columns.learned, np.exp(sizes.tolerance), 1.0) * columns.spread
    packed, curved = packed or Packed.of(rows, columns), np.flatnonzero(columns.curved)
    q = columns.relative[np.ix_(rows.telling, curved)] * spread[curved]

    def at(beta: FloatArray) -> Point:
        point = Point.at(rows, sizes, q @ beta[curved], rows.error - packed.times(spread * beta))
        return replace(point, height=point.height - 0.5 * float(beta @ beta))

    def curvature(point: Point, beta: FloatArray) -> tuple[FloatArray, FloatArray]:
        W = rows.power / point.variance
        H = packed.gram(W) * np.outer(spread, spread) + np.eye(beta.size)
        slope = spread * packed.back(W * point.residual) - beta
        gradient, added = point.impedance_terms(rows, q)
        H[np.ix_(curved, curved)] += added
        slope[curved] += gradient
        return H, slope

    beta = np.zeros(columns.count) if start is None else start / spread
    point = at(beta)
    if start is None:
        W = rows.power / point.variance
        flat = np.linalg.solve(packed.gram(W) * np.outer(spread, spread) + np.eye(beta.size),
                               spread * packed.back(W * rows.error))
        point, beta = max((point, beta), (at(flat), flat), key=lambda pair: pair[0].height)
    for _ in range(iterations):
        H, slope = curvature(point, beta)
        step = np.linalg.solve(H, slope)
        if slope @ step < accuracy:  # twice what is still to be gained
            break
        higher = next(((p, b) for b in (beta + step * 0.5**k for k in range(8)) if (p := at(b)).height > point.height),
                      None)
        if higher is None:
            break
        point, beta = higher
    else:
        H, _ = curvature(point, beta)
    covariance = np.linalg.inv(H)
    return Posterior(beta * spread, covariance * np.outer(spread, spread), sizes,
                     float(point.height - 0.5 * np.linalg.slogdet(H)[1]), point.residual, point.variance, point.noise)


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
        noise, unexplained, ambient = variance(rows, sizes, rows.averaging @ np.abs(s) ** 2)
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
            change = np.maximum(rows.averaging @ np.abs(self.s) ** 2, 1e-12)
            self._pulls.append((change, slope[:kinds], curve[:kinds]))
        return self._pulls[0]

    def impedance_terms(self, rows: Rows, q: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Return gradient and information of log Jacobian and log variance by unknowns with relative changes q."""
        scaled = q / self.s[:, None]
        weight, real, imaginary = rows.weight[rows.telling], scaled.real, scaled.imag
        fisher = real.T @ (weight[:, None] * real) - imaginary.T @ (weight[:, None] * imaginary)
        values, vectors = np.linalg.eigh(0.5 * (fisher + fisher.T))
        information = (vectors * np.maximum(values, 0.0)) @ vectors.T
        slope = -2.0 * (rows.averaging @ (np.abs(self.s[:, None]) ** 2 * real))
        change, pull, stiff = self.pulls(rows)
        relative = slope / change[:, None]
        return (-(weight @ real) + relative.T @ pull,
                information + relative.T @ (stiff[:, None] * relative))


def safe(values: ComplexArray) -> ComplexArray:
    """Keep away from zero what is a divisor."""
    return np.where(np.abs(values) < 1e-3, 1e-3, values)


def learn(rows: Rows, columns: Columns, start: Sizes, prior: SizePrior | None = None, steps: int = 15,
          accuracy: float = 0.03) -> Posterior:
    """Return the posterior at the most probable sizes, its evidence with their prior and with limits of sign.

    The sizes are climbed to by at most `steps` steps, until one gains less than about `accuracy` of log evidence.
    """
    prior = prior or SizePrior()
    groups = rows.share.size
    centre = np.concatenate([np.log(rows.share), np.log(rows.ambient), np.zeros(start.noise.size), [0.0]])
    width = np.concatenate([np.full(groups, prior.share), np.full(groups, prior.ambient),
                            np.full(start.noise.size, prior.noise), [prior.tolerance]])

    means: list[FloatArray | None] = [None]
    packed = Packed.of(rows, columns)

    def negative(x: FloatArray) -> tuple[float, FloatArray]:
        found = solve(rows, columns, Sizes.of(x, groups), start=means[0], packed=packed)
        means[0] = found.mean
        slope = size_gradient(rows, columns, found, packed) - (x - centre) / width**2
        return -(found.log_evidence - 0.5 * np.sum(((x - centre) / width) ** 2)), -slope

    bounds = [(c - 5 * w, c + 5 * w) for c, w in zip(centre[:-1], width[:-1])] + [(0.0, 2 * prior.tolerance)]
    best = minimize(negative, start.vector, jac=True, method="L-BFGS-B", bounds=bounds,
                    options={"maxiter": steps, "ftol": accuracy / max(rows.error.size, 1)})
    found = solve(rows, columns, Sizes.of(best.x, groups), start=means[0], packed=packed)
    value = found.log_evidence - 0.5 * np.sum(((best.x - centre) / width) ** 2) + log_allowed(found, columns)
    return Posterior(found.mean, found.covariance, found.sizes, float(value), found.residual, found.variance,
                     found.noise)


def size_gradient(rows: Rows, columns: Columns, found: Posterior, packed: Packed | None = None) -> FloatArray:
    """Return the derivative of the log evidence by the logarithms of the sizes, the curvature's own left out."""
    _, unexplained, ambient = variance(rows, found.sizes)
    noise, v = found.noise, found.variance
    explained = (packed or Packed.of(rows, columns)).spread_of(found.covariance)
    slope = rows.power * ((found.residual**2 + explained) / v - 1.0) / v
    share = np.bincount(rows.group, slope * unexplained, rows.share.size)
    steady = np.bincount(rows.group, slope * ambient, rows.share.size)
    sensor = np.bincount(rows.sensor, slope * noise, found.sizes.noise.size)
    spread = columns.spread[columns.learned] * np.exp(found.sizes.tolerance)
    second = found.mean[columns.learned] ** 2 + np.diag(found.covariance)[columns.learned]
    return np.concatenate([share, steady, sensor, [np.sum(second / spread**2 - 1.0)]])


def log_allowed(found: Posterior, columns: Columns, far: float = 4.0) -> float:
    """Return the log of the posterior probability of the allowed region over that of the prior.

    Allowed are positive values where only those make sense, and values within `far` prior standard deviations.
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
    ranged = np.flatnonzero(~columns.learned)
    deviation = np.sqrt(np.maximum(np.diag(found.covariance)[ranged], 1e-300))
    beyond = (far * columns.spread[ranged] - np.abs(found.mean[ranged])) / deviation
    return total + float(log_ndtr(beyond).sum())


def gains(rows: Rows, columns: Columns, found: Posterior, candidates: Sequence[Columns]) -> FloatArray:
    """Return the log Bayes factor of each set of columns added, at the sizes of `found`: a score test with a prior."""
    W = rows.power / found.variance
    U = columns.values
    rest, weighted = W * found.residual, W[:, None] * U
    point = Point(safe(1.0 - columns.relative[rows.telling] @ found.mean), found.noise, found.variance, found.residual)
    result = np.empty(len(candidates))
    for k, new in enumerate(candidates):
        X = new.values
        cross = weighted.T @ X
        A = X.T @ (W[:, None] * X) - cross.T @ found.covariance @ cross
        b = X.T @ rest
        if np.any(new.relative):
            gradient, added = point.impedance_terms(rows, new.relative[rows.telling])
            b, A = b + gradient, A + added
        s = new.spread
        P = A * np.outer(s, s) + np.eye(s.size)
        mean = np.linalg.solve(P, s * b)
        value = 0.5 * mean @ (s * b) - 0.5 * np.linalg.slogdet(P)[1]
        deviation = np.sqrt(np.diag(np.linalg.inv(P)))
        value += np.sum(np.where(new.positive, log_ndtr(mean / deviation) + np.log(2.0), 0.0))
        value += float(log_ndtr((4.0 - np.abs(mean)) / deviation).sum())
        result[k] = value
    return result
