"""The equation error of a model along measured motion: its rows, and the columns that every candidate has."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import fftconvolve

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import couplings_by_symmetry, nominal_effects
from radiation_ss.fit.rational import frequency_response
from radiation_ss.inference.effect_features import Feature, features_of
from radiation_ss.inference.force_errors import force_errors, shape_errors
from radiation_ss.inference.linear_model import Columns, Posterior, Rows, Sizes, joined
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.own import BEFORE, COHERENT, OFFSET, TOLERANCE, Own
from radiation_ss.inference.problem import Discrepancy, EquationError, columns_of, nothing, scales_of
from radiation_ss.inference.rows import (
    BANDS,
    Place,
    all_places,
    bins_of,
    jacobian_weight,
    local_size,
    moved,
    powers,
    rather_noise,
    relative_gap,
    rows_of,
    spectral_groups,
    tied,
)
from radiation_ss.simulation.linear import radiation_states

LEFT_OUT = "radiation left out||"
POWERS = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))  # of displacement and velocity


def equation_error(model: Model, runs: Sequence[MeasuredMotion], tolerance: Mapping[str, float],
                   discrepancy: Discrepancy | None = None) -> EquationError:
    """Return the regression problem of a model and records, without any effect.

    `tolerance`: from `effects.nominal.tolerances`.
    """
    discrepancy = discrepancy or Discrepancy()
    places = tuple(all_places(runs))
    n = model.n
    count = places[-1].rows.stop
    error, noise, scale, steady, group, sensor = (
        np.concatenate(part) for part in zip(*(rows_of(model, runs[p.record], p) for p in places)))
    speeds = sorted({abs(run.record.speed) for run in runs})
    for place in places:
        # Under way the flow is another one, and so is what a model leaves of it.
        at = speeds.index(abs(runs[place.record].record.speed)) if place.order < 0 else len(speeds) - 1
        group[place.rows] += n * BANDS * at
    gap = np.array([relative_gap(places, runs, model, i, error, noise) for i in range(n)])
    spectra = spectral_groups(places, runs, group, n * BANDS * len(speeds) + n)
    by_band = np.tile(np.repeat(gap, BANDS), len(speeds))
    share = np.concatenate([discrepancy.unexplained * by_band, np.full(n, discrepancy.sensors),
                            np.full(spectra, discrepancy.spectrum)])
    ambient = np.concatenate([discrepancy.ambient * by_band, np.full(n, discrepancy.sensors),
                              np.full(spectra, discrepancy.ambient * 0.05)])
    power, quiet = powers(places, runs, scale, discrepancy.saturation), rather_noise(model, runs, places, error, noise)
    weight, (fine, kind) = jacobian_weight(places, runs, power * ~quiet, n), bins_of(places, runs, count, n)
    ties = tied(model, runs, places, scale, noise, discrepancy.mixing)
    rows = Rows(error if ties is None else ties @ error, noise, scale, steady, group, sensor, share, ambient, power,
                weight, fine, kind, tuple(p.rows for p in places), spectra)
    scales = {dof: scales_of(model, runs, i) for i, dof in enumerate(model.dofs)}
    empty = EquationError(model, tuple(runs), rows, nothing(count, weight.size), (), places, gap, scales, discrepancy,
                          ties, quiet)
    base, labels = base_columns(empty, tolerance, discrepancy)
    own = tuple(own_columns(empty, r, tolerance, discrepancy) for r in range(len(runs)))
    return replace(empty, base=base, labels=labels, rows=replace(rows, own=own))


def base_columns(problem: EquationError, tolerance: Mapping[str, float],
                 discrepancy: Discrepancy) -> tuple[Columns, tuple[str, ...]]:
    """Return what every candidate has in all records: nominal numbers, coherent errors."""
    model, labels, parts = problem.model, [], []
    for own in nominal_effects(model, tolerance, force=problem.forced):
        found = features_of(problem.symbols(own.active), own.active, problem.runs)
        parts.append(columns_of(problem, (of_record[0] for of_record in found), own.spread, TOLERANCE, linear=True))
        labels.append(f"{own.active.name}|{own.active.dof}|{own.active.other}")
    for active in couplings_by_symmetry(model):
        found = features_of(problem.symbols(active), active, problem.runs)
        parts.append(columns_of(problem, (of_record[0] for of_record in found), discrepancy.symmetry, linear=True))
        labels.append(f"asymmetry|{active.dof}|{active.other}")
    if model.hydro is not None:
        left_out = (radiation_left_out(model, run) for run in problem.runs)
        parts.append(columns_of(problem, left_out, 1.0, linear=True))
        labels.append(LEFT_OUT)
    coherent, names = coherent_columns(problem, discrepancy)
    return joined([*parts, *coherent]), (*labels, *names)


def radiation_left_out(model: Model, run: MeasuredMotion) -> Feature:
    """Return the radiation force that the fit leaves out of its data along a motion, and its response.

    The kernel is r(t) = 2/pi int_0^inf (B(w) - Re K(iw)) cos(w t) dw, with B between its frequencies by monotone
    cubics, and nothing known beyond the last one. Of a strength 0 the truth is the fit, of 1 the data.
    """
    hydro, count, dt = model.hydro, run.time.size, run.dt
    force, response = np.zeros_like(run.x), np.zeros((run.omega_fine.size, model.n, model.n), dtype=complex)
    if hydro is None or run.record.kind == "static":
        return Feature(force, force, response, response, force)
    K = frequency_response(model.fit.a, model.fit.b, model.fit.c, np.asarray(hydro.omega))
    known = np.r_[0.0, hydro.omega[hydro.omega > 0.0]]
    values = np.concatenate([np.zeros((1, model.n, model.n)), (hydro.B - K.real)[hydro.omega > 0.0]])
    omega = 2.0 * np.pi * np.fft.rfftfreq(4 * count, dt)
    spectrum = np.where((omega <= known[-1])[:, None, None], PchipInterpolator(known, values)(omega), 0.0)
    kernel = 2.0 * np.fft.irfft(spectrum, 4 * count, axis=0)[:count]
    kernel[0] *= 0.5
    there = np.flatnonzero(np.any(kernel, axis=0).any(axis=0) & run.free)
    for j in there:
        force -= fftconvolve(run.v[[j]], kernel[:, :, j].T, axes=1)[:, :count]
    if not run.prescribed:
        turned = np.exp(-1j * np.outer(run.omega_fine, run.time - run.time[0]))
        response -= 1j * run.omega_fine[:, None, None] * np.tensordot(turned, kernel, axes=1)
    return Feature(force, np.zeros_like(force), response, np.zeros_like(response), np.zeros_like(force))


def left_out(problem: EquationError, posterior: Posterior, clear: float = 3.0) -> bool:
    """Whether the records show the radiation that its fit leaves out, by more than `clear` standard deviations."""
    if LEFT_OUT not in problem.labels:
        return False
    k = problem.labels.index(LEFT_OUT)
    return bool(posterior.mean[k] > clear * np.sqrt(posterior.covariance[k, k]))


def own_columns(problem: EquationError, r: int, tolerance: Mapping[str, float], discrepancy: Discrepancy) -> Own:
    """Return what one record has for itself: offsets, wandering, errors of its force, what was before it."""
    model, run, name = problem.model, problem.runs[r], problem.runs[r].record.name
    forces, labels, spreads, factors = [], [], [], []
    for i in np.flatnonzero(run.free):
        size = problem.scales[model.dofs[i]].force
        found = record_columns(problem, run, int(i), size, discrepancy)
        found += [(label, values, discrepancy.by_record * tolerance["force"], TOLERANCE)
                  for label, values in force_errors(model, run, int(i)) + shape_errors(model, run, int(i))]
        for label, values, spread, factor in found:
            forces.append({int(i): values})
            labels.append(f"{label}|{model.dofs[i]}|{name}")
            spreads.append(spread)
            factors.append(factor)
    forces += [dict(enumerate(values)) for values in run.transients]
    labels += [f"transient {k}||{name}" for k in range(len(run.transients))]
    labels += [f"integration {k}||{name}" for k in range(len(run.lost))]
    more = len(run.transients) + len(run.lost)
    began = [BEFORE if run.record.kind == "decay" else 0] * len(run.transients)
    mine = [p for p in problem.places if p.record == r]
    first, last = mine[0].rows.start, mine[-1].rows.stop
    columns = np.zeros((last - first, len(labels)))
    for place in mine:
        rows = columns[place.rows.start - first:place.rows.stop - first]
        here = [k for k, series in enumerate(forces) if place.order < 0 and place.dof in series]
        if here:
            stacked = np.stack([forces[k][place.dof] for k in here])
            rows[:, here] = projected_on(run.basis, stacked, bins=place.bins).reshape(len(here), -1).T
        for k, series in enumerate(run.lost):
            rows[:, len(forces) + k] = read_wrongly(model, run, place, series)
    if problem.ties is not None:
        columns = problem.ties[first:last, first:last] @ columns
    parts = []
    for place in mine:
        rows = columns[place.rows.start - first:place.rows.stop - first]
        at = np.flatnonzero(np.any(rows, axis=0))
        parts.append((place.rows, at, np.ascontiguousarray(rows[:, at])))
    factors += [*began, *[0] * len(run.lost)]
    return Own(tuple(parts), np.array([*spreads, *[1.0] * more]), np.array(factors, dtype=int), tuple(labels))


def read_wrongly(model: Model, run: MeasuredMotion, place: Place, series: FloatArray) -> FloatArray:
    """Return the rows of one place for an error of the readings, shape (n, nt)."""
    if place.order < 0:
        return moved(model, run, place, series, model.fit.c @ radiation_states(model, series, run.dt))
    return -projected_on(run.basis, series[place.dof], place.order, place.bins).ravel()


def slow_columns(run: MeasuredMotion, i: int, damping: float, sd: float) -> list[tuple[str, FloatArray, float, int]]:
    """Return the force that held the first place of a slow test, and the model's damping, as `record_columns` does."""
    found, reached = [], run.v[i] != 0.0
    if np.any(reached) and not np.all(reached):  # from which side it was reached, and so what friction does, is unknown
        found.append(("arrival", 1.0 - reached, sd, 0))
    if damping > 0.0 and np.any(run.pace[i]):
        found.append(("pace", run.pace[i], damping, 0))
    return found


