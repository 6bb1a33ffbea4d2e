"""Prior of the default filter's parameters: lognormal about the model's own, and its condition on known points.

A relative uncertainty is symmetric only in the logarithm: a truth 15 % above its start and a start 15 % below its
truth are then one statement. Coefficients keep their signs, so denominators of order one and two stay stable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter.pieces import Pieces


class Prior(NamedTuple):
    """theta = start * exp(spread u), u standard normal; a spread of 0 keeps a parameter fixed."""

    start: FloatArray   # (n_theta,)
    spread: FloatArray  # (n_theta,): standard deviation of the logarithm

    @property
    def free(self) -> np.ndarray:
        """Indices of the parameters that may move, (d,)."""
        return np.flatnonzero(self.spread > 0.0)

    def theta(self, u: FloatArray) -> FloatArray:
        """Return parameters (..., n_theta) of u (..., d)."""
        theta = np.broadcast_to(self.start, (*u.shape[:-1], self.start.size)).copy()
        theta[..., self.free] *= np.exp(self.spread[self.free] * u)
        return theta

    def slope(self, theta: FloatArray) -> FloatArray:
        """Return d theta / d u of the free parameters, (..., d)."""
        return theta[..., self.free] * self.spread[self.free]


def lognormal(start: FloatArray, relative: FloatArray) -> Prior:
    """Return the prior whose median is `start` and whose relative standard deviation is that of a lognormal."""
    return Prior(start, np.where(start != 0.0, np.sqrt(np.log1p(relative**2)), 0.0))


class Conditions(NamedTuple):
    """Known points: rows H theta = y with errors `std` (25)-(27)."""

    H: FloatArray    # (p, n_theta)
    y: FloatArray    # (p,)
    std: FloatArray  # (p,)

    def residual(self, prior: Prior, u: FloatArray) -> FloatArray:
        """Return standardised residuals (..., p)."""
        return (prior.theta(u) @ self.H.T - self.y) / self.std

    def jacobian(self, prior: Prior, u: FloatArray) -> FloatArray:
        """Return d residual / d u, (..., p, d)."""
        rows = self.H[:, prior.free] / self.std[:, None]
        return np.asarray(rows * prior.slope(prior.theta(u))[..., None, :])


class Evidence(NamedTuple):
    """What a record says near `centre`: log likelihood g' d - d' I d / 2.

    d is the change of theta in units of its slope at the centre. Parameters that leave K alone where the motion has
    power lie on a plane in theta (26), (27), as a record sees them; in u they would lie on a curved sheet, and what it
    knows best would be off by many of its standard deviations.
    """

    centre: FloatArray       # (d,)
    gradient: FloatArray     # (d,)
    information: FloatArray  # (d, d)

    def change(self, prior: Prior, u: FloatArray) -> FloatArray:
        """Return d (..., d) of u."""
        spread = prior.spread[prior.free]
        return np.asarray(np.expm1(spread * (u - self.centre)) / spread)

    def slope(self, prior: Prior, u: FloatArray) -> FloatArray:
        """Return the derivative of each d by its own u, (..., d)."""
        return np.asarray(np.exp(prior.spread[prior.free] * (u - self.centre)))


class Draws(NamedTuple):
    """Draws of the errors of prior, points and data; all zero for the mode."""

    u0: FloatArray     # (rows, d): the prior's mean
    shift: FloatArray  # (rows, p): standard normal errors of the points
    pull: FloatArray   # (rows, d): errors of the data's gradient


def no_evidence(size: int) -> Evidence:
    """Return the evidence of no record."""
    return Evidence(np.zeros(size), np.zeros(size), np.zeros((size, size)))


def most_probable(prior: Prior, points: Conditions, data: Evidence, draws: Draws, *, steps: int = 60,
                  halvings: int = 12, close: float = 1e-9) -> Pieces[FloatArray]:
    """Return the most probable u of each row, given its own prior mean, error of the points and pull of the data.

    With zeros it is the mode. With u0, shift and pull drawn as the prior, the points' and the data's errors are, the
    rows are draws of the posterior, exact where everything is linear (randomised maximum likelihood, Oliver 1996).
    Gauss-Newton steps, halved until the cost falls.

    Parameters
    ----------
    draws : Draws
        One row each.
    steps, halvings : int
        Most Gauss-Newton steps, and halvings of each.
    close : float
        A step that changes nothing, in prior standard deviations.

    Raises
    ------
    SolverError
        If no descent is found: the points contradict the prior by far.
    """
    u0, shift, pull = draws
    if not points.y.size and not data.information.any():
        return u0.copy()

    def cost(u: FloatArray) -> FloatArray:
        away, off = u - u0, points.residual(prior, u) + shift
        near = data.change(prior, u)
        return np.asarray(0.5 * ((away**2).sum(-1) + (off**2).sum(-1) + np.einsum("ri,ij,rj->r", near,
                          data.information, near)) - ((data.gradient + pull) * near).sum(-1))

    u, now = u0.copy(), cost(u0)
    for _ in range(steps):
        yield
        J, off, near = points.jacobian(prior, u), points.residual(prior, u) + shift, data.change(prior, u)
        slope = data.slope(prior, u)
        hessian = (np.eye(u.shape[1]) + J.swapaxes(1, 2) @ J
                   + slope[:, :, None] * data.information * slope[:, None, :])
        descent = (u0 - u - np.einsum("rpi,rp->ri", J, off)
                   + slope * (data.gradient + pull - near @ data.information))
        step = np.linalg.solve(hessian, descent[..., None])[..., 0]
        reach = np.ones(u.shape[0])
        for _ in range(halvings):
            tried = cost(u + reach[:, None] * step)
            worse = ~(tried <= now + 1e-12 * np.abs(now))
            if not worse.any():
                break
            reach[worse] *= 0.5
        reach[worse] = 0.0
        u = u + reach[:, None] * step
        now = np.where(reach > 0.0, tried, now)
        if np.abs(reach[:, None] * step).max() < close:
            break
    if not np.isfinite(now).all():
        raise SolverError("the prior cannot be brought onto the known points; check K there, or widen prior")
    return u
