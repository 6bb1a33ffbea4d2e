"""Random seas from spectra, by FFT: the record repeats after its own length and has the exact spectrum on its bins."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len

from radiation_ss.arrays import ComplexArray, FloatArray, generator, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro import wave_number
from radiation_ss.methods import Brief


@dataclass(frozen=True, eq=False, repr=False)
class Sea(Brief):
    """A random sea as a sum of harmonics: elevation(t) = Re sum_k sum_d a_dk e^{i w_k t} at the origin."""

    dt: float  # Time step [s]
    samples: int  # Length of the record asked for
    period: int  # Length of the harmonic sum, samples or a little more (a length that the FFT likes)
    amplitudes: ComplexArray  # (n_dir, period // 2 + 1): Complex amplitudes [m] of the frequencies k / (period dt)
    # (n_dir,): Directions of propagation [rad]; None for a long-crested sea along the one direction that the body knows
    directions: FloatArray | None

    def __str__(self) -> str:
        way = "long-crested" if self.directions is None else f"{self.directions.size} direction(s)"
        return (f"Sea: {self.samples * self.dt:g} s every {self.dt:g} s, {way}, significant height "
                f"{4.0 * self.elevation.std():.3g} m")

    @property
    def time(self) -> FloatArray:
        """Sample times [s], from 0."""
        return self.dt * np.arange(self.samples, dtype=np.float64)

    @property
    def omega(self) -> FloatArray:
        """Circular frequencies of the harmonics [rad/s]."""
        return harmonics(self.period, self.dt)

    @property
    def elevation(self) -> FloatArray:
        """Wave elevation at the origin [m], shape (samples,)."""
        return self.signal(self.amplitudes.sum(axis=0))

    def elevation_at(self, x: float, y: float = 0.0, *, depth: float = np.inf, g: float = 9.81) -> FloatArray:
        """Return the wave elevation at another point, a wave probe [m], shape (samples,).

        A wave along direction b at (x, y) is a e^{i (w t - k (x cos b + y sin b))}, k by the dispersion relation.

        Parameters
        ----------
        x, y : float
            The point [m]. A sea without a direction of its own runs along x.
        depth, g : float
            Water depth [m], gravity [m/s^2].
        """
        along = np.zeros(1) if self.directions is None else self.directions
        path = x * np.cos(along) + y * np.sin(along)
        k = np.append(0.0, wave_number(self.omega[1:] ** 2 / g, depth))
        return self.signal(np.sum(self.amplitudes * np.exp(-1j * path[:, None] * k), axis=0))

    def signal(self, coefficients: ComplexArray) -> FloatArray:
        """Return Re sum_k h_k e^{i w_k t}, shape (..., samples), of coefficients of shape (..., period // 2 + 1)."""
        return harmonic_sum(coefficients, self.period)[..., : self.samples]


def harmonics(period: int, dt: float) -> FloatArray:
    """Return the circular frequencies [rad/s] of a sum that repeats after `period` steps of dt [s]."""
    return (2.0 * np.pi / (period * dt)) * np.arange(period // 2 + 1, dtype=np.float64)


def harmonic_sum(coefficients: ArrayLike, period: int) -> FloatArray:
    """Return Re sum_k h_k e^{2 pi i k t / period} for t = 0 .. period - 1, last axis."""
    half = np.array(coefficients, dtype=complex) * (0.5 * period)
    half[..., 0] *= 2.0
    if period % 2 == 0:
        half[..., -1] *= 2.0
    return irfft(half, n=period, axis=-1)


def realise(spectrum: Callable[[FloatArray], FloatArray], duration: float, dt: float, *,
            seed: int | np.random.Generator = 0, method: str = "phase",
            directions: Sequence[float] | FloatArray | None = None,
            spreading: ArrayLike | None = None, largest: int = 100_000_000) -> Sea:
    """Draw a random sea from a spectrum.

    Parameters
    ----------
    spectrum : callable
        S(w) [m^2 s/rad], one-sided; a `Spectrum` or any function of omega [rad/s].
    duration, dt : float
        Length and time step [s].
    seed : int or numpy.random.Generator
    method : str
        "phase": |a_k| = sqrt(2 S dw), random phase (the paper's; every record has the same energy). "amplitude":
        real and imaginary part of a_k are Gaussian with variance S dw (a Gaussian process also in short records).
    directions : array_like, shape (n_dir,), optional
        Directions of propagation [rad]; if absent a long-crested sea along the only direction of the body's X.
    spreading : array_like, shape (n_dir,), optional
        Share of the energy in each direction; sums to 1 (`force.cosine_spreading`).

    largest : int
        Most samples that are made.

    Returns
    -------
    Sea
        With `.time`, `.elevation`, `.amplitudes`.

    Raises
    ------
    InputError
        If times, method or shares are not usable, or the time step cuts off more than 1 % of the energy.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> sea = rss.realise(rss.jonswap(2.0, tp=8.0), 600.0, 0.25, seed=0)
    >>> sea.time.size, round(float(4.0 * sea.elevation.std()), 1)
    (2400, 2.0)
    """
    if not (dt > 0.0 and duration >= 2.0 * dt and np.isfinite(duration)):
        raise InputError(f"duration {duration:g} s, dt {dt:g} s: a positive step and at least two of them are needed")
    if duration > largest * dt:
        raise InputError(f"duration {duration:g} s, dt {dt:g} s: {duration / dt:.3g} samples, more than {largest:.4g}; "
                         "raise `largest` (each takes some hundred bytes of memory)")
    if method not in ("phase", "amplitude"):
        raise InputError(f"method: {method!r} is unknown; use 'phase' or 'amplitude'")
    headings = read_only(np.atleast_1d(0.0 if directions is None else directions), "directions [rad]", (None,))
    if np.abs(headings).max(initial=0.0) > 2.0 * np.pi + 1e-6:
        raise InputError(f"directions: {headings[np.abs(headings).argmax()]:g} rad is more than a turn; degrees are "
                         "given in radians, np.radians(...)")
    even = np.full(headings.size, 1.0 / headings.size)
    shares = even if spreading is None else read_only(spreading, "spreading", (None,))
    if shares.shape != headings.shape or shares.min() < 0.0 or abs(shares.sum() - 1.0) > 1e-6:
        raise InputError(f"spreading: {headings.size} shares that sum to 1 are needed, one for each direction")
    rng = generator(seed)
    samples = round(duration / dt)
    period = next_fast_len(samples, real=True)
    omega = harmonics(period, dt)
    energy = np.concatenate([[0.0], np.asarray(spectrum(omega[1:]), dtype=float)]) * omega[1]
    if period % 2 == 0:
        energy[-1] = 0.0  # a harmonic at the Nyquist frequency has no phase
    total = getattr(spectrum, "moment", None)
    if total is not None and energy.sum() < 0.99 * total(0) and spectrum.share(1e-3 * omega[-1], omega[-1]) < 0.99:  # type: ignore[attr-defined]
        raise InputError(f"dt: {dt:g} s keeps {energy.sum() / total(0):.1%} of the sea's energy; use a smaller step")
    shape = (headings.size, omega.size)
    size = np.sqrt(2.0 * energy * shares[:, None])
    if method == "phase":
        amplitudes = size * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, shape))
    else:
        amplitudes = size * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)
    return Sea(float(dt), samples, period, amplitudes, None if directions is None else headings)
