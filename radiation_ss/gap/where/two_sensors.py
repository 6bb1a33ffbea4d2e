"""Two sensors on one motion, held against each other without any model: their ratio shows gain and delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.gap.where.tapers import quiet, tapered
from radiation_ss.simulation.record import Record

Rows = tuple[FloatArray, FloatArray]
DIFFERENT = 1e-4  # probability of delays as unlike one another if the clocks kept together
MATERIAL_DELAY = 0.02  # phase [rad] at the motion's frequency


def ratio_rows(record: Record, dof: str, omega: float) -> list[Rows]:
    """Return rows of A = -w^2 X (alpha + i w tau alpha) in the loud bins, real and imaginary part.

    None without both sensors.
    """
    x, a = record.channels.get(dof), record.channels.get(f"{dof}_acceleration")
    if x is None or a is None or min(np.isfinite(x).sum(), np.isfinite(a).sum()) < 64:
        return []
    h = float(np.median(np.diff(record.time)))
    time = np.arange(record.time[0], record.time[-1], h)
    pair = np.stack([np.interp(time, record.time[np.isfinite(v)], v[np.isfinite(v)]) for v in (x, a)], axis=1)
    both = tapered(pair - pair.mean(axis=0))
    at: FloatArray = np.asarray(2.0 * np.pi * np.fft.rfftfreq(time.size, h))
    loud = np.logical_not(quiet(both[:, :, :1], at)) & (at > 0.3 * omega)
    base = -(at[loud] ** 2) * both[:, loud, 0]
    A = np.stack([base, 1j * at[loud] * base], axis=-1).reshape(-1, 2)
    target = both[:, loud, 1].ravel()
    return [(np.concatenate([A.real, A.imag]), np.concatenate([target.real, target.imag]))]


def fault(rows: Sequence[Rows]) -> tuple[float, float, FloatArray]:
    """Return gain and delay [s] of the displacement against the acceleration, and their covariance."""
    solution, covariance = weighted(np.concatenate([r[0] for r in rows]), np.concatenate([r[1] for r in rows]))
    return float(1.0 / solution[0] - 1.0), float(solution[1] / solution[0]), covariance


def weighted(A: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return least squares and its covariance; tapers and neighbouring bins overlap, so ordinates count a fourth."""
    solution: FloatArray = np.asarray(np.linalg.lstsq(A, target, rcond=None)[0], dtype=np.float64)
    variance = float(np.mean((target - A @ solution) ** 2))
    return solution, np.asarray(np.linalg.inv(A.T @ A)) * variance * 4.0


def unlike_clocks(records: Sequence[Record], typical: Mapping[str, float]) -> tuple[str, ...]:
    """Return a remark on each degree of freedom whose two sensors are apart by another time in each record.

    A delay that is the same in all records is an effect of the library; clocks started by hand differ from run to run.

    Parameters
    ----------
    records : sequence of Record
    typical : mapping of dof to float
        Circular frequency of the motion [rad/s].
    """
    said = []
    for dof, omega in typical.items():
        found = [(record.name, *fault(rows)) for record in records if (rows := ratio_rows(record, dof, omega))]
        if len(found) < 2:
            continue
        delays = np.array([delay for _, _, delay, _ in found])
        weights = np.array([1.0 / covariance[1, 1] for *_, covariance in found])
        apart = delays - weights @ delays / weights.sum()
        unlikely = chi2.sf(float(weights @ apart**2), delays.size - 1) < DIFFERENT
        if unlikely and omega * float(np.abs(apart).max()) > MATERIAL_DELAY:
            each = ", ".join(f"{delay:+.3g} s in {name}" for name, _, delay, _ in found)
            said.append(f"{dof} and {dof}_acceleration do not share a clock: the displacement is late by {each}. Bring "
                        "both to one clock in every record, leave one of them out, or name clock_offset among the "
                        "effects.")
    return tuple(said)
