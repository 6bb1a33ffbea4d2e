"""The sea as an unknown: JONSWAP with free height, period and peakedness, times a smooth deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.waves.spectrum import jonswap_shape

HEIGHT_SPREAD, PERIOD_SPREAD, PEAK_SPREAD = 1.0, 0.25, 0.7      # of log Hs, log Tp, log(gamma - 1)
PEAK_MEDIAN = 2.3                                               # gamma - 1
SCALE_MEDIAN, SCALE_SPREAD = 0.1, 0.8                           # of the deviation's standard deviation in log S


@dataclass(frozen=True, eq=False)
class SeaModel:
    """Wave spectrum S(w; v), v standardised: [height, period, peakedness; size of deviation, its coefficients].

    Parameters
    ----------
    height, period : float
        Prior medians of Hs [m] and Tp [s].
    knots : ndarray, shape (m,)
        Frequencies [rad/s] of the deviation's bumps, spaced evenly in log w; none = pure JONSWAP.
    """

    height: float
    period: float
    knots: FloatArray

    @property
    def size(self) -> int:
        """Number of parameters."""
        return 3 + (self.knots.size + 1 if self.knots.size else 0)

    def natural(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (Hs [m], Tp [s], gamma) of the JONSWAP part, each shape (...)."""
        return (self.height * np.exp(HEIGHT_SPREAD * v[..., 0]), self.period * np.exp(PERIOD_SPREAD * v[..., 1]),
                1.0 + PEAK_MEDIAN * np.exp(PEAK_SPREAD * v[..., 2]))

    def density(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return S(w) [m^2 s/rad], shape (..., nw); of zero or negative frequencies 0."""
        height, period, gamma = (item[..., None] for item in self.natural(v))
        x = np.maximum(omega, 0.0) * period / (2.0 * np.pi)
        # Area of the shape (Yamaguchi 1984), within 1 %: smooth in gamma and the same for all draws at once.
        area = 0.065 * gamma**0.803 + 0.135
        S: FloatArray = height**2 / 16.0 * period / (2.0 * np.pi) / area * jonswap_shape(x, gamma)
        if self.knots.size:
            S = S * np.exp(self.deviation(v, omega))
        return np.asarray(S)

    def deviation(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return the log of the deviation from JONSWAP, shape (..., nw)."""
        scale = SCALE_MEDIAN * np.exp(SCALE_SPREAD * v[..., 3])
        return np.asarray(scale[..., None] * (v[..., 4:4 + self.knots.size] @ self._bumps(omega)))

    def _bumps(self, omega: FloatArray) -> FloatArray:
        """Return Gaussian bumps in log w, scaled so that their random sum has variance about 1, shape (m, nw)."""
        centre = np.log(self.knots)
        width = centre[1] - centre[0]
        distance = (np.log(np.maximum(omega, 1e-3 * self.knots[0])) - centre[:, None]) / width
        bumps = np.exp(-0.5 * distance**2)
        # sum_i exp(-(x - i)^2) = sqrt(pi) for evenly spaced i
        return np.asarray(bumps / np.pi**0.25)
