"""What looks wrong with a record: unit slips, dead, clipped and hanging channels, a decay that is held at first."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from shlex import quote

import numpy as np
from scipy.integrate import cumulative_trapezoid

from radiation_ss.arrays import FloatArray, distinct
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode, motion_unit
from radiation_ss.records import signals
from radiation_ss.records.column_checks import column_conflicts, column_doubts
from radiation_ss.records.columns import RATES, SUFFIXES, split
from radiation_ss.records.faults import FAULTS, clipped, faults, logged_again
from radiation_ss.records.marks import without_marks
from radiation_ss.records.record import Record
from radiation_ss.units import KNOT


def suspicions(record: Record, *, stated: bool = True, most: int = 200_000, longest_step: float = 4.5,
               shortest_step: float = 2e-5, fastest: float = 13.0) -> tuple[str, ...]:
    """Return a sentence for each thing that looks wrong with a record: units, signs, dead, clipped, hanging channels.

    And a free decay whose kind is not `stated`. Spectra and clipping are looked for in the first `most` samples.
    `longest_step` [s]: moored ships of 100 s are sampled every 3 s, a record at 200 Hz in ms has steps of 5.
    `shortest_step` [s]: blows are sampled at 20 kHz, and 1 Hz in days has steps of 1.2e-5. `fastest`: ship [m/s].
    """
    found, whole, rows = [], record, f"all {record.time.size} rows"
    if record.time.size > most:
        record, rows = record.window(-np.inf, float(record.time[most - 1])), f"the first {most} rows"
    if abs(record.speed) > fastest:
        found.append(f"comment 'speed': {record.speed:g} m/s is {record.speed / KNOT:.3g} knots; if it is in knots, "
                     f"write {record.speed * KNOT:.4g}")
    pushed = [name for name in record.channels if name == "wave_elevation" or name.endswith("_force")]
    if not stated and record.kind in ("waves", "motion-only") and not pushed:
        dying = [dof for dof in record.dofs if dof in record.channels and dies_away(record.channels[dof])]
        found += [f"{dof} dies away from its largest value as in a free decay; if no force acts, add `# kind: decay` "
                  "(kind='decay')" for dof in dying[:1]]
    step = float(np.median(np.diff(record.time)))
    if step > longest_step and record.kind != "static":
        found.append(f"time [s]: a sample every {step:.3g} s; is the time in milliseconds? Its header is then "
                     "`time [ms]`; offsets under steady loads are `# kind: static`")
    if (step := float(np.ptp(record.time)) / record.time.size) < shortest_step:
        found.append(f"time [s]: a sample every {step:.3g} s; is the time in days, as in a spreadsheet? Its header is "
                     "then `time [d]`")
    for name in whole.channels:
        said, values = without_marks(whole, name)
        there = values[np.isfinite(values)]
        found += [*said, *_channel(name, there, most, record.kind == "static"), *_zero(name, there, record.kind)]
        if said:
            record = record.with_channels(**{name: values[:record.time.size]})
    for dof in record.dofs:
        found += column_conflicts(record, dof, rows) or column_doubts(record, dof)
    return tuple(found)


def _zero(name: str, values: FloatArray, kind: str, far: float = 10.0, g: float = 9.81) -> Iterator[str]:
    """Yield a sentence for a motion `far` times its spread from zero, or an acceleration within .05 `g` of gravity."""
    if kind == "static" or values.size < 16 or np.ptp(values) == 0.0:
        return
    middle, spread = float(np.median(values)), float(np.std(values))
    if name.endswith("_acceleration") and motion_unit(split(name)[0]) == "m" and abs(abs(middle) - g) < 0.05 * g:
        yield f"{name}: {middle:.3g} m/s^2 on average; gravity is in it: take that off"
    elif not name.endswith(SUFFIXES) and abs(middle) > far * spread:
        yield (f"{name}: stands at {middle:.3g}, {abs(middle) / spread:.0f} times its standard deviation; it is from "
               "rest in still water: take off the reading at rest")


def named_apart(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records with names that differ: a number is added to those that are there already."""
    names = distinct(record.name for record in records)
    return tuple(replace(record, name=name) for record, name in zip(records, names))


def check_given_once(records: Sequence[Record], withheld: Sequence[Record] = ()) -> None:
    """Raise InputError if two records hold the same samples: one that is given twice would count twice."""
    named = [(f"{what} {i} ({record.file or record.name})", record) for what, group in (
        ("record", records), ("withheld record", withheld)) for i, record in enumerate(group, 1)]
    for (name, one), (other_name, other) in combinations(named, 2):
        if np.array_equal(one.time, other.time) and one.channels.keys() == other.channels.keys() and all(
                np.array_equal(values, other.channels[k], equal_nan=True) for k, values in one.channels.items()):
            raise InputError(f"{name} and {other_name} hold the same samples; give one of both")


