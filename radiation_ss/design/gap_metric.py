"""Robustness by the nu-gap: how far apart two plants are for feedback, and how far a controller reaches.

Vinnicombe (1993), "Frequency domain uncertainty and the graph topology", IEEE TAC 38(9); Zhou & Doyle (1998), ch. 17.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, matrix_balance, solve_continuous_are, solve_triangular

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.body.time_step import UNDO, Matrices
from radiation_ss.errors import InputError, SolverError
from radiation_ss.fit.rational import frequency_response

if TYPE_CHECKING:
    import control as ct


def gap_metric(P1: ct.StateSpace | ct.TransferFunction, P2: ct.StateSpace | ct.TransferFunction, *,
               input_scale: ArrayLike | None = None, output_scale: ArrayLike | None = None) -> float:
    """Return Vinnicombe's nu-gap between two plants, 0 (the same to any feedback) to 1 (nothing in common).

    It compares what goes from inputs to outputs: modes that no input reaches, or no output shows, are left out, and
    counted by `robust_margin`. A controller with margin b(P1, C) > gap stabilises P2, and arcsin b(P2, C) >= arcsin
    b(P1, C) - arcsin gap. The winding-number condition is checked by counting zeros, not on a grid; where it fails the
    gap is 1.

    Parameters
    ----------
    P1, P2 : control.StateSpace or control.TransferFunction
        Same numbers of inputs and outputs, same time step.
    input_scale, output_scale : array_like, optional
        One unit of each input and output, e.g. the largest force and the largest motion meant. The gap compares gains
        with 1: a body whose motion per newton is 1e-6 must be scaled.

    Raises
    ------
    InputError
        If sizes or time steps differ, or P1 or P2 is no system, or one that differentiates.
    SolverError
        If no normalised coprime factorisation is found.

    Examples
    --------
    >>> import control as ct
    >>> import radiation_ss as rss
    >>> plant = ct.ss(ct.tf([1.0], [1.0, 1.0]))
    >>> round(rss.gap_metric(plant, plant), 6)
    0.0
    """
    first, second = (without_hidden(*continuous(P, input_scale, output_scale, name))
                     for P, name in ((P1, "P1"), (P2, "P2")))
    if first[3].shape != second[3].shape or P1.dt != P2.dt:
        raise InputError(f"P1, P2: sizes {first[3].shape} and {second[3].shape}, time steps {P1.dt} and {P2.dt}; "
                         "they must agree")
    right, other = right_graph(*first), right_graph(*second)
    # The plants' graphs meet in [N; M]; their images under the other's complement are the gap, under its adjoint the
    # winding number.
    if not winds_as_needed(right, other):
        return 1.0
    return min(hinf_norm(*series(left_complement(*second), right)), 1.0)


def robust_margin(P: ct.StateSpace | ct.TransferFunction, C: ct.StateSpace | ct.TransferFunction | ArrayLike, *,
                  input_scale: ArrayLike | None = None, output_scale: ArrayLike | None = None) -> float:
    """Return the margin b(P, C) = 1 / || [P; I] (I + C P)^-1 [C  I] ||_inf of a negative feedback u = -C y, 0 to 1.

    0 if the loop is not stable; a mode on the stability limit or beyond it that the other does not move counts, too.
    0.3 is comfortable: about 5 dB and 35 degrees at every frequency. A gain margin of at least (1 + b)/(1 - b) and a
    phase margin of at least 2 arcsin b follow.

    Parameters
    ----------
    P : control.StateSpace or control.TransferFunction
    C : control.StateSpace, control.TransferFunction or array_like
        The controller as `ct.feedback(P, C)` takes it; a matrix is a gain.
    input_scale, output_scale : array_like, optional
        As for `gap_metric`; the controller is scaled inversely.

    Examples
    --------
    The margin of 1/s with unit feedback is 1/sqrt(2).

    >>> import control as ct
    >>> import radiation_ss as rss
    >>> round(rss.robust_margin(ct.ss(ct.tf([1.0], [1.0, 0.0])), 1.0), 4)
    0.7071
    """
    import control as ct

    a, b, c, d = continuous(P, input_scale, output_scale, "P")
    if not isinstance(C, ct.StateSpace | ct.TransferFunction):
        C = ct.ss([], [], [], read_only(np.atleast_2d(C), "C", (None, None)), P.dt)
    e, f, g, h = continuous(C, output_scale, input_scale, "C")
    if h.shape != d.shape[::-1] or (P.dt != C.dt and a.size and e.size):
        raise InputError(f"C: {h.shape[0]} outputs and {h.shape[1]} inputs at dt = {C.dt}; the plant needs "
                         f"{d.shape[1]} and {d.shape[0]} at dt = {P.dt}")
    n_out, n_in = d.shape
    algebraic = np.eye(n_in) + h @ d
    if np.linalg.cond(algebraic) > 1e12:
        return 0.0
    # u = w2 - C (y + w1), y = P u: inputs (w1, w2), outputs (y, u).
    E = np.linalg.inv(algebraic)
    state = np.block([[a - b @ E @ h @ c, -b @ E @ g], [f @ (c - d @ E @ h @ c), e - f @ d @ E @ g]])
    drive = np.block([[-b @ E @ h, b @ E], [f @ (np.eye(n_out) - d @ E @ h), f @ d @ E]])
    read = np.block([[c - d @ E @ h @ c, -d @ E @ g], [-E @ h @ c, -E @ g]])
    direct = np.block([[-d @ E @ h, d @ E], [-E @ h, E]])
    poles = np.linalg.eigvals(state)
    if poles.size and poles.real.max() >= -1e-12 * np.abs(poles).max():
        return 0.0
    return 1.0 / hinf_norm(state, drive, read, direct)


def continuous(system: ct.StateSpace | ct.TransferFunction, input_scale: ArrayLike | None,
               output_scale: ArrayLike | None, name: str) -> Matrices:
    """Return scaled continuous matrices; a discrete system by z = (1 + s)/(1 - s), which keeps the nu-gap."""
    import control as ct

    if not isinstance(system, ct.StateSpace | ct.TransferFunction):
        raise InputError(f"{name}: {type(system).__name__} found; a ct.StateSpace or a ct.TransferFunction is needed")
    if isinstance(system, ct.TransferFunction) and any(
            np.trim_zeros(num, "f").size > np.trim_zeros(den, "f").size
            for nums, dens in zip(system.num, system.den) for num, den in zip(nums, dens)):
        raise InputError(f"{name}: a numerator of higher degree than its denominator, which no state-space system has; "
                         "put fast poles on what differentiates")
    system = ct.ss(system)
    a, b, c, d = whole = system.A, system.B, system.C, system.D
    if system.isdtime(strict=True):
        a, b, c, d = UNDO["tustin"](whole, 2.0)
    u, y = scale(input_scale, d.shape[1], "input_scale"), scale(output_scale, d.shape[0], "output_scale")
    return a, b * u, c / y[:, None], d * u / y[:, None]


def scale(value: ArrayLike | None, size: int, name: str) -> FloatArray:
    """Return one positive unit for each signal."""
    units = read_only(np.ones(size) if value is None else np.atleast_1d(value), name, (None,))
    if units.size not in (1, size) or not np.all(units > 0.0):
        raise InputError(f"{name}: {units.tolist()}; one positive number, or one for each of the plant's {size}, is "
                         "needed")
    return np.broadcast_to(units, (size,))


def without_hidden(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Matrices:
    """Return the part of a system, stable or not, that its inputs reach and its outputs show.

    The balanced one of `fit` asks for Gramians, which only a stable system has.
    """
    for _ in range(2):  # reached, then, in the transposed system, shown
        a, (size, _) = matrix_balance(a, permute=False, separate=True) if a.size else (a, (np.ones(0), None))
        b, c = b / size[:, None], c * size
        basis = reached(a, b)
        a, b, c, d = (basis.T @ a @ basis).T, (c @ basis).T, (basis.T @ b).T, d.T
    return a, b, c, d


def reached(a: FloatArray, b: FloatArray, least: float = 1e-10) -> FloatArray:
    """Return an orthonormal basis (N, k) of the states that inputs reach, but for shares below `least`."""
    basis, new, size = np.zeros((len(a), 0)), b, np.linalg.norm(b, 2) if b.size else 0.0
    while new.shape[1]:
        new = new - basis @ (basis.T @ new)
        left, part, _ = np.linalg.svd(new - basis @ (basis.T @ new), full_matrices=False)
        new = left[:, part > least * size]
        basis = np.hstack([basis, new])
        new, size = a @ new, np.linalg.norm(a, 2) if a.size else 0.0
    return basis


def right_graph(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Matrices:
    """Return the normalised right graph symbol [N; M], P = N M^-1, N~N + M~M = I; stable."""
    R, X = np.eye(d.shape[1]) + d.T @ d, np.zeros((0, 0))
    try:
        X = solve_continuous_are(a, b, c.T @ c, R, s=c.T @ d) if a.size else X
    except (LinAlgError, ValueError) as error:
        raise SolverError(f"plant: no normalised coprime factorisation ({error})") from None
    F = -np.linalg.solve(R, b.T @ X + d.T @ c)
    root = np.linalg.inv(np.linalg.cholesky(R)).T  # R = U U^T gives root root^T = R^-1
    return a + b @ F, b @ root, np.vstack([c + d @ F, F]), np.vstack([d, np.eye(d.shape[1])]) @ root


def left_complement(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Matrices:
    """Return [M~, -N~] of the normalised left factorisation P = M~^-1 N~: it annihilates the plant's own graph."""
    A, B, C, D = right_graph(a.T, c.T, b.T, d.T)  # of the transposed plant: [N~^T; M~^T]
    n = d.shape[1]
    return A.T, np.hstack([C.T[:, n:], -C.T[:, :n]]), B.T, np.hstack([D.T[:, n:], -D.T[:, :n]])


