"""From what sensors measured to what a record holds: accelerometers, degrees, other clocks."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.hydro.data import RIGID, ROTATIONS, mode
from radiation_ss.records.columns import RATES, split
from radiation_ss.records.convert import as_record
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, even_samples

ORDER = {suffix: order for order, suffix in enumerate(RATES)}  # of the derivative


def from_accelerometers(time: ArrayLike, readings: ArrayLike, places: ArrayLike, axes: ArrayLike,
                        dofs: Sequence[str], *, rotations: Record | None = None,
                        g: float = 9.81) -> dict[str, FloatArray]:
    """Return the accelerations of a body from accelerometers fixed to it, gravity taken off, by least squares.

    A sensor at r with axis e reads e . (a + alpha x r + g z'), z' the vertical in the body's axes. To first order in
    the angles z' = z - theta x z: a transverse sensor reads g times the roll angle, of which nothing is acceleration.
    Centripetal terms, of second order, are left out.

    Parameters
    ----------
    time : array_like, shape (nt,)
        [s]
    readings : array_like, shape (k, nt)
        [m/s^2]; a sensor at rest with its axis up reads +g.
    places : array_like, shape (k, 3)
        From the point that the motion refers to [m]: x forward, y to port, z up.
    axes : array_like, shape (k, 3)
        Unit vectors.
    dofs : sequence of str
        Degrees of freedom that move; at most k.
    rotations : Record, optional
        Measured angles (Roll, Pitch) [rad]. Without it the angles' part of gravity stays in the result of horizontal
        sensors, which is refused.
    g : float
        [m/s^2]

    Returns
    -------
    dict of str to ndarray, shape (nt,)
        `<Dof>_acceleration`.

    Raises
    ------
    InputError
        If the sensors cannot tell the degrees of freedom apart, or horizontal sensors lack the angles.

    Examples
    --------
    Two vertical sensors, 0.13 m to each side: the mean is heave, the difference roll.

    >>> found = from_accelerometers([0.0, 1.0], [[9.81, 10.07], [9.81, 9.81]], [[0, 0.13, 0], [0, -0.13, 0]],
    ...                             [[0, 0, 1], [0, 0, 1]], ["Heave", "Roll"])
    >>> {name: round(float(values[1]), 6) for name, values in found.items()}
    {'Heave_acceleration': 0.13, 'Roll_acceleration': 1.0}
    """
    t = read_only(time, "time", (None,))
    measured = read_only(readings, "readings", (None, t.size), finite=False)
    r = read_only(places, "places", (measured.shape[0], 3))
    e = read_only(axes, "axes", (measured.shape[0], 3))
    if np.abs(np.linalg.norm(e, axis=1) - 1.0).max() > 1e-6:
        raise InputError("axes: unit vectors are needed")
    if strange := [dof for dof in dofs if mode(dof) not in RIGID]:
        raise InputError(f"dofs: {strange[0]!r} is not one of {', '.join(RIGID)}")
    whole = np.hstack([e, np.cross(r, e)])               # e . (alpha x r) = alpha . (r x e)
    matrix = whole[:, [RIGID.index(mode(dof)) for dof in dofs]]
    if np.linalg.matrix_rank(matrix, tol=1e-9 * np.abs(matrix).max(initial=1.0)) < len(dofs):
        raise InputError(f"accelerometers: {measured.shape[0]} at these places cannot tell {', '.join(dofs)} apart")
    theta = _angles(t, e, dofs, rotations)
    for number, (level, vertical) in enumerate(zip(np.nanmean(measured, axis=1), e[:, 2]), 1):
        if abs(vertical) > 0.7 and abs(level - g * vertical) > 0.2 * g:
            warnings.warn(InputWarning(f"accelerometer {number}: its mean is {level:.4g}, gravity along its axis is "
                                       f"{g * vertical:.4g} m/s^2; check its sign and unit (m/s^2, not g), and that "
                                       "its mean was not taken off"), stacklevel=2)
    up = np.array([0.0, 0.0, 1.0])[:, None] - np.cross(theta.T, [0.0, 0.0, 1.0]).T
    found = np.linalg.lstsq(matrix, measured - g * e @ up, rcond=None)[0]
    return {f"{dof}_acceleration": row for dof, row in zip(dofs, found)}


def _angles(t: FloatArray, axes: FloatArray, dofs: Sequence[str], rotations: Record | None) -> FloatArray:
    """Return roll, pitch and yaw at some times, shape (3, nt); zero where no sensor leans with them."""
    theta = np.zeros((3, t.size))
    channels = {} if rotations is None else {mode(dof): rotations.channels[dof] for dof in rotations.dofs
                                             if dof in rotations.channels}
    for i, name in enumerate(ROTATIONS[:2]):
        leans = np.any(np.abs(axes @ np.cross(np.eye(3)[i], [0.0, 0.0, 1.0])) > 1e-9)
        if name in channels and rotations is not None:
            there = np.isfinite(channels[name])
            first, last = rotations.time[there][[0, -1]]
            step = np.ptp(rotations.time) / (rotations.time.size - 1)
            if t.min() < first - step or t.max() > last + step:
                raise InputError(f"rotations: {name} is measured from {first:.6g} to {last:.6g} s, the accelerometers "
                                 f"from {t.min():.6g} to {t.max():.6g} s; cut these to the time of the angles")
            theta[i] = np.interp(t, rotations.time[there], channels[name][there])
        elif leans and name in [mode(dof) for dof in dofs]:
            raise InputError(f"rotations: a horizontal accelerometer reads g times the {name} angle; give the angles")
    return theta


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
        Largest offset looked for [s]; if absent half of the shorter record beside what brings both starts together.
    least : float
        Smallest correlation, 0 to 1.

    Returns
    -------
    offset : float
        [s]
    correlation : float
        Of the two signals at this offset, where both are there.

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
    record, other, other_channel = as_record(record), as_record(other), other_channel or channel
    (dof, suffix), (other_dof, other_suffix) = split(channel), split(other_channel)
    if dof != other_dof or (suffix in ORDER) != (other_suffix in ORDER):
        raise InputError(f"clocks: {channel} and {other_channel} are not one degree of freedom")
    for run, name in ((record, channel), (other, other_channel)):
        if name not in run.channels:
            raise InputError(f"record {run.name}: no channel {name!r}")
    (t1, x1), (t2, x2) = (even_samples(run, name, run.channels[name])
                          for run, name in ((record, channel), (other, other_channel)))
    dt = min(t1[1] - t1[0], t2[1] - t2[0])
    a, b = (CubicSpline(t, x)(np.arange(t[0], t[-1], dt)) for t, x in ((t1, x1), (t2, x2)))
    reach = largest if largest is not None else 0.5 * dt * min(a.size, b.size) + abs(t1[0] - t2[0])
    lags, alike = _correlation(a, b, dt, ORDER.get(other_suffix, 0) - ORDER.get(suffix, 0))
    offsets = t1[0] - t2[0] - lags
    within = (np.abs(offsets) <= reach) & np.isfinite(alike)
    if not within.any():
        raise InputError(f"clocks: {record.name} begins at {t1[0]:.10g} s, {other.name} at {t2[0]:.10g} s; no offset "
                         f"within {reach:.4g} s joins them, give a larger one (largest)")
    least_alike, alike = float(alike[within].min()), np.where(within, alike, -np.inf)
    best = int(np.argmax(alike))
    if -least_alike >= least and 1.0 + least_alike < 0.75 * (1.0 - alike[best]):
        raise InputError(f"clocks: {channel} of {record.name} and {other_channel} of {other.name} are alike with a "
                         f"turned sign (correlation {least_alike:.4f}, else {alike[best]:.4f}); turn one")
    if not alike[best] >= least:
        raise InputError(f"clocks: {channel} of {record.name} and {other_channel} of {other.name} are nowhere alike "
                         f"within {reach:.4g} s (correlation {alike[best]:.2f}, {least:g} needed)")
    around = alike[[best - 1, best, (best + 1) % alike.size]]
    bend = around[0] - 2.0 * around[1] + around[2]
    peak = 0.5 * (around[0] - around[2]) / bend if np.isfinite(bend) and bend < 0.0 else 0.0
    return float(offsets[best] - peak * (lags[1] - lags[0])), float(alike[best])


def _correlation(a: FloatArray, b: FloatArray, dt: float, order: int, fine: int = 4) -> tuple[FloatArray, FloatArray]:
    """Return lags [s], `fine` a sample, and the correlation in the band of a, with a (b, if negative) differentiated.

    Over the samples that both have at a lag; NaN where these hold less than half the energy of either signal.
    """
    band = _band(a, dt)
    ends = int(min(2.0 * np.pi / (band[0] * dt), a.size / 8, b.size / 8))  # which the filter reaches past
    a, b = (_differentiated(x, dt, band, max(k, 0), fine)[fine * ends:fine * (x.size - ends)]
            for x, k in ((a, order), (b, -order)))
    size = 1 << int(np.ceil(np.log2(a.size + b.size)))
    lags = np.asarray(np.fft.fftfreq(size, 1.0 / size).round(), dtype=np.intp)  # b[k + lag] beside a[k]
    cross = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    held = []
    for x, first, end in ((a, -lags, b.size - lags), (b, lags, a.size + lags)):
        energy = np.r_[0.0, np.cumsum(x**2)]
        held.append(energy[np.clip(end, 0, x.size)] - energy[np.clip(first, 0, x.size)])
    whole = np.sqrt(held[0] * held[1])
    alike = np.divide(cross, whole, out=np.zeros(size), where=whole > 0.0)
    alike[(held[0] < 0.5 * np.sum(a**2)) & (held[1] < 0.5 * np.sum(b**2))] = np.nan
    return np.asarray(dt / fine * lags, dtype=np.float64), alike


def _band(x: FloatArray, dt: float) -> tuple[float, float]:
    """Return the lowest and the highest frequency [rad/s] of a signal's band."""
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(x.size, dt), dtype=np.float64)
    inside = omega[band_of(omega, np.fft.rfft((x - x.mean()) * np.hanning(x.size)))]
    return (float(inside[0]), float(inside[-1])) if inside.size else (np.inf, np.inf)


