"""Passive memories: which parameters give one, and the nearest that do."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.certificate import PASSIVE
from radiation_ss.inference.parameters import Parametrisation


def frequencies(form: Parametrisation, count: int = 120) -> FloatArray:
    """Return 0 and frequencies [rad/s] from far below the slowest pole of the prior mean to far above its fastest."""
    sizes = np.abs(np.linalg.eigvals(form.realise(form.mean).a))
    return np.r_[0.0, np.geomspace(0.02 * sizes.min(), 50.0 * sizes.max(), count)]


def passive(form: Parametrisation, theta: FloatArray, slack: float = PASSIVE, chunk: int = 200) -> np.ndarray:
    """Return whether the Hermitian part of K is positive semidefinite, shape (S,), for theta of shape (S, d).

    K is symmetric, so its Hermitian part is Re K; each degree of freedom is scaled by its own largest damping, of which
    a share `slack` may be missing.
    """
    omega, out = frequencies(form), np.zeros(theta.shape[0], dtype=bool)
    for start in range(0, theta.shape[0], chunk):
        damping = form.K(theta[start:start + chunk], omega).real
        size = np.sqrt(np.abs(np.einsum("swjj->swj", damping)).max(axis=1)) + 1e-300
        damping = damping / (size[:, None, :, None] * size[:, None, None, :]) + slack * np.eye(len(form.dofs))
        out[start:start + chunk] = positive_definite(damping).all(axis=1)
    return out


def positive_definite(matrices: FloatArray) -> np.ndarray:
    """Return which symmetric matrices, shape (..., n, n), are positive (semi)definite: no pivot is negative."""
    good, left = np.ones(matrices.shape[:-2], dtype=bool), matrices
    while left.shape[-1]:
        pivot, column = left[..., 0, 0], left[..., 1:, 0]
        good &= pivot >= 0.0
        left = left[..., 1:, 1:] - column[..., :, None] * (column / np.maximum(pivot, 1e-300)[..., None])[..., None, :]
    return good


def nearest_passive(form: Parametrisation, theta: FloatArray, draws: FloatArray) -> tuple[FloatArray, str]:
    """Return theta, moved as little as needed to be passive (certified), and what was done ("" if nothing).

    The way leads to the nearest passive draw, distances in standard deviations of the draws; without any, to the prior
    mean. `theta` (d,). `draws` (S, d).
    """
    certificate = form.realise(theta).certificate
    if certificate.passive:
        return theta, ""
    spread = np.where(draws.std(axis=0) > 0.0, draws.std(axis=0), 1.0)
    where = f"negative damping at {certificate.worst_omega:.3g} rad/s" if certificate.stable else "an unstable pole"
    order = np.argsort(np.sum(((draws - theta) / spread) ** 2, axis=1))
    goal = next((draws[i] for i in order[passive(form, draws[order])] if form.realise(draws[i]).passive), form.mean)
    if not form.realise(goal).passive:
        return theta, f"the fit of the mean parameters has {where}, and no passive one was found near it"
    low, high = 0.0, 1.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        inside = form.realise(form.tied(theta + middle * (goal - theta))).passive
        low, high = (low, middle) if inside else (middle, high)
    moved, omega = form.tied(theta + high * (goal - theta)), frequencies(form)
    K = form.K(theta, omega)
    change = np.linalg.norm(form.K(moved, omega) - K) / np.linalg.norm(K)
    return moved, (f"the fit of the mean parameters has {where}; the fit handed on is passive, "
                   f"its K {100 * change:.2g} % away")
