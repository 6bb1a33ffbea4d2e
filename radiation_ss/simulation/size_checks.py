"""Whether a motion has the size that the model gives it under the force of its record: a unit of one is off."""

from collections.abc import Iterator

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.records.column_checks import FACTOR, factor_between
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, columns_of, compared, grid_of, spectrum_of, whole
from radiation_ss.simulation.force_checks import displacements, forces
from radiation_ss.simulation.linear import exact_step, propagate
from radiation_ss.simulation.prepared import exciting_force
from radiation_ss.units import FORCE, UNITS

APART = 3.0  # Times that a force is off its motion from which on it is said: stiffness and inertia are off by less


def sizes(model: Model, record: Record, far: float = 0.5, alike: float = 0.8, share: float = 0.1,
          by_waves: float = 2.5) -> Iterator[tuple[str, float, str]]:
    """Yield each motion whose force is APART times larger or smaller than it needs, F_i = sum Z_ij x_j: how many times,
    and a sentence. One that X makes of the elevation from `by_waves` times on: noise leaves an X of another unit
    somewhat less than 3. Of a static test all that `slopes` tells.

    Else where of stiffness and inertia terms `far` remains of their sum: there damping, friction and drag do little,
    and a stiffness 44 % off changes the ratio by less than APART. With a correlation `alike`, and a `share` of the
    force's energy: less may be leakage or noise.
    """
    for i, times in slopes(model, record).items() if record.kind == "static" else ():
        if not 1.0 / APART < times < APART:
            dof = model.dofs[i]
            yield dof, times, sentence(record, dof, f"{dof}_force", times, "")
    if (inputs := forces(model, record)) is None or not (motions := displacements(model, record)):
        return
    w = inputs[0][1:]
    Z, inertia = impedance(model, w), np.abs(model.M + model.A_inf)
    largest = np.abs(Z).max(axis=0)
    for i, dof in enumerate(model.dofs):
        tied = largest[i] ** 2 > np.finfo(float).eps * largest[i, i] * np.diag(largest)
        if not columns_of(record, dof) or not set(np.flatnonzero(tied)) <= set(motions):
            continue
        made, force = np.sum([Z[:, i, j] * x for j, x in motions.items()], axis=0), inputs[1][i, 1:]
        terms = np.sum([(abs(model.C[i, j]) + w**2 * inertia[i, j]) * np.abs(x) for j, x in motions.items()], axis=0)
        band = band_of(w, force) & (np.abs(made) > far * terms)
        correlation, times = compared(made[band], force[band])
        counts = np.sum(np.abs(force[band]) ** 2) >= share * np.sum(np.abs(force) ** 2)
        apart = APART if inputs[2] is None else by_waves
        if counts and correlation > alike and not 1.0 / apart < times < apart:
            source = "wave_elevation" if inputs[2] is not None else f"{dof}_force"
            yield dof, times, sentence(record, dof, source, times)


def in_unit(dof: str, times: float, near: float = 0.1) -> str:
    """Word the units of force or of motion that make a force `times` what its motion needs; none gives ""."""
    motion = motion_unit(dof)
    said = [f"force in {unit} is {1.0 / one:.3g} times that in N" for unit, one in FORCE.items()
            if one != 1.0 and abs(np.log(times * one)) < near]
    said += [f"{dof} in {unit} is {1.0 / one:.3g} times that in {motion}" for unit, one in UNITS[motion].items()
             if one != 1.0 and abs(np.log(times / one)) < near]
    return " or ".join(said)


def sentence(record: Record, dof: str, source: str, times: float, where: str = ", away from resonance") -> str:
    """Word a force that is `times` what the motion needs."""
    unit = "m" if source == "wave_elevation" else force_unit(dof)
    made = "the force that X makes of it" if source == "wave_elevation" else "it"
    X = f"X ({force_unit(dof)} per metre of wave amplitude), " if source == "wave_elevation" else ""
    unit_said = f"; {known}" if (known := in_unit(dof, times)) else ""
    return (f"column {source} or {dof}, all {record.time.size} rows: {made} is {times:.3g} times "
            f"the force that the model's stiffness and inertia need for {dof}{where}{unit_said}; check "
            f"{X}the units ({source} in {unit}, {dof} in {motion_unit(dof)}), and the model's mass and stiffness")


def faint(model: Model, moved: FloatArray, share: float = 1e-3) -> np.ndarray:
    """Return which motions of these sizes, (n,), have less than a share of the largest one, by kinetic energy.

    By default less than the model knows of its couplings: it hardly tells a motion that no force of its own drives.
    """
    energetic = np.sqrt(np.diag(model.M + model.A_inf)) * moved
    return np.asarray(energetic <= share * energetic.max())


