"""The equation error at one value of the unknowns: what they make of the impedance, and of the Jacobian of the data."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
from scipy.sparse import csc_array, csr_array

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.inference.linear_model import Rows, Sizes, safe, variance


@dataclass(frozen=True, eq=False)
class Bend:
    """Relative changes of the impedance, shape (terms, unknowns): terms of the Jacobian in some bins, unknowns `at`."""

    span: slice  # bins
    fine: slice  # their terms
    at: np.ndarray
    values: ComplexArray


def bends_of(rows: Rows, relative: csc_array) -> list[Bend]:
    """Return the changes `relative`, shape (J, unknowns), of neighbouring parts that the same unknowns reach."""
    count, found, told = rows.fine.shape[1], list[Bend](), csr_array(relative)[rows.telling]

    def fine(span: slice) -> slice:
        return slice(span.start * count, span.stop * count)

    for at, group in groupby(rows.spans, key=lambda span: np.unique(told[fine(span)].indices).tolist()):
        spans = list(group)
        whole = slice(spans[0].start, spans[-1].stop)
        if at:
            found.append(Bend(whole, fine(whole), np.array(at), told[fine(whole)][:, at].toarray()))
    return found


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
    def at(cls, rows: Rows, sizes: Sizes, change: ComplexArray, residual: FloatArray) -> "Point":
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

    def impedance_gradient(self, rows: Rows, bends: Sequence[Bend], size: int) -> FloatArray:
        """Return the gradient of log Jacobian and log variance by `size` unknowns."""
        gradient, count = np.zeros(size), rows.fine.shape[1]
        change, pull, _ = self.pulls(rows)
        by_bin = -2.0 / count * pull / change
        for bend in bends:
            s = self.s[bend.fine]
            along = np.repeat(by_bin[bend.span], count) * np.abs(s) ** 2 - rows.weight[rows.telling[bend.fine]]
            gradient[bend.at] += ((along / s) @ bend.values).real
        return gradient

    def impedance_information(self, rows: Rows, bends: Sequence[Bend], spread: FloatArray) -> FloatArray:
        """Return Fisher's information of log Jacobian and log variance on unknowns in units of their spread."""
        size, count = spread.size, rows.fine.shape[1]
        fisher, added = np.zeros((size, size)), np.zeros((size, size))
        change, _, stiff = self.pulls(rows)
        for bend in bends:
            s, both, square = self.s[bend.fine], spread[bend.at], np.ix_(bend.at, bend.at)
            root, scaled = np.sqrt(rows.weight[rows.telling[bend.fine], None]), bend.values * (1.0 / s)[:, None]
            real, imaginary = np.ascontiguousarray(scaled.real), root * scaled.imag
            heavy = root * real  # of a matrix times itself BLAS makes one half
            fisher[square] += (heavy.T @ heavy - imaginary.T @ imaginary) * np.outer(both, both)
            slope = ((np.abs(s) ** 2).reshape(-1, 1, count) @ real.reshape(-1, count, both.size))[:, 0] * both
            slope *= 2.0 / count * np.sqrt(stiff[bend.span, None]) / change[bend.span, None]
            added[square] += slope.T @ slope
        reached = np.flatnonzero(np.any(fisher, axis=0))
        values, vectors = np.linalg.eigh(fisher[np.ix_(reached, reached)])
        added[np.ix_(reached, reached)] += (vectors * np.maximum(values, 0.0)) @ vectors.T
        return added
