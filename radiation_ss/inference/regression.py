"""Gaussian linear model of an equation error: learned sizes, limits of sign, the Jacobian of the data, evidence."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.linear_model import (
    Columns,
    Posterior,
    Rows,
    SizePrior,
    Sizes,
    bounded_step,
    factor_of,
    log_allowed,
    safe,
    spreads,
    variance,
)
from radiation_ss.inference.own import BEFORE, COHERENT, OFFSET, TOLERANCE, Arrow, Packed
from radiation_ss.inference.point import Point, bends_of


class Layout:
    """Rows and columns without their zeros, made once for all sizes."""

    def __init__(self, rows: Rows, columns: Columns) -> None:
        self.packed, self.bends = Packed(rows.parts, columns.values, rows.own), bends_of(rows, columns.relative)


def solve(rows: Rows, columns: Columns, sizes: Sizes, iterations: int = 20, start: Posterior | None = None,
          layout: Layout | None = None, accuracy: float = 1e-3, stretch: FloatArray | float = 1.0) -> Posterior:
    """Return the Laplace approximation at given sizes, climbing from `start`, the solution at sizes nearby.

    The unknowns change the impedance, and with it the Jacobian of the data and what the sensors' noise does to the
    error. Newton's method with Fisher's information of both, which is made anew where the last one has not brought
    three quarters of what was to be gained; a step is halved until it climbs. Without a start it is zero or the least
    squares' solution with the model's numbers as they are, whichever is higher: between them the impedance may vanish
    somewhere, as that of a body which only its mooring restores. A start without information, which is another set's,
    is held against the least squares, too. It ends where less than `accuracy` of log likelihood is to be gained.
    `stretch` multiplies the prior standard deviations.
    """
    spread, n = spreads(rows, columns, sizes, stretch), columns.count
    layout = layout or Layout(rows, columns)
    packed, bends = layout.packed, layout.bends

    def at(beta: FloatArray) -> Point:
        change = np.zeros(rows.telling.size, dtype=complex)
        for bend in bends:
            change[bend.fine] = bend.values @ (spread * beta)[bend.at]
        point = Point.at(rows, sizes, change, rows.error - packed.times(spread * beta))
        return replace(point, height=point.height - 0.5 * float(beta @ beta))

    def slope_at(point: Point, beta: FloatArray) -> FloatArray:
        slope = packed.back(rows.power / point.variance * point.residual)
        slope[:n] += point.impedance_gradient(rows, bends, n)
        return np.asarray(spread * slope - beta)

    def arrow_at(point: Point) -> Arrow:
        head, sides, blocks = packed.information(rows.power / point.variance, spread)
        head += point.impedance_information(rows, bends, spread[:n])
        return Arrow.of(head, sides, blocks)

    zero = np.zeros(spread.size)
    beta = zero if start is None else np.concatenate([start.mean, start.own_mean]) / spread
    arrow, point = None if start is None else start.arrow, at(beta)
    if arrow is None:
        W, free = rows.power / at(zero).variance, np.where(factor_of(rows, columns) == TOLERANCE, 0.0, spread)
        flat = Arrow.of(*packed.information(W, free)).solve(free * packed.back(W * rows.error))
        point, beta = max((point, beta), (at(flat), flat), key=lambda pair: pair[0].height)
    fresh, left = False, float("inf")  # whether the information is that at the point; twice what is still to be gained
    for _ in range(iterations):
        slope = slope_at(point, beta)
        if arrow is None or not (fresh or accuracy < slope @ arrow.solve(slope) < 0.25 * left):
            arrow, fresh = arrow_at(point), True
        step = arrow.solve(slope)
        left = float(slope @ step)
        if left < accuracy:
            break
        higher = next(((p, b) for b in (beta + step * 0.5**k for k in range(8)) if (p := at(b)).height > point.height),
                      None)
        if higher is None and fresh:
            break
        (point, beta), fresh, left = (higher, False, left) if higher else ((point, beta), False, 0.0)
    arrow = arrow if fresh and arrow is not None else arrow_at(point)
    covariance = np.asarray(np.linalg.inv(arrow.schur), dtype=np.float64)
    own_std = np.sqrt(np.maximum(packed.variances(covariance, arrow)[n:], 0.0)) * spread[n:]
    return Posterior((beta * spread)[:n], covariance * np.outer(spread[:n], spread[:n]), sizes,
                     float(point.height - 0.5 * arrow.log_determinant), point.residual, point.variance, point.noise,
                     (beta * spread)[n:], own_std, arrow)


def learn(rows: Rows, columns: Columns, start: Sizes, prior: SizePrior | None = None, steps: int = 40,
          accuracy: float = 0.03, nuisances: int = 0, near: Posterior | None = None) -> Posterior:
    """Return the posterior at the most probable sizes, its evidence with their prior and with limits of strengths.

    The first `nuisances` columns are no strengths. The climb begins at the unknowns of `near`, those of another set.

    The sizes are climbed to by Newton's method within their bounds, in at most `steps` steps, until one gains less than
    about `accuracy` of log evidence; with no step they stay.
    """
    prior = prior or SizePrior()
    groups = rows.share.size
    centre = np.concatenate([np.log(rows.share), np.log(rows.ambient), np.zeros(start.noise.size + 4)])
    known = groups - rows.spectra
    width = np.concatenate([np.full(known, prior.share), np.full(rows.spectra, prior.spectrum),
                            np.full(groups, prior.ambient),
                            np.full(start.noise.size, prior.noise),
                            [prior.tolerance, prior.offset, prior.before, prior.coherent]])
    lower, upper = centre - 5.0 * width, centre + 5.0 * width
    lower[[-4, -1]], upper[-4:] = (0.0, np.log(prior.exact)), (np.log(prior.largest), 0.0, 0.0, 0.0)
    layout = Layout(rows, columns)

    def scaled(found: Posterior) -> FloatArray:
        # Shares of the force of the equation as it is multiplied: else to multiply all of it would pay. The slope
        # leaves out how the factor follows the sizes.
        by_group = multiplied(rows, columns, found)
        return np.concatenate([by_group, by_group, np.zeros(start.noise.size + 4)])

    def solved(x: FloatArray, near: Posterior | None, kept: tuple[Rows, FloatArray]) -> Reached:
        # From the best so far: past where the impedance is zero lies another solution, which a long step may meet.
        climbed, stretch = kept
        found = solve(climbed, columns, Sizes.of(x, groups), start=near, layout=layout, stretch=stretch)
        more = float(np.sum((rows.weight - climbed.weight)[rows.telling] * logs_of(rows, columns, found)))
        found = replace(found, log_evidence=found.log_evidence + more)
        off = (x - centre - scaled(found)) / width
        return Reached(found.log_evidence - 0.5 * float(off @ off), found, off / width)

    def settled(x: FloatArray, near: Posterior) -> tuple[Reached, tuple[Rows, FloatArray]]:
        kept = in_proportion(rows, columns, near, nuisances)
        return solved(x, near, kept), kept

    x = start.vector
    now, kept = settled(x, near or solved(x, None, (rows, np.ones(1))).found)
    for _ in range(steps):
        slope, information = size_slopes(rows, columns, now.found, layout, kept[1])
        slope -= now.pull
        step = bounded_step(information + np.diag(width**-2.0), slope, x, lambda to: np.clip(to, lower, upper)) - x
        if 0.5 * float(slope @ step) < accuracy:
            break
        step = np.minimum(step, 0.5 * np.log1p(2.0 * np.maximum(step, 0.0)))  # a variance grows as its rows ask
        higher = next((new for k in range(6) if (new := solved(x + step * 0.5**k, now.found, kept)).value > now.value),
                      None)
        if higher is None:
            break
        x = higher.found.sizes.vector
        now, kept = settled(x, higher.found)
    return replace(now.found, log_evidence=now.value + log_allowed(now.found, columns), arrow=None)


class Reached(NamedTuple):
    """Log evidence with the sizes' prior at some sizes, the posterior there, and how the prior pulls each size."""

    value: float
    found: Posterior
    pull: FloatArray


