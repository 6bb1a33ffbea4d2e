"""Coefficients from papers, independent of any panel method: a truncated cylinder and a half-immersed sphere in heave.

    python analytic.py OUT       writes OUT/yeung_<draft>_<depth>.npz and OUT/hulme.npz (needs scipy only)
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.special import hankel2, i0e, i1e, j0, j1, k0e, k1e

G, RHO = 9.81, 1000.0

# Hulme (1982), J. Fluid Mech. 121, table 1: K a, added mass and damping of the half-immersed sphere in heave,
# as parts of 2/3 pi rho a^3 (and of that times omega).
HULME = np.array([
    (0.0, 0.8310, 0.0), (0.05, 0.8764, 0.1036), (0.1, 0.8627, 0.1816), (0.2, 0.7938, 0.2793), (0.3, 0.7157, 0.3254),
    (0.4, 0.6452, 0.3410), (0.5, 0.5861, 0.3391), (0.6, 0.5381, 0.3271), (0.7, 0.4999, 0.3098), (0.8, 0.4698, 0.2899),
    (0.9, 0.4464, 0.2691), (1.0, 0.4284, 0.2484), (1.2, 0.4047, 0.2096), (1.4, 0.3924, 0.1756), (1.6, 0.3871, 0.1469),
    (1.8, 0.3864, 0.1229), (2.0, 0.3884, 0.1031), (2.5, 0.3988, 0.0674), (3.0, 0.4111, 0.0452), (4.0, 0.4322, 0.0219),
    (5.0, 0.4471, 0.0116), (6.0, 0.4574, 0.0066), (7.0, 0.4647, 0.0040), (8.0, 0.4700, 0.0026), (9.0, 0.4740, 0.0017),
    (10.0, 0.4771, 0.0012)])
PHASE = np.array([(0.0, 0.0), (0.102, 0.0146), (0.349, 0.1284), (0.743, 0.4081), (1.285, 0.8565), (1.973, 1.462),
                  (2.81, 2.228), (3.793, 3.135), (4.924, 4.234), (6.202, 5.524), (7.627, 6.858), (9.2, 8.512)])  # by panels


def roots(K: float, h: float, n: int) -> tuple[float, np.ndarray]:
    """Return m0 of m0 tanh(m0 h) = K and the n first m of m tan(m h) = -K; for infinite K those of cos(m h) = 0."""
    if np.isinf(K):
        return np.nan, (np.arange(1, n + 1) - 0.5) * np.pi / h
    m0 = brentq(lambda m: m * np.tanh(m * h) - K, 1e-9, max(2 * K, 2 * np.sqrt(K / h)) + 1.0, xtol=1e-14)
    m = [brentq(lambda x: x * np.sin(x * h) + K * np.cos(x * h), (k - 0.5) * np.pi / h, k * np.pi / h) for k in range(1, n + 1)]
    return m0, np.array(m)


def yeung(K: float, a: float, d: float, h: float, n: int = 60) -> tuple[complex, complex]:
    """Return (A + B/(i w), X) in heave of a vertical cylinder: Yeung (1981), Applied Ocean Research 3; X by Haskind."""
    s, k = h - d, np.arange(n)
    lam = k * np.pi / s
    m0, m = roots(K, h, n)
    Z = np.sin(m * s) * m / np.sqrt(0.5 * (1 + np.sin(2 * m * h) / (2 * m * h)))
    J = (-1.0) ** k[:, None] * Z / (m**2 - lam[:, None] ** 2)
    R = -k0e(m * a) / (m * k1e(m * a)) + 0j
    if np.isfinite(K):  # the wave itself; exp(-m0 h) is taken out of cosh and sinh
        root = np.sqrt(0.5 * (np.exp(-2 * m0 * h) + (1 - np.exp(-4 * m0 * h)) / (4 * m0 * h)))
        first = (np.exp(-m0 * d) - np.exp(-m0 * (h + s))) / 2 / root
        J = np.column_stack([(-1.0) ** k * m0 * first / (m0**2 + lam**2), J])
        R = np.append(-hankel2(0, m0 * a) / (m0 * hankel2(1, m0 * a)), R)
    slope = np.append(0.0, lam[1:] * i1e(lam[1:] * a) / i0e(lam[1:] * a))
    P = np.append((s**2 / 3 - a**2 / 2) / 2, (-1.0) ** k[1:] / lam[1:] ** 2)
    # alpha = 2/s (J (R beta) - P), beta = 1/h (J' (slope alpha) - a/(2 s) J_0)
    T = 2 / (s * h) * (J * R) @ J.T
    alpha = np.linalg.solve(np.eye(n) - T * slope, -T[:, 0] * a / (2 * s) - 2 / s * P)
    beta = (J.T @ (slope * alpha) - a / (2 * s) * J[0]) / h
    parts = np.append(a**2 / 4, (-1.0) ** k[1:] * a * i1e(lam[1:] * a) / i0e(lam[1:] * a) / lam[1:])
    added = 2 * np.pi * RHO * ((s**2 * a**2 / 2 - a**4 / 8) / (2 * s) + parts @ alpha)
    if np.isinf(K):
        return added, 0j
    X = -RHO * G * 2 * np.pi * a * h * 2 * root / (1 + np.exp(-2 * m0 * h)) * beta[0] * (j0(m0 * a) + R[0] * m0 * j1(m0 * a))
    return added, X


def cylinder(d: float, h: float, top: float = 7.5) -> dict:
    """Return the table of a cylinder of radius 1 and draft d in water of depth h."""
    omega = np.linspace(0.15, top, 70)
    both = [yeung(w**2 / G, 1.0, d, h) for w in omega]
    impedance = 1j * omega * np.array([b[0] for b in both])
    return table(omega, impedance.imag / omega, impedance.real, yeung(np.inf, 1.0, d, h)[0].real,
                 np.array([b[1] for b in both]), np.pi * RHO * d, np.pi * RHO * G, depth=h)


def hulme() -> dict:
    """Return the sphere's table; |X| by the Haskind relation for axisymmetric bodies, its phase from panels."""
    volume = 2 / 3 * np.pi * RHO
    omega = np.sqrt(HULME[1:, 0] * G)
    B = HULME[1:, 2] * volume * omega
    X = np.sqrt(2 * RHO * G**3 * B / omega**3) * np.exp(1j * np.interp(HULME[1:, 0], *PHASE.T))
    return table(omega, HULME[1:, 1] * volume, B, 0.5 * volume, X, volume, np.pi * RHO * G)


def table(omega, A, B, A_inf, X, mass, C, depth=np.inf) -> dict:
    """Return a table of the form of bodies.py."""
    return {"omega": omega, "A": A[:, None, None], "B": B[:, None, None], "A_inf": np.array([[A_inf]]),
            "X": X[:, None, None], "M": np.array([[mass]]), "C": np.array([[C]]), "dofs": np.array(["Heave"]),
            "directions": np.array([0.0]), "zg": 0.0, "panels": 0, "depth": depth}


def main() -> None:
    out = Path(sys.argv[1])
    for d, h in ((1.0, 20.0), (0.5, 4.0), (2.0, 8.0)):
        np.savez_compressed(out / f"yeung_{d:g}_{h:g}.npz", **cylinder(d, h))
    np.savez_compressed(out / "hulme.npz", **hulme())


if __name__ == "__main__":
    main()