def series(second: Matrices, first: Matrices) -> Matrices:
    """Return second * first."""
    a1, b1, c1, d1 = first
    a2, b2, c2, d2 = second
    a = np.block([[a1, np.zeros((a1.shape[0], a2.shape[0]))], [b2 @ c1, a2]])
    return a, np.vstack([b1, b2 @ d1]), np.hstack([d2 @ c1, c2]), d2 @ d1


def winds_as_needed(first: Matrices, second: Matrices) -> bool:
    """Return whether det(G2~ G1) does not vanish on the axis and winds zero times: as many unstable zeros as poles."""
    a, b, c, d = second
    a, b, c, d = series((-a.T, -c.T, b.T, d.T), first)  # G~(s) = G(-s)^T
    if abs(np.linalg.det(d)) < 1e-12:
        return False
    zeros, poles = np.linalg.eigvals(a - b @ np.linalg.solve(d, c)), np.linalg.eigvals(a)
    return int(np.sum(zeros.real > 0.0)) == int(np.sum(poles.real > 0.0))


def hinf_norm(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, tolerance: float = 1e-9) -> float:
    """Return the largest singular value over all frequencies of a stable system (Bruinsma & Steinbuch 1990).

    The bound rises to the largest value between its crossings, eigenvalues of a Hamiltonian matrix, until there are
    none.
    """
    direct = float(np.linalg.norm(d, 2))
    if a.size == 0:
        return direct
    poles = np.linalg.eigvals(a)
    start = np.concatenate([[0.0], np.abs(poles), np.abs(poles.imag)])
    bound = max(direct, peak(a, b, c, d, start))
    if bound == 0.0:
        return 0.0
    for _ in range(60):
        level = (1.0 + tolerance) * bound
        frequencies = crossings(a, b, c, d, level)
        if frequencies.size == 0:
            return bound
        higher = peak(a, b, c, d, np.concatenate([0.5 * (frequencies[1:] + frequencies[:-1]), frequencies]))
        if higher <= level:
            return max(bound, higher)
        bound = higher
    raise SolverError("H-infinity norm: no convergence in 60 steps")


def peak(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, omega: FloatArray) -> float:
    """Return the largest singular value over some frequencies."""
    return float(np.linalg.norm(frequency_response(a, b, c, omega) + d, 2, axis=(1, 2)).max())


def crossings(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, level: float) -> FloatArray:
    """Return the frequencies >= 0 where a singular value equals the level, ascending."""
    R = level**2 * np.eye(d.shape[1]) - d.T @ d
    S = level**2 * np.eye(d.shape[0]) - d @ d.T
    half = solve_triangular(np.linalg.cholesky(R), b.T, lower=True)  # b R^-1 b^T = half^T half
    drift = a + b @ np.linalg.solve(R, d.T @ c)
    hamiltonian = np.block([[drift, level * half.T @ half], [-level * c.T @ np.linalg.solve(S, c), -drift.T]])
    values = np.linalg.eigvals(hamiltonian)
    near = np.abs(values.real) <= 1e-7 * np.maximum(np.abs(values), 1e-3 * np.abs(values).max())
    return np.unique(np.abs(values[near].imag))
