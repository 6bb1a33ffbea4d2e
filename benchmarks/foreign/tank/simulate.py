"""The true tank: Cummins' equation with convolution and effects, by Runge and Kutta's fourth-order steps.

    (M + A_inf) a + int K(t - s) v(s) ds + D v + C x = F(t) + sum of effects

Inputs stand on half steps, results on whole ones. What is linear and instantaneous is in the matrices already; here is
what is not. Every effect acts on degree of freedom `i`, has parameters p, up to two states z, and a series s(t).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

(DRAG, COULOMB, POLYNOMIAL, STOP, PARAMETRIC, TANK, BOUC_WEN, DECK, SLAM, FEEDBACK, STRIPS, TABLE, BASSET, WAKE,
 SNAG) = range(15)


@dataclass
class Effect:
    """An effect of the integrator: kind, degree of freedom, parameters and its series on half steps (or None)."""

    kind: int
    i: int
    p: tuple
    series: np.ndarray | None = None
    curve: np.ndarray = field(default_factory=lambda: np.zeros(2))


@njit(cache=True)
def push(kind, i, p, z, s, x, v, past_x, past_v, curve, basset, f):
    """Add the force of one effect to f."""
    if kind == DRAG:  # Morison et al. (1950), relative to the water's velocity s
        f[i] -= p[0] * (v[i] - s) * abs(v[i] - s)
    elif kind == COULOMB:  # dry friction, smoothed below the speed p[1]; s opens and closes it
        f[i] -= s * p[0] * np.tanh(v[i] / p[1])
    elif kind == POLYNOMIAL:
        f[i] -= p[0] * x[i] ** 2 + p[1] * x[i] ** 3
    elif kind == STOP:  # pushing spring p[0] and damper p[2] beyond p[1]; p[3]: 1 above, -1 below, 2 both
        if p[3] != -1 and x[i] > p[1]:
            f[i] -= max(p[0] * (x[i] - p[1]) + p[2] * v[i], 0.0)
        if p[3] != 1 and x[i] < -p[1]:
            f[i] -= min(p[0] * (x[i] + p[1]) + p[2] * v[i], 0.0)
    elif kind == PARAMETRIC:  # restoring that follows the wave at the hull
        f[i] -= p[0] * s * x[i]
    elif kind == TANK:  # an inner mass on a spring, p = mass, frequency, damping ratio; its mass is taken from M
        f[i] += p[0] * (p[1] ** 2 * (z[0] - x[i]) + 2 * p[2] * p[1] * (z[1] - v[i]))
    elif kind == BOUC_WEN:  # Wen (1976)
        f[i] -= p[0] * z[0]
    elif kind == DECK:  # weight of the water on deck
        f[i] -= p[3] * z[0]
    elif kind == SLAM:  # flare or wave-in-deck: load with the square of the closing speed
        deep, fast = s - x[i] - p[1], z[1] - v[i]  # z[1]: the wave's rate
        if deep > 0 and fast > 0:
            f[i] += p[0] * fast * fast * min(1.0, deep / (0.05 * p[1]))
    elif kind == FEEDBACK:  # a controller that acts late
        f[i] -= p[0] * past_x + p[1] * past_v
    elif kind == STRIPS:  # drag of strips along the hull, p = drag per length, length, pitch dof; heave at r is x - r th
        j, k = int(p[2]), 9
        for n in range(k):
            r = p[1] * ((n + 0.5) / k - 0.5)
            w = v[i] - r * v[j] - s
            f[i] -= p[0] * p[1] / k * w * abs(w)
            f[j] += r * p[0] * p[1] / k * w * abs(w)
    elif kind == TABLE:  # a line's horizontal force over offset, tabulated from p[0] to p[1]
        m = len(curve) - 1
        at = min(max((x[i] - p[0]) / (p[1] - p[0]) * m, 0.0), m - 1e-9)
        n = int(at)
        f[i] -= p[2] * (curve[n] + (at - n) * (curve[n + 1] - curve[n]))
    elif kind == BASSET:
        f[i] -= p[0] * basset
    elif kind == WAKE:
        f[i] += p[2] * z[0]
    elif kind == SNAG:
        f[i] -= p[0] * s * (x[i] - z[0])


@njit(cache=True)
def drift(kind, i, p, z, s, x, v, a, out):
    """Write the rates of the states of one effect."""
    out[0] = out[1] = 0.0
    if kind == TANK:
        out[0] = z[1]
        out[1] = -p[1] ** 2 * (z[0] - x[i]) - 2 * p[2] * p[1] * (z[1] - v[i])
    elif kind == BOUC_WEN:  # z in -1..1, yields at p[1], sharpness p[2]
        out[0] = v[i] / p[1] * (1 - abs(z[0]) ** p[2] * (0.5 + 0.5 * np.sign(v[i] * z[0])))
    elif kind == DECK:  # weir flow over the freeboard p[1], drains with the time p[2]
        out[0] = p[0] * max(s - x[i] - p[1], 0.0) ** 1.5 - z[0] / p[2]
    elif kind == WAKE:  # Facchinetti, de Langre & Biolley (2004), coupled to the acceleration
        out[0] = z[1]
        out[1] = -0.3 * p[1] * (z[0] ** 2 - 1) * z[1] - p[1] ** 2 * z[0] + p[0] * a[i]
    elif kind == SNAG:  # follows the body until the line catches
        out[0] = (1 - s) * p[1] * (x[i] - z[0])


@njit(cache=True)
def late(hist, i, k, back):
    """Return the past value at whole steps k - back, linear between; the first one before the start."""
    at = k - back
    if at <= 0:
        return hist[0, i]
    n = int(at)
    if n >= k:
        return hist[k, i]
    return hist[n, i] + (at - n) * (hist[n + 1, i] - hist[n, i])


@njit(cache=True)
def march(h, steps, x0, v0, M, C, D, K, F, kinds, dof, par, series, curves, x, v, a, E, guided):
    """Integrate over all steps. K and F are on half steps. Guided: x, v, a are given and E is the force they take."""
    n, ne, nk = len(x0), len(kinds), (len(K) - 3) // 2
    turned, V = np.zeros((2, n, n, nk + 1)), np.zeros((n, steps + 1))
    for m in range(nk + 1):  # the kernel at whole steps and half a step (or one) more, latest first
        turned[0, :, :, nk - m], turned[1, :, :, nk - m] = K[2 * m + 1], K[2 * m + 2]
    M = M - h * h / 12 * K[0]  # what trapezoids add to the memory: h^2/12 of the slope of K(t - s) v(s) at s = t
    inverse = np.linalg.inv(M)
    z, kz, zs = np.zeros((ne, 2)), np.zeros((4, ne, 2)), np.zeros((ne, 2))
    past, mem = np.zeros((3, n)), np.zeros(n)
    kx, kv, ka = np.zeros((4, n)), np.zeros((4, n)), np.zeros(n)
    basset, root = np.zeros((ne, 3)), np.sqrt(np.arange(2.0 * steps + 4))
    for e in range(ne):
        if kinds[e] in (TANK, SNAG):
            z[e, 0] = x0[dof[e]]
        if kinds[e] == WAKE:
            z[e, 0] = 0.1
    if not guided:
        x[0], v[0] = x0, v0
    for k in range(steps):
        if k:
            past[0] = past[2] + 0.5 * h * (K[2] @ v[k - 1] + K[0] @ v[k])
        m = min(k, nk)
        for i in range(n):  # memory of all before t_k, seen from t_k, t_k + h/2, t_k + h; trapezoids
            for c in range(1, 3):
                past[c, i] = 0.0
                for j in range(n):
                    V[j, k] = v[k, j]
                    ends = K[c, i, j] * v[k, j] + (K[2 * k + c, i, j] * v[0, j] if m == k else 0.0)
                    past[c, i] += h * (np.dot(turned[c - 1, i, j, nk - m :], V[j, k - m : k + 1]) - 0.5 * ends)
        for e in range(ne):
            if kinds[e] == BASSET:  # int v'(s) / sqrt(pi (t - s)) ds of all before t_k by the L1 rule
                basset[e] = 0.0
                for m in range(k):
                    for c in range(3):
                        q = 2 * (k - m) + c
                        basset[e, c] += np.sqrt(2 / (np.pi * h)) * (v[m + 1, dof[e]] - v[m, dof[e]]) * (root[q] - root[q - 2])
        for r in range(4):
            c, part = (0, 1, 1, 2)[r], (0.0, 0.5, 0.5, 1.0)[r]
            if guided:
                xs = x[k] if r == 0 else x[k] + part * (x[k + 1] - x[k])
                vs = v[k] if r == 0 else v[k] + part * (v[k + 1] - v[k])
            elif r == 0:
                xs, vs = x[k].copy(), v[k].copy()
            else:
                xs, vs = x[k] + part * h * kx[r - 1], v[k] + part * h * kv[r - 1]
            zs[:] = z + part * h * kz[r - 1] if r else z
            mem[:] = past[c]
            if r:  # the cell between t_k and now
                for i in range(n):
                    for j in range(n):
                        mem[i] += part * h / 2 * (K[min(c, len(K) - 1), i, j] * v[k, j] + K[0, i, j] * vs[j])
            f = F[2 * k + c] - mem - C @ xs - D @ vs
            for e in range(ne):
                s = series[e, 2 * k + c]
                if kinds[e] == SLAM:
                    up, low = min(2 * k + c + 1, len(F) - 1), max(2 * k + c - 1, 0)
                    zs[e, 1] = (series[e, up] - series[e, low]) / ((up - low) * 0.5 * h)
                back = par[e, 2] / h if kinds[e] == FEEDBACK else 0.0
                now = basset[e, c]
                if kinds[e] == BASSET and r:
                    now += 2 * (vs[dof[e]] - v[k, dof[e]]) / np.sqrt(np.pi * part * h)
                push(kinds[e], dof[e], par[e], zs[e], s, xs, vs, late(x, dof[e], k, back - part),
                     late(v, dof[e], k, back - part), curves[e], now, f)
            ka[:] = a[k] if guided else inverse @ f
            kx[r], kv[r] = vs, ka
            if r == 0:
                E[k] = M @ a[k] - f if guided else f
                a[k] = ka
            for e in range(ne):
                drift(kinds[e], dof[e], par[e], zs[e], series[e, 2 * k + c], xs, vs, ka, kz[r, e])
        if not guided:
            if not np.all(np.abs(v[k]) < 1e6):
                x[k + 1 :] = np.nan
                return
            x[k + 1] = x[k] + h / 6 * (kx[0] + 2 * kx[1] + 2 * kx[2] + kx[3])
            v[k + 1] = v[k] + h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3])
        z += h / 6 * (kz[0] + 2 * kz[1] + 2 * kz[2] + kz[3])
    if steps:
        a[steps], E[steps] = a[steps - 1], E[steps - 1]
