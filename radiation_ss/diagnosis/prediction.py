"""What is predicted, its errors, and the gap that they make."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.errors import InputError, SolverError
from radiation_ss.inference.effect_features import Feature, features
from radiation_ss.inference.effect_symbols import Symbols
from radiation_ss.inference.equation import radiation_left_out
from radiation_ss.inference.grid import averaged, fewest
from radiation_ss.inference.motion import MeasuredMotion, measured_motion, with_waves
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.record import Record
from radiation_ss.records.signals import columns_of
from radiation_ss.simulation.linear import radiation_states
from radiation_ss.simulation.rollout import reading
from radiation_ss.simulation.run import run


@dataclass(frozen=True, eq=False)
class Error:
    """Measured signal and what a model leaves of it, for one degree of freedom of one record.

    Parameters
    ----------
    record : str
    dof : int
    quantity : str
        displacement, velocity, acceleration, or force where the motion is prescribed.
    time, measured, error : ndarray, shape (nk,)
    least : float
        Root mean square that the signal counts as at least: a static load may be zero where the others move the body.
    static : bool
        Whether the samples are places of a static test, the time their numbers.
    """

    record: str
    dof: int
    quantity: str
    time: FloatArray
    measured: FloatArray
    error: FloatArray
    least: float = 0.0
    static: bool = False


def split(model: Model, records: Sequence[Record], tail: float, levels: int) -> tuple[list[Record], list[Record]]:
    """Return the parts of records from which numbers are fitted for the check, and those that check them.

    The time of a record is cut in two; the waves beyond the cut that make a part's force stay with it. The rows of a
    static test, of which `levels` are kept, have no order in time: to check it, loads are taken from among all others.
    """
    pairs = [places_apart(r, tail, levels) if r.kind == "static" else
             (with_waves(model, r, float(r.time[0]), cut), with_waves(model, r, cut, float(r.time[-1])))
             for r, cut in ((record, cut_of(record, tail)) for record in records)]
    return [head for head, _ in pairs], [rest for _, rest in pairs]


def places_apart(record: Record, share: float, levels: int) -> tuple[Record, Record]:
    """Return a static test without a share of its loads, and with these alone; twice the whole if it has too few.

    They are spread evenly over the loads in ascending order, of equal ones over the places, so that the order of rows
    does not choose them. All places stay: they tell which way the body came. Rows that are averaged stay together.
    """
    loads = [name for name in record.channels if name.endswith("_force")]
    places = [dof for dof in record.dofs if dof in record.channels]
    keep = max(record.time.size // levels, 1)
    keys = averaged(np.array([record.channels[name] for name in (*loads, *places)]), keep)
    known = np.flatnonzero(np.isfinite(keys).all(axis=0))
    every = max(round(1.0 / share), 2)
    ascending = known[np.lexsort(keys[::-1, known])]
    chosen = np.isin(np.arange(record.time.size) // keep, ascending[every // 2::every])
    if min(chosen.sum(), known.size * keep - chosen.sum()) < fewest(record) * keep:
        return record, record

    def of(rows: np.ndarray) -> Record:
        return record.with_channels(**{name: np.where(rows, record.channels[name], np.nan) for name in loads})

    return of(~chosen), of(chosen)


def cut_of(record: Record, tail: float, swings: int = 8) -> float:
    """Return the time at which the last share of a record begins.

    Of a decay it is a share of the squared motion, for in the last third of the time there may be only noise; so many
    swings, to either side, come before it.
    """
    cut = float(record.time[-1] - tail * (record.time[-1] - record.time[0]))
    columns = [columns_of(record, dof)[0][1] for dof in record.dofs if columns_of(record, dof)]
    if record.kind != "decay" or not columns:
        return cut
    late = record.time.size // 5 + 1
    apart = np.array([record.channels[c] - np.nanmedian(record.channels[c][-late:]) for c in columns])
    square = np.cumsum(np.nansum((apart / np.nanstd(apart, axis=1, keepdims=True)) ** 2, axis=0)
                       * np.gradient(record.time))
    turns = [np.flatnonzero(np.diff(np.signbit(row))) for row in apart]
    moved = float(record.time[np.searchsorted(square, (1.0 - tail) * square[-1])])
    swung = [float(record.time[t[swings - 1]]) if t.size >= swings else cut for t in turns]
    return min(cut, max(moved, *swung))


def errors_on(model: Model, actives: Sequence[Active], record: Record, starts: dict[int, FloatArray]) -> list[Error]:
    """Predict a record from its start and return the errors.

    Of each degree of freedom the displacement counts; a velocity or acceleration only where there is none. Of a
    prescribed motion the force counts. Starts found are kept by the record's identity in `starts`, for the next to be
    sought near them. SolverError if the motion grows without bounds.
    """
    if record.kind in ("prescribed", "static"):
        return force_errors(model, actives, measured_motion(model, record))
    rollout, prepared, motion, p = run(model, record, tuple(actives), None, near=starts.get(id(record)))
    starts[id(record)] = motion.state[0]
    found = []
    for dof in range(model.n):
        channels = [c for q in QUANTITIES for c in prepared.channels if c.dof == dof and c.quantity == q]
        for channel in channels[:1]:
            value, _ = reading(rollout, motion, prepared.grid, channel, p)
            found.append(Error(record.name, dof, channel.quantity, channel.time, channel.value, channel.value - value))
    return found


def force_errors(model: Model, actives: Sequence[Active], motion: MeasuredMotion) -> list[Error]:
    """Return what a model leaves of the measured force along a prescribed motion."""
    assert motion.force is not None
    read, told = np.eye(model.n), np.ones((model.n, 1))
    off: FloatArray = np.zeros_like(motion.x)
    for active, value, found in strengths_along(model, actives, motion):
        R = found.reading_response[0].real
        read, off = read + value * R, off + value * (found.reading - R @ motion.x)
        if active.effect.linear and active.effect.input is not None:
            told = told + value * np.diag(found.response[0].real)[:, None]
    true = truly(model, motion, np.asarray(np.linalg.inv(read), dtype=np.float64))
    still = motion.record.kind == "static"
    damping = model.D @ (true.pace if still else true.v)
    force = (model.M + model.A_inf) @ true.a + damping + true.memory + model.C @ true.x
    force = force - radiation_left_out(model, true).force
    if np.any(off):
        force = force - needed_force(model, motion, np.asarray(np.linalg.solve(read, off), dtype=np.float64))
    for _, value, found in strengths_along(model, actives, true):
        force = force - value * found.force
    error = (motion.force - force) / told
    # What the motion does beyond the record's ends reaches into the acceleration by half a test function.
    size = min(motion.basis[0].g.shape[1] // 2, motion.time.size // 8)
    edge = max(size, 1)
    held = motion.x * np.diag(model.C)[:, None] if still else 0.0 * motion.x
    inner = np.arange(edge, motion.time.size - edge)
    known = np.flatnonzero(motion.basis[0].g.any(axis=0))
    errors = []
    for i in map(int, np.flatnonzero(motion.free)):
        if still:  # which way the first place was reached is not known, and so not what friction holds there
            inner = known[motion.v[i, known] != 0.0] if np.any(motion.v[i, known]) else known
        errors.append(Error(motion.record.name, i, "force", motion.time[inner], motion.force[i, inner],
                            error[i, inner], float(np.sqrt(np.mean(held[i, inner] ** 2))), still))
    return errors


def strengths_along(model: Model, actives: Sequence[Active],
                    motion: MeasuredMotion) -> Iterator[tuple[Active, float, Feature]]:
    """Yield each strength of some effects with its value and what a unit of it makes along a record."""
    for active in actives:
        strengths = [name for name, p in active.effect.parameters.items() if p.strength]
        for name, found in zip(strengths, features(Symbols(model, active), active, [motion])):
            yield active, active.values.get(name, 0.0), found[0]


def truly(model: Model, motion: MeasuredMotion, share: FloatArray) -> MeasuredMotion:
    """Return the motion that is a share (n, n) of what its sensors read, with the radiation force of its clear part."""
    x, states = share @ motion.x, motion.radiation
    if motion.record.kind != "static":
        states = radiation_states(model, x, motion.dt)
    return replace(motion, x=x, v=share @ motion.v, a=share @ motion.a, memory=model.fit.c @ states, radiation=states)


def needed_force(model: Model, motion: MeasuredMotion, x: FloatArray) -> FloatArray:
    """Return the force that a share x (n, nt) of a record's displacement needs, in a static test by stiffness alone."""
    if motion.record.kind == "static":
        return np.asarray(model.C @ x)
    spline = make_interp_spline(motion.time, x, k=5, axis=1)
    v, a = (spline(motion.time, order) for order in (1, 2))
    memory = model.fit.c @ radiation_states(model, x, motion.dt)
    return np.asarray((model.M + model.A_inf) @ a + model.D @ v + memory + model.C @ x)


