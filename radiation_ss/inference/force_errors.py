"""What errors of a record's own exciting force would add to it: of size, of phase, and of X where waves make it."""

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.records.signals import middle
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
