"""Unknowns that one record has for itself, eliminated record by record: cost and memory grow linearly with records.

The information matrix has an arrow's shape: what all records share is its head, and what each record has for itself is
a block that meets the head alone. The blocks are eliminated first (Schur's complement), so nothing of the size of all
unknowns squared is ever made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.stored import Values

TOLERANCE, OFFSET, BEFORE, COHERENT = 1, 2, 3, 4  # common factors of spreads, all learned


@dataclass(frozen=True, eq=False)
class Own:
    """Unknowns of one record that the error is linear in; they leave the Jacobian of the data as it is."""

    # Rows of one motion, positions of the unknowns that reach them, and their
    # values, shape (rows, positions)
    parts: tuple[tuple[slice, np.ndarray, FloatArray], ...]
    spread: FloatArray  # (k,): Prior standard deviations; the prior mean is 0
    # (k,) int: Which common factor applies: 0 none, or `TOLERANCE` of the stated tolerances, `OFFSET` of the offsets,
    # `BEFORE` of what decays began with, or `COHERENT` of errors that go with the motion by no known law
    factor: np.ndarray
    labels: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.spread.size

    def times(self, unknowns: FloatArray, out: FloatArray, weights: FloatArray | None = None) -> None:
        """Add what unknowns of shape (k, ...) make to rows, in place; weights, shape (N, ...), multiply it."""
        for rows, at, values in self.parts:
            out[rows] += values @ unknowns[at] * (1.0 if weights is None else weights[rows])

    def back(self, error: FloatArray, first: int = 0) -> FloatArray:
        """Return values.T @ error for errors of rows from `first` on, shape (rows, ...); shape (k, ...)."""
        found = np.zeros((self.count, *error.shape[1:]))
        for rows, at, values in self.parts:
            found[at] += values.T @ error[rows.start - first:rows.stop - first]
        return found

    def gram(self, weights: FloatArray) -> FloatArray:
        """Return values.T diag(weights) values."""
        found = np.zeros((self.count, self.count))
        for rows, at, values in self.parts:
            found[np.ix_(at, at)] += values.T @ (weights[rows, None] * values)
        return found


@dataclass(frozen=True, eq=False)
class OwnBlock:
    """One record's block of an arrow matrix: its inverse, the head's positions that it meets, inverse times side."""

    inverse: FloatArray
    at: np.ndarray
    carry: FloatArray
    log_determinant: float

    @classmethod
    def of(cls, matrix: FloatArray, side: FloatArray) -> "OwnBlock":
        """Take a block of shape (k, k) and its side of shape (head, k)."""
        at = np.flatnonzero(np.any(side, axis=1))
        lower, failed = dpotrf(matrix, lower=True)
        if failed or not matrix.size:  # not positive but for round-off
            inverse, log_determinant = np.linalg.inv(matrix), np.linalg.slogdet(matrix)[1]
        else:
            half, log_determinant = dpotri(lower, lower=True)[0], 2.0 * np.sum(np.log(np.diag(lower)))
            inverse = half + half.T  # above the diagonal half is zero
            inverse.flat[::len(matrix) + 1] *= 0.5
        return cls(np.asarray(inverse, dtype=np.float64), at, inverse @ side[at].T, float(log_determinant))


@dataclass(frozen=True, eq=False)
class Arrow:
    """A positive matrix of an arrow's shape: Schur's complement of the blocks in the head, and the blocks."""

    schur: FloatArray
    blocks: tuple[OwnBlock, ...]

    @classmethod
    def of(cls, head: FloatArray, sides: Sequence[FloatArray], matrices: Sequence[FloatArray]) -> "Arrow":
        """Eliminate the blocks."""
        schur, blocks = head.copy(), tuple(OwnBlock.of(m, s) for m, s in zip(matrices, sides))
        for block, side in zip(blocks, sides):
            schur[np.ix_(block.at, block.at)] -= side[block.at] @ block.carry
        return cls(0.5 * (schur + schur.T), blocks)

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant."""
        return float(np.linalg.slogdet(self.schur)[1]) + sum(block.log_determinant for block in self.blocks)

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution for a right side that lists the head, then the blocks."""
        n = self.schur.shape[0]
        head, tails = right[:n].copy(), []
        ends = n + np.cumsum([0] + [block.inverse.shape[0] for block in self.blocks])
        for block, i, j in zip(self.blocks, ends[:-1], ends[1:]):
            head[block.at] -= block.carry.T @ right[i:j]
        found = np.linalg.solve(self.schur, head)
        for block, i, j in zip(self.blocks, ends[:-1], ends[1:]):
            tails.append(block.inverse @ right[i:j] - block.carry @ found[block.at])
        return np.concatenate([found, *tails])


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of one motion in one record and the values of the unknowns that reach them, shape (rows, k).

    `at` are their positions among all unknowns; `square` those of their pairs in a matrix of the shared unknowns and of
    the record's, the `owner`.
    """

    rows: slice
    owner: int
    at: np.ndarray
    square: tuple[np.ndarray, ...]
    values: FloatArray


