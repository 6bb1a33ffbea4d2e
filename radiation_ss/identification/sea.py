"""The sea as an unknown, in competing families: one JONSWAP system or two, exact or not, and other spectra.

A departure is a sum of smooth bumps of the log spectrum whose size is itself unknown; lumps are narrow ones. The free
family is a straight line in log S over log w, between two edges of any steepness, with a departure.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy.special import ndtr

from radiation_ss.arrays import FloatArray
from radiation_ss.waves.spectrum import jonswap_shape


@dataclass(frozen=True)
class Family:
    """A family of seas."""

    probability: float  # Prior probability
    systems: int = 1  # JONSWAP systems, 1 or 2; 0: the free family
    departure: float = 0.0  # Prior median of the standard deviation of the departure of log S; 0: none
    lumps: float = 0.0  # Standard deviation of the lumps of log S

    @property
    def shape(self) -> int:
        """Number of shape parameters: Hs, Tp, gamma; those of a second system; level, slope, edges, steepnesses."""
        return 3 if self.systems == 1 else 6


@cache
def families() -> dict[str, Family]:
    """Return the families of seas."""
    return {"one system": Family(0.3), "departing": Family(0.2, 1, 0.2), "two systems": Family(0.2, 2, 0.1),
            "free": Family(0.1, 0, 0.7), "lumpy": Family(0.1, 1, 0.1, 0.4), "two lumpy": Family(0.05, 2, 0.1, 0.4),
            "free lumpy": Family(0.05, 0, 0.7, 0.4)}


@dataclass(frozen=True, eq=False)
class SeaPrior:
    """Prior medians and spreads (standard deviations of logarithms) of a sea's parameters."""

    # height, period: Spread of Hs and of Tp
    height: float = 1.0
    period: float = 0.25
    # Largest peak enhancement; gamma is uniform between 1 and this (the North Sea's lies in 1 to 7, Hasselmann 1973)
    sharpest: float = 7.0
    # energy_median, energy, ratio: Energy of a second system over the first's: median and spread; spread of its period
    # over the first's
    energy_median: float = 0.5
    energy: float = 1.0
    ratio: float = 0.4
    departure: float = 0.8  # Spread of the departure's size about its family's median
    slope: float = 3.0  # Standard deviation of d log S / d log w of the free family
    # edge, steepness_median, steepness: Of the free family: spread of the frequencies of its edges; power of w with
    # which S falls beyond them
    edge: float = 0.2
    steepness_median: float = 20.0
    steepness: float = 1.0
    lump_spacing: float = 0.07  # Distance of the lumps in log w


