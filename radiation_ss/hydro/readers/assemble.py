"""From rows as a file has them to one HydroData: order, limits, missing frequencies, clear errors."""

import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radiation_ss.arrays import ComplexArray, FloatArray, positive
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, ROTATIONS, HydroData, body, mode
from radiation_ss.hydro.linear_waves import wave_number
from radiation_ss.hydro.measures import REVERSED, horizontal_lead, is_reversed, off_scale
from radiation_ss.reading import hdf5_text
from radiation_ss.units import check_water

IntArray = NDArray[np.intp]
log = logging.getLogger("radiation_ss")

UNKNOWN_POINT = (np.nan, np.nan, np.nan)
MSS_AXES = np.array([1, -1, -1, 1, -1, -1])  # forward-starboard-down of MSS's files becomes forward-port-up
USUAL = {"rho": 1000.0, "g": 9.81, "depth": np.inf}  # where neither the file nor the caller says it
Points = Mapping[str, tuple[float, ...]]


def six_dofs(bodies: Sequence[str]) -> tuple[str, ...]:
    """Return the names of six rigid modes of each body, `body__Mode` if several; one without a name has its number."""
    if len(bodies) == 1:
        return RIGID
    names = [name or f"body{k}" for k, name in enumerate(bodies, 1)]
    if len(set(names)) < len(names):
        names = [f"{name}_{k}" for k, name in enumerate(names, 1)]
    return tuple(f"{name}__{m}" for name in names for m in RIGID)


def assemble(path: Path | str, omega: ArrayLike, A: ArrayLike, B: ArrayLike, dofs: Sequence[str], *,
             X: ArrayLike | None = None, A_inf: ArrayLike | None = None, points: Points | None = None,
             notes: Sequence[str] = (), **fields: Any) -> HydroData:
    """Return HydroData of rows in any order, with or without the limits omega = 0 and omega = inf.

    `path` is named in every message. `omega` (rows,): [rad/s]; the limits go into A_zero and A_inf. `A`, `B` (rows, n,
    n): B is not looked at in the limits; a frequency whose A and B are NaN throughout has no result in the file: it is
    left out, and a note says so. `X` (rows, n_dir, n). `A_inf` (n, n): a limit that the file gives apart from the rows.
    `points`: about which the rotations of each body are taken, see `common_point`; a reader that knows the one point
    gives `reference_point` instead. `notes`: what the reader had to assume or leave out. `fields`: others of HydroData.
    """
    if "reference_point" not in fields:
        fields["reference_point"], more = common_point(path, dofs, points)
        notes = [*notes, *more]
    order, w = _ordered(path, np.asarray(omega, dtype=float))
    for name, values in (("added mass", A), ("damping", B)):
        if np.iscomplexobj(values) and np.any(np.imag(np.asarray(values))):
            raise InputError(f"{path}: {name} is complex; real coefficients are needed")
    mass, damping = np.real(A).astype(float)[order], np.real(B).astype(float)[order]
    A_zero, A_inf = _limit(mass, w == 0.0, None), _limit(mass, np.isinf(w), A_inf)
    inside = (w > 0.0) & np.isfinite(w)
    empty = inside & np.isnan(mass).all((1, 2)) & np.isnan(damping).all((1, 2))
    lost = [f"{path}: no radiation result (NaN) at {_list(w[empty])} rad/s; left out"] * bool(empty.any())
    lost += [f"{path}: no added mass (NaN) at {limit:g} rad/s; that row is left out"
             for limit in (0.0, np.inf) if np.isnan(mass[w == limit]).all((1, 2)).any()]
    keep = inside & ~empty
    if not keep.any():
        raise InputError(f"{path}: no frequency between zero and infinity with added mass and damping")
    w, mass, damping = w[keep], mass[keep], damping[keep]
    force = None if X is None else np.asarray(X, dtype=complex)[order][keep]
    if force is not None and (empty := np.isnan(force).all((1, 2))).any():
        lost.append(f"{path}: no exciting force (NaN) at {_list(w[empty])} rad/s; X is left out")
        force = None
    for name, value in (("added mass", mass), ("radiation damping", damping), ("exciting force", force)):
        _refuse_nan(path, name, value, w, dofs)
    try:
        data = HydroData(w, mass, damping, A_inf, tuple(dofs), X=force, A_zero=A_zero,  # type: ignore[arg-type]
                         source=str(path), notes=(*notes, *lost), **fields)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if is_reversed(horizontal_lead(data.X, data.C, data.dofs, data.directions)):
        lost.append(f"{path}: {REVERSED}; X is as the file has it")
    lost += [f"{path}: {text}" for text in off_scale(data)]
    other = [dof for dof in dofs if mode(dof) not in RIGID and mode(dof).capitalize() in RIGID]
    lost += [f"{path}: {', '.join(other)}: none of {', '.join(RIGID)}; taken as a degree of freedom of its own"
             for _ in other[:1]]
    data = data.replace(notes=(*notes, *lost))
    for note in lost:
        log.warning(note)
    return data


def about_points(path: Path, omega: FloatArray, A: ArrayLike, B: ArrayLike, points: FloatArray, headings: FloatArray,
                 force: FloatArray | None, **fields: Any) -> HydroData:
    """Return HydroData of bodies of six degrees of freedom, each about its own point, (bodies, 3).

    `force` [body, heading, frequency, (amplitude, phase in deg), i]: the phases are lags behind the wave at each body's
    point, those of X leads over the wave at the origin.
    """
    dofs = six_dofs([""] * len(points))
    if force is not None:
        lagged = force[..., 0, :] * np.exp(-1j * np.deg2rad(force[..., 1, :]))
        X = [part * delay(omega, headings, point, fields["g"], fields["depth"]).T[:, :, None]
             for part, point in zip(lagged, points)]
        fields |= {"X": np.concatenate(X, axis=-1).swapaxes(0, 1), "directions": headings}
    return assemble(path, omega, A, B, dofs, points=dict(zip(bodies(dofs), map(tuple, points))), **fields)


