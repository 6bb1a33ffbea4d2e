"""Discrete-time systems, with a report of what the time step does to them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray, generator, positive
from radiation_ss.body.composite import cummins
from radiation_ss.body.convert import opened
from radiation_ss.body.model import Model
from radiation_ss.body.time_step import Matrices
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response, impulse_response
from radiation_ss.fit.result import RadiationFit
from radiation_ss.methods import Brief, accepting

if TYPE_CHECKING:
    import control as ct

METHODS = ("foh", "zoh", "tustin")
FINE = 16  # fine steps of the convolution in one time step
LONGEST = 4000  # time steps of the comparison with the convolution


@dataclass(frozen=True, eq=False, repr=False)
class Sampled(Brief):
    """A discrete-time system and what sampling did to it; picklable, `.to_ss()` is the ct.StateSpace."""

    # A, B, C, D: x_(k+1) = A x_k + B u_k, y_k = C x_k + D u_k
    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    dt: float  # Time step [s]
    method: str
    # omega, error (nw,): Frequencies up to pi/dt [rad/s] and, at each, the error of the frequency response (largest
    # singular value, relative to that of the continuous system)
    omega: FloatArray
    error: FloatArray
    # Smallest eigenvalue of the Hermitian part over the frequencies, relative to the largest, of the continuous and of
    # the sampled system; from force to velocity for a model. None where inputs and outputs do not pair up.
    passivity: tuple[float, float] | None
    # Relative rms error of the response to a random input with frequencies up to `band`, against the convolution
    # integral; nan where that does not settle: a system that is not stable, a body without restoring
    convolution_error: float
    band: float  # [rad/s]
    # inputs, outputs, states, name: Of the continuous system
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    name: str

    @property
    def stable(self) -> bool:
        """All poles inside the unit circle."""
        return bool(np.all(np.abs(np.linalg.eigvals(self.A)) < 1.0))

    @property
    def drifts(self) -> bool:
        """Not stable, but only by poles at z = 1: what has no restoring, as a free body in Surge, rests anywhere."""
        poles, off = np.linalg.eigvals(self.A), 1e-5  # a double pole is found as far off as the root of the rounding
        return not self.stable and bool(np.all(np.abs(poles[np.abs(poles) >= 1.0 - off] - 1.0) < off))

    @property
    def passive(self) -> bool | None:
        """The sampled system gives no energy, looked up on a dense grid; None where that has no meaning."""
        return None if self.passivity is None else (self.stable or self.drifts) and self.passivity[1] >= -1e-9

    @property
    def bandwidth(self) -> float:
        """Frequency up to which the error stays below 1 % [rad/s]; 0 if nowhere."""
        good = np.logical_and.accumulate(self.error <= 0.01)
        return float(self.omega[good].max(initial=0.0))

    def error_at(self, omega: float) -> float:
        """Return the relative error of the frequency response at a frequency [rad/s]."""
        return float(np.interp(omega, self.omega, self.error))

    def to_ss(self) -> "ct.StateSpace":
        """Return the discrete-time ct.StateSpace, signals named as in the continuous system.

        With "foh" the state is x_k - after u_k, not x_k: map an initial state so; outputs are the same.
        """
        import control as ct

        return ct.ss(self.A, self.B, self.C, self.D, self.dt, inputs=list(self.inputs), outputs=list(self.outputs),
                     states=list(self.states), name=self.name)

    def __str__(self) -> str:
        convolution = ("none, as it does not settle" if np.isnan(self.convolution_error)
                       else f"{self.convolution_error:.2e}")
        drifts = "stable but for poles at z = 1: no restoring, it drifts" if self.drifts else "NOT stable"
        lines = [f"{self.name} sampled by {self.method} at dt = {self.dt:g} s (Nyquist {np.pi / self.dt:.4g} rad/s)",
                 f"  frequency response within 1 % up to {self.bandwidth:.4g} rad/s; "
                 f"error {self.error_at(self.band):.2%} at {self.band:.4g} rad/s",
                 f"  against the convolution integral, input up to {self.band:.4g} rad/s: {convolution}",
                 f"  {'stable' if self.stable else drifts}"]
        if self.passivity is not None:
            before, after = self.passivity
            lines.append(f"  smallest Hermitian eigenvalue over the largest: continuous {before:.1e}, sampled "
                         f"{after:.1e} ({'passive' if self.passive else 'NOT passive'})")
        return "\n".join(lines)


@accepting(plant=opened)
def sampled(plant: "Model | RadiationFit | ct.StateSpace", dt: float, method: str = "foh", *,
            band: float | None = None, seed: int = 0) -> Sampled:
    """Discretise a system and report what the time step does: frequency error, passivity, error against convolution.

    Parameters
    ----------
    plant : Model, RadiationFit or control.StateSpace
        Continuous.
    dt : float
        Time step [s].
    method : str
        "foh": exact for an input that is linear between samples (no delay; for simulation). "zoh": exact for an input
        held over the step (an actuator behind a D/A converter; lags by half a step). "tustin": bilinear; keeps
        passivity exactly, warps frequencies.
    band : float, optional
        Highest frequency of interest [rad/s]; by default that of the fastest pole, at most 0.5/dt.
    seed : int
        Of the random input for the convolution.

    Raises
    ------
    InputError
        If dt or method is not usable or the system is discrete already.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), gyradius=0.07)
    >>> data = section.select("Heave").times(0.3)
    >>> discrete = rss.sampled(rss.fit_radiation(data, 3), 0.01, "tustin")
    >>> discrete.passive
    True
    """
    from scipy.signal import cont2discrete

    dt = positive(dt, "dt", "s")
    if method not in METHODS:
        raise InputError(f"method: {method!r} is unknown; use one of {', '.join(METHODS)}")
    system: ct.StateSpace = (cummins(plant) if isinstance(plant, Model)
                             else plant.to_ss() if isinstance(plant, RadiationFit) else plant)
    if not system.isctime():
        raise InputError(f"plant: {system.name} is discrete already (dt = {system.dt})")
    continuous = (system.A, system.B, system.C, system.D)
    discrete: Matrices = cont2discrete(continuous, dt, "bilinear" if method == "tustin" else method)[:4]
    omega = np.concatenate([np.geomspace(1e-4, 0.02, 60)[:-1], np.linspace(0.02, 0.999, 900)]) * np.pi / dt
    exact = frequency_response(system.A, system.B, system.C, omega) + system.D
    F, G, H, J = discrete
    resolvent = np.exp(1j * omega * dt)[:, None, None] * np.eye(len(F)) - F
    found = np.asarray(H @ np.linalg.solve(resolvent, G.astype(complex)[None]) + J, dtype=complex)
    poles = np.linalg.eigvals(system.A) if system.nstates else np.zeros(1)
    usual = float(min(max(np.abs(poles).max(), 1e-3 / dt), 0.5 / dt))
    band = usual if band is None else positive(band, "band", "rad/s")
    rows = None     # outputs whose product with the inputs is power; none where they do not pair up
    if isinstance(plant, Model):
        rows = slice(plant.n, 2 * plant.n)
    elif system.noutputs == system.ninputs:
        rows = slice(0, system.ninputs)
    passivity = None if rows is None else (hermitian_floor(exact[:, rows]), hermitian_floor(found[:, rows]))
    stable = bool(np.all(poles.real < -1e-9 * np.abs(poles).max()))
    return Sampled(*discrete, dt=float(dt), method=method, omega=omega, error=relative_error(exact, found),
                   passivity=passivity, band=band, inputs=tuple(system.input_labels),
                   outputs=tuple(system.output_labels), states=tuple(system.state_labels),
                   name=f"{system.name}_sampled",
                   convolution_error=convolution_error(continuous, discrete, dt, band, seed) if stable else np.nan)


def relative_error(exact: ComplexArray, found: ComplexArray) -> FloatArray:
    """Return the largest singular value of the error over the exact response's, (nw,), signals of any unit alike."""
    size = np.abs(exact).max(axis=0)
    scale = np.ones_like(size)
    for axis in (1, 0, 1, 0):
        most = (size / scale).max(axis=axis, keepdims=True)
        scale = scale * np.where(most > 0.0, most, 1.0)
    return np.linalg.norm((found - exact) / scale, 2, axis=(1, 2)) / np.linalg.norm(exact / scale, 2, axis=(1, 2))


