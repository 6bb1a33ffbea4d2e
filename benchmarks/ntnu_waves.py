"""Waves in the flume told apart by the probes: what runs towards the wavemaker comes back from it."""

from __future__ import annotations

import numpy as np
from scipy.fft import next_fast_len, rfft

from radiation_ss.hydro.linear_waves import wave_number
from radiation_ss.waves.realise import Sea, harmonics

G = 9.81


def two_ways(elevations: np.ndarray, places: np.ndarray, h: float, depth: float) -> tuple[Sea, Sea]:
    """Return the waves at y = 0 that run away from there and those that run towards it.

    Least squares over the probes of linear waves a e^{i (w t - k y)} + b e^{i (w t + k y)}, frequency by frequency.

    Parameters
    ----------
    elevations : ndarray, shape (n, nt)
        Of n probes [m].
    places : ndarray, shape (n,)
        Their distances y from the wavemaker [m].
    h, depth : float
        Time step [s], water depth [m].
    """
    samples = elevations.shape[1]
    period = next_fast_len(2 * samples, real=True)
    path = wave_numbers(period, h, depth)[:, None] * places
    seen = np.exp(1j * np.stack([-path, path], axis=-1))
    amplitudes = 2.0 / period * rfft(elevations, period).T[..., None]
    away, towards = (np.linalg.pinv(seen, rcond=0.1) @ amplitudes)[..., 0].T
    return tuple(Sea(h, samples, period, wave[None], None) for wave in (away, towards))


def come_back(towards: Sea, place: float, depth: float) -> Sea:
    """Return the waves at y = place once they have run to y = 0 and were sent back there, all of them.

    A flap that moves as it is told is a wall for them.
    """
    phase = np.exp(-1j * place * wave_numbers(towards.period, towards.dt, depth))
    return Sea(towards.dt, towards.samples, towards.period, towards.amplitudes * phase, None)


def wave_numbers(period: int, h: float, depth: float) -> np.ndarray:
    """Return the wave numbers [1/m] of the harmonics of a record of `period` steps."""
    return np.append(0.0, wave_number(harmonics(period, h)[1:] ** 2 / G, depth))
