"""The equation error of a model along measured motion: rows of a regression, columns for what may explain it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Scales
from radiation_ss.effects.nominal import natural_frequency, nominal_effects
from radiation_ss.inference.features import Feature, features, impedance
from radiation_ss.inference.measured_motion import FINE, MeasuredMotion, radiation_states
from radiation_ss.inference.own import Own
from radiation_ss.inference.regression import Columns, Posterior, Rows, joined

BANDS = 4  # unexplained force: below, around, at twice and at three times the typical frequency


@dataclass(frozen=True)
class Discrepancy:
    """Prior sizes of what no effect explains.

    Parameters
    ----------
    unexplained : float
        Median of the smooth random force in each band that goes with the motion's size, of the gap.
    ambient : float
        Median of the one that does not, of the gap.
    spectrum : float
        Median of an unknown exciting force at each frequency, of the model's own forces.
    sensors : float
        Median of the disagreement of two sensors, of their signal.
    coherent : float
        Cubic polynomials of displacement and velocity, of the gap.
    wandering : float
        Stiffness and damping that vary slowly, of the gap.
    offset : float
        Zero of a sensor, of the model's own forces.
    mixing : float
        Error of one motion's row, of the model's own force, with which it may enter another's to take noise out of it.
    by_record : float
        Error of the force that differs from record to record, in size and phase, of the stated tolerance.
    saturation : float
        Number of rows beyond which more of them say little new: likelihoods are taken to 1/(1 + N/saturation). Rows
        count by the energy of the motion around them.
    """

    unexplained: float = 0.1
    ambient: float = 0.02
    sensors: float = 0.003
    spectrum: float = 0.3
    coherent: float = 0.1
    wandering: float = 0.05
    offset: float = 0.05
    mixing: float = 0.003
    by_record: float = 0.5
    saturation: float = 300.0


@dataclass(frozen=True, eq=False)
class Place:
    """Where the rows of one degree of freedom of one record lie, and what projects signals onto them.

    Parameters
    ----------
    record, dof : int
    order : int
        -1 for the equation of motion, else the order of a second sensor.
    bins : int
        How many of each block's test functions are used.
    rows : slice
    """

    record: int
    dof: int
    order: int
    bins: int
    rows: slice


@dataclass(frozen=True, eq=False)
class EquationError:
    """Rows, the columns that every candidate has, and what makes more columns.

    Parameters
    ----------
    model : Model
    runs : tuple of MeasuredMotion
    rows : Rows
    base : Columns
        Nominal numbers and coherent errors; what one record has for itself is `rows.own`.
    labels : tuple of str
        Of the columns of `base`.
    places : tuple of Place
    gap : ndarray, shape (n,)
        Relative size of the nominal model's equation error of each degree of freedom.
    scales : mapping of dof to Scales
    discrepancy : Discrepancy
    ties : sparse array, shape (N, N), or None
        What each row is with multiples of other motions' rows added: see `tied`.
    """

    model: Model
    runs: tuple[MeasuredMotion, ...]
    rows: Rows
    base: Columns
    labels: tuple[str, ...]
    places: tuple[Place, ...]
    gap: FloatArray
    scales: Mapping[str, Scales] = field(default_factory=dict)
    discrepancy: Discrepancy = field(default_factory=Discrepancy)
    ties: csr_array | None = None

    def mixed(self, values: FloatArray) -> FloatArray:
        """Return rows of the equation of motion, shape (N, ...), with other motions' rows added."""
        return values if self.ties is None else np.asarray(self.ties @ values)

    @cached_property
    def impedances(self) -> list[tuple[ComplexArray, ComplexArray]]:
        """Z of each record where the Jacobian is taken, and its inverse for the record's own motions, (nw, n, n)."""
        found = []
        for run in self.runs:
            Z = impedance(self.model, run.omega_fine)
            own, inverse = np.ix_(np.arange(len(Z)), run.free, run.free), np.zeros_like(Z)
            if not run.prescribed:
                inverse[own] = np.linalg.inv(Z[own])
            found.append((Z, inverse))
        return found

    def unknown(self, posterior: Posterior) -> FloatArray:
        """Return the error that goes to what nothing is known of, wandering and coherent errors, in each row."""
        loose = [k for k, label in enumerate(self.labels) if label.startswith("x^")]
        found, at = self.base.values[:, loose] @ posterior.mean[loose], 0
        for own in self.rows.own:
            mean = posterior.own_mean[at:at + own.count]
            own.times(np.where([label.startswith("wandering") for label in own.labels], mean, 0.0), found)
            at += own.count
        return found

    @property
    def forced(self) -> bool:
        """Whether a known force that is not zero acts in any record."""
        return any(run.force is not None and np.any(run.force != 0.0) and not run.prescribed for run in self.runs)