def gap_of(errors: Sequence[Error]) -> float:
    """Return the gap: rms error over rms measured, pooled over degrees of freedom each scaled by its own rms."""
    return float(np.sqrt(energy(errors).sum()))


def energy(errors: Sequence[Error], sizes: Mapping[tuple[str, int], float] | None = None) -> FloatArray:
    """Return each error's part of the squared gap, shape (errors,): of each signal's own, of equal weight.

    Motion and force of one degree of freedom, or its displacement and acceleration, are signals of their own.
    """
    signals = [(e.dof, e.quantity) for e in errors]
    total = dict.fromkeys(signals, 0.0)
    for e, signal in zip(errors, signals):
        own = float(np.sum((e.measured - mean_of(e)) ** 2))
        least = max(e.least**2, (sizes or {}).get((e.record, e.dof), 0.0))
        total[signal] += max(own, least * e.measured.size)
    return np.array([np.sum(e.error**2) / max(total[s], 1e-300) / len(total) for e, s in zip(errors, signals)])


def mean_of(error: Error) -> float:
    """Return the level that a signal's size is measured from: zero, but for a mean larger than what varies."""
    mean, spread = float(np.mean(error.measured)), float(np.std(error.measured))
    return mean if abs(mean) > spread > 0.0 else 0.0


