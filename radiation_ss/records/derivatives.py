"""Velocity and acceleration from a measured displacement, with the noise that they carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.fft import dct, dst
from scipy.optimize import minimize

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.errors import InputError, SolverError
from radiation_ss.records.record import Record

MEDIAN_CHI2 = 0.4549  # median of a chi-square variable with one degree of freedom


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Displacement, velocity and acceleration of one channel, shape (3, nt), and their standard deviations."""

    # values, std (3, nt): Rows: displacement [m or rad], velocity, acceleration. `std` is the noise that remains.
    values: FloatArray
    std: FloatArray
    noise: float  # Standard deviation of the measurement's noise, given or estimated


def fourier_derivatives(displacement: ArrayLike, dt: float, *, cutoff: float | None = None,
                        noise: float | None = None) -> Derivatives:
    """Differentiate a Fourier series of the record, term by term (the paper's way).

    The line through the ends is taken off and a sine series is fitted to the rest, so that the ends make no jump; the
    series stops at `cutoff`. A white noise of standard deviation s leaves a velocity noise of variance
    2 s^2/(nt-1) sum_m w_m^2 cos^2(w_m t). Only for even samples without gaps; near the ends the acceleration is forced
    to zero.

    Parameters
    ----------
    displacement : array_like, shape (nt,)
    dt : float
        Time step [s].
    cutoff : float, optional
        Highest circular frequency kept [rad/s]. By default where the spectrum sinks into the noise floor.
    noise : float, optional
        Standard deviation of the measurement's noise; by default from the floor in the upper half of the spectrum.

    Raises
    ------
    InputError
        If there are fewer than 8 samples, or one is missing.
    """
    x = read_only(displacement, "displacement", (None,))
    if x.size < 8:
        raise InputError(f"displacement: {x.size} samples; at least 8 are needed")
    count = x.size - 1
    slope = (x[-1] - x[0]) / (count * dt)
    line = x[0] + slope * dt * np.arange(x.size)
    terms = dst((x - line)[1:-1], type=1) / count  # sin(w_m t), m = 1 .. count - 1
    omega = np.pi * np.arange(1, count) / (count * dt)
    if noise is None:
        noise = float(np.sqrt(0.5 * count * np.median(terms[terms.size // 2:] ** 2) / MEDIAN_CHI2))
    if cutoff is None:
        level = np.convolve(terms**2, np.full(9, 1.0 / 9.0), mode="same")
        peak = int(np.argmax(level))
        quiet = np.flatnonzero(level[peak:] < 6.0 * noise**2 / count)  # three times the floor
        cutoff = float(omega[peak + quiet[0]] if quiet.size else omega[-1])
    kept = np.where(omega <= cutoff, terms, 0.0)
    values = np.stack([line, np.full(x.size, slope), np.zeros(x.size)])
    values[0, 1:-1] += 0.5 * dst(kept, type=1)
    values[1] += 0.5 * dct(np.concatenate([[0.0], kept * omega, [0.0]]), type=1)
    values[2, 1:-1] -= 0.5 * dst(kept * omega**2, type=1)
    std = np.empty_like(values)
    for row in range(3):
        weight = np.zeros(count)
        weight[1:] = np.where(omega <= cutoff, omega ** (2 * row), 0.0)
        ripple = np.fft.fft(weight).real  # sum_m weight_m cos(2 w_m t_k): sin^2 and cos^2 differ in its sign
        sign = 1.0 if row == 1 else -1.0
        std[row] = np.sqrt(np.maximum(weight.sum() + sign * np.append(ripple, ripple[0]), 0.0) / count) * noise
    return Derivatives(values, std, noise)


def smoother_derivatives(time: ArrayLike, displacement: ArrayLike, *, noise: float | None = None) -> Derivatives:
    """Estimate displacement, velocity and acceleration by a Kalman smoother whose snap is white noise.

    For any sampling and with gaps (NaN). The size of the snap, and of the measurement's noise unless given, are those
    of the largest likelihood. In the limit it is a smoothing spline of degree seven, with its bands: a
    spectrum that falls as w^-8, close to the w^-9 of a floating body in a sea.

    Parameters
    ----------
    time : array_like, shape (nt,)
        Ascending times [s].
    displacement : array_like, shape (nt,)
        NaN where missing.
    noise : float, optional
        Standard deviation of the measurement's noise [m or rad].

    Raises
    ------
    InputError
        If fewer than 8 samples are there or the channel is constant.
    SolverError
        If the likelihood has no maximum.
    """
    t = read_only(time, "time", (None,))
    y = read_only(displacement, "displacement", (t.size,), finite=False)
    there = np.isfinite(y)
    if there.sum() < 8 or np.ptp(y[there]) == 0.0:
        raise InputError("displacement: constant, or fewer than 8 samples; nothing to differentiate")
    scale, unit = float(np.std(y[there])), float(np.median(np.diff(t)))
    s, z = t / unit, (y - y[there].mean()) / scale
    mean, P = np.zeros((t.size, 4)), np.zeros((t.size, 4, 4))

    def cost(log: FloatArray) -> float:
        variance = (noise / scale) ** 2 if noise is not None else np.exp(log[1])
        return -filter_snap(s, z, np.exp(log[0]), variance, mean, P)

    rough = float(np.nanvar(np.diff(z[there], 4)))  # fourth difference: snap and 70 times the noise
    start = [np.log(rough)] + ([] if noise is not None else [np.log(rough / 140.0)])
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 1e-3, "maxiter": 400})
    if not found.success:
        raise SolverError(f"displacement: the smoother's likelihood has no maximum ({found.message})")
    variance = (noise / scale) ** 2 if noise is not None else float(np.exp(found.x[1]))
    cost(found.x)
    mean, var = smooth(s, float(np.exp(found.x[0])), mean, P)
    size = scale / unit ** np.arange(3)[:, None]
    values = mean.T[:3] * size
    values[0] += y[there].mean()
    return Derivatives(values, np.sqrt(var.T[:3]) * size, float(np.sqrt(variance)) * scale)


def smooth(t: FloatArray, q: float, mean: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the Rauch-Tung-Striebel smoother's means and variances, shape (nt, 4), from what `filter_snap` left."""
    mean, P = mean.copy(), P.copy()
    F, Q = np.zeros((4, 4)), np.zeros((4, 4))
    for k in range(t.size - 2, -1, -1):
        transition(t[k + 1] - t[k], q, F, Q)
        ahead = F @ P[k] @ F.T + Q
        gain = np.linalg.solve(ahead, F @ P[k]).T
        mean[k] += gain @ (mean[k + 1] - F @ mean[k])
        P[k] += gain @ (P[k + 1] - ahead) @ gain.T
    return mean, np.maximum(np.einsum("kii->ki", P), 0.0)


def with_derivatives(record: Record, dofs: Sequence[str] | None = None, *,
                     method: str = "smoother") -> tuple[Record, dict[str, FloatArray]]:
    """Return the record with the velocity and acceleration channels that it lacks, and their standard deviations.

    Parameters
    ----------
    dofs : sequence of str, optional
        All that have a displacement if absent.
    method : str
        "smoother" (any sampling, gaps) or "fourier" (the paper's).

    Returns
    -------
    record : Record
    std : dict of channel to ndarray, shape (nt,)
        Of the channels added.
    """
    if method not in ("smoother", "fourier"):
        raise InputError(f"method: {method!r} is unknown; use 'smoother' or 'fourier'")
    channels: dict[str, ArrayLike] = {}
    std: dict[str, FloatArray] = {}
    for dof in dofs or [d for d in record.dofs if d in record.channels]:
        if dof not in record.channels:
            raise InputError(f"record {record.name}: no channel {dof!r} to differentiate")
        if method == "fourier":
            steps = np.diff(record.time)
            if np.ptp(steps) > 1e-3 * steps.mean():
                raise InputError(f"record {record.name}: uneven times; use method='smoother'")
            found = fourier_derivatives(record.channels[dof], float(steps.mean()))
        else:
            found = smoother_derivatives(record.time, record.channels[dof])
        for row, suffix in ((1, "_velocity"), (2, "_acceleration")):
            if dof + suffix not in record.channels:
                channels[dof + suffix], std[dof + suffix] = found.values[row], found.std[row]
    return record.with_channels(**channels), std


@njit(cache=True)
def filter_snap(t: np.ndarray, y: np.ndarray, q: float, r: float,
                mean: np.ndarray, P: np.ndarray) -> float:
    """Run a Kalman filter on (d/dt)^4 x = white noise of intensity q, x measured with variance r; NaN is missing.

    Products are written out: linear algebra calls would take ten seconds to compile.

    Parameters
    ----------
    mean, P : ndarray, shapes (nt, 4), (nt, 4, 4)
        Filled with the filtered displacement, velocity, acceleration and jerk, and their covariance.

    Returns
    -------
    log_likelihood : float
    """
    F, Q = np.zeros((4, 4)), np.zeros((4, 4))
    total = 0.0
    for k in range(t.size):
        x, p = mean[k], P[k]
        if k == 0:
            for i in range(4):
                p[i, i] = 100.0
        else:
            transition(t[k] - t[k - 1], q, F, Q)
            for i in range(4):
                x[i] = 0.0
                for j in range(4):
                    x[i] += F[i, j] * mean[k - 1, j]
                    p[i, j] = Q[i, j]
                    for m in range(i, 4):  # F is upper triangular
                        for n in range(j, 4):
                            p[i, j] += F[i, m] * P[k - 1, m, n] * F[j, n]
        if not np.isnan(y[k]):
            s = p[0, 0] + r
            e = y[k] - x[0]
            g0, g1, g2, g3 = p[0, 0] / s, p[1, 0] / s, p[2, 0] / s, p[3, 0] / s
            gain = (g0, g1, g2, g3)
            for i in range(4):
                x[i] += gain[i] * e
                for j in range(4):
                    p[i, j] -= gain[i] * gain[j] * s
            total -= 0.5 * (e * e / s + np.log(2.0 * np.pi * s))
    return total


@njit(cache=True)
def transition(d: float, q: float, F: np.ndarray, Q: np.ndarray) -> None:
    """Fill the transition over d and the noise of a chain of four integrators driven by white noise of intensity q."""
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    for i in range(4):
        for j in range(4):
            if j >= i:
                F[i, j] = d ** (j - i) / factorial[j - i]
            m, n = 3 - i, 3 - j
            Q[i, j] = q * d ** (m + n + 1) / (factorial[m] * factorial[n] * (m + n + 1))
