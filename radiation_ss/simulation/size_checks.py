"""Whether a force is as large as stiffness and inertia need it for the motion: a unit between force and motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.records.column_checks import band_of, columns_of, spectrum_of
from radiation_ss.records.record import Record
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