def logs_of(rows: Rows, columns: Columns, found: Posterior) -> FloatArray:
    """Return the logarithm of what the impedance is multiplied by, where the Jacobian is taken."""
    return np.asarray(np.log(np.abs(safe(1.0 - (columns.relative @ found.mean)[rows.telling]))))


def multiplied(rows: Rows, columns: Columns, found: Posterior) -> FloatArray:
    """Return the mean logarithm of what the impedance of each group's motion is multiplied by, shape (groups,)."""
    logs = rows.averaged(logs_of(rows, columns, found))
    of_row = np.append(logs, 0.0)[rows.kind]
    of_motion = np.bincount(rows.sensor, rows.power * of_row) / np.maximum(np.bincount(rows.sensor, rows.power), 1e-300)
    size = np.maximum(np.bincount(rows.group, minlength=rows.share.size), 1)
    return np.asarray(np.bincount(rows.group, of_motion[rows.sensor], rows.share.size) / size)


def in_proportion(rows: Rows, columns: Columns, found: Posterior, nuisances: int) -> tuple[Rows, FloatArray]:
    """Return what keeps the equation from being multiplied: rows for the climb, and by how much each spread grows.

    What no effect explains is a share of the equation as it is multiplied. And of N rows k go to such unknowns, so that
    the residual of the others is what a factor of all is found from: the Jacobian counts N - k times, not N.
    """
    stretch, whole = np.ones(columns.count + sum(own.count for own in rows.own)), rows.kind < rows.fine.shape[0]
    total = float(rows.power[whole].sum())
    if total == 0.0:
        return rows, stretch
    shares = factor_of(rows, columns) != TOLERANCE
    shares[nuisances:columns.count] = False
    logs = rows.averaged(logs_of(rows, columns, found))[rows.kind[whole]]
    stretch[shares] = np.exp(np.average(logs, weights=rows.power[whole]))
    spread = spreads(rows, columns, found.sizes, stretch)
    left = np.concatenate([np.diag(found.covariance), found.own_std**2])[shares] / spread[shares] ** 2
    known = float(np.sum(np.clip(1.0 - left, 0.0, 1.0)))
    return replace(rows, weight=rows.weight * max(1.0 - known / total, 0.0)), stretch