def cosines(time: FloatArray, top: float) -> FloatArray:
    """Return a constant and the cosines of whole half periods over a record, up to a frequency, shape (nt, k)."""
    span = float(time[-1] - time[0])
    count = int(top * span / np.pi) + 1
    return np.asarray(np.cos(np.pi * np.outer((time - time[0]) / span, np.arange(count))))


def without_slow(errors: Sequence[Error], slow: Mapping[tuple[str, int], float]) -> list[Error]:
    """Return errors without what is slower than a frequency, of those motions of a record that have one."""
    found = []
    for e in errors:
        if (e.record, e.dof) in slow and np.any(e.error):
            basis = cosines(e.time, slow[e.record, e.dof])
            e = replace(e, error=e.error - basis @ np.linalg.lstsq(basis, e.error, rcond=None)[0])
        found.append(e)
    return found


def clocks(errors: Sequence[Error], least: float, share: float) -> list[str]:
    """Return a sentence for each signal whose error is that it is read early or late, but for a share of its energy.

    To first order the error is the lag times the rate. Errors of less than `least` of the signal are not told, and none
    where all are late or all early: damping and stiffness shift the phase of regular waves alike.
    """
    said, lags = [], [0.0]
    for e in errors:
        if e.quantity == "force" or e.time.size < 3:
            continue
        rate = np.gradient(e.measured - e.error, e.time)
        lag = -float(e.error @ rate) / max(float(rate @ rate), 1e-300)
        energy, rest = float(e.error @ e.error), float(np.sum((e.error + lag * rate) ** 2))
        if energy > least**2 * float(e.measured @ e.measured) and rest < share * energy:
            lags.append(lag)
            said.append(f"Record {e.record}: its motion comes {abs(lag):.2g} s {'later' if lag > 0.0 else 'earlier'} "
                        f"than predicted, which makes {1.0 - rest / energy:.0%} of what is left there; are the clocks "
                        "of force and motion the same in all records?")
    return said if min(lags) < 0.0 < max(lags) else []


class Predictor:
    """Errors of one model with any effects on records: what is predicted is kept, and so are the starts.

    `largest`: numbers that are kept at most, 8 bytes each; what was predicted for more is predicted again.
    """

    def __init__(self, model: Model, largest: int = 10_000_000) -> None:
        self.model, self.largest, self._held = model, largest, 0
        self._known: dict[tuple[Any, ...], list[Error] | None] = {}
        self._starts: dict[int, FloatArray] = {}

    def __call__(self, actives: Sequence[Active], records: Sequence[Record]) -> list[Error] | None:
        """Return the errors on several records; None if a prediction grows without bounds, or needs too short steps."""
        found: list[Error] = []
        for record in records:
            key = (id(record), *((a.name, a.dof, a.other, *a.vector) for a in actives))
            if key not in self._known:
                self._keep(key, self._errors(actives, record))
            errors = self._known[key]
            if errors is None:
                return None
            found += errors
        return found

    def _errors(self, actives: Sequence[Active], record: Record) -> list[Error] | None:
        try:
            return errors_on(self.model, actives, record, self._starts)
        except SolverError:
            return None
        except InputError:
            if not actives:
                raise
            return None

    def _keep(self, key: tuple[Any, ...], errors: list[Error] | None) -> None:
        size = sum(e.time.size + e.measured.size + e.error.size for e in errors or ())
        if self._held + size > self.largest:
            self._known.clear()
            self._held = 0
        self._known[key] = errors
        self._held += size