def constants(path: Path | str, in_file: Mapping[str, float | None], given: Mapping[str, float],
              notes: list[str]) -> dict[str, Any]:
    """Return density, gravity and depth, each from the file, else as given, else the usual one, which is noted."""
    return {field: constant(path, field, in_file.get(field), given, usual, notes) for field, usual in USUAL.items()}


def constant(path: Path | str, field: str, in_file: float | None, given: Mapping[str, float], default: float,
             notes: list[str]) -> float:
    """Return a constant from the file, else the one given (InputError if they contradict), else the default, noted."""
    value = given.get(field, default) if in_file is None else in_file
    if in_file is None and field not in given:
        notes.append(f"{path}: {field} is not in the file; {default:g} assumed")
    if in_file is not None and field in given and not np.isclose(given[field], in_file, rtol=1e-6):
        raise InputError(f"{path}: {field} = {given[field]:g} given, but the file says {in_file:g}")
    value = positive(value, f"{path}: {field}", or_infinite=field == "depth")
    check_water(f"{path}: {field}", value, field)
    return value


def delay(omega: FloatArray, directions: FloatArray, point: Sequence[float] | FloatArray, g: float,
          depth: float) -> ComplexArray:
    """Return the phase factor (nw, n_dir) that refers a force to the wave at the origin, not at a point (x, y, ...)."""
    inside = np.isfinite(omega) & (omega > 0.0)
    k = wave_number(np.where(inside, omega, 1.0) ** 2 / g, depth)
    along = point[0] * np.cos(directions) + point[1] * np.sin(directions)
    return np.asarray(np.exp(-1j * k[:, None] * along), dtype=complex)


def common_point(path: Path | str, dofs: Sequence[str], points: Points | None) -> tuple[tuple[float, ...], list[str]]:
    """Return the point about which rotations are taken, and notes; NaN where the file cannot tell."""
    turning = [dof for dof in dofs if mode(dof) in ROTATIONS]
    if points:
        distinct = {tuple(float(v) for v in point) for point in points.values()}
        if len(distinct) == 1:
            return distinct.pop(), []
        if turning:
            each = "; ".join(f"{name} {tuple(float(v) for v in point)}" for name, point in points.items())
            return UNKNOWN_POINT, [f"{path}: each body's rotations are about its own point [m]: {each}"]
    if not turning:
        return (0.0, 0.0, 0.0), []
    return UNKNOWN_POINT, [f"{path}: does not say about which point {', '.join(turning)} turn; reference_point "
                           "is NaN (data.replace(reference_point=...) sets it)"]


def bodies(dofs: Sequence[str]) -> list[str]:
    """Return the names of the bodies in the order of their degrees of freedom."""
    return list(dict.fromkeys(body(dof) for dof in dofs))


def body_groups(file: Any) -> tuple[list[str], list[str]]:
    """Return the groups of the bodies in an open file of BEMIO, in order, and the names of the bodies."""
    groups = sorted((group for group in file if re.fullmatch(r"body\d+", group)), key=lambda group: int(group[4:]))
    return groups, [hdf5_text(file, f"{group}/properties/name") or group for group in groups]


def _ordered(path: Path | str, omega: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the ascending order of the frequencies and the frequencies in it."""
    if (wrong := np.isnan(omega) | (omega < 0.0)).any():
        raise InputError(f"{path}: frequencies must be zero, positive or infinite, found {omega[wrong][0]:g} rad/s")
    order = np.argsort(omega, kind="stable")
    omega = omega[order]
    if (twice := np.flatnonzero(omega[1:] == omega[:-1])).size:
        raise InputError(f"{path}: frequency {omega[twice[0]]:g} rad/s is there twice")
    return order, omega


def _limit(A: FloatArray, row: FloatArray, given: ArrayLike | None) -> ArrayLike | None:
    return A[row][0] if row.any() and not np.isnan(A[row][0]).all() else given


def _list(omega: FloatArray) -> str:
    head = ", ".join(f"{w:g}" for w in omega[:4])
    return head if omega.size <= 4 else f"{head}, ... ({omega.size} frequencies)"


def _refuse_nan(path: Path | str, name: str, value: FloatArray | ComplexArray | None, omega: FloatArray,
                dofs: Sequence[str]) -> None:
    if value is None or np.isfinite(value).all():
        return
    k, i, j = (int(v) for v in np.argwhere(~np.isfinite(value))[0])
    where = dofs[j] if name == "exciting force" else f"{dofs[i]}, {dofs[j]}"
    raise InputError(f"{path}: {name} at omega = {omega[k]:g} rad/s, {where} is {value[k, i, j]}; a number is needed")


def six_places(dofs: tuple[str, ...], path: Path) -> tuple[list[int], list[str]]:
    """Return the place of each degree of freedom among 6 for each body, and the bodies."""
    names = bodies(dofs)
    if foreign := [dof for dof in dofs if mode(dof) not in RIGID]:
        raise InputError(f"{path.name}: degree of freedom {foreign[0]!r} has no place in this form; only "
                         f"{', '.join(RIGID)} have (write .json instead)")
    return [6 * names.index(body(dof)) + RIGID.index(mode(dof)) for dof in dofs], names
