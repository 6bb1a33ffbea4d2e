"""Members of the filters: drawn from the prior, conditioned on points and on what a record says, kept physical."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.physical import Passivity, Projected, passivity, projected
from radiation_ss.filter.pieces import Pieces
from radiation_ss.filter.prior import Draws, Evidence, Prior, lognormal, most_probable
from radiation_ss.inference.subsystems import Subsystems


def exact_draws(rng: np.random.Generator, size: int, members: int) -> FloatArray:
    """Return standard normal draws, shape (size, members), with sample mean 0 and, where possible, covariance I.

    With more members than variables the sample covariance is made the identity exactly, so that conditioning the
    ensemble equals conditioning the Gaussian; with fewer, each variable gets unit variance.
    """
    draws = rng.standard_normal((size, members))
    draws -= draws.mean(axis=1, keepdims=True)
    if members > size + 1:
        factor = np.linalg.cholesky(draws @ draws.T / (members - 1))
        return np.linalg.solve(factor, draws)
    return draws / draws.std(axis=1, ddof=1, keepdims=True)


class Members(NamedTuple):
    """An ensemble of parameters with the centre that the estimate is taken from."""

    theta: FloatArray   # (n_theta, members)
    drawn: FloatArray   # (n_theta, members): as they were before any was moved
    centre: FloatArray  # (n_theta,)
    unstable: int       # of those drawn
    not_passive: int    # of those drawn


@dataclass(frozen=True, eq=False)
class Drawing:
    """How the default filter draws: the same random numbers whatever the evidence, so that members move smoothly.

    draws (members, 2 d + p) are those of the prior, of the data's and of the points' errors.
    """

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

    def members(self, data: Evidence | None = None) -> Pieces[Members]:
        """Return members given points and data; SolverError if the most probable parameters are unstable."""
        d = self.size
        data = Evidence.none(d) if data is None else data
        u0, pulls, shifts = np.split(np.vstack([np.zeros(self.draws.shape[1]), self.draws]), [d, 2 * d], axis=1)
        values, vectors = np.linalg.eigh(data.information)
        draws = Draws(u0, shifts, pulls @ (vectors * np.sqrt(np.maximum(values, 0.0))).T)
        theta = self.prior.theta((yield from most_probable(self.prior, data, draws))).T
        if not self.parts.stable(theta[:, 0]):
            raise SolverError("the prior conditioned on the points is unstable; check K at the points, or widen prior")
        kept = yield from self.physical(theta, theta[:, 0], data.information)
        return Members(kept.theta[:, 1:], theta[:, 1:], kept.theta[:, 0], kept.unstable, kept.not_passive)

    def physical(self, theta: FloatArray, centre: FloatArray, information: FloatArray) -> Pieces[Projected]:
        """Return members (n_theta, members) that are stable and passive; information (d, d) is what records told."""
        return (yield from projected(self.parts, self.rule, self.prior, theta, (centre, information)))


def drawing(parts: Subsystems, prior_std: FloatArray, points: tuple[FloatArray, FloatArray, FloatArray],
            point_noise: float, omega: FloatArray, draws: tuple[int, np.random.Generator]) -> Drawing:
    """Return the drawing of some members, with exact sample mean and covariance where there are enough of them.

    points are those of `prior.conditions`, omega the frequencies of the answer, at which members are passive, draws the
    number of members and what draws them.
    """
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