def projected(model: Model, run: MeasuredMotion, place: Place, values: FloatArray) -> FloatArray:
    """Return the rows of one place for forces of shape (n, nt)."""
    return np.concatenate([b.project(values[place.dof])[: place.bins] for b in run.basis])


def moved(model: Model, run: MeasuredMotion, place: Place, motion: FloatArray, memory: FloatArray) -> FloatArray:
    """Return the rows of one place for the force that a motion needs: (M + A_inf) x'' + D x' + memory + C x."""
    i, inertia, found = place.dof, model.M + model.A_inf, []
    for b in run.basis:
        rows = (inertia[i] @ b.project(motion, 2) + model.D[i] @ b.project(motion, 1) + model.C[i] @ b.project(motion)
                + b.project(memory[i]))
        found.append(rows[: place.bins])
    return np.concatenate(found)


def equation_error(model: Model, runs: Sequence[MeasuredMotion], tolerance: Mapping[str, float],
                   discrepancy: Discrepancy | None = None) -> EquationError:
    """Return the regression problem of a model and records, without any effect.

    Parameters
    ----------
    model : Model
    runs : sequence of MeasuredMotion
    tolerance : mapping of name to float
        From `effects.nominal.tolerances`.
    discrepancy : Discrepancy, optional
    """
    discrepancy = discrepancy or Discrepancy()
    places = tuple(all_places(runs))
    n = model.n
    count = places[-1].rows.stop
    columns = RowColumns(*np.zeros((4, count)), *np.zeros((2, count), dtype=int))
    error, noise, scale, steady, group, sensor = columns
    speeds = sorted({abs(run.record.speed) for run in runs})
    for place in places:
        run = runs[place.record]
        fill(model, run, place, columns)
        if place.order < 0:  # under way the flow is another one, and so is what a model leaves of it
            group[place.rows] += n * BANDS * speeds.index(abs(run.record.speed))
        else:
            group[place.rows] += n * BANDS * (len(speeds) - 1)
    gap = np.array([relative_gap(places, runs, model, i, error, noise) for i in range(n)])
    spectra = spectral_groups(places, runs, group, n * BANDS * len(speeds) + n)
    by_band = np.tile(np.repeat(gap, BANDS), len(speeds))
    share = np.concatenate([discrepancy.unexplained * by_band, np.full(n, discrepancy.sensors),
                            np.full(spectra, discrepancy.spectrum)])
    ambient = np.concatenate([discrepancy.ambient * by_band, np.full(n, discrepancy.sensors),
                              np.full(spectra, discrepancy.ambient * 0.05)])
    power = np.ones(count)
    for i in range(n):
        rows_of = [np.arange(p.rows.start, p.rows.stop) for p in places if p.dof == i]
        mine = np.concatenate([np.zeros(0, int), *rows_of])
        size = scale[mine] ** 2
        telling = size.sum() ** 2 / max(float(np.sum(size**2)), 1e-300) if mine.size else 0.0
        power[mine] = 1.0 / (1.0 + telling / discrepancy.saturation)
    weight, (fine, kind) = jacobian_weight(places, runs, power, n), bins_of(places, runs, count, n)
    ties = tied(model, runs, places, scale, noise, discrepancy.mixing)
    rows = Rows(error if ties is None else ties @ error, noise, scale, steady, group, sensor, share, ambient, power,
                weight, fine, kind, tuple(p.rows for p in places), spectra)
    empty = EquationError(model, tuple(runs), rows, nothing(count, weight.size), (), places, gap,
                          {dof: scales_of(model, runs, i) for i, dof in enumerate(model.dofs)}, discrepancy, ties)
    base, labels = base_columns(empty, tolerance, discrepancy)
    own = tuple(own_columns(empty, r, tolerance, discrepancy) for r in range(len(runs)))
    return replace(empty, base=base, labels=labels, rows=replace(rows, own=own))


