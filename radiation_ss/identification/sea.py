"""The sea as an unknown, in competing families: one JONSWAP system, two, a free smooth spectrum, a lumpy one.

Each family carries a smooth departure of the log spectrum whose size is itself unknown. The free one has nothing but
that about a straight line in log S over log w, between two edges of any steepness; the lumpy one has narrow lumps on
one system.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.waves.spectrum import SIGMA_HIGH, SIGMA_LOW

FAMILIES = {"one system": 3, "two systems": 6, "free": 6, "lumpy": 3}       # name -> number of shape parameters


@dataclass(frozen=True, eq=False)
class SeaPrior:
    """Prior medians and spreads (standard deviations of logarithms) of a sea's parameters.

    Parameters
    ----------
    height, period, peak : float
        Spread of Hs, of Tp, and of gamma - 1.
    peak_median : float
        Of gamma - 1.
    energy_median, energy, ratio : float
        Energy of a second system over the first's: median and spread; spread of its period over the first's.
    departure, departure_free, departure_spread : float
        Standard deviation of the departure of log S: median about JONSWAP, median of the free family, spread of both.
    slope : float
        Standard deviation of d log S / d log w of the free family.
    edge, steepness_median, steepness : float
        Of the free family: spread of the frequencies of its edges; power of w with which S falls beyond them.
    lump, lump_spacing : float
        Standard deviation of the lumps of log S, and their distance in log w.
    """

    height: float = 1.0
    period: float = 0.25
    peak: float = 0.7
    peak_median: float = 2.3
    energy_median: float = 0.5
    energy: float = 1.0
    ratio: float = 0.4
    departure: float = 0.1
    departure_free: float = 0.7
    departure_spread: float = 0.8
    slope: float = 3.0
    edge: float = 0.2
    steepness_median: float = 20.0
    steepness: float = 1.0
    lump: float = 0.4
    lump_spacing: float = 0.07


@dataclass(frozen=True, eq=False)
class SeaModel:
    """Wave spectrum S(w; v), v standardised.

    v holds the shape (Hs, Tp, gamma, then energy, period ratio and gamma of a second system; of the free family level,
    slope, edges and their steepness), the size of the departure and its coefficients, and those of the lumps.

    Parameters
    ----------
    height, period : float
        Prior medians of Hs [m] and Tp [s] of the first system.
    knots : ndarray, shape (m,)
        Frequencies [rad/s] of the departure's bumps, spaced evenly in log w; none = no departure.
    family : str
        One of FAMILIES.
    level : float
        Prior median of the free family's log S half way between its edges.
    edges : (float, float)
        Prior medians of its edges [rad/s].
    prior : SeaPrior
    """

    height: float
    period: float
    knots: FloatArray
    family: str = "one system"
    level: float = 0.0
    edges: tuple[float, float] = (1.0, 10.0)
    prior: SeaPrior = SeaPrior()

    @property
    def shape(self) -> int:
        """Number of shape parameters."""
        return FAMILIES[self.family]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.shape + (1 + self.knots.size if self.knots.size else 0) + self.lumps.size

    @property
    def free(self) -> bool:
        """Whether the family knows no JONSWAP shape."""
        return self.family == "free"

    @cached_property
    def lumps(self) -> FloatArray:
        """Frequencies of the lumps [rad/s]; none but in the lumpy family."""
        if self.family != "lumpy":
            return np.empty(0)
        count = round(np.log(self.knots[-1] / self.knots[0]) / self.prior.lump_spacing) + 1
        return np.geomspace(self.knots[0], self.knots[-1], count)

    def natural(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (Hs [m], Tp [s], gamma) of the first system, each shape (...); NaN of a free sea."""
        if self.free:
            return tuple(np.full(v.shape[:-1], np.nan) for _ in range(3))  # type: ignore[return-value]
        p = self.prior
        return (self.height * np.exp(p.height * v[..., 0]), self.period * np.exp(p.period * v[..., 1]),
                1.0 + p.peak_median * np.exp(p.peak * v[..., 2]))

    def with_second(self, v: FloatArray, energy: float, period: float) -> FloatArray:
        """Return v of one system with a second one of this energy and period over the first's put in."""
        p = self.prior
        return np.r_[v[:3], np.log(energy / p.energy_median) / p.energy, np.log(period) / p.ratio, v[2], v[3:]]

    def density(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return S(w) [m^2 s/rad], shape (..., nw); of zero or negative frequencies 0."""
        p = self.prior
        if self.free:
            place = np.log(np.maximum(omega, 1e-6))
            low, high = (np.log(edge) + p.edge * v[..., 2 + i:3 + i] for i, edge in enumerate(self.edges))
            fall = p.steepness_median * np.exp(p.steepness * np.clip(v[..., 4:6], -4.0, 4.0))
            log_S = (self.level + p.height * v[..., :1] + p.slope * v[..., 1:2] * (place - 0.5 * (low + high))
                     - np.logaddexp(0.0, fall[..., :1] * (low - place))
                     - np.logaddexp(0.0, fall[..., 1:] * (place - high)))
            S = np.exp(np.clip(log_S, -300.0, 300.0)) * (omega > 0.0)
        else:
            height, period, gamma = (item[..., None] for item in self.natural(v))
            S = _unit_energy(omega, period, gamma)
            if self.family == "two systems":
                energy = p.energy_median * np.exp(p.energy * v[..., 3:4])
                gamma = 1.0 + p.peak_median * np.exp(p.peak * v[..., 5:6])
                S = S + energy * _unit_energy(omega, period * np.exp(p.ratio * v[..., 4:5]), gamma)
            S = height**2 / 16.0 * S
        return np.asarray(S * np.exp(np.clip(self.departure(v, omega), -300.0, 300.0)))

    def log_slopes(self, v: FloatArray, omega: FloatArray, step: float = 1e-5) -> FloatArray:
        """Return d log S / d v, shape (size, nw), of v (size,)."""
        moved = np.zeros((2 * self.shape, self.size))
        moved[range(self.shape), range(self.shape)] = step
        moved[range(self.shape, 2 * self.shape), range(self.shape)] = -step
        around = np.log(self.density(v + moved, omega) + 1e-300)
        slopes = [(around[:self.shape] - around[self.shape:]) / (2.0 * step)]
        if self.knots.size:
            size = self._departure_size(v)
            bumps, own = bumps_about(self.knots, omega), v[self.shape + 1:self.shape + 1 + self.knots.size]
            slopes += [self.prior.departure_spread * size * (own @ bumps)[None], size * bumps]
        if self.lumps.size:
            slopes.append(self.prior.lump * bumps_about(self.lumps, omega))
        return np.vstack(slopes)

    def _departure_size(self, v: FloatArray) -> FloatArray:
        p = self.prior
        median = p.departure_free if self.free else p.departure
        return np.asarray(median * np.exp(p.departure_spread * v[..., self.shape:self.shape + 1]))

    def departure(self, v: FloatArray, omega: FloatArray) -> FloatArray:
        """Return the departure of log S, shape (..., nw)."""
        out, at = np.zeros((*v.shape[:-1], omega.size)), self.shape + 1
        if self.knots.size:
            out = self._departure_size(v) * (v[..., at:at + self.knots.size] @ bumps_about(self.knots, omega))
        if self.lumps.size:
            out = out + self.prior.lump * (v[..., at + self.knots.size:][..., :self.lumps.size]
                                           @ bumps_about(self.lumps, omega))
        return np.asarray(out)


def bumps_about(knots: FloatArray, omega: FloatArray) -> FloatArray:
    """Return Gaussian bumps in log w, scaled so that their random sum has variance about 1, shape (m, nw)."""
    centre = np.log(knots)
    width = centre[1] - centre[0]
    place = np.log(np.clip(omega, 0.7 * knots[0], 1.4 * knots[-1]))
    # sum_i exp(-(x - i)^2) = sqrt(pi) for evenly spaced i
    return np.asarray(np.exp(-0.5 * ((place - centre[:, None]) / width) ** 2) / np.pi**0.25)


def _unit_energy(omega: FloatArray, period: FloatArray, gamma: FloatArray) -> FloatArray:
    """Return JONSWAP spectra of unit area, by Yamaguchi's (1984) area of the shape, within 1 %: smooth in gamma."""
    x = np.maximum(omega * period / (2.0 * np.pi), 0.2)         # below 0.2 the shape is under 1e-300
    log_x = np.log(x)
    peak = np.exp(-0.5 * ((x - 1.0) / np.where(x > 1.0, SIGMA_HIGH, SIGMA_LOW)) ** 2)
    shape = np.exp(-5.0 * log_x - 1.25 * np.exp(-4.0 * log_x) + np.log(gamma) * peak)
    return np.asarray(period / (2.0 * np.pi) / (0.065 * gamma**0.803 + 0.135) * shape)
