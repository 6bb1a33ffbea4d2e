"""A score test with a prior: what columns would gain beside those of a solved model, many sets of columns at once.

Rows are taken record by record and what a record has for itself is marginalised there, so that nothing of the length of
all rows is made beside the columns themselves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.special import log_ndtr

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.linear_model import Columns, Posterior, Rows, joined, safe
from radiation_ss.inference.own import Own
from radiation_ss.inference.point import Point


@dataclass(frozen=True, eq=False)
class Score:
    """Score and information on sets of as many columns each, in units of their prior: (sets, k), (sets, k, k)."""

    at: tuple[int, ...]  # positions of the sets
    slope: FloatArray
    information: FloatArray


def scores(rows: Rows, columns: Columns, found: Posterior, candidates: Sequence[Columns],
           largest: int = 2_000_000) -> Iterator[Score]:
    """Yield score and information of each set of columns, all of `columns` marginalised.

    As many sets are taken at once as have `largest` numbers in a record.
    """
    W = rows.power / found.variance
    rest, factors = W * found.residual, np.exp(found.sizes.factors)
    change = (columns.relative @ found.mean)[rows.telling]
    point = Point(safe(1.0 - change), found.noise, found.variance, found.residual)
    spans = list(records_of(rows))
    most = largest // max(rows.telling.size, *(span.stop - span.start for span, _ in spans))
    inverses = [None if own is None else marginal_inverse(own, W, factors) for _, own in spans]
    for some in alike([new.count for new in candidates], most):
        k, size = candidates[some[0]].count, len(some) * candidates[some[0]].count
        score, A, cross = np.zeros(size), np.zeros((len(some), k, k)), np.zeros((columns.count, size))
        for (span, own), inverse in zip(spans, inverses):
            X = np.concatenate([candidates[i].values[span] for i in some], axis=1)
            here = np.flatnonzero(np.any(X, axis=0).reshape(-1, k).any(axis=0))  # without what other records have
            at, block = (np.arange(len(some))[:, None] * k + here).ravel(), (slice(None), here[:, None], here)
            X, base = X if here.size == k else X[:, at], columns.values[span]
            if not here.size:
                continue
            heavy = W[span, None] * X
            score[at] += rest[span] @ X
            cross[:, at] += base.T @ heavy
            A[block] += products(X, heavy, here.size)
            if own is not None and inverse is not None:
                G = own.back(heavy, span.start)
                known = inverse @ G
                cross[:, at] -= own.back(W[span, None] * base, span.start).T @ known
                A[block] -= products(G, known, here.size)
        A -= products(cross, found.covariance @ cross, k)
        spread = np.stack([candidates[i].spread for i in some])
        q = joined([candidates[i] for i in some]).relative.tocsr()[rows.telling]
        slope, added = through_impedance(point, rows, q, spread)
        yield Score(tuple(some), score.reshape(spread.shape) * spread + slope,
                    A * spread[:, :, None] * spread[:, None, :] + added)


def records_of(rows: Rows) -> Iterator[tuple[slice, Own | None]]:
    """Yield the rows of each record that has unknowns of its own, and these; all rows where none has."""
    if not rows.own:
        yield slice(0, rows.error.size), None
    for own in rows.own:
        yield slice(own.parts[0][0].start, own.parts[-1][0].stop), own


def marginal_inverse(own: Own, weights: FloatArray, factors: FloatArray) -> FloatArray:
    """Return the covariance of what a record has for itself, everything else known."""
    spread = factors[own.factor] * own.spread
    both = np.outer(spread, spread)
    return np.asarray(np.linalg.inv(own.gram(weights) * both + np.eye(own.count)) * both, dtype=np.float64)


def alike(counts: Sequence[int], most: int) -> Iterator[list[int]]:
    """Yield positions of sets with the same number of columns, together at most `most` columns or one set."""
    for k in sorted(set(counts)):
        at = [i for i, count in enumerate(counts) if count == k]
        step = max(most // max(k, 1), 1)
        yield from (at[first:first + step] for first in range(0, len(at), step))


def products(X: FloatArray, Y: FloatArray, k: int) -> FloatArray:
    """Return each set's own X'Y for columns (rows, sets k), shape (sets, k, k)."""
    if k == 1:
        return np.einsum("ij,ij->j", X, Y)[:, None, None]
    shape = X.shape[0], X.shape[1] // k, k
    return np.asarray(X.reshape(shape).transpose(1, 2, 0) @ Y.reshape(shape).transpose(1, 0, 2))


def through_impedance(point: Point, rows: Rows, q: csr_array, spread: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return slope and Fisher's information of log Jacobian and log variance, of sets of unknowns in units of spread.

    q (terms, sets k) are the relative changes of the impedance; shapes (sets, k) and (sets, k, k). Of the bins of one
    motion in one record few sets change any.
    """
    sets, k = spread.shape
    slope, fisher, information = np.zeros((sets, k)), np.zeros((sets, k, k)), np.zeros((sets, k, k))
    (change, pull, stiff), count, all_weights = point.pulls(rows), rows.fine.shape[1], rows.weight[rows.telling]
    for span in rows.spans:
        fine = slice(span.start * count, span.stop * count)
        reached = np.unique(q[fine].indices // k)
        if reached.size == 0:
            continue
        at = (reached[:, None] * k + np.arange(k)).ravel()
        s, weight = point.s[fine, None], all_weights[fine]
        scaled = q[fine][:, at].toarray() * spread[reached].ravel() / s
        real, imaginary = np.ascontiguousarray(scaled.real), np.ascontiguousarray(scaled.imag)
        moved = -2.0 * (np.abs(s) ** 2 * real).reshape(-1, count, at.size).mean(axis=1) / change[span, None]
        slope[reached] += (pull[span] @ moved - weight @ real).reshape(-1, k)
        fisher[reached] += products(real, weight[:, None] * real, k)
        fisher[reached] -= products(imaginary, weight[:, None] * imaginary, k)
        information[reached] += products(moved, stiff[span, None] * moved, k)
    values, vectors = np.linalg.eigh(fisher)
    return slope, information + (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)


def gains(rows: Rows, columns: Columns, found: Posterior, candidates: Sequence[Columns]) -> FloatArray:
    """Return the log Bayes factor of each set of columns added, at the sizes of `found`."""
    result = np.empty(len(candidates))
    for score in scores(rows, columns, found, candidates):
        lower = np.stack([candidates[i].lower / candidates[i].spread for i in score.at])
        result[list(score.at)] = log_factors(score, lower)
    return result


def log_factors(score: Score, lower: FloatArray) -> FloatArray:
    """Return the log Bayes factors of sets of columns above their physical bounds."""
    b, P = score.slope, score.information + np.eye(score.slope.shape[1])
    inverse = np.linalg.inv(P)
    mean = np.einsum("sij,sj->si", inverse, b)
    # Of records without noise round-off may make a variance negative.
    deviation = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 1e-300))
    within = log_ndtr((mean - lower) / deviation) - log_ndtr(-lower)
    return np.asarray(0.5 * np.sum(mean * b, axis=1) - 0.5 * np.linalg.slogdet(P)[1] + within.sum(axis=1))
