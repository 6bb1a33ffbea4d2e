"""Dynamics of a linear body: impedance and natural modes, its text; the model of a file's data."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, InputWarning, SolverError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import RIGID, HydroData, force_unit, mode, motion_unit
from radiation_ss.hydro.measures import (
    inertia_not_positive,
    inertia_not_symmetric,
    percent,
    statically_unstable,
    unstable_text,
)


def impedance(model: Model, omega: FloatArray) -> ComplexArray:
    """Return Z(iw), force over displacement, shape (nw, n, n)."""
    w = omega[:, None, None]
    K = model.fit.frequency_response(omega)
    return np.asarray(model.C - w**2 * (model.M + model.A_inf) + 1j * w * (K + model.D))


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes, one for each degree of freedom."""

    dofs: tuple[str, ...]
    period: FloatArray  # (n,): Of the damped oscillation [s]; inf where a degree of freedom does not oscillate
    ratio: FloatArray  # (n,): Damping ratio, share of critical; nan where a degree of freedom does not oscillate


def natural_modes(model: Model) -> Modes:
    """Return period and damping ratio of the mode in which the displacement of each degree of freedom has most part.

    The part of a state in a mode is the product of its entries in the right and the left eigenvector (participation
    factor: Perez-Arriaga, Verghese & Schweppe 1982): of a displacement its share in what follows a release. Velocities
    do not count: they follow radiation states, too. Each mode is given to one degree of freedom.

    >>> import radiation_ss as rss
    >>> modes = natural_modes(rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.1))
    >>> round(float(modes.period[0]), 4), round(float(modes.ratio[0]), 4)
    (3.1574, 0.1)
    """
    F = model.matrices()[0]
    n, m = model.n, model.fit.states
    scale = np.sqrt(np.maximum(np.diag(model.M + model.A_inf), 1e-300))
    size = np.concatenate([np.ones(m), scale, scale])
    poles, right = np.linalg.eig(F * (size[:, None] / size))
    period, ratio = np.full(n, np.inf), np.full(n, np.nan)
    loose = statically_unstable(model.M, model.C, model.dofs)
    part = np.abs(right.T * np.linalg.pinv(right))[:, m:m + n]
    swings = poles.imag > 1e-6 * np.abs(poles)
    share = np.where(swings[:, None], 2.0 * part, np.where(poles.imag[:, None] < 0.0, 0.0, part))  # of a pair both
    for row, dof in zip(*linear_sum_assignment(-share)):
        s = poles[row]
        if swings[row] and model.C[dof, dof] != 0.0 and model.dofs[dof] not in loose:
            period[dof], ratio[dof] = 2.0 * np.pi / s.imag, np.round(-s.real / abs(s), 12) + 0.0
    return Modes(model.dofs, period, ratio)


def text(model: Model, most: int = 6) -> str:
    """Return the model in ten lines at most: a line a degree of freedom, its radiation, its tolerances."""
    modes, loose = natural_modes(model), statically_unstable(model.M, model.C, model.dofs)
    lines = [f"Model {' '.join(model.name.split())[:60]}"]
    for i, dof in enumerate(model.dofs[:most]):
        swing = (f"period {modes.period[i]:.4g} s, damping ratio {modes.ratio[i]:.2g}" if np.isfinite(modes.period[i])
                 else "statically unstable (C < 0)" if dof in loose else "no oscillation")
        force, motion = force_unit(dof), motion_unit(dof)
        mass, stiffness, damping = "kg m^2" if motion == "rad" else "kg", f"{force}/{motion}", f"{force} s/{motion}"
        if mode(dof) not in RIGID:  # a model does not hold what one of its own is measured in
            mass = stiffness = damping = "SI"
        D = f", D {model.D[i, i]:.4g} {damping}" if model.D[i, i] else ""
        lines.append(f"  {dof}  M {model.M[i, i]:.4g}, A_inf {model.A_inf[i, i]:.4g} {mass}, C {model.C[i, i]:.4g} "
                     f"{stiffness}{D}; {swing}")
    if model.n > most:
        lines.append(f"  and {model.n - most} more: {', '.join(model.dofs[most:])[:80]}")
    fit = model.fit
    error = "" if np.isnan(fit.relative_error) else f", relative error {fit.relative_error:.3g}"
    lines.append(f"  radiation: {fit.states} states{error}" if fit.states else "  radiation: none")
    if model.tolerance:
        said = ", ".join(f"{name} {100.0 * value:.4g} %" for name, value in model.tolerance.items())
        lines.append(f"  tolerance: {said}")
    return "\n".join(lines)


