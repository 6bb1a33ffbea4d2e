"""Rows of the equation error in each bin of a motion, with their noise; what motions share of it is taken out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array

from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.inference.force_errors import spectra, typical_frequency
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion import FINE, MeasuredMotion

BANDS = 4  # unexplained force: below, around, at twice and at three times the typical frequency


@dataclass(frozen=True, eq=False)
class Place:
    """Where the rows of one degree of freedom of one record lie, and what projects signals onto them."""

    record: int
    dof: int
    order: int  # -1 for the equation of motion, else the order of a second sensor
    bins: int  # How many of each block's test functions are used
    rows: slice


def projected(model: Model, run: MeasuredMotion, place: Place, values: FloatArray) -> FloatArray:
    """Return the rows of one place for forces of shape (n, nt)."""
    return projected_on(run.basis, values[place.dof], bins=place.bins).ravel()


def moved(model: Model, run: MeasuredMotion, place: Place, motion: FloatArray, memory: FloatArray) -> FloatArray:
    """Return the rows of one place for the force that a motion needs: (M + A_inf) x'' + D x' + memory + C x."""
    i, inertia = place.dof, model.M + model.A_inf
    parts = [(0, model.C[i] @ motion + memory[i]), (1, model.D[i] @ motion), (2, inertia[i] @ motion)]
    return np.sum([projected_on(run.basis, values, order, place.bins) for order, values in parts], axis=0).ravel()


def all_places(runs: Sequence[MeasuredMotion]) -> list[Place]:
    """Return the places of all rows."""
    found, at = [], 0
    for r, run in enumerate(runs):
        wanted = [(int(i), -1) for i in np.flatnonzero(run.free)]
        wanted += [(s.dof, s.order) for s in run.sensors]
        for dof, order in wanted:
            top = run.basis[0].omega <= 1.001 * max(run.reach[dof], run.basis[0].omega[0])
            bins = int(top.sum())
            found.append(Place(r, int(dof), order, bins, slice(at, at + bins * len(run.basis))))
            at = found[-1].rows.stop
    return found


def rows_of(model: Model, run: MeasuredMotion, place: Place) -> tuple[np.ndarray, ...]:
    """Return error, noise, scale, steady, group and sensor of the rows of one place, as in `linear_model.Rows`."""
    n, i = model.n, place.dof
    omega = np.concatenate([b.omega[: place.bins] for b in run.basis])
    if place.order >= 0:
        reading = next(s for s in run.sensors if (s.dof, s.order) == (i, place.order))
        error = (projected_on(run.basis, reading.values, 0, place.bins)
                 - projected_on(run.basis, run.raw[i], place.order, place.bins)).ravel()
        size = np.full(omega.size, float(np.std(reading.values)))
        own = np.tile(run.noise[i, : place.bins], len(run.basis))
        its = np.tile(reading.noise[: place.bins], len(run.basis))
        return (error, its**2 + own**2 * omega ** (2 * place.order), size, size,
                np.full(omega.size, n * BANDS + i), np.full(omega.size, n + i))
    force = run.force if run.force is not None else np.zeros_like(run.raw)
    error = moved(model, run, place, run.raw, run.memory) - projected(model, run, place, force)
    band = np.clip(np.round(omega / typical_frequency(model, run, i)), 0, BANDS - 1).astype(int)
    spread = run.places / np.bincount(band, minlength=BANDS)[band]  # samples for each row of the band
    local, whole = local_size(model, run, i)
    local = local if run.force is not None else np.full(local.size, whole)
    return (error, np.tile(force_noise(model, run, place), len(run.basis)),
            np.repeat(local, place.bins) * np.sqrt(spread), whole * np.sqrt(spread), i * BANDS + band,
            np.full(omega.size, i))


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
    noise = np.stack([np.interp(at, block.omega, row) for row in run.noise], axis=1)
    Z = impedance(model, np.minimum(np.maximum(at, 1e-6), 1.3 * block.omega[-1])) * noise[:, None]
    each = np.real(np.einsum("wiq,wjq->wij", Z, Z.conj()))
    return np.asarray(np.tensordot(power, each, axes=1))


