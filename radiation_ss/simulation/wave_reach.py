"""How far before and after a time the force of an elevation reaches, and whether X is known finely enough for it."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import HydroData
from radiation_ss.records.column_checks import spectrum_of
from radiation_ss.records.record import Record
from radiation_ss.simulation.measured import power_of


def unsure_edge(model: Model, record: Record, *, periods: float = 1.5, longest: float = 1.0 / 6.0) -> float:
    """Return how much of a record's ends [s] has an unsure force, where it comes from the elevation; else 0.

    The force at a time depends on the elevation before and after it, and that is cut off at the ends: at least 1.5 wave
    periods, and more where X says so. X = int h(t) e^(-i w t) dt gives the mean square time over which the memory h of
    this sea's force reaches, sum S |dX/dw|^2 / sum S |X|^2 (Parseval): the square of the group delay d arg X / dw,
    weighted by the force's spectrum, and of what spreads about it. An even memory reaches sqrt(3) times its root; that
    of a long body in short waves lies at its ends, and what is over is for how far it spreads there. `periods`: of the
    waves, that are unsure in any case. `longest`: share of a record that is left out at either end at most.
    """
    if record.get("force", model.dofs) is not None or "wave_elevation" not in record.channels:
        return 0.0
    least = periods * 2.0 * np.pi / mean_frequency(record.time, record.channels["wave_elevation"])
    length = float(record.time[-1] - record.time[0])
    if least >= longest * length:
        return 0.0
    return min(max(least, np.sqrt(3.0) * reach(model, record)), longest * length)


def reach(model: Model, record: Record, slight: float = 1e-6) -> float:
    """Return the standard deviation [s], about the time itself, of the memory of the sea's force; the longest one.

    A force of less than the share `slight` of the largest one's power is rounding.
    """
    known = model.hydro
    if known is None or known.X is None or known.omega.size < 2:
        return 0.0
    X = known.X[:, 0, :]
    slope = np.gradient(X, known.omega, axis=0)
    sea = sea_powers(known, record)[:, None] * np.gradient(known.omega)[:, None]
    power, moment = np.sum(sea * np.abs(X) ** 2, axis=0), np.sum(sea * np.abs(slope) ** 2, axis=0)
    counts = power > slight * max(float(power.max()), 1e-300)
    return float(np.sqrt(np.max(moment[counts] / power[counts]))) if counts.any() else 0.0


def coarse_excitation(model: Model, record: Record, *, turn: float = 1.0, share: float = 0.05,
                      slight: float = 1e-6) -> tuple[str, ...]:
    """Return a sentence for each degree of freedom whose X turns too far between frequencies that the sea has.

    Parameters
    ----------
    turn : float
        Phase between neighbouring frequencies [rad]; at .8 rad a cubic is off by 1 %, at 2 rad by half.
    share : float
        Of the force's power, in such gaps, that is worth a word.
    slight : float
        Of the largest force's power: what a symmetric body has of rounding and panels.
    """
    known = model.hydro
    if (known is None or known.X is None or known.omega.size < 2 or "wave_elevation" not in record.channels
            or record.get("force", model.dofs) is not None):
        return ()
    said = []
    X, sea, omega = known.X[:, 0, :], sea_powers(known, record), known.omega
    powers = sea[:, None] * np.abs(X) ** 2
    between = 0.5 * (powers[1:] + powers[:-1]) * np.diff(omega)[:, None]
    turns = np.abs(np.angle(X[1:] * X[:-1].conj()))
    totals = np.sum(between, axis=0)
    for i, dof in enumerate(model.dofs):
        far = turns[:, i] > turn
        if totals[i] > slight * totals.max() and between[far, i].sum() > share * totals[i]:
            k = int(np.argmax(np.where(far, between[:, i], 0.0)))
            said.append(f"X of {dof} turns by {turns[k, i]:.1f} rad between {omega[k]:.3g} and {omega[k + 1]:.3g} "
                        f"rad/s: too coarse for the sea of {record.name}; give X at more frequencies.")
    return tuple(said)


def sea_powers(known: HydroData, record: Record) -> FloatArray:
    """Return the elevation's power at the frequencies of X, each the mean over half the way to its neighbours."""
    omega, spectrum = spectrum_of(record, record.channels["wave_elevation"])
    middles = 0.5 * (known.omega[1:] + known.omega[:-1])
    edges = np.concatenate([[known.omega[0]], middles, [known.omega[-1]]])
    cumulated = np.concatenate([[0.0], np.cumsum(np.abs(spectrum) ** 2)])
    at = np.concatenate([omega, [2.0 * omega[-1] - omega[-2]]]) - 0.5 * omega[1]
    return np.asarray(np.diff(np.interp(edges, at, cumulated)) / np.maximum(np.diff(edges), 1e-300))


def mean_frequency(time: FloatArray, values: FloatArray) -> float:
    """Return the mean circular frequency of a signal's power spectrum [rad/s]."""
    omega, power = power_of(time, values)
    return float(np.sum(omega[1:] * power[1:]) / max(power[1:].sum(), 1e-300))
