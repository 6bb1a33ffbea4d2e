"""Likelihood of the motion when the force is known (or zero, in a decay test), by prediction errors."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model, equation_of_motion
from radiation_ss.body.time_step import hold_matrices
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.fit.rational import connected
from radiation_ss.identification.channels import Channels
from radiation_ss.identification.force import WaveForce
from radiation_ss.inference.kalman import innovations, log_likelihood
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.remainder import Remainder
from radiation_ss.records.signals import filled, middle
from radiation_ss.simulation.start import coupled


@dataclass(frozen=True)
class NoiseRules:
    """What is believed of noise."""

    # level, spread: Prior median of noise relative to a channel's rms (motion and force), and the spread of its
    # logarithm
    level: float = 0.01
    spread: float = 1.5
    least: float = 1e-5  # Of any channel: simulated records without noise would have a likelihood without bounds
    slow: float = 0.25  # Corner frequency of a slow force that nobody measured, relative to the motion's or the wave's
    drift: float = 0.02  # Corner frequency of the sensors' slow drift, relative to the motion's
    settled: float = 1e-5  # Relative change of the prediction errors' variance below which the Kalman gain is frozen
    # Noise of a force that is known to be zero, relative to the force that the motion would take
    least_force: float = 1e-4
    edge: float = 2.0  # Periods at each end of a record where a force from the elevation is unsure: X's memory

    def of(self, v: FloatArray) -> FloatArray:
        """Return the noise of standardised values v."""
        return np.asarray(np.hypot(self.level * np.exp(self.spread * v), self.least), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Law:
    """A nonlinear force of unknown strength: its name, its force (nt, n) at a strength of one, its coefficient [SI]."""

    name: str
    force: FloatArray
    unit: float


@dataclass(frozen=True, eq=False)
class MotionLikelihood:
    """log p(motion | theta, noise) of one record by a Kalman filter on the sampled composite model (9)-(13).

    Nuisance parameters v: log noise of each channel and of each force; where between a straight line and a smooth curve
    the force ran; log size of a slow force on each motion (white noise through two first-order filters); the strength
    of each law; of a force from the elevation the error of X.
    """

    model: Model
    form: Parametrisation
    channels: Channels  # The record, on a uniform time grid
    force: FloatArray  # (nt, n)
    laws: tuple[Law, ...] = ()
    wave: WaveForce | None = None  # How the force follows from the elevation, where it does
    rules: NoiseRules = NoiseRules()
    beside: FloatArray | float = 0.0  # (nt, n): Known force along the motion, of what is no part of the subsystem

    @property
    def first_law(self) -> int:
        """Where the strength of the first law stands in v."""
        return self.channels.count + 3 * self.model.n

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return self.first_law + len(self.laws) + (self.wave.size if self.wave else 0)

    def forces(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the force (nt, n) for parameters u and nuisance parameters v."""
        at = self.first_law
        force = self.force if self.wave is None else self.wave.force(self.form, u, v[at + len(self.laws):])
        force = force + self.beside
        for strength, law in zip(v[at:], self.laws):
            force = force + strength * law.force
        return force

    @cached_property
    def _stiffness(self) -> FloatArray:
        """Force that a displacement of one takes at the typical frequency, without regard to phase, (n,)."""
        inertia = np.diag(self.model.M + self.model.A_inf)
        return np.asarray(np.abs(np.diag(self.model.C)) + inertia * self.channels.frequency**2)

    @cached_property
    def _reach(self) -> tuple[FloatArray, FloatArray]:
        """Root mean square and twice the largest displacement of each degree of freedom, each (n,).

        One that is not measured has the energy of the measured one that has the most.
        """
        c = self.channels
        out = np.zeros((2, self.model.n))
        for row, size in zip(out, (c.rms, 2.0 * np.nanmax(np.abs(c.y), axis=0))):
            np.maximum.at(row, c.dof, size / c.frequency**c.derivative)
        unseen = np.setdiff1d(np.arange(self.model.n), c.dof)
        energy = np.max(self._stiffness * out**2, axis=1)
        out[:, unseen] = np.sqrt(energy[:, None] / self._stiffness[unseen])
        return out[0], np.maximum(out[1], np.maximum(1e-6 * out[1].max(), 1e-12))

    @cached_property
    def force_scale(self) -> FloatArray:
        """Force rms; of a decay test, the restoring force of its motion."""
        return np.maximum(self.force.std(axis=0), 0.1 * self._stiffness * self._reach[0])

    @cached_property
    def _slow(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What makes a slow force on each motion: two first-order filters in series, the force the state of the second.

        Their matrix, their covariance at rest with forces of one, and their noise in a step, each (2n, 2n), with each
        force before what drives it. The corner is below the free motion's frequency, and below the force's that drives
        it where the motion is mostly a drift.
        """
        own, dt, corner = self.channels.frequency, self.channels.dt, np.empty(self.model.n)
        for i, force in enumerate(self.force.T):
            free = natural_frequency(self.model, i) if self.model.C[i, i] > 0.0 else np.inf
            omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(force.size, dt), dtype=np.float64)
            corner[i] = self.rules.slow * min(max(own, middle(omega, np.fft.rfft(force))), free)
        A, rest = (np.asarray(np.kron(np.diag(each), two), dtype=np.float64) for each, two in (
            (corner, [[-1.0, 1.0], [0.0, -1.0]]), (np.ones(self.model.n), [[1.0, 1.0], [1.0, 2.0]])))
        step = expm(A * dt)
        return A, rest, np.asarray(rest - step @ rest @ step.T)

    @cached_property
    def _curvature(self) -> FloatArray:
        """dt^2/12 f'', the difference between a smooth force and its straight-line interpolation."""
        padded = np.vstack([self.force[:1], self.force, self.force[-1:]])
        return np.asarray(np.diff(padded, n=2, axis=0) / 12.0)

    @cached_property
    def _initial(self) -> FloatArray:
        """Wide initial covariance of [radiation states; displacement; velocity; slow forces; sensor drifts]."""
        n, reach, frequency = self.model.n, self._reach[1], self.channels.frequency
        velocity = reach * frequency
        realised = self.form.realise(self.form.mean)
        source = realised.b @ np.diag(velocity**2 * 2.0 / frequency) @ realised.b.T
        m, p = realised.states, self.channels.count
        P = np.diag(np.r_[np.zeros(m), reach**2, velocity**2, np.zeros(2 * n), np.full(p, 0.25)])
        P[:m, :m] = solve_continuous_lyapunov(realised.a, -source)
        P[m + 2 * n:m + 4 * n, m + 2 * n:m + 4 * n] = self._slow[1]
        return P

    def matrices(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (F, G) of the composite for the parameters u."""
        form, model = self.form, self.model
        inertia, stiffness = form.rigid(u, model.M + model.A_inf, model.C)
        return equation_of_motion(inertia, model.D, stiffness, form.state_space(form.theta(u)))

    def outputs(self, F: FloatArray, G: FloatArray, gain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (H, J) of y = H x + J f in units of each channel's rms, for sensors of this gain (..., n)."""
        c, (N, n) = self.channels, G.shape[-2:]
        row = N + (np.minimum(c.derivative, 1) - 2) * n + c.dof     # of an acceleration the velocity's
        rate, scale = (c.derivative == 2)[:, None], (gain[..., c.dof] / c.rms)[..., None]
        return scale * np.where(rate, F[..., row, :], np.eye(N)[row]), scale * np.where(rate, G[..., row, :], 0.0)

    def run(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return innovations and their variances, in units of each channel's rms, (..., nt, p); u, v (..., d)."""
        bodies, own = np.atleast_2d(u, v)
        c, at = self.channels, slice(self.channels.count + self.model.n, self.channels.count + 2 * self.model.n)
        e, s = np.empty((2, bodies.shape[0], *c.y.shape))
        for i, (F, now, after, Q, H, direct, R) in enumerate(zip(*self.sampled(bodies, own))):
            force = self.forces(bodies[i], own[i])
            bent = force - (0.5 + 0.5 * own[i, at]) * self._curvature
            drive = np.zeros((force.shape[0], F.shape[0]))
            drive[:-1, :now.shape[0]] = bent[:-1] @ now.T + bent[1:] @ after.T
            e[i], s[i] = innovations(F, Q, H, R, self._initial, drive, c.y / c.rms - force @ direct.T,
                                     self.rules.settled)
        return (e, s) if u.ndim > 1 else (e[0], s[0])

    def sampled(self, bodies: FloatArray, own: FloatArray) -> tuple[FloatArray, ...]:
        """Return the sampled systems of u, v (count, d), with slow forces and the sensors' drift among their states.

        Transition, what the force at its beginning and at its end adds, noise, outputs, what the force adds to these,
        and their noise's variances.
        """
        c, p, n, count = self.channels, self.channels.count, self.model.n, bodies.shape[0]
        F, G = self.matrices(bodies)
        N, at = F.shape[-1], 2 * np.arange(n)
        M = N + 2 * n
        noise, force_noise, slow = (size * self.rules.of(own[:, first:first + size.size]) for size, first in (
            (np.ones(p), 0), (self.force_scale, p), (self.force_scale, p + 2 * n)))
        whole, acting = np.zeros((count, M, M)), np.zeros((count, M, n))
        whole[:, :N, :N], whole[:, :N, N + at], whole[:, N:, N:], acting[:, :N] = F, G * slow[:, None], self._slow[0], G
        Ad, held, late = hold_matrices(whole, acting, c.dt)     # exact for a force that is straight between samples
        process = held * force_noise[:, None]
        H, full, Q = np.zeros((count, p, M + p)), np.zeros((count, M + p, M + p)), np.zeros((count, M + p, M + p))
        H[..., :N], direct = self.outputs(F, G, self.form.gain("sensor", bodies))
        H[..., N + at], H[..., M:] = direct * slow[:, None], np.eye(p)
        R = noise**2 + np.sum((direct * force_noise[:, None]) ** 2, axis=-1)
        full[:, :M, :M], full[:, M:, M:], Q[:, :M, :M] = Ad, np.eye(p), process @ process.swapaxes(1, 2)
        Q[:, N:M, N:M] += self._slow[2]
        Q[:, M:, M:] = (self.rules.drift * c.frequency * c.dt) ** 2 * noise[:, None]**2 * np.eye(p)
        return full, held - late, late, Q, H, direct, R

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood."""
        found = log_likelihood(*self.run(u, v))
        return found if np.isfinite(found) else -np.inf

    def local(self, u: FloatArray, v: FloatArray, body: bool = True) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information, in [u, v] or in v alone, by differences."""
        e, s = self.run(u, v)
        J, L = (part[0 if body else u.size:] for part in self._sensitivities(u, v, e, s, body))
        z = (e / np.sqrt(s)).ravel()
        gradient = -J @ z - 0.5 * L @ (1.0 - z * z)
        return log_likelihood(e, s), gradient, J @ J.T + 0.5 * L @ L.T

    def _sensitivities(self, u: FloatArray, v: FloatArray, e: FloatArray, s: FloatArray, body: bool = True,
                       step: float = 1e-4) -> tuple[FloatArray, FloatArray]:
        """Return derivatives by [u, v] of innovations over their deviation, and of log variances, each (d, nt p)."""
        both = np.concatenate([u, v])
        weighted, log_changes = np.zeros((2, both.size, e.size))
        at = np.flatnonzero(np.r_[self.form.involved & body, np.ones(v.size, bool)])
        moved = both + step * np.eye(both.size)[at]
        e1, s1 = self.run(moved[:, :u.size], moved[:, u.size:])
        weighted[at] = ((e1 - e) / step / np.sqrt(s)).reshape(at.size, -1)
        log_changes[at] = ((s1 - s) / step / s).reshape(at.size, -1)
        return weighted, log_changes

    def filtered(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the channels (nt, p) without the noise that the model tells from motion, by the samples so far."""
        e, s = self.run(u, v)
        return np.asarray(self.channels.y - e * self.rules.of(v[:self.channels.count]) ** 2 / s * self.channels.rms)

    def with_law(self, law: Law, v: FloatArray, strength: float = 0.0) -> "tuple[MotionLikelihood, FloatArray]":
        """Return the likelihood with one more law, and its nuisance parameters."""
        return replace(self, laws=(*self.laws, law)), np.insert(v, self.first_law + len(self.laws), strength)

    def scores_of(self, laws: Iterable[Law], u: FloatArray,
                  v: FloatArray) -> Iterator[tuple[float, float, FloatArray]]:
        """Yield score and information of each law's strength, and their cross information with [u, v]."""
        e, s = self.run(u, v)
        J, _ = self._sensitivities(u, v, e, s)
        for law in laws:
            more, moved = self.with_law(law, v, 1.0)        # innovations are linear in a force
            by_force = ((more.run(u, moved)[0] - e) / np.sqrt(s)).ravel()
            yield float(-by_force @ (e / np.sqrt(s)).ravel()), float(by_force @ by_force), J @ by_force


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
        own = replace(channels.pick(pick), dof=np.searchsorted(dofs, channels.dof[pick]))
        waves = None if wave is None else replace(wave, haskind=wave.haskind.part(dofs))
        out.append(MotionLikelihood(small, part, own, force[:, dofs], wave=waves,
                                    beside=force_beside(part.beside, own)))
    return out


def force_beside(beside: Remainder | None, channels: Channels, bridge: float = 0.5) -> FloatArray | float:
    """Return the force (nt, n) of what a subsystem leaves out, by the measured motion, at rest before the record.

    Gaps of up to `bridge` periods are filled; in longer ones, and by motions that are not measured, there is none.
    """
    if beside is None:
        return 0.0
    seen, length = channels.one_each(), channels.y.shape[0]
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(2 * length, channels.dt), dtype=np.float64)
    gap, s = int(bridge * channels.period / channels.dt), 1j * np.maximum(omega, 1e-9)
    velocity = np.zeros((omega.size, beside.K.shape[1]), dtype=np.complex128)
    for column, dof, derivative in zip(seen.y.T, seen.dof, seen.derivative):
        y = np.nan_to_num(filled(column, gap, 3 * gap))
        velocity[:, dof] = s ** (1.0 - derivative) * np.fft.rfft(y - (y[0] if derivative == 0 else 0.0), 2 * length)
    force = np.einsum("wjk,wk->wj", beside.at(omega), velocity * (omega > 0.0)[:, None])
    return np.asarray(-np.fft.irfft(force, 2 * length, axis=0)[:length], dtype=np.float64)


def uncoupled(model: Model, least: float = 1e-3) -> list[list[int]]:
    """Return groups of degrees of freedom that are not coupled by `least` of the geometric mean of the diagonal."""
    return [group.tolist() for group in connected(coupled(model, least))]
