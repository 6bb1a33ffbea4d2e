"""A record made ready for the integrator: its force on any time, its readings as one list."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import DEPTHS
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode
from radiation_ss.hydro.linear_waves import profile, wave_number
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.probe import check_elevation_at_body
from radiation_ss.records.record import Record
from radiation_ss.records.signals import columns_of
from radiation_ss.simulation.headings import force_of_waves, heading
from radiation_ss.simulation.measured import unsure_edge
from radiation_ss.waves.force import on_all


@dataclass(frozen=True, eq=False)
class Channel:
    """One sensor's samples that are there; `dof` is a position, `under_way` says that the body moved before."""

    dof: int
    quantity: str
    time: FloatArray
    value: FloatArray
    under_way: bool = False

    def window(self, first: float, last: float) -> "Channel":
        """Return the samples from first to last [s]."""
        keep = (self.time >= first) & (self.time <= last)
        return replace(self, time=self.time[keep], value=self.value[keep])


@dataclass(frozen=True, eq=False)
class Prepared:
    """A record on the model's degrees of freedom: the integrator's uniform times [s], from the first sample to past the
    last, the readings, and the force on each degree of freedom, None where it is unknown.
    """

    record: Record
    grid: FloatArray
    channels: tuple[Channel, ...]
    force: tuple[CubicSpline, ...] | None
    model: Model | None = None

    @cached_property
    def smooth(self) -> tuple[CubicSpline | tuple[FloatArray, FloatArray], ...]:
        """The force as steps of this grid can follow it: itself, or times and values, which take less memory."""
        assert self.force is not None
        slow = map(self._followed, self.force)
        return tuple(f if f is own else (f.x, f(f.x)) for f, own in zip(slow, self.force))

    def settled(self) -> "Prepared":
        """Return the same with the force only as steps of this grid can follow it."""
        found = replace(self, force=None)
        found.__dict__["smooth"] = self.smooth
        return found

    def drive(self, clock: FloatArray | None = None) -> FloatArray:
        """Return force, slope and clock at start, middle and end of each step, (nt, 9, n); `clock` (2 nt + 1, n): when
        the force acts, the grid with half steps if absent.
        """
        return self._at_steps([f if isinstance(f, CubicSpline) else CubicSpline(*f) for f in self.smooth], clock)

    @cached_property
    def wave_drive(self) -> FloatArray:
        """The waves (see `wave_motion`) as `drive` has the force, shape (nt, 9, rows)."""
        assert self.model is not None
        return self._at_steps([*map(self._followed, wave_motion(self.model, self.record))])

    def _followed(self, signal: CubicSpline) -> CubicSpline:
        return without_fast(signal, 1.6 / float(self.grid[1] - self.grid[0]))

    def _at_steps(self, splines: Sequence[CubicSpline], clock: FloatArray | None = None) -> FloatArray:
        """Return `laid_out` at start, middle and end of each step, shape (nt, 9, k)."""
        nt, two = self.grid.size, 2.0 * float(self.grid[1] - self.grid[0])
        found = laid_out(splines, half_steps(self.grid), clock, two)
        return np.stack([found[k:k + 2 * nt:2] for k in range(3)], axis=2).reshape(nt, 9, -1)


def laid_out(splines: Sequence[CubicSpline], time: FloatArray, clock: FloatArray | None = None,
             beyond: float = 0.0) -> FloatArray:
    """Return value, slope and clock (the times (nt, k) at which each acts; `time` if absent) of signals, (nt, 3, k).
    They stand still before and after their samples; up to `beyond` [s] after them they go on straight: the reading of
    the last sample leans on steps past it.
    """
    found = np.empty((time.size, 3, len(splines)))
    for i, f in enumerate(splines):
        found[:, 2, i] = time if clock is None else clock[:, i]
        inside = np.clip(found[:, 2, i], f.x[0], f.x[-1])
        found[:, 1, i] = f(inside, 1)
        found[:, 0, i] = f(inside) + found[:, 1, i] * np.clip(found[:, 2, i] - f.x[-1], 0.0, beyond)
    return found


