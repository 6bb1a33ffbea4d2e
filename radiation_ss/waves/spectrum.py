"""Wave spectra: JONSWAP, Pierson-Moskowitz, Bretschneider and a user's own, by (Hs, Tp) or (H1/3, T01)."""

from dataclasses import dataclass
from functools import lru_cache
from math import gamma as gamma_function
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, positive, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.transforms import composite
from radiation_ss.methods import Brief


def jonswap_shape(x: ArrayLike, gamma: float | FloatArray) -> FloatArray:
    """Return x^-5 exp(-1.25 x^-4) gamma^r with r = exp(-(x - 1)^2 / (2 sigma^2)), x = w / w_p; 0 at x <= 0.

    The width sigma of the peak is 0.07 below and 0.09 above it (Hasselmann et al. 1973).
    """
    x = np.asarray(x, dtype=float)
    safe = np.where(x > 0.1, x, 1.0)  # below 0.1 the exponential is under 1e-5000
    log_x, r = np.log(safe), np.exp(-0.5 * ((safe - 1.0) / np.where(safe > 1.0, 0.09, 0.07)) ** 2)
    return np.where(x > 0.1, np.exp(-5.0 * log_x - 1.25 * np.exp(-4.0 * log_x) + np.log(gamma) * r), 0.0)


@lru_cache(maxsize=4096)
def shape_moment(order: int, gamma: float) -> float:
    """Return the moment int_0^inf x^order shape(x) dx, order -1 to 3.

    The Pierson-Moskowitz part is closed, Gamma(1 - order/4) 1.25^(order/4) / 5; the rest, which lives near x = 1 and is
    below 1e-40 beyond x = 3, is by Gauss-Legendre quadrature on each side of the kink in sigma.
    """
    if not -1 <= order <= 3:
        raise InputError(f"order: {order} is not one of -1 to 3; those of 4 and more of a w^-5 tail do not exist")
    closed = gamma_function(1.0 - order / 4.0) * 1.25 ** (order / 4.0) / 5.0
    x, weights = composite(np.array([0.15, 1.0, 1.45, 3.0]), np.full(3, 40))
    return closed + float(weights @ (x**order * (jonswap_shape(x, gamma) - jonswap_shape(x, 1.0))))


def jonswap_density(omega: ArrayLike, hs: float, tp: float, gamma: float = 3.3) -> FloatArray:
    """Return the JONSWAP density S(w) [m^2 s/rad], one-sided, scaled so that its area is exactly Hs^2/16.

    `omega`: circular frequencies [rad/s]. `hs`, `tp`: significant wave height 4 sqrt(m0) [m] and peak period [s].
    `gamma`: peak enhancement; 1 is Pierson-Moskowitz.
    """
    peak = 2.0 * pi / tp
    return hs**2 / (16.0 * peak * shape_moment(0, gamma)) * jonswap_shape(np.asarray(omega) / peak, gamma)


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Brief):
    """One-sided wave spectrum S(w) [m^2 s/rad]; call it with circular frequencies [rad/s].

    Built by `jonswap`, `pierson_moskowitz`, `bretschneider` (density in closed form) or `user_spectrum` (a table,
    linear between its points, zero outside).

    Parameters
    ----------
    hs, tp, gamma : float
        Significant height [m], peak period [s], peak enhancement (nan for a table).
    omega, density : ndarray, optional
        The table of a user's spectrum.
    name : str

    Examples
    --------
    >>> import radiation_ss as rss
    >>> sea = rss.jonswap(2.0, tp=8.0)
    >>> round(4.0 * sea.moment(0) ** 0.5, 2)
    2.0
    """

    hs: float
    tp: float
    gamma: float
    name: str
    omega: FloatArray | None = None
    density: FloatArray | None = None

    def __str__(self) -> str:
        shape = "" if np.isnan(self.gamma) else f", peak enhancement {self.gamma:.3g}"
        return f"Spectrum {self.name}: significant height {self.hs:.3g} m, peak period {self.tp:.3g} s{shape}"

    def __call__(self, omega: ArrayLike) -> FloatArray:
        """Return S(w) [m^2 s/rad]."""
        if self.omega is None or self.density is None:
            return jonswap_density(omega, self.hs, self.tp, self.gamma)
        return np.interp(np.asarray(omega, dtype=float), self.omega, self.density, left=0.0, right=0.0)

    def moment(self, order: int) -> float:
        """Return m_order = int w^order S dw, order -1 to 3, in closed form (or exactly, for a table).

        >>> round(sea.moment(0), 3)
        0.25
        """
        if self.omega is None or self.density is None:
            peak = 2.0 * pi / self.tp
            return self.hs**2 / 16.0 * peak**order * shape_moment(order, self.gamma) / shape_moment(0, self.gamma)
        if not -1 <= order <= 3:
            raise InputError(f"order: {order} is not one of -1 to 3")
        return table_moment(self.omega, self.density, order)

    @property
    def te(self) -> float:
        """Energy period [s]: 2 pi times the moment of order -1 over that of order 0."""
        return 2.0 * pi * self.moment(-1) / self.moment(0)

    @property
    def t01(self) -> float:
        """Mean period 2 pi m0 / m1 [s]."""
        return 2.0 * pi * self.moment(0) / self.moment(1)

    @property
    def t02(self) -> float:
        """Mean zero-crossing period 2 pi sqrt(m0 / m2) [s]."""
        return 2.0 * pi * sqrt(self.moment(0) / self.moment(2))

    def share(self, low: float, high: float) -> float:
        """Return the share of m0 between two frequencies [rad/s].

        >>> round(sea.share(0.0, 10.0), 3)
        1.0
        """
        grid = np.linspace(low, high, 4001)
        return float(np.trapezoid(self(grid), grid) / self.moment(0))


