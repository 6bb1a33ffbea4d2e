"""What a record's sensors say of a motion: which of them, its typical frequency, their noise, integrals."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import DEPTHS
from radiation_ss.errors import InputError
from radiation_ss.inference.grid import Grid, averaged, fewest
from radiation_ss.inference.sensor_noise import coloured_noise, noise_of, spectra
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.record import Record
from radiation_ss.records.signals import bridged
from radiation_ss.simulation.measured import power_of
from radiation_ss.simulation.prepared import exciting_force, wave_motion
from radiation_ss.simulation.size_checks import faint

SLOW = 0.2  # Of a motion's typical frequency: what is slower is not integrated


@dataclass(frozen=True, eq=False)
class Sensor:
    """A second sensor on a degree of freedom: position, order of its time derivative, readings and noise a sample.

    noise (bins,): standard deviation a sample of white noise as strong as the sensor's in each bin of the basis.
    """

    dof: int
    order: int
    values: FloatArray
    noise: FloatArray


def moves(model: Model, record: Record) -> bool:
    """Whether a record shows motion of the model beside noise, or measures none of it at all."""
    silent = all(record.get(q, model.dofs) is None for q in QUANTITIES)
    return silent or any(channel(model, record, i) is not None for i in range(model.n))


def channel(model: Model, record: Record, i: int) -> tuple[int, FloatArray, FloatArray] | None:
    """Return order, times and readings of the sensor that shows a motion best: displacement, else its derivatives."""
    for order, quantity in enumerate(QUANTITIES):
        values = record.get(quantity, [model.dofs[i]])
        if values is not None and np.isfinite(values[0]).sum() >= fewest(record) and np.nanstd(values[0]) > 0.0:
            there = np.isfinite(values[0])
            found = (order, record.time[there], values[0][there])
            silent = noise_only(model, found, i) and not (record.kind == "static" and loaded(record, model.dofs[i]))
            return None if silent or aside(model, record, i) else found
    return None


def gauged(model: Model, record: Record, moving: np.ndarray) -> np.ndarray:
    """Return which motions of a prescribed test have a force that is measured, (n,); InputError if none has.

    On a motion that is held, not `moving`, it is no faint one: the model knows its couplings no better.
    """
    force = record.get("force", model.dofs)
    rows = np.full((model.n, 1), np.nan) if force is None else force
    found = np.isfinite(rows).sum(axis=1) >= 4
    size = np.array([np.nanstd(row) if there else 0.0 for row, there in zip(rows, found)])
    found &= moving | ~faint(model, size / np.diag(model.M + model.A_inf))
    if not found.any():
        raise InputError(f"record {record.name}: a prescribed motion predicts its force, and no force is measured; its "
                         f"columns are {', '.join(record.channels)}")
    return found


def unmoved(model: Model, record: Record) -> list[str]:
    """Return sentences on motions that are taken as none: those that their sensors hardly show, or that have none."""
    still = [dof for i, dof in enumerate(model.dofs) if channel(model, record, i) is None]
    if record.kind == "prescribed":
        return [f"Record {record.name}: {dof} shows no motion beside noise; it is taken as held fast." for dof in still
                if dof in record.dofs]
    dark = [dof for dof in still if not np.isfinite([values for q in QUANTITIES if (
        values := record.get(q, [dof])) is not None]).any()]
    quiet, said = [dof for dof in still if dof not in dark], []
    if quiet:
        said.append(f"Record {record.name}: {', '.join(quiet)} {'shows' if len(quiet) == 1 else 'show'} no motion "
                    "beside noise, or hardly any against the others; no cause is sought there.")
    if dark and record.kind != "static":
        said.append(f"Record {record.name}: {', '.join(dark)} {'is' if len(dark) == 1 else 'are'} not measured and "
                    "taken as at rest, not predicted: if there is motion, causes on it or by way of it are not told, "
                    "and coupled numbers may take their place.")
    return said


def not_measured(model: Model, record: Record) -> InputError:
    """Return why a record shows no motion of the model."""
    rows = {dof: [values for q in QUANTITIES if (values := record.get(q, [dof])) is not None] for dof in model.dofs}
    there = {dof: max(int(np.isfinite(values).sum()) for values in found) for dof, found in rows.items() if found}
    if not there:
        said = f"no motion of {', '.join(model.dofs)} in its columns, {', '.join(record.channels) or 'none'}"
    elif max(there.values()) < fewest(record):
        said = (f"{max(there.values())} usable samples of {', '.join(there)}; a record of kind {record.kind!r} takes "
                f"{fewest(record)} at least")
    else:
        said = (f"{', '.join(there)} {'are' if len(there) > 1 else 'is'} noise alone (a flat spectrum), or sampled "
                f"too coarsely, every {float(np.median(np.diff(record.time))):.3g} s")
    return InputError(f"record {record.name}: {said}")


def loaded(record: Record, dof: str) -> bool:
    """Whether a force acts on a motion that is not the same all the time."""
    load = record.channels.get(f"{dof}_force")
    return load is not None and bool(np.nanstd(load) > 0.0)


def aside(model: Model, record: Record, i: int, flat: float = 0.7) -> bool:
    """Whether a motion without a load of its own does not follow the others' loads: what it shows is its sensor's.

    Of a free or forced motion it is what is faint against the others. `flat`: as in `noise_only`.
    """
    loads = [record.channels[f"{dof}_force"] for dof in model.dofs if loaded(record, dof)]
    driven = bool(loads) and record.kind in ("static", "forced")
    if loaded(record, model.dofs[i]) or not (driven or record.kind == "decay"):
        return False
    if record.kind != "static":
        moved = np.array([np.nanstd(record.channels.get(dof, np.zeros(1))) for dof in model.dofs])
        return bool(faint(model, moved)[i] and moved[i] > 0.0)  # without a displacement its size is not known here
    rows = np.column_stack([np.ones(record.time.size), *loads, record.channels[model.dofs[i]]])
    rows = rows[np.isfinite(rows).all(axis=1)]
    loads, motion = rows[:, :-1] / np.abs(rows[:, :-1]).max(axis=0), rows[:, -1]
    left = motion - loads @ np.linalg.lstsq(loads, motion)[0]
    return bool(np.std(left) > flat * np.std(motion))


def noise_only(model: Model, found: tuple[int, FloatArray, FloatArray], i: int, flat: float = 0.7) -> bool:
    """Whether a reading is nothing but white noise: its degree of freedom is then at rest."""
    _, time, values = found
    step = float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], step), time, values)
    level = noise_of(even, step, typical(model, found, i)) if even.size > 64 else 0.0
    return level > flat * float(np.std(even))


def typical(model: Model, found: tuple[int, FloatArray, FloatArray] | None, i: int) -> float:
    """Return the typical frequency of a motion [rad/s]; of its acceleration where nothing restores it: it may drift."""
    if found is None:
        return 0.0
    inertia = model.M[i, i] + model.A_inf[i, i]
    span = found[1][-1] - found[1][0]
    natural = float(np.sqrt(max(model.C[i, i], 0.0) / inertia)) or 2 * np.pi / span
    omega, power = power_of(found[1], found[2])
    # Of a heavily damped decay most samples are noise: what stands out of the median is motion. As an acceleration
    # noise grows with frequency, so there it has to stand out more.
    drifts = model.C[i, i] == 0.0
    strong = np.maximum(power - (30.0 if drifts else 10.0) * np.median(power), 0.0) * (omega**4 if drifts else 1.0)
    strong *= strong > 0.05 * strong[1:].max(initial=0.0)
    strong[0] = 0.0
    return max(float(omega @ strong / strong.sum()) if strong.any() else natural, 2 * np.pi / span)


def driven_up_to(model: Model, record: Record, i: int, share: float = 0.9) -> float:
    """Return the frequency [rad/s] below which a share of the power is that drives a motion; 0 where none is recorded.

    A soft mooring may let a body move far below the waves that push it.
    """
    values = record.channels.get(f"{model.dofs[i]}_force", record.channels.get("wave_elevation"))
    if values is None or record.kind not in ("waves", "forced") or not np.nanstd(values) > 0.0:
        return 0.0
    omega, power = power_of(record.time, values)
    return float(omega[int(np.searchsorted(np.cumsum(power), share * power.sum()))])


def integrated(values: FloatArray, dt: float, order: int, omega: float) -> FloatArray:
    """Return the `order`-fold integral of a signal without what is slower than `SLOW` of its typical frequency."""
    if order == 0:
        return values
    double = np.concatenate([values, values[::-1]])
    at = 2 * np.pi * np.fft.rfftfreq(double.size, dt)
    gain = np.where(at > SLOW * omega, 1.0 / (1j * np.maximum(at, SLOW * omega)) ** order, 0.0)
    return np.asarray(np.fft.irfft(np.fft.rfft(double - double.mean()) * gain, double.size)[: values.size])


def slow_motions(order: int, raw: FloatArray, i: int, omega: float, dt: float) -> FloatArray:
    """Return what `integrated` leaves out of a motion, each with the motion's own rms, shape (k, n, nt).

    Of the even extension's cosines these are the integrals of all below the cut, and the constants of integration.
    """
    share = (np.arange(raw.shape[1]) + 0.5) / raw.shape[1]
    count = int(SLOW * omega * dt * raw.shape[1] / np.pi)
    powers = [share**k for k in range(order + 1)] if order else []
    waves = [(np.sin if order == 1 else np.cos)(np.pi * k * share) for k in range(1, count + 1)] if order else []
    found = np.zeros((len(powers) + len(waves), *raw.shape))
    for k, shape in enumerate([*powers, *waves]):
        found[k, i] = shape * np.std(raw[i]) / np.sqrt(np.mean(shape**2))
    return found


def clear_up_to(grid: Grid, found: tuple[int, FloatArray, FloatArray], omega: float, white: float, least: float,
                clear: float = 2.0, chance: float = 0.01) -> float:
    """Return the frequency [rad/s], `least` at least, up to which a motion stands out of its sensor's noise.

    There its power in a third of an octave is `clear` times that of the noise for the last time, and more than what
    noise alone has in any of them with probability `chance`, by the numbers of their lines and of the noise's.
    """
    _, time, values = found
    own, highest = np.interp(grid.own, time, values), 0.7 * np.pi / (grid.step * grid.keep)
    at, power, (far, _), count = spectra(own, grid.step, omega, 8)
    above = (at > least) & (at <= highest)
    if not above.any():
        return least
    noise = 2.0 * grid.step * coloured_noise(own, grid.step, omega, at[above], white) ** 2
    third = np.floor(3.0 * np.log2(at[above] / least)).astype(int)
    # Under Hann's window m lines of a segment are as m + 1 squares of normal numbers, and a median as half as many.
    squares = count * (np.bincount(third) + 1.0)
    level = np.maximum(clear, f.isf(chance / squares.size, squares, 0.5 * count * (far.size + 1.0)))
    there = np.flatnonzero(np.bincount(third, power[above]) > level * np.bincount(third, noise))
    return min(least * 2.0 ** ((there[-1] + 1.0) / 3.0), highest) if there.size else least


def second_sensors(model: Model, record: Record, grid: Grid, found: list[tuple[int, FloatArray, FloatArray] | None],
                   omega: FloatArray, at: FloatArray | None, white: float) -> list[Sensor]:
    """Return velocity and acceleration sensors beside a displacement whose noise is their own; see `Grid.noise`.

    One whose noise goes along with the displacement's derivative was computed from it and says nothing more.
    """
    sensors = []
    for i, first in enumerate(found):
        if first is None or first[0] != 0:
            continue
        base = np.interp(grid.own, first[1], first[2])
        for order, quantity in ((1, "velocity"), (2, "acceleration")):
            values = record.get(quantity, [model.dofs[i]])
            if values is None or np.isfinite(values[0]).sum() < 16 or np.nanstd(values[0]) == 0.0:
                continue
            there = np.isfinite(values[0])
            time, reading = bridged(record.time[there], values[0][there], 2 * np.pi / omega[i])
            if not derived(base, np.interp(grid.own, time, reading), grid.step, order, omega[i]):
                least = 1e-3 * float(np.std(reading)) * np.sqrt(grid.split / grid.keep)
                level = np.atleast_1d(np.maximum(grid.noise(time, reading, omega[i], at, white), least))
                sensors.append(Sensor(i, order, averaged(grid.between(time, reading), grid.keep), level))
    return sensors


def derived(base: FloatArray, reading: FloatArray, dt: float, order: int, omega: float) -> bool:
    """Whether the noise of a reading is that of the displacement's derivative: their coherence far above the motion."""
    at = 2 * np.pi * np.fft.rfftfreq(base.size, dt)
    window = np.hanning(base.size)
    one = (1j * at) ** order * np.fft.rfft((base - base.mean()) * window)
    two = np.fft.rfft((reading - reading.mean()) * window)
    band = (at > 6.0 * omega) & (at < 0.5 * np.pi / dt)
    if band.sum() < 8:
        return False
    cross = np.abs(np.vdot(one[band], two[band])) ** 2
    power = np.vdot(one[band], one[band]).real * np.vdot(two[band], two[band]).real
    return bool(cross > 0.25 * power)


def known_force(model: Model, record: Record, grid: Grid) -> FloatArray | None:
    """Return the force on the grid: recorded, zero in a decay, from the elevation; None if it is unknown."""
    splines = exciting_force(model, record)
    return None if splines is None else np.stack([averaged(f(grid.even), grid.keep) for f in splines])


def still_or_waves(model: Model, record: Record, grid: Grid) -> FloatArray:
    """Return elevation, envelope and orbital velocities on the grid, a row each; 0 without an elevation."""
    if "wave_elevation" not in record.channels:
        return np.zeros((2 + len(DEPTHS) * model.n, grid.time.size))
    return np.stack([averaged(f(grid.even), grid.keep) for f in wave_motion(model, record)])