def record_columns(problem: EquationError, run: MeasuredMotion, i: int, size: float,
                   discrepancy: Discrepancy) -> list[tuple[str, FloatArray, float, int]]:
    """Return offset, drift, release, wandering stiffness and damping of one motion in one record, or `slow_columns`.

    Of each its label, force, prior standard deviation and common factor, as in `Own`. A force's zero is nothing to a
    body that is held; one that nothing restores is carried away by it, so there it is none of the tolerances.
    """
    held = problem.model.C[i, i] != 0.0 or run.record.kind in ("static", "prescribed")
    found = list[tuple[str, FloatArray, float, int]]()
    if held:
        found.append(("offset", np.ones(run.time.size), discrepancy.offset * size, OFFSET))
    if run.record.kind == "static":
        found += slow_columns(run, i, problem.model.D[i, i], discrepancy.release * size)
    elif held:
        drift = np.linspace(-np.sqrt(3.0), np.sqrt(3.0), run.time.size)
        found.append(("drift", drift, discrepancy.offset * size, OFFSET))
    if run.record.kind == "decay":
        gone = 0.5 * np.clip((run.time - run.time[0]) * run.omega[i], 0.0, 2.0 * np.pi)  # pi at the first period's end
        found += [(f"release {k}", np.cos(0.5 * gone) ** 2 * np.cos(k * gone), discrepancy.release * size, 0)
                  for k in range(4)]
    found += [(f"slow {k}", values, size, 0) for k, values in enumerate(slow_cosines(problem, run, i), start=1)]
    duration = run.time[-1] - run.time[0]
    count = int(np.clip(duration * run.omega[i] / (2 * np.pi) / 4.0, 1, 8))
    part = discrepancy.wandering * problem.gap[i] / np.sqrt(count)
    share = (run.time - run.time[0]) / duration
    stiff = max(abs(problem.model.C[i, i]), (problem.model.M + problem.model.A_inf)[i, i] * run.omega[i] ** 2)
    for k in range(1, count + 1):
        shape = np.sqrt(2.0) * np.cos(np.pi * k * share)
        found.append((f"wandering stiffness {k}", shape * run.x[i], part * stiff, COHERENT))
        if run.record.kind != "static":
            found.append((f"wandering damping {k}", shape * run.v[i], part * stiff / run.omega[i], COHERENT))
    return found


