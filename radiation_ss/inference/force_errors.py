"""Errors of a record's own exciting force: of size, of phase, of X where waves make it; and the noise in it."""

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import natural_modes
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.readings import driven_up_to
from radiation_ss.inference.sensor_noise import coloured_noise
from radiation_ss.records.signals import middle, whole
from radiation_ss.simulation.headings import computed, force_of_waves
from radiation_ss.waves.force import on_all


def force_errors(model: Model, run: MeasuredMotion, i: int) -> list[tuple[str, FloatArray]]:
    """Return what errors of size and phase of a record's own force would add to it."""
    if run.force is None or run.prescribed or not np.any(run.force[i]):
        return []
    late = -np.gradient(run.force[i], run.dt) / natural_frequency(model, i)
    return [("force of the record", run.force[i]), ("phase of the record", late)]


def shape_errors(model: Model, run: MeasuredMotion, i: int, octaves: float = 0.6,
                 least: float = 0.01) -> list[tuple[str, FloatArray]]:
    """Return what smooth errors of X would add to a force of waves: in phase with the elevation, and a quarter period
    before it.

    Between centres so far apart they go linearly. They are of the size of the force about a centre, not at each
    frequency: where X passes through zero its errors do not. `least`: share of the force's energy there that counts.
    """
    if run.force is None or not computed(model, run.record) or not np.any(run.force[i]):
        return []
    omega, forces = spectra(run, run.force)
    wave = wave_of(model, run, i)
    at = np.log2(np.maximum(omega, 1e-9) / run.omega[i]) / octaves
    energy, waves = np.abs(forces[i]) ** 2, np.abs(wave) ** 2
    centres = np.arange(np.floor(at[1]), np.ceil(at[-1]) + 1.0)
    near = np.clip(1.0 - np.abs(at - centres[:, None]), 0.0, 1.0)
    told = (near @ energy > least * energy.sum()) & (near @ waves > 0.0)
    if not told.any():  # a constant force
        return []
    size = np.exp(np.interp(at, centres[told], 0.5 * np.log(near[told] @ energy / (near[told] @ waves))))
    return [(f"X {k:.0f} {word}", np.fft.irfft(part * size * turned * wave)[: run.time.size])
            for k, part in zip(centres[told], near[told]) for word, turned in (("size", 1.0), ("phase", 1j))]


def wave_of(model: Model, run: MeasuredMotion, i: int, least: float = 1e-2) -> ComplexArray:
    """Return the spectrum of the waves at the body: of the elevation, or what the forces and X say of it, or the force
    on motion i itself where the model has no X for this record. X of less than the share `least` tells little.
    """
    if np.any(run.elevation):
        return spectra(run, run.elevation)[1]
    assert run.force is not None
    omega, forces = spectra(run, run.force)
    known = model.hydro
    if known is None or known.X is None or run.record.speed:
        return np.asarray(forces[i])
    try:
        X = on_all(known.omega, force_of_waves(model, run.record), omega).T
    except InputError:  # X is for other directions; the record's own force needs none
        return np.asarray(forces[i])
    scale = np.maximum(np.abs(X).max(axis=1, keepdims=True), 1e-300)
    X, forces = X / scale, np.where(np.any(forces, axis=1, keepdims=True), forces / scale, 0.0)
    return np.asarray(np.sum(X.conj() * forces, axis=0) / (np.sum(np.abs(X) ** 2, axis=0) + least**2))


def typical_frequency(model: Model, run: MeasuredMotion, i: int) -> float:
    """Return the typical frequency of a motion [rad/s]; of one that is mostly a drift, slower than its natural
    frequency and the force that is known, the lower of these.
    """
    own, natural = float(run.omega[i]), natural_frequency(model, i) if model.C[i, i] > 0.0 else np.inf
    if run.force is None or not np.any(run.force[i]):
        return own
    return max(own, min(middle(*spectra(run, run.force[i])), natural))


def spectra(run: MeasuredMotion, values: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Return circular frequencies [rad/s], and spectra of signals without their means, padded to twice their length."""
    size = 2 * run.time.size
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, run.dt)
    return np.asarray(omega), np.asarray(np.fft.rfft(values - values.mean(axis=-1, keepdims=True), size))


def recorded_noise(model: Model, run: MeasuredMotion, i: int, at: FloatArray) -> FloatArray:
    """Return the standard deviations a sample of the noise in a recorded exciting force at frequencies `at` [rad/s]."""
    if run.force is None or run.prescribed or not np.any(run.force[i]):
        return np.zeros_like(at)
    values, step = recorded_force(model, run, i)
    fastest = max(float(run.omega[i]), driven_up_to(model, run.record, i))  # of force and motion
    return np.asarray(coloured_noise(values, step, fastest, at) * np.sqrt(step / run.dt))


def recorded_force(model: Model, run: MeasuredMotion, i: int) -> tuple[FloatArray, float]:
    """Return an exciting force and its step [s], as read: between readings there is no noise of high frequency."""
    assert run.force is not None
    recorded, time = run.record.get("force", [model.dofs[i]]), run.record.time
    if recorded is None:
        return run.force[i], run.dt
    step = float(np.median(np.diff(time)))
    return whole(time, recorded[0], np.arange(time[0], time[-1] + 0.5 * step, step)), step


def noise_at_resonance(model: Model, run: MeasuredMotion, i: int) -> FloatArray:
    """Return the noise of a recorded force at a narrow resonance of its motion, by its Fourier components (k, nt).

    Each has one standard deviation. What they move goes on for longer than a block of the rows lasts: the errors that
    they make of one block and the next are not independent.
    """
    omega, time = narrow_resonance(model, run, i), run.time - run.time[0]
    size = np.sqrt(2.0 / time.size) * recorded_noise(model, run, i, omega)[:, None]
    found = np.concatenate([size * wave(omega[:, None] * time) for wave in (np.cos, np.sin)])
    return np.asarray(found[np.any(found, axis=1)])


def narrow_resonance(model: Model, run: MeasuredMotion, i: int, narrow: float = 0.25, wide: float = 2.0) -> FloatArray:
    """Return the frequencies of a record at a resonance of one motion that rings for longer than a block lasts, (k,).

    `narrow`: rate of decay, in widths of a bin, from which the blocks are taken as independent. `wide`: half the band,
    in rates of decay or in what the record tells apart.
    """
    modes, bins, apart = natural_modes(model), run.basis[0].omega, 2.0 * np.pi / (run.time[-1] - run.time[0])
    omega, ratio = 2.0 * np.pi / modes.period[i], modes.ratio[i]
    rate = ratio * omega / np.sqrt(np.maximum(1.0 - ratio**2, 1e-12))
    if not rate <= narrow * 2.0 * bins[0] or omega > bins[-1]:  # without a resonance the rate is nan
        return np.zeros(0)
    at = np.asarray(apart * np.arange(1, int(bins[-1] / apart) + 1), dtype=np.float64)
    return at[np.abs(at - omega) <= wide * max(rate, apart)]
