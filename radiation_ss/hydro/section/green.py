"""The two-dimensional source potential under a free surface, deep water and finite depth, time factor e^{+i w t}.

Points are complex numbers P = y + i z, z up from the still water surface; K = omega^2 / g. The source is normalised to
G ~ ln|P - Q|. Wehausen & Laitone (1960), Surface Waves, section 13; the factored finite-depth form is derived in
docs/theory/section.md.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import exp1

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.linear_waves import depth_ratio, group_velocity, wave_number


def rankine(unit: float, P: ComplexArray, Q: ComplexArray, n: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return ln(|P - Q| / unit) and its derivative along the normal n at Q; the unit of length [m] drops out of G."""
    r = P - Q
    return np.log(np.abs(r) / unit), -(n / r).real


def wave(K: FloatArray, P: ComplexArray, Q: ComplexArray, n: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return G - ln r + ln r' of deep water and its derivative along the normal n at Q; r' from the image of Q above.

    G = ln r - ln r' - 2 int_0^oo e^{k Y} cos(k X) / (k - K) dk, the path above the pole, X = y_P - y_Q, Y = z_P + z_Q
    = ln r - ln r' - 2 Re F(K w) + 2 pi i e^{K conj(w)},  w = Y + i|X|,  F(s) = e^s E1(s).
    """
    offset = P - np.conj(Q)
    w = offset.imag + 1j * np.abs(offset.real)
    step = n.imag - 1j * np.sign(offset.real) * n.real  # dw/dn
    F = scaled_exp1(K * w)
    outgoing = 2j * np.pi * np.exp(K * np.conj(w))
    return -2.0 * F.real + outgoing, -2.0 * ((K * F - 1.0 / w) * step).real + outgoing * K * np.conj(step)


def scaled_exp1(s: ComplexArray) -> ComplexArray:
    """Return e^s E1(s) without overflow; E1 is the exponential integral, principal branch."""
    far = np.abs(s) > 40.0
    if not far.any():
        return np.exp(s) * exp1(s)
    near = np.where(far, -1.0, s)
    inverse = -1.0 / np.where(far, s, 1e3)
    term = -inverse
    series = term.copy()
    for order in range(1, 20):  # asymptotic, 1e-14 at |s| = 40
        term = term * order * inverse
        series += term
    return np.where(far, series, np.exp(near) * exp1(near))


def far_field_factor(k0: FloatArray, depth: float) -> FloatArray:
    """Return N of G -> 2 pi i N Z(z_P) Z(z_Q) e^{-i k0 |X|} far away, Z = `profile`; 1 in deep water."""
    return np.ones_like(k0) if np.isinf(depth) else 1.0 / (np.tanh(k0 * depth) * (1.0 + depth_ratio(k0, depth)))


@dataclass(frozen=True, eq=False)
class DepthTerm:
    """G(finite depth) - G(deep), as a sum of products of a function of P and the same function of Q.

    D = -int_0^oo U_k(P) U_k(Q) / (k (k - K) [(k - K) - e^{-2kh}(k + K)]) dk for a source and its mirror image about the
    centre line, with U = ((k - K) e^{-k(h + z)} + (k + K) e^{-k(h - z)}) (cos k y for even motion, sin k y for odd),
    times two. The path is a ray above both poles, k = s e^{i alpha}; trapezoidal rule in ln s.
    """

    depth: float  # Water depth h [m]
    # k, weight (nk,): Nodes and weights dk
    k: ComplexArray
    weight: ComplexArray

    @classmethod
    def build(cls, depth: float, draft: float, half_breadth: float, K_min: float) -> "DepthTerm":
        """Choose the ray so that cos(k X) does not outgrow the depth factor, and its nodes for about 1e-10."""
        angle = min(0.25 * np.pi, 0.5 * np.arctan2(depth - draft, half_breadth))
        decay = 2.0 * ((depth - draft) * np.cos(angle) - half_breadth * np.sin(angle))
        low, high = np.log(min(1e-6 * K_min, 1e-6 / depth)), np.log(35.0 / decay)
        step = 2.0 * np.pi * angle / 25.0
        s = np.exp(np.arange(low, high + step, step))
        k = s * np.exp(1j * angle)
        return cls(depth, k, step * k)

    def factor(self, minus: ComplexArray, plus: ComplexArray, P: ComplexArray, even: bool,
               normal: ComplexArray | None = None) -> ComplexArray:
        """Return U at the points, or its normal derivative, (nw, np, nk); `minus`, `plus` as of `spectrum`."""
        k, y, z = self.k, P.real[:, None], P.imag[:, None]
        down, up = np.exp(-k * (self.depth + z)), np.exp(-k * (self.depth - z))
        across, slope = (np.cos(k * y), -k * np.sin(k * y)) if even else (np.sin(k * y), k * np.cos(k * y))
        if normal is None:
            return (minus * down + plus * up) * across
        ny, nz = normal.real[:, None], normal.imag[:, None]
        return minus * (down * (slope * ny - k * across * nz)) + plus * (up * (slope * ny + k * across * nz))

    def spectrum(self, K: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return (k - K, k + K, weight), each (nw, 1, nk); K = inf gives the limit of infinite frequency."""
        K = np.asarray(K, dtype=float)[:, None, None]
        image = np.exp(-2.0 * self.k * self.depth)
        with np.errstate(invalid="ignore"):
            minus, plus = self.k / K - 1.0, self.k / K + 1.0
        return minus, plus, -2.0 * self.weight / (self.k * minus * (minus - image * plus))


@dataclass(frozen=True, eq=False)
class FarField:
    """Waves far away from the section."""

    # (nw, 2, 3): Complex wave amplitude [m per m/s, m per rad/s] towards +y and -y of unit velocity in Sway, Heave and
    # Roll, with the phase at y = 0
    radiated: ComplexArray
    # reflection, transmission (nw,): Complex coefficients of the fixed section
    reflection: ComplexArray
    transmission: ComplexArray
    group_velocity: FloatArray  # (nw,): c_g [m/s]
    kochin: ComplexArray  # (nw, 2, 3): int (phi_n - phi d/dn) cosh k0(z + h)/cosh k0 h e^{+-i k0 y} ds
    rho: float
    g: float

    @classmethod
    def build(cls, omega: FloatArray, depth: float, rho: float, g: float, kochin: ComplexArray,
              scattered: ComplexArray) -> "FarField":
        """Build it from Kochin functions of the radiation (nw, 2, 3) and scattering (nw, 2) potentials."""
        k0 = wave_number(omega ** 2 / g, depth)
        factor = omega * far_field_factor(k0, depth) / g
        return cls(factor[:, None, None] * kochin, factor * scattered[:, 1], 1.0 + factor * scattered[:, 0],
                   group_velocity(omega, k0, depth), kochin, rho, g)

    @property
    def damping(self) -> FloatArray:
        """Damping from the energy of the radiated waves (35), shape (nw, 3, 3)."""
        products = np.einsum("wsi,wsj->wij", self.radiated, np.conj(self.radiated)).real
        return self.rho * self.g * self.group_velocity[:, None, None] * products

    @property
    def haskind(self) -> ComplexArray:
        """Exciting force of a wave towards +y from the radiation problem by Haskind's relation, shape (nw, 3)."""
        return -self.rho * self.g * self.kochin[:, 1]