def slow_cosines(problem: EquationError, run: MeasuredMotion, i: int) -> FloatArray:
    """Return the course of any slow force on a motion that is mostly a drift in any record, (k, nt); else none.

    Rows of their own sizes would not do: what a strong one leaves in the rows of the waves is not independent there.
    """
    top = problem.drifting_below[problem.runs.index(run), i]
    share = (run.time - run.time[0]) / (run.time[-1] - run.time[0])
    count = int(top * (run.time[-1] - run.time[0]) / np.pi)
    return np.asarray(np.cos(np.pi * np.outer(np.arange(1, count + 1), share)))


def coherent_columns(problem: EquationError, discrepancy: Discrepancy) -> tuple[list[Columns], list[str]]:
    """Return cubic polynomials of displacement and velocity, the same in all records."""
    parts, labels = [], []
    for i, dof in enumerate(problem.model.dofs):
        for (p, q), sd in coherent_sizes(problem, i, discrepancy).items():
            found = [polynomial(problem, run, i, (p, q)) for run in problem.runs]
            parts.append(columns_of(problem, found, sd, factor=COHERENT))
            labels.append(f"x^{p} v^{q}|{dof}|")
    return parts, labels


def coherent_sizes(problem: EquationError, i: int, discrepancy: Discrepancy) -> dict[tuple[int, int], float]:
    """Return the prior standard deviation of each polynomial: in no record more than a share of the model's own force.

    One size for all records together would leave a large motion under small forces to the polynomials.
    """
    found, own = dict[tuple[int, int], float](), [local_size(problem.model, run, i)[1] for run in problem.runs]
    for p, q in POWERS:
        most = max(float(np.sqrt(np.mean(polynomial(problem, run, i, (p, q)).force[i] ** 2))) / size
                   for run, size in zip(problem.runs, own))
        if most > 0.0:
            found[p, q] = discrepancy.coherent * float(problem.gap[i]) / most
    return found


