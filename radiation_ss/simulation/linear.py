"""Linear response of a floating body to a sampled force: exact for a force that is linear between its samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_continuous_lyapunov
from scipy.signal import fftconvolve

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.body.composite import signal_names, system_matrices
from radiation_ss.body.convert import opened
from radiation_ss.body.model import Model
from radiation_ss.body.time_step import hold_matrices
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import impulse_response, square_root
from radiation_ss.methods import accepting

if TYPE_CHECKING:
    import control as ct


@dataclass(frozen=True, eq=False)
class ExactStep:
    """Exact step x_(k+1) = F x_k + before u_k + after u_(k+1) of x' = f x + g u with u linear in between."""

    F: FloatArray
    before: FloatArray
    after: FloatArray
    dt: float


def exact_step(f: FloatArray, g: FloatArray, dt: float) -> ExactStep:
    """Return the exact step of x' = f x + g u, shapes (N, N) and (N, n_in), over dt [s]."""
    F, held, after = hold_matrices(f, g, dt)
    return ExactStep(np.ascontiguousarray(F), held - after, after, float(dt))


def propagate(step: ExactStep, u: FloatArray, x0: FloatArray) -> FloatArray:
    """Return the states (nt, N) at every sample of an input (nt, n_in), from x0 (N,) at the first."""
    from radiation_ss.simulation.integrator import run_linear

    x = np.empty((u.shape[0], x0.size))
    x[0] = x0
    x[1:] = u[:-1] @ step.before.T + u[1:] @ step.after.T
    run_linear(step.F, x)
    return x


@dataclass(frozen=True, eq=False)
class Kernel:
    """Outputs from rest by a unit of one input at one sample: at the first one, and at any later one.

    Both have the shape (outputs, inputs, nt). Before the first sample the input is zero without a slope to it.
    """

    first: FloatArray
    later: FloatArray

    @classmethod
    def of(cls, step: ExactStep, H: FloatArray, nt: int) -> Kernel:
        """Return the kernel of the outputs H x at nt samples."""
        unit, inputs = np.zeros((nt, step.after.shape[1])), range(step.after.shape[1])
        first, later = np.empty((2, H.shape[0], len(inputs), nt))
        for j in inputs:
            unit[0] = np.eye(len(inputs))[j]
            for found, start in ((first, np.zeros(H.shape[1])), (later, step.after[:, j])):
                found[:, j] = H @ propagate(step, unit, start).T
        return cls(first, later)

    def respond(self, u: FloatArray) -> FloatArray:
        """Return the outputs (outputs, nt) of inputs (inputs, nt), by the fast Fourier transform."""
        acts = np.flatnonzero(np.any(u, axis=1))
        if not acts.size:
            return np.zeros((self.later.shape[0], u.shape[1]))
        begun = np.einsum("ijt,j->it", self.first[:, acts], u[acts, 0])
        rest = np.where(np.arange(u.shape[1]) == 0, 0.0, u[acts])
        moved = fftconvolve(self.later[:, acts], rest[None], axes=2)[:, :, :u.shape[1]]
        return np.asarray(begun + moved.sum(axis=1))


def respond(step: ExactStep, H: FloatArray, J: FloatArray, u: FloatArray, x0: FloatArray, *, chunk: int = 1 << 13,
            ill_conditioned: float = 1e5) -> FloatArray:
    """Return the outputs H x + J u at every sample, shape (n_out, nt), of inputs (n_in, nt), mode by mode.

    One mode for a conjugate pair, real and imaginary parts below each other in real arrays. With eigenvectors of a
    condition above `ill_conditioned` modes lose digits: states are stepped together. `chunk` samples stay in the cache.
    """
    from radiation_ss.simulation.integrator import run_modes

    poles, vectors = np.linalg.eig(step.F)
    last, y = u.shape[1] - 1, J @ u if J.any() else np.zeros((J.shape[0], u.shape[1]))
    if not poles.size or not np.linalg.cond(vectors) < ill_conditioned:
        return y + H @ propagate(step, u.T, x0).T
    kept = np.flatnonzero(poles.imag >= 0.0)
    if kept.size % 2:  # the kernel takes modes two by two: a mode that is not read completes the last pair
        kept = np.append(kept, kept[-1])
    inverse = np.linalg.inv(vectors)[kept]
    rows = (H @ vectors[:, kept]) * np.where(poles[kept].imag == 0.0, 1.0, 2.0)
    if np.unique(kept).size < kept.size:
        rows[:, -1] = 0.0
    real, imag = poles[kept].real.copy(), poles[kept].imag.copy()
    drive, z = (np.concatenate([values.real, values.imag])
                for values in (inverse @ np.hstack([step.before, step.after]), inverse @ x0))
    out = np.hstack([rows.real, -rows.imag])
    y[:, 0] += out @ z
    for start in range(0, last, chunk):
        stop = min(start + chunk, last)
        w = drive @ np.concatenate([u[:, start:stop], u[:, start + 1:stop + 1]])
        run_modes(real, imag, w, z)
        y[:, start + 1:stop + 1] += out @ w
    return y