def _differentiated(x: FloatArray, dt: float, band: tuple[float, float], order: int, fine: int) -> FloatArray:
    """Return a derivative of a signal in a band, `fine` values a sample.

    The signal is mirrored through its ends, where a cut would make a step.
    """
    mirrored = np.pad(x - x.mean(), x.size, mode="reflect", reflect_type="odd")
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(mirrored.size, dt), dtype=np.float64)
    inside = (omega >= band[0]) & (omega <= band[1])
    spectrum = np.where(inside, np.fft.rfft(mirrored) * (1j * omega) ** order, 0.0)
    return np.asarray(np.fft.irfft(spectrum, fine * mirrored.size)[fine * x.size:2 * fine * x.size], dtype=np.float64)


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
        If a channel is in both, or the offset is no number.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> camera = rss.Record([0.0, 0.1, 0.2], {"Heave": [0.0, 1.0, 2.0]})
    >>> logger = rss.Record([0.0, 0.1], {"Heave_acceleration": [5.0, 6.0]})
    >>> rss.joined(camera, logger, 0.1).channels["Heave_acceleration"].tolist()
    [nan, 5.0, 6.0]
    """
    record, other = as_record(record), as_record(other)
    if both := [name for name in other.channels if name in record.channels]:
        raise InputError(f"records {record.name} and {other.name}: both have a channel {both[0]!r}")
    if np.ndim(offset) or not np.isfinite(offset):
        raise InputError(f"offset: {offset!r}; one number of seconds is needed, the first that clock_offset returns")
    moved = other.time + offset
    time = np.union1d(np.round(record.time, 9), np.round(moved, 9))
    channels = {}
    for clock, run in ((record.time, record), (moved, other)):
        place = np.searchsorted(time, np.round(clock, 9))
        for name, values in run.channels.items():
            channels[name] = np.full(time.size, np.nan)
            channels[name][place] = values
    return replace(record, time=time, channels=channels, units={**other.units, **record.units}, file="")
