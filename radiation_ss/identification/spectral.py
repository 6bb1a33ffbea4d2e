"""Motion only: likelihood of the motion's spectrum under an unknown sea and Haskind's relation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.identification.banded import FINE, REACH, Coefficients
from radiation_ss.identification.channels import Channels
from radiation_ss.identification.gaps import filled
from radiation_ss.identification.haskind import Haskind, relation
from radiation_ss.identification.sea import SeaModel
from radiation_ss.inference.parameters import Parametrisation

LOWEST, HIGHEST = 0.4, 2.5      # band used, relative to the motion's median frequency
NOISE, NOISE_SPREAD = 0.01, 1.5  # prior median of measurement noise over the motion's rms; spread of its logarithm
KNOTS = 8
BRIDGE, GAP_REACH = 0.5, 1.5     # longest gap that is filled, and how far around it is looked, in periods of the motion
STEP = 1e-5
SIMULATED = 20      # simulated scores for each parameter, where the information is their covariance


class Departure(Protocol):
    """Something that the likelihood holds at zero: a change of the spectra."""

    def slope(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return the spectra's derivative by the change, shape (nw, p, p), of one stretch."""


@dataclass(frozen=True, eq=False)
class SpectralLikelihood:
    """log p(motion | theta, sea, noise) of one record, by its windowed Fourier coefficients in the wave band.

    Nuisance parameters v: the sea's, then the log noise of each channel.
    """

    model: Model
    form: Parametrisation
    channels: Channels
    coefficients: tuple[Coefficients, ...]
    sea: SeaModel
    haskind: tuple[Haskind, ...]

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return self.sea.size + self.channels.count

    @cached_property
    def _statics(self) -> tuple[tuple[ComplexArray, ComplexArray], ...]:
        """For each stretch, stiffness minus inertia (nw, n, n) and the channels' derivative factors (nw, p)."""
        out = []
        for part in self.coefficients:
            w = np.maximum(part.fine, part.spacing / FINE)
            factors = (1j * w[:, None]) ** self.channels.derivative / self.channels.rms
            out.append((rigid_impedance(self.model, w), factors))
        return tuple(out)

    def responses(self, number: int, u: FloatArray) -> ComplexArray:
        """Return channels per wave amplitude, in units of each channel's rms, shape (..., nw, p)."""
        part, haskind = self.coefficients[number], self.haskind[number]
        rigid, factors = self._statics[number]
        w = np.maximum(part.fine, part.spacing / FINE)
        K = self.form.K(self.form.theta(u), w)
        X = haskind.exciting_force(np.einsum("...wjj->...wj", K.real))
        impedance = rigid + 1j * w[:, None, None] * K
        motion: ComplexArray = X / impedance[..., 0] if self.model.n == 1 else _solve(impedance, X)
        return np.asarray(motion[..., self.channels.dof] * factors)

    def spectra(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return cross spectra of the channels, shape (..., nw, p, p)."""
        g = self.responses(number, u)
        S = self.sea.density(v[..., :self.sea.size], self.coefficients[number].fine)
        if self.channels.count == 1:
            return np.asarray((np.abs(g[..., 0]) ** 2 * S)[..., None, None])
        return np.asarray(g[..., :, None] * np.conj(g[..., None, :]) * S[..., None, None])

    def noise(self, v: FloatArray) -> FloatArray:
        """Return measurement noise variances over each channel's variance, shape (..., p)."""
        return np.asarray((NOISE * np.exp(NOISE_SPREAD * v[..., self.sea.size:])) ** 2)

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood."""
        noise = self.noise(v)
        return sum(part.log_likelihood(self.spectra(i, u, v), noise) for i, part in enumerate(self.coefficients))

    def mean_damping(self, u: FloatArray) -> FloatArray:
        """Return the radiation damping B_jj at the motion's median frequency, shape (n,)."""
        K = self.form.K(self.form.theta(u), [self.channels.frequency])[0]
        return np.asarray(np.diag(K).real)

    def local(self, u: FloatArray, v: FloatArray,
              variants: tuple[Departure, ...] = ()) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, its exact gradient, and Fisher information, in [u, v] and the variants.

        Of one channel it is Whittle's. Motions of several degrees of freedom in one long-crested sea have a cross
        spectrum of rank one: their ratio at a frequency is known to the noise. Whittle's information averages the
        spectrum over a bin, takes what the ratio changes by within it for noise, and comes out too small (600 times in
        one direction, of a ship's section in sway and roll); then it is the covariance of simulated scores.
        """
        noise, d, p = self.noise(v), u.size + v.size, self.channels.count
        noise_slope = self._noise_slopes(noise, d + len(variants))
        value, gradient = 0.0, np.zeros(d + len(variants))
        fisher = np.zeros((gradient.size, gradient.size))
        for i, part in enumerate(self.coefficients):
            S, slope = self.slopes(i, u, v, variants)
            one, by_S, by_noise = part.gradient(S, noise)
            value += one
            gradient += np.einsum("wij,awij->a", by_S, slope).real + noise_slope @ by_noise
            if p > 1:
                # The same draws with and without variants, so that their blocks belong together.
                fisher += _simulated_information(part, S, noise, slope, noise_slope, SIMULATED * d)
                continue
            seen = part.local_average(S) + np.diag(noise)
            change = part.local_average(slope) + np.einsum("ap,pq->apq", noise_slope, np.eye(p))[:, None]
            relative = np.linalg.solve(seen, change)
            fisher += np.einsum("akij,bkji->ab", relative, relative).real
        return value, gradient, fisher

    def slopes(self, number: int, u: FloatArray, v: FloatArray,
               variants: tuple[Departure, ...] = ()) -> tuple[ComplexArray, ComplexArray]:
        """Return spectra (nw, p, p) of a stretch and their derivatives by [u, v] and the variants (d, nw, p, p)."""
        both = np.concatenate([u, v])
        d = both.size
        moved = both + STEP * np.concatenate([np.eye(d), -np.eye(d)])
        around = self.spectra(number, moved[:, :u.size], moved[:, u.size:])
        return self.spectra(number, u, v), np.concatenate([(around[:d] - around[d:]) / (2.0 * STEP),
                                                           *(item.slope(number, u, v)[None] for item in variants)])

    def _noise_slopes(self, noise: FloatArray, count: int) -> FloatArray:
        """Return the derivatives of the noise variances by [u, v] and variants, shape (count, p)."""
        out, p = np.zeros((count, noise.size)), noise.size
        end = self.form.active.size + self.size
        out[end - p:end] = np.diag(2.0 * NOISE_SPREAD * noise)
        return out

    def simulated_scores(self, u: FloatArray, v: FloatArray, variants: tuple[Departure, ...],
                         rng: np.random.Generator, count: int) -> FloatArray:
        """Return scores by [u, v] and the variants of records simulated at u and v, shape (count, d)."""
        noise = self.noise(v)
        noise_slope = self._noise_slopes(noise, u.size + v.size + len(variants))
        total = np.zeros((count, noise_slope.shape[0]))
        for i, part in enumerate(self.coefficients):
            S, slope = self.slopes(i, u, v, variants)
            total += part.simulated_scores(S, noise, slope, noise_slope, rng, count)
        return total


def spectral_likelihood(model: Model, form: Parametrisation, channels: Channels, *,
                        knots: int = KNOTS) -> tuple[SpectralLikelihood, tuple[str, ...]]:
    """Return the likelihood of one record's motion, and warnings.

    One channel of each degree of freedom is used: displacement, else velocity, else acceleration. A gap longer than
    half a period splits the record into stretches that are taken as independent; shorter ones are filled.

    Raises
    ------
    InputError
        If no stretch is longer than four periods.
    """
    channels = one_each(channels)
    w_mid = channels.frequency
    stretches = complete_stretches(channels, shortest=4.0 * 2.0 * np.pi / w_mid, bridge=BRIDGE * 2.0 * np.pi / w_mid)
    if not stretches:
        raise InputError(f"record {channels.name}: no stretch without gaps is longer than four periods of the motion")
    parts, haskinds = [], []
    warnings: tuple[str, ...] = ()
    for y in stretches:
        part = Coefficients(y / channels.rms, channels.dt, *band_of_bins(w_mid, y.shape[0], channels.dt))
        parts.append(part)
        found, warnings = relation(model, np.maximum(part.fine, part.spacing / FINE))
        haskinds.append(found)
    knot_places = np.geomspace(LOWEST * w_mid, HIGHEST * w_mid, knots) if knots else np.empty(0)
    guess = SeaModel(1.0, 2.0 * np.pi / w_mid, knot_places)
    likelihood = SpectralLikelihood(model, form, channels, tuple(parts), guess, tuple(haskinds))
    height, period = _first_guess(likelihood)
    return SpectralLikelihood(model, form, channels, tuple(parts), SeaModel(height, period, knot_places),
                              tuple(haskinds)), warnings


def _simulated_information(part: Coefficients, S: ComplexArray, noise: FloatArray, slope: ComplexArray,
                           noise_slope: FloatArray, count: int) -> FloatArray:
    """Return the information of coefficients as the covariance of simulated scores, the same at every call."""
    scores = part.simulated_scores(S, noise, slope, noise_slope, np.random.default_rng(0), count)
    return np.asarray(scores.T @ scores / count)


def rigid_impedance(model: Model, omega: FloatArray) -> ComplexArray:
    """Return C + i w D - w^2 (M + A_inf), shape (nw, n, n)."""
    w = omega[:, None, None]
    return np.asarray(model.C + 1j * w * model.D - w**2 * (model.M + model.A_inf))


def _solve(impedance: ComplexArray, X: ComplexArray) -> ComplexArray:
    return np.asarray(np.linalg.solve(impedance, X[..., None])[..., 0], dtype=np.complex128)


def band_of_bins(frequency: float, samples: int, dt: float) -> tuple[int, int]:
    """Return the first and last bin used of a stretch, for a motion of this median frequency [rad/s]."""
    spacing = 2.0 * np.pi / (samples * dt)
    first = max(int(np.ceil(LOWEST * frequency / spacing)), 2)
    last = int(min(HIGHEST * frequency, 0.8 * np.pi / dt) / spacing)
    return first, max(last, first + 2 * REACH + 2)


def one_each(channels: Channels) -> Channels:
    """Return the channel of lowest derivative of each degree of freedom."""
    pick = [i for i in range(channels.count)
            if channels.derivative[i] == channels.derivative[channels.dof == channels.dof[i]].min()]
    return Channels(channels.name, channels.start, channels.dt, channels.y[:, pick], channels.dof[pick],
                    channels.derivative[pick], tuple(channels.labels[i] for i in pick))


def complete_stretches(channels: Channels, shortest: float, bridge: float) -> list[FloatArray]:
    """Return stretches (nt, p) without gaps; gaps up to `bridge` [s] are filled (`gaps.filled`)."""
    y = np.stack([filled(column, int(bridge / channels.dt), int(GAP_REACH * 2.0 * np.pi / channels.frequency
                                                                / channels.dt)) for column in channels.y.T], axis=1)
    whole = np.isfinite(y).all(axis=1)
    edges = np.flatnonzero(np.diff(np.r_[0, whole.astype(int), 0]))
    return [y[a:b] - y[a:b].mean(axis=0) for a, b in zip(edges[::2], edges[1::2]) if (b - a) * channels.dt >= shortest]


def _first_guess(likelihood: SpectralLikelihood) -> tuple[float, float]:
    """Return Hs [m] and Tp [s] from the motion by the prior mean's response, least squares on a grid of periods."""
    part = max(likelihood.coefficients, key=lambda item: item.y.shape[0])
    number = likelihood.coefficients.index(part)
    g = np.abs(likelihood.responses(number, np.zeros(likelihood.form.active.size))) ** 2
    best = (-np.inf, 1.0, 1.0)
    power = np.abs(part.z) ** 2
    for period in 2.0 * np.pi / likelihood.channels.frequency * np.geomspace(0.6, 1.8, 25):
        v = np.zeros(likelihood.sea.size)
        unit = SeaModel(1.0, float(period), likelihood.sea.knots).density(v, part.fine)
        spectra = (g.T * unit).astype(complex)[:, :, None, None]
        seen = part.local_average(spectra)[:, :, 0, 0].T.real
        floor = 1e-4 * seen.max(axis=0)
        scale = float(np.mean(power / (seen + floor) * seen / seen.sum(axis=0)) * seen.shape[0])
        score = -float(np.sum(np.log(scale * (seen + floor)) + power / (scale * (seen + floor))))
        if score > best[0]:
            best = (score, float(np.sqrt(scale)), float(period))
    return best[1], best[2]
