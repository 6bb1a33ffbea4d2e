"""The discrepancy eliminated from a fit: readings are linear in it and its prior is normal, so its optimum is known.

For given nominal numbers, effects and starts the sizes d of its directions D minimise |r - D d|^2 + |d|^2. What is left
is a problem of the other parameters alone whose curvature is the Schur complement J'J + 1 - J'D (D'D + 1)^-1 D'J
(variable projection, Golub and Pereyra 1973, here exact for D does not depend on them).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.posterior.noise import Noise
from radiation_ss.gap.posterior.setting import Setting, filled


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Directions of the discrepancy under one noise.

    Parameters
    ----------
    columns : ndarray, shape (nk, nd)
        All channels stacked; times the weights they are D, in units of the noise.
    weights : ndarray, shape (nk,)
    blocks : tuple of (ndarray of int, ndarray)
        `filled` columns of each channel.
    root : ndarray, shape (nd, nd)
        Upper triangular; root' root = D'D + 1.
    """

    columns: FloatArray
    weights: FloatArray
    blocks: tuple[tuple[NDArray[np.intp], FloatArray], ...]
    root: FloatArray

    def along(self, values: FloatArray) -> FloatArray:
        """Return D' times values in units of the noise."""
        return self.columns.T @ (self.weights * values.T).T

    def step(self, r: FloatArray, d: FloatArray) -> FloatArray:
        """Return the step from d, where the whitened residual is r, that minimises |r - D step|^2 + |d + step|^2."""
        return np.asarray(cho_solve((self.root, False), self.along(r) - d))

    def cross(self, J: FloatArray) -> FloatArray:
        """Return root'^-1 D'J, whose square the curvature by the other parameters loses."""
        moved, at = np.zeros((self.root.shape[0], J.shape[1])), 0
        for there, block in self.blocks:  # a record's own noise and start are nothing to other records
            part, weight = J[at:at + block.shape[0]], self.weights[at:at + block.shape[0], None]
            (moving, values), = filled([part])
            moved[np.ix_(there, moving)] += block.T @ (weight * values)
            at += block.shape[0]
        return np.asarray(solve_triangular(self.root, moved, trans="T"))


def eliminated(setting: Setting, noise: Noise) -> Eliminated:
    """Return the directions of a setting's discrepancy under a noise."""
    sizes = [c.time.size for record in setting.records for c in record.channels]
    if all(taps.size == 1 and drift is None for taps, drift in zip(noise.filters, noise.drifts)):
        deviations = np.array(noise.deviation)
        weights, columns, blocks = np.repeat(1.0 / deviations, sizes), setting.stacked, setting.blocks
        square = np.tensordot(deviations**-2.0, setting.squares, axes=1)
    else:
        white = [noise.whiten(k, part) for k, part in enumerate(setting.discrepancy)]
        columns, blocks = np.concatenate(white), filled(white)
        weights, square = np.ones(columns.shape[0]), columns.T @ columns
    return Eliminated(columns, weights, blocks, np.asarray(cholesky(square + np.eye(setting.unnamed))))
