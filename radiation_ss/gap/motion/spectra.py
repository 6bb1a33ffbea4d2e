"""Motion without any known force: what an unknown Gaussian force cannot absorb.

Everything linear is absorbed by the force's unknown spectrum. A nonlinear effect is not: along the measured motion it
makes harmonics and sums that a linear response to a Gaussian force does not have. With phi(x, v) the effect's force
and H the model's receptance, y = x + theta H (phi - its best linear fit) is the motion without the effect; the map
from x to y is causal with unit slope, so the likelihood is that of y under a spectrum of its own, profiled bin by bin
(Whittle, with Slepian tapers). Two sensors on one motion show a fault of one of them by their ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Effect, Scales
from radiation_ss.errors import InputError
from radiation_ss.gap.posterior.linear import frequencies, receptance
from radiation_ss.gap.posterior.setting import Term, scales_of, shapes_of
from radiation_ss.gap.where.residual_force import smooth
from radiation_ss.gap.where.tapers import HALF_BANDWIDTH, TAPERS, quiet, tapered
from radiation_ss.gap.which.scan import forces, unit_force
from radiation_ss.records.record import Record
from radiation_ss.simulation.prepare import prepare, step_size

REPEATS = 4  # times that the equivalent linear model is renewed


@dataclass(frozen=True, eq=False)
class Even:
    """A motion-only record on an even grid.

    Parameters
    ----------
    record : Record
    h : float
        Sample step [s].
    x, v : ndarray, shape (nt, n)
        Displacement and velocity, low-passed to `top`.
    raw : ndarray, shape (nt, n)
        Displacement as measured, mean removed.
    top : float
        Highest circular frequency in use [rad/s].
    """

    record: Record
    h: float
    x: FloatArray
    v: FloatArray
    raw: FloatArray
    top: float


def even_records(model: Model, records: Sequence[Record]) -> tuple[dict[str, Scales], float, list[Even]]:
    """Return typical sizes by degree of freedom, the highest typical frequency [rad/s], and the records on even grids.

    Raises
    ------
    InputError
        If no record measures the displacement of every degree of freedom.
    """
    h = step_size(model, list(records))
    prepared = [prepare(model, record, h) for record in records]
    scales = {dof: scales_of(model, prepared, i) for i, dof in enumerate(model.dofs)}
    omega = max(s.omega for s in scales.values())
    evens = [even for record in records if (even := even_record(model, record, omega)) is not None]
    if not evens:
        raise InputError("records: motion only, and none measures the displacement of every degree of freedom "
                         f"({', '.join(model.dofs)}) with 64 samples or more")
    return scales, omega, evens


def even_record(model: Model, record: Record, omega: float) -> Even | None:
    """Put displacement on an even grid and differentiate it by Fourier series; None without displacement."""
    values = record.get("displacement", model.dofs)
    if values is None or not all(np.isfinite(row).sum() > 64 for row in values):
        return None
    h = float(np.median(np.diff(record.time)))
    time = np.arange(record.time[0], record.time[-1], h)
    raw = np.stack([CubicSpline(record.time[np.isfinite(row)], row[np.isfinite(row)])(time) for row in values], axis=1)
    raw = raw - raw.mean(axis=0)
    top = min(6.0 * omega, 0.8 * np.pi / h)
    x, v, _ = smooth(raw, h, top)
    return Even(record, h, x, v, raw, top)


@dataclass(frozen=True, eq=False)
class Spectra:
    """Tapered transforms of one record: motion and an effect's response, shape (tapers, nw, n) and (.., strengths)."""

    omega: FloatArray
    motion: ComplexArray
    response: ComplexArray


def responses(model: Model, even: Even, term: Term, theta: FloatArray) -> FloatArray:
    """Return H (phi - linear fit) for each strength at one prior deviation, on every dof, shape (nt, n, strengths).

    H is the receptance of the equivalent linear model: at the strengths `theta` the linear part of the effect's force
    belongs to stiffness and damping.
    """
    dof = model.dofs.index(term.active.dof)
    count = even.x.shape[0]
    linear = np.stack([even.x[:, dof], even.v[:, dof], np.ones(count)], axis=1)
    motion = {"time": even.h * np.arange(count), "h": even.h, "x": even.x, "v": even.v}
    rests, stiffness, damping = [], model.C.copy(), model.D.copy()
    for force, strength in zip(forces([term], unit_force(term.active.effect), motion, dof), theta):
        part = np.linalg.lstsq(linear, force, rcond=None)[0]
        rests.append(force - linear @ part)
        stiffness[dof, dof] -= strength * part[0]
        damping[dof, dof] -= strength * part[1]
    padded = 2 * count
    H = receptance(model.replace(C=stiffness, D=damping), frequencies(padded, even.h))[:, :, dof]
    return np.stack([np.fft.irfft(H * np.fft.rfft(rest, padded)[:, None], padded, axis=0)[:count] for rest in rests],
                    axis=2)