def hermitian_floor(K: ComplexArray) -> float:
    """Return the smallest eigenvalue of the Hermitian part over all frequencies, relative to the largest; at best 0."""
    scale = np.sqrt(np.maximum(np.abs(np.einsum("wii->wi", K).real).max(axis=0), 1e-300))
    K = K / scale / scale[:, None]
    values = np.linalg.eigvalsh(0.5 * (K + np.conj(np.swapaxes(K, 1, 2))))
    return min(float(values.min()) / max(float(values.max()), 1e-300), 0.0)


def convolution_error(continuous: Matrices, discrete: Matrices, dt: float, band: float, seed: int) -> float:
    """Return the relative rms error of the response to 40 random sines up to `band`, against the convolution."""
    from scipy.signal import dlsim, fftconvolve

    a, b, c, d = continuous
    n_in = d.shape[1]
    slowest = float(np.min(-np.linalg.eigvals(a).real))
    steps = int(np.clip(6.0 / (slowest * dt), 200, LONGEST))
    rng = generator(seed)
    w, size = rng.uniform(0.0, band, (n_in, 40, 1)), rng.standard_normal((n_in, 40, 1))
    fine = dt / FINE * np.arange(steps * FINE + 1)
    u = np.sum(size * np.sin(w * fine), axis=1)
    kernel = impulse_response(a, b, c, fine) * (dt / FINE)
    along = u.T[:, None]
    full = fftconvolve(kernel, along, axes=0)[: fine.size] - 0.5 * kernel[0] * along
    truth = d @ u[:, ::FINE] + full.sum(axis=2)[::FINE].T
    y = dlsim((*discrete, dt), u[:, ::FINE].T)[1].T
    rms = np.sqrt(np.mean(truth**2, axis=1, keepdims=True))
    return float(np.sqrt(np.mean(((y - truth) / np.where(rms > 0.0, rms, 1.0)) ** 2)))
