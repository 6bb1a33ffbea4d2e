"""Noise of the sensors and size of the force, from a record: what the default settings are scaled by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import tukey

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.subsystems import Subsystems
from radiation_ss.records.columns import QUANTITIES, SUFFIXES
from radiation_ss.records.record import Record
from radiation_ss.records.signals import without_spikes


@dataclass(frozen=True, eq=False)
class SignalScales:
    """Scales of one record."""

    # (4, n): Sensor noise (standard deviation) of displacement, velocity, acceleration and known force; NaN where
    # absent
    noise: FloatArray
    motion: FloatArray  # (n,): Standard deviation of the displacement
    # force, omega, bandwidth (n,): Standard deviation [N, N m], mean frequency [rad/s] and relative bandwidth of the
    # exciting force, by the model
    force: FloatArray
    omega: FloatArray
    bandwidth: FloatArray


def channel_names(dofs: Sequence[str]) -> list[str]:
    """Return the names of all channels in the order of `channels`."""
    return [dof + suffix for suffix in ("", *SUFFIXES) for dof in dofs]


def interval_of(time: FloatArray) -> float:
    """Return the usual time between samples [s]: the mean of those within 1 % of their median."""
    dts = np.diff(time)
    middle = np.median(dts)
    return float(dts[np.abs(dts - middle) <= 0.01 * middle].mean())


def channels(record: Record, dofs: tuple[str, ...]) -> FloatArray:
    """Return the samples of all channels, shape (4 n, nt), NaN where missing; a decay's force is a known zero."""
    rows = []
    for quantity in (*QUANTITIES, "force"):
        values = record.get(quantity, dofs)
        if values is None:
            calm = record.kind == "decay" and quantity == "force"
            values = np.full((len(dofs), record.time.size), 0.0 if calm else np.nan)
        rows.append(values)
    return np.vstack(rows)


def straightened(force: FloatArray, least: float = 1e-3) -> FloatArray | None:
    """Return the samples (n, nt) whose smooth path acts as one that is straight between those given.

    That path has sinc^2(omega dt / 2), about 1 - (omega dt)^2 / 12, of each component. None where that changes the
    samples by less than a share `least`.
    """
    bent = np.zeros_like(force)
    bent[:, 1:-1] = np.nan_to_num(np.diff(force, 2, axis=1)) / 12.0
    return force + bent if np.linalg.norm(bent) > least * np.linalg.norm(np.nan_to_num(force)) else None


