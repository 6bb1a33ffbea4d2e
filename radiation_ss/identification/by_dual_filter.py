"""The paper's dual filter behind `identify`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.estimate import Estimate
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.study import Findings, Study
from radiation_ss.inference.parameters import Block, Parametrisation, relative_spread
from radiation_ss.inference.subsystems import subsystems

SEVERAL = ("the dual filter takes one record at a time: the parameters are those of record {}, which told most")


def entrywise(model: Model, prior: float) -> Parametrisation:
    """Return the dual filter's own parametrisation: each entry a polynomial fraction with poles of its own."""
    parts = subsystems(model.fit)
    blocks = tuple(Block(((j, k),), order, "polynomial", 0, start, (0,))
                   for (j, k), order, start in zip(parts.entries, parts.orders, parts.offsets))
    std = np.abs(parts.theta)
    for block, poles in zip(blocks, parts.poles(parts.theta)):
        own = slice(block.start, block.start + 2 * block.order)
        alone = replace(block, start=0, entries=((0, 0),))
        std[own] *= prior / relative_spread(alone, parts.theta[own], std[own], poles)
    return Parametrisation(model.dofs, np.array(model.A_inf), blocks, parts.theta, std, parts.names)


def relative_prior(form: Parametrisation) -> float:
    """Return one relative standard deviation of the coefficients for all entries, as the dual filter takes it."""
    used = np.abs(form.mean) > 0.0
    return float(np.median(form.std[used] / np.abs(form.mean[used])))


def by_dual_filter(study: Study) -> Findings:
    """Return what the dual filter finds from each record; the parameters of the record that told most."""
    prior = relative_prior(study.form)
    runs = {record.name: DualEnKF(study.model, seed=study.seed, points=study.given_points, prior=prior,
                                  point_noise=study.point_tolerance, n_ensemble=max(100, study.draws // 2)).run(record)
            for record in study.records}
    best = min(runs, key=lambda name: _spread(runs[name]))
    said = dict.fromkeys(text for run in runs.values() for text in run.warnings)
    if len(runs) > 1:
        said[SEVERAL.format(best)] = None
    force = {name: ForceEstimate(run.time, run.force.mean, run.force.lower, run.force.upper)
             for name, run in runs.items()}
    changes = {name: {"change": _change(run)} for name, run in runs.items()}
    return Findings(_standardised(study, runs[best]), {"force": changes}, tuple(said), force=force)


def _spread(run: Estimate) -> float:
    return float(np.mean([p.std / p.prior_std for p in run.parameters.values() if p.prior_std > 0.0]))


def _change(run: Estimate) -> float:
    """Return how far the force is from that of parameters left at their start, relative to its rms."""
    nothing, size = run.baseline["force"], np.sqrt(np.mean(run.force.mean**2))
    return float(np.sqrt(np.mean((run.force.mean - nothing) ** 2)) / size)


def _standardised(study: Study, run: Estimate) -> FloatArray:
    """Return the ensemble's members as standardised parameters u, shape (members, d_u)."""
    form = study.form
    return np.asarray((run.members.T - form.mean)[:, form.active] / form.std[form.active])
