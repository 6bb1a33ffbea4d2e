"""Coefficients repaired, only as asked for and with the change in the notes, or moved; what follows from them."""

import logging
from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import ComplexArray, FloatArray, frequencies, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import MATRICES, RIGID, ROTATIONS, TRANSLATIONS, HydroData, body, mode
from radiation_ss.hydro.measures import bands, damping_scale, percent, said, scaled
from radiation_ss.hydro.narrow import not_of_a_body, roughness
from radiation_ss.hydro.transforms import estimate_A_inf

log = logging.getLogger("radiation_ss")


def clean(data: HydroData, *, band: tuple[float, float] | None = None, drop: Sequence[tuple[float, float]] = (),
          spikes: float | bool = False, symmetric: bool = False, negative_damping: bool = False,
          A_inf: bool = False) -> HydroData:
    """Return the data with the repairs that are asked for, in the order of the parameters.

    Each repair adds a note that says what was changed, where and by how much, and logs it. Without arguments the data
    come back as they are.

    Parameters
    ----------
    band : (low, high), optional
        Keep only these frequencies [rad/s].
    drop : sequence of (low, high)
        Leave out the frequencies of these intervals [rad/s], ends included.
    spikes : bool or float
        Leave out frequencies where A or B is off its neighbours by more than this share of the curve's largest value
        (True: 3 %) and breaks Kramers-Kronig there, has negative damping, or lies where irregular frequencies do.
    symmetric : bool
        Replace A, B, A_inf and A_zero by half of themselves and their transpose.
    negative_damping : bool
        Replace the symmetric part of B by the nearest one without negative eigenvalues (each degree of freedom
        scaled by its largest damping). Kramers-Kronig is hurt by as much as is changed.
    A_inf : bool
        Replace A_inf by the one that A and B imply.

    Raises
    ------
    InputError
        If fewer than two frequencies would be left, or an interval is not ascending.
    """
    for low, high in ([band] if band else []) + list(drop):
        if not low <= high:
            raise InputError(f"interval ({low:g}, {high:g}) rad/s: the lower end is above the upper")
    if band is not None:
        low, high = band
        data = _keep(data, (data.omega >= low) & (data.omega <= high), f"outside {low:g} to {high:g} rad/s")
    if drop:
        outside = [(data.omega < low) | (data.omega > high) for low, high in drop]
        data = _keep(data, np.all(outside, axis=0), "as asked")
    if spikes:
        share, found = 0.03 if spikes is True else float(spikes), data.check()
        wrong = not_of_a_body(data, roughness(data), found.kramers_kronig, found.smallest_eigenvalue, share)
        rough = wrong.max(axis=(1, 2))
        data = _keep(data, rough <= share, f"that leave their neighbours by up to {percent(rough.max())}")
    for wanted, repaired in ((symmetric, _symmetric), (negative_damping, _passive), (A_inf, _implied_A_inf)):
        data = repaired(data) if wanted else data
    return data


def _noted(data: HydroData, note: str, **changes: object) -> HydroData:
    log.info("%s: %s", data.source or "coefficients", note)
    return data.replace(notes=(*data.notes, f"clean: {note}"), **changes)


def _keep(data: HydroData, keep: np.ndarray, why: str) -> HydroData:
    if keep.all():
        return _noted(data, f"no frequency lies {why}" if why.startswith("outside") else "no frequency left out")
    if keep.sum() < 2:
        raise InputError(f"{data.source or 'data'}: only {frequencies(int(keep.sum()))} would be left ({why})")
    gone = said(bands(data.omega, ~keep))
    rows = {name: value[keep] for name in ("omega", "A", "B", "X") if (value := getattr(data, name)) is not None}
    return _noted(data, f"{int((~keep).sum())} of {keep.size} frequencies left out {why}: {gone}", **rows)


def _symmetric(data: HydroData) -> HydroData:
    changes: dict[str, FloatArray] = {}
    told = []
    for name in ("A", "B", "A_inf", "A_zero"):
        if (value := getattr(data, name)) is not None:
            changes[name] = 0.5 * (value + np.swapaxes(value, -1, -2))
            size = np.abs(np.diagonal(value, axis1=-2, axis2=-1)).reshape(-1, data.n).max(axis=0)
            change = scaled(changes[name] - value, np.sqrt(np.where(size > 0.0, size, np.inf)))
            told.append(f"{name} by up to {percent(np.abs(change).max())}")
    return _noted(data, f"made symmetric: {', '.join(told)} of the largest on the diagonal", **changes)


