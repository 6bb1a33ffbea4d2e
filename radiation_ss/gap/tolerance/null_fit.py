"""The fit without effects, and the noise that it leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.fitting import Fit, fit, fit_free_noise, refit
from radiation_ss.gap.posterior.noise import floor_of, white
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import Setting, channel_omegas
from radiation_ss.gap.tolerance.tolerated import discrepancy


def tolerant(setting: Setting) -> tuple[Fit, tuple[float, ...]]:
    """Converge the model without effects, free in what its tolerances allow that no nominal number describes, too."""
    bare, floors = null_fit(setting)
    columns, count = discrepancy(bare, floors, np.random.default_rng(0))
    wider = replace(setting, discrepancy=columns, tolerated=count)
    if not wider.unnamed:
        return bare, floors
    problem = Problem(wider)
    found = fit_free_noise(problem, floors, bare.noise, problem.extend(bare.q, bare.problem))
    return (found, floors_of(wider, found)) if found.settled else (bare, floors)


def null_fit(setting: Setting) -> tuple[Fit, tuple[float, ...]]:
    """Converge the model without effects, its noise as large as its own residual."""
    problem = Problem(setting)
    channels = [c for record in setting.records for c in record.channels]
    noise = white([0.1 * max(float(np.std(c.value)), 1e-300) for c in channels])
    rough = fit(problem, noise, np.zeros(problem.size), tolerance=0.1)
    found = fit_free_noise(problem, floors_of(setting, rough), noise, rough.q)
    if not found.converged:  # the noise was still shrinking: go on under the last one
        found = refit(found, found.noise, passes=80)
    if not found.settled:
        raise SolverError("the fit without effects did not converge")
    return found, floors_of(setting, found)


def nominal_fit(setting: Setting, null: Fit) -> Fit:
    """Fit only the starts; the model stays as given."""
    bare = Problem(replace(setting, nominal=(), discrepancy=()))
    return fit(bare, null.noise, bare.extend(null.q, null.problem))


def floors_of(setting: Setting, found: Fit) -> tuple[float, ...]:
    """Return the white noise of each channel, of alike channels in different records together."""
    channels = [c for record in setting.records for c in record.channels]
    own = [floor_of(c, r, w) for c, r, w in zip(channels, found.point.residuals, channel_omegas(setting))]
    groups: dict[tuple[int, str], list[float]] = {}
    for channel, value in zip(channels, own):
        groups.setdefault((channel.dof, channel.quantity), []).append(value)
    return tuple(max(value, 0.1 * float(np.median(groups[c.dof, c.quantity]))) for c, value in zip(channels, own))