@accepting(plant=opened)
def linear_response(plant: Model | ct.StateSpace, time: ArrayLike, force: ArrayLike, *, x0: ArrayLike | None = None,
                    displacement: ArrayLike | None = None, velocity: ArrayLike | None = None) -> ct.TimeResponseData:
    """Return the motion under a sampled force, exact for a force that is linear between its samples.

    The same numbers as `control.forced_response`, some hundred times faster, with any sampling (jitter included).

    Parameters
    ----------
    plant : Model or control.StateSpace
        A model (outputs as `cummins`: displacements, velocities, accelerations) or any continuous system.
    time : array_like, shape (nt,)
        Ascending times [s].
    force : array_like, shape (n, nt) or (nt,)
        Force at the times [N, N m] (or the system's inputs).
    x0 : array_like, shape (N,), optional
        The whole initial state.
    displacement, velocity : array_like, shape (n,), optional
        Initial motion of a Model instead of `x0`; its memory starts at rest (no motion before the first sample).

    Raises
    ------
    InputError
        If shapes differ, times do not ascend, a value is not finite, or the system is discrete.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0)
    >>> time = np.linspace(0.0, np.pi, 200)
    >>> motion = rss.linear_response(model, time, np.zeros(200), displacement=[0.1])
    >>> round(float(motion.outputs[0, -1]), 5)
    0.1
    """
    import control as ct

    f, g, H, J, inputs, outputs = continuous_matrices(plant)
    t, u = np.asarray(time, dtype=float), np.atleast_2d(np.asarray(force, dtype=float))
    if t.ndim != 1 or u.shape != (g.shape[1], t.size):
        raise InputError(f"force: shape {u.shape} found, ({g.shape[1]}, {t.size}) needed: inputs by times")
    if not np.isfinite(t.sum() + u.sum()):
        raise InputError("time, force: every value must be finite; fill or cut missing samples first")
    steps = np.diff(t)
    if steps.size == 0 or steps.min() <= 0.0:
        raise InputError("time: at least two ascending times [s] are needed")
    start = initial_state(plant, x0, displacement, velocity, f.shape[0])
    if steps.max() - steps.min() <= 1e-6 * steps[0]:
        y = respond(exact_step(f, g, (t[-1] - t[0]) / steps.size), H, J, u, start)
    else:
        y = respond_unevenly(f, g, H, J, t, u, start)
    return ct.TimeResponseData(t, y, None, u, issiso=(H.shape[0] == g.shape[1] == 1), output_labels=outputs,
                               input_labels=inputs, plot_inputs=False)


def continuous_matrices(plant: Model | ct.StateSpace) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray,
                                                               list[str], list[str]]:
    """Return (f, g, H, J) and the signal names of a Model or of a continuous ct.StateSpace."""
    if isinstance(plant, Model):
        inputs, outputs = signal_names(plant.dofs)
        return (*system_matrices(plant), list(inputs), list(outputs))
    if not plant.isctime():
        raise InputError(f"plant: {plant.name} is discrete (dt = {plant.dt}); a continuous system is needed")
    return plant.A, plant.B, plant.C, plant.D, list(plant.input_labels), list(plant.output_labels)


