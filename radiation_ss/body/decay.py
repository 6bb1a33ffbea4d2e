"""Inertia, stiffness and damping of one degree of freedom from its natural period and damping ratio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from radiation_ss.errors import InputError

Transfer = Callable[[complex], complex]


def pole(period: float, ratio: float) -> complex:
    """Return the pole of a decay with this period of its oscillation [s] and damping ratio [1/s].

    Examples
    --------
    >>> s = pole(2.0, 0.1)
    >>> round(s.imag, 6), round(-s.real / abs(s), 6)
    (3.141593, 0.1)
    """
    return 2.0 * np.pi / period * complex(-ratio / np.sqrt(1.0 - ratio**2), 1.0)


def from_period(period: float, ratio: float | None, K: Transfer, *, inertia: float | None = None,
                stiffness: float | None = None) -> tuple[float, float]:
    """Return what is missing, inertia with added mass or stiffness, and the damping beside radiation.

    A free oscillation s = pole(period, ratio) obeys s^2 I + s (K(s) + D) + C = 0: two real equations, linear in the
    missing one of I and C, and in D. Without a ratio D is zero, and the ratio is that of radiation alone.

    Parameters
    ----------
    period : float
        Of the oscillation [s].
    ratio : float, optional
        Damping ratio, 0 to 1.
    K : callable
        Radiation transfer function K(s) at complex s [1/s].
    inertia, stiffness : float, optional
        M + A_inf or C, one of them.

    Returns
    -------
    missing, damping : float

    Raises
    ------
    InputError
        If radiation alone damps more than the ratio says, or no ratio makes an oscillation of this period.
    """
    def solve(ratio: float) -> tuple[float, float]:
        s = pole(period, ratio)
        column = s**2 if inertia is None else 1.0
        rest = s * (s * (inertia or 0.0) + K(s)) + (stiffness or 0.0)
        matrix = np.array([[np.real(column), s.real], [np.imag(column), s.imag]])
        missing, damping = np.linalg.solve(matrix, [-np.real(rest), -np.imag(rest)])
        return float(missing), float(damping)

    if ratio is not None:
        missing, damping = solve(ratio)
        if damping < -1e-9 * abs(pole(period, ratio)) * max(abs(missing), inertia or 0.0):
            raise InputError(f"damping_ratio: {ratio:g} is less than what radiation alone gives, "
                             f"{own_ratio(solve, period):.3g}; give a larger ratio, or leave it out")
        return missing, max(damping, 0.0)
    return solve(own_ratio(solve, period))[0], 0.0


def own_ratio(solve: Callable[[float], tuple[float, float]], period: float) -> float:
    """Return the damping ratio at which `solve` finds no damping beside radiation."""
    if abs(solve(0.0)[1]) <= 1e-12 * abs(solve(0.5)[1]):
        return 0.0
    try:
        return float(brentq(lambda ratio: solve(ratio)[1], 0.0, 0.99))
    except ValueError:
        raise InputError(f"period: {period:g} s; the body does not oscillate so with this radiation") from None


def damping_of_ratio(ratio: float, K: Transfer, inertia: float, stiffness: float) -> float:
    """Return the damping beside radiation that makes the damping ratio of a body of known inertia and stiffness.

    Of s = w (-ratio + i sqrt(1 - ratio^2)) the frequency w is sought at which s I + K(s) + C / s is real: it is -D.

    Raises
    ------
    InputError
        If the body has no stiffness, or radiation alone damps more.
    """
    if stiffness <= 0.0:
        raise InputError("damping_ratio: a body without stiffness does not oscillate; give a stiffness, or the linear "
                         "damping by model.attached(damping={...}) [N s/m or N m s/rad]")

    def impedance(w: float) -> complex:
        s = w * complex(-ratio, np.sqrt(1.0 - ratio**2))
        return s * inertia + K(s) + stiffness / s

    high = 10.0 * np.sqrt(stiffness / inertia)
    try:
        w = float(brentq(lambda w: impedance(w).imag, 1e-3 * high, high))
    except ValueError:
        raise InputError(f"damping_ratio: {ratio:g}; with this radiation the body does not oscillate so") from None
    damping = -impedance(w).real
    if damping < -1e-9 * w * inertia:
        raise InputError(f"damping_ratio: {ratio:g} is less than what radiation alone gives; give a larger ratio, or "
                         "leave it out")
    return max(damping, 0.0)
