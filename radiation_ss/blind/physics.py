"""Motion of a body with memory and hidden laws: convolution integral, implicit trapezoid rule, a fine step.

Written apart from `simulate` on purpose: what checks the diagnosis must not share its integrator or its formulas.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from radiation_ss.arrays import FloatArray

LAWS = {name: code for code, name in enumerate((
    "none", "square_drag", "viscous", "dry", "spring", "cube_spring", "even_spring", "taut_line", "beating_spring",
    "steady", "swell", "carried_mass", "rubber", "clip", "stribeck", "power_drag", "catenary", "flare", "soft_clip",
    "sloshing", "flooding", "leaking", "buffer", "echo", "backlash", "grounding", "ramp_load", "burst"))}
ITERATIONS = 6


@njit(cache=True)
def _law(code: int, p: FloatArray, t: float, motion: tuple[float, float, float], own: tuple[float, float], u: float,
         old: float) -> float:
    """Return the force of one law on its degree of freedom; `old` is the velocity p[1] seconds ago."""
    (x, v, a), (z, dz) = motion, own
    if code == 1:  # |v| v
        return -p[0] * abs(v) * v
    if code == 2:
        return -p[0] * v
    if code == 3:  # dry friction; sticking is a steep viscous stretch around v = 0
        return -p[0] * min(max(v / p[1], -1.0), 1.0)
    if code == 4:
        return -p[0] * x
    if code == 5:
        return -p[0] * x * x * x
    if code == 6:
        return -p[0] * x * x
    if code == 7:  # line that pulls on one side only, beyond p[1]; p[2] = +-1
        return -p[2] * p[0] * max(p[2] * x - p[1], 0.0)
    if code == 8:
        return -p[0] * math.cos(p[1] * t + p[2]) * x
    if code == 9:
        return p[0]
    if code == 10:
        return p[0] * math.cos(p[1] * t + p[2])
    if code == 11 or code == 19:  # a mass p[2] on a spring p[0] and damper p[1]; sloshing: hardening, square damping
        gap, rate = z - x, dz - v
        if code == 11:
            return p[0] * gap + p[1] * rate
        return p[0] * gap * (1.0 + (gap / p[3]) ** 2) + p[1] * rate + p[1] * abs(rate) * rate / p[4]
    if code == 12:  # elastic-plastic element, p[1] its elastic reach
        return -p[0] * z / p[1]
    if code == 13:
        return min(max(u, -p[0]), p[0]) - u
    if code == 14:  # Stribeck: breakaway above sliding friction
        return -(p[0] + p[2] * math.exp(-((v / p[3]) ** 2))) * math.tanh(v / p[1])
    if code == 15:
        return -p[0] * abs(v) ** 0.7 * v
    if code == 16:  # catenary: the horizontal pull of a line grows like sinh with excursion
        return -p[0] * p[1] * (math.sinh(x / p[1]) - x / p[1])
    if code == 17:  # a waterplane that widens smoothly upwards
        return -p[0] * x * p[1] * math.log1p(math.exp(min(x / p[1], 40.0)))
    if code == 18:
        return p[0] * math.tanh(u / p[0]) - u
    if code == 20:  # mass taken on board linearly in time
        return -p[0] * t / p[1] * a
    if code == 21:  # stiffness lost linearly in time
        return p[0] * t / p[1] * x
    if code == 22:  # stiff buffers on both sides
        return -p[0] * (max(x - p[1], 0.0) - max(-x - p[1], 0.0))
    if code == 23:  # the radiated wave comes back from a wall
        return -p[0] * old
    if code == 24:  # a spring with play
        return -p[0] * (x - min(max(x, -p[1]), p[1]))
    if code == 25:  # rubbing on one side only
        return -p[0] * min(max(v / p[2], -1.0), 1.0) if x > p[1] else 0.0
    if code == 26:
        return p[0] * t / p[1]
    if code == 27:  # a gust
        return p[0] * math.exp(-(((t - p[1]) / p[2]) ** 2))
    return 0.0


@njit(cache=True)
def _rate(code: int, p: FloatArray, x: float, v: float, z: float, dz: float) -> tuple[float, float]:
    """Return the time derivatives of a law's own two states."""
    if code == 11:
        return dz, -(p[0] * (z - x) + p[1] * (dz - v)) / p[2]
    if code == 19:
        gap, rate = z - x, dz - v
        force = p[0] * gap * (1.0 + (gap / p[3]) ** 2) + p[1] * rate + p[1] * abs(rate) * rate / p[4]
        return dz, -force / p[2]
    if code == 12:
        if (z >= p[1] and v > 0.0) or (z <= -p[1] and v < 0.0):
            return 0.0, 0.0
        return v, 0.0
    return 0.0, 0.0