def _passive(data: HydroData) -> HydroData:
    """Set negative eigenvalues of the scaled symmetric part of B to zero; modes that do not radiate are left alone."""
    scale, _ = damping_scale(data)
    even, pairs = scaled(0.5 * (data.B + data.B.transpose(0, 2, 1)), scale), np.outer(scale, scale)
    values, vectors = np.linalg.eigh(even)
    touched = (values < -1e-9 * np.abs(values).max(initial=0.0)).any(axis=1)
    if not touched.any():
        return _noted(data, "no negative damping to lift")
    nearest = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    change = np.where(touched[:, None, None], nearest - even, 0.0)
    size = np.abs(change).max(axis=(1, 2))
    note = (f"negative damping lifted at {int(touched.sum())} of {touched.size} frequencies ("
            f"{said(bands(data.omega, touched))}), by up to {percent(size.max())} of the largest damping, at "
            f"{data.omega[int(size.argmax())]:.3g} rad/s")
    return _noted(data, note, B=data.B + change * np.where(np.isinf(pairs), 0.0, pairs))


def _implied_A_inf(data: HydroData) -> HydroData:
    found = estimate_A_inf(data.omega, data.A, data.B)
    change = "there was none before"
    if data.A_inf is not None:
        before = data.A_inf.diagonal()
        each = (found.value - data.A_inf).diagonal() / np.where(before == 0.0, np.inf, before)
        change = "changed by " + ", ".join(f"{dof} {percent(v)}" for dof, v in zip(data.dofs, each))
    return _noted(data, f"A_inf estimated by Kramers-Kronig; {change}", A_inf=found.value)


def at(data: HydroData, reference_point: Sequence[float]) -> HydroData:
    """Return the data about another reference point P: force = T^T force_O, matrices T^T (.) T (A.1)-(A.11).

    Velocities at the old point O follow from those at P: v_O = v_P + Omega x (O - P), that is v_O = T v_P. The
    congruence keeps passivity. In two dimensions with z up, T = [[1, -(z_O - z_P)], [0, 1]] for (Sway, Roll); the
    paper's [[1, l_G], [0, 1]] has y down. C is moved as the stiffness of a body in equilibrium. The phase of X stays at
    the origin. `reference_point`: the new point (x, y, z) [m], z up from the still water surface; for several bodies
    the same for each. InputError if the point is not three finite numbers, a mode is no rigid-body mode, or a
    translation is missing that a rotation about the new point brings in.
    """
    point = read_only(reference_point, "reference_point, three finite coordinates (x, y, z) [m]", (3,))
    if not np.isfinite(data.reference_point).all():
        raise InputError(f"{data.source or 'data'}: its own reference point is not known (or each body has its own); "
                         "set it with data.replace(reference_point=(x, y, z)) if you know it")
    T = velocity_transform(data.dofs, np.asarray(data.reference_point) - point)
    return data.mapped(lambda matrix: T.T @ matrix @ T, lambda X: X @ T, reference_point=tuple(point.tolist()))


def velocity_transform(dofs: Sequence[str], arm: FloatArray) -> FloatArray:
    """Return T of v_O = T v_P for arm = O - P, shape (n, n); see `at`."""
    T = np.eye(len(dofs))
    for column, dof in enumerate(dofs):
        if mode(dof) in TRANSLATIONS:
            continue
        if mode(dof) not in ROTATIONS:
            raise InputError(f"degree of freedom {dof!r}: only the six rigid-body modes can be moved to another point")
        turning = np.eye(3)[ROTATIONS.index(mode(dof))]
        for name, value in zip(TRANSLATIONS, np.cross(turning, arm)):
            partner = f"{body(dof)}__{name}" if body(dof) else name
            if value == 0.0:
                continue
            if partner not in dofs:
                raise InputError(f"reference_point: {dof!r} about the new point brings in {partner!r}, which the data "
                                 f"{list(dofs)} do not hold")
            T[list(dofs).index(partner), column] += value
    return T


