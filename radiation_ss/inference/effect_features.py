"""What an effect adds to the equation of motion along a measured motion, for each unit of its strengths."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.effects.definition import Active
from radiation_ss.inference.effect_symbols import Symbols
from radiation_ss.inference.motion import MeasuredMotion


@dataclass(frozen=True, eq=False)
class Feature:
    """One strength of an effect along one record, for each unit of the strength."""

    force: FloatArray  # (n, nt): Force [N or N m]
    reading: FloatArray  # (n, nt): What it adds to the displacement's readings [m or rad]
    # (nw, n, n): Mean derivative of the force at the frequencies `omega_fine` of the record by what it predicts: by the
    # displacement, or of a prescribed motion by the measured force
    response: ComplexArray
    reading_response: ComplexArray  # (nw, n, n): That of the readings by the displacement
    others: FloatArray  # (n, nt): What it adds to the displacements that the other sensors are derivatives of


def features(symbols: Symbols, active: Active, runs: Sequence[MeasuredMotion]) -> list[list[Feature]]:
    """Return the features of each strength in each record, indexed [strength][record].

    `symbols` are those of the same effect on the same place, with any numbers.
    """
    return [list(by_record) for by_record in zip(*features_of(symbols, active, runs))]


def features_of(symbols: Symbols, active: Active, runs: Sequence[MeasuredMotion],
                responses: bool = True) -> Iterator[list[Feature]]:
    """Yield the features of each strength record by record: along long records all of them together are large.

    Without `responses` these have no frequencies.
    """
    strengths = [k for k, p in enumerate(active.effect.parameters.values()) if p.strength]
    return (along(symbols, active, strengths, run, run.omega_fine if responses else np.zeros(0)) for run in runs)


def along(symbols: Symbols, active: Active, strengths: Sequence[int], run: MeasuredMotion,
          omega: FloatArray) -> list[Feature]:
    """Return the features of one record, their responses at some frequencies."""
    effect, n, nt = active.effect, symbols.model.n, run.time.size
    values = np.array(active.vector)
    values[list(strengths)] = 0.0
    slow = run.record.kind == "static" and not effect.settled
    if not run.free[symbols.places].any() or (slow and not (effect.by_pace and run.paced)):
        still = np.zeros((n, nt)), np.zeros((omega.size, n, n), dtype=complex)
        return [Feature(still[0], still[0], still[1], still[1], still[0])] * len(strengths)
    rows = symbols.values(replace(run, v=run.pace) if slow else run)
    found = []
    for strength in strengths:
        force, reading = np.zeros((n, nt)), np.zeros((n, nt))
        response, seen = np.zeros((omega.size, n, n), dtype=complex), np.zeros((omega.size, n, n), dtype=complex)
        if effect.force is not None:
            at_one = np.where(np.arange(values.size) == strength, 1.0, values)
            at = omega[:0] if run.prescribed else omega
            value, slope = symbols.force(rows, strength, values, at_one, run.steps[symbols.places[0]], at)
            for row, place in enumerate(symbols.targets):
                force[place] += value[row]
                response[: at.size, place] += slope[:, row]
        if effect.input is not None and run.force is not None:
            for place in symbols.places:
                value, slope = symbols.scalar("input", place, rows, strength, values)
                force[place] += value
                response[:, place] += slope * (run.prescribed and np.any(run.force[place]))
        if effect.clock_in is not None and run.force is not None:
            shift, whole = symbols.clock("clock_in", rows, strength, active)
            force[symbols.places] += shift * moving_at(run, run.force[symbols.places], whole)
        if effect.output is not None:
            place = symbols.places[0]
            value, slope = symbols.scalar("output", place, rows, strength, values)
            reading[place] = value
            seen[:, place] += slope
        if effect.clock_out is not None:
            shift, whole = symbols.clock("clock_out", rows, strength, active)
            driving = run.force if run.driven_alone and effect.linear else None
            if driving is not None:
                force[symbols.places] += shift * moving_at(run, driving[symbols.places], whole)
            for place in symbols.places if driving is None else ():  # its Jacobian's modulus is one: it turns phases
                # The motion is what a late sensor will read; what others read late has been.
                sign = -1.0 if active.of_first_sensor else 1.0
                reading[place] += shift * moving_at(run, run.x[[place]], sign * whole)[0]
        first, others = float(active.of_first_sensor), float(active.of_other_sensors)
        found.append(Feature(force, first * reading, response, seen if first else 0.0j * seen, others * reading))
    return found


def ringing(symbols: Symbols, active: Active, run: MeasuredMotion, sizes: FloatArray) -> Iterator[FloatArray]:
    """Yield the force (n, nt) by each own state that is off rest by its size at first, at a strength of one."""
    values = np.array([1.0 if p.strength else v for v, p in zip(active.vector, active.effect.parameters.values())])
    (strength,) = (k for k, p in enumerate(active.effect.parameters.values()) if p.strength)
    rows = [np.zeros(run.time.size)] * symbols.given.numel()
    for begins in np.diag(sizes):
        z, force = symbols.own_states(rows, values, run.steps[symbols.places[0]], begins), np.zeros_like(run.x)
        force[symbols.targets] = symbols.along(rows, strength, values, z)
        yield force


def moving_at(run: MeasuredMotion, values: FloatArray, shift: FloatArray) -> FloatArray:
    """Return the change of signals (k, nt) over a shift of time (nt,), for each second.

    Of a slow test it is that of what is smooth: between two noisy readings there is less noise than in either.
    """
    return run.rates(values) if run.record.kind == "static" else secant(run.time, values, shift)


def secant(time: FloatArray, values: FloatArray, shift: FloatArray) -> FloatArray:
    """Return the change of signals (..., nt) over a shift of time (nt,), for each second; where it is none, slope."""
    spline = CubicSpline(time, values, axis=-1)
    moved = np.clip(time + shift, time[0], time[-1]) - time
    far = np.abs(moved) > 1e-9 * (time[-1] - time[0])
    return np.asarray(np.where(far, (spline(time + moved) - values) / np.where(far, moved, 1.0), spline(time, 1)))
