"""Likelihood of tapered Fourier coefficients of a stationary normal process, with their exact banded covariance.

A Hann window makes coefficients more than a few bins apart independent for all practical purposes, but neighbours are
not: keeping their covariance makes the likelihood that of the record itself, short or long, with leakage in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from radiation_ss.arrays import ComplexArray, FloatArray

REACH = 6           # bins beyond which the window's side lobes are dropped
FINE = 4            # points of the spectral integral per bin


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Windowed Fourier coefficients z_k = sum_t w_t y_t e^{-i w_k (t - centre)} of channels y (nt, p), unit noise gain.

    Parameters
    ----------
    y : ndarray, shape (nt, p)
        Complete samples.
    dt : float
    first, last : int
        Bins used: w_k = 2 pi k / (nt dt), first <= k <= last.
    """

    y: FloatArray
    dt: float
    first: int
    last: int

    @cached_property
    def window(self) -> FloatArray:
        """Hann window of unit energy, shape (nt,)."""
        nt = self.y.shape[0]
        w = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(nt) + 0.5) / nt)
        return np.asarray(w / np.sqrt(np.sum(w**2)), dtype=np.float64)

    @property
    def spacing(self) -> float:
        """Width of a bin [rad/s]."""
        return float(2.0 * np.pi / (self.y.shape[0] * self.dt))

    @cached_property
    def omega(self) -> FloatArray:
        """Frequencies of the bins [rad/s], shape (nk,)."""
        return self.spacing * np.arange(self.first, self.last + 1, dtype=np.float64)

    @cached_property
    def fine(self) -> FloatArray:
        """Frequencies of the spectral integral [rad/s], shape (nk * FINE + 2 REACH FINE - FINE + 1,)."""
        points = np.arange((self.first - REACH) * FINE, (self.last + REACH) * FINE + 1, dtype=np.float64)
        return self.spacing / FINE * points

    @cached_property
    def z(self) -> ComplexArray:
        """Coefficients, shape (nk, p)."""
        nt = self.y.shape[0]
        k = np.arange(self.first, self.last + 1)
        spectrum = np.fft.fft(self.window[:, None] * self.y, axis=0)[k % nt]
        return np.asarray(spectrum * np.exp(2j * np.pi * k * 0.5 * (nt - 1) / nt)[:, None])

    def _transform(self, nu: FloatArray) -> FloatArray:
        """Return the window's transform about its centre at frequencies nu [rad/s] (real: the window is even)."""
        t = (np.arange(self.y.shape[0]) - 0.5 * (self.y.shape[0] - 1)) * self.dt
        return np.asarray(np.cos(np.outer(nu, t)) @ self.window)

    @cached_property
    def kernel(self) -> FloatArray:
        """Weights of S(w_k + nu) in the covariance of bins k and k + d, shape (2 REACH + 1, 2 REACH FINE + 1)."""
        step = self.spacing / FINE
        taps = np.arange(-REACH * FINE, REACH * FINE + 1)
        W = self._transform(step * np.arange(0, REACH * FINE + 1, dtype=np.float64))
        kernel = np.zeros((2 * REACH + 1, taps.size))
        for d in range(2 * REACH + 1):
            away = np.abs(taps - d * FINE)
            near = away <= REACH * FINE
            kernel[d, near] = W[away[near]] * W[np.abs(taps[near])] * 0.5 * step
        return kernel

    @cached_property
    def noise(self) -> FloatArray:
        """Covariance of bins d apart of white noise of unit variance, shape (2 REACH + 1,)."""
        t = (np.arange(self.y.shape[0]) - 0.5 * (self.y.shape[0] - 1)) * self.dt
        row = np.cos(np.outer(self.spacing * np.arange(2 * REACH + 1), t)) @ self.window**2
        return np.where(np.abs(row) > 1e-9, row, 0.0)

    def covariance(self, S: ComplexArray, noise: FloatArray) -> ComplexArray:
        """Return the banded lower covariance of z (bins outer, channels inner), shape ((2 REACH + 1) p, nk p).

        Parameters
        ----------
        S : ndarray, shape (n_fine, p, p)
            One-sided cross spectra of the channels at `fine`, S_ij ~ y_i conj(y_j).
        noise : ndarray, shape (p,)
            Variances of white measurement noise.
        """
        nk, p = self.z.shape
        windows = sliding_window_view(S, self.kernel.shape[1], axis=0)[::FINE][:nk]
        blocks = np.einsum("kijt,dt->dkij", windows, self.kernel) if p > 1 else (
            (windows[:, 0, 0] @ self.kernel.T).T[:, :, None, None])
        blocks = blocks + self.noise[:, None, None, None] * np.diag(noise)
        band = np.zeros(((2 * REACH + 1) * p, nk * p), dtype=blocks.dtype)
        for d in range(2 * REACH + 1):
            for i in range(p):
                for j in range(p):
                    if d * p + i - j >= 0:
                        band[d * p + i - j, j:(nk - d) * p:p] = blocks[d, :nk - d, i, j]
        return band

    def log_likelihood(self, S: ComplexArray, noise: FloatArray) -> float:
        """Return log p(z) up to a constant; -inf if the covariance is not positive definite."""
        factor = self._factor(S, noise)
        if factor is None:
            return -np.inf
        flat = self.z.ravel()
        squared = float((flat.conj() @ cho_solve_banded((factor, True), flat)).real)
        return -2.0 * float(np.log(factor[0].real).sum()) - squared

    def log_likelihoods(self, S: ComplexArray, noise: FloatArray) -> FloatArray:
        """Return log p(z) for many spectra S (B, n_fine, p, p) and noise variances (B, p), shape (B,)."""
        if self.z.shape[1] > 1:
            return np.array([self.log_likelihood(one, sigma) for one, sigma in zip(S, noise)])
        parts = np.stack([self.z[:, 0].real, self.z[:, 0].imag])
        return _real_log_likelihoods(np.ascontiguousarray(S[:, :, 0, 0].real), noise[:, 0], self.kernel, self.noise,
                                     parts)

    def _factor(self, S: ComplexArray, noise: FloatArray) -> ComplexArray | None:
        band = self.covariance(S, noise)
        if not np.isfinite(band).all():
            return None
        try:
            return np.asarray(cholesky_banded(band, lower=True, check_finite=False))
        except LinAlgError:
            return None

    def gradient(self, S: ComplexArray, noise: FloatArray) -> tuple[float, ComplexArray, FloatArray]:
        """Return log p(z), and its exact derivatives by S and by the noise variances.

        Returns
        -------
        value : float
        by_S : ndarray, shape (n_fine, p, p)
            d value = Re sum(by_S * dS).
        by_noise : ndarray, shape (p,)
        """
        factor = self._factor(S, noise)
        nk, p = self.z.shape
        if factor is None:
            return -np.inf, np.zeros_like(S), np.zeros(p)
        flat = self.z.ravel()
        alpha = cho_solve_banded((factor, True), flat)
        value = -2.0 * float(np.log(factor[0].real).sum()) - float((flat.conj() @ alpha).real)
        inverse = _inverse_band(factor.astype(complex))
        by_noise, taps = np.zeros(p), self.kernel.shape[1]
        # Room for taps to be split into groups of FINE: bin k adds to the fine points from k FINE on.
        groups = -(-taps // FINE)
        by_S = np.zeros(((nk + groups) * FINE, p, p), dtype=complex)
        for i in range(p):
            for j in range(p):
                G = np.zeros((nk, 2 * REACH + 1), dtype=complex)
                for d in range(2 * REACH + 1):
                    row, column = d * p + np.arange(nk - d) * p + i, np.arange(nk - d) * p + j
                    lower = row >= column
                    r, c = np.where(lower, row, column), np.where(lower, column, row)
                    Z = inverse[r - c, c]
                    Z = np.where(lower, Z, Z.conj())
                    # d(log p) = tr[(alpha alpha^H - C^-1) dC], with dC_rc = kernel dS_ij and its mirror.
                    G[:nk - d, d] = (1.0 if d == 0 else 2.0) * np.conj(alpha[row] * alpha[column].conj() - Z)
                by_noise[i] += float(G.sum(axis=0).real @ self.noise) if i == j else 0.0
                spread = np.zeros((nk, groups * FINE), dtype=complex)
                spread[:, :taps] = G @ self.kernel
                target, spread = by_S[:, i, j].reshape(-1, FINE), spread.reshape(nk, groups, FINE)
                for g in range(groups):
                    target[g:g + nk] += spread[:, g]
                by_S[:, i, j] = target.ravel()
        by_S = by_S[:S.shape[0]]
        return value, by_S, by_noise

    def local_average(self, S: ComplexArray) -> ComplexArray:
        """Return spectra seen by the bins themselves, shape (..., nk, p, p), of S (..., n_fine, p, p)."""
        weights = self.kernel[0]
        windows = sliding_window_view(S, weights.size, axis=-3)[..., ::FINE, :, :, :][..., :self.z.shape[0], :, :, :]
        return np.asarray(windows @ weights)


@njit(cache=True)
def _inverse_band(L: ComplexArray) -> ComplexArray:
    """Return the band of (L L^H)^-1 in lower form from the banded factor L (Takahashi's recursion)."""
    width, size = L.shape
    Z = np.zeros_like(L)
    for j in range(size - 1, -1, -1):
        last = min(j + width - 1, size - 1)
        for i in range(last, j - 1, -1):
            total = 0.0 + 0.0j
            for k in range(j + 1, last + 1):
                z = Z[i - k, k] if i >= k else np.conj(Z[k - i, i])
                total += z * L[k - j, j]
            if i == j:
                Z[0, j] = (1.0 / L[0, j] - total) / L[0, j]
                Z[0, j] = Z[0, j].real
            else:
                Z[i - j, j] = -total / L[0, j]
    return Z


@njit(cache=True)
def _real_log_likelihoods(S: FloatArray, noise: FloatArray, kernel: FloatArray, noise_row: FloatArray,
                          z: FloatArray) -> FloatArray:
    """Return log p(z) of one channel, whose covariance is real, for each spectrum (B, n_fine) and noise (B,)."""
    width, taps = kernel.shape
    size, out = z.shape[1], np.empty(S.shape[0])
    L, x = np.empty((size, width)), np.empty((2, size))      # L[i, d] = L_{i, i - d}
    for b in range(S.shape[0]):
        total, bad = 0.0, False
        for i in range(size):
            reach = min(i, width - 1)
            for d in range(reach, -1, -1):
                j = i - d
                value = noise_row[d] * noise[b]
                for t in range(FINE * d, taps):
                    value += kernel[d, t] * S[b, j * FINE + t]
                for k in range(d + 1, reach + 1):
                    if k - d < width:
                        value -= L[i, k] * L[j, k - d]
                if d > 0:
                    L[i, d] = value / L[j, 0]
                elif value > 0.0:
                    L[i, 0] = np.sqrt(value)
                else:
                    bad = True
                    L[i, 0] = 1.0
            total -= 2.0 * np.log(L[i, 0])
            for c in range(2):
                value = z[c, i]
                for d in range(1, reach + 1):
                    value -= L[i, d] * x[c, i - d]
                x[c, i] = value / L[i, 0]
                total -= x[c, i] ** 2
        out[b] = -np.inf if bad or not np.isfinite(total) else total
    return out
