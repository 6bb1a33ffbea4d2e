"""The dual ensemble Kalman filter, with the paper's preset or without, behind `identify`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.estimate import Estimate
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.study import Findings, Study
from radiation_ss.inference.parameters import Block, Parametrisation, relative_spread
from radiation_ss.inference.subsystems import subsystems


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


def by_dual_filter(study: Study) -> Findings:
    """Return what the dual filter finds from each record; the parameters of the record that told most."""
    form, rules = study.form, study.rules
    used = form.std > 0.0
    # One relative standard deviation for all coefficients, as the filter takes it.
    options = {"prior": float(np.median(form.std[used] / np.abs(form.mean[used]))), "points": study.given_points,
               "point_noise": rules.point_tolerance, "preset": rules.preset,
               "n_ensemble": 100 if rules.preset else max(100, study.draws // 2)}
    runs = {record.name: DualEnKF(study.model, seed=study.seed, **options | dict(rules.filter)).run(record)
            for record in study.records}
    best = min(runs, key=lambda name: float(np.mean([p.std / p.prior_std for p in runs[name].parameters.values()
                                                     if p.prior_std > 0.0])))
    said = dict.fromkeys(text for run in runs.values() for text in run.warnings)
    if len(runs) > 1:
        said[f"the dual filter takes one record at a time: the parameters are those of record {best}, which told most"
             ] = None
    force = {name: ForceEstimate(run.time, run.force.mean, run.force.lower, run.force.upper)
             for name, run in runs.items()}
    changes = {name: {"change": change(run)} for name, run in runs.items()}
    u = (runs[best].members.T - form.mean)[:, form.active] / form.std[form.active]
    return Findings(np.asarray(u, dtype=np.float64), {"force": changes}, tuple(said), force=force)


def change(run: Estimate) -> float:
    """Return how far the force is from that of parameters left at their start, relative to its rms."""
    away, size = run.force.mean - run.baseline["force"], np.sqrt(np.mean(run.force.mean**2))
    return float(np.sqrt(np.mean(away**2)) / size)
