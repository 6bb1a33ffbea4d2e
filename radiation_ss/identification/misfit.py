"""Whether what a linear model leaves of a record is the noise that the columns show, or something it lacks."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.identification.prediction_error import NOISE, NOISE_SPREAD, MotionLikelihood
from radiation_ss.inference.scales import noise_of
from radiation_ss.records.record import Record

MISTAKEN = 1e-4     # chance to warn of a record whose noise is as its columns show
UNSURE = 1.5        # of a variance: what the noise's level, estimated from few samples, may be off by
EDGE = 2            # periods; X's memory
LEAST = 1e-4        # of the force: the noise of a force that is known to be zero


def misfit_warnings(part: MotionLikelihood, u: FloatArray, v: FloatArray, *, floor: float = LEAST,
                    edge: int = 0) -> list[str]:
    """Return a warning if prediction errors are larger than sensor noise, and the noise of the force column, explain.

    The fit calls whatever it cannot explain a random force. Here the random force has the size that the force column
    itself shows, and the squared normalised innovations of each period of the motion are held against chi^2: overall,
    and at their worst period (a decay is lively only in its first ones).

    Parameters
    ----------
    part : MotionLikelihood
    u, v : ndarray
        The estimate: radiation parameters, and the record's nuisance parameters.
    floor : float
        Least noise of the force, relative.
    edge : int
        Periods at each end that do not count, because the force is unsure there.
    """
    e, s = part.run(u, as_measured(part, v, floor))
    there = np.isfinite(part.channels.y)
    period = max(1, round(2.0 * np.pi / part.frequency / part.channels.dt))
    kept = slice(edge * period, part.channels.y.shape[0] - edge * period)
    square, used = np.where(there, e**2 / s, 0.0).sum(axis=1)[kept], there.sum(axis=1)[kept]
    if used.sum() < period:
        return []
    starts = np.arange(0, square.size, period)
    total = np.r_[np.add.reduceat(square, starts), square.sum()]
    count = np.maximum(np.r_[np.add.reduceat(used, starts), used.sum()], 1)
    excess, limits = total / count, chi2.ppf(1.0 - MISTAKEN / count.size, count) / count
    worst = int(np.argmax(excess / limits))
    if excess[worst] < UNSURE * limits[worst]:
        return []
    noise = float(np.sqrt(np.median(s[there])))
    time = part.channels.time[kept]
    where = "" if worst == starts.size else f" in its worst period, about {time[starts[worst]]:.4g} s"
    return [f"record {part.channels.name}: from one sample to the next the linear model leaves "
            f"{noise * np.sqrt(excess[worst]):.2%} of the motion{where}, noise of the columns explains "
            f"{noise:.2%}; the bands hold only if the rest is noise: run diagnose first"]


def as_measured(part: MotionLikelihood, v: FloatArray, floor: float = LEAST) -> FloatArray:
    """Return the nuisance parameters with the random force at the noise that the force column shows."""
    p, n = part.channels.count, part.model.n
    shown = np.array([noise_of(column) for column in part.force.T])
    level = np.maximum(shown / part.force_scale, floor)
    out = v.copy()
    out[p:p + n] = np.minimum(out[p:p + n], np.log(level / NOISE) / NOISE_SPREAD)
    return out


def unsure_force(record: Record, source: str) -> tuple[float, int]:
    """Return the least relative noise of a record's force, and the periods at its ends where it is unsure.

    A force from the elevation is smooth whatever the probe's noise, and X asks for elevations beyond the ends.
    """
    if not source.startswith("wave elevation"):
        return LEAST, 0
    elevation = record.channels["wave_elevation"]
    elevation = elevation[np.isfinite(elevation)]
    return max(noise_of(elevation) / float(elevation.std()), LEAST), EDGE