def against_model(model: Model, record: Record,
                  coherent: float = 0.2) -> Iterator[tuple[str, tuple[tuple[int, str], ...], float | None]]:
    """Yield each motion that is coherent with the model's under the record's force, with its columns, and how many
    times as large it is where that is far off, beside the free motions that a start makes; noise, and motion of another
    cause, are less coherent. Of what a force of its own drives only what rounding moves is left out, of the others what
    is faint.
    """
    moved = None if record.kind in ("decay", "motion-only", "static") else _predicted(model, record)
    if moved is None:
        return
    largest = np.abs(moved).max(axis=1)
    undriven, rounded = faint(model, largest), faint(model, largest, np.finfo(float).eps ** 0.5)
    for i, dof in enumerate(model.dofs):
        have, own = columns_of(record, dof), record.channels.get(f"{dof}_force", np.zeros(1))
        if not have or (rounded if variance(own) > 0.0 else undriven)[i]:
            continue
        order, column = have[0]
        omega, measured = spectrum_of(record, record.channels[column])
        predicted = spectrum_of(record, moved[i])[1] * omega**order
        factor = factor_between(omega, measured, predicted)
        if factor is not None:  # the start may explain it
            free = _free(model, record, i) * omega**order
            measured, predicted = (row - free.T @ np.linalg.lstsq(free.T, row)[0] for row in (measured, predicted))
            factor = factor_between(omega, measured, predicted)
        if _coherence(measured, predicted) >= coherent:
            yield dof, tuple(have), factor


def moves_as(model: Model, record: Record, dof: str) -> bool:
    """Whether a motion has the model's size under the force that a record states."""
    if record.kind == "static":
        return 1.0 / FACTOR < slopes(model, record).get(model.dofs.index(dof), 0.0) < FACTOR
    return any(name == dof and times is None for name, _, times in against_model(model, record))


def off_size(model: Model, record: Record) -> Iterator[tuple[str, float, str]]:
    """Yield each motion that is far larger or smaller than the model's under the record's force: how many times.

    A rig that prescribes a motion may hold the body where its model drifts.
    """
    for dof, have, factor in against_model(model, record):
        if factor is None or (record.kind == "prescribed" and not model.C[model.dofs.index(dof)].any()):
            continue
        pushed = [name for name in model.dofs if f"{name}_force" in record.channels]
        source = (f"{dof}_force" if dof in pushed else "the other degrees of freedom's force" if pushed
                  else "wave_elevation")
        force = "m" if source == "wave_elevation" else force_unit(dof)
        agree = f" {' and '.join(c for _, c in have)} agree, so look at {source} first;" if len(have) > 1 else ""
        yield (dof, factor,
               f"column {source} or {have[0][1]}, all {record.time.size} rows: {dof} moves "
               f"{factor:.3g} times as much as the model under the recorded force;{agree} check the units "
               f"({source} in {force}, {dof} in {motion_unit(dof)}) and that the record is of this body")


def slopes(model: Model, record: Record, alike: float = 0.8) -> dict[int, float]:
    """Return load over place by the model's stiffness where they correlate by `alike`: friction hides a slope."""
    found = {}
    for i, dof in enumerate(model.dofs):
        if model.C[i, i] == 0.0 or not {dof, f"{dof}_force"} <= set(record.channels):
            continue
        x, load = (record.channels[name] for name in (dof, f"{dof}_force"))
        both = np.isfinite(x) & np.isfinite(load)
        x, load = x[both] - np.mean(x[both]), load[both] - np.mean(load[both])
        size = float(np.linalg.norm(x) * np.linalg.norm(load))
        if both.sum() >= 3 and abs(x @ load) >= alike * size > 0.0:
            found[i] = float(x @ load / (x @ x)) / model.C[i, i]
    return found


def _predicted(model: Model, record: Record) -> FloatArray | None:
    """Return the model's displacements under the record's force from rest, (n, nt); None if that is unknown or zero."""
    rows = record.get("force", model.dofs)
    if rows is not None:
        rows = np.stack([whole(record.time, row) for row in rows])
    elif "wave_elevation" in record.channels and np.isfinite(record.channels["wave_elevation"]).sum() > 8:
        splines = exciting_force(model, record)
        rows = None if splines is None else np.stack([f(np.clip(record.time, *f.x[[0, -1]])) for f in splines])
    if rows is None or not rows.any():
        return None
    return moved_by(model, record, rows, np.zeros(model.fit.states + 2 * model.n))


def _free(model: Model, record: Record, i: int) -> ComplexArray:
    """Return the spectra of a displacement in the free motions from each place and velocity, (2n, nw)."""
    still, states = np.zeros((model.n, record.time.size)), np.eye(model.fit.states + 2 * model.n)[model.fit.states:]
    return np.stack([spectrum_of(record, moved_by(model, record, still, start)[i], spiky=False)[1] for start in states])


def _coherence(one: ComplexArray, other: ComplexArray) -> float:
    """Return the correlation of two spectra, in whatever phase."""
    return float(np.abs(np.vdot(one, other)) / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-300))


def moved_by(model: Model, record: Record, force: FloatArray, start: FloatArray) -> FloatArray:
    """Return the model's displacements (n, nt) at a record's times under a force (n, nt), from a state."""
    (F, G), grid, first = model.matrices(), grid_of(record), model.fit.states
    even = np.stack([np.interp(grid, record.time, row) for row in force], axis=1)
    states = propagate(exact_step(F, G, float(grid[1] - grid[0])), even, start)
    return np.stack([np.interp(record.time, grid, row) for row in states.T[first:first + model.n]])


def variance(values: FloatArray) -> float:
    """Return the variance of what is measured; 0 if nothing is."""
    good = values[np.isfinite(values)]
    return float(np.var(good)) if good.size else 0.0
