"""Levenberg-Marquardt with exact derivatives, sign limits, a standard normal prior; the discrepancy is eliminated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.eliminated import Eliminated, eliminated
from radiation_ss.gap.posterior.noise import Noise, white
from radiation_ss.gap.posterior.problem import Point, Problem, whitened
from radiation_ss.gap.posterior.steps import Curvature, Place, curvature, limited_step, placed

STALLED = 0.05  # nats: what matters for evidence is more
ATTEMPTS = 8  # at the noise that a fit leaves
PATIENCE, LONG = 4, 8  # passes: while candidates are sought, and under the common noise
FIRST, LEAST, MOST = 1e-6, 1e-9, 1e8  # damping, relative to the curvature's diagonal


@dataclass(frozen=True, eq=False)
class Fit:
    """A maximum of the posterior.

    Parameters
    ----------
    problem : Problem
    q : ndarray, shape (nq,)
    point : Point
        Residuals and derivatives there.
    noise : Noise
    cost : float
        Half the sum of squares of whitened residuals and prior.
    curve : Curvature
        By the parameters other than the discrepancy.
    discrepancy : Eliminated or None
        Where the setting has any.
    converged : bool
    gain : float
        How much the last pass lowered the cost.
    """

    problem: Problem
    q: FloatArray
    point: Point
    noise: Noise
    cost: float
    curve: Curvature
    discrepancy: Eliminated | None
    converged: bool
    gain: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether the cost falls no more by what matters for evidence, converged or not."""
        return self.converged or self.gain < STALLED

    @cached_property
    def covariance(self) -> FloatArray:
        """Posterior covariance of q, shape (nq, nq)."""
        inverse = solve_triangular(self.curve.root, np.eye(self.curve.root.shape[0]))
        rolled: FloatArray = inverse @ inverse.T
        if self.discrepancy is None:
            return rolled
        root = self.discrepancy.root
        follows = -solve_triangular(root, self.curve.cross)  # how the discrepancy's optimum moves with the others
        moved = follows @ rolled
        own = np.asarray(cho_solve((root, False), np.eye(root.shape[0]))) + moved @ follows.T
        return np.block([[rolled, moved.T], [moved, own]])

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the curvature by all of q."""
        roots = [self.curve.root] if self.discrepancy is None else [self.curve.root, self.discrepancy.root]
        return 2.0 * float(sum(np.sum(np.log(np.abs(np.diag(root)))) for root in roots))

    @property
    def slopes(self) -> list[FloatArray]:
        """Derivatives of each channel's prediction by all of q, the discrepancy's directions included."""
        found = self.point.slopes or []
        if self.discrepancy is None:
            return found
        return [np.concatenate(pair, axis=1) for pair in zip(found, self.problem.setting.discrepancy)]

    def whitened(self) -> tuple[FloatArray, FloatArray]:
        """Return residuals and derivatives by all of q in units of the noise, all channels stacked."""
        r, J = whitened(Point(self.point.residuals, self.slopes), self.noise)
        assert J is not None
        return r, J

    @property
    def pulls(self) -> dict[str, float]:
        """How far each nominal number moved, in standard deviations of its tolerance."""
        terms = self.problem.setting.nominal
        return {f"{t.active.name.removeprefix('nominal_')} {t.active.dof}": float(self.q[k])
                for k, t in enumerate(terms)}


def fit(problem: Problem, noise: Noise, start: FloatArray, *, passes: int = 25, tolerance: float = 1e-3,
        known: Point | None = None, patience: int = 25) -> Fit:
    """Maximise the posterior.

    Parameters
    ----------
    problem : Problem
    noise : Noise
    start : ndarray, shape (nq,)
    passes : int
        Most iterations.
    tolerance : float
        Converged when a step promises a gain of log posterior below this.
    known : Point, optional
        Residuals and derivatives at the start, if they are known.
    patience : int
        Where as many passes together gain less than `STALLED`, the fit counts as converged: kinks that friction leaves
        in the cost can make it creep for long.

    Raises
    ------
    SolverError
        If the motion grows without bounds at the start already; later, such a step is shortened.
    """
    free = eliminated(problem.setting, noise) if problem.setting.unnamed else None
    q, damping, converged, gain = np.maximum(start, problem.limits()), FIRST, False, 0.0
    costs: list[float] = []
    here = placed(problem, noise, free, q, known if known is not None else problem.at(q))
    curve = curvature(here, noise, free)
    for _ in range(passes):
        costs.append(here.cost)
        if len(costs) > patience and costs[-1 - patience] - here.cost < STALLED:
            converged = True
            break
        moved, promise, damping = descend(problem, noise, free, here, curve, damping, tolerance)
        if moved is None:
            converged, gain = promise < tolerance, 0.0
            break
        gain = here.cost - moved.cost
        here, curve, damping = moved, curvature(moved, noise, free), max(0.1 * damping, LEAST)
    return Fit(problem, here.q, here.point, noise, here.cost, curve, free, converged, gain)


def descend(problem: Problem, noise: Noise, free: Eliminated | None, here: Place, curve: Curvature, damping: float,
            tolerance: float) -> tuple[Place | None, float, float]:
    """Return a place of lower cost, the gain promised there and the damping that led to it.

    No place if the promise is below the tolerance, or if no step keeps its promise at all.
    """
    lower = np.maximum(problem.limits(), problem.reach(here.q))
    while damping < MOST:
        step = limited_step(here.q, curve, lower, damping)
        promise = curve.promise(step)
        moved = attempt(problem, noise, free, here, step) if promise >= tolerance else None
        if moved is not None or promise < tolerance:
            return moved, promise, damping
        damping = max(10.0 * damping, 1e-3)
    return None, np.inf, damping


def attempt(problem: Problem, noise: Noise, free: Eliminated | None, here: Place, step: FloatArray) -> Place | None:
    """Return the place a step away, with derivatives, if its cost is lower, else None."""
    q = np.concatenate([here.q[: problem.rolled] + step, np.zeros(problem.setting.unnamed)])
    try:
        place = placed(problem, noise, free, q, problem.at(q, slopes=False))
        if not np.isfinite(place.cost) or place.cost >= here.cost:
            return None
        slopes = problem.at(q, paths=place.point.paths).slopes
    except SolverError:
        return None
    return replace(place, point=replace(place.point, slopes=slopes))


def refit(found: Fit, noise: Noise, passes: int = 25, *, patience: int = 25) -> Fit:
    """Continue a fit under another noise."""
    return fit(found.problem, noise, found.q, known=found.point, passes=passes, patience=patience)


def fit_free_noise(problem: Problem, floors: tuple[float, ...], noise: Noise, start: FloatArray, *,
                   ceiling: float = np.inf, known: Point | None = None) -> Fit:
    """Fit with white noise as large as the residual it leaves, not below the floors; both settle together.

    A fit whose `residual_energy` is above the ceiling, and would not get below it if each attempt left lowered it as
    much as the last, is given up: a rival is better beyond doubt. A shape that may only halve in a pass takes several.
    """
    found, before = fit(problem, noise, start, passes=3, tolerance=0.1, known=known), np.inf
    for left in range(ATTEMPTS, 0, -1):
        energy = residual_energy(found)
        if energy > ceiling and left * (before - energy) < energy - ceiling:
            break
        before = energy
        noise = residual_noise(found.point.residuals, floors)
        done = max(abs(np.log(a / b)) for a, b in zip(noise.deviation, found.noise.deviation)) < 0.02
        found = refit(found, noise, 25 if done else 3, patience=PATIENCE)
        if done and found.settled:
            break
    return found


def residual_energy(found: Fit) -> float:
    """Return the log of the residuals' energy, each channel by its own size: what a fit with free noise minimises."""
    return sum(r.size * np.log(np.mean(r**2) + 1e-300) for r in found.point.residuals) + float(found.q @ found.q)


def residual_noise(residuals: list[FloatArray], floors: tuple[float, ...]) -> Noise:
    """Return white noise as large as the residuals, not below the floors."""
    return white([max(float(np.sqrt(np.mean(r**2))), floor) for r, floor in zip(residuals, floors)])