def all_places(runs: Sequence[MeasuredMotion]) -> list[Place]:
    """Return the places of all rows."""
    found, at = [], 0
    for r, run in enumerate(runs):
        wanted = [(int(i), -1) for i in np.flatnonzero(run.free)]
        wanted += [(s.dof, s.order) for s in run.sensors]
        for dof, order in wanted:
            top = run.basis[0].omega <= 1.001 * max(3.5 * run.omega[dof], run.basis[0].omega[0])
            bins = int(top.sum())
            found.append(Place(r, int(dof), order, bins, slice(at, at + bins * len(run.basis))))
            at = found[-1].rows.stop
    return found


class RowColumns(NamedTuple):
    """What is filled in for each row, as in `regression.Rows`; each of shape (N,)."""

    error: FloatArray
    noise: FloatArray
    scale: FloatArray
    steady: FloatArray
    group: np.ndarray
    sensor: np.ndarray


def fill(model: Model, run: MeasuredMotion, place: Place, columns: RowColumns) -> None:
    """Fill the rows of one place."""
    error, noise, scale, steady, group, sensor = columns
    n, i, at = model.n, place.dof, place.rows
    omega = np.concatenate([b.omega[: place.bins] for b in run.basis])
    if place.order >= 0:
        reading = next(s for s in run.sensors if (s.dof, s.order) == (i, place.order))
        error[at] = np.concatenate([(b.project(reading.values) - b.project(run.raw[i], place.order))[: place.bins]
                                    for b in run.basis])
        noise[at] = reading.noise**2 + run.noise[i] ** 2 * omega ** (2 * place.order)
        scale[at] = steady[at] = float(np.std(reading.values))
        group[at], sensor[at] = n * BANDS + i, n + i
        return
    force = run.force if run.force is not None else np.zeros_like(run.raw)
    error[at] = moved(model, run, place, run.raw, run.memory) - projected(model, run, place, force)
    noise[at] = np.tile(force_noise(model, run, place), len(run.basis))
    band = np.clip(np.round(omega / run.omega[i]), 0, BANDS - 1).astype(int)
    spread = run.time.size / np.bincount(band, minlength=BANDS)[band]  # samples for each row of the band
    local, whole = local_size(model, run, i)
    local = local if run.force is not None else np.full(local.size, whole)
    scale[at], steady[at] = np.repeat(local, place.bins) * np.sqrt(spread), whole * np.sqrt(spread)
    group[at], sensor[at] = i * BANDS + band, i


def force_noise(model: Model, run: MeasuredMotion, place: Place) -> FloatArray:
    """Return the variance of one block's rows by the displacement sensors' noise: |Z|^2 under each window."""
    return noise_in_rows(model, run, place.bins)[:, place.dof, place.dof]


