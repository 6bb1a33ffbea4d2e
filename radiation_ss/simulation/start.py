"""The unknown start of a record: displacement, velocity and the memory of what went before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.fit.rational import frequency_response
from radiation_ss.simulation.prepare import Prepared

MEMORY_DIRECTIONS = 3


@dataclass(frozen=True, eq=False)
class Start:
    """A Gaussian prior of the state at the first grid time: basis @ q with q of unit variance.

    Parameters
    ----------
    basis : ndarray, shape (m + 2 n, k)
        Columns in the order memory directions, displacements, velocities.
    """

    basis: FloatArray

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.basis.shape[1]

    def full(self, states: int) -> FloatArray:
        """Return the basis with rows of zero for the states of effects, which start at rest."""
        return np.vstack([self.basis, np.zeros((states - self.basis.shape[0], self.count))])


def start_of(model: Model, prepared: Prepared) -> Start:
    """Return the prior of a record's start from the size and speed of its motion.

    Displacement and velocity are almost free (10 times their typical size). The memory is what a motion of the
    typical size and of frequencies around the typical one can have left behind.
    """
    n, m = model.n, model.fit.states
    sizes = [motion_size(model, prepared, i) for i in range(n)]
    columns = []
    for i, (size, omega_m) in enumerate(sizes):
        if m:
            omega = omega_m * np.linspace(0.5, 1.5, 21)
            response = frequency_response(model.fit.a, model.fit.b[:, [i]], np.eye(m), omega)[:, :, 0]
            gram = (size * omega_m) ** 2 * np.real(np.einsum("wi,wj->ij", response, response.conj())) / omega.size
            values, vectors = eigh(gram)
            for k in np.argsort(values)[::-1][:MEMORY_DIRECTIONS]:
                if values[k] > 1e-8 * values[-1]:
                    columns.append(np.concatenate([vectors[:, k] * np.sqrt(values[k]), np.zeros(2 * n)]))
    for rows in (0, 1):
        for i, (size, omega_m) in enumerate(sizes):
            column = np.zeros(m + 2 * n)
            column[m + rows * n + i] = 10.0 * size * omega_m**rows
            columns.append(column)
    return Start(np.stack(columns, axis=1))


def motion_size(model: Model, prepared: Prepared, dof: int) -> tuple[float, float]:
    """Return the root mean square displacement about its mean [m or rad] and a typical frequency [rad/s]."""
    from radiation_ss.effects.nominal import natural_frequency

    omega = natural_frequency(model, dof)
    for order, quantity in enumerate(("displacement", "velocity", "acceleration")):
        for channel in prepared.channels:
            if channel.dof == dof and channel.quantity == quantity:
                if order == 0:
                    omega = typical_frequency(channel.time, channel.value, omega)
                size = float(np.std(channel.value)) / omega**order
                return max(size, 1e-12), omega
    sizes = [float(np.std(c.value)) for c in prepared.channels]
    return max(*sizes, 1e-12), omega


def typical_frequency(time: FloatArray, value: FloatArray, fallback: float) -> float:
    """Return the mean frequency of a signal's power spectrum around its peak [rad/s]."""
    dt = float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], dt), time, value)
    if even.size < 16:
        return fallback
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size))) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(even.size, dt)
    strong = power > 0.05 * power[1:].max()
    strong[0] = False
    return float(np.sum(omega[strong] * power[strong]) / np.sum(power[strong])) if strong.any() else fallback