class Packed:
    """All unknowns without their zeros, as pieces: the shared ones first, then those of each record.

    `parts`: rows of one motion in one record each. `shared` (N, K).
    """

    def __init__(self, parts: Sequence[slice], shared: FloatArray | Values, own: Sequence[Own]) -> None:
        self.rows, self.count = shared.shape
        owned = {rows.start: (r, at, values) for r, part in enumerate(own) for rows, at, values in part.parts}
        self.starts = self.count + np.cumsum([0] + ([part.count for part in own] or [0]))
        self.pieces: list[Piece] = []
        for rows in parts or (slice(0, self.rows),):
            whole = shared[rows]
            at = np.flatnonzero(np.any(whole, axis=0))
            r, mine, values = owned.get(rows.start, (0, np.zeros(0, int), np.zeros((rows.stop - rows.start, 0))))
            local = np.concatenate([at, self.count + mine])
            self.pieces.append(Piece(rows, r, np.concatenate([at, self.starts[r] + mine]), np.ix_(local, local),
                                     np.concatenate([whole[:, at], values], axis=1)))

    def times(self, unknowns: FloatArray) -> FloatArray:
        """Return values @ unknowns."""
        found = np.zeros(self.rows)
        for piece in self.pieces:
            found[piece.rows] = piece.values @ unknowns[piece.at]
        return found

    def back(self, error: FloatArray) -> FloatArray:
        """Return values.T @ error."""
        found = np.zeros(self.starts[-1])
        for piece in self.pieces:
            found[piece.at] += error[piece.rows] @ piece.values
        return found

    def scales(self, spread: FloatArray) -> list[FloatArray]:
        """Return the spreads of the shared unknowns and each record's."""
        return [np.concatenate([spread[: self.count], spread[i:j]]) for i, j in pairwise(self.starts)]

    def information(self, weights: FloatArray, spread: FloatArray) -> tuple[FloatArray, list[FloatArray],
                                                                            list[FloatArray]]:
        """Return values.T diag(weights) values + 1 of standardised unknowns: head, sides and blocks of an arrow."""
        scales, n = self.scales(spread), self.count
        grams, roots = [np.zeros((scale.size, scale.size)) for scale in scales], np.sqrt(weights)[:, None]
        for piece in self.pieces:
            root = roots[piece.rows] * piece.values  # of a matrix times itself BLAS makes one half
            grams[piece.owner][piece.square] += root.T @ root
        for gram, scale in zip(grams, scales):
            gram *= scale[:, None]
            gram *= scale
        head = np.eye(n) + sum(gram[:n, :n] for gram in grams)
        return head, [g[:n, n:] for g in grams], [np.eye(len(g) - n) + g[n:, n:] for g in grams]

    def explained(self, covariance: FloatArray, arrow: Arrow, spread: FloatArray) -> FloatArray:
        """Return the diagonal of values covariance values.T for the inverse of an arrow and the head's covariance."""
        found, wholes = np.zeros(self.rows), []
        for block, scale in zip(arrow.blocks, self.scales(spread)):
            cross = block.carry @ covariance[block.at]
            own = block.inverse + cross[:, block.at] @ block.carry.T
            wholes.append(scale[:, None] * np.block([[covariance, -cross.T], [-cross, own]]) * scale)
        for piece in self.pieces:
            found[piece.rows] = np.einsum("ij,ij->i", piece.values @ wholes[piece.owner][piece.square], piece.values)
        return found

    def variances(self, covariance: FloatArray, arrow: Arrow) -> FloatArray:
        """Return the standardised variances of all unknowns."""
        tails = [np.diag(b.inverse) + np.sum((b.carry @ covariance[np.ix_(b.at, b.at)]) * b.carry, axis=1)
                 for b in arrow.blocks]
        return np.concatenate([np.diag(covariance), *tails])
