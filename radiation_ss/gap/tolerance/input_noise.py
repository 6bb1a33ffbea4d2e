"""What the noise of a recorded exciting force, or of a recorded elevation, does to the readings.

The integrator takes the record's force as it is, noise and all. Where a lightly damped motion answers to frequencies at
which the sea has nothing (a sway on a soft mooring), that noise moves the model although it never moved the body.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.linear import frequencies, receptance
from radiation_ss.gap.posterior.noise import floor_of
from radiation_ss.simulation.prepare import QUANTITIES, Channel, Prepared
from radiation_ss.simulation.wave_reach import mean_frequency
from radiation_ss.waves.force import on_all

HEARD = 0.2  # standard deviations of a channel's noise that one frequency must reach over a record


def input_errors(null: Fit) -> list[FloatArray]:
    """Return columns for each channel: what unit normal numbers make of the readings, one pair for each frequency.

    White noise of standard deviation s in steps of dt has independent cosines and sines of variance 2 s^2 dt / T at the
    frequencies 2 pi k / T, and a mean of variance s^2 dt / T. The linear model answers to each in its steady state;
    starts are free anyway.
    """
    setting = null.problem.setting
    blocks: list[list[FloatArray]] = []  # of each record: its channels' columns
    number = 0
    for prepared in setting.records:
        count = len(prepared.channels)
        floors = null.noise.deviation[number: number + count]
        sources = input_sources(setting.model, prepared)
        blocks.append([setting.without_slow(number + k, part)
                       for k, part in enumerate(answers(setting.model, prepared, sources, floors))])
        number += count
    total = sum(block[0].shape[1] for block in blocks if block)
    found, begin = [], 0
    for block in blocks:
        for part in block:
            columns = np.zeros((part.shape[0], total))
            columns[:, begin: begin + part.shape[1]] = part
            found.append(columns)
        begin += block[0].shape[1] if block else 0
    return found


def input_sources(model: Model, prepared: Prepared) -> list[tuple[float, float, int | None]]:
    """Return deviation of the white noise, sampling step [s], degree of freedom (None: elevation) of each input."""
    if not prepared.forced:
        return []
    record, force = prepared.record, prepared.record.get("force", model.dofs)
    inputs = ([(record.channels["wave_elevation"], None)] if force is None else
              [(row, i) for i, row in enumerate(force)])
    found: list[tuple[float, float, int | None]] = []
    for values, dof in inputs:
        there = np.isfinite(values)
        if there.sum() < 64 or not np.any(values[there]):
            continue
        time, x = record.time[there], values[there]
        noise = floor_of(Channel(0, "displacement", time, x), x, mean_frequency(time, x))
        found.append((noise, float(np.median(np.diff(time))), dof))
    return found


def answers(model: Model, prepared: Prepared, sources: list[tuple[float, float, int | None]],
            floors: tuple[float, ...]) -> list[FloatArray]:
    """Return the readings of one record: cosine and sine for each frequency that any channel hears of."""
    begin, length = prepared.grid[0], float(np.ptp(prepared.grid))
    omega = frequencies(prepared.grid.size, length / prepared.grid.size)
    omega = omega if np.linalg.matrix_rank(model.C) == model.n else omega[1:]  # a mean force would carry it away
    H = receptance(model, omega)
    columns: list[list[FloatArray]] = [[] for _ in prepared.channels]
    for noise, dt, dof in sources:
        F = wave_force_at(model, omega) if dof is None else np.eye(model.n)[dof] + 0j
        x = noise * np.einsum("wij,wj->wi", H, np.broadcast_to(F, (omega.size, model.n)))
        heard = np.zeros(omega.size, dtype=bool)
        for channel, floor in zip(prepared.channels, floors):
            heard |= np.abs(x[:, channel.dof]) * omega ** QUANTITIES.index(channel.quantity) > HEARD * floor
        at = omega[heard]
        size = np.sqrt(np.where(at > 0.0, 2.0, 1.0) * dt / length)
        for k, channel in enumerate(prepared.channels):
            answer = size * x[heard, channel.dof] * (1j * at) ** QUANTITIES.index(channel.quantity)
            turning = answer * np.exp(1j * at * (channel.time[:, None] - begin))
            columns[k] += [turning.real, turning.imag]
    empty = [np.zeros((c.time.size, 0)) for c in prepared.channels]
    return [np.concatenate([none, *parts], axis=1) for none, parts in zip(empty, columns)]


def wave_force_at(model: Model, omega: FloatArray) -> ComplexArray:
    """Return the exciting force per metre of elevation, shape (nw, n); none above the file's band."""
    assert model.hydro is not None and model.hydro.X is not None
    return on_all(model.hydro.omega, model.hydro.X[:, 0, :], omega)
