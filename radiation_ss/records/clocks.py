"""Two records of one run on one clock."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.records.record import Record
from radiation_ss.records.sensors import even_samples


def clock_offset(record: Record, other: Record, channel: str, other_channel: str | None = None, *,
                 largest: float | None = None, least: float = 0.7) -> tuple[float, float]:
    """Return by how much another record's clock is behind, from what both see, and how alike they are there.

    The delay of the largest correlation, in the band of the first signal: of an acceleration and a displacement of one
    degree of freedom the second one is differentiated. `other.time + offset` is the record's clock.

    Parameters
    ----------
    record, other : Record
    channel, other_channel : str
        What both see, for example "Heave" by a camera and "Heave_acceleration"; the same name if absent.
    largest : float, optional
        Largest offset looked for [s]; half of the shorter record if absent.
    least : float
        Smallest correlation, 0 to 1.

    Returns
    -------
    offset : float
        [s]
    correlation : float
        Of the two signals at this offset.

    Raises
    ------
    InputError
        If a channel is absent, the records are of two quantities, or nothing alike is found.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> t = np.arange(0.0, 60.0, 0.05)
    >>> path = lambda t: np.exp(-0.02 * (t - 30.0) ** 2) * np.sin(3.0 * t)
    >>> camera, logger = rss.Record(t, {"Heave": path(t)}), rss.Record(t, {"Heave": path(t + 2.34)})
    >>> round(rss.clock_offset(camera, logger, "Heave")[0], 2)
    2.34
    """
    other_channel = other_channel or channel
    orders = [_order(name) for name in (channel, other_channel)]
    if orders[0][0] != orders[1][0]:
        raise InputError(f"clocks: {channel} and {other_channel} are not one degree of freedom")
    for run, name in ((record, channel), (other, other_channel)):
        if name not in run.channels:
            raise InputError(f"record {run.name}: no channel {name!r}")
    (t1, x1), (t2, x2) = (even_samples(run, name, run.channels[name])
                          for run, name in ((record, channel), (other, other_channel)))
    dt = min(t1[1] - t1[0], t2[1] - t2[0])
    a, b = (CubicSpline(t, x)(np.arange(t[0], t[-1], dt)) for t, x in ((t1, x1), (t2, x2)))
    reach = largest if largest is not None else 0.5 * dt * min(a.size, b.size) + abs(t1[0] - t2[0])
    lags, alike = _correlation(a, b, dt, orders[1][1] - orders[0][1])
    offsets = t1[0] - t2[0] - lags
    alike = np.where(np.abs(offsets) > reach, -np.inf, alike)
    best = int(np.argmax(alike))
    if not alike[best] >= least:
        raise InputError(f"clocks: {channel} of {record.name} and {other_channel} of {other.name} are nowhere alike "
                         f"within {reach:.4g} s (correlation {alike[best]:.2f}, {least:g} needed)")
    around = alike[[best - 1, best, (best + 1) % alike.size]]
    bend = around[0] - 2.0 * around[1] + around[2]
    peak = 0.5 * (around[0] - around[2]) / bend if np.isfinite(bend) and bend < 0.0 else 0.0
    return float(offsets[best] - peak * (lags[1] - lags[0])), float(alike[best])


def _correlation(a: FloatArray, b: FloatArray, dt: float, order: int) -> tuple[FloatArray, FloatArray]:
    """Return lags [s], four a sample, and the correlation there, in the band of a, with a differentiated `order` times.

    A negative order differentiates b.
    """
    size = 1 << int(np.ceil(np.log2(a.size + b.size)))
    omega = 2.0 * np.pi / (size * dt) * np.arange(size // 2 + 1)
    A, B = (np.fft.rfft((x - x.mean()) * np.hanning(x.size), size) for x in (a, b))
    power = np.cumsum(np.abs(A) ** 2)
    centre = omega[int(np.searchsorted(power, 0.5 * power[-1]))]
    band = (omega > centre / 3.0) & (omega < 3.0 * centre)
    A = np.where(band, A * (1j * omega) ** max(order, 0), 0.0)
    B = np.where(band, B * (1j * omega) ** max(-order, 0), 0.0)
    whole = float(np.sum(np.abs(A) ** 2) * np.sum(np.abs(B) ** 2))
    alike = 2.0 * size * np.fft.irfft(np.conj(A) * B, 4 * size) / np.sqrt(whole) if whole > 0.0 else np.zeros(4 * size)
    lags = np.asarray(0.25 * dt * np.fft.fftfreq(4 * size, 1.0 / (4 * size)), dtype=np.float64)
    return lags, alike


def _order(channel: str) -> tuple[str, int]:
    """Return degree of freedom and order of the derivative of a motion channel."""
    for order, suffix in ((1, "_velocity"), (2, "_acceleration")):
        if channel.endswith(suffix):
            return channel.removesuffix(suffix), order
    return channel, 0


def joined(record: Record, other: Record, offset: float = 0.0) -> Record:
    """Return one record of both, the other's clock moved by `offset` [s]; where only one has a sample the rest is NaN.

    Parameters
    ----------
    record, other : Record
        Kind, name and comments are those of the first.
    offset : float
        From `clock_offset` [s].

    Raises
    ------
    InputError
        If a channel is in both.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> camera = rss.Record([0.0, 0.1, 0.2], {"Heave": [0.0, 1.0, 2.0]})
    >>> logger = rss.Record([0.0, 0.1], {"Heave_acceleration": [5.0, 6.0]})
    >>> rss.joined(camera, logger, 0.1).channels["Heave_acceleration"].tolist()
    [nan, 5.0, 6.0]
    """
    both = [name for name in other.channels if name in record.channels]
    if both:
        raise InputError(f"records {record.name} and {other.name}: both have a channel {both[0]!r}")
    moved = other.time + offset
    time = np.union1d(np.round(record.time, 9), np.round(moved, 9))
    channels = {}
    for clock, run in ((record.time, record), (moved, other)):
        place = np.searchsorted(time, np.round(clock, 9))
        for name, values in run.channels.items():
            channels[name] = np.full(time.size, np.nan)
            channels[name][place] = values
    return Record(time, channels, kind=record.kind, name=record.name, start=record.start, meta=record.meta,
                  speed=record.speed)
