"""Fit radiation subsystems to hydrodynamic data."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.fit.joint import fit_joint
from radiation_ss.fit.problem import Problem, block_problem, blocks_of
from radiation_ss.fit.result import RadiationFit
from radiation_ss.fit.score import entry_errors, joint_error
from radiation_ss.hydro.data import HydroData

INDEPENDENT = 0.1
"""Directions of motion whose K is below this part of the largest singular value add no states."""


def fit_radiation(data: HydroData, order: int | None = None, *, at_zero: str | float | ArrayLike = "free",
                  points: ArrayLike | None = None, weight: ArrayLike | None = None, seed: int = 0) -> RadiationFit:
    """Fit a stable, passive, reciprocal, strictly proper model of K(s) to B + i w (A - A_inf).

    Parameters
    ----------
    data : HydroData
        With A_inf.
    order : int, optional
        States for each independent degree of freedom. None: the smallest whose error falls by less than a fifth when
        the order is raised by two.
    at_zero : "free", "zero" or array_like
        K(0): free; exactly zero, as for bodies in three dimensions; or a value, a number for one degree of freedom,
        else an (n, n) matrix. In two dimensions and finite depth K(0) is not zero.
    points : array_like, optional
        Frequencies [rad/s] within the band where K is met exactly (25)-(27).
    weight : array_like, shape (nw,) or (nw, n, n), optional
        Weights of the squared misfits; by default all samples count alike.
    seed : int
        Of the random starts.

    Returns
    -------
    RadiationFit

    Raises
    ------
    InputError
        If the data or an option cannot be used.
    SolverError
        If no model was found that meets the frequency points.
    """
    _check(data, order, at_zero)
    wanted = _points(points, data)
    weights = _weights(weight, data)
    found, blocks = [], [block for block in blocks_of(data)]
    if not blocks:
        raise InputError(f"{data.source or 'data'}: K is zero for {', '.join(data.dofs)}; there is nothing to fit")
    for block in blocks:
        problem = block_problem(data, block, at_zero=at_zero, points=wanted, weight=weights)
        found.append(_fit_block(problem, order, seed))
    a = block_diag(*[f[0] for f in found])
    b = np.zeros((a.shape[0], data.n))
    row = 0
    for block, (_, part, _order) in zip(blocks, found):
        b[row:row + part.shape[0], block] = part
        row += part.shape[0]
    fitted = RadiationFit(data.dofs, a, b, b.T, order=max(f[2] for f in found), A_inf=data.A_inf, method="joint",
                          at_zero=at_zero if isinstance(at_zero, str) else np.asarray(at_zero).tolist(),
                          points=tuple(wanted.tolist()), data=data,
                          blocks=tuple(tuple(data.dofs[i] for i in block) for block in blocks))
    K = fitted.frequency_response(data.omega)
    return fitted.replace(relative_error=joint_error(data, K), entry_error=entry_errors(data, K))


def _fit_block(problem: Problem, order: int | None, seed: int) -> tuple[FloatArray, FloatArray, int]:
    """Return (a, b, order) of one block."""
    rank = _independent(problem)
    if order is not None:
        a, b, _ = fit_joint(problem, order * rank, seed=seed)
        return a, b, order
    order = 2
    a, b, error = fit_joint(problem, order * rank, seed=seed)
    while order < 10:
        next_a, next_b, next_error = fit_joint(problem, (order + 2) * rank, seed=seed)
        if next_error > 0.8 * error:
            break
        order, a, b, error = order + 2, next_a, next_b, next_error
    return a, b, order


def _independent(problem: Problem) -> int:
    """Return how many combinations of motions radiate on their own: surge and pitch of a sphere are one."""
    m = problem.m
    full = np.zeros((problem.x.size, m, m), dtype=complex)
    upper = np.triu_indices(m)
    full[:, upper[0], upper[1]] = problem.K
    full[:, upper[1], upper[0]] = problem.K
    sizes = np.linalg.svd(full.reshape(-1, m), compute_uv=False)
    return int(np.sum(sizes > INDEPENDENT * sizes[0]))


def _check(data: HydroData, order: int | None, at_zero: object) -> None:
    """Refuse what cannot be fitted."""
    if order is not None and order < 1:
        raise InputError(f"order: {order} found; at least 1 is needed (2 with at_zero='zero')")
    if data.omega.size < 3:
        raise InputError(f"{data.source or 'data'}: {data.omega.size} frequencies; at least 3 are needed for a fit")
    if isinstance(at_zero, str) and at_zero not in ("free", "zero"):
        raise InputError(f"at_zero: {at_zero!r} found; use 'free', 'zero' or a value [N s/m and so on]")


def _points(points: ArrayLike | None, data: HydroData) -> FloatArray:
    """Return the frequency points, checked."""
    wanted = np.unique(np.zeros(0) if points is None else np.atleast_1d(np.asarray(points, dtype=float)))
    outside = (wanted < data.omega[0]) | (wanted > data.omega[-1])
    if outside.any():
        raise InputError(f"points: {wanted[outside][0]:g} rad/s lies outside the data "
                         f"({data.omega[0]:g} to {data.omega[-1]:g} rad/s)")
    return wanted


def _weights(weight: ArrayLike | None, data: HydroData) -> FloatArray | None:
    """Return the weights, checked."""
    if weight is None:
        return None
    values = np.asarray(weight, dtype=float)
    if values.shape not in ((data.omega.size,), data.B.shape):
        raise InputError(f"weight: shape {values.shape} found; ({data.omega.size},) or {data.B.shape} needed")
    if not np.isfinite(values).all() or (values < 0.0).any() or not values.any():
        raise InputError("weight: must be finite, not negative, and not all zero")
    return values
