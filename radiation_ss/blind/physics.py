"""Motion of a body with memory and hidden laws: convolution integral, implicit trapezoid rule, a fine step.

Written apart from `simulate` on purpose: what checks the diagnosis must not share its integrator or its formulas.
"""

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
    if code == 11 or code == 19:  # the mass feels minus the force on the body
        return dz, -_law(code, p, 0.0, (x, v, 0.0), (z, dz), 0.0, 0.0) / p[2]
    if code == 12:
        if (z >= p[1] and v > 0.0) or (z <= -p[1] and v < 0.0):
            return 0.0, 0.0
        return v, 0.0
    return 0.0, 0.0


def integrate(dt: float, kernel: FloatArray, matrices: tuple[FloatArray, FloatArray], force: FloatArray, x0: FloatArray,
              laws: tuple[FloatArray, FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate M x'' + int L(t - tau) x'(tau) dtau + C x = f + laws from rest at x0; return x, v, a (n, nt).

    `dt`: step [s]. `kernel` (n, n, nk): L at 0, dt, 2 dt, ..., latest first. `matrices`: M, with the added mass at
    infinite frequency, and C, each (n, n). `force` (n, nt). `laws`: codes (k,), the degrees of freedom that they act
    on (k,), and their numbers (k, 5).
    """
    inverse = np.asarray(np.linalg.inv(matrices[0]), dtype=float)
    x, v, a = (np.zeros(force.shape) for _ in range(3))
    x[:, 0] = x0
    _march(dt, kernel, (inverse, matrices[1]), force, laws, (x, v, a))
    return x, v, a


@njit(cache=True, fastmath={"contract", "reassoc"})
def _march(dt: float, kernel: FloatArray, matrices: tuple[FloatArray, FloatArray], force: FloatArray,
           laws: tuple[FloatArray, FloatArray, FloatArray], motion: tuple[FloatArray, FloatArray, FloatArray]) -> None:
    """Fill in x, v, a from their start; loops, as assignments of slices take seconds to compile."""
    (inverse, C), (codes, places, parameters), (x, v, a) = matrices, laws, motion
    (n, nt), nk, k = force.shape, kernel.shape[2], codes.size
    z, zn, dz = np.zeros((k, 2)), np.zeros((k, 2)), np.zeros((k, 2))
    for q in range(k):
        if codes[q] == 11 or codes[q] == 19:
            z[q, 0] = zn[q, 0] = x[places[q], 0]
    xn, vn, an, past, right = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        xn[i] = x[i, 0]
    for step in range(nt):
        t, back = step * dt, min(step, nk - 1)
        for i in range(n):
            total = 0.0
            for j in range(n):
                row, speed = kernel[i, j, nk - 1 - back:nk - 1], v[j, step - back:step]
                for m in range(back):
                    total += row[m] * speed[m]
            past[i] = dt * total
        for _ in range(ITERATIONS):
            if step > 0:
                for i in range(n):
                    vn[i] = v[i, step - 1] + 0.5 * dt * (a[i, step - 1] + an[i])
                    xn[i] = x[i, step - 1] + 0.5 * dt * (v[i, step - 1] + vn[i])
            for i in range(n):
                right[i] = force[i, step] - past[i]
                for j in range(n):
                    right[i] -= 0.5 * dt * kernel[i, j, nk - 1] * vn[j] + C[i, j] * xn[j]
            for q in range(k):
                d = places[q]
                behind = step - int(parameters[q, 1] / dt) if codes[q] == 23 else step
                old = v[d, behind] if 0 <= behind < step else 0.0
                rate = _rate(codes[q], parameters[q], xn[d], vn[d], zn[q, 0], zn[q, 1])
                if step > 0:
                    for r in range(2):
                        zn[q, r] = z[q, r] + 0.5 * dt * (dz[q, r] + rate[r])
                right[d] += _law(codes[q], parameters[q], t, (xn[d], vn[d], an[d]), (zn[q, 0], zn[q, 1]),
                                 force[d, step], old)
            for i in range(n):
                an[i] = 0.0
                for j in range(n):
                    an[i] += inverse[i, j] * right[j]
        for i in range(n):
            x[i, step], v[i, step], a[i, step] = xn[i], vn[i], an[i]
        for q in range(k):
            z[q, 0], z[q, 1] = zn[q, 0], zn[q, 1]
            dz[q, 0], dz[q, 1] = _rate(codes[q], parameters[q], xn[places[q]], vn[places[q]], zn[q, 0], zn[q, 1])
