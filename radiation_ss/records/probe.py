"""The wave elevation at another place than the probe's, where the body is."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter, lfiltic

from radiation_ss.arrays import FloatArray, positive, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.linear_waves import group_velocity, wave_number
from radiation_ss.records.convert import as_record
from radiation_ss.records.csv_files import number_in
from radiation_ss.records.record import Record
from radiation_ss.records.signals import even_samples


def at_the_body(record: Record, distance: float | None = None, *, depth: float = np.inf, g: float = 9.81) -> Record:
    """Return the record with the wave elevation at the body, carried from a probe that stands elsewhere.

    Parameters
    ----------
    record : Record
        With `wave_elevation` as the probe measured it, without the body's own waves.
    distance : float, optional
        From the probe to the body in the direction in which the waves travel [m]. If absent, that of the comment
        `# probe: x`, the probe's place along that direction with the body at 0.
    depth, g : float
        Water depth [m], gravity [m/s^2].

    Raises
    ------
    InputError
        If there is no elevation or distance, the body is under way, or samples are missing over more than two steps.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> t = np.arange(0.0, 60.0, 0.05)
    >>> probe = rss.Record(t, {"wave_elevation": 0.02 * np.cos(6.0 * t)}, meta={"probe": "-1.5"})
    >>> body = rss.at_the_body(probe)
    >>> round(float(np.nanmax(np.abs(body.channels["wave_elevation"] - 0.02 * np.cos(6.0 * t - 3.67 * 1.5)))), 3)
    0.0
    """
    record = as_record(record)
    if (values := record.channels.get("wave_elevation")) is None:
        raise InputError(f"record {record.name}: no channel wave_elevation to carry to the body")
    if record.speed != 0.0:
        raise InputError(f"record {record.name}: speed {record.speed:g} m/s; a probe is carried to a body at rest only")
    if distance is None:
        if "probe" not in record.meta:
            raise InputError(f"record {record.name}: the place of the probe is not known; give the distance [m], or "
                             "the comment `# probe: x`")
        distance = -probe_place(record)
    grid, even = even_samples(record, "wave_elevation", values)
    moved = carry_elevation(even, grid[1] - grid[0], distance, depth=depth, g=g)
    inside = np.isfinite(moved)
    at = CubicSpline(grid[inside], moved[inside])(record.time)
    at[(record.time < grid[inside][0]) | (record.time > grid[inside][-1]) | ~np.isfinite(values)] = np.nan
    here = {"probe": "0"} if "probe" in record.meta else {}
    return replace(record.with_channels(wave_elevation=at), meta={**record.meta, **here})


def probe_place(record: Record) -> float:
    """Return the place of the wave probe [m] by the comment `probe`, 0 without one; InputError if it is no number."""
    stated = str(record.meta.get("probe", "0"))
    place = number_in(stated, "m")
    if not np.isfinite(place):
        raise InputError(f"record {record.name}: comment 'probe': {stated!r} is no place [m] along the waves, the body "
                         "at 0; write metres, for example -1.5, and a probe's name under another key")
    return place


def check_elevation_at_body(record: Record) -> None:
    """Refuse a record whose wave probe stands elsewhere by its own comment."""
    place = probe_place(record)
    if "wave_elevation" in record.channels and place != 0.0:
        raise InputError(f"record {record.name}, column wave_elevation: comment 'probe' says that it was measured at "
                         f"{place:g} m, and the body is at 0; at_the_body(record, depth=...) carries it there, or "
                         "leave the column out (--ignore wave_elevation)")


def carry_elevation(elevation: ArrayLike, dt: float, distance: float, *, depth: float = np.inf, g: float = 9.81,
                    share: float = 0.99) -> FloatArray:
    """Return the elevation of long-crested waves some way farther on [m], NaN where the samples do not tell it.

    Each harmonic a e^{i w t} becomes a e^{i (w t - k d)}. Waves that pass the probe reach the place with their group
    speed: what has passed before the first sample, or passes after the last one, is not known there. The slowest and
    the fastest waves looked at are those between which `share` of the energy lies. There must be no waves from
    elsewhere.

    Parameters
    ----------
    elevation : array_like, shape (nt,)
        Even samples without gaps [m].
    dt : float
        Time step [s].
    distance : float
        From the probe to the place, in the direction in which the waves travel [m]; negative where they pass the place
        first.
    depth, g : float
        Water depth [m], gravity [m/s^2].
    share : float
        0 to 1.

    Raises
    ------
    InputError
        If a sample is missing, an argument is out of its range, or the record is shorter than the waves' way.

    Examples
    --------
    A wave of 1 s in deep water is 1.56 m long: 0.78 m farther on it is in opposite phase.

    >>> t = 0.02 * np.arange(3000)
    >>> moved = carry_elevation(np.cos(2.0 * np.pi * t), 0.02, 9.81 / (4.0 * np.pi))
    >>> round(float(moved[1500] / np.cos(2.0 * np.pi * t[1500])), 2)
    -1.0
    """
    x = read_only(elevation, "elevation", (None,))
    dt, depth = positive(dt, "dt", "s"), positive(depth, "depth", "m", or_infinite=True)
    g = positive(g, "g", "m/s^2")
    if not 0.0 < share < 1.0:
        raise InputError(f"share: {share}; a share of the energy between 0 and 1 is needed, such as 0.99")
    if not np.isfinite(distance):
        raise InputError(f"distance: {distance} m; a finite number is needed")
    mean = float(x.mean())
    energy = np.cumsum(np.abs(rfft((x - mean) * np.hanning(x.size))[1:]) ** 2)
    omega = 2.0 * np.pi / (x.size * dt) * np.arange(1, energy.size + 1)
    if energy[-1] == 0.0:
        return np.array(x)
    low, middle, high = (omega[np.searchsorted(energy, part * energy[-1])] for part in
                         (0.5 * (1.0 - share), 0.5, 0.5 * (1.0 + share)))
    ends = np.array([low, high])
    lags = distance / group_velocity(ends, wave_number(ends**2 / g, depth), depth)
    # Beyond the samples the waves go on as they went: a sudden end would send waves of all lengths.
    more = int(2.0 * np.abs(lags).max() / dt) + 1
    order = min(int(6.0 * np.pi / (middle * dt)) + 2, x.size // 3)
    before, after = _continued(x[::-1] - mean, order, more)[::-1], _continued(x - mean, order, more)
    longer = np.concatenate([before, x - mean, after])
    period = next_fast_len(longer.size + more, real=True)
    harmonics = 2.0 * np.pi / (period * dt) * np.arange(1, period // 2 + 1)
    k = np.concatenate([[0.0], wave_number(harmonics**2 / g, depth)])
    moved = irfft(rfft(longer, period) * np.exp(-1j * k * distance), period)[more:more + x.size] + mean
    first = int(np.ceil(max(lags.max(), 0.0) / dt))
    last = x.size + int(np.floor(min(lags.min(), 0.0) / dt))
    if last - first < 2:
        raise InputError(f"elevation: {x.size * dt:.4g} s are too short; the waves need {np.abs(lags).max():.4g} s for "
                         f"{abs(distance):g} m")
    moved[:first] = moved[last:] = np.nan
    return moved


def _continued(x: FloatArray, order: int, count: int) -> FloatArray:
    """Return samples after the last one by linear prediction (Burg 1975: such a prediction never grows)."""
    ahead, back = x[1:], x[:-1]
    weights = np.ones(1)
    for _ in range(order):
        power = float(ahead @ ahead + back @ back)
        if power <= 1e-24 * float(x @ x) or ahead.size < 2:
            break
        reflection = -2.0 * float(ahead @ back) / power
        weights = np.append(weights, 0.0)
        weights = weights + reflection * weights[::-1]
        ahead, back = (ahead + reflection * back)[1:], (back + reflection * ahead)[:-1]
    past = lfiltic([1.0], weights, x[:-weights.size:-1])
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / count)
    return lfilter([1.0], weights, np.zeros(count), zi=past)[0] * fade
