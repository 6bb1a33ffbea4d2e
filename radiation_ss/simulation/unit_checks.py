"""Whether the columns of a record agree with each other, with the model and with gravity: units, signs, dead forces."""

from collections.abc import Iterator, Sequence

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.records import signals
from radiation_ss.records.column_checks import FACTOR, column_conflicts, units_text
from radiation_ss.records.record import Record
from radiation_ss.simulation.force_checks import turned, turned_in_decay
from radiation_ss.simulation.misreadings import misread
from radiation_ss.simulation.pushes import let_go
from radiation_ss.simulation.size_checks import moved_by, moves_as, off_size, sizes, slopes, variance


def check_units(model: Model, records: Sequence[Record]) -> None:
    """Compare the columns of each degree of freedom with each other and with the model's motion; InputError names them.

    Numbers that ought to agree differ by more than FACTOR, or a motion goes against the force. What no comparison sees,
    as the size of all motion in a decay, passes; `doubts` speaks where it is too large for anything afloat.
    """
    for record in records:
        for text in _conflicts(model, record, records):
            raise InputError(f"record {record.name}, {text}")


def _conflicts(model: Model, record: Record, records: Sequence[Record]) -> Iterator[str]:
    """Yield what is wrong with a record beyond doubt."""
    for apart in _apart(model, record) if not slow_by_nature(record) else ():
        yield (f"{apart}; check the units (time in s), that the record is of this body, and its kind: forced, "
               "prescribed and static tests may be as slow as the rig likes")
    if record.kind == "static":
        for i, times in slopes(model, record).items():
            dof, unit = model.dofs[i], motion_unit(model.dofs[i])
            where = f"column {dof} or {dof}_force, all {record.time.size} rows"
            if times < 0.0:
                yield f"{where}: {dof} goes against the load; the sign of one of them is turned"
            if not 1.0 / FACTOR < times < FACTOR:
                degrees = f"; {dof} in degrees?" if unit == "rad" and 30.0 < 1.0 / times < 120.0 else ""
                yield (f"{where}: the load rises {times:.3g} times as much with {dof} as the model's stiffness says"
                       f"{degrees}; check the units ({dof} in {unit}, {dof}_force in {force_unit(dof)})")
        return
    for dof in model.dofs:
        yield from column_conflicts(record, dof)
    # Friction or a stop may hold a body that moves as the model where the force is larger, or that a static load heels.
    off = [text for dof, factor, text in off_size(model, record) if factor > 1.0 or not any(
        moves_as(model, other, dof) for other in records if other is not record)]
    held = np.inf if record.kind != "prescribed" else FACTOR  # a rig that prescribes the motion overcomes friction
    off = off or [text for _, times, text in sizes(model, record) if not 1.0 / FACTOR < times < held]
    if off := off + turned(model, record):
        kind, text = misread(model, [record]) or ("", "")
        yield from [text] if kind == "order" else off


def check_decays(model: Model, records: Sequence[Record], fall: float = 10.0) -> None:
    """Refuse records that state a force of zero and do not die out."""
    for record in records:
        for text in _lasting(model, record, fall):
            raise InputError(f"record {record.name}, {text}")


def _lasting(model: Model, record: Record, fall: float = 10.0) -> Iterator[str]:
    """Yield a sentence if no force acts, but the last third moves half as much as the liveliest, though the model's
    slowest motion falls by `fall` over a third. Of a motion that the model does not restore nothing is known: a mooring
    may.
    """
    force = record.get("force", model.dofs)
    free = any(model.C[i, i] == 0.0 and signals.columns_of(record, dof) for i, dof in enumerate(model.dofs))
    if free or force is None or not np.isfinite(force).any() or np.nansum(np.abs(force)) > 0.0:
        return
    poles = np.linalg.eigvals(model.matrices()[0])
    slowest = float(np.min(-poles[poles.imag != 0.0].real, initial=np.inf))
    length = float(record.time[-1] - record.time[0])
    if not np.isfinite(slowest) or slowest * length / 3.0 < np.log(fall):
        return
    thirds = np.array_split(np.arange(record.time.size), 3)
    power = np.array([sum(variance(record.channels[c][part]) / max(variance(record.channels[c]), 1e-300)
                          for c in _motion(model, record)) for part in thirds])
    if power[-1] > 0.25 * power.max() > 0.0:
        columns = [f"{dof}_force" for dof in model.dofs if f"{dof}_force" in record.channels]
        stated = (f"column {', '.join(columns)}: zero on all {record.time.size} rows" if columns
                  else f"kind {record.kind}: no force acts")
        yield (f"{stated}, but the motion does not die out: its last third has "
               f"{np.sqrt(power[-1] / power.max()):.0%} of the liveliest third's rms; in waves of unknown force leave "
               "the force columns out (kind motion-only); cut a decay test to one release")


def doubts(model: Model, record: Record) -> tuple[str, ...]:
    """Return a sentence for each thing that a result from this record cannot be trusted for."""
    if record.kind == "static":
        said = [text for _, _, text in sizes(model, record)]
    else:
        kind, text = misread(model, [record]) or ("", "")
        told = kind in ("order", "sign")
        large = [] if told else [text for _, _, text in sizes(model, record)]
        said = [*_short(model, record), *_gravity(model, record), *_paced(model, record),
                *(large or filter(None, [text])), *(text for _, _, text in off_size(model, record)),
                *(_apart(model, record) if slow_by_nature(record) else [])]
        if record.kind == "decay":
            said += [text for text, sure in turned_in_decay(model, record) if not (sure or told)]
            said += _lasting(model, record)
    strange = [name for dof in record.dofs if dof not in model.dofs for _, name in signals.columns_of(record, dof)]
    if strange:
        said.append(f"column {', '.join(strange)}: not used; the model's degrees of freedom are "
                    f"{', '.join(model.dofs)}")
    return tuple(f"record {record.name}, {text}" for text in said)


