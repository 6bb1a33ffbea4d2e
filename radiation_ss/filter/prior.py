"""What is known of the default filter's parameters: a lognormal prior, known points, and what a record says.

A relative uncertainty is symmetric only in the logarithm: a truth 15 % above its start and a start 15 % below its
truth are then one statement. Coefficients keep their signs, so denominators of order one and two stay stable.
"""

from collections.abc import Generator
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.inference.subsystems import Subsystems


def conditions(parts: Subsystems, omega: FloatArray, K: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (H, y, scale) of known points as linear conditions H theta = y, real and imaginary parts (25)-(27).

    K P - Q = 0 with P = s^n + sum a_l s^(l-1), Q = sum b_l s^(l-1). A relative error of K, times `scale` = |K P| at the
    start, is that of the row.
    """
    H, y, scale = [], [], []
    for w, matrix in zip(omega, K):
        for (j, k), offset, order in zip(parts.entries, parts.offsets, parts.orders):
            powers = (1j * w) ** np.arange(order)
            row = np.zeros(parts.theta.size, dtype=complex)
            row[offset:offset + order] = matrix[j, k] * powers
            row[offset + order:offset + 2 * order] = -powers
            right = -matrix[j, k] * (1j * w) ** order
            P = parts.theta[offset:offset + order] @ powers + (1j * w) ** order
            H += [row.real, row.imag]
            y += [right.real, right.imag]
            scale += 2 * [max(abs(matrix[j, k] * P), 1e-300)]
    return np.reshape(H, (-1, parts.theta.size)), np.array(y), np.array(scale)


class Prior(NamedTuple):
    """theta = start * exp(spread u), u standard normal, and points H theta = y with errors `std`."""

    start: FloatArray   # (n_theta,)
    spread: FloatArray  # (n_theta,): standard deviation of the logarithm; 0 keeps a parameter fixed
    H: FloatArray       # (p, n_theta)
    y: FloatArray       # (p,)
    std: FloatArray     # (p,)

    @property
    def free(self) -> np.ndarray:
        """Indices of the parameters that may move, (d,)."""
        return np.flatnonzero(self.spread > 0.0)

    def theta(self, u: FloatArray) -> FloatArray:
        """Return parameters (..., n_theta) of u (..., d)."""
        theta = np.broadcast_to(self.start, (*u.shape[:-1], self.start.size)).copy()
        theta[..., self.free] *= np.exp(self.spread[self.free] * u)
        return theta

    def u(self, theta: FloatArray) -> FloatArray:
        """Return the standardised parameters (..., d) of theta (..., n_theta)."""
        return np.asarray(np.log(theta[..., self.free] / self.start[self.free]) / self.spread[self.free])

    def slope(self, theta: FloatArray) -> FloatArray:
        """Return d theta / d u of the free parameters, (..., d)."""
        return theta[..., self.free] * self.spread[self.free]

    def off(self, u: FloatArray) -> FloatArray:
        """Return standardised residuals of the points (..., p)."""
        return (self.theta(u) @ self.H.T - self.y) / self.std

    def off_slope(self, u: FloatArray) -> FloatArray:
        """Return the residuals' derivative by u, (..., p, d)."""
        return np.asarray(self.H[:, self.free] / self.std[:, None] * self.slope(self.theta(u))[..., None, :])


def lognormal(start: FloatArray, relative: FloatArray, points: tuple[FloatArray, FloatArray, FloatArray]) -> Prior:
    """Return the prior with median `start` and a lognormal's relative standard deviation; points are (H, y, std)."""
    return Prior(start, np.where(start != 0.0, np.sqrt(np.log1p(relative**2)), 0.0), *points)


class Evidence(NamedTuple):
    """What a record says near `centre`: log likelihood g' d - d' I d / 2, d the change of theta over its slope there.

    Not of u: parameters that leave K alone lie on a plane in theta (26), (27), and on a curved sheet in u.
    """

    centre: FloatArray       # (d,)
    gradient: FloatArray     # (d,)
    information: FloatArray  # (d, d)

    @classmethod
    def none(cls, size: int) -> "Evidence":
        """Return the evidence of no record."""
        return cls(np.zeros(size), np.zeros(size), np.zeros((size, size)))

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


def most_probable(prior: Prior, data: Evidence, draws: Draws, *, steps: int = 60, halvings: int = 12,
                  close: float = 1e-9) -> "Pieces[FloatArray]":
    """Return the most probable u of each row, given its own prior mean, error of the points and pull of the data.

    With zeros it is the mode; with the errors drawn it is a draw of the posterior, exact where all is linear
    (randomised maximum likelihood, Oliver 1996). Gauss-Newton steps, halved until the cost falls, ended by one of
    `close`.
    """
    u0, shift, pull = draws
    if not prior.y.size and not data.information.any():
        return u0.copy()

    def cost(u: FloatArray) -> FloatArray:
        near = data.change(prior, u)
        squares = ((u - u0) ** 2).sum(-1) + ((prior.off(u) + shift) ** 2).sum(-1)
        return np.asarray(0.5 * (squares + (near @ data.information * near).sum(-1))
                          - ((data.gradient + pull) * near).sum(-1))

    u, now = u0.copy(), cost(u0)
    for _ in range(steps):
        yield
        J, slope = prior.off_slope(u), data.slope(prior, u)
        hessian = np.eye(u.shape[1]) + J.swapaxes(1, 2) @ J + slope[:, :, None] * data.information * slope[:, None, :]
        descent = (u0 - u - np.einsum("rpi,rp->ri", J, prior.off(u) + shift)
                   + slope * (data.gradient + pull - data.change(prior, u) @ data.information))
        step, reach = np.linalg.solve(hessian, descent[..., None])[..., 0], np.ones(u.shape[0])
        for _ in range(halvings):
            tried = cost(u + reach[:, None] * step)
            worse = ~(tried <= now + 1e-12 * np.abs(now)) & (np.abs(reach[:, None] * step).max(axis=1) >= close)
            if not worse.any():
                break
            reach[worse] *= 0.5
        reach[worse] = 0.0
        u, now = u + reach[:, None] * step, np.where(reach > 0.0, tried, now)
        if np.abs(reach[:, None] * step).max() < close:
            break
    if not np.isfinite(now).all():
        raise SolverError("the prior cannot be brought onto the known points; check K there, or widen prior")
    return u


Result = TypeVar("Result")
Pieces = Generator[None, None, Result]


def finish(work: Pieces[Result]) -> Result:
    """Do all of the work at once."""
    return Job(work).run(None)  # type: ignore[return-value]


class Job(Generic[Result]):
    """Work that is done a few pieces at a time; what comes out does not depend on how many."""

    def __init__(self, work: Pieces[Result]) -> None:
        self.work, self.done, self.finished = work, 0, False
        self.result: Result | None = None

    def run(self, pieces: int | None) -> Result | None:
        """Do at most some pieces, all that are left for None; return the result once there is one."""
        while not self.finished and (pieces is None or pieces > 0):
            try:
                next(self.work)
            except StopIteration as end:
                self.result, self.finished = end.value, True
            self.done += 1
            pieces = None if pieces is None else pieces - 1
        return self.result
