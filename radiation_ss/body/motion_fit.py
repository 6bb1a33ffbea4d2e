"""The radiation model that the motion of a body needs: close, and right at its natural frequencies."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from radiation_ss.errors import InputError, InputWarning, SolverError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData


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