def _channel(name: str, values: FloatArray, most: int, still: bool, largest: float = 50.0,
             lean: float = 1.2) -> Iterator[str]:
    """Yield what looks wrong with a channel: more than `largest` [m] or `lean` [rad], `most` samples on one value.

    A test that is `still` reads the same again and again.
    """
    if values.size < 2:
        yield f"{name}: {values.size} sample(s) in the whole record"
        return
    if np.ptp(values) == 0.0 and not (name.endswith("_force") and values[0] == 0.0):  # a decay test states force zero
        yield f"{name}: constant at {values[0]:.4g} over all {values.size} samples; a dead channel?"
    elif not name.endswith(SUFFIXES):
        unit = "m" if name == "wave_elevation" else motion_unit(name)
        size = float(np.ptp(values)) / 2.0
        if unit == "rad" and size > (np.pi if mode(name) == "Yaw" else lean):
            yield (f"{name} [rad]: an amplitude of {size:.3g}; is it in degrees? Its header is then `{name} [deg]`, "
                   f"or read_record(..., degrees=({name!r},)), --degrees {quote(name)}")
        if unit == "m" and size > largest:
            yield f"{name} [m]: an amplitude of {size:.3g}; is it in millimetres? Its header is then `{name} [mm]`"
    among = f" of the first {most}" if values.size > most else ""
    for side, level, count in clipped(np.delete(values[:most], logged_again(values[:most]))):
        yield f"{name}: clipped at {side} of {level:.4g} ({count} samples{among}); the sensor's range is too small"
    for fault, places in ({} if still else faults(name, values[:most])).items():
        if places.size and fault != "clipped":
            yield f"{name}: {places.size} samples{among} {FAULTS[fault]} (the first: {places[0] + 1}); leave them empty"