def without_fast(force: CubicSpline, top: float, *, stop: float = 3.125, shape: float = 5.65,
                 reach: float = 5.6) -> CubicSpline:
    """Return a force as it is below `top` [rad/s], without what is faster than `stop` times that (60 dB).

    At the ends and middles of steps, force at one cycle a step comes back as a steady one, which a slow and lightly
    damped motion integrates. Steps of h can follow 1.6 / h. `shape`, `reach`: of the Kaiser window.
    """
    dt = float(np.median(np.diff(force.x)))
    if np.pi / dt <= stop * top or not np.any(force.c):
        return force
    time = np.linspace(force.x[0], force.x[-1], max(round((force.x[-1] - force.x[0]) / dt), 1) + 1)
    half = min(int(np.ceil(reach / top / dt)), time.size - 1)
    kernel = firwin(2 * half + 1, 0.5 * (1.0 + stop) * top * dt / np.pi, window=("kaiser", shape))
    values = np.pad(force(time), half, mode="reflect", reflect_type="odd")
    return CubicSpline(time, np.convolve(values, kernel, "valid"))


def half_steps(grid: FloatArray) -> FloatArray:
    """Return the grid with the middles of its steps, one step past its end, shape (2 nt + 1,)."""
    h = grid[1] - grid[0]
    return grid[0] + 0.5 * h * np.arange(2 * grid.size + 1)


LARGEST = 5_000_000  # Steps of a record at most


def prepare(model: Model, record: Record, h: float, *, trim: bool = True, largest: int = LARGEST) -> Prepared:
    """Pick the model's degrees of freedom from a record and interpolate its force, in at most `largest` steps.

    With `trim`, the ends of a record whose force comes from the elevation are left out.
    """
    channels = []
    for quantity in QUANTITIES:
        values = record.get(quantity, model.dofs)
        for i in range(model.n if values is not None else 0):
            there = np.isfinite(values[i])  # type: ignore[index]
            if there.sum() >= 2:
                channels.append(Channel(i, quantity, record.time[there], values[i][there],  # type: ignore[index]
                                        under_way=record.kind != "decay"))
    if not channels:
        short = [dof for dof in model.dofs if dof in record.dofs]
        if short:
            raise InputError(f"record {record.name}: fewer than two samples of the motion of {', '.join(short)} are "
                             f"left between {record.time[0]:.4g} and {record.time[-1]:.4g} s")
        raise InputError(f"record {record.name}: no motion of {', '.join(model.dofs)} in its columns, "
                         f"{', '.join(record.channels) or 'none'}")
    edge = unsure_edge(model, record) if trim else 0.0
    first, last = record.time[0] + edge, record.time[-1] - edge
    steps = int(np.ceil((record.time[-1] - first) / h)) + 1
    if steps > largest:
        raise InputError(f"record {record.name}: {record.time[-1] - first:.4g} s are {steps} steps of {h:.3g} s, which "
                         f"the model's frequencies need, more than {largest}; take a window of it, and see that its "
                         "time is in seconds")
    kept = tuple(c for each in channels if (c := each.window(first, last)).time.size >= 2)
    if not kept:
        raise InputError(f"record {record.name}: no motion is measured between {first:.4g} and {last:.4g} s, where the "
                         "force that comes from the wave elevation is sure")
    return Prepared(record, first + h * np.arange(steps + 1), kept, exciting_force(model, record), model)


def exciting_force(model: Model, record: Record) -> tuple[CubicSpline, ...] | None:
    """Return the force on each degree of freedom: recorded, zero in a decay, or from the wave elevation; else None."""
    force = record.get("force", model.dofs)
    if force is not None:
        splines = []
        for row, dof in zip(force, model.dofs):
            there = np.isfinite(row)
            if there.sum() < (2 if record.kind == "static" else 4):
                # What no column holds is zero, or that of a motion that stands still and is not asked for.
                if record.kind not in ("decay", "static") and (record.kind != "prescribed" or columns_of(record, dof)):
                    measured = tuple(d for d in model.dofs if d in record.dofs)
                    fewer = ("" if dof in record.dofs or not measured else
                             f"; a model of what it measures: read_model(path, dofs={measured})")
                    raise InputError(f"record {record.name}: {dof}_force has {there.sum()} samples where four are "
                                     f"needed; its columns are {', '.join(record.channels)}{fewer}")
                row, there = np.zeros(record.time.size), np.full(record.time.size, True)
            known = np.flatnonzero(there) if np.any(row[there]) else np.flatnonzero(there)[[0, -1]]
            splines.append(CubicSpline(record.time[known], row[known]))
        return tuple(splines)
    return wave_force(model, record) if known_in_waves(model, record) else None


def driven_at(model: Model, record: Record) -> list[FloatArray]:
    """Return the times at which a record has each force that moves the body, or the elevation that makes it."""
    force, rows = record.get("force", model.dofs), []
    if force is not None:
        rows = list(force)
    elif known_in_waves(model, record):
        rows = [record.channels["wave_elevation"]]
    return [record.time[np.isfinite(row)] for row in rows if np.isfinite(row).any() and np.nanstd(row) > 0.0]


