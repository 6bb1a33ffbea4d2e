"""`identify`: added mass, damping, exciting force and sea from records of a floating body, by one entry point."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import opened
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.identification.assembly import assemble
from radiation_ss.identification.by_dual_filter import by_dual_filter, entrywise
from radiation_ss.identification.force_known import by_prediction_error
from radiation_ss.identification.joint import by_joint_filter
from radiation_ss.identification.motion_only import by_motion_only
from radiation_ss.identification.plant import model_of_system
from radiation_ss.identification.result import Identification
from radiation_ss.identification.study import Findings, Study
from radiation_ss.inference.parameters import parametrise
from radiation_ss.inference.points import Points, known_points
from radiation_ss.methods import accepting
from radiation_ss.records.convert import as_records
from radiation_ss.records.record import Record
from radiation_ss.simulation.measured import released
from radiation_ss.simulation.unit_checks import check_decays, check_units, doubts

if TYPE_CHECKING:
    import control as ct

__all__ = ["Identification", "identify"]

@accepting(model=opened, records=as_records)
def identify(model: Model | ct.StateSpace, records: Record | Sequence[Record], method: str = "spectral",
             prior: float = 0.15, points: Points | None = None, seed: int = 0, *, omega: ArrayLike | None = None,
             tolerance: float | Mapping[str, float] | None = None, point_tolerance: float = 1e-3,
             draws: int = 1000) -> Identification:
    """Identify the radiation memory (added mass, damping) of a body, and the force that moved it.

    Parameters
    ----------
    model : Model or control.StateSpace
        Its numbers are the prior mean. A system has the signals of `cummins`, in any state coordinates.
    records : Record or sequence of Record
        Runs of the same body. Displacement, velocity or acceleration of the model's degrees of freedom. Of a decay
        whose record begins before the release, what comes after; a warning says so.
    method : str
        "spectral": motion only; likelihood of the motion under Haskind's relation and a sea of one JONSWAP system, of
        two, lumpy or free, weighed by their evidence.
        "joint": motion only, recursive: block after block, with a coloured force (`baseline["history"]`).
        "dual-enkf": the paper's dual filter with a default that keeps its spread; one record at a time.
        "prediction-error": force known (force columns, a decay test, or wave elevation with X).
        "points": the prior conditioned on known points only; records are not used.
    prior : float
        Relative standard deviation of K, root mean square over frequency; its scale is learned where the records tell
        it. The same for every method and order: the subsystem's coefficients get what makes K spread so.
    points : mapping or sequence, optional
        Frequencies [rad/s] where K is known: {omega: K}, or frequencies where the model's own data are exact.
    seed : int
    omega : array_like, optional
        Frequencies [rad/s] of the result; those of the model's data by default.
    tolerance : float or mapping of str to float, optional
        Relative standard deviations of what the model states: one number, or by name. "mass", "A_inf", "stiffness",
        0.02; "force" (X): 0.05; "kernel" (what the model's order leaves out of K): 0.01 or the fit's own error if that
        is larger; "sensor" (gain of the motion sensors): 0.005. "force" and "sensor" enter where the force is known,
        "kernel" there and with several degrees of freedom.
    point_tolerance : float
        Relative standard deviation of K at the points.
    draws : int
        Number of draws kept of the posterior.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        If a record lacks what the method needs, its units contradict each other or the model, or a setting is out of
        range.
    SolverError
        If the most probable parameters are not reached.
    """
    if method not in METHODS:
        raise InputError(f"method: {method!r} is unknown; use one of {', '.join(METHODS)}")
    if method == "points" and points is None:
        raise InputError("points: none given, and method 'points' needs at least one frequency [rad/s]")
    if not isinstance(model, Model):
        model = model_of_system(model)
    runs = _named_apart((records,) if isinstance(records, Record) else tuple(records))
    if method == "points":
        runs = ()
    elif not runs:
        raise InputError(f"records: none given, and method {method!r} needs at least one")
    if not 0.0 < prior < 1.0:
        raise InputError(f"prior: relative standard deviation between 0 and 1 needed, found {prior:g}")
    freed = [released(model, record) for record in runs]
    runs = tuple(record for record, _ in freed)
    sizes = tolerances(tolerance)
    if method == "dual-enkf":
        form = entrywise(model, prior)
    else:
        known_forces = method == "prediction-error"
        # The motion of one degree of freedom in an unknown sea does not see so little.
        seen = known_forces or model.n > 1
        rest = max(sizes["kernel"], float(model.fit.relative_error or 0.0)) if seen else 0.0
        form = parametrise(model.fit, model.A_inf, prior, rest)
        if method != "points":
            form = form.with_nominal(sizes if known_forces else sizes | {"sensor": 0.0}, model.M)
    check_units(model, runs)
    check_decays(model, runs)
    known = None if points is None else known_points(model, points, form, point_tolerance)
    study = Study(model, form, runs, known, np.random.default_rng(seed), draws, seed, prior, points, point_tolerance,
                  sizes["force"])
    grid = _frequencies(model, omega)
    found = METHODS[method](study)
    said = [text for _, held in freed for text in held] + [text for record in runs for text in doubts(model, record)]
    return assemble(study, method, grid, replace(found, warnings=tuple(dict.fromkeys((*said, *found.warnings)))))


TOLERANCES = {"mass": 0.02, "A_inf": 0.02, "stiffness": 0.02, "kernel": 0.01, "force": 0.05, "sensor": 0.005}


def tolerances(given: float | Mapping[str, float] | None) -> dict[str, float]:
    """Return a tolerance for each name of TOLERANCES: one number for all, or by name, the default where not named."""
    if given is None:
        given = {}
    if not isinstance(given, Mapping):
        given = dict.fromkeys(TOLERANCES, given)
    unknown = [name for name in given if name not in TOLERANCES]
    if unknown:
        raise InputError(f"tolerance: {unknown[0]!r} is unknown; use {', '.join(TOLERANCES)}")
    out = TOLERANCES | {name: float(value) for name, value in given.items()}
    for name, value in out.items():
        if not 0.0 <= value < 1.0:
            raise InputError(f"tolerance: {name} relative standard deviation from 0 to below 1 needed, found {value}")
    return out


def _named_apart(records: tuple[Record, ...]) -> tuple[Record, ...]:
    """Return the records with names that differ."""
    names: list[str] = []
    for record in records:
        name, number = record.name, 2
        while name in names:
            name, number = f"{record.name}_{number}", number + 1
        names.append(name)
    return tuple(replace(record, name=name) for record, name in zip(records, names))


def _frequencies(model: Model, omega: ArrayLike | None) -> FloatArray:
    if omega is not None:
        grid = np.atleast_1d(np.asarray(omega, dtype=float))
        if grid.size == 0 or not (grid > 0.0).all() or not (np.diff(grid) > 0.0).all():
            raise InputError("omega: positive ascending frequencies [rad/s] needed")
        return grid
    if model.hydro is not None:
        return np.array(model.hydro.omega)
    stiffness, inertia = np.abs(np.diag(model.C)), np.diag(model.M + model.A_inf)
    highest = float(np.sqrt((stiffness / inertia).max()))
    if highest == 0.0:
        highest = float(np.abs(np.linalg.eigvals(model.fit.a)).max())
    return np.linspace(0.05, 3.0, 60) * highest


def _by_points(study: Study) -> Findings:
    inference = study.infer([])
    return Findings(inference.draws[:, :study.n_u], {}, passive=inference.share)


METHODS: dict[str, Callable[[Study], Findings]] = {
    "spectral": by_motion_only,
    "dual-enkf": by_dual_filter,
    "joint": by_joint_filter,
    "prediction-error": by_prediction_error,
    "points": _by_points,
}
