"""`identify`: added mass, damping, exciting force and sea from records of a floating body, by one entry point."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, generator, is_number
from radiation_ss.body.convert import as_model, opened
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.identification.channels import between_gaps, check_force_known
from radiation_ss.identification.filters import by_dual_filter, by_joint_filter, entrywise
from radiation_ss.identification.motion_only import by_motion_only
from radiation_ss.identification.prediction_error import by_prediction_error
from radiation_ss.identification.result import Identification, assemble
from radiation_ss.identification.study import (
    Findings,
    Settings,
    Study,
    left_out,
    most_probable,
    settings_of,
)
from radiation_ss.inference.laplace import find_peak, sample
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import Points, known_points
from radiation_ss.inference.prior import parametrise, with_table
from radiation_ss.methods import accepting
from radiation_ss.parallel import on_one_core
from radiation_ss.records.convert import as_records
from radiation_ss.records.marks import check_no_codes
from radiation_ss.records.record import Record
from radiation_ss.records.record_checks import check_given_once, named_apart
from radiation_ss.simulation.headings import along_waves, directional
from radiation_ss.simulation.pushes import let_go
from radiation_ss.simulation.unit_checks import check_decays, check_units, doubts

if TYPE_CHECKING:
    import control as ct


MOTION_ONLY = ("spectral", "joint")  # methods that do not use a recorded force


@accepting(model=lambda given: as_model(opened(given)), records=as_records)
@on_one_core
def identify(model: "Model | ct.StateSpace", records: Record | Sequence[Record], method: str = "spectral",
             prior: float = 0.15, points: Points | None = None, seed: int = 0, *, omega: ArrayLike | None = None,
             **options: Any) -> Identification:
    """Identify the radiation (added mass, damping) of a body, and the force that moved it.

    Parameters
    ----------
    model : Model or control.StateSpace
        Its numbers are the prior mean. A system, continuous or sampled, has the signals of `cummins`, in any state
        coordinates.
    records : Record or sequence of Record
        Runs of the same body. Displacement, velocity or acceleration of the model's degrees of freedom. Of a decay
        whose record begins before the release, what comes after; a warning says so.
    method : str
        "spectral": motion only; likelihood of the motion under Haskind's relation and a sea of one JONSWAP system, of
        two, or free, with and without departures and lumps, weighed by their evidence.
        "joint": motion only, recursive: block after block, with a coloured force (`baseline["history"]`).
        "dual-enkf": the paper's dual filter with a default that keeps its spread; one record at a time.
        "paper": the same with preset="paper", the filter as printed.
        "prediction-error": force known (force columns, a decay test, or wave elevation with X).
        "points": the prior conditioned on known points only; records are not used.
    prior : float
        Relative standard deviation of K, root mean square over frequency; the same for every method and order: the
        subsystem's coefficients get what makes K spread so.
    points : mapping or sequence, optional
        Frequencies [rad/s] where K is known: {omega: K}, or frequencies where the model's own data are exact.
    seed : int
    omega : array_like, optional
        Frequencies [rad/s] of the result; those of the model's data by default.
    **options
        Fields of `identification.study.Settings` (tolerance, draws, ...), and of the dual filter: preset,
        Q_theta, Q_state, Q_force, R (the paper's noise variances), units, analysis, inflation, order, n_ensemble.

    Raises
    ------
    InputError
        If a record lacks what the method needs or is given twice, its units contradict each other or the model, or a
        setting is out of range.
    SolverError
        If the most probable parameters are not reached.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    >>> rss.identify(model, [], "points", points=[6.0], omega=[5.0, 6.0]).B.mean.shape
    (2, 1, 1)
    """
    (method, rules), grid = _asked(method, prior, points, settings_of(options)), _asked_at(omega)
    runs = () if method == "points" else (records,) if isinstance(records, Record) else tuple(records)
    if not runs and method != "points":
        raise InputError(f"records: none given, and method {method!r} needs at least one")
    for record in runs:
        if record.kind == "static":
            raise InputError(f"record {record.name}: a static test has no motion that radiates waves, so it says "
                             "nothing of A, B or a wave's force; `diagnose` takes it for the stiffness")
        if method == "prediction-error":    # what it cannot do without, before what else is wrong with the record
            check_force_known(model, record)
    check_given_once(runs)
    check_no_codes(runs)
    check_decays(model, named_apart(runs))
    freed = [let_go(model, record) for record in named_apart(runs)]
    runs = tuple(record for record, _ in freed)
    waves = [r for r in runs if by_waves(model, r, method)]
    untold = [r.name for r in waves
              if directional(model) and "heading" not in r.meta and "wave_elevation" not in r.channels]
    model = along_waves(model, [r for r in waves if r.name not in untold])
    # The model's own, but for its kernel (see `prior`).
    if rules.tolerance is None or isinstance(rules.tolerance, Mapping):
        stated = {name: value for name, value in model.tolerance.items() if name != "kernel"}
        rules = replace(rules, tolerance={**stated, **(rules.tolerance or {})})
    check_units(model, runs)
    parts = [between_gaps(model, record) if method == "prediction-error" else ([record], []) for record in runs]
    taken = tuple(part for each, _ in parts for part in each)
    # A decay, which has one frequency, does not see such errors, nor does motion whose force is X's.
    forced = sum(record.kind != "decay" for record in runs) > len(waves)

    def study_of(prior: float, smooth: bool) -> Study:
        beyond = prior * rules.beyond if method == "prediction-error" and forced else 0.0
        form = _form(model, method, prior, beyond, rules, bool(waves), smooth)
        known = None if points is None else known_points(model, points, form, rules.point_tolerance)
        return Study(model, form, taken, known, points, seed, generator(seed), rules)

    said = [text for record in runs for text in doubts(model, record)]
    said += [text for _, left in [*freed, *parts] for text in left]
    try:
        study, found = _answered(study_of, method, prior)
    except SolverError as error:
        raise SolverError("; ".join([str(error), *said])) from None
    said += [f"record {name}: it does not say where its waves go to (comment `# heading: 90`); X of the model's first "
             "direction is taken for the sea" for name in untold]
    said += [f"record {record.name}: method {method!r} takes the motion alone, and compares the force columns with the "
             "force that it estimates; method 'prediction-error' uses them" for record in runs
             if method in MOTION_ONLY and record.kind != "decay"
             and record.get("force", model.dofs) is not None]
    left = float(model.fit.relative_error or 0.0)
    if study.form.beside is None and left > max(prior / 3.0, rules.tolerances["kernel"]):
        said.append(f"the radiation model leaves out {left:.0%} of K in its own data, which it does not carry: that "
                    "goes into what is found, and the bands may not hold it; a fit with more states tells more")
    grid = _frequencies(model) if grid is None else grid
    return assemble(study, method, grid, replace(found, warnings=tuple(dict.fromkeys((*said, *found.warnings)))))


def _answered(study_of: Callable[[float, bool], Study], method: str, prior: float,
              wider: float = 3.0) -> tuple[Study, Findings]:
    """Return what a method finds under the most probable of some priors, of those that lead to an answer.

    Where the force is known errors of K may be smooth or not, and linear damping that the model lacks has a rival:
    radiation `wider` times farther off than `prior` tells.
    """
    reached, errors, usual = list[tuple[Study, Findings]](), list[SolverError](), 0
    for size in (prior, min(wider * prior, 0.9)):
        for smooth in (True, False) if method == "prediction-error" else (True,):
            try:
                study = study_of(size, smooth)
                reached.append((study, METHODS[method](study)))
            except SolverError as error:
                errors.append(error)
        usual = usual or len(reached)
        if not any(found.damping for _, found in reached):
            break
    if not reached:
        raise errors[0]
    study, found = most_probable([study for study, _ in reached], [found for _, found in reached])
    if all(study is not one for one, _ in reached[:usual]):
        said = (f"the records contradict the prior of K, {prior:.0%}: one {wider:g} times as wide is more probable, "
                "and in the answer")
        found = replace(found, warnings=(*found.warnings, said))
    return study, found


def _asked(method: str, prior: float, points: Points | None, rules: Settings) -> tuple[str, Settings]:
    """Return the method by its own name, with its settings; InputError where they do not fit each other."""
    if method == "paper" or (rules.preset is not None and method == "spectral"):
        method, rules = "dual-enkf", replace(rules, preset=rules.preset or "paper")
    if method not in METHODS:
        raise InputError(f"method: {method!r} is unknown; use one of {', '.join((*METHODS, 'paper'))}")
    if method == "points" and points is None:
        raise InputError("points: none given, and method 'points' needs at least one frequency [rad/s]")
    if (rules.preset is not None or rules.filter) and method != "dual-enkf":
        raise InputError(f"preset and {', '.join(rules.filter) or 'Q_theta'}: options of the dual filter; use method "
                         "'dual-enkf' or 'paper'")
    if rules.tolerance is not None and method == "dual-enkf":
        raise InputError(f"tolerance: {rules.tolerance!r} found, but the dual filter takes the model's numbers as they "
                         "are; use method 'prediction-error', 'spectral' or 'joint'")
    if not is_number(prior) or not 1e-6 < prior < 1.0:
        raise InputError(f"prior: relative standard deviation between 1e-6 and 1 needed, found {prior!r}")
    return method, rules


def by_waves(model: Model, record: Record, method: str) -> bool:
    """Whether a method takes the size of the force on a record's motion from X."""
    if method in MOTION_ONLY:
        return record.kind != "decay"
    unknown = record.kind != "decay" and record.get("force", model.dofs) is None
    return unknown and method == "prediction-error" and "wave_elevation" in record.channels


def _form(model: Model, method: str, prior: float, beyond: float, rules: Settings, waves: bool,
          smooth: bool) -> Parametrisation:
    """Return the parameters that a method moves, with their prior; `waves`: whether X gives the force of a record.

    `prior`, `beyond`, `smooth`: as in `parametrise`.
    """
    if method == "dual-enkf":
        return entrywise(model, prior)
    sizes, known_forces = rules.tolerances, method == "prediction-error"
    rest = left_out(model, rules)
    # The motion of one degree of freedom in an unknown sea does not see as little as the tolerance is.
    if rest <= sizes["kernel"] and model.n == 1 and not known_forces:
        rest = 0.0
    form = with_table(parametrise(model.fit, model.A_inf, prior, rest, smooth, beyond), model)
    if method == "points":
        return form
    seen = {"sensor": known_forces, "force": known_forces and waves}    # else the sea's own size takes them in
    return form.with_nominal(sizes | {name: 0.0 for name, there in seen.items() if not there}, model.M)


def _asked_at(omega: ArrayLike | None) -> FloatArray | None:
    """Return the frequencies asked for; InputError if they are none."""
    try:
        grid = None if omega is None else np.atleast_1d(np.array(omega, dtype=float))  # the caller's own may change
    except (TypeError, ValueError):
        grid = np.zeros(0)
    if grid is not None and not (grid.ndim == 1 and grid.size and grid[0] > 0.0 and np.isfinite(grid).all()
                                 and (np.diff(grid) > 0.0).all()):
        raise InputError(f"omega: {omega!r}; positive ascending frequencies [rad/s] are needed")
    return grid


def _frequencies(model: Model) -> FloatArray:
    if model.hydro is not None:
        return np.array(model.hydro.omega)
    stiffness, inertia = np.abs(np.diag(model.C)), np.diag(model.M + model.A_inf)
    highest = float(np.sqrt((stiffness / inertia).max()))
    if highest == 0.0:
        highest = float(np.abs(np.linalg.eigvals(model.fit.a)).max())
    return np.linspace(0.05, 3.0, 60) * highest


def _by_points(study: Study) -> Findings:
    target = study.target([])
    draws, share = sample(target, [find_peak(target, np.zeros(target.size))], study.rng, study.rules.draws,
                          study.rules.least_passive)
    return Findings(draws, {}, passive=share)


METHODS: dict[str, Callable[[Study], Findings]] = {
    "spectral": by_motion_only,
    "dual-enkf": by_dual_filter,
    "joint": by_joint_filter,
    "prediction-error": by_prediction_error,
    "points": _by_points,
}
