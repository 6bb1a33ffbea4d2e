"""Standard tests of a tank, simulated from the model alone, and how their readings change with what may be wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray, positive
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Active
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import motion_unit
from radiation_ss.inference.effect_features import features
from radiation_ss.inference.effect_symbols import Symbols
from radiation_ss.inference.motion import MeasuredMotion, Resolution, measured_motion
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.faults import drives
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate
from radiation_ss.waves.realise import realise
from radiation_ss.waves.spectrum import jonswap

SMALL = 0.2  # of the full amplitude
DECAY, FORCED = 12, 40  # lengths in natural periods (in waves also in peak periods)
SAMPLES = 24  # a natural (or peak) period
PLAIN = ("displacement",)
BOTH = ("displacement", "acceleration")


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """A test that could be done."""

    name: str
    description: str
    # What it would measure without noise if the model were right. Tests of one record differ in their sensors.
    record: Record
    quantities: tuple[str, ...] = QUANTITIES  # The sensors that are read: displacement, velocity, acceleration
    large: bool = True  # Whether the motion has the full amplitude

    @property
    def measured(self) -> Record:
        """The record with only the channels that the test reads."""
        dropped = {f"_{quantity}" for quantity in QUANTITIES if quantity not in self.quantities}
        kept = {k: v for k, v in self.record.channels.items() if not any(k.endswith(s) for s in dropped)}
        return replace(self.record, channels=kept, name=self.name)


def standard_tests(model: Model, amplitude: Mapping[str, float], sea: tuple[float, float] | None = None, *,
                   told: bool = True) -> list[PlannedTest]:
    """Return the menu, simple tests first: decays, waves and forced sweeps, full and a fifth, with and without
    accelerometers.

    `amplitude`: largest displacement [m or rad]. `sea`: (Hs, Tp) for a model with X; else waves have the natural period
    and the amplitude. `told`: whether descriptions give amplitudes in m and rad.
    """
    runs = [run for i, dof in enumerate(model.dofs) if model.C[i, i] > 0.0 for run in decays(model, i, amplitude[dof])]
    runs += waves(model, amplitude, sea)
    for i in range(model.n):
        runs += scaled(model, "forced sweep" + of(model, i), "known force of an actuator from half to twice the natural"
                       " frequency", sweep(model, i), amplitude, peak=1.0)
    sizes = ", ".join(f"{amplitude[dof]:.3g} {motion_unit(dof)}" for dof in model.dofs)
    runs = [replace(run, description=f"{run.description} (amplitude: {sizes})") for run in runs] if told else runs
    return [replace(run, name=run.name + extra, quantities=quantities)
            for run in runs for extra, quantities in (("", PLAIN), (" + accelerometer", BOTH))]


def of(model: Model, i: int) -> str:
    """Return ' of Heave' where there are several degrees of freedom."""
    return f" of {model.dofs[i]}" if model.n > 1 else ""


def decays(model: Model, i: int, amplitude: float) -> list[PlannedTest]:
    """Return releases from rest at full and small displacement, and from the other side."""
    omega = natural_frequency(model, i)
    time = even_times(model, DECAY * 2.0 * np.pi / omega, omega)
    still = np.zeros((model.n, time.size))
    outputs = np.asarray(simulate(model, (time, still), start={model.dofs[i]: amplitude}).outputs)
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
        raise InputError("sea: the model carries no wave excitation force X, so a sea makes no motion; leave sea out, "
                         "and the waves are scaled to the amplitude")
    slowest = min(natural_frequency(model, i) for i in range(model.n))
    height, period = sea if sea is not None else (1.0, 2.0 * np.pi / slowest)
    height, period = positive(height, "sea, Hs", "m"), positive(period, "sea, Tp", "s")
    time = even_times(model, FORCED * max(period, 2.0 * np.pi / slowest), 2.0 * np.pi / period)
    drawn = realise(jonswap(height, period), time.size * (time[1] - time[0]), float(time[1] - time[0]), seed=0)
    still = {dof: np.zeros(time.size) for dof in model.dofs}
    elevation = drawn.elevation[: time.size]
    fixed = None if sea is None else 1.0
    forces, menu = [elevation * amplitude[dof] * model.C[i, i] if model.C[i, i] > 0.0 else elevation
                    for i, dof in enumerate(model.dofs)], []
    if has_x:
        record = Record(time, {**still, "wave_elevation": elevation}, meta=headed(model))
        menu.append(("waves with elevation", "only the elevation known", record))
        forces = list(np.asarray(simulate(model, record, start={}).inputs))
    known = {f"{dof}_force": row for dof, row in zip(model.dofs, forces)}
    menu.append(("waves with force", "the wave excitation force known (diffraction test)",
                 Record(time, {**still, **known}, meta=headed(model))))
    return [run for name, what, record in menu
            for run in scaled(model, name, f"irregular waves, {what}", record, amplitude, peak=2.0, scale=fixed)]


def scaled(model: Model, name: str, description: str, record: Record, amplitude: Mapping[str, float], *, peak: float,
           scale: float | None = None) -> list[PlannedTest]:
    """Return the answer to a force or elevation at full and small size, of one simulation.

    `peak` 1 makes the largest displacement the amplitude, 2 twice the rms of the motion.
    """
    outputs = np.asarray(simulate(model, record, start={}).outputs)
    sizes = np.abs(outputs[: model.n]).max(axis=1) if peak == 1.0 else peak * outputs[: model.n].std(axis=1)
    if scale is None:
        scale = 1.0 / max(float(size) / amplitude[dof] for size, dof in zip(sizes, model.dofs))
    given = {k: v for k, v in record.channels.items() if drives(k)}
    return [planned(model, record.time, share * scale * outputs, record.kind, f"{name}, {word}",
                    f"{description}, {'full' if share == 1.0 else 'a fifth of the'} amplitude", share,
                    {k: share * scale * v for k, v in given.items()})
            for share, word in ((1.0, "large"), (SMALL, "small"))]


def headed(model: Model) -> dict[str, str]:
    """Return the comment that waves go to the first of several directions of X."""
    known = None if model.hydro is None else model.hydro.directions
    return {"heading": f"{np.degrees(known[0]):.10g}"} if known is not None and known.size > 1 else {}


def planned(model: Model, time: FloatArray, outputs: FloatArray, kind: str, name: str, description: str, share: float,
            given: Mapping[str, FloatArray] | None = None) -> PlannedTest:
    """Return a run with displacement and acceleration of every degree of freedom."""
    n = model.n
    channels = {dof: outputs[i] for i, dof in enumerate(model.dofs)}
    channels |= {f"{dof}_acceleration": outputs[2 * n + i] for i, dof in enumerate(model.dofs)}
    record = Record(time, {**channels, **(given or {})}, kind=kind, name=name, meta=headed(model))
    return PlannedTest(name, description, record, large=abs(share) == 1.0)


@dataclass(frozen=True, eq=False)
class Simulated:
    """Records without noise, and what to weigh changes of their readings with."""

    model: Model
    runs: tuple[MeasuredMotion, ...]
    sizes: FloatArray  # (3, n): Rms of displacement, velocity and acceleration at full amplitude
    noise: float  # Standard deviation of a sensor at each of the record's samples, of what it reads at full amplitude

    def weighed(self, r: int, change: FloatArray) -> list[FloatArray]:
        """Return changes in standard deviations for each quantity that record r holds, shapes (rows, K)."""
        run, found = self.runs[r], []
        kept = np.sqrt(run.kept)
        for order, quantity in enumerate(QUANTITIES):
            rows = [change[order, i] / (self.noise * self.sizes[order, i] / kept) for i, dof in
                    enumerate(self.model.dofs) if self.sizes[order, i] > 0.0
                    and (order == 0 or run.record.get(quantity, [dof]) is not None)]
            found.append(np.concatenate([*rows, np.zeros((0, change.shape[-1]))]))
        return found

    def by(self, active: Active, symbols: Symbols, per_record: bool = False) -> list[FloatArray]:
        """Return changes (3, n, nt, K) in each record by each strength, `per_record`: by each strength and record."""
        strengths = features(symbols, active, self.runs)
        found = []
        for r, run in enumerate(self.runs):
            force = np.stack([by_record[r].force for by_record in strengths], axis=-1)
            change = response(self.model, force, run.dt)
            for order in range(3):
                own = [by_record[r].others if order else by_record[r].reading for by_record in strengths]
                if np.any(own):
                    change[order] += make_interp_spline(run.time, np.stack(own, axis=-1), k=5, axis=1)(run.time, order)
            if per_record:
                spread = np.zeros((*change.shape, len(self.runs)))
                spread[..., r] = change
                change = spread.reshape(*change.shape[:-1], -1)
            found.append(change)
        return found

    def unknown(self, r: int, wide: float = 30.0) -> FloatArray:
        """Return changes by the unknown start, shape (3, n, nt, K): place, velocity, and what was before a record.

        `wide`: prior standard deviation of place and velocity, of the rms at full amplitude.
        """
        run, n, m = self.runs[r], self.model.n, self.model.fit.states
        start = np.zeros((m + 2 * n, 2 * n))
        start[m:] = np.diag(wide * np.concatenate([self.sizes[0], self.sizes[1]]))
        free = response(self.model, np.zeros((n, run.time.size, 2 * n)), run.dt, start)
        if not len(run.transients):
            return free
        return np.concatenate([free, response(self.model, np.moveaxis(run.transients, 0, -1), run.dt)], axis=-1)


def simulated(model: Model, records: Sequence[Record], full: Sequence[bool], noise: float) -> Simulated:
    """Return simulated records; the size of readings is that of the records at full amplitude, or of all."""
    runs = [measured_motion(model, record, Resolution(noise_floor=0.0)) for record in records]
    for i, run in enumerate(runs):
        if run.force is None or run.prescribed:
            said = "no known force" if run.force is None else "a given motion"
            raise InputError(f"test {run.record.name}: kind {run.record.kind!r} with {said}; a planned test is a "
                             "decay, or the body moves freely under a known force or wave elevation")
        path = make_interp_spline(run.time, run.raw, k=5, axis=1)       # the displacement itself: it has no noise
        runs[i] = replace(run, x=run.raw, v=path(run.time, 1), a=path(run.time, 2))
    large = [run for run, is_full in zip(runs, full) if is_full] or runs
    sizes = np.stack([np.sqrt(np.mean([np.mean(getattr(run, name) ** 2, axis=1) for run in large], axis=0))
                      for name in "xva"])
    return Simulated(model, tuple(runs), sizes, noise)


def response(model: Model, force: FloatArray, dt: float, start: FloatArray | None = None) -> FloatArray:
    """Return motion (3, n, nt, K) of the linear model from `start` (m + 2 n, K), under splines of force (n, nt, K)."""
    from radiation_ss.simulation.integrator import run_linear  # numba takes .2 s to load

    F, G = model.matrices()
    n, (size, count) = model.n, (F.shape[0], force.shape[1])
    block = np.zeros((size + 4 * n, size + 4 * n))
    block[:size, :size], block[:size, size:size + n] = F, G
    block[size:-n, size + n:] = np.eye(3 * n)
    step = expm(block * dt)
    pieces = CubicSpline(dt * np.arange(count), force, axis=1).c  # (4, nt - 1, n, K), highest power first
    drive = sum(np.tensordot(step[:size, size + p * n:size + (p + 1) * n], factorial(p) * pieces[3 - p], (1, 1))
                for p in range(4))  # (states, nt - 1, K)
    states = np.zeros((force.shape[2], count, size))
    if start is not None:
        states[:, 0] = start.T
    states[:, 1:] = np.transpose(drive, (2, 1, 0))
    transition = np.ascontiguousarray(step[:size, :size])
    for column in states:
        run_linear(transition, column)
    states, m = np.transpose(states, (2, 1, 0)), model.fit.states
    a = np.tensordot(F[m + n:], states, 1) + np.tensordot(G[m + n:], force, 1)
    return np.stack([states[m:m + n], states[m + n:], a])


def amplitudes(model: Model, amplitude: float | Mapping[str, float] | None) -> dict[str, float]:
    """Return the amplitude of each degree of freedom."""
    if amplitude is None:  # (M + A_inf) omega^2 x^2 as large as in the first degree of freedom at 1
        energy = [(model.M + model.A_inf)[i, i] * natural_frequency(model, i) ** 2 for i in range(model.n)]
        return {dof: float(np.sqrt(energy[0] / e)) for dof, e in zip(model.dofs, energy)}
    given = amplitude if isinstance(amplitude, Mapping) else dict.fromkeys(model.dofs, amplitude)
    for dof in model.dofs:
        if dof not in given:
            raise InputError(f"amplitude: none for {dof}")
    return {dof: positive(given[dof], f"amplitude of {dof}") for dof in model.dofs}