def tied(model: Model, runs: Sequence[MeasuredMotion], places: Sequence[Place], scale: FloatArray, noise: FloatArray,
         share: float, rounding: float = 1e-9) -> csr_array | None:
    """Return the matrix that adds multiples of other motions' rows to each row; put what noise is left in place.

    The noise of one sensor is in the rows of all motions that the model couples, through the same impedance. A set of
    effects that together make another motion's row would explain it; here it is taken out beforehand. In each row the
    multiples are those of least noise, together with a share of the added motion's own force at that time, and of the
    others' by a coupling inertia, for its model's error.
    """
    if model.n == 1:
        return None
    row, column, value = [], [], []
    inertia = np.diag(model.M + model.A_inf)
    for r, run in enumerate(runs):
        mine = [p for p in places if p.record == r and p.order < 0]
        if run.prescribed or len(mine) < 2:
            continue
        S = noise_in_rows(model, run, max(p.bins for p in mine))
        for p in mine:
            others = [q for q in mine if q.dof != p.dof]
            for k in range(min(p.bins, max(q.bins for q in others))):
                use = [q for q in others if q.bins > k]
                at = [q.dof for q in use]
                both, side = S[k][np.ix_(at, at)], S[k][at, p.dof]
                forces = sum(scale[o.rows][min(k, o.bins - 1)::o.bins] ** 2 / inertia[o.dof] for o in mine)
                own = share**2 * np.outer(forces, inertia[at])[:, None] + 1e-300
                t = -np.linalg.solve(both + np.eye(len(at)) * own, side[:, None])[..., 0]
                # What takes out no more than rounding would carry all of another motion's unknowns along.
                t[np.abs(t) * np.sqrt(np.diag(both)) < rounding * np.sqrt(S[k][p.dof, p.dof])] = 0.0
                lines = p.rows.start + k + p.bins * np.arange(len(run.basis))
                noise[lines] = S[k][p.dof, p.dof] + 2.0 * t @ side + np.sum(t @ both * t, axis=1)
                for q, weights in zip(use, t.T):
                    row.append(lines)
                    column.append(q.rows.start + k + q.bins * np.arange(len(run.basis)))
                    value.append(weights)
    count = scale.size
    added = coo_array((np.concatenate(value), (np.concatenate(row), np.concatenate(column))), shape=(count, count)
                      ) if value else coo_array((count, count))
    found = csr_array(added + eye_array(count))
    found.eliminate_zeros()
    return found


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
    """Return the rms of the model's own force in each block and in the whole record, about the mean of the motion.

    A held motion needs none: it has the size of the force that is measured there.
    """
    inertia = model.M[i, i] + model.A_inf[i, i]
    stiff = max(abs(model.C[i, i]), inertia * run.omega[i] ** 2)
    drifts = model.C[i, i] == 0.0 and run.record.kind != "static"
    force = inertia * run.a[i] if drifts else stiff * about_mean(run, i)
    if run.record.kind == "prescribed" and run.force is not None and not np.any(run.x[i]):
        force = run.force[i] - run.force[i].mean()
    local = np.array([np.sqrt(np.mean(force[b.samples] ** 2)) for b in run.basis])
    return local, float(np.sqrt(np.mean(force**2))) + 1e-300


def about_mean(run: MeasuredMotion, i: int) -> FloatArray:
    """Return a displacement without its mean, which a zero or a steady force makes; of a static test with it."""
    return np.asarray(run.x[i] if run.record.kind == "static" else run.x[i] - run.x[i].mean())


def relative_gap(places: Sequence[Place], runs: Sequence[MeasuredMotion], model: Model, i: int, error: FloatArray,
                 noise: FloatArray) -> float:
    """Return the rms of the error beyond noise and steady forces, of the model's own force; half a percent at least."""
    mine = [p for p in places if p.dof == i and p.order < 0 and runs[p.record].force is not None]
    if not mine:
        return 0.05
    excess = 0.0
    for p in mine:
        run = runs[p.record]
        steady = projected_on(run.basis, np.ones(run.time.size), 0, p.bins).ravel()
        known = (steady @ error[p.rows]) ** 2 / (steady @ steady) if run.record.kind != "static" else 0.0
        excess += float(np.sum(error[p.rows] ** 2 - noise[p.rows]) - known)
    samples = sum(runs[p.record].places for p in mine)
    return float(np.clip(np.sqrt(max(excess, 0.0) / samples) / own_size([runs[p.record] for p in mine], model, i),
                         0.005, 1.0))


def own_size(runs: Sequence[MeasuredMotion], model: Model, i: int) -> float:
    """Return the rms of the model's own force on one motion over records, what a relative gap is a share of."""
    squares = [local_size(model, run, i)[1] ** 2 for run in runs]
    return float(np.sqrt(np.average(squares, weights=[run.places for run in runs])))


