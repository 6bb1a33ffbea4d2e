"""Two sensors on one motion, held against each other without any model: their ratio shows gain and delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.gap.where.tapers import quiet, tapered
from radiation_ss.records.record import Record

Rows = tuple[FloatArray, ComplexArray, ComplexArray]
TURNS = 8  # Gauss-Newton steps at most; two or three are enough up to a radian of delay
DIFFERENT = 1e-4  # probability of delays as unlike one another if the clocks kept together
MATERIAL_DELAY = 0.02  # phase [rad] at the motion's frequency


def ratio_rows(record: Record, dof: str, omega: float) -> list[Rows]:
    """Return the loud bins: frequencies, -w^2 X and the acceleration's A, which are alike for sound sensors.

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
    return [(np.tile(at[loud], len(both)), base.ravel(), both[:, loud, 1].ravel())]


def fault(rows: Sequence[Rows]) -> tuple[float, float, FloatArray]:
    """Return gain and delay [s] of the displacement against the acceleration, and their covariance.

    A = -w^2 X alpha e^{i w tau} by Gauss-Newton: the delay found so far is taken out of X before the next step.
    """
    omega, base, target = (np.concatenate(parts) for parts in zip(*rows))
    delay = 0.0
    for _ in range(TURNS):
        turned = base * np.exp(1j * omega * delay)
        solution, covariance = weighted(np.stack([turned, 1j * omega * turned], axis=-1), target)
        step = float(solution[1] / solution[0])
        delay += step
        if abs(step) < 1e-3 * np.sqrt(covariance[1, 1]) / abs(solution[0]):
            break
    slopes = np.diag([-1.0 / solution[0] ** 2, 1.0 / solution[0]])  # of gain = 1 / alpha - 1 and of the step
    return float(1.0 / solution[0] - 1.0), delay, slopes @ covariance @ slopes


def weighted(columns: ComplexArray, values: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return real least squares, and covariance; tapers and neighbouring bins overlap, so ordinates count a fourth."""
    A, target = np.concatenate([columns.real, columns.imag]), np.concatenate([values.real, values.imag])
    solution: FloatArray = np.asarray(np.linalg.lstsq(A, target, rcond=None)[0], dtype=np.float64)
    variance = float(np.mean((target - A @ solution) ** 2))
    return solution, np.asarray(np.linalg.inv(A.T @ A)) * variance * 4.0


def unlike_clocks(records: Sequence[Record], typical: Mapping[str, float]) -> tuple[str, ...]:
    """Return a remark on each degree of freedom whose two sensors are apart by another time in each record.

    A delay that is the same in all records is an effect of the library; clocks started by hand differ from run to run.
    Decays are passed over: a motion that begins at its largest has no spectrum that the tapers leave as it is, and the
    ratio is not -w^2.

    Parameters
    ----------
    records : sequence of Record
    typical : mapping of dof to float
        Circular frequency of the motion [rad/s].
    """
    said = []
    for dof, omega in typical.items():
        steady = [record for record in records if record.kind != "decay"]
        found = [(record.name, *fault(rows)) for record in steady if (rows := ratio_rows(record, dof, omega))]
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
