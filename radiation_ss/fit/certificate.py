"""Proof of a model's stability and passivity, without a grid of frequencies."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigvals

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.rational import Realisation, connected, frequency_response, modes

PASSIVE = 1e-9  # negative eigenvalue of the scaled Hermitian part, of the largest size, that counts as round-off


@dataclass(frozen=True)
class Certificate:
    """What was proved of K(s) = c (s I - a)^-1 b; K scaled to S^-1 K S^-1, s_i^2 = max_w Re K_ii(iw)."""

    abscissa: float  # Largest real part of the poles [rad/s]; negative means stable
    # Smallest eigenvalue of the Hermitian part of K(iw) over all w >= 0, relative to the largest in size. A strictly
    # proper K tends to zero, so 0 is its best value; below -1e-9 the model makes energy.
    margin: float
    worst_omega: float  # Where the smallest is attained [rad/s] (inf if in the limit)
    relative_degree: int  # 1 for a model of radiation; L(0+) = c b is then not zero. 0 if there is a feed-through.
    K_zero: float  # Largest |K_ij(0)| of the scaled K, relative to the Hermitian eigenvalue that is largest in size

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
    poles = np.concatenate([np.linalg.eigvals(a[np.ix_(states, states)]) for states in connected(a)])
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
    least, limit = float(values[worst, 0]), float(np.linalg.eigvalsh(0.5 * (d + d.T))[0])
    least, at = (least, float(omega[worst])) if least < limit else (limit, np.inf)
    if proved and least < 0.0:  # rounding
        least, at = 0.0, np.inf
    margin = least / largest
    at_rest = _apart(np.zeros(1), infinite)
    zero = float(np.abs(frequency_response(a, b, c, 0.0) + d).max()) / largest if at_rest.size else np.inf
    degree = 0 if d.any() else 1 if np.abs(c @ b).max() > 1e-9 * rate * largest else 2
    return Certificate(float(poles.real.max()), margin, at, degree, zero)


def _apart(omega: FloatArray, infinite: FloatArray) -> FloatArray:
    near = np.isclose(omega[:, None], infinite, rtol=1e-9, atol=1e-9 * infinite.max(initial=0.0) + 1e-12)
    return omega[~near.any(axis=1)]


def _sign_changes(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, rate: float) -> FloatArray:
    """Return frequencies [rad/s] where K(iw) + K(iw)^H may be singular, of each group of motions that are coupled."""
    n, root, found = d.shape[0], np.sqrt(rate), [np.zeros(0)]
    for group in connected(np.block([[d, c], [b, a]])):
        ports, states = group[group < n], group[group >= n] - n
        if ports.size and states.size:
            part = _merged(a[np.ix_(states, states)] / rate, b[np.ix_(states, ports)] / root,
                           c[np.ix_(ports, states)] / root)
            found.append(rate * _imaginary_zeros(*part, d[np.ix_(ports, ports)]))
    return np.concatenate(found)


def _merged(a: FloatArray, b: FloatArray, c: FloatArray, same: float = 1e-9, rounding: float = 1e-13) -> Realisation:
    """Return a realisation with one pole where connected parts have the `same` (Gilbert's).

    The residues at a pole add up to a matrix whose rank, but for `rounding`, is the number of states that it needs.
    Models that are read entry by entry repeat the poles of the whole in each entry. A part near to a multiple pole
    stays as it is.
    """
    parts = [(a[np.ix_(states, states)], b[states], c[:, states]) for states in connected(a)]
    found = [modes(*part) for part in parts]
    apart = [part for part in found if part is not None]
    if len(parts) == 1 or not apart:
        return a, b, c
    merged = [part for part, known in zip(parts, found) if known is None]
    poles, residues = (np.concatenate([part[k] for part in apart]) for k in (0, 1))
    upper = poles.imag >= 0.0
    poles, residues = poles[upper], residues[upper]
    scale = np.linalg.norm(residues, 2, axis=(1, 2)).max()
    for near in connected(np.abs(poles[:, None] - poles) <= same * np.abs(poles)):
        merged.append(_of_pole(complex(poles[near].mean()), residues[near].sum(axis=0), rounding * scale))
    return (block_diag(*[part[0] for part in merged]), np.vstack([part[1] for part in merged]),
            np.hstack([part[2] for part in merged]))


def _of_pole(pole: complex, residue: ComplexArray, rounding: float) -> Realisation:
    """Return the real realisation of R / (s - pole), and of its conjugate beside it where the pole is complex."""
    left, sizes, right = np.linalg.svd(residue if pole.imag else residue.real)
    rank = int(np.sum(sizes > rounding))
    b, c = np.sqrt(sizes[:rank, None]) * right[:rank], left[:, :rank] * np.sqrt(sizes[:rank])
    if not pole.imag:
        return pole.real * np.eye(rank), b, c
    turn = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    return np.kron(turn, np.eye(rank)), np.vstack([b.real, -b.imag]), np.hstack([2.0 * c.real, 2.0 * c.imag])


def _imaginary_zeros(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return where K(iw) + K(iw)^H may be singular: the imaginary eigenvalues of the pencil of K(s) + K(-s)^T."""
    N = a.shape[0]
    pencil = np.block([[a, np.zeros((N, N)), b], [np.zeros((N, N)), -a.T, -c.T], [c, b.T, d + d.T]])
    mass = np.zeros_like(pencil)
    mass[:2 * N, :2 * N] = np.eye(2 * N)
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = eigvals(pencil, mass)
    zeros = zeros[np.isfinite(zeros)]
    # Generous: a zero that is imaginary but for round-off (double zeros split) costs one more look-up at worst.
    near = np.abs(zeros.real) <= 1e-3 * np.abs(zeros) + 1e-9
    return np.asarray(np.abs(zeros[near].imag), dtype=float)
