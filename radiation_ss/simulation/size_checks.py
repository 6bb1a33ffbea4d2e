"""Whether force and motion are as large as the model makes of each other: a unit between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, columns_of, factor_between, grid_of, spectrum_of, whole
from radiation_ss.simulation.linear import exact_step, propagate
from radiation_ss.simulation.prepared import exciting_force
from radiation_ss.simulation.sign_checks import forces, impedance

APART = 3.0  # Times that a force is off its motion from which on it is said: stiffness and inertia are off by less


@dataclass(frozen=True)
class SizeRules:
    """Where force and motion are compared."""

    # Share of the sum of stiffness and inertia terms that must remain of their difference. There damping does little,
    # and a stiffness or inertia 44 % off changes the ratio by less than APART
    far: float = 0.5
    alike: float = 0.8  # Correlation of the two forces
    share: float = 0.1  # Of the recorded force's energy that must lie there: less may be leakage or noise


def sizes(model: Model, record: Record, rules: SizeRules = SizeRules()) -> list[str]:
    """Return a sentence for each force that is APART times larger or smaller than the motion needs.

    F_i = sum_j Z_ij x_j at frequencies where stiffness and inertia do not cancel: near static it is C x, far above
    resonance -w^2 (M + A) x. Drag, friction and radiation, which a diagnosis looks for, matter at resonance.
    """
    if record.kind in ("decay", "motion-only", "static"):
        return []
    inputs, motions = forces(model, record), {}
    for j, dof in enumerate(model.dofs):
        for order, column in columns_of(record, dof)[:1]:
            omega, spectrum = spectrum_of(record, record.channels[column])
            motions[j] = spectrum[1:] / (1j * omega[1:]) ** order
    if inputs is None or not motions:
        return []
    w = inputs[0][1:]
    Z = impedance(model, w)
    largest = np.abs(Z).max(axis=0)
    said = []
    for i, dof in enumerate(model.dofs):
        tied = largest[i] ** 2 > np.finfo(float).eps * largest[i, i] * np.diag(largest)
        if not columns_of(record, dof) or not set(np.flatnonzero(tied)) <= set(motions):
            continue
        times = _ratio(model, Z[:, i], i, motions, w, inputs[1][i, 1:], rules)
        if times is not None and not 1.0 / APART < times < APART:
            source = "wave_elevation" if inputs[2] is not None else f"{dof}_force"
            said.append(sentence(record, dof, source, times))
    return said


def moves_as_told(model: Model, record: Record, dof: str) -> bool:
    """Whether a motion is as large as the model's under the record's force."""
    return any(name == dof and factor is None for name, _, factor in against_model(model, record))


def against_model(model: Model, record: Record,
                  coherent: float = 0.2) -> Iterator[tuple[str, tuple[tuple[int, str], ...], float | None]]:
    """Yield each motion that goes along with the model's under the record's force, from rest, with its columns.

    And how many times as large it is, where that is far off. Noise, and motion of another cause, are less coherent
    with the prediction.
    """
    moved = None if record.kind in ("decay", "motion-only", "static") else _predicted(model, record)
    if moved is None:
        return
    undriven = np.finfo(float).eps ** 0.5 * np.abs(moved).max()  # what rounding alone moves
    for i, dof in enumerate(model.dofs):
        have = columns_of(record, dof)
        if not have or np.abs(moved[i]).max() <= undriven:
            continue
        order, column = have[0]
        omega, measured = spectrum_of(record, record.channels[column])
        predicted = spectrum_of(record, moved[i])[1] * omega**order
        size = max(float(np.linalg.norm(measured) * np.linalg.norm(predicted)), 1e-300)
        if np.abs(np.vdot(measured, predicted)) / size >= coherent:
            yield dof, tuple(have), factor_between(omega, measured, predicted)


def off_size(model: Model, record: Record) -> Iterator[tuple[str, float, str]]:
    """Yield each motion that is far larger or smaller than the model's under the record's force: how many times."""
    for dof, have, factor in against_model(model, record):
        if factor is None:
            continue
        pushed = [name for name in model.dofs if f"{name}_force" in record.channels]
        source = (f"{dof}_force" if dof in pushed else "the other degrees of freedom's force" if pushed
                  else "wave_elevation")
        force = "m" if source == "wave_elevation" else force_unit(dof)
        agree = f" {' and '.join(c for _, c in have)} agree, so look at {source} first;" if len(have) > 1 else ""
        yield (dof, factor,
               f"record {record.name}, column {source} or {have[0][1]}, all {record.time.size} rows: {dof} moves "
               f"{factor:.3g} times as much as the model under the recorded force;{agree} check the units "
               f"({source} in {force}, {dof} in {motion_unit(dof)}) and that the record is of this body")


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
    F, G = model.matrices()
    grid = grid_of(record)
    force = np.stack([np.interp(grid, record.time, row) for row in rows], axis=1)
    states = propagate(exact_step(F, G, float(grid[1] - grid[0])), force, np.zeros(F.shape[0]))
    first = F.shape[0] - 2 * model.n
    return np.stack([np.interp(record.time, grid, states[:, first + i]) for i in range(model.n)])


def sentence(record: Record, dof: str, source: str, times: float, where: str = ", away from resonance") -> str:
    """Word a force that is `times` what the motion needs."""
    unit = "m" if source == "wave_elevation" else force_unit(dof)
    made = "the force that X makes of it" if source == "wave_elevation" else "it"
    kilograms = "; force in kgf is 0.102 times that in N" if abs(np.log(times * 9.81)) < 0.1 else ""
    return (f"record {record.name}, column {source} or {dof}, all {record.time.size} rows: {made} is {times:.3g} times "
            f"the force that the model's stiffness and inertia need for {dof}{where}{kilograms}; check "
            f"the units ({source} in {unit}, {dof} in {motion_unit(dof)}), and the model's mass and stiffness")


def _ratio(model: Model, Z: ComplexArray, i: int, motions: dict[int, ComplexArray], w: FloatArray, force: ComplexArray,
           rules: SizeRules) -> float | None:
    """Return recorded over needed force of a degree of freedom, None where they cannot be compared; Z (nw, n)."""
    inertia = np.abs(model.M + model.A_inf)[i]
    made = np.sum([Z[:, j] * x for j, x in motions.items()], axis=0)
    terms = np.sum([(abs(model.C[i, j]) + w**2 * inertia[j]) * np.abs(x) for j, x in motions.items()], axis=0)
    far = band_of(w, force) & (np.abs(made) > rules.far * terms)
    one, other = float(np.linalg.norm(made[far])), float(np.linalg.norm(force[far]))
    if one == 0.0 or other**2 < rules.share * float(np.sum(np.abs(force) ** 2)):
        return None
    along = float(np.vdot(made[far], force[far]).real) / (one * other) if other else 0.0
    return other / one if along > rules.alike else None
