"""Whether the motion goes with the force that is said to cause it: a sign or a phase of one is off."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import motion_unit
from radiation_ss.records.record import Record
from radiation_ss.records.signals import band_of, columns_of, compared, middle, spectrum_of
from radiation_ss.simulation.headings import force_of_waves
from radiation_ss.waves.force import on_all


@dataclass(frozen=True)
class TurnRules:
    """What a body and its sensors may be off by, and how sure a turned sign has to be."""

    # Share of the stiffness by which the body may be softer or stiffer: the natural frequency within 23 %
    softer: float = 0.4
    # Of critical, beside the model's own damping; a body without any has a frequency at which nothing resists
    damped: tuple[float, ...] = (1e-6, 0.05, 0.2)
    late: float = 1.5  # Phase at the motion's frequency by which a sensor or a force may be late [rad]
    explained: float = 0.5  # Least share of the motion's power by the turned force; a correlation of .7
    # Times the force is what turns: a motion of another size has another cause
    sizes: tuple[float, float] = (0.3, 1.0 / 0.3)
    times: float = 2.0  # As much must the force as given leave
    sure: float = 5.0  # Nats of likelihood
    # In fewer frequencies a turned sign is half a period of delay; what drives a body is read as its motion is
    lines: float = 3.0


class Turn(NamedTuple):
    """One way to turn the force: by what it is multiplied, whether X is conjugated, and what that means."""

    sign: float
    conjugate: bool
    meaning: str


TURNS = (Turn(-1.0, False, "the sign of the elevation or of {column} is turned"),
         Turn(1.0, True, "X has the other convention of phase (its conjugate fits), or the waves come from the other "
                          "side"),
         Turn(-1.0, True, "X has the other convention of phase, and one of the two the other sign"))


def turned(model: Model, record: Record, rules: TurnRules = TurnRules()) -> list[str]:
    """Return a sentence for each degree of freedom that moves against the force.

    Near a lightly damped resonance a small error turns the phase by half a period. So the force as given is taken with
    every natural frequency, damping and delay that there may be, the turned one without a delay, each with the size
    that fits best. Where nothing restores, the inertia takes the place of the stiffness. The evidence is the number of
    spectral lines times the log of the ratio of what they leave.
    """
    if record.kind == "decay":
        return [text for text, sure in turned_in_decay(model, record) if sure]
    if (inputs := forces(model, record)) is None:
        return []
    moving = inputs[0] > 0.0  # at rest a body that nothing restores is anywhere
    receptance = np.zeros((moving.size, model.n, model.n), dtype=complex)
    receptance[moving] = np.linalg.inv(impedance(model, inputs[0][moving]))
    turns = TURNS[:1] if inputs[2] is None else TURNS
    said = []
    for i, dof in enumerate(model.dofs):
        have = columns_of(record, dof)
        found = [(column, meant) for order, column in have
                 if (meant := _turn(model, record, (order, column), i, receptance, inputs, turns, rules)) is not None]
        if not found:
            continue
        (column, meant), rows = found[0], f"all {record.time.size} rows"
        if len(found) < len(have):
            said.append(f"column {column}, {rows}: it moves against the force, and the other columns of {dof} with it: "
                        f"the sign of {column} is turned")
        elif inputs[2] is not None:
            causes = "; or ".join(turn.meaning.format(column=column) for turn in meant)
            said.append(f"column wave_elevation or {column}, {rows}: {dof} moves against the force that the model's X "
                        f"makes of the elevation: {causes}")
        else:
            source = f"{dof}_force" if f"{dof}_force" in record.channels else "the other degrees of freedom's force"
            said.append(f"column {source} or {column}, {rows}: {dof} moves against the recorded force: its sign, or "
                        "that of the motion, is turned")
    return said


def turned_in_decay(model: Model, record: Record, least: float = 0.8, share: float = 0.25, apart: float = 3.0,
                    far: float = 0.3, lines: int = 5) -> list[tuple[str, bool]]:
    """Return a sentence for a free motion that goes against, or is in other units than, what a coupled one makes of it.

    And whether it is sure: degrees are; a coupling that the model lacks looks like a sign. Z_jj x_j = -sum Z_ji x_i
    where |Z_jj| is `far` of stiffness and inertia, in so many `lines` with a `share` of the energy. Against is a
    correlation of `least` and sizes a factor `apart`; degrees are 57 times.
    """
    spectra = {i: spectrum_of(record, record.channels[dof]) for i, dof in enumerate(model.dofs)
               if (0, dof) in columns_of(record, dof)}
    if len(spectra) < 2:
        return []
    omega = next(iter(spectra.values()))[0]
    w, Z = omega[1:], impedance(model, omega[1:])
    for j in spectra:
        y, parts = spectra[j][1][1:], {i: -Z[:, j, i] / Z[:, j, j] * spectra[i][1][1:] for i in spectra if i != j}
        made = np.sum(list(parts.values()), axis=0)
        size = np.maximum(abs(model.C[j, j]), w**2 * (model.M + model.A_inf)[j, j])
        band = band_of(w, made) & (np.abs(Z[:, j, j]) > far * size)
        along, ratio = compared(made[band], y[band])
        if band.sum() < lines or not ratio or np.sum(np.abs(y[band]) ** 2) <= share * np.sum(np.abs(y) ** 2):
            continue
        degrees = 40.0 < 1.0 / ratio < 80.0 and motion_unit(model.dofs[j]) == "m"
        turned = along < -least and 1.0 / apart < ratio < apart
        if turned or (degrees and abs(along) > least):
            sizes = {i: float(np.linalg.norm(part[band])) for i, part in parts.items()}
            a, b = sorted((j, max(sizes, key=lambda i: sizes[i])))
            what = ("moves against" if turned else f"is {ratio:.3g} times") + " what the model's coupling with "
            mend = "the sign of one of the two may be turned" if turned else "the rotation is in degrees, not radians"
            return [(f"column {model.dofs[a]} or {model.dofs[b]}, all {record.time.size} rows: in this decay "
                     f"{model.dofs[j]} {what}{model.dofs[b if j == a else a]} makes of it: {mend}", not turned)]
    return []


def forces(model: Model, record: Record) -> tuple[FloatArray, ComplexArray, ComplexArray | None] | None:
    """Return frequencies, the force's spectrum (n, nw), and that by the conjugate of X; None if no force is known, or
    it moves nothing.
    """
    if record.kind in ("motion-only", "static"):
        return None
    rows = record.get("force", model.dofs)
    if rows is not None:
        spectra = [spectrum_of(record, row) for row in rows]
        found = np.stack([s for _, s in spectra])
        return (spectra[0][0], found, None) if np.any(found) else None
    elevation = record.channels.get("wave_elevation")
    if elevation is None or model.hydro is None or model.hydro.X is None or np.isfinite(elevation).sum() < 16:
        return None
    omega, waves = spectrum_of(record, elevation)
    X = on_all(model.hydro.omega, force_of_waves(model, record), omega).T
    return omega, X * waves, X.conj() * waves


def displacements(model: Model, record: Record) -> dict[int, ComplexArray]:
    """Return the spectra of the motions that a record measures, without the mean, by their positions."""
    found = {}
    for i, dof in enumerate(model.dofs):
        for order, column in columns_of(record, dof)[:1]:
            omega, spectrum = spectrum_of(record, record.channels[column])
            found[i] = spectrum[1:] / (1j * omega[1:]) ** order
    return found


def _turn(model: Model, record: Record, have: tuple[int, str], i: int, receptance: ComplexArray,
          inputs: tuple[FloatArray, ComplexArray, ComplexArray | None], turns: Sequence[Turn],
          rules: TurnRules) -> list[Turn] | None:
    """Return the turns that explain a column, the derivative of some order, where the force as given does not."""
    order, column = have
    omega, given, mirrored = inputs
    measured = spectrum_of(record, record.channels[column])[1]
    moved = {False: np.einsum("wj,jw->w", receptance[:, i], given)}
    if mirrored is not None:
        moved[True] = np.einsum("wj,jw->w", receptance[:, i], mirrored)
    w_mean, inertia = middle(omega, measured), (model.M + model.A_inf)[i, i]
    stiffness = model.C[i, i] or inertia * w_mean**2
    band = band_of(omega, moved[False] if model.C[i, i] else measured)
    y = measured[band]
    power = np.abs(y) ** 2
    lines = power.sum() ** 2 / max(np.sum(power**2), 1e-300)
    if not lines >= (1.0 if record.kind == "prescribed" else rules.lines):
        return None
    w = omega[band]
    own = receptance[band, i, i]
    change = np.concatenate([share * stiffness + 2j * w[None] * damped * np.sqrt(max(stiffness, 0.0) * inertia)
                             for damped in rules.damped
                             for share in rules.softer * np.linspace(-1.0, 1.0, 17)[:, None]])
    bodies = (1j * w) ** order / (1.0 + change * own)
    mean = float(np.sum(w * power) / power.sum())
    plain = min(least_left(y, bodies * (moved[False][band] * np.exp(-1j * w * late / mean)))
                for late in rules.late * np.linspace(-1.0, 1.0, 13))
    left = {turn: least_left(y, turn.sign * bodies * moved[turn.conjugate][band], rules.sizes) for turn in turns}
    best = min(left.values())
    evidence = lines * np.log(plain / max(best, 1e-12))
    if best > 1.0 - rules.explained or plain < rules.times * best or evidence < rules.sure:
        return None
    return [turn for turn in turns if left[turn] < 2.0 * best]


def least_left(y: ComplexArray, moved: ComplexArray, sizes: tuple[float, float] = (0.0, np.inf)) -> float:
    """Return the least share of a motion's power that any row of `moved`, times a number within `sizes`, leaves."""
    along, size = np.real(moved.conj() @ y), np.maximum(np.sum(np.abs(moved) ** 2, axis=1), 1e-300)
    times = np.maximum(along / size, 0.0)
    gained = np.where((times >= sizes[0]) & (times <= sizes[1]), times * along, 0.0)
    return float(max(1.0 - np.max(gained) / np.sum(np.abs(y) ** 2), 0.0))
