"""Exciting force from a measured wave elevation, with the doubt about X that identification needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.identification.haskind import Haskind, relation
from radiation_ss.identification.sea import bumps_about
from radiation_ss.inference.parameters import Parametrisation


@dataclass(frozen=True, eq=False)
class WaveForce:
    """Exciting force from the wave elevation: X by Haskind's relation with the damping, times a complex error."""

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
        X = self.haskind.exciting_force(np.einsum("wjj->wj", form.K(form.theta(u), self.omega).real))
        moved = self.spectrum[:, None] * X * np.exp(parts[:n] + 1j * parts[n:]).T
        return np.asarray(np.fft.irfft(moved, 2 * self.samples, axis=0)[self.trim:self.samples - self.trim])


def wave_force(model: Model, elevation: FloatArray, dt: float, frequency: float, error: float, trim: int) -> WaveForce:
    """Return the exciting force of an elevation (nt,) at the body, with X of the model's first direction.

    Parameters
    ----------
    frequency : float
        A typical frequency of the motion [rad/s]; the error of X has bumps from half to twice that.
    error, trim
        As in WaveForce.
    """
    nt = elevation.size
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(2 * nt, dt), dtype=np.float64)
    assert model.hydro is not None
    spectrum = np.where(omega > 1.5 * model.hydro.omega[-1], 0.0, np.fft.rfft(elevation, 2 * nt))
    bumps = bumps_about(frequency * np.exp(np.linspace(-0.7, 0.7, 5)), omega)
    return WaveForce(spectrum, omega, relation(model, np.maximum(omega, omega[1]))[0], bumps, error, nt, trim)