def unexplained_forces(problem: EquationError, run: MeasuredMotion, i: int, sizes: Sizes) -> list[FloatArray]:
    """Return the forces on one motion of a record that no effect explains, (nt,), one standard deviation each."""
    scales, discrepancy = problem.scales[problem.model.dofs[i]], problem.discrepancy
    share = float(np.exp(sizes.coherent))
    found = [(share if factor == COHERENT else 1.0) * spread * values
             for _, values, spread, factor in record_columns(problem, run, i, scales.force, discrepancy)]
    return found + [share * sd * polynomial(problem, run, i, (p, q)).force[i]
                    for (p, q), sd in coherent_sizes(problem, i, discrepancy).items()]


def polynomial(problem: EquationError, run: MeasuredMotion, i: int, power: tuple[int, int]) -> Feature:
    """Return the force (x / scale)^p (v / scale)^q on one motion of a record, and its mean response."""
    n, scales = problem.model.n, problem.scales[problem.model.dofs[i]]
    (p, q), x, v = power, run.x[i] / scales.x, run.v[i] / scales.v
    # In a static test the velocity is a direction only.
    there = float(run.free[i] and (q == 0 or run.record.kind != "static"))
    force = np.zeros_like(run.x)
    force[i] = there * x**p * v**q
    response = np.zeros((run.omega_fine.size, n, n), dtype=complex)
    by_x, by_v = (np.mean(part) for part in (p * x ** max(p - 1, 0) * v**q, q * x**p * v ** max(q - 1, 0)))
    if not run.prescribed:
        response[:, i, i] = there * (by_x / scales.x + 1j * run.omega_fine * by_v / scales.v)
    return Feature(force, np.zeros_like(force), response, np.zeros_like(response), np.zeros_like(force))
