"""When a body that is held at first is let go: where a decay begins."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.records.record import Record

DEGREE = 4  # of the polynomial that a free motion is until it has gone half its way


def since_release(record: Record, surer: float = 5.0) -> tuple[Record, tuple[str, ...]]:
    """Return a decay from its release on, and a sentence if the body is held before.

    Loggers start before the release, and whatever holds the body until then is not in the model. Until the first motion
    has gone half its way, each motion is a constant and then, from one instant on that all share, a polynomial in time;
    a body that is free all along is the case where the instant is the first sample. `surer`: log likelihood by which a
    motion that is held at first must be the better one.
    """
    when = _release(record, surer) if record.kind == "decay" else None
    if when is None:
        return record, ()
    return record.window(when, np.inf), (f"{record.name}: the body is held until {when:.4g} s; the record is taken "
                                         "from there.",)


def _release(record: Record, surer: float, least: int = 8, many: int = 400, apart: float = 0.3) -> float | None:
    """Return when the motions leave the place at which they are held; None if they are not held away from rest.

    `least` samples are needed; more than `many` are thinned out, and the place is looked at again from nearby. Away
    from rest is a motion that begins there by a share `apart` of its longest way.
    """
    motions = [record.channels[dof] for dof in record.dofs if dof in record.channels]
    there = np.all(np.isfinite(motions), axis=0) if motions else np.zeros(0, dtype=bool)
    if there.sum() < 2 * least:
        return None
    t, x = record.time[there], np.array(motions)[:, there]
    begin, rest = np.median(x[:, :3], axis=1), np.median(x[:, -(t.size // 5):], axis=1)
    if np.all(np.abs(begin - rest) < apart * np.abs(x - begin[:, None]).max(axis=1)):
        return None
    last = min(_half_way(row) for row in x)
    first, when = 0, t[0]
    while last - first >= least:
        pick = np.unique(np.linspace(first, last, many).astype(int))
        found = _held_until(t[pick], x[:, pick], surer)
        if found is None:
            break
        when = found
        if pick.size == last - first + 1:
            break
        first = max(int(np.searchsorted(t, 4.0 * when - 3.0 * t[last])), first + 1)
    return float(when) if when > t[0] else None


def _half_way(x: FloatArray) -> int:
    """Return the sample at which a motion has gone half the way to where it is farthest from its first place."""
    way = np.abs(x - np.median(x[:3]))
    far = way > 0.5 * way.max()
    return int(np.argmax(far[:-2] & far[1:-1] & far[2:])) or x.size - 1


def _held_until(t: FloatArray, x: FloatArray, surer: float, fine: float = 1e-3, alike: float = 0.2) -> float | None:
    """Return the latest instant that explains the motion as well as the best; None if the body may as well be free.

    A free motion has one number more, its first velocity, in place of the instant. The noise is unknown; a share
    `fine` of the way is what a polynomial does not follow. Mean squares that differ by `alike` are alike: noise need
    not be white, and to cut too late costs nothing.
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
