"""The wave excitation force by all of a record: fixed-interval smoothing (Rauch, Tung and Striebel 1965)."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.default_engine import DefaultEngine
from radiation_ss.filter.estimate import Z95, Band
from radiation_ss.filter.marginal import FilterState, advance, assimilate, transition, usable
from radiation_ss.filter.plan import Samples
from radiation_ss.inference.kalman import Gaussian, smooth


def smoothed_force(engine: DefaultEngine, start: FloatArray, samples: Samples, most: int = 40) -> Band:
    """Return the force given the whole record, shape (n, nt), with the parameters as the filter left them.

    Given the parameters the smoother is linear, so all members share its gains, as they share the filter's.

    Parameters
    ----------
    engine : DefaultEngine
        After its run.
    start : ndarray, shape (m + 4 n, m + 4 n)
        Covariance before the first sample.
    samples : Samples
    most : int
        Members used at most: enough for a band, and 60 000 samples still fit into memory.
    """
    system, rules, members = engine.system, engine.rules, engine.state.members
    few = np.linspace(0, members - 1, min(members, most)).astype(int)
    theta = engine.state.theta[:, [*few, members, members + 1]]
    state = FilterState.at_rest(theta, start, samples.y.shape[1])
    # Per sample: the state before and after it, and the transition that led to it.
    path: list[tuple[Gaussian, Gaussian, FloatArray]] = []
    F, dt_of_F = np.eye(start.shape[0]), np.nan
    for y, dt, count in zip(*samples):
        if count:
            if dt / count != dt_of_F:
                F, dt_of_F = transition(system, theta[:, -2], dt / count), dt / count
            advance(system, state, dt / count, int(count))
        before = Gaussian(state.z[:, :-1].copy(), state.P.copy())
        assimilate(system, state, y, usable(system, state, y, rules), False)
        path.append((before, Gaussian(state.z[:, :-1].copy(), state.P.copy()),
                     np.linalg.matrix_power(F, int(count))))
    rows = slice(system.plan.m + 2 * system.plan.n, None, 2)
    here = path[-1][1]
    bands = [_force(here, rows)]
    for (ahead, _, F), (_, filtered, _) in zip(path[:0:-1], path[-2::-1]):
        here = smooth(filtered, ahead, here, F)
        bands.append(_force(here, rows))
    centre, reach = (np.array(part[::-1]).T for part in zip(*bands))
    return Band(centre, centre - Z95 * reach, centre + Z95 * reach)


def _force(state: Gaussian, rows: slice) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the force: spread of the members and covariance given the parameters."""
    spread = state.mean[rows, :-1].var(axis=1, ddof=1) + np.maximum(np.diag(state.cov)[rows], 0.0)
    return state.mean[rows, -1], np.sqrt(spread)