def initial_state(plant: Model | ct.StateSpace, x0: ArrayLike | None, displacement: ArrayLike | None,
                  velocity: ArrayLike | None, size: int) -> FloatArray:
    """Return the initial state, shape (size,), from the whole state or from a Model's initial motion."""
    if displacement is None and velocity is None:
        return np.zeros(size) if x0 is None else read_only(np.atleast_1d(np.asarray(x0, dtype=float)), "x0", (size,))
    if x0 is not None:
        raise InputError("x0: give either the whole state or displacement and velocity, not both")
    if not isinstance(plant, Model):
        raise InputError("displacement, velocity: known for a Model only; give x0 for a general system")
    state = np.zeros(size)
    n = plant.n
    for value, at, label in ((displacement, size - 2 * n, "displacement"), (velocity, size - n, "velocity")):
        if value is not None:
            state[at:at + n] = read_only(np.atleast_1d(np.asarray(value, dtype=float)), label, (n,))
    return state


def respond_unevenly(f: FloatArray, g: FloatArray, H: FloatArray, J: FloatArray, t: FloatArray, u: FloatArray,
                     x0: FloatArray) -> FloatArray:
    """Return the outputs for uneven times: one exact step for each different time step (to 1e-11 of the median)."""
    grain = 1e-11 * float(np.median(np.diff(t)))
    different, which = np.unique(np.round(np.diff(t) / grain), return_inverse=True)
    steps, states = [exact_step(f, g, length * grain) for length in different], np.empty((t.size, x0.size))
    states[0] = x0
    for k, step in enumerate(steps[i] for i in which):
        states[k + 1] = step.F @ states[k] + step.before @ u[:, k] + step.after @ u[:, k + 1]
    return H @ states.T + J @ u


def radiation_states(model: Model, raw: FloatArray, dt: float, finer: int = 4) -> FloatArray:
    """Return the radiation states along a displacement, from rest, (m, nt): with q = x_r - b xi, q' = a q + a b xi.
    Exact for lines between `finer` points a sample of a spline; between samples they lose (w dt)^2/12 of the motion.
    """
    samples = raw.shape[1]
    if model.fit.states == 0:
        return np.zeros((0, samples))
    fine = CubicSpline(np.arange(samples), raw, axis=1)(np.arange(finer * (samples - 1) + 1) / finer)
    fit, shift = model.fit, model.fit.b @ fine
    q = propagate(exact_step(fit.a, fit.a @ fit.b, dt / finer), fine.T, -shift[:, 0]).T
    return np.ascontiguousarray((q + shift)[:, ::finer])  # a view would keep the fine path


def left_over(model: Model, time: FloatArray, v: FloatArray, least: float = 1e-2) -> FloatArray:
    """Return radiation forces of a motion before the record, one standard deviation each, shape (k, n, nt).

    The states have the covariance P that white velocities of the motion's size make; the directions are the principal
    ones of P and the observability Gramian, down to a share `least` of the largest.
    """
    fit = model.fit
    if fit.states == 0:
        return np.zeros((0, *v.shape))
    spread = fit.b @ np.diag(np.mean(v**2, axis=1)) @ fit.b.T
    P = solve_continuous_lyapunov(fit.a, -spread * 2.0 / max(-np.linalg.eigvals(fit.a).real.max(), 1e-9))
    size = np.sqrt(np.maximum(np.einsum("is,st,it->i", fit.c, P, fit.c), 0.0))
    root = square_root(P)
    seen = fit.c / np.where(size > 0.0, size, np.inf)[:, None]  # no radiation acts on a motion that makes no waves
    Q = solve_continuous_lyapunov(fit.a.T, -seen.T @ seen)
    lasts, turned = np.linalg.eigh(root.T @ Q @ root)
    keep = np.flatnonzero(lasts > least**2 * max(lasts[-1], 1e-300))[::-1]
    lasting = min(time.size, int(4.0 / max(-np.linalg.eigvals(fit.a).real.max(), 1e-9) / (time[1] - time[0])) + 2)
    found, after = np.zeros((keep.size, v.shape[0], time.size)), (time[1] - time[0]) * np.arange(lasting)
    found[:, :, :lasting] = impulse_response(fit.a, (root @ turned)[:, keep], fit.c, after).T
    return found
