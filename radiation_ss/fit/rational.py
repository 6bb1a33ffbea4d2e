"""Small state-space and rational models: vectorised evaluation, canonical and balanced forms."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag, expm, solve_continuous_lyapunov
from scipy.sparse.csgraph import connected_components

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError

Realisation = tuple[FloatArray, FloatArray, FloatArray]  # a, b, c


def frequency_response(a: FloatArray, b: FloatArray, c: FloatArray, omega: ArrayLike, whole: int = 50) -> ComplexArray:
    """Return c (i w I - a)^-1 b for all frequencies at once, shape (..., nw, n_out, n_in).

    A sum over the modes, sum_m R_m / (i w - pole_m); near multiple poles, a linear solve for each frequency. `a`, `b`,
    `c` (..., N, N), (..., N, n_in), (..., n_out, N): one model, or a stack of models of equal size. `omega` (nw,):
    circular frequencies [rad/s]. `whole`: states up to which one model is not looked at for independent
    parts, which costs more than it saves.
    """
    w = np.atleast_1d(np.asarray(omega, dtype=float))
    if a.ndim == 2 and a.shape[0] > whole:
        K = np.zeros((w.size, c.shape[0], b.shape[1]), dtype=complex)
        for states in connected(a):
            rows, columns = (np.flatnonzero(part.any(axis=axis)) for part, axis in ((c[:, states], 1), (b[states], 0)))
            K[:, rows[:, None], columns] += _response(a[np.ix_(states, states)], b[np.ix_(states, columns)],
                                                      c[np.ix_(rows, states)], w)
        return K
    return _response(a, b, c, w)


def _response(a: FloatArray, b: FloatArray, c: FloatArray, w: FloatArray) -> ComplexArray:
    if (found := modes(a, b, c)) is not None:
        return sum_of_modes(*found, w)
    resolvent = 1j * w[:, None, None] * np.eye(a.shape[-1]) - a[..., None, :, :]
    return c[..., None, :, :] @ np.linalg.solve(resolvent, b[..., None, :, :].astype(complex))


def connected(linked: NDArray) -> list[NDArray[np.int64]]:
    """Return the groups of connected positions, each ascending, of a matrix (n, n) of links: zero for none."""
    count, group = connected_components(linked != 0.0, directed=False)
    return [np.flatnonzero(group == k) for k in range(count)]


def impulse_response(a: FloatArray, b: FloatArray, c: FloatArray, t: ArrayLike) -> FloatArray:
    """Return c exp(a t) b, shape (nt, n_out, n_in), for times t >= 0 [s]; by modes, else by matrix exponentials."""
    times = np.atleast_1d(np.asarray(t, dtype=float))
    if (found := modes(a, b, c)) is not None:
        poles, residues = found
        flat = np.exp(times[:, None] * poles) @ residues.reshape(poles.size, c.shape[0] * b.shape[1])
        return np.ascontiguousarray(flat.real).reshape(times.size, c.shape[0], b.shape[1])
    return c @ expm(a * times[:, None, None]) @ b


def sum_of_modes(poles: ComplexArray, residues: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Return sum_m R_m / (i w - p_m), shape (..., nw, n_out, n_in), in real arithmetic (a third of the time).

    With d = w - Im p and q = 1 / (d^2 + (Re p)^2) a term is (-Re p - i d) q R: one product of a real matrix with the
    real [q; d q], whose rows run over the frequencies.
    """
    n_out, n_in = residues.shape[-2:]
    N, entries = poles.shape[-1], n_out * n_in
    R = np.swapaxes(residues.reshape(*poles.shape, entries), -1, -2)
    damping = -poles.real[..., None, :]
    matrix = np.concatenate([np.concatenate([damping * R.real, R.imag], axis=-1),
                             np.concatenate([damping * R.imag, -R.real], axis=-1)], axis=-2)
    terms = np.empty((*poles.shape[:-1], 2 * N, omega.size))
    q, dq = terms[..., :N, :], terms[..., N:, :]
    np.subtract(omega, poles.imag[..., None], out=dq)
    np.multiply(dq, dq, out=q)
    q += np.square(poles.real)[..., None]
    np.divide(1.0, q, out=q)
    dq *= q
    parts = np.swapaxes(matrix @ terms, -1, -2)
    K = np.empty((*poles.shape[:-1], omega.size, entries), dtype=complex)
    K.real, K.imag = parts[..., :entries], parts[..., entries:]
    return K.reshape(*K.shape[:-1], n_out, n_in)


def modes(a: FloatArray, b: FloatArray, c: FloatArray, worst: float = 1e4) -> tuple[ComplexArray, ComplexArray] | None:
    """Return poles and residues of c (s I - a)^-1 b, shapes (..., N), (..., N, n_out, n_in).

    None where any model is too near to a multiple pole: eigenvectors (rows scaled to one) of a condition above
    `worst` (the sum would lose more than four digits), or residues so much larger than the response that they cancel.
    """
    if a.shape[-1] == 0:
        return np.zeros(a.shape[:-1], dtype=complex), np.zeros((*a.shape[:-1], c.shape[-2], b.shape[-1]), dtype=complex)
    poles, vectors = np.linalg.eig(a)
    rows = np.sqrt(np.sum(np.abs(vectors) ** 2, axis=-1))
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    # Frobenius norm of the row-scaled inverse; that of the row-scaled vectors is sqrt(N).
    reverse = np.sum(np.abs(inverse) ** 2 * np.square(rows)[..., None, :], axis=(-2, -1))
    if np.any(reverse > worst**2):
        return None
    residues = np.swapaxes(c @ vectors, -1, -2)[..., :, None] * (inverse @ b)[..., None, :]
    size = np.abs(poles)
    near = 1.001 * size + 1e-9 * np.max(size, axis=-1, keepdims=True) + 1e-100
    distance = np.maximum(np.abs(poles.real), 1e-3 * near)
    flat = residues.reshape(*poles.shape, c.shape[-2] * b.shape[-1])
    response = (1.0 / (1j * near[..., :, None] - poles[..., None, :])) @ flat
    total = np.sum(np.sqrt(np.sum(np.abs(flat) ** 2, axis=-1)) / distance, axis=-1)
    largest = np.sqrt(np.max(np.sum(np.abs(response) ** 2, axis=-1), axis=-1))
    return None if np.any(total > worst * largest) else (poles, residues)


