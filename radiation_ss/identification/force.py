"""Exciting force from an elevation, and from motion, smoothed.

Under a stationary normal force of known spectrum the smoothed force is its conditional mean given the motion. It is
formed here from the covariance functions directly (what a Rauch-Tung-Striebel smoother does step by step once the
spectrum is written as a shaping filter), so that the spectrum needs no rational approximation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular
from scipy.special import ndtr
from scipy.stats import t as student

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import SolverError
from radiation_ss.filter.estimate import Z95
from radiation_ss.identification.haskind import Haskind, error_bumps, receptance_times_X, relation
from radiation_ss.identification.spectral import SpectralLikelihood
from radiation_ss.identification.study import ForceEstimate, Study
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.records.record import Record

# A window of the smoother, in typical periods: with the part beyond what is kept, and that part on each side
WINDOW, MARGIN = 20.0, 5.0


@dataclass(frozen=True, eq=False)
class WaveForce:
    """Exciting force from the wave elevation: X by Haskind's relation with the damping, times a gain and an error."""

    spectrum: ComplexArray  # (nw,): Fourier coefficients of the elevation, padded to twice its length
    omega: FloatArray  # (nw,)
    haskind: Haskind  # At omega
    bumps: FloatArray  # (m, nw): Shapes of the error of log X, real part and phase alike
    error: float  # Standard deviation of that error
    samples: int  # Of the elevation
    trim: int = 0  # Samples left out at both ends, where the force is wrong because X is not causal

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return 2 * self.bumps.shape[0] * self.haskind.X.shape[1]

    def force(self, form: Parametrisation, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force (nt, n)."""
        n = self.haskind.X.shape[1]
        parts = self.error * (v.reshape(2 * n, -1) @ self.bumps)
        moved = self._of_body(form, u) * (np.exp(parts[:n] + 1j * parts[n:]).T * form.gain("force", u))
        return np.asarray(np.fft.irfft(moved, 2 * self.samples, axis=0)[self.trim:self.samples - self.trim])

    @cached_property
    def _last(self) -> list[tuple[Parametrisation, bytes, ComplexArray]]:
        return []

    def _of_body(self, form: Parametrisation, u: FloatArray) -> ComplexArray:
        """Return the force's coefficients (nw, n) but for the gain and the error; the last body's are kept.

        Most of a likelihood's slopes are at one body.
        """
        key = u.tobytes()
        for known, at, found in self._last:
            if known is form and at == key:
                return found
        X = self.haskind.exciting_force(np.einsum("wjj->wj", form.K(form.theta(u), self.omega).real))
        made = np.asarray(self.spectrum[:, None] * X)
        self._last[:] = [(form, key, made)]
        return made


def wave_force(model: Model, form: Parametrisation, elevation: FloatArray, dt: float, frequency: float, error: float,
               trim: int) -> WaveForce:
    """Return the force of an elevation (nt,) at the body; X errs by bumps from half to twice `frequency` [rad/s]."""
    nt = elevation.size
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(2 * nt, dt), dtype=np.float64)
    assert model.hydro is not None
    spectrum = np.where(omega > 1.5 * model.hydro.omega[-1], 0.0, np.fft.rfft(elevation, 2 * nt))
    return WaveForce(spectrum, omega, relation(model, form, np.maximum(omega, omega[1]))[0],
                     error_bumps(frequency, omega), error, nt, trim)


@dataclass(frozen=True, eq=False)
class ForceSpectra:
    """Spectra of one draw on a common frequency grid."""

    omega: FloatArray  # (nw,): Evenly spaced from 0 [rad/s]
    force: ComplexArray  # (nw, n): Force per wave amplitude
    motion: ComplexArray  # (nw, p): Channels per wave amplitude
    sea: FloatArray  # (nw,): One-sided wave spectrum
    noise: FloatArray  # (p,): Measurement noise variances of the channels
    unexplained: float | FloatArray = 0.0  # Share of each motion's spectrum beside what the sea makes

    def covariance(self, left: ComplexArray, right: ComplexArray, lags: FloatArray) -> FloatArray:
        """Return E[left(t + lag) right(t)], shape (n_lags, n_left, n_right), by the spectral integral."""
        weights = self.sea * (self.omega[1] - self.omega[0])
        product = (left[:, :, None] * right.conj()[:, None, :] * weights[:, None, None]).reshape(self.omega.size, -1)
        wave = np.outer(lags, self.omega)
        value = np.cos(wave) @ product.real - np.sin(wave) @ product.imag
        return np.asarray(value.reshape(lags.size, left.shape[1], right.shape[1]))


def window_estimate(model: ForceSpectra, length: int, dt: float, good: np.ndarray) -> tuple[FloatArray, ...]:
    """Return factors lower, root and variances (L n): the force is root.T lower^-1 y of samples `good` (L, p)."""
    lags = dt * np.arange(-(length - 1), length, dtype=np.float64)
    n, p = model.force.shape[1], model.motion.shape[1]
    at = np.arange(length)[:, None] - np.arange(length) + length - 1
    both = model.covariance(np.hstack([model.force, model.motion]), model.motion, lags)
    Rfy = both[:, :n][at].transpose(0, 2, 1, 3).reshape(length * n, length * p)
    alone = both[:, n:]
    alone[:, range(p), range(p)] *= 1.0 + model.unexplained
    Ryy = alone[at].transpose(0, 2, 1, 3).reshape(length * p, length * p)
    Rff = np.diagonal(model.covariance(model.force, model.force, np.zeros(1))[0])
    keep = good.ravel()
    # A jitter of 1e-9 of the motion's power keeps the factor well conditioned without noise.
    noise = model.noise + 1e-9 * np.diagonal(Ryy)[:p]
    Ryy = Ryy[np.ix_(keep, keep)] + np.diag(np.tile(noise, length)[keep])
    try:
        lower = cholesky(Ryy, lower=True)
    except LinAlgError:
        raise SolverError("force smoother: the motion's covariance is not positive definite; check the record's step "
                          "and units") from None
    root = solve_triangular(lower, Rfy[:, keep].T, lower=True)
    return lower, root, np.maximum(np.tile(Rff, length) - np.sum(root**2, axis=0), 0.0)


def smooth_one(model: ForceSpectra, y: FloatArray, dt: float, period: float) -> tuple[FloatArray, FloatArray]:
    """Return force mean and variance, each (nt, n), from motion y (nt, p) with NaN where missing."""
    nt, n = y.shape[0], model.force.shape[1]
    length = min(nt, int(WINDOW * period / dt))
    margin = min(int(MARGIN * period / dt), (length - 1) // 2)
    mean, variance = np.zeros((nt, n)), np.zeros((nt, n))
    good = np.isfinite(y)
    complete = window_estimate(model, length, dt, np.ones((length, y.shape[1]), bool))
    done = 0
    while done < nt:
        start = min(max(done - margin, 0), nt - length)
        end = start + length
        last = nt if end == nt else end - margin
        here = good[start:end]
        lower, root, spread = complete if here.all() else window_estimate(model, length, dt, here)
        white = solve_triangular(lower, y[start:end][here], lower=True)
        estimate = (white @ root).reshape(length, n)
        mean[done:last] = estimate[done - start:last - start]
        variance[done:last] = spread.reshape(length, n)[done - start:last - start]
        done = last
    return mean, variance


def smoothed(models: Sequence[ForceSpectra], y: FloatArray, dt: float,
             period: float) -> tuple[FloatArray, FloatArray]:
    """Return the force's mean and half the width of its band, each (nt, n), over the draws' models."""
    means, variances = map(np.array, zip(*(smooth_one(model, y, dt, period) for model in models)))
    return means.mean(axis=0), total_deviation(means, variances)


def total_deviation(means: FloatArray, variances: FloatArray) -> FloatArray:
    """Return half the band's width about the mean of m draws (m, ...), within and between them (Rubin 1987).

    That of a t distribution with his degrees of freedom: a spread between few draws is itself unsure.
    """
    m, within = means.shape[0], variances.mean(axis=0)
    if m < 2:
        return np.asarray(Z95 * np.sqrt(within), dtype=np.float64)
    between = means.var(axis=0, ddof=1) * (1.0 + 1.0 / m)
    freedom = (m - 1) * (1.0 + within / np.maximum(between, 1e-12 * within + 1e-300)) ** 2
    return np.asarray(student.ppf(ndtr(Z95), np.minimum(freedom, 1e6)) * np.sqrt(within + between))


def force_model(part: SpectralLikelihood, u: FloatArray, v: FloatArray, top: float = 6.0,
                points: int = 600) -> ForceSpectra:
    """Return the spectra of one draw on the smoother's grid, up to `top` times the motion's median frequency: the force
    may have much of its power where a free body hardly moves.
    """
    channels = part.channels
    omega = np.linspace(0.0, min(top * channels.frequency, np.pi / channels.dt), points + 1)
    w = np.maximum(omega, omega[1])
    haskind = part.with_errors(v, relation(part.model, part.form, w)[0], w)
    X, motion = receptance_times_X(part.model, part.form, u, w, haskind)
    factors = (1j * w[:, None]) ** channels.derivative / channels.rms
    return ForceSpectra(omega, X, motion[:, channels.dof] * factors, part.sea.density(v, omega), part.noise(v),
                        part.unexplained(v))


def estimate_force(branches: Sequence[tuple[SpectralLikelihood, FloatArray, FloatArray]], draws: int = 16,
                   most: int = 700) -> ForceEstimate:
    """Return the force of a record, with its band, over (some of) the draws u, v in each structure.

    A record with more than `most` samples in a window is thinned.
    """
    rows = [(part, u[i], v[i]) for part, u, v in branches for i in range(u.shape[0])]
    pick = np.unique(np.linspace(0, len(rows) - 1, min(draws, len(rows))).astype(int))
    channels = branches[0][0].channels
    y, dt, period = (channels.y - np.nanmean(channels.y, axis=0)) / channels.rms, channels.dt, channels.period
    stride = max(1, int(np.ceil(WINDOW * period / dt / most)))
    mean, half = smoothed([force_model(*rows[i]) for i in pick], y[::stride], dt * stride, period)
    if stride > 1:
        from scipy.interpolate import CubicSpline

        at, all_at = np.arange(0, y.shape[0], stride), np.arange(y.shape[0])
        mean = CubicSpline(at, mean)(all_at)
        half = np.stack([np.interp(all_at, at, column) for column in half.T], axis=1)
    return ForceEstimate(channels.time, mean.T, (mean - half).T, (mean + half).T)


def compare_forces(study: Study, record: Record, found: ForceEstimate, idle: ForceEstimate) -> dict[str, float]:
    """Return how far the force is from the prior model's, and both errors where the record carries the true force."""
    size = np.sqrt(np.mean(found.mean**2))
    out = {"change": float(np.sqrt(np.mean((found.mean - idle.mean) ** 2)) / size)}
    measured = record.get("force", study.model.dofs)
    if measured is not None and measured.shape == found.mean.shape:
        good = np.isfinite(measured)
        rms = np.sqrt(np.mean(measured[good] ** 2))
        for key, estimate in (("do_nothing_error", idle), ("identified_error", found)):
            out[key] = float(np.sqrt(np.mean((estimate.mean - measured)[good] ** 2)) / rms) if rms > 0.0 else np.nan
    return out