@njit(cache=True)
def integrate(dt: float, kernel: FloatArray, matrices: tuple[FloatArray, FloatArray], force: FloatArray, x0: FloatArray,
              laws: tuple[FloatArray, FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate M x'' + int L(t - tau) x'(tau) dtau + C x = f + laws from rest at x0; return x, v, a (n, nt).

    `dt`: step [s]. `kernel` (n, n, nk): L at 0, dt, 2 dt, ..., latest first. `matrices`: M, with the added mass at
    infinite frequency, and C, each (n, n). `force` (n, nt). `laws`: codes (k,), the degrees of freedom that they act
    on (k,), and their numbers (k, 5).
    """
    (M, C), (codes, places, parameters) = matrices, laws
    n, nt = force.shape
    nk = kernel.shape[2]
    k = codes.size
    x, v, a = np.zeros((n, nt)), np.zeros((n, nt)), np.zeros((n, nt))
    z, dz = np.zeros((k, 2)), np.zeros((k, 2))
    inverse = np.linalg.inv(M)
    x[:, 0] = x0
    for q in range(k):
        if codes[q] == 11 or codes[q] == 19:
            z[q, 0] = x0[places[q]]
    xn, vn, an, zn = x0.copy(), np.zeros(n), np.zeros(n), z.copy()
    for step in range(nt):
        t = step * dt
        past = np.zeros(n)
        back = min(step, nk - 1)
        if back > 0:
            for i in range(n):
                for j in range(n):
                    past[i] += np.dot(kernel[i, j, nk - 1 - back: nk - 1], v[j, step - back: step])
            past *= dt
        for _ in range(ITERATIONS):
            if step > 0:
                vn = v[:, step - 1] + 0.5 * dt * (a[:, step - 1] + an)
                xn = x[:, step - 1] + 0.5 * dt * (v[:, step - 1] + vn)
            right = force[:, step] - past - 0.5 * dt * kernel[:, :, nk - 1] @ vn - C @ xn
            for q in range(k):
                d = places[q]
                behind = step - int(parameters[q, 1] / dt) if codes[q] == 23 else step
                old = v[d, behind] if 0 <= behind < step else 0.0
                rate = _rate(codes[q], parameters[q], xn[d], vn[d], zn[q, 0], zn[q, 1])
                if step > 0:
                    zn[q, 0] = z[q, 0] + 0.5 * dt * (dz[q, 0] + rate[0])
                    zn[q, 1] = z[q, 1] + 0.5 * dt * (dz[q, 1] + rate[1])
                right[d] += _law(codes[q], parameters[q], t, (xn[d], vn[d], an[d]), (zn[q, 0], zn[q, 1]),
                                 force[d, step], old)
            an = inverse @ right
        x[:, step], v[:, step], a[:, step] = xn, vn, an
        for q in range(k):
            rate = _rate(codes[q], parameters[q], xn[places[q]], vn[places[q]], zn[q, 0], zn[q, 1])
            z[q] = zn[q]
            dz[q, 0], dz[q, 1] = rate
    return x, v, a
