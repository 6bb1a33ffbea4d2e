"""What a record shows of the free motion of a body: without samples and times that say nothing of it."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import since_release, without_clipped
from radiation_ss.records.spikes import without_spikes


def measured_freely(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a record without clipped samples, spikes and the time before a release, and a sentence for each."""
    fastest = max(natural_frequency(model, i) for i in range(model.n))
    record, clipped = without_clipped(record)
    record, apart = without_spikes(record, 2.0 * np.pi / fastest)
    record, held = released(model, record)
    return record, (*clipped, *apart, *held)


def released(model: Model, record: Record) -> tuple[Record, tuple[str, ...]]:
    """Return a decay from its release on, and a sentence if the body is held before."""
    slowest = min(natural_frequency(model, i) for i in range(model.n))
    return since_release(record, 2.0 * np.pi / slowest)


def power_of(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return circular frequencies [rad/s] and power (Hann window) of a signal without its mean; NaN is filled in."""
    there, dt = np.isfinite(values), float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], dt), time[there], values[there])
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size))) ** 2
    return np.asarray(2.0 * np.pi * np.fft.rfftfreq(even.size, dt)), power