def from_hydro(data: HydroData, fit: RadiationFit | None, dofs: Sequence[str] | None, order: int | None,
               accuracy: float | None, options: dict[str, object], own: bool = False) -> Model:
    """Return the model of data with M and C, see `Model.from_hydro`; `own`: the fit is known to be of these data."""
    if fit is not None and not isinstance(fit, RadiationFit):
        raise InputError(f"fit: a RadiationFit is needed, {type(fit).__name__} found (order=2 makes one of order 2)")
    if fit is not None and (order is not None or options):
        other = ", ".join(["order"] * (order is not None) + [*options])
        raise InputError(f"fit: given, and {other} too, which is for a fit that is made; give one of the two")
    if dofs is None and fit is not None:
        dofs = fit.dofs
    if dofs is not None:
        data = data.select(dofs)
    data = data.with_A_inf()
    for name, what in (("M", "the inertia matrix"), ("C", "the hydrostatic stiffness")):
        if getattr(data, name) is None:
            raise InputError(f"{data.source or 'data'}: {what} ({name}) is missing and a model needs it")
    assert data.M is not None and data.C is not None and data.A_inf is not None
    if wrong := inertia_not_positive(data.M, data.A_inf, data.dofs)[1]:
        raise InputError(f"{data.source or 'data'}: {wrong}")
    given = fit is not None
    if fit is None:
        fit = fit_for_motion(data, order, accuracy, options)
    elif (skew := inertia_not_symmetric(data.A_inf, data.M, data.dofs)):
        warnings.warn(InputWarning(f"{data.source or 'data'}: {skew}"), stacklevel=3)
    if given and not own:
        check_fit(fit, data)
    if loose := statically_unstable(data.M, data.C, data.dofs):
        warnings.warn(InputWarning(f"{data.source or 'data'}: {unstable_text(loose)}; check the centre of gravity, "
                                   "or add what restores it: model.attached(stiffness={...})"), stacklevel=3)
    return Model(dofs=data.dofs, M=data.M, A_inf=data.A_inf, C=data.C, fit=fit, D=data.D,  # type: ignore[arg-type]
               hydro=data, name=Path(data.source).stem or "body")


def check_fit(fit: RadiationFit, data: HydroData, usual: float = 0.1, change: float = 0.02, other: float = 0.9) -> None:
    """Refuse a radiation model that is not stable or of another body than the data; warn of one that does not fit.

    Its error is compared with what it states, or `usual` where it states none. More than twice that, and more by
    `change`, is doubtful; by `other`, about as far off as no radiation at all, it is of another body. Energy that it
    gives is told from a share `change` of its largest damping on.
    """
    from radiation_ss.fit.problem import joint_error

    if fit.states == 0 or tuple(fit.dofs) != data.dofs or data.A_inf is None:
        return
    if not fit.stable:
        raise InputError(f"fit: not stable, {fit.certificate}")
    if fit.certificate.margin < -change:
        warnings.warn(InputWarning(f"fit: it can give energy to the body; {fit.certificate}"), stacklevel=4)
    stated = usual if np.isnan(fit.whole_error) else fit.whole_error
    off = joint_error(data, fit.frequency_response(data.omega))
    dense = (f"; it is for {fit.density:g} kg/m^3, these are for {data.rho:g}"
             if fit.density is not None and abs(fit.density - data.rho) > 1e-3 * data.rho else "")
    said = (f"fit: its K is off the coefficients of {data.source or 'the data'} by {percent(off)}, and "
            + (f"{percent(stated)} is usual" if np.isnan(fit.whole_error) else f"it states {percent(stated)}") + dense)
    if off > stated + other:
        raise InputError(f"{said}: it is of another body, reference point, unit or sign; fit_radiation makes one of "
                         "these coefficients")
    if off > max(2.0 * stated, stated + change) or dense:
        warnings.warn(InputWarning(f"{said}; is it of this body?"), stacklevel=4)


