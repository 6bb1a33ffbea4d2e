"""The exact time step of a linear system, and the continuous system behind a sampled one."""

import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.linalg import expm, logm

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def hold_matrices(a: FloatArray, b: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (F, held, after) of the exact step x_(k+1) = F x_k + (held - after) u_k + after u_(k+1), u linear between.

    `held` alone is the step for an input held constant. From one matrix exponential (Van Loan 1978). `a`, `b`
    (..., N, N), (..., N, n_in). `dt`: time step [s].
    """
    N, n = b.shape[-2:]
    block = np.zeros((*b.shape[:-2], N + 2 * n, N + 2 * n))
    block[..., :N, :N], block[..., :N, N:N + n] = a * dt, b * dt
    block[..., N:N + n, N + n:] = np.eye(n)
    whole = expm(block)[..., :N, :]
    return whole[..., :N], whole[..., N:N + n], whole[..., N + n:]


def continuous(system: Matrices, dt: float, rows: tuple[Sequence[int], Sequence[int]], name: str,
               tolerance: float = 1e-6) -> Matrices:
    """Return the continuous system behind a sampled one, by whichever method of python-control made it.

    Only by the right one are the outputs in the second of `rows`, velocities, the rates of those in the first,
    displacements, to a relative `tolerance`. InputError if none fits.
    """
    x, v = rows
    found = {method: undo(system, dt) for method, undo in UNDO.items()}

    def off(matrices: Matrices) -> float:
        F, G, H, J = matrices
        if not all(np.isfinite(part).all() for part in matrices):
            return np.inf
        size = [np.abs(part).max() + 1e-300 for part in (H[v], H[v] @ G, np.abs(H[x]).max() * G)]
        parts = (H[x] @ F - H[v], J[v], H[x] @ G)
        return max(float(np.abs(part).max() / one) for part, one in zip(parts, size))

    best = min(found.values(), key=off)
    if not off(best) < tolerance:
        raise InputError(f"{name}: sampled at dt = {dt:g} s, but by none of {', '.join(found)} are its velocities the "
                         "rates of its displacements; give the continuous system")
    F, G, H, J = best
    return F, G, H, np.where(np.abs(J) > tolerance * np.abs(J).max(), J, 0.0)


def _undo_weighted(system: Matrices, dt: float, weight: float) -> Matrices:
    """Undo a method that takes the rate at the end of a step with this weight, at its beginning with the rest."""
    A, B, C, D = system
    one = np.eye(len(A))
    with np.errstate(all="ignore"):
        try:
            a = np.asarray(np.linalg.solve((weight * A + (1.0 - weight) * one).T, (A - one).T).T / dt)
        except np.linalg.LinAlgError:
            a = np.full_like(A, np.nan)
    left = one - weight * dt * a
    b, c = left @ B / dt, C @ left
    return a, b, c, D - weight * c @ B


def _undo_hold(system: Matrices, dt: float, linear: bool) -> Matrices:
    """Undo an input that is held, or linear, between samples."""
    A, B, C, D = system
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its accuracy is judged by what comes out
        a = np.asarray(np.real(logm(A)) / dt, dtype=np.float64)
    if not np.isfinite(a).all():
        return a, B, C, D
    _, held, after = hold_matrices(a, np.eye(len(A)), dt)
    after = linear * after
    b = np.asarray(np.linalg.solve(held - after + A @ after, B))
    return a, b, C, D - C @ after @ b


UNDO: dict[str, Callable[[Matrices, float], Matrices]] = {
    "zoh": partial(_undo_hold, linear=False), "foh": partial(_undo_hold, linear=True),
    "tustin": partial(_undo_weighted, weight=0.5), "euler": partial(_undo_weighted, weight=0.0),
    "backward_diff": partial(_undo_weighted, weight=1.0)}
