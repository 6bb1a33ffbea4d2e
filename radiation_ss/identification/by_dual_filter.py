"""The paper's dual filter behind `identify`."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.estimate import Estimate
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.study import Findings, Study
from radiation_ss.inference.parameters import Block, Parametrisation
from radiation_ss.inference.subsystems import subsystems

SEVERAL = ("the dual filter takes one record at a time: the parameters are those of record {}, which told most")


def entrywise(model: Model, prior: float) -> Parametrisation:
    """Return the dual filter's own parametrisation: each entry a polynomial fraction with poles of its own."""
    parts = subsystems(model.fit)
    blocks = tuple(Block(((j, k),), order, "polynomial", 0, start, (0,))
                   for (j, k), order, start in zip(parts.entries, parts.orders, parts.offsets))
    return Parametrisation(model.dofs, np.array(model.A_inf), blocks, parts.theta, prior * np.abs(parts.theta),
                           parts.names)


def by_dual_filter(study: Study) -> Findings:
    """Return what the dual filter finds from each record; the parameters of the record that told most."""
    runs = {record.name: DualEnKF(study.model, seed=study.seed, points=study.given_points, prior=study.prior,
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
