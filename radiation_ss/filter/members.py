"""Members of the filters: drawn from the prior, conditioned on points and on what a record says, kept physical.

A radiation force can only take energy out: Re K(iw) is positive semidefinite. Members that are not are moved to the
nearest parameters that are, as far as prior and records tell parameters apart, and on the known points where there are
any: a least-distance program (Lawson and Hanson 1974, ch. 23) whose rows are the tangents of the least eigenvalue of
Re K at the frequencies met so far, solved again until no frequency is left.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import nnls

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.prior import Draws, Evidence, Pieces, Prior, lognormal, most_probable
from radiation_ss.inference.subsystems import Subsystems


def exact_draws(rng: np.random.Generator, size: int, members: int) -> FloatArray:
    """Return standard normal draws (size, members) with sample mean 0 and, with members enough, covariance I exactly.

    So conditioning the ensemble equals conditioning the Gaussian; with fewer members each variable gets unit variance.
    """
    draws = rng.standard_normal((size, members))
    draws -= draws.mean(axis=1, keepdims=True)
    if members > size + 1:
        factor = np.linalg.cholesky(draws @ draws.T / (members - 1))
        return np.linalg.solve(factor, draws)
    return draws / draws.std(axis=1, ddof=1, keepdims=True)


class Passivity(NamedTuple):
    """What every member has to keep: least eigenvalue of Re K / scale not below `floor` at the frequencies omega."""

    omega: FloatArray
    scale: FloatArray   # (n, n): s_i s_j with s_i^2 the start's largest |Re K_ii|, as in fit.certificate
    floor: float

    def kept(self, parts: Subsystems, theta: FloatArray) -> NDArray[np.bool_]:
        """Return which of some parameters (..., n_theta) keep it."""
        return np.asarray(parts.damping(theta, self.omega, self.scale).min(axis=-1) >= self.floor)


def passivity(parts: Subsystems, omega: FloatArray, tolerance: float, grid: int = 240) -> Passivity:
    """Return the condition for members drawn about `parts.theta`.

    At the answer's frequencies and a grid beyond the poles. `tolerance` is the relative error that K may have even
    where it is known: less negative damping is no contradiction. A start that has more is its own floor.
    """
    poles = np.concatenate([np.abs(p).ravel() for p in parts.poles(parts.theta)])
    wide = np.geomspace(0.01 * poles.min(), 100.0 * poles.max(), grid)
    w = np.unique(np.concatenate([[0.0], wide, omega]))
    size = np.sqrt(np.abs(np.einsum("wjj->wj", parts.K(parts.theta, w).real)).max(axis=0))
    size[size == 0.0] = 1.0
    scale = np.outer(size, size)
    least = float(parts.damping(parts.theta, w, scale).min())
    return Passivity(w, scale, min(-tolerance, least) - 1e-9)  # less rounding


class Members(NamedTuple):
    """An ensemble of parameters with the centre that the estimate is taken from."""

    theta: FloatArray   # (n_theta, members)
    drawn: FloatArray   # (n_theta, members): as they were before any was moved
    centre: FloatArray  # (n_theta,)
    unstable: int       # of those drawn
    not_passive: int    # of those drawn


@dataclass(frozen=True, eq=False)
class Drawing:
    """How the default filter draws: by the same draws (members, 2 d + p) of all errors each time."""

    parts: Subsystems
    prior: Prior
    rule: Passivity
    draws: FloatArray

    @property
    def size(self) -> int:
        """Number of parameters that may move."""
        return self.prior.free.size

    def mode(self, data: Evidence) -> Pieces[FloatArray]:
        """Return the most probable u, shape (d,)."""
        zero = np.zeros((1, self.size))
        draws = Draws(zero, np.zeros((1, self.prior.y.size)), zero)
        return (yield from most_probable(self.prior, data, draws))[0]  # type: ignore[no-any-return]

    def members(self, data: Evidence | None = None, together: int = 16) -> Pieces[Members]:
        """Return members given points and data, so many at a time."""
        d = self.size
        data = Evidence.none(d) if data is None else data
        u0, pulls, shifts = np.split(np.vstack([np.zeros(self.draws.shape[1]), self.draws]), [d, 2 * d], axis=1)
        values, vectors = np.linalg.eigh(data.information)
        draws = Draws(u0, shifts, pulls @ (vectors * np.sqrt(np.maximum(values, 0.0))).T)
        found = []
        for first in range(0, len(u0), together):
            some = Draws(*(part[first:first + together] for part in draws))
            found.append((yield from most_probable(self.prior, data, some)))
        theta = self.prior.theta(np.vstack(found)).T
        if not self.parts.stable(theta[:, 0]):
            raise SolverError("the prior conditioned on the points is unstable; check K at the points, or widen prior")
        kept = yield from self.physical(theta, theta[:, 0], data.information)
        return kept._replace(theta=kept.theta[:, 1:], drawn=theta[:, 1:], centre=kept.theta[:, 0])

    def physical(self, theta: FloatArray, centre: FloatArray, information: FloatArray) -> Pieces[Members]:
        """Return members (n_theta, members) that are stable and keep the rule, moved as little as that takes.

        One that is left outside is drawn towards the centre (n_theta,), stable parameters, of which records have told
        the information (d, d).
        """
        def stable(columns: FloatArray) -> np.ndarray:
            return np.asarray(self.parts.stable(columns.T))

        def good(columns: FloatArray) -> np.ndarray:
            return np.asarray(stable(columns) & self.rule.kept(self.parts, columns.T))

        yield
        out, unstable = theta.copy(), ~stable(theta)
        out[:, unstable] = yield from _towards(out[:, unstable], centre, stable)
        yield
        bad = np.flatnonzero(~good(out))
        for e in bad:
            out[:, e] = yield from self.nearest_passive(out[:, e], centre, information)
        left = bad[~good(out[:, bad])]
        if left.size and good(centre[:, None])[0]:
            out[:, left] = yield from _towards(out[:, left], centre, good)
        return Members(out, theta, centre, int(unstable.sum()), bad.size)

    def nearest_passive(self, theta: FloatArray, centre: FloatArray, information: FloatArray, *, rounds: int = 30,
                        lowest: int = 4, farthest: float = 10.0) -> Pieces[FloatArray]:
        """Return the nearest parameters (n_theta,) that keep the rule; the last iterate where they are not reached.

        Each round takes up the frequencies with the least damping; a member moves `farthest` prior standard deviations
        at most.
        """
        prior, rule, free = self.prior, self.rule, self.prior.free
        if not free.size or (theta[free] * prior.start[free] <= 0.0).any():
            return theta
        # The information is taken along to theta (`prior.Evidence`).
        slope = theta[free] / centre[free]
        hessian = np.eye(free.size) + slope[:, None] * information * slope
        root = np.asarray(np.linalg.inv(np.linalg.cholesky(hessian)).T)  # turns distances into changes of u
        first = u = prior.u(theta)
        keep, active = prior.off(u), np.zeros(0, dtype=np.int64)
        aim, moved, apart = rule.floor + 1e-6, theta, 0.0  # so far inside, as a share of the largest damping
        for _ in range(rounds):
            yield
            least, off = self.parts.damping(moved, rule.omega, rule.scale), keep - prior.off(u)
            # A tenth of the points' error is what a member may lose on them.
            if least.min() >= rule.floor and apart < 1e-3 and np.all(np.abs(off) < 0.1):
                break
            active = np.union1d(active, np.argsort(least)[:lowest])
            values, slopes = damping_slopes(self.parts, moved, rule.omega[active], rule.scale)
            rows, J = slopes[:, free] * prior.slope(moved), prior.off_slope(u)
            change = least_distance(rows @ root, aim - values + rows @ (u - first), J @ root, J @ (u - first) + off)
            if change is None or not np.linalg.norm(root @ change) < farthest:
                break
            apart, u = float(np.linalg.norm(first + root @ change - u)), first + root @ change
            moved = np.where(prior.spread > 0.0, prior.theta(u), theta)
        return moved


def drawing(parts: Subsystems, prior_std: FloatArray, points: tuple[FloatArray, FloatArray, FloatArray],
            point_noise: float, omega: FloatArray, draws: tuple[int, np.random.Generator]) -> Drawing:
    """Return the drawing of (number of members, generator), given points as of `prior.conditions`, passive at omega."""
    relative = np.divide(prior_std, np.abs(parts.theta), out=np.zeros_like(prior_std), where=parts.theta != 0.0)
    H, y, scale = points
    prior, (size, rng) = lognormal(parts.theta, relative, (H, y, point_noise * scale)), draws
    count = 2 * prior.free.size + y.size
    normal = exact_draws(rng, count, size).T if prior.free.size else np.zeros((size, count))
    return Drawing(parts, prior, passivity(parts, omega, point_noise), normal)


def gaussian_members(parts: Subsystems, prior_std: FloatArray, size: int, rng: np.random.Generator) -> Members:
    """Return the paper's members: normal about the start; unstable ones pulled to it, passivity as it comes."""
    free = prior_std > 0.0
    theta = np.repeat(parts.theta[:, None], size, axis=1)
    theta[free] += prior_std[free, None] * exact_draws(rng, int(free.sum()), size)
    drawn, bad = theta.copy(), ~parts.stable(theta.T)
    unstable = int(bad.sum())
    while bad.any():
        theta[:, bad] = parts.theta[:, None] + 0.7 * (theta[:, bad] - parts.theta[:, None])
        bad[bad] = ~parts.stable(theta[:, bad].T)
    return Members(theta, drawn, parts.theta, unstable, 0)


