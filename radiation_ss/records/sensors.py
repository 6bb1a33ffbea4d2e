"""From what sensors measured to what a record holds: probes elsewhere, accelerometers, degrees, other clocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, mode
from radiation_ss.records.record import Record
from radiation_ss.waves.dispersion import carry_elevation


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
    values = record.channels.get("wave_elevation")
    if values is None:
        raise InputError(f"record {record.name}: no channel wave_elevation to carry to the body")
    if record.speed != 0.0:
        raise InputError(f"record {record.name}: speed {record.speed:g} m/s; a probe is carried to a body at rest only")
    if distance is None:
        try:
            distance = -float(record.meta["probe"].removesuffix("[m]").removesuffix("m"))
        except KeyError:
            raise InputError(f"record {record.name}: the place of the probe is not known; give the distance [m], or "
                             "the comment `# probe: x`") from None
        except ValueError:
            raise InputError(f"record {record.name}: comment 'probe': {record.meta['probe']!r} is no place [m] along "
                             "the waves, the body at 0") from None
    grid, even = even_samples(record, "wave_elevation", values)
    moved = carry_elevation(even, grid[1] - grid[0], distance, depth=depth, g=g)
    inside = np.isfinite(moved)
    at = CubicSpline(grid[inside], moved[inside])(record.time)
    at[(record.time < grid[inside][0]) | (record.time > grid[inside][-1]) | ~np.isfinite(values)] = np.nan
    return record.with_channels(wave_elevation=at)


def even_samples(record: Record, name: str, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a channel on even times between its first and last sample."""
    there = np.isfinite(values)
    t = record.time[there]
    if t.size < 8:
        raise InputError(f"record {record.name}: {name} has {t.size} samples; at least 8 are needed")
    step = float(np.median(np.diff(t)))
    widest = int(np.argmax(np.diff(t)))
    if t[widest + 1] - t[widest] > 3.5 * step:
        raise InputError(f"record {record.name}: {name} has no sample from {t[widest]:.6g} to {t[widest + 1]:.6g} s; "
                         "take a part without gaps, record.window(start, end)")
    grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
    return grid, CubicSpline(t, values[there])(grid)


def in_radians(record: Record, *names: str) -> Record:
    """Return the record with rotations that are in degrees, degrees/s or degrees/s^2 in radians.

    Parameters
    ----------
    record : Record
    *names : str
        Degrees of freedom (with all their motion channels); all rotations if absent.

    Raises
    ------
    InputError
        If a name is no rotation of the record.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> record = rss.Record([0.0, 1.0], {"Roll": [90.0, 0.0], "Roll_force": [1.0, 0.0]}, kind="forced")
    >>> float(rss.in_radians(record).channels["Roll"][0])
    1.5707963267948966
    """
    wanted = names or tuple(dof for dof in record.dofs if mode(dof) in ROTATIONS)
    for dof in wanted:
        if dof not in record.dofs or mode(dof) not in ROTATIONS:
            raise InputError(f"record {record.name}: {dof!r} is none of its rotations")
    changed = {dof + suffix: np.deg2rad(record.channels[dof + suffix]) for dof in wanted
               for suffix in ("", "_velocity", "_acceleration") if dof + suffix in record.channels}
    return record.with_channels(**changed)


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
    modes = (*TRANSLATIONS, *ROTATIONS)
    strange = [dof for dof in dofs if mode(dof) not in modes]
    if strange:
        raise InputError(f"dofs: {strange[0]!r} is not one of {', '.join(modes)}")
    whole = np.hstack([e, np.cross(r, e)])               # e . (alpha x r) = alpha . (r x e)
    matrix = whole[:, [modes.index(mode(dof)) for dof in dofs]]
    if np.linalg.matrix_rank(matrix, tol=1e-9 * np.abs(matrix).max(initial=1.0)) < len(dofs):
        raise InputError(f"accelerometers: {measured.shape[0]} at these places cannot tell {', '.join(dofs)} apart")
    theta = _angles(t, e, dofs, rotations)
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
            theta[i] = np.interp(t, rotations.time[there], channels[name][there])
        elif leans and name in [mode(dof) for dof in dofs]:
            raise InputError(f"rotations: a horizontal accelerometer reads g times the {name} angle; give the angles")
    return theta
