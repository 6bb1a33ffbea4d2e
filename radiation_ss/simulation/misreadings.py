"""Whether a record fits the model far better with two columns exchanged, a sign turned, or a force in another unit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import motion_unit
from radiation_ss.records.column_checks import column_doubts
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, middle, spectrum_of
from radiation_ss.simulation.force_checks import displacements, forces
from radiation_ss.simulation.pushes import let_go
from radiation_ss.simulation.size_checks import APART, in_unit, sizes
from radiation_ss.units import FORCE


@dataclass(frozen=True)
class ReadingRules:
    """What a body may be off by under every reading, and how much better one must fit than the record as given."""

    own: float = 0.4  # Share of a motion's own stiffness and inertia
    coupled: float = 0.5  # Share of each coupling
    damped: float = 0.3  # Of critical, beside the model's own damping
    least: float = 0.1  # Share (rms) of the forces that the record as given may leave without a question
    weak: float = 1e-3  # Share of the liveliest force's energy, its square over the inertia, that counts
    fits: float = 0.5  # Largest share (rms) of the forces that a reading may leave
    times: float = APART  # As much more the record as given leaves
    lines: float = 3.0  # A motion in fewer frequencies fits bodies that are other ones


class Reading(NamedTuple):
    """What a record may mean, and the matrices that motions and forces are then multiplied by."""

    kind: str  # What the columns are wrong in: "order", "sign" or "unit"
    columns: tuple[str, ...]
    words: str
    motion: FloatArray
    force: FloatArray


class Spectra(NamedTuple):
    """Motions and forces of some records at their frequencies, ascending."""

    w: FloatArray
    x: ComplexArray
    F: ComplexArray
    waves: bool  # Whether X makes the forces of an elevation


def misread(model: Model, records: Sequence[Record], rules: ReadingRules = ReadingRules()) -> tuple[str, str] | None:
    """Return kind and sentence if another reading of the columns leaves far less of the forces than that as given.

    What is left is F - Z x, of each force (in a decay: of the body's inertia force) its own share, by the body that
    fits best under that reading: an effect that the model lacks is in all of them. Records of one kind and of the same
    columns are read alike: several regular tests tell what each of them does not.
    """
    given = _spectra(model, records)
    if given is None:
        return None
    w, x, F, waves = given
    free = not F.any()
    of = _measure(model, w, x, F)
    energy = np.linalg.norm(of, axis=1) ** 2 / np.diag(model.M + model.A_inf)
    acts = energy > rules.weak * max(energy)
    power = [np.abs(f[band_of(w, f)]) ** 2 for f in of[acts]]
    if not power or (not free and min(p.sum() ** 2 / max(np.sum(p**2), 1e-300) for p in power) < rules.lines):
        return None
    as_given = _left(model, given, acts, rules)
    if as_given < rules.least:
        return None
    known = [i for i in range(model.n) if F[i].any()]
    found = [(_left(model, given._replace(x=reading.motion @ x, F=reading.force @ F),
                    (reading.motion if free else reading.force) @ acts != 0.0, rules), reading)
             for reading in _readings(model, records[0], known, waves)]
    if waves:
        found += [(_left(model, spectra, acts, rules), reading)
                  for spectra, reading in _with_elevation(model, records)]
    best = min(left for left, _ in found)
    if best > rules.fits or as_given < rules.times * best:
        return None
    alike = [reading for left, reading in found if left < 1.1 * best]
    columns = dict.fromkeys(column for reading in alike for column in reading.columns)
    return alike[0].kind, (
        f"column {' or '.join(columns)}, all {sum(record.time.size for record in records)} rows: with "
        f"{' or '.join(r.words for r in alike)} the model leaves {as_given / best:.3g} times less unexplained; check "
        f"the {alike[0].kind} of the columns")


def other_readings(model: Model, records: Sequence[Record], of_units: bool = False) -> tuple[str, ...]:
    """Return a sentence for what the columns of records may be instead: another reading fits the model far better, or
    two sensors of one motion contradict each other. Of records of one kind and of the same columns, each or all.
    `of_units`: only where a known unit of a force or a motion is it.
    """
    said, alike = list[str](), dict[tuple[str, frozenset[str]], list[Record]]()
    for record in records:
        alike.setdefault((record.kind, frozenset(record.channels)), []).append(record)
    for (kind, _), group in alike.items():
        if kind == "static":
            said += [f"record {record.name}, {text}" for record in group for text in _by_unit(model, record)]
            continue
        found = [(record, misread(model, [record])) for record in group]
        if len(group) > 1 and not any(text for _, text in found) and (all_of := misread(model, group)):
            found, name = [], f"records {', '.join(record.name for record in group)}"
            said += [f"{name}, {all_of[1]}"] if all_of[0] == "unit" or not of_units else []
        for record, other in found:
            texts = [other[1]] if other and (other[0] == "unit" or not of_units) else _by_unit(model, record)
            if not (texts or other or of_units):
                texts = [text for dof in model.dofs for text in column_doubts(record, dof)]
            said += [f"record {record.name}, {text}" for text in texts]
    return tuple(said)


def _by_unit(model: Model, record: Record) -> list[str]:
    """Return a sentence for each force whose size a known unit explains, of it or of the motion."""
    return [text for dof, times, text in sizes(model, record) if in_unit(dof, times)]


def _spectra(model: Model, records: Sequence[Record]) -> Spectra | None:
    """Return the spectra of all records; None if a motion or the force of one is not known."""
    parts, waves = list[tuple[FloatArray, ComplexArray, ComplexArray]](), False
    for record in records:
        free, inputs = record.kind == "decay" and model.n > 1, forces(model, record)
        if not (free or inputs) or not {*model.dofs} <= {*record.dofs}:
            return None
        if free:
            record = replace(let_go(model, record)[0], kind="motion-only")  # windowed
        w = spectrum_of(record, record.time)[0][1:]
        x: ComplexArray = np.zeros((model.n, w.size), dtype=complex)  # zero of what stands still
        for i, spectrum in displacements(model, record).items():
            x[i] = spectrum
        parts.append((w, x, inputs[1][:, 1:] if inputs else np.zeros_like(x)))
        waves = waves or (inputs is not None and inputs[2] is not None)
    w, x, F = (np.concatenate(rows, axis=-1) for rows in zip(*parts))
    order = np.argsort(w, kind="stable")
    return Spectra(w[order], x[:, order], F[:, order], waves)


def _with_elevation(model: Model, records: Sequence[Record]) -> Iterator[tuple[Spectra, Reading]]:
    """Yield the spectra of records with the elevation and a translation exchanged."""
    eye = np.eye(model.n)
    for dof in model.dofs:
        if motion_unit(dof) == "m" and all(dof in record.channels for record in records):
            turned = _spectra(model, [record.with_channels(**{dof: record.channels["wave_elevation"],
                                                              "wave_elevation": record.channels[dof]})
                                      for record in records])
            if turned is not None:
                words = f"{dof} and wave_elevation exchanged"
                yield turned, Reading("order", (dof, "wave_elevation"), words, eye, eye)


def _readings(model: Model, record: Record, known: list[int], waves: bool) -> Iterator[Reading]:
    """Yield what a record may mean, with forces `known` and not zero; of one in `waves` they are the model's own."""
    there = {i for i, dof in enumerate(model.dofs) if f"{dof}_force" in record.channels}
    eye = np.eye(model.n)
    turns = [eye - 2.0 * np.outer(row, row) for row in eye]
    for i, dof in enumerate(model.dofs):
        yield Reading("sign", (dof,), f"the sign of {dof} turned", turns[i], eye)
        if not waves and i in known:
            yield Reading("sign", (f"{dof}_force",), f"the sign of {dof}_force turned", eye, turns[i])
            yield Reading("sign", (dof,), f"both signs turned, of {dof} and its force", turns[i], turns[i])
    for i, j in combinations(range(model.n), 2):
        swap = eye.copy()
        swap[[i, j]] = eye[[j, i]]
        one, other = model.dofs[i], model.dofs[j]
        yield Reading("order", (one, other), f"{one} and {other} exchanged", swap, eye)
        if not waves and {i, j} <= there and {i, j} & {*known}:
            forced = f"{one}_force", f"{other}_force"
            yield Reading("order", forced, f"{forced[0]} and {forced[1]} exchanged", eye, swap)
            yield Reading("order", (one, other), f"{one} and {other} exchanged, with their forces", swap, swap)
    for sets in (known,) * bool(known) if waves or len(known) < 2 else (known, *([i] for i in known)):
        columns = ("wave_elevation",) if waves else tuple(f"{model.dofs[i]}_force" for i in sets)
        what = "the model's X" if waves else " and ".join(columns)
        for times, words in ((FORCE["kgf"], "taken from kgf to N"), (FORCE["lbf"], "taken from lbf to N"),
                             (1.0 / FORCE["kgf"], "divided by 9.81")):
            yield Reading("unit", columns, f"{what} {words}", eye,
                          np.diag([times if i in sets else 1.0 for i in range(model.n)]))


def _measure(model: Model, w: FloatArray, x: ComplexArray, F: ComplexArray) -> ComplexArray:
    """Return what the rest is a share of, (n, nw): the forces, or of a free body the inertia forces at its pace."""
    if F.any():
        return F
    pace = np.array([middle(w, row) for row in x])
    return np.asarray((np.diag(model.M + model.A_inf) * pace**2)[:, None] * x)


def _left(model: Model, given: Spectra, acts: NDArray[np.bool_], rules: ReadingRules) -> float:
    """Return the rms share of the forces that the model leaves, stiffness, inertia and damping as fits them best."""
    w, x, F, _ = given
    C, inertia, Z, shares = model.C, model.M + model.A_inf, impedance(model, w), []
    of = _measure(model, w, x, F)
    for i in np.flatnonzero(acts):
        band = band_of(w, of[i])
        y, v = x[:, band], w[band]
        size = float(np.linalg.norm(of[i, band]))
        stiffness = C[i, i] if C[i, i] > 0.0 else inertia[i, i] * np.mean(v) ** 2
        free = np.where(np.arange(model.n) == i, rules.own, rules.coupled)[:, None]
        terms = np.concatenate([free * C[i, :, None] * y, free * inertia[i, :, None] * v**2 * y,
                                2j * rules.damped * np.sqrt(stiffness * inertia[i, i]) * (v * y[i])[None]]) / size
        error = (F[i, band] - np.einsum("wj,jw->w", Z[band, i], y)) / size
        there = np.any(terms != 0.0, axis=1)
        terms, low = terms[there], np.r_[-np.ones(2 * model.n), 0.0][there]
        if not there.any():
            shares.append(1.0)
            continue
        whole = np.vstack([np.hstack([terms.real, terms.imag]), np.r_[error.real, error.imag]]).T
        small = np.asarray(np.linalg.qr(whole, mode="r"))  # the same squares in as many rows as columns
        fitted = lsq_linear(small[:, :-1], small[:, -1], (low, 1.0))
        shares.append(2.0 * fitted.cost)
    return float(np.sqrt(np.mean(shares)))