def spectra_of(model: Model, even: Even, term: Term | None, theta: FloatArray | None = None) -> Spectra:
    """Return the transforms of the motion minus the effect's response (y = x - H phi theta) in the bands in use."""
    count = even.raw.shape[0]
    omega: FloatArray = np.asarray(2.0 * np.pi * np.fft.rfftfreq(count, even.h))
    motion = tapered(even.raw)
    keep = (omega > 2.0 * np.pi * HALF_BANDWIDTH / (count * even.h)) & (omega < even.top) & quiet(motion, omega)
    shape = (count, -1)
    response = np.zeros((count, even.raw.shape[1], 0))
    if term is not None:
        response = responses(model, even, term, np.zeros(len(term.strengths)) if theta is None else theta)
    tapers = tapered(response.reshape(shape)) if response.shape[2] else np.zeros((TAPERS, omega.size, 0), complex)
    return Spectra(omega[keep], motion[:, keep],
                   tapers[:, keep].reshape(TAPERS, int(keep.sum()), even.raw.shape[1], -1))


@dataclass(frozen=True, eq=False)
class BlindFit:
    """An effect fitted to motion only.

    Parameters
    ----------
    term : Term or None
    values : ndarray
        Strengths in prior deviations.
    deviation : ndarray
    evidence : float
        Log evidence against no effect.
    reach : float
        Standard deviations by which an effect of the prior's typical size would show.
    """

    term: Term | None
    values: FloatArray
    deviation: FloatArray
    evidence: float
    reach: float


def band_powers(spectra: Spectra, theta: FloatArray) -> tuple[list[FloatArray], ComplexArray]:
    """Return for each dof the power in each bin, mean over the tapers, and the residual."""
    y = spectra.motion - spectra.response @ theta
    return [np.mean(np.abs(y[:, :, i]) ** 2, axis=0) for i in range(y.shape[2])], y


def whittle(records: Sequence[Spectra], theta: FloatArray) -> float:
    """Return the profiled negative log likelihood: sum of log powers.

    Neighbouring bins of a multitaper estimate are alike: together the tapers carry as many independent ordinates as
    there are Fourier bins.
    """
    return float(sum(np.sum(np.log(power)) for one in records for power in band_powers(one, theta)[0]))


def fit_blind(records: Sequence[Spectra], term: Term) -> BlindFit:
    """Fit the strengths by reweighted least squares and weigh them against no effect."""
    size = len(term.strengths)
    theta: FloatArray = np.zeros(size)
    matrix, right = np.eye(size), np.zeros(size)
    for _ in range(40):
        matrix, right = np.eye(size), np.zeros(size)
        for one in records:
            powers, _ = band_powers(one, theta)
            for i, power in enumerate(powers):
                r = one.response[:, :, i] / np.sqrt(power)[None, :, None]
                m = one.motion[:, :, i] / np.sqrt(power)[None, :]
                matrix += 2.0 / TAPERS * np.einsum("kwa,kwb->ab", r.conj(), r).real
                right += 2.0 / TAPERS * np.einsum("kwa,kw->a", r.conj(), m).real
        new = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        signs = np.array([term.signs[j] for j in term.strengths])
        new = np.asarray(np.where((signs > 0) & (new < 0.0), 0.0, new), dtype=np.float64)
        done = np.abs(new - theta).max() < 1e-6
        theta = 0.5 * theta + 0.5 * new if not done else new
        if done:
            break
    start = np.zeros(size)
    gain = whittle(records, start) - whittle(records, theta)
    limited = sum(1 for j in term.strengths if term.signs[j] > 0)
    evidence = (gain - 0.5 * float(theta @ theta) - 0.5 * float(np.linalg.slogdet(matrix)[1])
                + limited * np.log(2.0) - np.log(term.alternatives))
    bare = information(records, start)
    return BlindFit(term, theta, np.sqrt(np.diag(np.linalg.inv(matrix))), float(evidence),
                    float(np.sqrt(np.linalg.eigvalsh(bare)[-1])))


def information(records: Sequence[Spectra], theta: FloatArray) -> FloatArray:
    """Return the Fisher information of the strengths at theta, in prior units."""
    matrix = np.zeros((theta.size, theta.size))
    for one in records:
        for i, power in enumerate(band_powers(one, theta)[0]):
            r = one.response[:, :, i] / np.sqrt(power)[None, :, None]
            matrix += 2.0 / TAPERS * np.einsum("kwa,kwb->ab", r.conj(), r).real
    return matrix


def fit_library(model: Model, evens: Sequence[Even], effects: Sequence[Effect],
                scales: dict[str, Scales]) -> list[BlindFit]:
    """Fit every effect that motion alone can show, from every start of its shape; the best of each, best first."""
    best: dict[tuple[str, str, str], BlindFit] = {}
    for effect in effects:
        if not visible(effect):
            continue
        for dof in model.dofs:
            for term in shapes_of(effect, dof, "", scales[dof]):
                found = fit_blind([spectra_of(model, even, term) for even in evens], term)
                for _ in range(REPEATS if found.evidence > 0.0 else 0):
                    found = fit_blind([spectra_of(model, even, term, found.values) for even in evens], term)
                if term.key not in best or found.evidence > best[term.key].evidence:
                    best[term.key] = found
    return sorted(best.values(), key=lambda f: -f.evidence)


def visible(effect: Effect) -> bool:
    """Whether motion alone can show an effect: a nonlinear force of the motion itself."""
    return (effect.force is not None and effect.states == 0 and effect.scope == "dof" and not effect.linear
            and not effect.needs and not effect.per_record and effect.family in ("damping", "stiffness"))
