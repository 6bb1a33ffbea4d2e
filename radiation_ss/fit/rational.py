"""Small state-space and rational models: vectorised evaluation; proof of stability and passivity without a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, eigvals, expm, solve_continuous_lyapunov

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError


def frequency_response(a: FloatArray, b: FloatArray, c: FloatArray, omega: ArrayLike) -> ComplexArray:
    """Return c (i w I - a)^-1 b for all frequencies at once, shape (..., nw, n_out, n_in).

    A sum over the modes, sum_m R_m / (i w - pole_m); near multiple poles, a linear solve for each frequency. `a`, `b`,
    `c` (..., N, N), (..., N, n_in), (..., n_out, N): one model, or a stack of models of equal size. `omega` (nw,):
    circular frequencies [rad/s].
    """
    w = np.atleast_1d(np.asarray(omega, dtype=float))
    found = modes(a, b, c)
    if found is not None:
        return sum_of_modes(*found, w)
    resolvent = 1j * w[:, None, None] * np.eye(a.shape[-1]) - a[..., None, :, :]
    return c[..., None, :, :] @ np.linalg.solve(resolvent, b[..., None, :, :].astype(complex))


def impulse_response(a: FloatArray, b: FloatArray, c: FloatArray, t: ArrayLike) -> FloatArray:
    """Return c exp(a t) b, shape (nt, n_out, n_in), for times t >= 0 [s]; by modes, else by matrix exponentials."""
    times = np.atleast_1d(np.asarray(t, dtype=float))
    found = modes(a, b, c)
    if found is not None:
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


def side_by_side(parts: Sequence[tuple[FloatArray, FloatArray, FloatArray]], rows: Sequence[Sequence[int]],
                 columns: Sequence[Sequence[int]], n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the realisation of several systems that share no states.

    `rows`, `columns`: outputs and inputs of each part among the n of the whole; outputs add up.
    """
    a = block_diag(*[part[0] for part in parts])
    b, c, start = np.zeros((a.shape[0], n)), np.zeros((n, a.shape[0])), 0
    for (part_a, part_b, part_c), row, column in zip(parts, rows, columns):
        states = slice(start, start + part_a.shape[0])
        b[states, column] = part_b
        c[row, states] = part_c
        start = states.stop
    return a, b, c