def side_by_side(parts: Sequence[Realisation], rows: Sequence[Sequence[int]], columns: Sequence[Sequence[int]],
                 n: int) -> Realisation:
    """Return the realisation of systems that share no states; `rows`, `columns`: outputs and inputs among the n."""
    a = block_diag(*[part[0] for part in parts])
    b, c, start = np.zeros((a.shape[0], n)), np.zeros((n, a.shape[0])), 0
    for (part_a, part_b, part_c), row, column in zip(parts, rows, columns):
        states = slice(start, start + part_a.shape[0])
        b[states, column] = part_b
        c[row, states] = part_c
        start = states.stop
    return a, b, c


def response_of(den: FloatArray, num: FloatArray, x: FloatArray) -> ComplexArray:
    """Return Q(ix) / P(ix); den and num constant term first, den without its leading 1."""
    return np.asarray(np.polyval(num[::-1], 1j * x) / np.polyval(np.r_[1.0, den[::-1]], 1j * x))


def observer_form(den: ArrayLike, num: ArrayLike) -> Realisation:
    """Return the observer canonical form (5)-(8) of the transfer function (23).

    K(s) = (b_n s^(n-1) + ... + b_2 s + b_1) / (s^n + a_n s^(n-1) + ... + a_2 s + a_1)

    `den`, `num` (n,): (a_1, ..., a_n) and (b_1, ..., b_n), constant term first, as in the paper. Returned are a, b, c:
    companion matrix with last column -a_1 ... -a_n, b = (b_1 ... b_n), c = the last state.
    """
    alpha, beta = np.asarray(den, dtype=float).ravel(), np.asarray(num, dtype=float).ravel()
    if alpha.size == 0 or alpha.size != beta.size:
        raise InputError(f"den, num: {alpha.size} and {beta.size} coefficients found; the same number n >= 1 is needed "
                         "(the leading 1 of the denominator is left out)")
    n = alpha.size
    a = np.eye(n, k=-1)
    a[:, -1] = -alpha
    return a, beta[:, None].copy(), np.eye(1, n, n - 1)


def to_polynomials(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (den, num) of c (s I - a)^-1 b of one input and one output: the inverse of `observer_form`.

    `a`, `b`, `c` (n, n), (n, 1), (1, n): any realisation. States that the input does not reach or the output does not
    see stay, as common factors; `minimal` takes them out. Returned are den, num: (a_1, ..., a_n) and (b_1, ..., b_n),
    constant term first.
    """
    n = a.shape[0]
    if n == 0:
        return np.zeros(0), np.zeros(0)
    if np.array_equal(a[:, :-1], np.eye(n, k=-1)[:, :-1]) and np.array_equal(c, np.eye(1, n, n - 1)):
        return -a[:, -1], b[:, 0].copy()
    # Time is scaled by the mean size of the poles, so that the coefficients stay within range.
    rate = float(np.exp(np.mean(np.log(np.maximum(np.abs(np.linalg.eigvals(a)), 1e-300)))))
    den = np.real(np.poly(a / rate))
    markov, x = [], b[:, 0]
    for _ in range(n):
        markov.append(float(c[0] @ x))
        x = a @ x / rate
    num = np.convolve(den, markov)[:n]
    return den[:0:-1] * rate ** np.arange(n, 0, -1), num[::-1] * rate ** np.arange(n - 1, -1, -1)


def minimal(a: FloatArray, b: FloatArray, c: FloatArray, tolerance: float = 1e-9) -> Realisation:
    """Return a balanced realisation of a stable one, without Hankel singular values below a share `tolerance`.

    Done twice: the root of a Gramian holds half of the digits, so of a state that is not reached, or not seen, 1e-8 may
    be left, with a pole anywhere. In balanced coordinates such a state is as little reached as seen: 1e-16 are left.
    """
    once = _balanced(a, b, c, tolerance)
    return _balanced(*once, tolerance) if once[0].size else once


def _balanced(a: FloatArray, b: FloatArray, c: FloatArray, tolerance: float) -> Realisation:
    """Return one pass of `minimal`."""
    reach = square_root(solve_continuous_lyapunov(a, -b @ b.T))
    observe = square_root(solve_continuous_lyapunov(a.T, -c.T @ c))
    u, sigma, vt = np.linalg.svd(observe.T @ reach)
    keep = sigma > tolerance * max(float(sigma[0]), 1e-300)
    scale = 1.0 / np.sqrt(sigma[keep])
    left, right = (observe @ u[:, keep] * scale).T, reach @ vt[keep].T * scale
    return left @ a @ right, left @ b, c @ right


def square_root(gramian: FloatArray) -> FloatArray:
    """Return R with R R^T = the positive semidefinite part of a Gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