def size_slopes(rows: Rows, columns: Columns, found: Posterior, layout: Layout | None = None,
                stretch: FloatArray | float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of the log evidence by the logarithms of the sizes, and their information.

    The slope leaves out the curvature's own. The information is Fisher's on the variance of the rows, as if the other
    unknowns were known; on the diagonal what is seen where that is more, as of a size that is far too large.
    """
    _, unexplained, ambient = variance(rows, found.sizes)
    noise, v, groups = found.noise, found.variance, rows.share.size
    assert found.arrow is not None
    packed = (layout or Layout(rows, columns)).packed
    spread, n = spreads(rows, columns, found.sizes, stretch), columns.count
    covariance = found.covariance / np.outer(spread[:n], spread[:n])
    square = (found.residual**2 + packed.explained(covariance, found.arrow, spread)) / v
    size = 2 * groups + found.sizes.noise.size
    parts = [(rows.group, unexplained / v), (groups + rows.group, ambient / v), (2 * groups + rows.sensor, noise / v)]

    def sums(at: np.ndarray, values: FloatArray, count: int) -> FloatArray:
        return np.asarray(np.bincount(at, rows.power * values, count), dtype=np.float64)

    slope = np.sum([sums(at, (square - 1.0) * share, size) for at, share in parts], axis=0)
    seen = np.sum([sums(at, 2.0 * share * (1.0 - square - share * (1.0 - 2.0 * square)), size) for at, share in parts],
                  axis=0)
    information = np.sum([sums(at * size + to, 2.0 * one * other, size**2).reshape(size, size)
                          for at, one in parts for to, other in parts], axis=0)
    np.fill_diagonal(information, np.maximum(np.diagonal(information), seen))
    factor, mean = factor_of(rows, columns), np.concatenate([found.mean, found.own_mean])
    left = np.concatenate([np.diag(found.covariance), found.own_std**2]) / spread**2
    second, known = mean**2 / spread**2 + left - 1.0, np.clip(1.0 - left, 0.0, 1.0)
    common = [factor == k for k in (TOLERANCE, OFFSET, BEFORE, COHERENT)]
    return (np.concatenate([slope, [np.sum(second[mine]) for mine in common]]),
            block_diag(information, np.diag([2.0 * np.sum(known[mine] ** 2) for mine in common])))
