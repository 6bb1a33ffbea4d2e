"""Passive, reciprocal models by construction: a port-Hamiltonian form whose state energy is |x|^2 / 2.

    A = [[-D1, G], [-G^T, -D2]],  B = [B1; 0],  C = B^T,  D1, D2 >= 0 diagonal

A + A^T = -2 diag(D1, D2) <= 0 and C = B^T are the positive-real lemma with the identity as energy, so K(s) is passive.
With the signature diag(I, -I), A^T = signature A signature: K(s) is symmetric. Every passive reciprocal K(s) that is
strictly proper has such a realisation (Willems 1972, Dissipative dynamical systems II, theorem 8), and orthogonal
changes of the two halves of the state make D1 and D2 diagonal. K(0) = 0 holds exactly if the first p states of the
second half have no loss and B1 = G1 W with G1 the first p columns of G: at rest these states alone balance the input.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_continuous_lyapunov

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.rational import observer_form


@lru_cache(maxsize=64)
def upper(m: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns of the upper triangle."""
    return np.triu_indices(m)


@dataclass(frozen=True)
class Port:
    """Sizes of the form: n1 and n2 states in the two halves, m inputs, `lossless` states that hold K(0) = 0.

    The parameters are one vector: roots of D1, roots of D2 (without the lossless), G, and B1 (or W). `signed` takes the
    diagonals themselves instead of their roots: reciprocal models that need not be passive.
    """

    n1: int
    n2: int
    m: int
    lossless: int = 0
    signed: bool = False

    @property
    def states(self) -> int:
        """Number of states."""
        return self.n1 + self.n2

    @property
    def inputs(self) -> int:
        """Rows of B1, or of W."""
        return self.lossless or self.n1

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.states - self.lossless + self.n1 * self.n2 + self.inputs * self.m

    def released(self, theta: FloatArray) -> "tuple[Port, FloatArray]":
        """Return the form without the sign of the losses, and the parameters of the same model."""
        free = theta.copy()
        free[:self.states - self.lossless] **= 2
        return replace(self, signed=True), free

    def largest(self, fastest: float) -> FloatArray:
        """Return the largest size of each parameter with losses and couplings up to `fastest`; inf for B1 or W."""
        losses = self.states - self.lossless
        loss = fastest if self.signed else np.sqrt(fastest)
        return np.repeat([loss, fastest, np.inf], [losses, self.n1 * self.n2, self.inputs * self.m])

    def unpack(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return (roots of D1, roots of D2, G, B1 or W)."""
        last = self.states - self.lossless
        e2, rest = np.zeros(self.n2), last + self.n1 * self.n2
        e2[self.lossless:] = theta[self.n1:last]
        return theta[:self.n1], e2, theta[last:rest].reshape(self.n1, self.n2), theta[rest:].reshape(-1, self.m)

    def pack(self, e1: FloatArray, e2: FloatArray, G: FloatArray, W: FloatArray) -> FloatArray:
        """Return the parameters of what `unpack` returns."""
        return np.concatenate([e1, e2[self.lossless:], G.ravel(), W.ravel()])

    def parts(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        """Return D1, D2, their derivatives by the parameters, G and B1 or W."""
        e1, e2, G, W = self.unpack(theta)
        if self.signed:
            return e1, e2, np.ones(self.n1), np.ones(self.n2), G, W
        return e1**2, e2**2, 2.0 * e1, 2.0 * e2, G, W

    def realise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (A, B); C = B^T."""
        d1, d2, _, _, G, W = self.parts(theta)
        b1 = G[:, :self.lossless] @ W if self.lossless else W
        a, b = np.diag(-np.concatenate([d1, d2])), np.zeros((self.states, self.m))
        a[:self.n1, self.n1:], a[self.n1:, :self.n1], b[:self.n1] = G, -G.T, b1
        return a, b

    def states_of(self, theta: FloatArray, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return K(ix), shape (nw, p) upper triangle, and Y = (ix I - A)^-1 B, shape (nw, N, m).

        The second half of the states is eliminated: (s + D1 + G (s + D2)^-1 G^T) Y1 = B1, Y2 = -(s + D2)^-1 G^T Y1;
        not with x = 0, where s + D2 may be zero.
        """
        i, j = upper(self.m)
        if not x.all():
            a, b = self.realise(theta)
            Y = np.linalg.solve(1j * x[:, None, None] * np.eye(self.states) - a, b.astype(complex))
            return np.asarray((b.T @ Y)[:, i, j]), np.asarray(Y)
        d1, d2, _, _, G, W = self.parts(theta)
        b1 = G[:, :self.lossless] @ W if self.lossless else W
        s = 1j * x[:, None]
        back = G.T / (s + d2 + 1e-300)[:, :, None]
        schur = np.asarray(G @ back, dtype=complex)
        half = np.arange(self.n1)
        schur[:, half, half] = schur[:, half, half] + s + d1
        first = np.linalg.solve(schur, b1[None])
        return np.asarray((b1.T @ first)[:, i, j]), np.concatenate([first, -back @ first], axis=1)

    def jacobian(self, theta: FloatArray, Y: ComplexArray) -> FloatArray:
        """Return dK/dtheta, shape (2, nw, p, size), real parts first: dK = Z^T dA Y + ... with Z = signature Y."""
        _, _, r1, r2, G, W = self.parts(theta)
        i, j = upper(self.m)
        nw, p, q = Y.shape[0], i.size, self.lossless
        ui, uj, li, lj = (np.swapaxes(half[:, :, k], 1, 2) for half in (Y[:, :self.n1], Y[:, self.n1:]) for k in (i, j))
        d_G = ui[:, :, :, None] * lj[:, :, None, :]
        d_G += uj[:, :, :, None] * li[:, :, None, :]
        d_b = np.zeros((nw, p, self.n1, self.m), dtype=complex)
        entry = np.arange(p)
        d_b[:, entry, :, j] += np.moveaxis(ui, 1, 0)
        d_b[:, entry, :, i] += np.moveaxis(uj, 1, 0)
        if q:
            d_G[:, :, :, :q] += d_b @ W.T
            d_b = G[:, :q].T @ d_b
        J, first = np.empty((2, nw, p, self.size)), 0
        for block in (-r1 * ui * uj, (r2 * li * lj)[:, :, q:], d_G, d_b):
            flat = block.reshape(nw, p, -1)
            J[0, :, :, first:first + flat.shape[2]] = flat.real
            J[1, :, :, first:first + flat.shape[2]] = flat.imag
            first += flat.shape[2]
        return J

    def gradient(self, theta: FloatArray, Y: ComplexArray, pull: ComplexArray) -> FloatArray:
        """Return d/dtheta of Re sum conj(pull) K without the Jacobian; pull has the shape (nw, p) of K."""
        _, _, r1, r2, G, W = self.parts(theta)
        i, j = upper(self.m)
        full = np.zeros((Y.shape[0], self.m, self.m), dtype=complex)
        full[:, i, j] += 0.5 * pull.conj()
        full[:, j, i] += 0.5 * pull.conj()
        seen = Y @ full
        own = np.einsum("wik,wik->i", seen, Y).real
        first, second = (np.moveaxis(part, 1, 0).reshape(part.shape[1], -1) for part in
                         (Y[:, :self.n1], seen[:, self.n1:]))
        d_G, d_b = 2.0 * (first @ second.T).real, 2.0 * seen[:, :self.n1].real.sum(axis=0)
        if self.lossless:
            d_G[:, :self.lossless] += d_b @ W.T
            d_b = G[:, :self.lossless].T @ d_b
        return self.pack(-r1 * own[:self.n1], r2 * own[self.n1:], d_G, d_b)

    def curvature(self, theta: FloatArray, Y: ComplexArray) -> FloatArray:
        """Return about the sum of |dK/dtheta|^2 for each parameter, its scale in a descent."""
        _, _, r1, r2, _, _ = self.parts(theta)
        power = np.sum(np.abs(Y) ** 2, axis=2)
        y1, y2 = power[:, :self.n1], power[:, self.n1:]
        inputs = np.repeat(y1.sum(axis=0)[:, None], self.m, axis=1)[:self.inputs]
        return self.pack(r1**2 * np.sum(y1**2, axis=0), r2**2 * np.sum(y2**2, axis=0), 2.0 * y1.T @ y2, 2.0 * inputs)

    def poles(self, theta: FloatArray, which: Callable[[ComplexArray], NDArray[np.bool_]],
              ) -> tuple[ComplexArray, ComplexArray]:
        """Return the poles that `which` picks, shape (k,), and their derivatives, shape (k, size).

        A^T = signature A signature, so the left eigenvectors are the signature times the right ones.
        """
        a = self.realise(theta)[0]
        if not which(np.asarray(np.linalg.eigvals(a), dtype=complex)).any():
            return np.zeros(0, dtype=complex), np.zeros((0, self.size), dtype=complex)
        values, right = np.linalg.eig(a)
        picked = which(values)
        values, right = values[picked], right[:, picked]
        _, _, r1, r2, _, W = self.parts(theta)
        u, v = right[:self.n1].T, right[self.n1:].T
        scale = np.sum(u * u, axis=1) - np.sum(v * v, axis=1)
        # Where two poles meet the derivative has no limit; it is left out.
        scale = np.where(np.abs(scale) > 1e-6, scale, np.inf)[:, None]
        d_G = (2.0 * u[:, :, None] * v[:, None, :]).reshape(values.size, self.n1 * self.n2) / scale
        return values, np.hstack([-r1 * u * u / scale, (r2 * v * v / scale)[:, self.lossless:], d_G,
                                  np.zeros((values.size, W.size))])


Start = tuple[Port, FloatArray]  # a form and its parameters


def port_of(den: FloatArray, num: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (roots of D1, roots of D2, G, B1) of a passive Q / P, both halves in the order of rising loss.

    The spectral factors of least and of largest phase give the smallest and the largest energy X with
    A^T X + X A <= 0 and X B = C^T; their geometric mean is an energy too, the one that reciprocity maps to itself
    (Willems 1972, theorem 8). In its coordinates reciprocity is a signature.
    """
    a, b, c = (part.T for part in observer_form(den, num))
    b, c = c, b
    factor = spectral_factor(den, num)
    least, most = (solve_continuous_lyapunov(a.T, -2.0 * np.outer(h, h)) for h in
                   (factor, factor * (-1.0) ** np.arange(den.size)))
    root, inverse = _roots(least)
    change, back = _roots(root @ _roots(inverse @ most @ inverse)[0] @ root)
    a, b = change @ a @ back, change @ b
    _, vectors = np.linalg.eig(a)
    left = np.linalg.pinv(vectors)
    reach, seen = (left @ b)[:, 0], (c @ back @ vectors)[0]
    ratio = np.where(np.abs(reach) > 1e-12 * np.abs(reach).max(), seen / np.where(reach == 0.0, 1.0, reach), 1.0)
    signs, halves = np.linalg.eigh(_even((left.T * ratio @ left).real))
    one, two = halves[:, signs > 0.0], halves[:, signs <= 0.0]
    (d1, q1), (d2, q2) = (np.linalg.eigh(-_even(half.T @ a @ half)) for half in (one, two))
    one, two = one @ q1, two @ q2
    return (np.sqrt(np.maximum(d1, 0.0)), np.sqrt(np.maximum(d2, 0.0)), 0.5 * (one.T @ a @ two - (two.T @ a @ one).T),
            one.T @ b)


def spectral_factor(den: FloatArray, num: FloatArray) -> FloatArray:
    """Return h, shape (n,), constant term first, with |h(iw)|^2 near Re[Q(iw) conj P(iw)]: exact where that is passive.

    Where the real part changes sign, the two ends of the negative interval become one double root between them.
    """
    n = den.size
    full, sign = np.r_[den, 1.0], (-1.0) ** np.arange(n + 1)
    even = np.convolve(num, full * sign)[::2]  # coefficients of s^0, s^2, ...
    if not np.any(even):
        return np.full(n, 1e-3)
    roots = np.sqrt(np.roots(even[::-1]).astype(complex))
    roots = np.where(roots.real > 0.0, -roots, roots)
    crossing = np.abs(roots.real) < 1e-7 * np.abs(roots)
    ends = np.sort(np.abs(roots[crossing]))
    paired = np.repeat(np.sqrt(ends[:-1:2] * ends[1::2]), 2) * np.tile([1j, -1j], ends.size // 2)
    kept = np.r_[roots[~crossing], paired, -ends[ends.size - ends.size % 2:]]
    lead = np.sqrt(abs(even[even.size - 1 - int(np.argmax(even[::-1] != 0.0))]))
    h = lead * np.atleast_1d(np.real(np.poly(kept)))[::-1]  # np.poly of no roots is a bare 1.0
    return np.r_[h, np.zeros(n - h.size)][:n]


def _even(matrix: FloatArray) -> FloatArray:
    return 0.5 * (matrix + matrix.T)


def _roots(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    values, vectors = np.linalg.eigh(_even(matrix))
    root = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    return (vectors * root) @ vectors.T, (vectors / root) @ vectors.T


def beside(parts: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]], zero: bool) -> Start:
    """Return models (roots of D1, roots of D2, G, B1) side by side; `zero`: with the states that hold K(0) = 0."""
    e1, e2, W = (np.concatenate([part[k] for part in parts]) for k in (0, 1, 3))
    G = block_diag(*[part[2] for part in parts])
    lossless = min(W.shape[1], *G.shape) if zero else 0
    if lossless:
        rising = np.argsort(e2, kind="stable")
        e2, G = e2[rising], G[:, rising]
        W = np.linalg.lstsq(G[:, :lossless], W, rcond=1e-6)[0]
    form = Port(G.shape[0], G.shape[1], W.shape[1], lossless)
    return form, form.pack(e1, e2, G, W)


def grown(smaller: Start, more: int, top: float, rng: np.random.Generator, loose: float, second: bool = False) -> Start:
    """Return a model with `more` states more, resonances up to `top` coupled to the smaller one by `loose`.

    An odd state goes into the first half, or into the `second`.
    """
    small, theta = smaller
    e1, e2, G, W = small.unpack(theta)
    n1 = min(small.n1 + more, max(small.n1, (small.states + more + 1 - second) // 2))
    n2 = small.states + more - n1
    H = loose * top * rng.normal(size=(n1, n2))
    H[:small.n1, :small.n2] = G
    for k in range(min(n1 - small.n1, n2 - small.n2)):
        H[small.n1 + k, small.n2 + k] = top * np.exp(rng.uniform(np.log(0.08), np.log(0.9)))
    V = loose * rng.normal(size=(small.lossless or n1, small.m))
    V[:W.shape[0]] = W
    form = replace(small, n1=n1, n2=n2)
    return form, form.pack(np.r_[e1, np.full(n1 - small.n1, 0.5)], np.r_[e2, np.full(n2 - small.n2, 0.5)], H, V)