def dies_away(values: FloatArray, swings: int = 6, least: float = 0.7) -> bool:
    """Whether a motion begins at its largest value and each of its next `swings` is smaller than the one before.

    Of random motion one in 720 has six such swings, and few of these begin at the largest of all. The last third must
    stay below `least` of the first swing.
    """
    x = values[np.isfinite(values)]
    if x.size < 20:
        return False
    x = x - np.median(x[-(x.size // 3):])
    cross = np.flatnonzero(np.diff(np.sign(x)) != 0.0) + 1
    parts = np.split(np.abs(x), cross)[:swings + 1]
    if len(parts) < swings + 1:
        return False
    peaks = np.array([part.max() for part in parts])
    late = float(np.abs(x[-(x.size // 3):]).max())
    return bool(np.all(np.diff(peaks) < 0.0) and peaks[0] == np.abs(x).max() and late < least * peaks[0])


def without_dead(record: Record, least: float = 3.0) -> tuple[Record, tuple[str, ...]]:
    """Return the record without sensors that another one of the same motion speaks against, and a sentence each.

    They show nothing but noise where the motion that they ought to see is `least` times as large; rest is a motion of
    none. A motion that only constant readings show, not even noise, beside another that moves, is not measured, either.
    """
    dead, said = dict[str, FloatArray](), list[str]()
    channels = {dof: [dof + suffix for suffix in RATES if dof + suffix in record.channels] for dof in record.dofs}
    still = [dof for dof, names in channels.items() if names and all(constant(record.channels[n]) for n in names)]
    for dof in record.dofs:
        if dof in still and len(still) < len(channels):
            dead |= {name: np.full(record.time.size, np.nan) for name in channels[dof]}
            said.append(f"{dof} of {record.name} is constant while another motion is not: a dead channel, left out.")
            continue
        seen = signals.columns_of(record, dof)
        for order, name in enumerate(dof + suffix for suffix in RATES):
            values = record.channels.get(name, np.zeros(0))
            if not seen or np.isfinite(values).sum() < 2 or (order, name) in seen:
                continue
            omega, spectrum = signals.spectrum_of(record, record.channels[seen[0][1]])
            band = signals.band_of(omega, spectrum)
            moved = spectrum[band] * omega[band] ** (order - seen[0][0])
            made = signals.rms_in(record, moved, np.ones(band.sum(), dtype=bool))
            if least * np.nanstd(values) < made:
                dead[name] = np.full(record.time.size, np.nan)
                said.append(f"{name} of {record.name} shows no motion where another sensor does: a dead sensor, left "
                            "out.")
    return (record.with_channels(**dead) if dead else record), tuple(said)


def constant(values: FloatArray) -> bool:
    """Whether all samples that are there have one value."""
    return np.unique(values[np.isfinite(values)]).size == 1


def without_gravity(record: Record, least: float = 2.0) -> tuple[Record, tuple[str, ...]]:
    """Return the record without means of accelerations that no motion keeps up, and a sentence for each channel.

    Such a mean would change the velocity by more than `least` times what all the rest of the reading makes of it.
    """
    changed, said = dict[str, FloatArray](), list[str]()
    for dof in record.dofs:
        values = record.channels.get(name := f"{dof}_acceleration", np.zeros(0))
        there = np.isfinite(values)
        if there.sum() < 2:
            continue
        mean, time = float(np.mean(values[there])), record.time[there]
        velocity = cumulative_trapezoid(values[there] - mean, time)
        if abs(mean) * (time[-1] - time[0]) > least * np.ptp(velocity) > 0.0:
            changed[name] = values - mean
            said.append(f"{name} of {record.name}: a mean of {mean:.4g} {motion_unit(dof)}/s^2, which no motion keeps "
                        "up, is gravity or the sensor's zero and left out.")
    return (record.with_channels(**changed) if changed else record), tuple(said)


DEGREE = 4  # of the polynomial that a free motion is until it has gone half its way


def since_release(record: Record, surer: float = 5.0) -> tuple[Record, tuple[str, ...]]:
    """Return a decay from its release on, and a sentence if the body is held before, by what is not in the model.

    Until the first motion has gone half its way, each is a constant and then, from one instant that all share, a
    polynomial; a body that is free all along is the case of the first sample. `surer`: log likelihood by which held
    must be better.
    """
    when = _release(record, surer) if record.kind == "decay" else None
    if when is None:
        return record, ()
    return record.window(when, np.inf), (f"{record.name}: the body is held until {when:.4g} s; the record is taken "
                                         "from there.",)


def _release(record: Record, surer: float, least: int = 8, many: int = 400, apart: float = 0.3) -> float | None:
    """Return when the motions leave the place at which they are held; None if that is not away from rest.

    Away from rest begins by a share `apart` of the longest way. More than `many` samples are thinned out, then looked
    at again from nearby.
    """
    motions = [record.channels[dof] for dof in record.dofs if dof in record.channels]
    there = np.all(np.isfinite(motions), axis=0) if motions else np.zeros(0, dtype=bool)
    if there.sum() < 2 * least:
        return None
    t, x = record.time[there], np.array(motions)[:, there]
    begin, rest = np.median(x[:, :3], axis=1), np.median(x[:, -(t.size // 5):], axis=1)
    way = np.abs(x - begin[:, None])
    if np.all(np.abs(begin - rest) < apart * way.max(axis=1)):
        return None
    far = way > 0.5 * way.max(axis=1, keepdims=True)
    gone = np.argmax(far[:, :-2] & far[:, 1:-1] & far[:, 2:], axis=1)  # half the way to where it is farthest
    last = int(np.where(gone > 0, gone, t.size - 1).min())
    first, when = 0, t[0]
    while last - first >= least:
        pick = np.unique(np.linspace(first, last, many).astype(int))
        if (found := _held_until(t[pick], x[:, pick], surer)) is None:
            break
        when = found
        if pick.size == last - first + 1:
            break
        first = max(int(np.searchsorted(t, 4.0 * when - 3.0 * t[last])), first + 1)
    return float(when) if when > t[0] else None


def _held_until(t: FloatArray, x: FloatArray, surer: float, fine: float = 1e-3, alike: float = 0.2) -> float | None:
    """Return the latest instant that explains the motion as well as the best; None if the body may as well be free.

    The noise is unknown; a share `fine` of the way is what a polynomial does not follow. Mean squares that differ by
    `alike` are alike: noise need not be white, and to cut too late costs nothing.
    """
    size, instants = np.ptp(x, axis=1), t[:-3]

    def left(when: float, lowest: int) -> float:
        since = np.maximum(t - when, 0.0) / (t[-1] - t[0])
        basis = np.linalg.qr(since[:, None] ** np.array([0, *range(lowest, DEGREE + 1)]))[0]
        rest = x - (x @ basis) @ basis.T
        return float(np.sum(np.log(np.mean(rest**2, axis=1) + (fine * size) ** 2 + 1e-300)))

    free, held = left(t[0], 1), np.array([left(when, 2) for when in instants])
    if 0.5 * (t.size - DEGREE - 1) * (free - held.min()) < surer:
        return None
    return float(instants[np.flatnonzero(held <= held.min() + np.log1p(alike))[-1]])
