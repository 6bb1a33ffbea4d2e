"""The radiation model that a body's motion needs: fine enough, and right where the body swings."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from radiation_ss.errors import InputError, InputWarning, SolverError
from radiation_ss.fit.radiation import fit_radiation
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData


def fit_for_motion(data: HydroData, order: int | None, accuracy: float | None, options: dict[str, object],
                   least: float = 0.02, dearest: float = 1.5) -> RadiationFit:
    """Return a fit of data with M, C and A_inf.

    With `accuracy` (and no order) the order is raised up to 8 until the relative error is below it. Where the fit
    misses more than the share `least` of the inertia's impedance at a natural frequency, it is made again, exact there,
    unless that costs `dearest` times the relative error: what is small beside the largest K may be large for a slow
    motion.
    """
    orders = (order,) if order is not None else (None, 4, 6, 8)

    def best(points: object, orders: tuple[int | None, ...], enough: float | None) -> RadiationFit:
        fit = fit_radiation(data, orders[0], points=points, **options)  # type: ignore[arg-type]
        for finer in orders[1:]:
            if enough is None or (fit.relative_error or 0.0) <= enough:
                break
            if finer is not None and finer > fit.order:
                trial = fit_radiation(data, finer, points=points, **options)  # type: ignore[arg-type]
                fit = min(fit, trial, key=lambda one: one.relative_error or 0.0)
        return fit

    given = options.pop("points", None)
    fit = best(given, orders, accuracy)
    missed = missed_swings(data, fit, least)
    if given is not None or not missed:
        return fit
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)  # that the points cost accuracy elsewhere is weighed here
            exact = best(missed, orders if order is not None else (fit.order, 8), 0.0)
    except (InputError, SolverError):
        return fit
    if not exact.relative_error <= max(dearest * fit.relative_error, least):
        return fit
    where = ", ".join(f"{omega:.3g}" for omega in missed)
    return replace(exact, notes=(*exact.notes, f"made exact at the natural frequency, {where} rad/s: the closest fit "
                                 f"misses more than {least:.0%} of what the motion feels there"))


def missed_swings(data: HydroData, fit: RadiationFit, least: float) -> list[float]:
    """Return the natural frequencies [rad/s] at which a motion of its own feels another impedance than the file's.

    The natural frequency is the first of the file's beyond which the inertia outweighs the stiffness; a motion without
    stiffness has none.
    """
    assert data.M is not None and data.C is not None
    found = set()
    for i in range(data.n):
        inertia = data.M[i, i] + data.A[:, i, i]
        beyond = np.flatnonzero(data.omega**2 * inertia > data.C[i, i])
        if data.C[i, i] > 0.0 and beyond.size:
            omega = float(data.omega[beyond[0]])
            off = fit.frequency_response(np.array([omega]))[0, i, i] - data.K[beyond[0], i, i]
            if abs(off) > least * omega * inertia[beyond[0]]:
                found.add(omega)
    return sorted(found)
