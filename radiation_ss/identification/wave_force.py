"""Exciting force from a measured wave elevation, with the doubt about X that identification needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.identification.haskind import positive
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import interpolate


@dataclass(frozen=True, eq=False)
class WaveForce:
    """Exciting force from the wave elevation: X by Haskind's relation with the damping, times a smooth complex error.

    Parameters
    ----------
    spectrum : ndarray, shape (nw,)
        Fourier coefficients of the elevation, padded to twice its length.
    omega : ndarray, shape (nw,)
    X : ndarray, shape (nw, n)
        The model's; it holds for the prior's damping.
    damping : ndarray, shape (nw, n)
        The prior's B_jj.
    bumps : ndarray, shape (m, nw)
        Shapes of the error of log X, real part and phase alike.
    error : float
        Standard deviation of that error.
    samples : int
        Of the elevation.
    trim : int
        Samples left out at both ends, where the force is wrong because X is not causal.
    """

    spectrum: ComplexArray
    omega: FloatArray
    X: ComplexArray
    damping: FloatArray
    bumps: FloatArray
    error: float
    samples: int
    trim: int = 0

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return 2 * self.bumps.shape[0] * self.X.shape[1]

    def force(self, form: Parametrisation, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force (nt, n)."""
        n, floor = self.X.shape[1], 1e-3 * np.abs(self.damping).max(axis=0)
        B = np.einsum("wjj->wj", form.K(form.theta(u), self.omega).real)
        change = np.sqrt(positive(B, floor) / positive(self.damping, floor))
        parts = self.error * (v.reshape(2 * n, -1) @ self.bumps)
        X = self.X * change * np.exp(parts[:n] + 1j * parts[n:]).T
        padded = 2 * self.samples
        whole = np.fft.irfft(self.spectrum[:, None] * X, padded, axis=0)
        return np.asarray(whole[self.trim:self.samples - self.trim])


def wave_force(model: Model, form: Parametrisation, elevation: FloatArray, dt: float, frequency: float,
               error: float, trim: int, knots: int = 5) -> WaveForce:
    """Return the exciting force of an elevation (nt,) at the body, with X of the model's first direction.

    Parameters
    ----------
    frequency : float
        A typical frequency of the motion [rad/s]; the error of X has bumps from half to twice that.
    trim : int
        As in WaveForce.
    """
    table, nt = model.hydro, elevation.size
    assert table is not None and table.X is not None
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(2 * nt, dt), dtype=np.float64)
    X = interpolate(table.omega, table.X[:, 0, :], np.clip(omega, table.omega[0], table.omega[-1]))
    X[omega > 1.5 * table.omega[-1]] = 0.0
    centre = np.log(frequency) + np.linspace(-0.7, 0.7, knots)
    place = np.log(np.clip(omega, 0.4 * frequency, 2.5 * frequency))
    bumps = np.exp(-0.5 * ((place - centre[:, None]) / (centre[1] - centre[0])) ** 2) / np.pi**0.25
    damping = np.einsum("wjj->wj", form.K(form.mean, omega).real)
    return WaveForce(np.fft.rfft(elevation, 2 * nt), omega, X, damping, bumps, error, nt, trim)
