"""Passive, reciprocal models by construction: a port-Hamiltonian form whose state energy is |x|^2 / 2.

    A = [[-D1, G], [-G^T, -D2]],  B = [B1; 0],  C = B^T,  D1, D2 >= 0 diagonal

A + A^T = -2 diag(D1, D2) <= 0 and C = B^T are the positive-real lemma with the identity as energy, so K(s) is passive.
With the signature diag(I, -I), A^T = signature A signature: K(s) is symmetric. Every passive reciprocal K(s) that is
strictly proper has such a realisation (Willems 1972, Dissipative dynamical systems II, theorem 8), and orthogonal
changes of the two halves of the state make D1 and D2 diagonal. K(0) = 0 holds exactly if the first p states of the
second half have no loss and B1 = G1 W with G1 the first p columns of G: at rest these states alone balance the input.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray


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

    @classmethod
    def of(cls, states: int, m: int, zero: bool) -> Port:
        """Return the sizes for a number of states, the larger half first; K(0) = 0 needs two states at least."""
        return cls.all_of(states, m, zero)[0]

    @classmethod
    def all_of(cls, states: int, m: int, zero: bool) -> tuple[Port, ...]:
        """Return the signatures for a number of states: one where it is even, the odd state in either half else."""
        small, large = states // 2, states - states // 2
        return tuple(cls(n1, n2, m, min(m, n1, n2) if zero else 0) for n1, n2 in dict.fromkeys(
            ((large, small), (small, large))) if n1 and (n2 or not zero))

    def released(self) -> Port:
        """Return the form without the sign of the losses."""
        return replace(self, signed=True)

    @property
    def inputs(self) -> int:
        """Rows of B1, or of W."""
        return self.lossless or self.n1

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.n1 + self.n2 - self.lossless + self.n1 * self.n2 + self.inputs * self.m

    def unpack(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return (roots of D1, roots of D2, G, B1 or W)."""
        lossy = self.n2 - self.lossless
        e1, e2, G, W = np.split(theta, np.cumsum([self.n1, lossy, self.n1 * self.n2]))
        return e1, np.r_[np.zeros(self.lossless), e2], G.reshape(self.n1, self.n2), W.reshape(-1, self.m)

    def realise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (A, B); C = B^T."""
        e1, e2, G, W = self.unpack(theta)
        b1 = G[:, :self.lossless] @ W if self.lossless else W
        d1, d2 = (e1, e2) if self.signed else (e1**2, e2**2)
        a = np.block([[-np.diag(d1), G], [-G.T, -np.diag(d2)]])
        return a, np.vstack([b1, np.zeros((self.n2, self.m))])

    def states_of(self, theta: FloatArray, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return K(ix), shape (nw, p) upper triangle, and Y = (ix I - A)^-1 B, shape (nw, N, m).

        The second half of the states is eliminated: (s + D1 + G (s + D2)^-1 G^T) Y1 = B1, Y2 = -(s + D2)^-1 G^T Y1.
        """
        e1, e2, G, W = self.unpack(theta)
        d1, d2 = (e1, e2) if self.signed else (e1**2, e2**2)
        b1 = G[:, :self.lossless] @ W if self.lossless else W
        s = 1j * x[:, None]
        back = G.T / (s + d2 + 1e-300)[:, :, None]
        schur = np.asarray(G @ back, dtype=complex)
        half = np.arange(self.n1)
        schur[:, half, half] = schur[:, half, half] + s + d1
        upper = np.linalg.solve(schur, np.broadcast_to(b1.astype(complex), (x.size, *b1.shape)))
        i, j = np.triu_indices(self.m)
        return np.asarray((b1.T @ upper)[:, i, j]), np.concatenate([upper, -back @ upper], axis=1)

    def jacobian(self, theta: FloatArray, Y: ComplexArray) -> FloatArray:
        """Return dK/dtheta, shape (2, nw, p, size), real parts first: dK = Z^T dA Y + ... with Z = signature Y."""
        e1, e2, G, W = self.unpack(theta)
        i, j = np.triu_indices(self.m)
        nw, p, q = Y.shape[0], i.size, self.lossless
        ui, uj, li, lj = (np.swapaxes(half[:, :, k], 1, 2) for half in (Y[:, :self.n1], Y[:, self.n1:]) for k in (i, j))
        r1, r2 = (np.ones(self.n1), np.ones(self.n2)) if self.signed else (2.0 * e1, 2.0 * e2)
        J = np.empty((2, nw, p, self.size))
        at = np.cumsum([0, self.n1, self.n2 - q, self.n1 * self.n2])

        def put(first: int, block: ComplexArray) -> None:
            flat = block.reshape(nw, p, -1)
            J[0, :, :, first:first + flat.shape[2]] = flat.real
            J[1, :, :, first:first + flat.shape[2]] = flat.imag

        put(at[0], -r1 * ui * uj)
        put(at[1], (r2 * li * lj)[:, :, q:])
        d_G = ui[:, :, :, None] * lj[:, :, None, :]
        d_G += uj[:, :, :, None] * li[:, :, None, :]
        d_b = np.zeros((nw, p, self.n1, self.m), dtype=complex)
        entry = np.arange(p)
        d_b[:, entry, :, j] += np.moveaxis(ui, 1, 0)
        d_b[:, entry, :, i] += np.moveaxis(uj, 1, 0)
        if q:
            d_G[:, :, :, :q] += d_b @ W.T
            d_b = G[:, :q].T @ d_b
        put(at[2], d_G)
        put(at[3], d_b)
        return J

    def poles(self, theta: FloatArray) -> tuple[ComplexArray, Callable[[], ComplexArray]]:
        """Return the poles, shape (N,), and a function that returns their derivatives, shape (N, size).

        A^T = signature A signature, so the left eigenvectors are the signature times the right ones.
        """
        values, right = np.linalg.eig(self.realise(theta)[0])

        def slopes() -> ComplexArray:
            e1, e2, _G, W = self.unpack(theta)
            u, v = right[:self.n1].T, right[self.n1:].T
            scale = np.sum(u * u, axis=1) - np.sum(v * v, axis=1)
            # Where two poles meet the derivative has no limit; it is left out.
            scale = np.where(np.abs(scale) > 1e-6, scale, np.inf)[:, None]
            r1, r2 = (np.ones(self.n1), np.ones(self.n2)) if self.signed else (2.0 * e1, 2.0 * e2)
            d_e1, d_e2 = -r1 * u * u / scale, (r2 * v * v / scale)[:, self.lossless:]
            d_G = (2.0 * u[:, :, None] * v[:, None, :]).reshape(values.size, -1) / scale
            return np.hstack([d_e1, d_e2, d_G, np.zeros((values.size, W.size))])

        return values, slopes
