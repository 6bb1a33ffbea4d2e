"""The standard tests of a tank, simulated from the model alone: what a plan chooses from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import motion_unit
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate
from radiation_ss.waves.realise import realise
from radiation_ss.waves.spectrum import jonswap

SMALL = 0.2  # of the full amplitude
DECAY, FORCED = 12, 40  # lengths in natural periods (in waves also in peak periods)
SAMPLES = 24  # a natural (or peak) period
PLAIN = ("displacement",)
BOTH = ("displacement", "acceleration")
ALL = ("displacement", "velocity", "acceleration")


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """A test that could be done."""

    name: str
    description: str
    # What it would measure without noise if the model were right. Tests of one record differ in their sensors.
    record: Record
    quantities: tuple[str, ...] = ALL  # The sensors that are read: displacement, velocity, acceleration
    large: bool = True  # Whether the motion has the full amplitude

    @property
    def measured(self) -> Record:
        """The record with only the channels that the test reads."""
        dropped = {f"_{quantity}" for quantity in ALL if quantity not in self.quantities}
        kept = {k: v for k, v in self.record.channels.items() if not any(k.endswith(s) for s in dropped)}
        return replace(self.record, channels=kept, name=self.name)


def standard_tests(model: Model, amplitude: Mapping[str, float], sea: tuple[float, float] | None = None, *,
                   told: bool = True) -> list[PlannedTest]:
    """Return the menu, simple tests first: decays, waves and forced sweeps, at full and at a fifth of the
    amplitude, with and without accelerometers.

    Parameters
    ----------
    amplitude : mapping of dof to float
        Largest displacement [m or rad].
    sea : (Hs, Tp), optional
        Significant wave height [m] and peak period [s]; needs X in the model. Without it the waves have the natural
        period and are scaled to the amplitude.
    told : bool
        Whether descriptions give amplitudes in m and rad, or only as full and a fifth.
    """
    runs = [run for i, dof in enumerate(model.dofs) if model.C[i, i] > 0.0 for run in decays(model, i, amplitude[dof])]
    runs += waves(model, amplitude, sea)
    for i in range(model.n):
        runs += scaled(model, "forced sweep" + of(model, i), "known force of an actuator from half to twice the natural"
                       " frequency", sweep(model, i), amplitude, peak=1.0)
    runs = [replace(run, description=sized(run.description, model, amplitude)) for run in runs] if told else runs
    return [replace(run, name=run.name + extra, quantities=quantities)
            for run in runs for extra, quantities in (("", PLAIN), (" + accelerometer", BOTH))]


def of(model: Model, i: int) -> str:
    """Return ' of Heave' where there are several degrees of freedom."""
    return f" of {model.dofs[i]}" if model.n > 1 else ""


def sized(text: str, model: Model, amplitude: Mapping[str, float]) -> str:
    """Return a description with the full amplitude in numbers."""
    sizes = ", ".join(f"{amplitude[dof]:.3g} {motion_unit(dof)}" for dof in model.dofs)
    return f"{text} (amplitude: {sizes})"


def decays(model: Model, i: int, amplitude: float) -> list[PlannedTest]:
    """Return releases from rest at full and small displacement, and from the other side."""
    omega = natural_frequency(model, i)
    time = even_times(model, DECAY * 2.0 * np.pi / omega, omega)
    start = np.zeros(model.fit.states + 2 * model.n)
    start[model.fit.states + i] = amplitude
    outputs = np.asarray(simulate(model, (time, np.zeros((model.n, time.size))), start=start).outputs)
    name = "decay" + of(model, i)
    return [planned(model, time, share * outputs, "decay", f"{name}, {word}", f"release {where}", share)
            for share, word, where in ((1.0, "large", "from the full amplitude"),
                                       (-1.0, "other side", "from the full amplitude to the other side"),
                                       (SMALL, "small", "from a fifth of the amplitude"))]


def even_times(model: Model, duration: float, fastest: float) -> FloatArray:
    """Return sample times that resolve every natural motion and the given frequency."""
    omega = max(fastest, *(natural_frequency(model, i) for i in range(model.n)))
    return np.arange(0.0, duration, 2.0 * np.pi / omega / SAMPLES)


def sweep(model: Model, i: int) -> Record:
    """Return a force whose frequency goes linearly from half to twice the natural frequency."""
    omega = natural_frequency(model, i)
    duration = FORCED * 2.0 * np.pi / omega
    time = even_times(model, duration, 2.0 * omega)
    force = np.sin(omega * (0.5 * time + 0.75 * time**2 / duration))
    channels = {f"{dof}_force": force * (j == i) for j, dof in enumerate(model.dofs)}
    return Record(time, {**channels, **{dof: np.zeros(time.size) for dof in model.dofs}}, kind="forced")


def waves(model: Model, amplitude: Mapping[str, float], sea: tuple[float, float] | None) -> list[PlannedTest]:
    """Return irregular waves with the force known and, where the model carries X, with the elevation only."""
    has_x = model.hydro is not None and model.hydro.X is not None
    if sea is not None and not has_x:
        raise InputError("sea: the model carries no exciting force X, so a sea makes no motion; leave sea out, and the "
                         "waves are scaled to the amplitude")
    slowest = min(natural_frequency(model, i) for i in range(model.n))
    height, period = sea if sea is not None else (1.0, 2.0 * np.pi / slowest)
    if not (height > 0.0 and period > 0.0):
        raise InputError(f"sea: Hs = {height:g} m, Tp = {period:g} s; both must be positive")
    time = even_times(model, FORCED * max(period, 2.0 * np.pi / slowest), 2.0 * np.pi / period)
    drawn = realise(jonswap(height, period), time.size * (time[1] - time[0]), float(time[1] - time[0]), seed=0)
    still = {dof: np.zeros(time.size) for dof in model.dofs}
    elevation = drawn.elevation[: time.size]
    fixed = None if sea is None else 1.0
    if not has_x:
        push = {f"{dof}_force": elevation * amplitude[dof] * model.C[i, i] if model.C[i, i] > 0.0 else elevation
                for i, dof in enumerate(model.dofs)}
        return scaled(model, "waves with force", "irregular waves, the exciting force known (diffraction test)",
                      Record(time, {**still, **push}), amplitude, peak=2.0)
    record = Record(time, {**still, "wave_elevation": elevation})
    forces = np.asarray(simulate(model, record, start=np.zeros(model.fit.states + 2 * model.n)).inputs)
    known = record.with_channels(**{f"{dof}_force": row for dof, row in zip(model.dofs, forces)})
    known = replace(known, channels={k: v for k, v in known.channels.items() if k != "wave_elevation"})
    return [*scaled(model, "waves with elevation", "irregular waves, only the elevation known", record, amplitude,
                    peak=2.0, scale=fixed),
            *scaled(model, "waves with force", "irregular waves, the exciting force known (diffraction test)", known,
                    amplitude, peak=2.0, scale=fixed)]


def scaled(model: Model, name: str, description: str, record: Record, amplitude: Mapping[str, float], *, peak: float,
           scale: float | None = None) -> list[PlannedTest]:
    """Return the answer to a force or elevation at full and small size.

    `peak` 1 makes the largest displacement the amplitude, 2 twice the rms of the motion. The model is linear: one
    simulation serves for both.
    """
    outputs = np.asarray(simulate(model, record, start=np.zeros(model.fit.states + 2 * model.n)).outputs)
    sizes = np.abs(outputs[: model.n]).max(axis=1) if peak == 1.0 else peak * outputs[: model.n].std(axis=1)
    if scale is None:
        scale = 1.0 / max(float(size) / amplitude[dof] for size, dof in zip(sizes, model.dofs))
    given = {k: v for k, v in record.channels.items() if k.endswith("_force") or k == "wave_elevation"}
    return [planned(model, record.time, share * scale * outputs, record.kind, f"{name}, {word}",
                    f"{description}, {'full' if share == 1.0 else 'a fifth of the'} amplitude", share,
                    {k: share * scale * v for k, v in given.items()})
            for share, word in ((1.0, "large"), (SMALL, "small"))]


def planned(model: Model, time: FloatArray, outputs: FloatArray, kind: str, name: str, description: str, share: float,
            given: Mapping[str, FloatArray] | None = None) -> PlannedTest:
    """Return a run with displacement and acceleration of every degree of freedom."""
    n = model.n
    channels = {dof: outputs[i] for i, dof in enumerate(model.dofs)}
    channels |= {f"{dof}_acceleration": outputs[2 * n + i] for i, dof in enumerate(model.dofs)}
    record = Record(time, {**channels, **(given or {})}, kind=kind, name=name)
    return PlannedTest(name, description, record, large=abs(share) == 1.0)