def rigid_inertia(mass: float, inertia: FloatArray, arm: FloatArray) -> FloatArray:
    """Return the mass matrix (6, 6) of a body with its tensor (3, 3) about G, `arm` from the point of the rotations."""
    T = velocity_transform(RIGID, np.asarray(arm, dtype=float))
    return np.asarray(T.T @ block_diag(mass * np.eye(3), inertia) @ T)


def text(data: HydroData) -> str:
    """Return what is there, in at most ten lines; see `HydroData.__str__`."""
    dofs = ", ".join(data.dofs[:6]) + (f" and {data.n - 6} more" if data.n > 6 else "")
    there = [name for name in (*MATRICES, "X") if getattr(data, name) is not None]
    lines = [f"HydroData of {data.source or 'numbers'}", f"  {data.n} degrees of freedom: {dofs}",
             f"  {frequencies(data.omega.size)}: {data.omega[0]:.4g} to {data.omega[-1]:.4g} rad/s",
             f"  A, B{''.join(', ' + name for name in there)}",
             f"  rho {data.rho:g} kg/m^3, g {data.g:g} m/s^2, depth {data.depth:g} m, rotations about "
             f"({', '.join(f'{v:g}' for v in data.reference_point)}) m"]
    if data.directions is not None:
        lines.insert(4, f"  {data.directions.size} wave directions: {np.degrees(data.directions[0]):.4g} to "
                        f"{np.degrees(data.directions[-1]):.4g} deg")
    lines += [f"  note: {note.removeprefix(f'{data.source}: ')[:110]}" for note in data.notes[:3]]
    return "\n".join(lines + [f"  and {len(data.notes) - 3} more notes in .notes"] * (len(data.notes) > 3))


def with_A_inf(data: HydroData) -> HydroData:
    """Return the data with A_inf estimated where it is missing; see `HydroData.with_A_inf`."""
    if data.A_inf is not None:
        return data
    if data.omega.size < 4:
        raise InputError(f"{data.source or 'data'}: A_inf is missing, and {data.omega.size} frequenc"
                         f"{'y' if data.omega.size == 1 else 'ies'} cannot tell it (4 at least, better 30 over the "
                         "band); compute more, or the limit omega = inf, or give data.replace(A_inf=...)")
    found = estimate_A_inf(data.omega, data.A, data.B)
    value, std, share = (np.diagonal(part) for part in (np.abs(found.value), found.std, found.tail.share))
    each = ", ".join(f"{dof} {100.0 * s / v:.2g} %" for dof, v, s in zip(data.dofs, value, std) if v > 0.0)
    note = (f"A_inf estimated by Kramers-Kronig with standard uncertainty {each}; up to "
            f"{100.0 * share.max():.2g} % of the damping lies above {found.tail.omega:g} rad/s")
    size = np.abs(np.einsum("kii->ki", data.B))
    if unsure := [f"{dof} still rises" if end == 1.0 else f"{dof} is still {percent(end)} of its largest"
                  for dof, end, rises in zip(data.dofs, size[-1] / np.fmax(size.max(axis=0), 1e-300),
                                             np.diagonal(found.rising)) if rises]:
        log.warning("%s: the damping of %s at %g rad/s, so A_inf is hardly known; give data.replace(A_inf=...), or "
                    "frequencies up to where the damping has fallen", data.source or "data", ", of ".join(unsure),
                    found.tail.omega)
    return data.replace(A_inf=found.value, notes=(*data.notes, note))


def rao(data: HydroData) -> ComplexArray:
    """Return the motion per metre wave amplitude; see `HydroData.rao`."""
    for name in ("M", "C", "X"):
        if getattr(data, name) is None:
            raise InputError(f"{data.source or 'data'}: {name} is missing and the motion in waves needs it")
    assert data.M is not None and data.C is not None and data.X is not None
    w = data.omega[:, None, None]
    impedance = data.C + 1j * w * (data.B + (0.0 if data.D is None else data.D)) - w ** 2 * (data.M + data.A)
    return np.swapaxes(np.linalg.solve(impedance, np.swapaxes(data.X, 1, 2)), 1, 2)
