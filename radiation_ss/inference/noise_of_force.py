"""The noise of a recorded exciting force, and what of it a narrow resonance feels."""

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import natural_modes
from radiation_ss.body.model import Model
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.readings import driven_up_to
from radiation_ss.inference.sensor_noise import coloured_noise
from radiation_ss.records.signals import whole


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