def known_in_waves(model: Model, record: Record) -> bool:
    """Whether the record has the elevation, and the model X."""
    return "wave_elevation" in record.channels and model.hydro is not None and model.hydro.X is not None


def wave_force(model: Model, record: Record) -> tuple[CubicSpline, ...]:
    """Return X(w) times the elevation, by FFT with the record's ends faded to rest over the added length."""
    assert model.hydro is not None and model.hydro.X is not None
    known, X = model.hydro.omega, force_of_waves(model, record)
    time, force = filtered(record, lambda omega: on_all(known, X, omega))
    return tuple(CubicSpline(time, column) for column in force.T)


def filtered(record: Record, transfer: Callable[[FloatArray], ComplexArray]) -> tuple[FloatArray, FloatArray]:
    """Return even times and the elevation passed through transfer functions of omega, (nt,) and (nt, k)."""
    check_elevation_at_body(record)
    elevation = record.channels["wave_elevation"]
    there = np.isfinite(elevation)
    dt = float(np.median(np.diff(record.time[there])))
    time = np.arange(record.time[0], record.time[-1] + 0.5 * dt, dt)
    signal = CubicSpline(record.time[there], elevation[there])(np.clip(time, *record.time[there][[0, -1]]))
    pad = time.size
    full = np.concatenate([signal, np.zeros(pad)])
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(full.size, dt), dtype=np.float64)
    return time, np.fft.irfft(np.fft.rfft(full)[:, None] * transfer(omega), full.size, axis=0)[: time.size]


def flow_depth(model: Model) -> float:
    """Return a depth [m] of the size of the hull: the edge of a cube of its displacement.

    Of a model without a translation it is the inverse wave number at its first natural frequency.
    """
    rho, g = (model.hydro.rho, model.hydro.g) if model.hydro is not None else (1000.0, 9.81)
    masses = [model.M[i, i] for i, dof in enumerate(model.dofs) if mode(dof) in ("Surge", "Sway", "Heave")]
    return float(np.cbrt(masses[0] / rho)) if masses else g / natural_frequency(model, 0) ** 2


def wave_motion(model: Model, record: Record) -> tuple[CubicSpline, ...]:
    """Return elevation, its envelope [m], and orbital velocity of each degree of freedom [m/s, rad/s], at the body.

    At the model's reference point, or at the still surface where that is unknown or above, then for each degree of
    freedom again at the others of `DEPTHS`; of rotations the rate of the wave's slope (Airy; Faltinsen 1990, table
    2.1). Decays and forced motions without an elevation are in still water.
    """
    if "wave_elevation" not in record.channels:
        if record.kind not in ("decay", "forced", "prescribed", "static"):
            raise InputError(f"record {record.name}: an effect needs the waves, and there is no column wave_elevation "
                             "[m]; add it, or the kind (decay, forced) if the water is still")
        return (CubicSpline(record.time[[0, -1]], np.zeros(2)),) * (2 + len(DEPTHS) * model.n)
    known = model.hydro
    g, depth = (known.g, known.depth) if known is not None else (9.81, np.inf)
    along = heading(model, record)
    level = 0.0 if known is None else float(np.nan_to_num(min(known.reference_point[2], 0.0)))

    def transfer(omega: FloatArray) -> ComplexArray:
        w = np.maximum(omega, 1e-9)
        k = wave_number(w**2 / g, depth)
        surface, rows = profile(k, depth, np.zeros(k.size))[1], [np.ones(w.size), np.full(w.size, -1j)]
        for at in (max(level - share * flow_depth(model), -depth) for share in DEPTHS):
            flat, upright = profile(k, depth, np.full(k.size, at))
            slope = w * k * (1.0 if at == level else upright / surface)
            speed = {"Surge": g * k / w * flat * np.cos(along), "Sway": g * k / w * flat * np.sin(along),
                     "Heave": 1j * g / w * upright, "Roll": slope * np.sin(along), "Pitch": -slope * np.cos(along)}
            rows += [speed.get(mode(dof), np.zeros(w.size)) for dof in model.dofs]
        return np.asarray(np.where(omega[:, None] > 0.0, np.stack(rows, axis=1), np.eye(1, len(rows))), complex)

    time, found = filtered(record, transfer)
    found[:, 1] = np.hypot(found[:, 0], found[:, 1])
    return tuple(CubicSpline(time, column) for column in found.T)