def noise_in_rows(model: Model, run: MeasuredMotion, bins: int) -> FloatArray:
    """Return the covariance of the motions' rows in each bin of a block by the sensors' noise, shape (bins, n, n)."""
    block = run.basis[len(run.basis) // 2]
    size = 4 * block.g.shape[1]
    at = 2 * np.pi * np.fft.rfftfreq(size, run.dt)
    power = np.abs(np.fft.rfft(block.g[:bins], size, axis=1)) ** 2
    power /= power.sum(axis=1, keepdims=True)
    # A window's tails are steep enough; beyond the top of the basis the impedance is not the motion's business.
    Z = impedance(model, np.minimum(np.maximum(at, 1e-6), 1.3 * block.omega[-1])) * run.noise
    each = np.real(np.einsum("wiq,wjq->wij", Z, Z.conj()))
    return np.asarray(np.tensordot(power, each, axes=1))


def tied(model: Model, runs: Sequence[MeasuredMotion], places: Sequence[Place], scale: FloatArray, noise: FloatArray,
         share: float) -> csr_array | None:
    """Return the matrix that adds multiples of other motions' rows to each row; put what noise is left in place.

    The noise of one sensor is in the rows of all motions that the model couples, through the same impedance. A set of
    effects that together make another motion's row would explain it; here it is taken out beforehand. In each bin the
    multiples are those of least noise, together with a share of the added motion's own force for its model's error.
    """
    if model.n == 1:
        return None
    row, column, value = [], [], []
    for r, run in enumerate(runs):
        mine = [p for p in places if p.record == r and p.order < 0]
        if run.prescribed or len(mine) < 2:
            continue
        S = noise_in_rows(model, run, max(p.bins for p in mine))
        for p in mine:
            others = [q for q in mine if q.dof != p.dof]
            for k in range(p.bins):
                use = [q for q in others if q.bins > k]
                at = [q.dof for q in use]
                own = np.array([share**2 * np.mean(scale[q.rows].reshape(-1, q.bins)[:, k] ** 2) for q in use])
                t = -np.linalg.solve(S[k][np.ix_(at, at)] + np.diag(own + 1e-300), S[k][at, p.dof])
                lines = p.rows.start + k + p.bins * np.arange(len(run.basis))
                noise[lines] = S[k][p.dof, p.dof] + 2.0 * t @ S[k][at, p.dof] + t @ S[k][np.ix_(at, at)] @ t
                for q, weight in zip(use, t):
                    row.append(lines)
                    column.append(q.rows.start + k + q.bins * np.arange(len(run.basis)))
                    value.append(np.full(lines.size, weight))
    count = scale.size
    added = coo_array((np.concatenate(value), (np.concatenate(row), np.concatenate(column))), shape=(count, count)
                      ) if value else coo_array((count, count))
    return csr_array(added + eye_array(count))


def spectral_groups(places: Sequence[Place], runs: Sequence[MeasuredMotion], group: np.ndarray, first: int) -> int:
    """Give every frequency of a record whose force is unknown a size of its own; return the number of these sizes."""
    count = 0
    for place in places:
        run = runs[place.record]
        if run.force is None and place.order < 0:
            group[place.rows] = first + count + np.tile(np.arange(place.bins), len(run.basis))
            count += place.bins
    return count


def local_size(model: Model, run: MeasuredMotion, i: int) -> tuple[FloatArray, float]:
    """Return the rms of the model's own force in each block and in the whole record."""
    inertia = model.M[i, i] + model.A_inf[i, i]
    stiff = max(abs(model.C[i, i]), inertia * run.omega[i] ** 2)
    drifts = model.C[i, i] == 0.0 and run.record.kind != "static"
    force = inertia * run.a[i] if drifts else stiff * run.x[i]
    local = np.array([np.sqrt(np.mean(force[b.samples] ** 2)) for b in run.basis])
    return local, float(np.sqrt(np.mean(force**2))) + 1e-300


def relative_gap(places: Sequence[Place], runs: Sequence[MeasuredMotion], model: Model, i: int, error: FloatArray,
                 noise: FloatArray) -> float:
    """Return the rms of the error beyond the noise, of the model's own force; at least half a percent."""
    mine = [p for p in places if p.dof == i and p.order < 0 and runs[p.record].force is not None]
    if not mine:
        return 0.05
    excess = sum(float(np.sum(error[p.rows] ** 2 - noise[p.rows])) for p in mine)
    own = sum(local_size(model, runs[p.record], i)[1] ** 2 * runs[p.record].time.size for p in mine)
    return float(np.clip(np.sqrt(max(excess, 0.0) / own), 0.005, 1.0))


def jacobian_weight(places: Sequence[Place], runs: Sequence[MeasuredMotion], power: FloatArray, n: int) -> FloatArray:
    """Return the weight of each record's, bin's and degree of freedom's term of the log determinant."""
    found = []
    for r, run in enumerate(runs):
        weight = np.zeros((run.omega_fine.size, n))
        for place in places:
            if place.record == r and place.order < 0 and not run.prescribed:
                weight[: FINE * place.bins, place.dof] = len(run.basis) * power[place.rows.start] / FINE
        found.append(weight.ravel())
    return np.concatenate(found)


def bins_of(places: Sequence[Place], runs: Sequence[MeasuredMotion], count: int,
            n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms of the Jacobian in each bin, shape (kinds, FINE), and each row's bin, shape (N,)."""
    starts = np.cumsum([0] + [run.omega_fine.size * n for run in runs])
    fine: list[np.ndarray] = []
    kind = np.full(count, -1)
    for place in places:
        run = runs[place.record]
        if place.order >= 0 or run.prescribed:
            continue
        kind[place.rows] = len(fine) + np.tile(np.arange(place.bins), len(run.basis))
        at = starts[place.record] + place.dof + n * np.arange(FINE * place.bins)
        fine += list(at.reshape(place.bins, FINE))
    kind[kind < 0] = len(fine)
    return np.array(fine, dtype=int).reshape(-1, FINE), kind


def nothing(rows: int, terms: int) -> Columns:
    """Return no columns."""
    return Columns(np.zeros((rows, 0)), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool),
                   np.zeros((terms, 0), complex))


def scales_of(model: Model, runs: Sequence[MeasuredMotion], i: int) -> Scales:
    """Return typical sizes of one degree of freedom over the records."""
    mine = [run for run in runs if run.free[i]] or list(runs)
    def rms(name: str) -> float:
        return float(np.sqrt(np.mean([np.mean(getattr(run, name)[i] ** 2) for run in mine]))) + 1e-12
    u = [np.mean(run.force[i] ** 2) for run in mine if run.force is not None and not run.prescribed]
    omega = float(np.mean([run.omega[i] for run in mine]))
    inertia = model.M[i, i] + model.A_inf[i, i]
    drifts = model.C[i, i] == 0.0 and any(run.record.kind != "static" for run in mine)
    force = inertia * rms("a") if drifts else max(abs(model.C[i, i]), inertia * omega**2) * rms("x")
    duration = float(np.mean([run.time[-1] - run.time[0] for run in mine]))
    speed = float(np.sqrt(np.mean([run.record.speed**2 for run in mine])))
    return Scales(rms("x"), rms("v"), rms("a"), float(np.sqrt(np.mean(u))) if u else 0.0, force, omega, duration,
                  natural_frequency(model, i), speed=speed, restored=bool(model.C[i, i] != 0.0))


def columns_of(problem: EquationError, found: Sequence[Feature], spread: float, positive: bool = False,
               learned: bool = False, linear: bool = False) -> Columns:
    """Return one column from its features in each record; `linear`: of what is linear in the motion, or an offset."""
    values = np.zeros((problem.rows.error.size, 1))
    relative = []
    for r, (run, feature) in enumerate(zip(problem.runs, found)):
        reading = np.any(feature.reading)
        memory = problem.model.fit.c @ radiation_states(problem.model, feature.reading, run.dt) if reading else None
        for place in problem.places:
            if place.record != r or not (reading or feature.force[place.dof].any()):
                continue
            if place.order >= 0:
                if reading:
                    values[place.rows, 0] = -np.concatenate(
                        [b.project(feature.reading[place.dof], place.order)[: place.bins] for b in run.basis])
                continue
            values[place.rows, 0] = projected(problem.model, run, place, feature.force)
            if memory is not None:
                values[place.rows, 0] += moved(problem.model, run, place, feature.reading, memory)
        relative.append(relative_change(feature, *problem.impedances[r]).ravel() * (run.force is not None))
        if run.force is None:
            told_by_motion_alone(problem, r, values, linear)
    return Columns(problem.mixed(values), np.array([spread]), np.array([positive]), np.array([learned]),
                   np.concatenate(relative)[:, None])


def told_by_motion_alone(problem: EquationError, record: int, values: FloatArray, linear: bool) -> None:
    """Take from the rows of a record what its unknown force takes: offsets and what is linear in the motion."""
    for place in problem.places:
        if place.record == record and place.order < 0:
            values[place.rows] = 0.0 if linear else beyond_linear(problem.runs[record], place, values[place.rows])


def beyond_linear(run: MeasuredMotion, place: Place, values: FloatArray) -> FloatArray:
    """Return rows (m, K) without what goes with displacements, velocities and accelerations."""
    motion = [np.concatenate([b.project(run.x[j], order)[: place.bins] for b in run.basis])
              for j in np.flatnonzero(run.free) for order in range(3)]
    basis = np.linalg.qr(np.stack(motion, axis=1))[0]
    return np.asarray(values - basis @ (basis.T @ values))


def relative_change(feature: Feature, Z: ComplexArray, inverse: ComplexArray) -> ComplexArray:
    """Return the diagonal of Z^-1 J, shape (nw, n), of a record's own motions."""
    J = feature.response
    if np.any(feature.reading_response):
        J = J + Z @ feature.reading_response
    return np.asarray(np.einsum("wij,wji->wi", inverse, J)) if np.any(J) else np.zeros(Z.shape[:2], dtype=complex)


def base_columns(problem: EquationError, tolerance: Mapping[str, float],
                 discrepancy: Discrepancy) -> tuple[Columns, tuple[str, ...]]:
    """Return what every candidate has in all records: nominal numbers, coherent errors."""
    model, labels, parts = problem.model, [], []
    for own in nominal_effects(model, tolerance, force=problem.forced):
        found = features(model, own.active, problem.runs)[0]
        parts.append(columns_of(problem, found, own.spread, learned=True, linear=True))
        labels.append(f"{own.active.name}|{own.active.dof}|{own.active.other}")
    coherent, names = coherent_columns(problem, discrepancy)
    return joined([*parts, *coherent]), (*labels, *names)


def own_columns(problem: EquationError, r: int, tolerance: Mapping[str, float], discrepancy: Discrepancy) -> Own:
    """Return what one record has for itself: offsets, wandering, errors of its force, what was before it."""
    model, run, name = problem.model, problem.runs[r], problem.runs[r].record.name
    forces, labels, spreads, learned = [], [], [], []
    for i in np.flatnonzero(run.free):
        size = problem.scales[model.dofs[i]].force
        found = [(*part, False) for part in record_columns(problem, run, int(i), size, discrepancy)]
        found += [(label, values, discrepancy.by_record * tolerance["force"], True)
                  for label, values in force_errors(model, run, int(i))]
        for label, values, spread, known in found:
            forces.append({int(i): values})
            labels.append(f"{label}|{model.dofs[i]}|{name}")
            spreads.append(spread)
            learned.append(known)
    forces += [dict(enumerate(values)) for values in run.transients]
    labels += [f"transient {k}||{name}" for k in range(len(run.transients))]
    labels += [f"integration {k}||{name}" for k in range(len(run.lost))]
    more = len(run.transients) + len(run.lost)
    mine = [p for p in problem.places if p.record == r]
    first, last = mine[0].rows.start, mine[-1].rows.stop
    columns = np.zeros((last - first, len(labels)))
    for place in mine:
        rows = columns[place.rows.start - first:place.rows.stop - first]
        here = [k for k, series in enumerate(forces) if place.order < 0 and place.dof in series]
        if here:
            stacked = np.stack([forces[k][place.dof] for k in here])
            rows[:, here] = np.concatenate([b.project(stacked)[:, : place.bins].T for b in run.basis])
        for k, series in enumerate(run.lost):
            rows[:, len(forces) + k] = read_wrongly(model, run, place, series)
    if problem.ties is not None:
        columns = problem.ties[first:last, first:last] @ columns
    parts = []
    for place in mine:
        rows = columns[place.rows.start - first:place.rows.stop - first]
        at = np.flatnonzero(np.any(rows, axis=0))
        parts.append((place.rows, at, np.ascontiguousarray(rows[:, at])))
    return Own(tuple(parts), np.array([*spreads, *[1.0] * more]), np.array([*learned, *[False] * more], dtype=bool),
               tuple(labels))


def read_wrongly(model: Model, run: MeasuredMotion, place: Place, series: FloatArray) -> FloatArray:
    """Return the rows of one place for an error of the readings, shape (n, nt)."""
    if place.order < 0:
        return moved(model, run, place, series, model.fit.c @ radiation_states(model, series, run.dt))
    return -np.concatenate([b.project(series[place.dof], place.order)[: place.bins] for b in run.basis])


def record_columns(problem: EquationError, run: MeasuredMotion, i: int, size: float,
                   discrepancy: Discrepancy) -> list[tuple[str, FloatArray, float]]:
    """Return offset and wandering stiffness and damping of one motion in one record."""
    found = [("offset", np.ones(run.time.size), discrepancy.offset * size)]
    duration = run.time[-1] - run.time[0]
    count = int(np.clip(duration * run.omega[i] / (2 * np.pi) / 4.0, 1, 8))
    part = discrepancy.wandering * problem.gap[i] / np.sqrt(count)
    share = (run.time - run.time[0]) / duration
    stiff = max(abs(problem.model.C[i, i]), (problem.model.M + problem.model.A_inf)[i, i] * run.omega[i] ** 2)
    for k in range(1, count + 1):
        shape = np.sqrt(2.0) * np.cos(np.pi * k * share)
        found.append((f"wandering stiffness {k}", shape * run.x[i], part * stiff))
        if run.record.kind != "static":
            found.append((f"wandering damping {k}", shape * run.v[i], part * stiff / run.omega[i]))
    return found


def force_errors(model: Model, run: MeasuredMotion, i: int) -> list[tuple[str, FloatArray]]:
    """Return what errors of size and phase of a record's own force would add to it."""
    if run.force is None or run.prescribed or not np.any(run.force[i]):
        return []
    late = -np.gradient(run.force[i], run.dt) / natural_frequency(model, i)
    return [("force of the record", run.force[i]), ("phase of the record", late)]


def coherent_columns(problem: EquationError, discrepancy: Discrepancy) -> tuple[list[Columns], list[str]]:
    """Return cubic polynomials of displacement and velocity, the same in all records."""
    parts, labels = [], []
    powers = [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]
    for i, dof in enumerate(problem.model.dofs):
        scales = problem.scales[dof]
        for p, q in powers:
            # In a static test the velocity is a direction only.
            series = [(run.x[i] / scales.x) ** p * (run.v[i] / scales.v) ** q * run.free[i]
                      * (q == 0 or run.record.kind != "static") for run in problem.runs]
            rms = np.sqrt(np.mean(np.concatenate(series) ** 2))
            if rms > 0.0:
                spread = discrepancy.coherent * problem.gap[i] * scales.force / rms
                parts.append(across(problem, i, series, spread))
                labels.append(f"x^{p} v^{q}|{dof}|")
    return parts, labels


def across(problem: EquationError, i: int, series: Sequence[FloatArray], spread: float) -> Columns:
    """Return one column of forces on one degree of freedom in all records."""
    values = np.zeros(problem.rows.error.size)
    for place in problem.places:
        if place.dof == i and place.order < 0:
            run = problem.runs[place.record]
            values[place.rows] = np.concatenate([b.project(series[place.record])[: place.bins] for b in run.basis])
    return plain(problem, values, spread)


def plain(problem: EquationError, values: FloatArray, spread: float) -> Columns:
    """Return one column that leaves the Jacobian alone."""
    return Columns(values[:, None], np.array([spread]), np.array([False]), np.array([False]),
                   np.zeros((problem.rows.weight.size, 1), dtype=complex))
