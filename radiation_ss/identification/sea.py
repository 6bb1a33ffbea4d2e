"""The sea as an unknown: JONSWAP with free height, period and peakedness, a second system, and a smooth deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.waves.spectrum import jonswap_shape

HEIGHT_SPREAD, PERIOD_SPREAD, PEAK_SPREAD = 1.0, 0.25, 0.7      # of log Hs, log Tp, log(gamma - 1)
PEAK_MEDIAN = 2.3                                               # gamma - 1
SECOND_MEDIAN, SECOND_SPREAD, RATIO_SPREAD = 0.5, 1.0, 0.4      # energy ratio of a second system, log of its period's
SCALE_MEDIAN, SCALE_SPREAD = 0.1, 0.8                          # of the deviation's standard deviation in log S
BASIC = 3
SECOND = 2


@dataclass(frozen=True, eq=False)
class SeaModel:
    """Wave spectrum S(w; v), v standardised.

    v holds height, period, peakedness of the first JONSWAP system; energy ratio and period ratio of a second one with
    the same peakedness, where there is one; the size of the deviation and its coefficients.

    Parameters
    ----------
    height, period : float
        Prior medians of Hs [m] and Tp [s] of the first system.
    knots : ndarray, shape (m,)
        Frequencies [rad/s] of the deviation's bumps, spaced evenly in log w; none = no deviation.
    two_systems : bool
    """

    height: float
    period: float
    knots: FloatArray
    two_systems: bool = False

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self._deviation_at + (1 + self.knots.size if self.knots.size else 0)

    @property
    def _deviation_at(self) -> int:
        """Where the deviation's parameters start in v."""
        return BASIC + (SECOND if self.two_systems else 0)

    def natural(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (Hs [m], Tp [s], gamma) of the first system, each shape (...)."""
        return (self.height * np.exp(HEIGHT_SPREAD * v[..., 0]), self.period * np.exp(PERIOD_SPREAD * v[..., 1]),
                1.0 + PEAK_MEDIAN * np.exp(PEAK_SPREAD * v[..., 2]))

    def second(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the second system's energy and period over the first's, each shape (...)."""
        return SECOND_MEDIAN * np.exp(SECOND_SPREAD * v[..., BASIC]), np.exp(RATIO_SPREAD * v[..., BASIC + 1])

    def standardised_second(self, energy: float, period: float) -> FloatArray:
        """Return the standardised parameters of a second system, shape (2,)."""
        return np.array([np.log(energy / SECOND_MEDIAN) / SECOND_SPREAD, np.log(period) / RATIO_SPREAD])

    def density(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return S(w) [m^2 s/rad], shape (..., nw); of zero or negative frequencies 0."""
        height, period, gamma = (item[..., None] for item in self.natural(v))
        S = height**2 / 16.0 * _unit_energy(omega, period, gamma)
        if self.two_systems:
            energy, ratio = (item[..., None] for item in self.second(v))
            S = S + height**2 / 16.0 * energy * _unit_energy(omega, period * ratio, gamma)
        if self.knots.size:
            S = S * np.exp(self.deviation(v, omega))
        return np.asarray(S)

    def deviation(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return the log of the deviation, shape (..., nw)."""
        at = self._deviation_at
        scale = SCALE_MEDIAN * np.exp(SCALE_SPREAD * v[..., at])
        return np.asarray(scale[..., None] * (v[..., at + 1:at + 1 + self.knots.size] @ self._bumps(omega)))

    def _bumps(self, omega: FloatArray) -> FloatArray:
        """Return Gaussian bumps in log w, scaled so that their random sum has variance about 1, shape (m, nw)."""
        centre = np.log(self.knots)
        width = centre[1] - centre[0]
        distance = (np.log(np.maximum(omega, 1e-3 * self.knots[0])) - centre[:, None]) / width
        bumps = np.exp(-0.5 * distance**2)
        # sum_i exp(-(x - i)^2) = sqrt(pi) for evenly spaced i
        return np.asarray(bumps / np.pi**0.25)


def _unit_energy(omega: FloatArray, period: FloatArray, gamma: FloatArray) -> FloatArray:
    """Return JONSWAP spectra of unit area, by Yamaguchi's (1984) area of the shape, within 1 %: smooth in gamma."""
    x = np.maximum(omega, 0.0) * period / (2.0 * np.pi)
    return np.asarray(period / (2.0 * np.pi) / (0.065 * gamma**0.803 + 0.135) * jonswap_shape(x, gamma))
