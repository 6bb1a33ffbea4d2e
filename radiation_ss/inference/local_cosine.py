"""Local cosine bases: orthonormal functions of short support, for equations of motion in weak form.

A test function that vanishes with its slope at both ends takes the derivatives of the motion upon itself: <g, x''> =
<g'', x> and <g, x'> = -<g', x>, so no measured signal is differentiated (Coifman & Meyer 1991).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Block:
    """The test functions of one interval."""

    start: int  # First sample of the support
    # g, dg, ddg (bins, ns): Test functions and their first two derivatives on the samples of the support, times the
    # sampling interval's square root: white noise of variance 1 a sample has projections of variance 1
    g: FloatArray
    dg: FloatArray
    ddg: FloatArray
    omega: FloatArray  # (bins,): Circular frequencies [rad/s]

    @property
    def samples(self) -> slice:
        """Samples of the support."""
        return slice(self.start, self.start + self.g.shape[1])

    def project(self, values: FloatArray, order: int = 0, bins: int | None = None) -> FloatArray:
        """Return the projections of the `order`-th time derivative of a signal, shape (..., bins)."""
        test = (self.g, self.dg, self.ddg)[order][:bins]
        return np.asarray(values[..., self.samples] @ test.T) * (-1.0) ** order


def projected_on(basis: Sequence[Block], values: FloatArray, order: int = 0, bins: int | None = None) -> FloatArray:
    """Return the projections of the `order`-th derivative of signals (..., nt) on a basis, shape (..., blocks, bins).

    Blocks that share their test functions are taken together, in groups that do not overlap: as matrices these are
    multiplied by BLAS.
    """
    parts, first = [], 0
    while first < len(basis):
        block, last = basis[first], first + 1
        while last < len(basis) and basis[last].g is block.g:
            last += 1
        if last == first + 1:
            parts.append(block.project(values, order, bins)[..., None, :])
            first = last
            continue
        test = (block.g, block.dg, block.ddg)[order][:bins]
        step = basis[first + 1].start - block.start
        windows = np.lib.stride_tricks.sliding_window_view(values[..., block.start:], block.g.shape[1], axis=-1)
        windows = windows[..., :(last - first - 1) * step + 1:step, :]
        part = np.empty((*windows.shape[:-1], test.shape[0]))
        apart = -(-block.g.shape[1] // step)  # windows that overlap are no matrix whose product is fast
        for k in range(min(apart, last - first)):
            part[..., k::apart, :] = windows[..., k::apart, :] @ test.T
        parts.append(part * (-1.0) ** order)
        first = last
    return np.concatenate(parts, axis=-2)


def bell(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sin(pi/2 S(u)) with S rising smoothly from 0 at u = -1 to 1 at u = 1, and its first two derivatives.

    bell(u)^2 + bell(-u)^2 = 1. The third derivative is continuous, too: sums for integrals err by the fourth order.
    """
    r = 0.5 * (np.clip(u, -1.0, 1.0) + 1.0)
    angle = 0.5 * np.pi * r**4 * (35.0 - 84.0 * r + 70.0 * r**2 - 20.0 * r**3)
    slope = 35.0 * np.pi * (r * (1.0 - r)) ** 3
    bend = 52.5 * np.pi * (r * (1.0 - r)) ** 2 * (1.0 - 2.0 * r)
    return np.sin(angle), np.cos(angle) * slope, np.cos(angle) * bend - np.sin(angle) * slope**2


def blocks(count: int, dt: float, length: float, top: float, edge: float, alike: float = np.inf) -> list[Block]:
    """Return the local cosine basis of a record of `count` samples.

    `dt`: sampling interval [s]. `length`: wanted length of an interval [s]; the record holds a whole number of them, at
    least one. `top`: highest circular frequency of a test function [rad/s]. `edge`: half width of the bell at the
    record's two ends [s]; between intervals it is a half of their length. `alike`: number of intervals from which they
    last a whole number of samples and share their test functions: memory does not grow with the record. What is left
    over, an interval at most, widens the two ends.
    """
    total = (count - 1) * dt
    edge = min(edge, 0.2 * total)
    number = max(round((total - 2 * edge) / length), 1)
    L = (total - 2 * edge) / number
    if number < alike:
        return [_block(j, number, count, dt, L, top, edge) for j in range(number)]
    samples = int(L / dt)
    L, number = samples * dt, int((total - 2 * edge) / (samples * dt))
    edge = 0.5 * (total - number * L)
    inner = _block(1, number, count, dt, L, top, edge)
    return [_block(0, number, count, dt, L, top, edge),
            *(replace(inner, start=inner.start + (j - 1) * samples) for j in range(1, number - 1)),
            _block(number - 1, number, count, dt, L, top, edge)]


def _block(j: int, number: int, count: int, dt: float, L: float, top: float, edge: float) -> Block:
    """Return the test functions of one interval of length L."""
    time = np.asarray(dt * np.arange(count), dtype=np.float64)
    a, b = edge + j * L, edge + (j + 1) * L
    rise, fall = (edge if j == 0 else 0.5 * L), (edge if j == number - 1 else 0.5 * L)
    keep = np.flatnonzero((time >= a - rise - 1e-9 * dt) & (time <= b + fall + 1e-9 * dt))
    t = time[keep]
    up, down = (bell(np.asarray(u, dtype=np.float64)) for u in ((t - a) / rise, (b - t) / fall))
    w, dw = up[0] * down[0], up[1] / rise * down[0] - up[0] * down[1] / fall
    ddw = up[2] / rise**2 * down[0] - 2 * up[1] * down[1] / (rise * fall) + up[0] * down[2] / fall**2
    omega = np.asarray(np.pi / L * (np.arange(max(int(top * L / np.pi), 1)) + 0.5), dtype=np.float64)
    c = np.cos(np.outer(omega, t - a)) * np.sqrt(2.0 * dt / L)
    s = np.sin(np.outer(omega, t - a)) * np.sqrt(2.0 * dt / L)
    W = omega[:, None]
    return Block(int(keep[0]), w * c, dw * c - W * w * s, ddw * c - 2 * W * dw * s - W**2 * w * c, omega)


def samplewise(taken: np.ndarray) -> Block:
    """Return test functions that take some samples, true in `taken` (nt,), as they are: without dynamics."""
    each = np.eye(taken.size)[taken]
    return Block(0, each, np.zeros_like(each), np.zeros_like(each), np.zeros(each.shape[0]))


def smooth(basis: list[Block], values: FloatArray, tops: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the parts of signals (n, nt) in the basis up to frequencies `tops` (n,), with their two derivatives."""
    found = tuple(np.zeros_like(values) for _ in range(3))
    for block in basis:
        weight = block.project(values) * (block.omega <= tops[:, None])
        for part, shape in zip(found, (block.g, block.dg, block.ddg)):
            part[..., block.samples] += weight @ shape
    return found[0], found[1], found[2]
