"""Levenberg-Marquardt with exact derivatives, sign limits and a standard normal prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.noise import Noise, white
from radiation_ss.gap.posterior.problem import Point, Problem, whitened

STALLED = 0.05  # nats a pass


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
    root : ndarray, shape (nq, nq)
        Upper triangular; root' root = J'J + 1 is the curvature.
    converged : bool
    gain : float
        How much the last pass lowered the cost.
    """

    problem: Problem
    q: FloatArray
    point: Point
    noise: Noise
    cost: float
    root: FloatArray
    converged: bool
    gain: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether the cost falls no more by what matters for evidence, converged or not."""
        return self.converged or self.gain < STALLED

    @property
    def covariance(self) -> FloatArray:
        """Posterior covariance of q."""
        inverse: FloatArray = solve_triangular(self.root, np.eye(self.q.size))
        return inverse @ inverse.T

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the curvature."""
        return 2.0 * float(np.sum(np.log(np.abs(np.diag(self.root)))))

    @property
    def pulls(self) -> dict[str, float]:
        """How far each nominal number moved, in standard deviations of its tolerance."""
        terms = self.problem.setting.nominal
        return {f"{t.active.name.removeprefix('nominal_')} {t.active.dof}": float(self.q[k])
                for k, t in enumerate(terms)}


def fit(problem: Problem, noise: Noise, start: FloatArray, *, passes: int = 25, tolerance: float = 1e-3,
        known: Point | None = None) -> Fit:
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

    Raises
    ------
    SolverError
        If the motion grows without bounds at the start already; later, such a step is shortened.
    """
    lower = problem.limits()
    q = np.maximum(start, lower)
    point = known if known is not None else problem.at(q)
    damping, converged, gain = 1e-6, False, 0.0
    for _ in range(passes):
        root, right = reduced(point, noise, q)
        cost, moved = half_square(whitened(point, noise)[0], q), None
        while damping < 1e8 and moved is None and not converged:
            step = limited_step(q, root, right, lower, damping)
            promise = 0.5 * float(right @ right - np.sum((right - root @ step) ** 2))
            converged = promise < tolerance
            moved = None if converged else attempt(problem, noise, q + step, cost)
            damping = damping if moved is not None or converged else max(10.0 * damping, 1e-3)
        if moved is None:
            gain = 0.0
            break
        gain = cost - half_square(whitened(moved, noise)[0], q + step)
        q, point, damping = q + step, moved, max(damping / 10.0, 1e-9)
    root, _ = reduced(point, noise, q)
    return Fit(problem, q, point, noise, half_square(whitened(point, noise)[0], q), root, converged, gain)


def reduced(point: Point, noise: Noise, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return R and b of the linearised problem min |b - R step|^2, prior included, by an orthogonal reduction."""
    r, J = whitened(point, noise)
    assert J is not None
    # The normal equations are faster and good enough unless directions are almost collinear.
    square, right = J.T @ J + np.eye(q.size), J.T @ r - q
    size = np.sqrt(np.diag(square))
    try:
        upper: FloatArray = cholesky(square / np.outer(size, size))
    except LinAlgError:
        upper = np.zeros((1, 1))
    if np.abs(np.diag(upper)).min() > 1e-5:
        return upper * size, solve_triangular(upper, right / size, trans="T")
    table = np.block([[J, r[:, None]], [np.eye(q.size), -q[:, None]]])
    triangle: FloatArray = np.linalg.qr(table, mode="r")  # type: ignore[assignment]
    return triangle[: q.size, : q.size], triangle[: q.size, q.size]


def attempt(problem: Problem, noise: Noise, q: FloatArray, cost: float) -> Point | None:
    """Return the point at q if its cost is lower, else None."""
    try:
        point = problem.at(q)
    except SolverError:
        return None
    r = np.concatenate([noise.whiten(i, value) for i, value in enumerate(point.residuals)])
    value = half_square(r, q)
    return point if np.isfinite(value) and value < cost else None


def half_square(r: FloatArray, q: FloatArray) -> float:
    """Return half the sum of squares of residuals and prior."""
    return 0.5 * float(r @ r + q @ q)


def limited_step(q: FloatArray, root: FloatArray, right: FloatArray, lower: FloatArray, damping: float) -> FloatArray:
    """Return the damped Newton step that keeps to the lower limits: entries that run into one are held there."""
    held = (q <= lower) & (root.T @ right < 0.0)
    size = np.sqrt(damping * np.sum(root**2, axis=0))
    step = np.zeros(q.size)
    for _ in range(q.size):
        free = ~held
        matrix = np.concatenate([root[:, free], np.diag(size[free])])
        target = np.concatenate([right - root[:, held] @ step[held], np.zeros(int(free.sum()))])
        step[free] = np.linalg.lstsq(matrix, target, rcond=None)[0]
        beyond = free & (q + step < lower)
        if not beyond.any():
            return step
        step[beyond] = lower[beyond] - q[beyond]
        held = held | beyond
    return step


def refit(found: Fit, noise: Noise, passes: int = 25) -> Fit:
    """Continue a fit under another noise."""
    return fit(found.problem, noise, found.q, known=found.point, passes=passes)


def fit_free_noise(problem: Problem, floors: tuple[float, ...], noise: Noise, start: FloatArray, *,
                   ceiling: float = np.inf, known: Point | None = None) -> Fit:
    """Fit with white noise as large as the residual it leaves, not below the floors; both converge together.

    A fit whose `residual_energy` is above the ceiling and does not fall fast enough to get below it is given up: a
    rival is better beyond doubt.
    """
    found, before = fit(problem, noise, start, passes=3, tolerance=0.1, known=known), np.inf
    for attempts in range(8):
        energy = residual_energy(found)
        if energy > ceiling and (attempts > 1 or before - energy < energy - ceiling):
            break
        before = energy
        noise = residual_noise(found.point.residuals, floors)
        done = max(abs(np.log(a / b)) for a, b in zip(noise.deviation, found.noise.deviation)) < 0.02
        found = refit(found, noise, 25 if done else 3)
        if done and found.converged:
            break
    return found


def residual_energy(found: Fit) -> float:
    """Return the log of the residuals' energy, each channel by its own size: what a fit with free noise minimises."""
    return sum(r.size * np.log(np.mean(r**2) + 1e-300) for r in found.point.residuals) + float(found.q @ found.q)


def residual_noise(residuals: list[FloatArray], floors: tuple[float, ...]) -> Noise:
    """Return white noise as large as the residuals, not below the floors."""
    return white([max(float(np.sqrt(np.mean(r**2))), floor) for r, floor in zip(residuals, floors)])
