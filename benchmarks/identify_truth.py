"""Truths for `identify` that share nothing with its estimator: a section's own kernel, seas of any shape, one FFT.

The body's K(iw) is interpolated from a fine table of the panel method, not from a rational fit, so that the model's
order is wrong as it is in life. The motion is the stationary response (the convolution of Cummins' equation over an
infinite past): a sum of harmonics with random amplitudes over eight record lengths.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

import radiation_ss as rss
from radiation_ss.inference.prior import parametrise

G, RHO = 9.81, 1000.0
FINE = np.r_[np.linspace(0.05, 20.0, 120), np.linspace(20.5, 40.0, 30)]


@dataclass(frozen=True)
class Body:
    """A body with tabulated coefficients: what nature has, and the band in which K is judged."""

    data: rss.HydroData
    order: int
    band: np.ndarray

    def K(self, w):
        """Return K(iw), shape (nw, n, n), by a spline of the table."""
        d = self.data
        table = d.B + 1j * d.omega[:, None, None] * (d.A - d.A_inf)
        K = CubicSpline(d.omega, table)(np.clip(w, d.omega[0], d.omega[-1]))
        beyond = w > d.omega[-1]
        K[beyond] *= (d.omega[-1] / w[beyond])[:, None, None]
        return K

    def X(self, w):
        """Return the exciting force per metre wave amplitude, shape (nw, n)."""
        d = self.data
        X = CubicSpline(d.omega, d.X[:, 0, :])(np.clip(w, d.omega[0], d.omega[-1]))
        X[w > d.omega[-1]] *= 0.0
        return X


@lru_cache
def lewis_heave():
    """The paper's section in heave: K(0) is not zero."""
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), FINE, depth=0.45, gyradius=0.07)
    data = section.times(0.297).select(("Heave",))
    return Body(data, 3, np.linspace(4.0, 12.0, 40))


@lru_cache
def ship_sway_roll():
    """A ship's section in sway and roll on a soft sway spring."""
    data = rss.section_2d(rss.lewis_section(0.2, 0.2, 0.95), FINE, depth=1.0, centre_of_gravity=-0.09,
                          gyradius=0.144).times(0.586).select(("Sway", "Roll"))
    C = np.array(data.C)
    C[0, 0] += 60.0
    return Body(data.replace(C=C), 4, np.linspace(2.5, 9.0, 40))


def perturbed(body: Body, rng, spread=0.15):
    """Return the model that a user has: coefficients of the body's fit off by as much as makes K off by `spread`.

    Its table and X go with them. The coefficients' errors are independent, which is not what `identify` believes.
    """
    fit = rss.fit_radiation(body.data, body.order)
    form = parametrise(fit, body.data.A_inf, spread)
    w = np.linspace(0.0, 2.0 * np.exp(np.mean(np.log(np.abs(np.linalg.eigvals(fit.a))))), 40)
    K = form.K(form.mean, w)
    size = np.sqrt(np.mean(np.abs(K) ** 2, axis=0))
    moved = form.tied(form.mean * (1.0 + 1e-6 * np.eye(form.mean.size)[form.active]))
    share = 1e-6 * spread * np.linalg.norm(K / size) / np.linalg.norm((form.K(moved, w) - K) / size)
    while True:
        error = np.zeros(form.mean.size)
        error[form.active] = share * rng.standard_normal(form.active.size)
        start = form.realise(form.tied(form.mean * (1.0 + error)))
        if start.stable and start.passive:
            break
    start = dataclasses.replace(start, relative_error=fit.relative_error)
    d, w = body.data, body.data.omega
    K = start.frequency_response(w)
    B = np.einsum("wjj->wj", K.real)
    old = np.einsum("wjj->wj", d.B)
    X = d.X * np.sqrt(np.maximum(B, 1e-9 * B.max(axis=0)) / np.maximum(old, 1e-9 * old.max(axis=0)))[:, None, :]
    data = d.replace(A=d.A_inf + K.imag / w[:, None, None], B=K.real, X=X)
    return rss.Model(d.dofs, d.M, d.A_inf, d.C, start, hydro=data)


def jonswap(hs, tp, gamma):
    """Return S(w)."""
    def S(w):
        x = np.maximum(w * tp / (2.0 * np.pi), 0.15)
        r = np.exp(-0.5 * ((x - 1.0) / np.where(x < 1.0, 0.07, 0.09)) ** 2)
        shape = x**-5 * np.exp(-1.25 * x**-4) * gamma**r
        return hs**2 / 16.0 * shape / np.trapezoid(shape, w)
    return S