def fit_for_motion(data: HydroData, order: int | None, accuracy: float | None, options: dict[str, object],
                   least: float = 0.02, wrong: float = 0.2, dearest: float = 1.5) -> RadiationFit:
    """Return a fit of data with M, C and A_inf.

    With `accuracy` (and no order) the order is raised up to 8 until the relative error is below it. What is small
    beside the largest K may be large for a slow motion, so the fit is made again, unless that costs `dearest` times
    the relative error: with K(0) = 0 where it damps a motion at its natural frequency more than the file does (moored,
    or without stiffness: a mooring holds such a motion far below the waves), and exact at natural frequencies where it
    misses more than the share `least` of the inertia's impedance, or `wrong` of the damping, which bounds resonance.
    """
    from radiation_ss.fit.radiation import fit_radiation

    def tried(options: dict[str, object], order: int | None) -> tuple[RadiationFit, list[warnings.WarningMessage]]:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            return fit_radiation(data, order, **options), said  # type: ignore[arg-type]

    def best(options: dict[str, object], orders: tuple[int | None, ...], enough: float | None) -> RadiationFit:
        """Return the closest fit; only what was said of that one is said."""
        fit, said = tried(options, orders[0])
        for finer in orders[1:]:
            if enough is None or (fit.relative_error or 0.0) <= enough:
                break
            if finer is not None and finer > fit.order:
                fit, said = min((fit, said), tried(options, finer), key=lambda one: one[0].relative_error or 0.0)
        for warning in said:
            warnings.warn(warning.message, stacklevel=4)
        return fit

    def ways() -> Iterator[tuple[dict[str, object], tuple[int | None, ...], str]]:
        """Yield how the fit that there is should be made again: options, orders, a note."""
        if "at_zero" not in options and (loose := damped_at_rest(data, fit)):
            yield ({"at_zero": "zero"}, (fit.order,), f"K(0) = 0: the closest fit damps {', '.join(loose)} more at the "
                   "natural frequency, at rest without stiffness, than the file does")
        if options.get("points") is None and (missed := missed_swings(data, fit, least, wrong)):
            where = ", ".join(f"{omega:.3g}" for omega in missed)
            yield ({"points": missed}, orders if order is not None else (fit.order, 8), "made exact at the natural "
                   f"frequency, {where} rad/s: the closest fit misses more than {least:.0%} of what the motion feels "
                   f"there, or {wrong:.0%} of its damping")

    orders = (order,) if order is not None else (None, 4, 6, 8)
    fit, said = best(options, orders, accuracy), list[str]()
    for changed, finer, note in ways():
        most = max(dearest * (fit.relative_error or 0.0), least)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", InputWarning)  # what it costs elsewhere is weighed here
                exact = best({**options, **changed}, finer, most)
        except (InputError, SolverError):
            continue
        if exact.relative_error <= most:
            options, said = {**options, **changed}, [*said, note]
            fit = replace(exact, notes=(*exact.notes, *said))
    return fit


def damped_at_rest(data: HydroData, fit: RadiationFit, least: float = 1e-3) -> list[str]:
    """Return the motions that a fit damps more than the file does at their natural frequency.

    That of one without stiffness is zero. Below the file's frequencies its first one counts. Within them the fit damps
    twice as much, and by a share `least` of the inertia's impedance more: a damping ratio of half of that.
    """
    assert data.M is not None and data.C is not None
    stiffness, inertia = np.diag(data.C), np.diag(data.M + data.A[0])
    omega = np.sqrt(np.maximum(stiffness, 0.0) / inertia)
    damping = np.einsum("jjj->j", fit.frequency_response(omega).real)
    told = np.maximum([np.interp(w, data.omega, data.B[:, i, i]) for i, w in enumerate(omega)], 0.0)
    most = np.where(omega < data.omega[0], told, 2.0 * told + least * omega * inertia)
    return [dof for i, dof in enumerate(data.dofs) if stiffness[i] >= 0.0 and damping[i] > most[i]]


def missed_swings(data: HydroData, fit: RadiationFit, least: float, wrong: float) -> list[float]:
    """Return the natural frequencies [rad/s] at which a motion of its own feels another impedance than the file's.

    The natural frequency is the first within the file's beyond which the inertia outweighs the stiffness; a motion
    without stiffness has none. The file's is interpolated.
    """
    assert data.M is not None and data.C is not None
    found = set()
    for i in range(data.n):
        over = data.omega**2 * (data.M[i, i] + data.A[:, i, i]) - data.C[i, i]
        beyond = np.flatnonzero(over > 0.0)
        if data.C[i, i] > 0.0 and beyond.size:
            near = slice(max(beyond[0] - 1, 0), beyond[0] + 1)
            omega = float(np.interp(0.0, over[near], data.omega[near]))
            K = np.interp(omega, data.omega, data.K[:, i, i])
            off = fit.frequency_response(np.array([omega]))[0, i, i] - K
            if abs(off) > least * data.C[i, i] / omega or abs(off.real) > wrong * K.real > 0.0:
                found.add(omega)
    return sorted(found)
