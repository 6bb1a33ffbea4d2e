"""Haskind's relation: the size of the exciting force with the damping; its errors; the motion that it makes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.hydro.linear_waves import group_velocity, wave_number
from radiation_ss.identification.sea import bumps_about
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import interpolate

BUMPS = 5  # In the error of log X, over two octaves


@dataclass(frozen=True, eq=False)
class Haskind:
    """|X_j(w)|^2 goes with B_jj(w) from the model's own values; the phase of X is taken as known."""

    X: ComplexArray  # (nw, n): The model's exciting force per metre wave amplitude
    damping: FloatArray  # (nw, n): The model's B_jj
    source: str  # Where X is from
    # Share of the largest damping below which X does not follow it: where a force changes sign, B_jj is next to nothing
    # and its relative change means nothing
    floor: float = 0.01

    def part(self, dofs: Sequence[int]) -> "Haskind":
        """Return the relation of some degrees of freedom."""
        return replace(self, X=self.X[:, dofs], damping=self.damping[:, dofs])

    def exciting_force(self, B: FloatArray) -> ComplexArray:
        """Return X for the dampings B_jj, shape (..., nw, n); dampings at or below zero give almost none."""
        least = self.floor * np.abs(self.damping).max(axis=0)
        return np.asarray(self.X * np.sqrt(positive(B, least) / positive(self.damping, least)))

    def log_slope(self, B: FloatArray) -> FloatArray:
        """Return d log X_j / d B_jj at the dampings B_jj, shape (..., nw, n)."""
        return 0.5 / np.maximum(B, self.floor * np.abs(self.damping).max(axis=0))


def positive(values: FloatArray, floor: FloatArray) -> FloatArray:
    """Return values above `floor` as they are, below it a smooth positive continuation."""
    below = np.minimum(values / floor - 1.0, 0.0)
    return np.where(values > floor, values, floor * np.exp(below))


def relation(model: Model, form: Parametrisation, omega: FloatArray) -> tuple[Haskind, tuple[str, ...]]:
    """Return Haskind's relation at omega [rad/s], with the damping of the prior mean, and warnings.

    The model's own X, which holds for a section and for a body alike. Without one that of a section, |X|^2 = 2 rho g
    c_g B per metre of length: then the wave height is only known up to the root of the length.
    """
    table = model.hydro
    rho, g, depth = (table.rho, table.g, table.depth) if table is not None else (1000.0, 9.81, np.inf)
    damping = np.einsum("wjj->wj", form.K(form.mean, omega).real)
    if table is None or table.X is None:
        water = "" if table is not None else " in deep water"
        warning = (f"the model has no wave excitation force X: Haskind's two-dimensional relation{water} is used for "
                   "a length of 1 m, so the wave heights are in units of the square root of the length")
        speed = group_velocity(omega, wave_number(omega**2 / g, depth), depth)[:, None]
        size = positive(damping, 1e-4 * np.abs(damping).max(axis=0)) * speed
        return Haskind(np.sqrt(2.0 * rho * g * size).astype(complex), damping, "2-D"), (warning,)
    inside = np.clip(omega, table.omega[0], table.omega[-1])
    return Haskind(interpolate(table.omega, table.X[:, 0, :], inside), damping, "X of the model"), ()


def error_bumps(frequency: float, omega: FloatArray) -> FloatArray:
    """Return shapes of the error of log X at omega [rad/s], from half to twice `frequency`, (BUMPS, nw)."""
    return bumps_about(frequency * np.exp(np.linspace(-0.7, 0.7, BUMPS)), omega)


