"""Exciting force from motion: the fixed-interval smoother of a force coloured by the sea, with its band.

Under a stationary normal force of known spectrum the estimate is its conditional mean given the motion. It is
formed here from the covariance functions directly (what a Rauch-Tung-Striebel smoother does step by step once the
spectrum is written as a shaping filter), so that the spectrum needs no rational approximation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular
from scipy.special import ndtr
from scipy.stats import t as student

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.channels import Channels
from radiation_ss.identification.result import ForceEstimate


@dataclass(frozen=True)
class Window:
    """How a record is cut for the smoother, and its band."""

    # core, margin: Kept part of a window, and part beyond it on each side, in typical periods
    core: float = 10.0
    margin: float = 5.0
    most: int = 700  # Samples of one window at most; a record with more is thinned
    tail: float = 1.959964  # Standard deviations of the band's half width

    @property
    def periods(self) -> float:
        """Length in typical periods."""
        return self.core + 2.0 * self.margin


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
    """Return factors and variances (L n) for motion sampled `length` times, with `good` (L, p) samples.

    The force is root.T @ white of white = lower^-1 y, of the factors lower and root.
    """
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


def smooth_one(model: ForceSpectra, y: FloatArray, dt: float, period: float,
               cut: Window = Window()) -> tuple[FloatArray, FloatArray]:
    """Return force mean and variance, each (nt, n), from motion y (nt, p) with NaN where missing."""
    nt, n = y.shape[0], model.force.shape[1]
    length = min(nt, int(cut.periods * period / dt))
    margin = min(int(cut.margin * period / dt), (length - 1) // 2)
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


def total_deviation(means: FloatArray, variances: FloatArray, cut: Window = Window()) -> FloatArray:
    """Return half the band's width about the mean of m draws (m, ...), by Rubin's (1987) rules.

    Within and between draws; the factor 1 + 1/m is for the mean itself, which is that of m draws only. A spread between
    few draws is itself unsure, so the band is that of a t distribution with his degrees of freedom.
    """
    m, within = means.shape[0], variances.mean(axis=0)
    if m < 2:
        return np.asarray(cut.tail * np.sqrt(within), dtype=np.float64)
    between = means.var(axis=0, ddof=1) * (1.0 + 1.0 / m)
    freedom = (m - 1) * (1.0 + within / np.maximum(between, 1e-12 * within + 1e-300)) ** 2
    return np.asarray(student.ppf(ndtr(cut.tail), np.minimum(freedom, 1e6)) * np.sqrt(within + between))


def smooth_force(models: list[ForceSpectra], y: FloatArray, channels: Channels,
                 cut: Window = Window()) -> ForceEstimate:
    """Return the force with its 95 % band over the spread of the draws and each draw's own uncertainty.

    `models`: one for each draw of the posterior; all equally likely. `y` (nt, p): channels in the units of the models'
    motion, NaN where missing. `channels`: whose times and typical period they have.
    """
    dt, period = channels.dt, channels.period
    stride = max(1, int(np.ceil(cut.periods * period / dt / cut.most)))
    results = [smooth_one(model, y[::stride], dt * stride, period, cut) for model in models]
    means = np.array([mean for mean, _ in results])
    mean = means.mean(axis=0)
    half = total_deviation(means, np.array([variance for _, variance in results]), cut)
    if stride > 1:
        from scipy.interpolate import CubicSpline

        at, all_at = np.arange(0, y.shape[0], stride), np.arange(y.shape[0])
        mean = CubicSpline(at, mean)(all_at)
        half = np.stack([np.interp(all_at, at, column) for column in half.T], axis=1)
    return ForceEstimate(channels.time, mean.T, (mean - half).T, (mean + half).T)
