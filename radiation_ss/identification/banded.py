"""Likelihood of tapered Fourier coefficients of a stationary normal process, with their exact banded covariance.

A Hann window makes coefficients more than a few bins apart independent for all practical purposes, but neighbours are
not: keeping their covariance makes the likelihood that of the record itself, short or long, with leakage in it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.identification.channels import strong_bins
from radiation_ss.jit import jit


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Windowed Fourier coefficients z_k = sum_t w_t y_t e^{-i w_k (t - centre)} of channels; noise gain 1."""

    y: FloatArray  # (m, nt, p): Complete samples of m stretches, independent of each other
    dt: float
    # first, last: Bins used: w_k = 2 pi k / (nt dt), first <= k <= last
    first: int
    last: int
    reach: int = 6  # Bins beyond which the window's side lobes are dropped
    finer: int = 4  # Points of the spectral integral per bin

    @property
    def spacing(self) -> float:
        """Width of a bin [rad/s]."""
        return float(2.0 * np.pi / (self.y.shape[1] * self.dt))

    @cached_property
    def omega(self) -> FloatArray:
        """Frequencies of the bins [rad/s], shape (nk,)."""
        return self.spacing * np.arange(self.first, self.last + 1, dtype=np.float64)

    @cached_property
    def fine(self) -> FloatArray:
        """Frequencies of the spectral integral [rad/s]: bins and `reach` beyond them on either side, `finer` a bin."""
        points = np.arange((self.first - self.reach) * self.finer, (self.last + self.reach) * self.finer + 1)
        return np.asarray(self.spacing / self.finer * points, dtype=np.float64)

    @cached_property
    def positive(self) -> FloatArray:
        """The frequencies `fine`, kept from zero, at which spectra are formed [rad/s]."""
        return np.maximum(self.fine, self.spacing / self.finer)

    def with_power(self, floor: float) -> "Coefficients":
        """Return the stretch without the bins at either end where no motion has `floor` of its largest density."""
        density = np.mean(np.abs(self.z) ** 2, axis=0)
        good = strong_bins(density, floor)
        # The window smears an edge over two bins and the average over one.
        first = self.first + good[0] + 2 * (good[0] > 0)
        last = self.first + good[-1] - 2 * (good[-1] < len(density) - 1)
        least = 2 * self.reach + 2
        if last - first < least:
            first = max(self.first, (first + last - least) // 2)
            last = first + least
        return replace(self, first=int(first), last=int(last))

    @cached_property
    def _time(self) -> FloatArray:
        """Times about the record's middle, shape (nt,)."""
        nt = self.y.shape[1]
        return (np.arange(nt) - 0.5 * (nt - 1)) * self.dt

    @cached_property
    def window(self) -> FloatArray:
        """Hann window of unit energy, shape (nt,)."""
        w = 0.5 + 0.5 * np.cos(self.spacing * self._time)
        return np.asarray(w / np.sqrt(np.sum(w**2)), dtype=np.float64)

    @cached_property
    def z(self) -> ComplexArray:
        """Coefficients, shape (m, nk, p)."""
        nt = self.y.shape[1]
        k = np.arange(self.first, self.last + 1)
        spectrum = np.fft.fft(self.window[:, None] * self.y, axis=1)[:, k % nt]
        return np.asarray(spectrum * np.exp(-1j * k * self.spacing * self._time[0])[:, None])

    @cached_property
    def kernel(self) -> FloatArray:
        """Weights of S(w_k + nu) in the covariance of bins k and k + d, shape (2 reach + 1, 2 reach finer + 1)."""
        step, most = self.spacing / self.finer, self.reach * self.finer
        taps = np.arange(-most, most + 1)
        W = np.cos(np.outer(step * np.arange(most + 1), self._time)) @ self.window    # the window is even
        kernel = np.zeros((2 * self.reach + 1, taps.size))
        for d in range(2 * self.reach + 1):
            away = np.abs(taps - d * self.finer)
            near = away <= most
            kernel[d, near] = W[away[near]] * W[np.abs(taps[near])] * 0.5 * step
        return kernel

    @cached_property
    def noise(self) -> FloatArray:
        """Covariance of bins d apart of white noise of unit variance, shape (2 reach + 1,)."""
        lags = self.spacing * np.arange(2 * self.reach + 1)
        return np.asarray(np.cos(np.outer(lags, self._time)) @ self.window**2)

    def covariance(self, S: ComplexArray, noise: FloatArray) -> ComplexArray:
        """Return the covariance of one stretch's z.ravel() in lower band form.

        S (n_fine, p, p): one-sided cross spectra at `fine`, S_ij ~ y_i conj(y_j); noise (p,): variances of white noise.
        """
        nk, p = self.z.shape[1:]
        windows = sliding_window_view(S, self.kernel.shape[1], axis=0)[::self.finer][:nk]
        blocks = np.moveaxis(windows @ self.kernel.T, -1, 0) + self.noise[:, None, None, None] * np.diag(noise)
        band = np.zeros((self.noise.size * p, nk * p), dtype=blocks.dtype)
        for d in range(self.noise.size):
            for i in range(p):
                for j in range(p):
                    if d * p + i - j >= 0:
                        band[d * p + i - j, j:(nk - d) * p:p] = blocks[d, :nk - d, i, j]
        return band

    def _factor(self, S: ComplexArray, noise: FloatArray) -> tuple[ComplexArray, ComplexArray, float] | None:
        """Return the banded factor, C^-1 z, shape (nk p, m), and log p(z); None if C is not positive definite."""
        band = self.covariance(S, noise)
        if not np.isfinite(band).all():
            return None
        try:
            factor = np.asarray(cholesky_banded(band, lower=True, check_finite=False))
        except LinAlgError:
            return None
        flat = self.z.reshape(len(self.z), -1).T
        alpha = cho_solve_banded((factor, True), flat, check_finite=False)
        return factor, alpha, (-2.0 * len(self.z) * float(np.log(factor[0].real).sum())
                               - float(np.vdot(flat, alpha).real))

    def log_likelihood(self, S: ComplexArray, noise: FloatArray) -> float:
        """Return log p(z) up to a constant; -inf if the covariance is not positive definite."""
        found = self._factor(S, noise)
        return -np.inf if found is None else found[2]

    def gradient(self, S: ComplexArray, noise: FloatArray) -> tuple[float, ComplexArray, FloatArray]:
        """Return log p(z), and its exact derivatives by S and by the noise variances: d value = Re sum(by_S * dS)."""
        m, nk, p = self.z.shape
        found = self._factor(S, noise)
        if found is None:
            return -np.inf, np.zeros_like(S), np.zeros(p)
        factor, alpha, value = found
        inverse = inverse_band(factor.astype(complex))
        lags, taps = self.noise.size, self.kernel.shape[1]
        by_noise, by_S = np.zeros(p), np.zeros((S.shape[0] + taps, p, p), dtype=complex)
        for i in range(p):
            for j in range(p):
                # d(log p) = tr[(alpha alpha^H - m C^-1) dC], with dC_rc = kernel dS_ij and its mirror.
                G = np.zeros((nk, lags), dtype=complex)
                for d in range(lags):
                    row, column = d * p + np.arange(nk - d) * p + i, np.arange(nk - d) * p + j
                    r, c = np.maximum(row, column), np.minimum(row, column)
                    Z = np.where(row >= column, inverse[r - c, c], inverse[r - c, c].conj())
                    G[:nk - d, d] = (1.0 if d == 0 else 2.0) * np.conj(
                        np.sum(alpha[row] * alpha[column].conj(), axis=1) - m * Z)
                by_noise[i] += float(G.sum(axis=0).real @ self.noise) if i == j else 0.0
                spread = G @ self.kernel
                for t in range(taps):
                    by_S[t:t + nk * self.finer:self.finer, i, j] += spread[:, t]
        return value, by_S[:S.shape[0]], by_noise

    def local_average(self, S: ComplexArray) -> ComplexArray:
        """Return spectra seen by the bins themselves, shape (..., nk, p, p), of S (..., n_fine, p, p)."""
        windows = sliding_window_view(S, self.kernel.shape[1], axis=-3)[..., ::self.finer, :, :, :]
        return np.asarray(windows[..., :self.z.shape[1], :, :, :] @ self.kernel[0])


@jit
def inverse_band(L: ComplexArray) -> ComplexArray:
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
                Z[0, j] = ((1.0 / L[0, j] - total) / L[0, j]).real
            else:
                Z[i - j, j] = -total / L[0, j]
    return Z
