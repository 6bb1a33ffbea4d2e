"""Dynamics of a linear body: natural modes; the model of a file's data; exact steps, and back; the text."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.linalg import expm, logm
from scipy.optimize import linear_sum_assignment

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.body.motion_fit import fit_for_motion
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import RIGID, HydroData, force_unit, mode, motion_unit
from radiation_ss.hydro.measures import (
    inertia_not_positive,
    inertia_not_symmetric,
    percent,
    statically_unstable,
    unstable_text,
)

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def impedance(model: Model, omega: FloatArray) -> ComplexArray:
    """Return Z(iw), force over displacement, shape (nw, n, n)."""
    w = omega[:, None, None]
    K = model.fit.frequency_response(omega)
    return np.asarray(model.C - w**2 * (model.M + model.A_inf) + 1j * w * (K + model.D))


def hold_matrices(a: FloatArray, b: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (F, held, after) of the exact step x_(k+1) = F x_k + (held - after) u_k + after u_(k+1), u linear between.

    `held` alone is the step for an input held constant. From one matrix exponential (Van Loan 1978). `a`, `b`
    (..., N, N), (..., N, n_in). `dt`: time step [s].
    """
    N, n = b.shape[-2:]
    block = np.zeros((*b.shape[:-2], N + 2 * n, N + 2 * n))
    block[..., :N, :N], block[..., :N, N:N + n] = a * dt, b * dt
    block[..., N:N + n, N + n:] = np.eye(n)
    whole = expm(block)[..., :N, :]
    return whole[..., :N], whole[..., N:N + n], whole[..., N + n:]


def continuous(system: Matrices, dt: float, rows: tuple[Sequence[int], Sequence[int]], name: str,
               tolerance: float = 1e-6) -> Matrices:
    """Return the continuous system behind a sampled one, by whichever method of python-control made it.

    Only by the right one are the outputs in the second of `rows`, velocities, the rates of those in the first,
    displacements, to a relative `tolerance`. InputError if none fits.
    """
    x, v = rows
    found = {method: undo(system, dt) for method, undo in UNDO.items()}

    def off(matrices: Matrices) -> float:
        F, G, H, J = matrices
        if not all(np.isfinite(part).all() for part in matrices):
            return np.inf
        size = [np.abs(part).max() + 1e-300 for part in (H[v], H[v] @ G, np.abs(H[x]).max() * G)]
        parts = (H[x] @ F - H[v], J[v], H[x] @ G)
        return max(float(np.abs(part).max() / one) for part, one in zip(parts, size))

    best = min(found.values(), key=off)
    if not off(best) < tolerance:
        raise InputError(f"{name}: sampled at dt = {dt:g} s, but by none of {', '.join(found)} are its velocities the "
                         "rates of its displacements; give the continuous system")
    F, G, H, J = best
    return F, G, H, np.where(np.abs(J) > tolerance * np.abs(J).max(), J, 0.0)


def _undo_weighted(system: Matrices, dt: float, weight: float) -> Matrices:
    """Undo a method that takes the rate at the end of a step with this weight, at its beginning with the rest."""
    A, B, C, D = system
    one = np.eye(len(A))
    with np.errstate(all="ignore"):
        try:
            a = np.asarray(np.linalg.solve((weight * A + (1.0 - weight) * one).T, (A - one).T).T / dt)
        except np.linalg.LinAlgError:
            a = np.full_like(A, np.nan)
    left = one - weight * dt * a
    b, c = left @ B / dt, C @ left
    return a, b, c, D - weight * c @ B


def _undo_hold(system: Matrices, dt: float, linear: bool) -> Matrices:
    """Undo an input that is held, or linear, between samples."""
    A, B, C, D = system
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its accuracy is judged by what comes out
        a = np.asarray(np.real(logm(A)) / dt, dtype=np.float64)
    if not np.isfinite(a).all():
        return a, B, C, D
    _, held, after = hold_matrices(a, np.eye(len(A)), dt)
    after = linear * after
    b = np.asarray(np.linalg.solve(held - after + A @ after, B))
    return a, b, C, D - C @ after @ b


UNDO: dict[str, Callable[[Matrices, float], Matrices]] = {
    "zoh": partial(_undo_hold, linear=False), "foh": partial(_undo_hold, linear=True),
    "tustin": partial(_undo_weighted, weight=0.5), "euler": partial(_undo_weighted, weight=0.0),
    "backward_diff": partial(_undo_weighted, weight=1.0)}


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