def any_jonswap(rng, tp=0.9):
    """JONSWAP, gamma 1 to 5, period off by up to a fifth."""
    return jonswap(0.01, tp * rng.uniform(0.85, 1.25), rng.uniform(1.0, 5.0))


def swell_and_wind(rng, tp=0.9):
    """A swell and a wind sea of random shares."""
    share, first = rng.uniform(0.3, 0.7), jonswap(0.01, tp * rng.uniform(1.4, 1.8), rng.uniform(3.0, 7.0))
    second = jonswap(0.01, tp * rng.uniform(0.75, 1.0), rng.uniform(1.0, 3.0))
    return lambda w: share * first(w) + (1.0 - share) * second(w)


def flat(rng, tp=0.9):
    """White from 4 to 12 rad/s (at a period of .9 s)."""
    return lambda w: 1e-6 * ((w > 4.0 * 0.9 / tp) & (w < 12.0 * 0.9 / tp))


def lumpy(rng, tp=0.9):
    """A tail w^-4 with lumps of 30 to 60 %."""
    size, phase, step = rng.uniform(0.3, 0.6), rng.uniform(0.0, 6.0), rng.uniform(0.2, 0.4)
    base = jonswap(0.01, tp * rng.uniform(0.9, 1.2), 2.0)
    return lambda w: (base(w) * np.maximum(w * tp / 6.0, 1.0)
                      * (1.0 + size * np.sin(2.0 * np.pi * np.log(np.maximum(w, 0.1)) / step + phase)))


SEAS: dict[str, Callable] = {"JONSWAP": any_jonswap, "swell + wind sea": swell_and_wind, "flat": flat, "lumpy": lumpy}


def sail(body: Body, S, duration, rng, *, dt=0.05, noise=0.01, mass=1.0, drag=0.0, force=False, elevation=False):
    """Return a record of the motion (force, elevation: their columns too) and the true force (n, nt).

    mass: true mass over the table's; drag: quadratic damping over the radiation damping, by iteration at each sample.
    """
    step = 2.0 * np.pi / (8.0 * duration)
    w = step * np.arange(1, int(30.0 / step))
    a = (rng.standard_normal(w.size) + 1j * rng.standard_normal(w.size)) * np.sqrt(S(w) * step)
    d = body.data
    Z = -(w**2)[:, None, None] * (mass * d.M + d.A_inf) + 1j * w[:, None, None] * body.K(w) + d.C
    F = body.X(w) * a[:, None]
    receptance = np.linalg.inv(Z)
    n_all = 8 * round(duration / dt)

    def series(values):
        return 0.5 * n_all * np.fft.irfft(np.vstack([np.zeros((1, values.shape[1])), values]), n_all, axis=0)

    whole = series(F)
    y = series(np.einsum("wij,wj->wi", receptance, F))
    if drag:
        rate = series(1j * w[:, None] * np.einsum("wij,wj->wi", receptance, F))
        coefficient = drag * np.einsum("wjj->wj", d.B).max(axis=0) / (0.85 * rate.std(axis=0) * 2.0)
        extra = np.zeros_like(whole)
        for _ in range(60):
            spectrum = np.fft.rfft(whole + extra, axis=0)[1:w.size + 1] / (0.5 * n_all)
            response = np.einsum("wij,wj->wi", receptance, spectrum)
            y, v = series(response), series(1j * w[:, None] * response)
            extra = 0.5 * extra - 0.5 * coefficient * v * np.abs(v)
    nt = n_all // 8
    noisy = {dof: y[:nt, j] + noise * y[:nt, j].std() * rng.standard_normal(nt) for j, dof in enumerate(d.dofs)}
    f = whole[:nt].T
    if force:
        noisy |= {f"{dof}_force": f[j] + noise * f[j].std() * rng.standard_normal(nt) for j, dof in enumerate(d.dofs)}
    if elevation:
        eta = series(a[:, None])[:nt, 0]
        noisy["wave_elevation"] = eta + noise * eta.std() * rng.standard_normal(nt)
    return rss.Record(dt * np.arange(nt), noisy, kind="waves" if force or elevation else "motion-only"), f
