"""Prediction-error identification: likelihood of the motion when the force is known (or zero, in a decay test)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.sparse.csgraph import connected_components

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.discretisation import hold_matrices
from radiation_ss.body.model import Model
from radiation_ss.identification.channels import Channels
from radiation_ss.identification.haskind import positive
from radiation_ss.identification.innovations import gaussian_log_likelihood, innovations
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import interpolate

NOISE = 0.01            # prior median of noise, relative to a channel's rms
NOISE_SPREAD = 1.5      # prior standard deviation of its logarithm
DRIFT = 0.02            # corner frequency of the sensors' slow drift, relative to the highest natural frequency
SETTLED = 1e-5
COUPLED = 1e-3          # of the geometric mean of the diagonal: less is no coupling


@dataclass(frozen=True, eq=False)
class WaveForce:
    """Exciting force from the wave elevation: X by Haskind's relation with the damping, times a smooth complex error.

    Parameters
    ----------
    spectrum : ndarray, shape (nw,)
        Fourier coefficients of the elevation, padded to twice its length.
    omega : ndarray, shape (nw,)
    X : ndarray, shape (nw, n)
        The model's; it holds for the prior's damping.
    damping : ndarray, shape (nw, n)
        The prior's B_jj.
    bumps : ndarray, shape (m, nw)
        Shapes of the error of log X, real part and phase alike.
    error : float
        Standard deviation of that error.
    samples : int
        Of the elevation.
    trim : int
        Samples left out at both ends, where the force is wrong because X is not causal.
    """

    spectrum: ComplexArray
    omega: FloatArray
    X: ComplexArray
    damping: FloatArray
    bumps: FloatArray
    error: float
    samples: int
    trim: int = 0

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return 2 * self.bumps.shape[0] * self.X.shape[1]

    def force(self, form: Parametrisation, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force (nt, n)."""
        n, floor = self.X.shape[1], 1e-3 * np.abs(self.damping).max(axis=0)
        B = np.einsum("wjj->wj", form.K(form.theta(u), self.omega).real)
        change = np.sqrt(positive(B, floor) / positive(self.damping, floor))
        parts = self.error * (v.reshape(2 * n, -1) @ self.bumps)
        X = self.X * change * np.exp(parts[:n] + 1j * parts[n:]).T
        padded = 2 * self.samples
        whole = np.fft.irfft(self.spectrum[:, None] * X, padded, axis=0)
        return np.asarray(whole[self.trim:self.samples - self.trim])


def wave_force(model: Model, form: Parametrisation, elevation: FloatArray, dt: float, frequency: float,
               error: float, trim: int, knots: int = 5) -> WaveForce:
    """Return the exciting force of an elevation (nt,) at the body, with X of the model's first direction.

    Parameters
    ----------
    trim : int
        Samples left out at both ends, where the force is wrong because X is not causal.
    frequency : float
        A typical frequency of the motion [rad/s]; the error of X has bumps from half to twice that.
    """
    table, nt = model.hydro, elevation.size
    assert table is not None and table.X is not None
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(2 * nt, dt), dtype=np.float64)
    X = interpolate(table.omega, table.X[:, 0, :], np.clip(omega, table.omega[0], table.omega[-1]))
    X[omega > 1.5 * table.omega[-1]] = 0.0
    centre = np.log(frequency) + np.linspace(-0.7, 0.7, knots)
    place = np.log(np.clip(omega, 0.4 * frequency, 2.5 * frequency))
    bumps = np.exp(-0.5 * ((place - centre[:, None]) / (centre[1] - centre[0])) ** 2) / np.pi**0.25
    damping = np.einsum("wjj->wj", form.K(form.mean, omega).real)
    return WaveForce(np.fft.rfft(elevation, 2 * nt), omega, X, damping, bumps, error, nt, trim)