def slow_by_nature(record: Record) -> bool:
    """Whether the rig, not the sea or the body, chooses how fast the motion is."""
    return record.kind in ("forced", "prescribed", "static") or record.speed != 0.0


def _short(model: Model, record: Record) -> Iterator[str]:
    """Yield a sentence if a record is shorter than the model's memory or its quickest natural period."""
    length, memory = float(np.ptp(record.time)), memory_length(model)
    period = 2.0 * np.pi / own_frequencies(model).max(initial=0.0) if model.C.diagonal().any() else 0.0
    if length < max(memory, period):
        said = (f"the model's memory lasts {memory:.3g} s (until it has fallen to 1%)" if memory >= period else
                f"the model's shortest natural period is {period:.3g} s")
        yield (f"column time: its {record.time.size} rows end after {length:.3g} s, and {said}; too short to tell the "
               "memory from the start, which is not known")


def memory_length(model: Model, rest: float = 0.01) -> float:
    """Return the time [s] after which the kernels stay below a share `rest` of their largest value."""
    fit = model.fit
    slowest = float(np.min(-np.linalg.eigvals(fit.a).real, initial=np.inf))
    if not 0.0 < slowest < np.inf:
        return 0.0
    t = np.linspace(0.0, 1.5 * np.log(1.0 / rest) / slowest, 1000)
    kernel = np.abs(fit.kernel(t))
    lasting = np.flatnonzero((kernel > rest * np.maximum(kernel.max(axis=0), 1e-300)).any(axis=(1, 2)))
    return float(t[lasting[-1]]) if lasting.size else 0.0


def own_frequencies(model: Model) -> FloatArray:
    """Return the frequencies of the degrees of freedom each alone that have a stiffness, ascending [rad/s]."""
    squares = np.sort(np.abs(np.diag(model.C)) / np.diag(model.M + model.A_inf))
    return np.sqrt(squares[squares > 0.0])


def _apart(model: Model, record: Record) -> Iterator[str]:
    """Yield words for a motion whose frequency is far from all natural ones.

    A drive whose frequency is not far from them witnesses that time is right: a slow force and friction move a body so.
    """
    natural = own_frequencies(model)
    if natural.size < model.n:
        return

    def far(columns: Sequence[str]) -> FloatArray:
        found = np.array([signals.middle(*signals.spectrum_of(record, record.channels[c])) for c in columns])
        return found if found.max() * FACTOR < natural.min() or found.min() > FACTOR * natural.max() else found[:0]

    drive = [c for c in (*(f"{dof}_force" for dof in model.dofs), "wave_elevation") if variance(
        record.channels.get(c, np.zeros(1)))]
    motion = _motion(model, record)
    if motion and (found := far(motion)).size and not (drive and not far(drive).size):
        yield (f"column time, all {record.time.size} rows: the motion's frequency is {np.median(found):.3g} rad/s "
               f"where the model's own is {natural[0]:.3g} rad/s")


def _paced(model: Model, record: Record, factor: float = 1.5) -> list[str]:
    """Return a sentence if a decay swings by `factor` slower or quicker than the model. Damping slows, too, but by 3 %
    at most where the swing back is half the first one, and by 16 % where it is .15.
    """
    if record.kind != "decay" or record.speed or np.any(np.diag(model.C) <= 0.0):
        return []
    free, states = let_go(model, record)[0], model.fit.states + 2 * model.n
    columns, still = _motion(model, free), np.zeros((model.n, free.time.size))
    own = [signals.middle(*signals.spectrum_of(free, moved_by(model, free, still, np.eye(states)[i - 2 * model.n])[i],
                                               spiky=False)) for i in range(model.n)]
    found = [signals.middle(*signals.spectrum_of(free, free.channels[column])) for column in columns]
    if not found or min(own) <= 0.0:
        return []

    def swings_back(values: FloatArray, least: float) -> bool:
        values = values[np.isfinite(values)]
        away = values - values[-(values.size // 3 + 1):].mean()
        one, other = sorted((float(away.max()), float(-away.min())))
        return one > least * other

    times, least = min(found) / max(own), 0.15 if max(found) < 0.4 * min(own) else 0.5
    if max(found) < min(own) / factor and all(swings_back(free.channels[column], least) for column in columns):
        times = max(found) / min(own)
    elif times <= factor:
        return []
    return [f"column time: this decay swings {times:.2g} times as fast as the model; is one of them in another scale "
            f"(by Froude about 1 : {max(times, 1.0 / times) ** 2:.2g}), or a stiffness or inertia so many times off?"]


def _gravity(model: Model, record: Record, gravity: float = 9.81) -> Iterator[str]:
    """Yield a sentence for each translation that accelerates more than anything afloat does: `gravity` [m/s^2]."""
    for dof in model.dofs:
        have = signals.columns_of(record, dof)
        if not have or motion_unit(dof) != "m":
            continue
        order, column = have[0]
        omega, spectrum = signals.spectrum_of(record, record.channels[column])
        acceleration = signals.rms_in(record, spectrum * omega ** (2 - order), signals.band_of(omega, spectrum))
        if acceleration > gravity:
            yield (f"column {column}, all {record.time.size} rows: an acceleration of {acceleration:.3g} m/s^2 (rms), "
                   f"more than that of gravity; {units_text(dof, (column,))}")


def _motion(model: Model, record: Record) -> list[str]:
    return [column for dof in model.dofs for _, column in signals.columns_of(record, dof)]