def scales_of(record: Record, model: Model, parts: Subsystems, noise: Mapping[str, float] | None = None,
              least: float = 1e-3) -> SignalScales:
    """Estimate the scales of a record.

    `noise`: known sensor noise by channel name (`Heave`, `Heave_velocity`, ...), in the channel's unit. `least`: least
    noise of a signal's standard deviation: clocks and filters are no better. InputError if a degree of freedom has no
    motion channel, or a channel does not move at all.
    """
    n, time, names = model.n, record.time, channel_names(model.dofs)
    if time.size < 16:
        raise InputError(f"record {record.name}: {time.size} samples; a filter needs at least 16")
    y = np.array([without_spikes(row) for row in channels(record, model.dofs)])
    spread = np.full(4 * n, np.nan)
    level = np.full(4 * n, np.nan)
    for c in np.flatnonzero(np.isfinite(y).sum(axis=1) > 8):
        good = y[c][np.isfinite(y[c])]
        spread[c] = good.std()
        level[c] = max(noise_of(good), least * spread[c])
        name = names[c]
        if noise is not None and name in noise:
            level[c] = noise[name]
        if spread[c] == 0.0 and c < 3 * n:
            raise InputError(f"record {record.name}, channel {name}: constant; a dead sensor? remove the channel")
    dt = interval_of(time)
    # As many whole steps as there are: rounding of the times must not change their number, nor where they begin.
    grid = time[0] + dt * np.arange(round((time[-1] - time[0]) / dt))
    omega: FloatArray = 2.0 * np.pi * np.fft.rfftfreq(grid.size, dt).astype(np.float64)
    orders, measured = zip(*(_measured(y[j:3 * n:n], time, grid, record, model.dofs[j]) for j in range(n)))
    noisy = np.array([level[j + order * n] for j, order in enumerate(orders)]) * np.sqrt(grid.size)
    # Cut ends leak into all frequencies, and the impedance makes a large fast force of that: they are tapered.
    taper = tukey(grid.size, 0.1)
    whole, motion = np.fft.rfft(measured), np.fft.rfft(measured * taper / np.sqrt(np.mean(taper**2)))
    motion[:, 0] = 0.0
    middle = _mean_frequency(motion, omega, noisy)
    for spectra in (whole, motion):
        spectra[:, 1:] /= (1j * omega[1:]) ** np.array(orders)[:, None]
    impedance = (-omega[:, None, None] ** 2 * (model.M + model.A_inf)
                 + 1j * omega[:, None, None] * (parts.K(parts.theta, omega) + model.D) + model.C)
    band = _band(motion, omega, middle)
    force = np.where(band, np.einsum("wjk,kw->jw", impedance, motion), 0.0)
    # Parseval: |F|^2 of a record with its mean removed.
    power = 2.0 * np.abs(force) ** 2 / grid.size**2
    m0, m1, m2 = (np.sum(power * omega**k, axis=1) for k in range(3))
    std = np.sqrt(2.0 * np.sum(np.abs(np.where(band, whole, 0.0)) ** 2, axis=1)) / grid.size
    floor = np.abs(np.diag(model.C)) * std * 1e-3 + 1e-300
    level[3 * n:] = np.where(np.isfinite(level[3 * n:]), np.maximum(level[3 * n:], floor), np.nan)
    return SignalScales(level.reshape(4, n), std, np.maximum(np.sqrt(m0), floor), m1 / m0,
                  np.clip(np.sqrt(np.maximum(m0 * m2 / m1**2 - 1.0, 0.0)), 0.1, 0.7))


def noise_of(values: FloatArray) -> float:
    """Return the noise of a smooth signal from its fourth differences, whose noise gain is sqrt(70)."""
    differences = np.abs(np.diff(values, 4))
    moving = differences[differences > 0.0]  # a dead sensor repeats itself and has none
    return float(np.median(moving) / 0.6745 / np.sqrt(70.0)) if moving.size > 8 else 0.0


def _measured(y: FloatArray, time: FloatArray, grid: FloatArray, record: Record, dof: str) -> tuple[int, FloatArray]:
    """Return whichever derivative of the displacement is there first, by its order, less its mean, on the grid."""
    for order, values in enumerate(y):
        good = np.isfinite(values)
        if good.sum() > 8:
            return order, np.interp(grid, time[good], values[good] - values[good].mean())
    raise InputError(f"record {record.name}: no motion of {dof}; give {dof}, {dof}_velocity or {dof}_acceleration")


def _mean_frequency(measured: ComplexArray, omega: FloatArray, noise: FloatArray, clear: float = 2.0) -> FloatArray:
    """Return the mean frequency [rad/s] of each measured motion (n, nw), of what is `clear` of its noise (n,).

    Of an acceleration itself, not of the displacement that it makes: its integral twice is mostly slow noise.
    """
    size = np.abs(measured)
    power = np.where((size > clear * noise[:, None]) | (size == size.max(axis=1, keepdims=True)), size, 0.0) ** 2
    return np.asarray((power * omega).sum(axis=1) / power.sum(axis=1), dtype=np.float64)


def _band(motion: ComplexArray, omega: FloatArray, middle: FloatArray) -> NDArray[np.bool_]:
    """Return where the motion has power: within a third and three times its mean frequency, above 1e-5 of the peak."""
    power = np.abs(motion) ** 2
    near = (omega > middle[:, None] / 3.0) & (omega < 3.0 * middle[:, None])
    return near & (power > 1e-5 * np.where(near, power, 0.0).max(axis=1, keepdims=True))