@dataclass(frozen=True, eq=False)
class MotionLikelihood:
    """log p(motion | theta, noise) of one record by a Kalman filter on the sampled composite model (9)-(13).

    Nuisance parameters v: log of each channel's noise, log of each degree of freedom's force noise (both standardised),
    and where between two samples' straight line and a smooth curve the force ran; the strength of each extra force; of
    a force from the elevation the error of X.

    Parameters
    ----------
    model : Model
    parametrisation : Parametrisation
    channels : Channels
        The record, on a uniform time grid.
    force : ndarray, shape (nt, n)
    extra : tuple of ndarray, shape (nt, n)
        Forces of unknown strength with a prior standard deviation of one (drag along the measured motion).
    units : tuple of float
        Coefficients [SI] of the laws behind the extra forces at a strength of one.
    wave : WaveForce, optional
        How the force follows from the elevation, where it does.
    """

    model: Model
    parametrisation: Parametrisation
    channels: Channels
    force: FloatArray
    extra: tuple[FloatArray, ...] = ()
    units: tuple[float, ...] = ()
    wave: WaveForce | None = None

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return self.channels.count + 2 * self.model.n + len(self.extra) + (self.wave.size if self.wave else 0)

    def forces(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force (nt, n) for parameters u and nuisance parameters v."""
        at = self.channels.count + 2 * self.model.n
        force = self.force
        if self.wave is not None:
            force = self.wave.force(self.parametrisation, u, v[at + len(self.extra):])
        for strength, shape in zip(v[at:], self.extra):
            force = force + strength * shape
        return force

    @cached_property
    def force_scale(self) -> FloatArray:
        """Force rms; of a decay test, the restoring force of its motion."""
        rms = self.force.std(axis=0)
        displacement = np.zeros(self.model.n)
        np.maximum.at(displacement, self.channels.dof, self.channels.as_displacement(self.frequency))
        stiffness = np.abs(np.diag(self.model.C)) + np.diag(self.model.M + self.model.A_inf) * self.frequency**2
        return np.maximum(rms, 0.1 * stiffness * displacement)

    @cached_property
    def frequency(self) -> float:
        """A typical frequency of the motion [rad/s]."""
        return self.channels.frequency

    @cached_property
    def _curvature(self) -> FloatArray:
        """dt^2/12 f'', the difference between a smooth force and its straight-line interpolation."""
        padded = np.vstack([self.force[:1], self.force, self.force[-1:]])
        return np.asarray(np.diff(padded, n=2, axis=0) / 12.0)

    @cached_property
    def _initial(self) -> tuple[FloatArray, FloatArray]:
        """Wide initial covariances: of the radiation states, of [displacement; velocity]."""
        n = self.model.n
        reach = np.full(n, 1e-12)
        np.maximum.at(reach, self.channels.dof, 2.0 * self.channels.peak_displacement(self.frequency))
        if n > 1:
            reach = np.maximum(reach, 1e-6 * reach.max())
        velocity = reach * self.frequency
        realised = self.parametrisation.realise(self.parametrisation.mean)
        source = realised.b @ np.diag(velocity**2 * 2.0 / self.frequency) @ realised.b.T
        radiation = solve_continuous_lyapunov(realised.a, -source)
        return radiation, np.concatenate([reach**2, velocity**2])

    def matrices(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (F, G) of the composite for the parameters u."""
        form, model = self.parametrisation, self.model
        inertia, stiffness = form.rigid(u, model.M + model.A_inf, model.C)
        a, b, c = form.state_space(form.theta(u))
        n, m = model.n, a.shape[0]
        inverse, F, G = np.linalg.inv(inertia), np.zeros((m + 2 * n, m + 2 * n)), np.zeros((m + 2 * n, n))
        F[:m, :m], F[:m, m + n:], F[m:m + n, m + n:] = a, b, np.eye(n)
        F[m + n:], G[m + n:] = -inverse @ np.hstack([c, stiffness, model.D]), inverse
        return F, G

    def run(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return innovations and their variances, in units of each channel's rms."""
        p, n = self.channels.count, self.model.n
        F, G = self.matrices(u)
        dt, N = self.channels.dt, F.shape[0]
        Ad, early, late = first_order_hold(F, G, dt)
        noise = NOISE * np.exp(NOISE_SPREAD * v[:p])
        force_noise = self.force_scale * NOISE * np.exp(NOISE_SPREAD * v[p:p + n])
        force = self.forces(u, v) - (0.5 + 0.5 * v[p + n:p + 2 * n]) * self._curvature
        drive = np.zeros((force.shape[0], N + p))
        drive[:-1, :N] = force[:-1] @ early.T + force[1:] @ late.T
        scale = self.channels.rms
        H, direct = self.channels.output_matrices(F, G)
        gain = self.parametrisation.sensor(u)[self.channels.dof, None]
        H, direct = gain * H, gain * direct
        R = noise**2 + np.sum((direct / scale[:, None] * force_noise) ** 2, axis=1)
        process = (early + late) * force_noise
        full, Q, P0 = np.eye(N + p), np.zeros((N + p, N + p)), np.zeros((N + p, N + p))
        full[:N, :N] = Ad
        Q[:N, :N] = process @ process.T
        Q[N:, N:] = np.diag((DRIFT * self.frequency * dt) ** 2 * noise**2)
        radiation, rigid = self._initial
        m = radiation.shape[0]
        P0[:m, :m] = radiation
        P0[m:N, m:N] = np.diag(rigid)
        P0[N:, N:] = np.eye(p) * 0.25
        H_full = np.hstack([H / scale[:, None], np.eye(p)])
        return innovations(full, drive, H_full, force @ (direct / scale[:, None]).T, R, Q, np.zeros(N + p), P0,
                           self.channels.y / scale, SETTLED)

    def values(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the log likelihoods, shape (B,), of u (B, d_u) and v (B, size)."""
        found = np.array([gaussian_log_likelihood(*self.run(*row)) for row in zip(u, v)])
        return np.where(np.isfinite(found), found, -np.inf)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information, from innovations of neighbouring parameters."""
        e, s = self.run(u, v)
        J, L, z = (*self._sensitivities(u, v, e, s), (e / np.sqrt(s)).ravel())
        gradient = -J @ z - 0.5 * L @ (1.0 - z * z)
        return gaussian_log_likelihood(e, s), gradient, J @ J.T + 0.5 * L @ L.T

    def _sensitivities(self, u: FloatArray, v: FloatArray, e: FloatArray,
                       s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return derivatives by [u, v] of innovations over their deviation, and of log variances, each (d, nt p)."""
        both, step = np.concatenate([u, v]), 1e-4
        weighted, log_changes = [], []
        involved = np.r_[self.parametrisation.involved, np.ones(v.size, bool)]
        for i in range(both.size):
            if not involved[i]:
                weighted.append(np.zeros(e.size))
                log_changes.append(np.zeros(e.size))
                continue
            moved = both.copy()
            moved[i] += step
            e1, s1 = self.run(moved[:u.size], moved[u.size:])
            weighted.append(((e1 - e) / step / np.sqrt(s)).ravel())
            log_changes.append(((s1 - s) / step / s).ravel())
        return np.array(weighted), np.array(log_changes)

    def predicted(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the one-step predictions of the channels, shape (nt, p)."""
        return np.asarray(self.channels.y - self.run(u, v)[0] * self.channels.rms)

    def score_of_force(self, u: FloatArray, v: FloatArray, extra: FloatArray) -> tuple[float, float, FloatArray]:
        """Return score and information of an extra force (nt, n), and their cross information with [u, v]."""
        e, s = self.run(u, v)
        J, _ = self._sensitivities(u, v, e, s)
        # Innovations are linear in the force, but for the scale of its noise, which is held.
        shifted = replace(self, extra=(*self.extra, extra))
        shifted.__dict__["force_scale"] = self.force_scale
        at = self.channels.count + 2 * self.model.n + len(self.extra)
        v = np.insert(v, at, 1.0)
        by_force = ((shifted.run(u, v)[0] - e) / np.sqrt(s)).ravel()
        return float(-by_force @ (e / np.sqrt(s)).ravel()), float(by_force @ by_force), J @ by_force


def motion_likelihoods(model: Model, form: Parametrisation, channels: Channels, force: FloatArray,
                       wave: WaveForce | None = None) -> list[MotionLikelihood]:
    """Return one likelihood for each group of degrees of freedom that nothing couples (surge-heave-pitch, ...)."""
    out = []
    for dofs in uncoupled(model):
        pick = np.flatnonzero(np.isin(channels.dof, dofs))
        if pick.size == 0:
            continue
        square, part = np.ix_(dofs, dofs), form.part(dofs)
        if not part.blocks:
            continue
        assert model.D is not None
        small = Model(part.dofs, model.M[square], model.A_inf[square], model.C[square], part.own.realise(part.mean),
                      D=model.D[square])
        own = replace(channels, y=channels.y[:, pick], derivative=channels.derivative[pick],
                      dof=np.searchsorted(dofs, channels.dof[pick]), labels=tuple(channels.labels[i] for i in pick))
        waves = None if wave is None else replace(wave, X=wave.X[:, dofs], damping=wave.damping[:, dofs])
        out.append(MotionLikelihood(small, part, own, force[:, dofs], wave=waves))
    return out


def uncoupled(model: Model) -> list[list[int]]:
    """Return groups of degrees of freedom with no inertia, stiffness, damping or memory between them."""
    gain = np.abs(model.fit.frequency_response(np.abs(np.linalg.eigvals(model.fit.a)) + 1e-9)).max(axis=0)
    linked = np.zeros((model.n, model.n), dtype=bool)
    for matrix in (np.abs(model.M + model.A_inf), np.abs(model.C), np.abs(model.D), gain):
        size = np.sqrt(np.diag(matrix))
        linked |= matrix > COUPLED * np.maximum(np.outer(size, size), 1e-300)
    count, label = connected_components(linked, directed=False)
    return [[int(j) for j in np.flatnonzero(label == i)] for i in range(count)]


def first_order_hold(F: FloatArray, G: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (Ad, early, late) of x_{k+1} = Ad x_k + early f_k + late f_{k+1}, exact for a force linear in between."""
    step, held, late = hold_matrices(F, G, dt)
    return step, held - late, late