def table_moment(omega: FloatArray, density: FloatArray, order: int) -> float:
    """Return int w^order S dw of a piecewise linear S, exactly (Gauss on each piece, logarithms for -1)."""
    if order == -1:
        slope = np.diff(density) / np.diff(omega)
        still = density[:-1] - slope * omega[:-1]  # of S = still + slope w
        if omega[0] == 0.0 and density[0] > 0.0:
            raise InputError("order: the moment of order -1 of a spectrum that is not zero at 0 rad/s does not exist")
        first = np.where(omega[:-1] > 0.0, omega[:-1], omega[1:])
        return float(np.sum(np.diff(density) + still * np.log(omega[1:] / first)))
    w, weights = composite(omega, np.ones(omega.size - 1, dtype=int))
    return float(weights @ (w**order * np.interp(w, omega, density)))


def jonswap(hs: float, tp: float | None = None, *, t01: float | None = None, gamma: float = 3.3) -> Spectrum:
    """Return a JONSWAP spectrum of significant height `hs` [m] and either peak period `tp` or mean period `t01` [s].

    Parameters
    ----------
    hs : float
        Significant height H1/3 = 4 sqrt(m0) [m].
    tp : float, optional
        Peak period [s].
    t01 : float, optional
        Mean period 2 pi m0 / m1 [s]; the paper's T01. T01 / Tp follows from gamma (0.834 at 3.3).
    gamma : float
        Peak enhancement, 1 to 20.

    Raises
    ------
    InputError
        If not exactly one period is given or a value is out of range.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> round(4.0 * rss.jonswap(2.0, tp=8.0).moment(0) ** 0.5, 2)
    2.0
    """
    if not 1.0 <= gamma <= 20.0:
        raise InputError(f"gamma: {gamma:g} is outside 1 to 20")
    hs = positive(hs, "hs (significant wave height)", "m")
    if (tp is None) == (t01 is None):
        raise InputError("period: give exactly one of tp (peak period) and t01 (mean period), in seconds")
    if tp is None:
        tp = positive(t01, "t01 (mean period)", "s") * shape_moment(1, gamma) / shape_moment(0, gamma)
    kind = "Pierson-Moskowitz" if gamma == 1.0 else f"JONSWAP (gamma {gamma:g})"
    return Spectrum(hs, positive(tp, "tp (peak period)", "s"), float(gamma), kind)


def pierson_moskowitz(hs: float | None = None, *, wind: float | None = None, g: float = 9.81) -> Spectrum:
    """Return the fully developed sea of Pierson and Moskowitz (1964): one parameter, height or wind speed.

    S = 8.1e-3 g^2 w^-5 exp(-1.25 (w_p/w)^4) with Hs = 0.21 V^2/g (from 0.74 g^4/(V w)^4 in the exponent).

    Parameters
    ----------
    hs : float, optional
        Significant height [m].
    wind : float, optional
        Wind speed at 19.5 m above the sea [m/s].

    Examples
    --------
    >>> import radiation_ss as rss
    >>> round(4.0 * rss.pierson_moskowitz(2.0).moment(0) ** 0.5, 2)
    2.0
    """
    if (hs is None) == (wind is None):
        raise InputError("sea: give exactly one of hs (m) and wind (m/s)")
    if wind is not None:
        hs = 2.0 * sqrt(8.1e-3 / 0.74) * positive(wind, "wind", "m/s")**2 / g
    hs = positive(hs, "hs (significant wave height)", "m")
    peak = (16.0 * 8.1e-3 * g**2 / (5.0 * hs**2)) ** 0.25
    return jonswap(hs, 2.0 * pi / peak, gamma=1.0)


def bretschneider(hs: float, tp: float | None = None, *, t01: float | None = None) -> Spectrum:
    """Return the two-parameter (ISSC, ITTC) spectrum: the Pierson-Moskowitz shape with free height and period.

    Parameters
    ----------
    hs : float
        Significant wave height [m].
    tp, t01 : float
        Peak period or mean period m0 / m1 [s], one of them.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> round(4.0 * rss.bretschneider(2.0, 8.0).moment(0) ** 0.5, 2)
    2.0
    """
    return jonswap(hs, tp, t01=t01, gamma=1.0)


def user_spectrum(omega: ArrayLike, density: ArrayLike, name: str = "user spectrum") -> Spectrum:
    """Return a spectrum from a table: S(w) [m^2 s/rad], linear between points and zero outside.

    Parameters
    ----------
    omega : array_like, shape (nw,)
        Circular frequencies [rad/s], ascending.
    density : array_like, shape (nw,)
        One-sided S(w) [m^2 s/rad], not negative. (From S(f) in m^2/Hz: divide by 2 pi.)

    Raises
    ------
    InputError
        If frequencies do not ascend, or a density is negative or all are zero.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> table = rss.user_spectrum([0.5, 1.0, 1.5], [0.0, 2.0, 0.0])
    >>> 4.0 * table.moment(0) ** 0.5
    4.0
    """
    w = read_only(omega, "omega", (None,))
    s = read_only(density, "density", (w.size,))
    if w.size < 2 or w[0] < 0.0 or np.any(np.diff(w) <= 0.0):
        raise InputError("omega: at least two ascending frequencies in rad/s are needed")
    if s.min() < 0.0 or s.max() == 0.0:
        raise InputError("density: must not be negative, and not zero everywhere")
    peak = float(w[np.argmax(s)])
    if peak == 0.0:
        raise InputError("density: its peak is at zero frequency, where a sea has no energy")
    return Spectrum(4.0 * sqrt(table_moment(w, s, 0)), 2.0 * pi / peak, float("nan"), name, w, s)