def damping_slopes(parts: Subsystems, theta: FloatArray, omega: FloatArray,
                   scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least eigenvalue of Re K(iw) / scale, (nw,), and its derivative by theta, (nw, n_theta)."""
    real = parts.K(theta, omega).real / scale
    values, vectors = np.linalg.eigh(0.5 * (real + real.swapaxes(-1, -2)))
    v, slopes = vectors[..., 0], np.zeros((omega.size, theta.size))
    for which, (j, k), dK in parts.form.slopes(theta, omega):
        weight = (1.0 if j == k else 2.0) * v[:, j] * v[:, k] / scale[j, k]
        slopes[:, which] = (weight * dK.real).T
    return values[:, 0], slopes


def least_distance(A: FloatArray, b: FloatArray, E: FloatArray | None = None,
                   f: FloatArray | None = None) -> FloatArray | None:
    """Return the shortest d with A d >= b and E d = f (least squares), where E is given; None where there is none."""
    fixed, basis = np.zeros(A.shape[1]), np.eye(A.shape[1])
    if E is not None and f is not None and f.size:
        fixed, basis = np.asarray(np.linalg.lstsq(E, f, rcond=None)[0], dtype=np.float64), null_space(E)
    size = np.maximum(np.linalg.norm(A, axis=1), 1e-300)
    rows, right = (A / size[:, None]) @ basis, (b - A @ fixed) / size
    stacked, end = np.vstack([rows.T, right]), np.r_[np.zeros(basis.shape[1]), 1.0]
    try:
        weights, distance = nnls(stacked, end, maxiter=100 * right.size)
    except RuntimeError:    # too many iterations
        return None
    rest = stacked @ weights - end
    return None if distance < 1e-9 else np.asarray(fixed - basis @ (rest[:-1] / rest[-1]))


def _towards(columns: FloatArray, centre: FloatArray, good: Callable[[FloatArray], np.ndarray]) -> Pieces[FloatArray]:
    """Return columns drawn straight to the centre, no farther than `good` takes (bisection); lines keep the points."""
    inside, outside = np.zeros(columns.shape[1]), np.ones(columns.shape[1])
    for _ in range(30 if columns.size else 0):
        yield
        middle = 0.5 * (inside + outside)
        kept = good(centre[:, None] + middle * (columns - centre[:, None]))
        inside, outside = np.where(kept, middle, inside), np.where(kept, outside, middle)
    return np.asarray(centre[:, None] + inside * (columns - centre[:, None]))
