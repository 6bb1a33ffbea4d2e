"""Rows and columns of a Gaussian linear model, the sizes that it learns, and the unknowns that it finds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, hstack
from scipy.special import log_ndtr

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.inference.own import Arrow, Own
from radiation_ss.inference.stored import Beside, Values


@dataclass(frozen=True, eq=False)
class Rows:
    """The equation error and what is known of its noise."""

    error: FloatArray  # (N,)
    noise: FloatArray  # (N,): Variance by the sensors
    scale: FloatArray  # (N,): Size of the model's own forces around each row: the unexplained force is a share of it
    steady: FloatArray  # (N,): The same over the whole record
    group: np.ndarray  # (N,) int: Which of the shares applies
    sensor: np.ndarray  # (N,) int: Which factor of the noise applies
    # share, ambient (groups,): Prior medians of the unexplained force's shares of `scale` and of `steady`
    share: FloatArray
    ambient: FloatArray
    power: FloatArray  # (N,): Power to which the likelihood of each row is taken
    weight: FloatArray  # (J,): Weight of each term of the log determinant of the data's Jacobian
    # (kinds, k) int: Terms of the Jacobian in one bin: the sensors' noise reaches the error through the same impedance
    fine: np.ndarray
    kind: np.ndarray  # (N,) int: Which of these bins a row is in; `kinds` where the impedance does not matter
    # Rows of one motion in one record each, which few of the unknowns reach; empty: all rows are one part
    parts: tuple[slice, ...] = ()
    spectra: int = 0  # How many of the last groups are an exciting force's that nothing is known of
    own: tuple[Own, ...] = ()  # Unknowns that one record has for itself, in every model of the rows

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
    """Unknowns that the error is linear in."""

    values: FloatArray | Values  # (N, K): Error for each unit of the unknowns
    spread: FloatArray  # (K,): Prior standard deviations; the prior mean is 0
    lower: FloatArray  # (K,): What an unknown is at least, by physics: 0 or less; -inf where nothing is known
    factor: np.ndarray  # (K,) int: Which common factor applies, as in `Own`
    relative: csc_array  # (J, K): Relative change of the data's impedance for each unit

    def __add__(self, other: "Columns") -> "Columns":
        return joined([self, other])

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.spread.size


def joined(parts: Sequence[Columns]) -> Columns:
    """Return the columns of all parts side by side; their values are not copied."""
    spread, lower, factor = (np.concatenate([getattr(part, f) for part in parts])
                              for f in ("spread", "lower", "factor"))
    relative = hstack([csc_array(part.relative) for part in parts], format="csc")
    return Columns(Beside([part.values for part in parts]), spread, lower, factor, relative)


@dataclass(frozen=True, eq=False)
class Sizes:
    """Logarithms of learned sizes: unexplained shares, factors of noise, tolerances, offsets, starts, coherence."""

    share: FloatArray
    ambient: FloatArray
    noise: FloatArray
    tolerance: float
    offset: float = 0.0
    before: float = 0.0
    coherent: float = 0.0

    @property
    def vector(self) -> FloatArray:
        """All of them in one array."""
        return np.concatenate([self.share, self.ambient, self.noise, self.factors[1:]])

    @property
    def factors(self) -> FloatArray:
        """Logarithms of the common factors of spreads, shape (5,), in the order that `Own` has."""
        return np.array([0.0, self.tolerance, self.offset, self.before, self.coherent])

    @classmethod
    def of(cls, vector: FloatArray, groups: int) -> "Sizes":
        """Take an array apart."""
        return cls(vector[:groups], vector[groups:2 * groups], vector[2 * groups:-4], *vector[-4:].tolist())


@dataclass(frozen=True)
class SizePrior:
    """Standard deviations of the logarithms of the learned sizes."""

    # share, ambient, noise, tolerance, offset, before, coherent: Of the unexplained shares (with the motion, and
    # steady), of the noise's standard deviation, of the common factors of the tolerances, of the records' own offsets,
    # of the radiation that decays begin with, and of coherent and wandering errors; the last three are at most as large
    # as stated
    share: float = 1.0
    ambient: float = 1.5
    noise: float = 0.7
    tolerance: float = 0.55
    offset: float = 1.5
    before: float = 3.0
    coherent: float = 1.5
    # What the tolerances' common factor is at most: what the user states holds but for this factor; at least it is 1
    largest: float = 3.0
    # What the factor of coherent and wandering errors is at least: no law of the library holds more exactly
    exact: float = 0.2
    spectrum: float = 5.0  # Of the logarithm of an unknown exciting force's size at one frequency


@dataclass(frozen=True, eq=False)
class Posterior:
    """Unknowns given the error."""

    mean: FloatArray  # (K,)
    covariance: FloatArray  # (K, K)
    sizes: Sizes
    log_evidence: float
    residual: FloatArray = field(repr=False)  # (N,)
    variance: FloatArray = field(repr=False)  # (N,): Of noise and unexplained force together
    noise: FloatArray = field(repr=False)  # (N,): Variance by the sensors alone
    # own_mean, own_std (sum of counts,): Means and standard deviations of what each record has for itself
    own_mean: FloatArray = field(repr=False)
    own_std: FloatArray = field(repr=False)
    arrow: Arrow | None = field(default=None, repr=False)  # Information on all standardised unknowns

    @property
    def std(self) -> FloatArray:
        """Standard deviations of the unknowns, shape (K,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of a least-squares fit: cost, information and right side, and what they are made of.

    Of each record: weighted errors (rows,), their derivatives (rows, some unknowns) and these unknowns' positions.
    """

    cost: float
    information: FloatArray
    slope: FloatArray
    errors: list[FloatArray]
    parts: list[tuple[FloatArray, np.ndarray]]


def variance(rows: Rows, sizes: Sizes, change: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the variance of noise and of the two kinds of unexplained force in each row.

    `change` is the squared relative change of the impedance in each bin, shape (kinds,); none if absent.
    """
    noise = rows.noise * np.exp(2 * sizes.noise)[rows.sensor]
    if change is not None:
        noise = noise * np.append(change, 1.0)[rows.kind]
    return (noise, (np.exp(sizes.share)[rows.group] * rows.scale) ** 2,
            (np.exp(sizes.ambient)[rows.group] * rows.steady) ** 2)


def spreads(rows: Rows, columns: Columns, sizes: Sizes, stretch: FloatArray | float = 1.0) -> FloatArray:
    """Return prior standard deviations of all unknowns, the records' own last.

    `stretch` multiplies each further.
    """
    spread = np.concatenate([columns.spread, *(own.spread for own in rows.own)])
    return np.asarray(np.exp(sizes.factors)[factor_of(rows, columns)] * spread * stretch)


def safe(values: ComplexArray) -> ComplexArray:
    """Keep away from zero what is a divisor."""
    return np.where(np.abs(values) < 1e-3, 1e-3, values)


def factor_of(rows: Rows, columns: Columns) -> np.ndarray:
    """Return which common factor applies to each unknown, as in `Own`."""
    return np.concatenate([columns.factor, *(own.factor for own in rows.own)])


def log_allowed(found: Posterior, columns: Columns, near: float = 6.0) -> float:
    """Return the log of the posterior probability of what is above the physical bounds over that of the prior.

    A bound further off than `near` posterior standard deviations takes nothing away.
    """
    deviation = np.maximum(np.sqrt(np.maximum(np.diag(found.covariance), 0.0)), 1e-150)
    above = (found.mean - columns.lower) / deviation
    limited = np.flatnonzero(above < near)
    total = -float(log_ndtr(-columns.lower / columns.spread).sum())
    if limited.size < 2:
        return total + float(log_ndtr(above[limited]).sum())
    from scipy.stats import multivariate_normal

    C = found.covariance[np.ix_(limited, limited)] / deviation[limited, None] / deviation[limited]
    chance = multivariate_normal(np.zeros(limited.size), C, allow_singular=True, seed=0).cdf(above[limited])
    return total + float(np.log(chance) if chance > 1e-8 else log_ndtr(above[limited]).sum())


def bounded_step(matrix: FloatArray, slope: FloatArray, q: FloatArray,
                 inside: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the point at which a quadratic of this matrix and negative slope at q is lowest within bounds.

    `inside` brings a point within its bounds. What meets one stays there, and the rest is lowest beside it.
    """
    step, free = np.zeros(q.size), np.ones(q.size, dtype=bool)
    while True:
        right = slope[free] - matrix[np.ix_(free, ~free)] @ step[~free]
        step[free] = np.linalg.solve(matrix[np.ix_(free, free)], right)
        point = inside(q + step)
        met = free & (np.abs(point - q - step) > 1e-9 * (1.0 + np.abs(step)))
        if not met.any():
            return point
        free, step = free & ~met, point - q