def observer_form(den: ArrayLike, num: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the observer canonical form (5)-(8) of the transfer function (23).

    K(s) = (b_n s^(n-1) + ... + b_2 s + b_1) / (s^n + a_n s^(n-1) + ... + a_2 s + a_1)

    `den`, `num` (n,): (a_1, ..., a_n) and (b_1, ..., b_n), constant term first, as in the paper. Returned are a, b, c:
    companion matrix with last column -a_1 ... -a_n, b = (b_1 ... b_n), c = the last state. InputError if the two have
    different lengths or are empty.
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
    powers = rate ** np.arange(n)
    return den[:0:-1] * rate ** np.arange(n, 0, -1), num[::-1] * powers[::-1]


def minimal(a: FloatArray, b: FloatArray, c: FloatArray, tolerance: float = 1e-9,
            ) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a balanced realisation without the states of Hankel singular value below `tolerance` of the largest.

    `a`, `b`, `c` (N, N), (N, n_in), (n_out, N): stable system.
    """
    reach = _square_root(solve_continuous_lyapunov(a, -b @ b.T))
    observe = _square_root(solve_continuous_lyapunov(a.T, -c.T @ c))
    u, sigma, vt = np.linalg.svd(observe.T @ reach)
    keep = sigma > tolerance * max(float(sigma[0]), 1e-300)
    scale = 1.0 / np.sqrt(sigma[keep])
    left, right = (observe @ u[:, keep] * scale).T, reach @ vt[keep].T * scale
    return left @ a @ right, left @ b, c @ right


def _square_root(gramian: FloatArray) -> FloatArray:
    """Return R with R R^T = the positive semidefinite part of a Gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


PASSIVE = 1e-9
"""Largest negative eigenvalue of the scaled Hermitian part, relative to the largest size, that counts as round-off."""


@dataclass(frozen=True)
class Certificate:
    """What was proved of K(s) = c (s I - a)^-1 b; K scaled to S^-1 K S^-1, s_i^2 = max_w Re K_ii(iw).

    Parameters
    ----------
    abscissa : float
        Largest real part of the poles [rad/s]; negative means stable.
    margin : float
        Smallest eigenvalue of the Hermitian part of K(iw) over all w >= 0, relative to the largest in size. A strictly
        proper K tends to zero, so 0 is the best value; below -1e-9 the model makes energy.
    worst_omega : float
        Where the smallest is attained [rad/s] (inf if in the limit).
    relative_degree : int
        1 for a model of radiation; L(0+) = c b is then not zero. 0 if there is a feed-through.
    K_zero : float
        Largest |K_ij(0)| of the scaled K, relative to the Hermitian eigenvalue that is largest in size.
    """

    abscissa: float
    margin: float
    worst_omega: float
    relative_degree: int
    K_zero: float

    @property
    def stable(self) -> bool:
        """All poles in the open left half plane."""
        return self.abscissa < 0.0

    @property
    def passive(self) -> bool:
        """Positive real: stable, and no frequency where the Hermitian part of K is negative beyond round-off."""
        return self.stable and self.margin >= -PASSIVE

    def __str__(self) -> str:
        verdict = ("stable" if self.stable else "UNSTABLE") + (", passive" if self.passive else ", NOT passive")
        return (f"{verdict}; largest real part of the poles {self.abscissa:.3g} rad/s, passivity margin "
                f"{self.margin:.1e} at {self.worst_omega:.3g} rad/s, relative degree {self.relative_degree}, "
                f"|K(0)| {self.K_zero:.1e} of the largest damping")


def certify(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray | None = None) -> Certificate:
    """Certify a square model, strictly proper unless a feed-through d is given.

    The Hermitian part H(w) of K(iw) can change sign only where det H(w) = 0, that is at the imaginary eigenvalues of
    the pencil of K(s) + K(-s)^T. The sign is looked up once between each two of them. `a`, `b`, `c` (N, N), (N, n), (n,
    N). `d` (n, n).
    """
    if a.shape[0] == 0:
        return Certificate(-np.inf, 0.0, np.inf, 1, 0.0)
    poles = np.linalg.eigvals(a)
    size = np.abs(poles)
    rate = float(np.exp(np.mean(np.log(np.maximum(size, max(1e-6 * float(size.max()), 1e-12))))))
    # Poles on the imaginary axis (within 1e-9 of their mean size), where K is infinite, are left out; such a model is
    # not stable, hence not passive.
    infinite = np.abs(poles.imag[np.abs(poles.real) <= 1e-9 * rate])
    axis = _apart(rate * np.logspace(-4, 4, 400), infinite)
    d = np.zeros((c.shape[0], b.shape[1])) if d is None else d
    diagonal = np.einsum("wii->wi", frequency_response(a, b, c, axis) + d).real
    scale = np.sqrt(np.abs(diagonal).max(axis=0))
    scale[scale == 0.0] = 1.0
    b, c, d = b / scale, c / scale[:, None], d / np.outer(scale, scale)
    # Where A + A^T <= 0, C = B^T and D + D^T >= 0 the energy |x|^2 / 2 proves that H is never negative.
    proved = np.array_equal(c, b.T) and max(np.linalg.eigvalsh(a + a.T)[-1], -np.linalg.eigvalsh(d + d.T)[0]) <= 0.0
    omega = np.concatenate([[0.0], axis, np.abs(poles.imag), [] if proved else _sign_changes(a, b, c, d, rate)])
    omega = np.unique(omega)
    omega = _apart(np.concatenate([omega, 0.5 * (omega[1:] + omega[:-1]), [1e3 * omega[-1]]]), infinite)
    K = frequency_response(a, b, c, omega) + d
    values = np.linalg.eigvalsh(0.5 * (K + np.conj(np.swapaxes(K, 1, 2))))
    largest = max(float(np.abs(values).max()), 1e-300)
    worst = int(np.argmin(values[:, 0]))
    margin = 0.0 if proved else min(float(values[worst, 0]) / largest, 0.0)
    at = float(omega[worst]) if margin < 0.0 else np.inf
    at_rest = _apart(np.zeros(1), infinite)
    zero = float(np.abs(frequency_response(a, b, c, 0.0) + d).max()) / largest if at_rest.size else np.inf
    degree = 0 if d.any() else 1 if np.abs(c @ b).max() > 1e-9 * rate * largest else 2
    return Certificate(float(poles.real.max()), margin, at, degree, zero)


def _apart(omega: FloatArray, infinite: FloatArray) -> FloatArray:
    near = np.isclose(omega[:, None], infinite, rtol=1e-9, atol=1e-9 * infinite.max(initial=0.0) + 1e-12)
    return omega[~near.any(axis=1)]


def _sign_changes(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, rate: float) -> FloatArray:
    """Return frequencies [rad/s] where K(iw) + K(iw)^H may be singular: imaginary eigenvalues of the pencil."""
    N = a.shape[0]
    pencil = np.block([[a / rate, np.zeros((N, N)), b], [np.zeros((N, N)), -a.T / rate, -c.T],
                       [c, b.T, d + d.T]])
    mass = np.zeros_like(pencil)
    mass[:2 * N, :2 * N] = np.eye(2 * N)
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = eigvals(pencil, mass)
    zeros = zeros[np.isfinite(zeros)]
    # Generous: a zero that is imaginary but for round-off (double zeros split) costs one more look-up at worst.
    near = np.abs(zeros.real) <= 1e-3 * np.abs(zeros) + 1e-9
    return np.asarray(np.abs(zeros[near].imag) * rate, dtype=float)