@dataclass(frozen=True, eq=False)
class RelativeErrors:
    """Smooth complex errors of log X of some degrees of freedom against the others; what all share is the sea's."""

    contrasts: FloatArray  # (n, m): Of the model's degrees of freedom, each of the errors' standard deviation
    frequency: float  # Of the motion [rad/s]

    @classmethod
    def of(cls, n: int, seen: np.ndarray, error: float, frequency: float) -> "RelativeErrors":
        """Return the errors of standard deviation `error` of the degrees of freedom `seen` of n."""
        out = np.zeros((n, seen.size - 1 if error > 0.0 else 0))
        out[seen] = error * null_space(np.ones((1, seen.size)))[:, :out.shape[1]]
        return cls(out, frequency)

    @property
    def size(self) -> int:
        """Number of parameters, standard normal: of the real parts, then of the imaginary ones."""
        return 2 * BUMPS * self.contrasts.shape[1]

    def applied(self, v: FloatArray, haskind: Haskind, omega: FloatArray) -> Haskind:
        """Return Haskind's relation at omega [rad/s] with the errors of parameters v."""
        if not self.size:
            return haskind
        parts = v.reshape(2, -1, BUMPS) @ error_bumps(self.frequency, omega)
        return replace(haskind, X=haskind.X * np.exp((parts[0] + 1j * parts[1]).T @ self.contrasts.T))

    def slopes(self, alone: ComplexArray, omega: FloatArray) -> ComplexArray:
        """Return the derivatives (size, nw, n) of motions, of those that each X makes alone, (n, nw, n)."""
        bumps = error_bumps(self.frequency, omega)
        real = np.einsum("jwk,jc,bw->cbwk", alone, self.contrasts, bumps).reshape(-1, *alone.shape[1:])
        return np.concatenate([real, 1j * real])


def receptance_times_X(model: Model, form: Parametrisation, u: FloatArray, w: FloatArray,
                       haskind: Haskind) -> tuple[ComplexArray, ComplexArray]:
    """Return X and the displacements that it makes, each (..., nw, n), per wave amplitude."""
    inertia, stiffness = form.rigid(u, model.M + model.A_inf, model.C)
    K = form.K(form.theta(u), w)
    X = haskind.exciting_force(np.einsum("...wjj->...wj", K.real))
    s = 1j * w[:, None, None]
    impedance = stiffness[..., None, :, :] + s**2 * inertia[..., None, :, :] + s * (K + model.D)
    if model.n == 1:
        return X, np.asarray(X / impedance[..., 0])
    return X, np.asarray(np.linalg.solve(impedance, X[..., None])[..., 0], dtype=np.complex128)


def motion_slopes(model: Model, form: Parametrisation, u: FloatArray, w: FloatArray, haskind: Haskind,
                  chunk: int = 8) -> tuple[ComplexArray, Iterator[tuple[slice, ComplexArray]]]:
    """Return the displacements per wave amplitude (nw, n); their derivatives (m, nw, n) by u, some at a time."""
    step, s = 1e-5, 1j * w[:, None]
    X, motion = receptance_times_X(model, form, u, w, haskind)
    around = u + step * np.concatenate([np.eye(u.size), -np.eye(u.size)])
    theta, inertia, stiffness = ((half[:u.size] - half[u.size:]) / (2.0 * step) for half in (
        form.theta(around), *form.rigid(around, model.M + model.A_inf, model.C)))
    at = form.theta(u)
    K, by_theta = form.K(at, w), np.zeros((at.size, *motion.shape), dtype=complex)
    follows, velocity = X * haskind.log_slope(np.einsum("wjj->wj", K.real)), s * motion
    for which, (j, k), dK in form.slopes(at, w):
        by_theta[which, :, j] -= dK * velocity[:, k]
        if j == k:
            by_theta[which, :, j] += dK.real * follows[:, j]
        else:
            by_theta[which, :, k] -= dK * velocity[:, j]
    nominal = form.rigid(u, model.M + model.A_inf, model.C)
    receptance = np.linalg.inv(nominal[1] + s[..., None] ** 2 * nominal[0] + s[..., None] * (K + model.D))

    def some() -> Iterator[tuple[slice, ComplexArray]]:
        """Yield chunks that stay in the processor's cache."""
        for start in range(0, u.size, chunk):
            rows = slice(start, min(start + chunk, u.size))
            force = (theta[rows] @ by_theta.view(float).reshape(at.size, -1)).view(np.complex128)
            force = force.reshape(-1, *motion.shape)
            for i in np.flatnonzero(np.any(inertia[rows], axis=(1, 2)) | np.any(stiffness[rows], axis=(1, 2))):
                force[i] -= s**2 * (motion @ inertia[start + i].T) + motion @ stiffness[start + i].T
            # Many small matrices, which `@` takes one by one.
            yield rows, np.asarray(sum(receptance[..., j] * force[..., j, None] for j in range(model.n)))

    return motion, some()
