"""The exciting force by all of a record: fixed-interval smoothing of the ensemble (Rauch, Tung, Striebel 1965)."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.engines import MarginalEngine
from radiation_ss.filter.estimate import Z95, Band
from radiation_ss.filter.marginal import Cloud, assimilate, believable, predict, transition

MOST_MEMBERS = 40  # enough for a band, and 60 000 samples still fit into memory


def smoothed_force(engine: MarginalEngine, start: FloatArray, y: FloatArray, dts: FloatArray,
                   steps: np.ndarray) -> Band:
    """Return the force given the whole record, shape (n, nt), with the parameters as the filter left them.

    Given the parameters the smoother is linear, so all members share its gains, as they share the filter's.

    Parameters
    ----------
    engine : MarginalEngine
        After its run.
    start : ndarray, shape (m + 4 n, m + 4 n)
        Covariance before the first sample.
    y : ndarray, shape (nt, 4 n)
    dts, steps : ndarray, shape (nt,)
        As `MarginalEngine.advance` takes them.
    """
    plan, members = engine.plan, engine.cloud.members
    few = np.linspace(0, members - 1, min(members, MOST_MEMBERS)).astype(int)
    theta = engine.cloud.theta[:, [*few, members, members + 1]]
    none = np.zeros(y.shape[1], dtype=np.int64)
    cloud = Cloud(theta, np.zeros((start.shape[0], theta.shape[1])), start.copy(), none,
                  np.full(y.shape[1], np.nan), none)
    # Per sample: the members before and after it, P before and after it, and the transition that led to it.
    path: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]] = []
    F, dt_of_F = np.eye(start.shape[0]), np.nan
    for sample, dt, count in zip(y, dts, steps):
        if count:
            if dt / count != dt_of_F:
                F, dt_of_F = transition(plan, engine.force.A, theta[:, -2], dt / count), dt / count
            predict(plan, engine.force.A, engine.q, cloud, dt / count, int(count))
        before, P_before = cloud.z, cloud.P.copy()
        cloud.z = before.copy()
        assimilate(engine.H, cloud, sample, engine.r, believable(engine.H, cloud, sample, engine.r, engine.gate), False)
        jump = np.linalg.matrix_power(F, int(count))
        path.append((before, cloud.z[:, :-1], P_before, cloud.P.copy(), jump))
    return _backward(path, slice(plan.m + 2 * plan.n, None, 2))


def _backward(path: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]], rows: slice) -> Band:
    _, z, _, P, _ = path[-1]
    mean, std = [], []
    for k in range(len(path) - 1, -1, -1):
        if k < len(path) - 1:
            ahead_z, _, ahead_P, _, F = path[k + 1]
            _, here, _, P_here, _ = path[k]
            # Scaled to a correlation; it can be singular to rounding, for the memory has no noise of its own.
            d = np.sqrt(np.diag(ahead_P))
            right = (F @ P_here) / d[:, None]
            gain = (np.linalg.lstsq(ahead_P / np.outer(d, d), right, rcond=1e-14)[0] / d[:, None]).T
            z = here + gain @ (z - ahead_z[:, :-1])
            P = P_here + gain @ (P - ahead_P) @ gain.T
        mean.append(z[rows, -1])
        std.append(np.sqrt(z[rows, :-1].var(axis=1, ddof=1) + np.maximum(np.diag(P)[rows], 0.0)))
    centre, reach = np.array(mean[::-1]).T, Z95 * np.array(std[::-1]).T
    return Band(centre, centre - reach, centre + reach)