@dataclass(frozen=True, eq=False)
class SeaModel:
    """Wave spectrum S(w; v), v standardised: the shape, size and coefficients of the departure, those of the lumps."""

    # height, period: Prior medians of Hs [m] and Tp [s] of the first system
    height: float
    period: float
    knots: FloatArray  # (m,): Frequencies [rad/s] of the departure's bumps, spaced evenly in log w
    name: str = "one system"  # One of the families
    level: float = 0.0  # Prior median of the free family's log S half way between its edges
    edges: tuple[float, float] = (1.0, 10.0)  # Prior medians of its edges [rad/s]
    prior: SeaPrior = SeaPrior()

    @property
    def family(self) -> Family:
        """The family of this sea."""
        return families()[self.name]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.family.shape + (1 + self.bumps.size) * (self.bumps.size > 0) + self.lumps.size

    @cached_property
    def bumps(self) -> FloatArray:
        """Frequencies of the departure's bumps [rad/s]; none of an exact family."""
        return self.knots if self.family.departure else np.empty(0)

    @cached_property
    def lumps(self) -> FloatArray:
        """Frequencies of the lumps [rad/s]; none but in the lumpy families."""
        count = round(np.log(self.knots[-1] / self.knots[0]) / self.prior.lump_spacing) + 1
        return np.geomspace(self.knots[0], self.knots[-1], count) if self.family.lumps else np.empty(0)

    def natural(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (Hs [m], Tp [s], gamma) of the first JONSWAP system, each shape (...)."""
        p = self.prior
        return (self.height * np.exp(p.height * v[..., 0]), self.period * np.exp(p.period * v[..., 1]),
                1.0 + (p.sharpest - 1.0) * ndtr(v[..., 2]))

    def with_second(self, v: FloatArray, energy: float, period: float) -> FloatArray:
        """Return the shape (6,) of two systems, v's (3,) and one of this energy and period over the first's."""
        p = self.prior
        return np.r_[v, np.log(energy / p.energy_median) / p.energy, np.log(period) / p.ratio, v[2]]

    def density(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return S(w) [m^2 s/rad], shape (..., nw); of zero or negative frequencies 0."""
        return np.asarray(self._systems(v, omega) * np.exp(np.clip(self.departure(v, omega), -300.0, 300.0)))

    def _systems(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return S(w) without its departure."""
        p = self.prior
        if self.family.systems == 0:
            return self._free(v, omega)
        height, period, gamma = (item[..., None] for item in self.natural(v))
        S = unit_energy(omega, period, gamma)
        if self.family.systems == 2:
            energy = p.energy_median * np.exp(p.energy * v[..., 3:4])
            gamma = 1.0 + (p.sharpest - 1.0) * ndtr(v[..., 5:6])
            S = S + energy * unit_energy(omega, period * np.exp(p.ratio * v[..., 4:5]), gamma)
        return np.asarray(height**2 / 16.0 * S)

    def _free(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        p, place = self.prior, np.log(np.maximum(omega, 1e-6))
        low, high = (np.log(edge) + p.edge * v[..., 2 + i:3 + i] for i, edge in enumerate(self.edges))
        fall = p.steepness_median * np.exp(p.steepness * np.clip(v[..., 4:6], -4.0, 4.0))
        log_S = (self.level + p.height * v[..., :1] + p.slope * v[..., 1:2] * (place - 0.5 * (low + high))
                 - np.logaddexp(0.0, fall[..., :1] * (low - place))
                 - np.logaddexp(0.0, fall[..., 1:] * (place - high)))
        return np.asarray(np.exp(np.clip(log_S, -300.0, 300.0)) * (omega > 0.0))

    def log_slopes(self, v: FloatArray, omega: FloatArray, step: float = 1e-5) -> FloatArray:
        """Return d log S / d v, shape (size, nw), of v (size,), by differences."""
        n, moved = self.family.shape, step * np.eye(self.size)
        up, down = v + moved, v - moved
        slopes = self.departure(up, omega) - self.departure(down, omega)
        systems = np.log(self._systems(np.concatenate([up[:n], down[:n]]), omega) + 1e-300)
        slopes[:n] = systems[:n] - systems[n:]
        return np.asarray(slopes / (2.0 * step))

    def departure(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return the departure of log S, shape (..., nw)."""
        out, at = np.zeros((*v.shape[:-1], omega.size)), self.family.shape
        if self.bumps.size:
            size = self.family.departure * np.exp(self.prior.departure * v[..., at:at + 1])
            out = size * (v[..., at + 1:at + 1 + self.bumps.size] @ bumps_about(self.bumps, omega))
        if self.lumps.size:
            out = out + self.family.lumps * (v[..., self.size - self.lumps.size:self.size]
                                             @ bumps_about(self.lumps, omega))
        return np.asarray(out)


def bumps_about(knots: FloatArray, omega: FloatArray) -> FloatArray:
    """Return Gaussian bumps in log w, scaled so that their random sum has variance about 1, shape (m, nw)."""
    centre = np.log(knots)
    width = centre[1] - centre[0]
    place = np.log(np.clip(omega, 0.7 * knots[0], 1.4 * knots[-1]))
    # sum_i exp(-(x - i)^2) = sqrt(pi) for evenly spaced i
    return np.asarray(np.exp(-0.5 * ((place - centre[:, None]) / width) ** 2) / np.pi**0.25)


def unit_energy(omega: FloatArray, period: FloatArray, gamma: FloatArray) -> FloatArray:
    """Return JONSWAP spectra of unit area, by Yamaguchi's (1984) area of the shape, within 1 %: smooth in gamma."""
    x = np.maximum(omega * period / (2.0 * np.pi), 0.2)         # below 0.2 the shape is under 1e-300
    return np.asarray(period / (2.0 * np.pi) / (0.065 * gamma**0.803 + 0.135) * jonswap_shape(x, gamma))