def powers(places: Sequence[Place], runs: Sequence[MeasuredMotion], scale: FloatArray, saturation: float) -> FloatArray:
    """Return the power of each row's likelihood, 1/(1 + N/saturation): N rows of one motion share a model's errors.

    Rows count by the energy of the motion around them, those of another record as far as the motion has the same
    frequencies there.
    """
    power = np.ones(scale.size)
    for i in {p.dof for p in places}:
        mine = [p for p in places if p.dof == i and p.order < 0]
        alike = overlaps([runs[p.record] for p in mine], i)
        square = [scale[p.rows] ** 2 for p in mine]
        energy, crowding = (alike @ [np.sum(e**k) for e in square] for k in (1, 2))
        found = dict(zip((p.record for p in mine), 1.0 / (1.0 + energy**2 / np.maximum(crowding, 1e-300) / saturation)))
        for p in places:
            if p.dof == i:
                power[p.rows] = found.get(p.record, 1.0)
    return power


def rather_noise(model: Model, runs: Sequence[MeasuredMotion], places: Sequence[Place], error: FloatArray,
                 noise: FloatArray, clear: float = 10.0) -> np.ndarray:
    """Return the rows (N,) of motions set by a machine in which their sensors' noise is no small part.

    Neither the force that the measured motion needs nor the measured one is `clear` times the noise's deviation there.
    Such rows would be fitted the better the less force a model makes of any motion, since its noise is less then, too.
    They tell how large noise is, and no strength; where they are clear a strength is biased by a hundredth at most.
    """
    found = np.zeros(error.size, dtype=bool)
    for place in places:
        run, rows = runs[place.record], place.rows
        if run.record.kind == "prescribed" and place.order < 0:
            needed = moved(model, run, place, run.raw, run.memory)
            found[rows] = np.maximum(np.abs(needed), np.abs(needed - error[rows])) < clear * np.sqrt(noise[rows])
    return found


def overlaps(runs: Sequence[MeasuredMotion], i: int, octaves: float = 0.6) -> FloatArray:
    """Return how far the motion has the same frequencies in any two records, 0 to 1: Bhattacharyya's coefficients.

    Energies are taken between centres so far apart, as far as errors of a model reach. A slow test is like others.
    """
    shares = []
    for run in runs:
        omega, x = spectra(run, run.x[i])
        at = np.round(np.log2(omega[1:] / runs[0].omega[i]) / octaves, 9)
        centres = np.arange(-40.0, 41.0)
        energy = np.clip(1.0 - np.abs(at - centres[:, None]), 0.0, 1.0) @ np.abs(x[1:]) ** 2
        still = run.record.kind == "static" or not energy.any()
        shares.append(np.append(energy / (energy.sum() + 1e-300), 0.0) if not still else np.eye(82)[-1])
    root = np.sqrt(shares)
    return np.asarray(root @ root.T)


def jacobian_weight(places: Sequence[Place], runs: Sequence[MeasuredMotion], power: FloatArray, n: int) -> FloatArray:
    """Return the weight of each record's, bin's and degree of freedom's term of the log determinant."""
    found = []
    for r, run in enumerate(runs):
        weight = np.zeros((run.omega_fine.size, n))
        for place in places:
            if place.record == r and place.order < 0:
                weight[: jacobian_terms(place, run), place.dof] = power[place.rows].sum() / jacobian_terms(place, run)
        found.append(weight.ravel())
    return np.concatenate(found)


def jacobian_terms(place: Place, run: MeasuredMotion) -> int:
    """Return how many terms of the log determinant one motion of a record has: some in each bin, or in all rows."""
    return FINE * (1 if run.prescribed else place.bins)


def bins_of(places: Sequence[Place], runs: Sequence[MeasuredMotion], count: int,
            n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms of the Jacobian in each bin, shape (kinds, FINE), and each row's bin, shape (N,)."""
    starts = np.cumsum([0] + [run.omega_fine.size * n for run in runs])
    fine: list[np.ndarray] = []
    kind = np.full(count, -1)
    for place in places:
        run = runs[place.record]
        if place.order >= 0:
            continue
        bins = np.zeros(place.bins, dtype=int) if run.prescribed else np.arange(place.bins)
        kind[place.rows] = len(fine) + np.tile(bins, len(run.basis))
        at = starts[place.record] + place.dof + n * np.arange(jacobian_terms(place, run))
        fine += list(at.reshape(-1, FINE))
    kind[kind < 0] = len(fine)
    return np.array(fine, dtype=int).reshape(-1, FINE), kind
