"""The spectral method: radiation memory, sea and exciting force from motion only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.identification.channels import known_force, motion_channels, thinned
from radiation_ss.identification.force_smoother import ForceModel, smooth_force
from radiation_ss.identification.haskind import relation
from radiation_ss.identification.nonlinear_score import nonlinear_doubts, score_nonlinear
from radiation_ss.identification.posterior import LEAST_EFFECTIVE, Likelihood
from radiation_ss.identification.prediction_error import motion_likelihoods
from radiation_ss.identification.relation_score import doubts, score_relation
from radiation_ss.identification.result import Band, ForceEstimate
from radiation_ss.identification.sea_structure import Branch, do_nothing, mixed, structures
from radiation_ss.identification.spectral import (
    HIGHEST,
    NOISE,
    SpectralLikelihood,
    rigid_impedance,
    spectral_likelihood,
)
from radiation_ss.identification.study import Findings, Study
from radiation_ss.inference.scales import noise_of
from radiation_ss.records.record import Record

FORCE_DRAWS = 16
UNSHOWN = 3.0               # times the noise that a column shows: more is no noise
FORCE_GRID = 400            # frequencies of the smoother's spectral integral
COUPLED = ("several degrees of freedom in one sea: the ratio of their motions is known to the sensor noise, and the "
           "likelihood is not as exact as that; bands are too narrow (B was covered in 80 % at a nominal 95 %), and "
           "Haskind's relation is not tested")

Draws: TypeAlias = tuple[SpectralLikelihood, FloatArray, FloatArray]     # a record's likelihood, body and sea draws


def by_motion_only(study: Study) -> Findings:
    """Return what the spectral method finds: one body, one sea for each record; decay tests join in with zero force."""
    parts, warnings, decays = [], [], list[Likelihood]()
    runs = [record for record in study.records if record.kind != "decay"]
    if not runs:
        raise InputError("records: only decay tests; use method 'prediction-error'")
    for record in study.records:
        if record.kind == "decay":
            channels, known = motion_channels(study.model, record), known_force(study.model, record)
            assert known is not None
            decays += motion_likelihoods(study.model, study.form, *thinned(channels, known[0]))
            continue
        part, said = spectral_likelihood(study.model, study.form, motion_channels(study.model, record))
        parts.append(part)
        warnings += [text for text in said if text not in warnings]
    # Sea and noise first, with the body at its prior: a start from which the joint climb is short.
    nothing = [do_nothing(part, study.n_u) for part in parts]
    start = np.concatenate([v for v, _ in nothing] + [np.zeros(part.size) for part in decays])
    branches = mixed(study, structures(study, parts, decays, start), decays, start)
    best = branches[0]
    refuse_wrong_mode(best)
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    gains, changes = {}, {}
    for i, (record, (v0, value0)) in enumerate(zip(runs, nothing)):
        name, shares = record.name, [split(study.n_u, branch, i) for branch in branches]
        sea[name] = describe_sea([(part, v) for part, _, v in shares])
        force[name] = estimate_force(shares)
        idle = estimate_force([(parts[i], np.zeros((1, study.n_u)), v0[None])])
        offset = study.n_u + sum(part.size for part in best.parts[:i])
        mode = best.inference.peak.phi
        gains[name] = best.parts[i].value(mode[:study.n_u], mode[offset:offset + best.parts[i].size]) - value0
        changes[name] = compare_forces(study, record, force[name], idle)
    coupled = any(part.channels.count > 1 for part in parts)
    relation_test = {} if coupled else score_relation(study, list(best.parts), best.inference)
    warnings += [COUPLED] if coupled else []
    decay_test = score_nonlinear(best.inference.target, best.inference.peak, decays)
    warnings += [*doubts(relation_test), *nonlinear_doubts(decay_test)]
    baseline = {"log_likelihood_gain": gains, "force": changes, "haskind_test": relation_test,
                "nonlinearity_test": decay_test}
    u = np.vstack([branch.draws[:, :study.n_u] for branch in branches])
    effective = sum(branch.probability * branch.inference.effective for branch in branches)
    share = sum(branch.probability * branch.inference.share for branch in branches)
    return Findings(u, baseline, (*warnings, *_effective_warning(effective)), sea, force, share)


def refuse_wrong_mode(branch: Branch) -> None:
    """Raise a SolverError where the mode calls noise what the columns of coupled motions do not show as noise.

    In one long-crested sea two motions' ratio at a frequency is known to the noise. A climb that is caught far from the
    truth leaves what it cannot explain of that ratio to the noise of a sensor.
    """
    target = branch.inference.target
    for part, v in zip(target.likelihoods, target.parts(branch.inference.peak.phi)):
        if not isinstance(part, SpectralLikelihood) or part.channels.count == 1:
            continue
        shown = np.array([noise_of(column[np.isfinite(column)]) for column in part.channels.y.T]) / part.channels.rms
        found = np.sqrt(part.noise(v))
        worst = int(np.argmax(found / np.maximum(shown, NOISE)))
        if found[worst] > UNSHOWN * max(shown[worst], NOISE):
            raise SolverError(
                f"record {part.channels.name}: the most probable parameters that were reached leave "
                f"{found[worst]:.0%} of {part.channels.labels[worst]} to sensor noise, the column "
                f"shows {shown[worst]:.1%}; they are not the most probable ones. Give a model nearer to the body, a "
                "smaller prior, one degree of freedom at a time, or the force (method 'prediction-error')")


def split(n_u: int, branch: Branch, number: int) -> Draws:
    """Return a record's likelihood, body and nuisance draws in one structure of the seas."""
    part, offset = branch.parts[number], n_u + sum(item.size for item in branch.parts[:number])
    return part, branch.draws[:, :n_u], branch.draws[:, offset:offset + part.size]


def describe_sea(branches: Sequence[tuple[SpectralLikelihood, FloatArray]]) -> dict[str, Any]:
    """Return Hs, Tp, gamma of the JONSWAP part and the whole spectrum, with bands, of draws v in each structure."""
    part = branches[0][0]
    first, labels = part.coefficients[0], part.channels.labels
    omega = np.linspace(first.omega[0], first.omega[-1], 80)
    heights, periods, peaks = (np.concatenate(rows) for rows in zip(*(item.sea.natural(v) for item, v in branches)))
    S = np.concatenate([item.sea.density(v, omega) for item, v in branches])
    whole = 4.0 * np.sqrt(np.trapezoid(S, omega, axis=1))
    noise = np.concatenate([np.sqrt(item.noise(v)) * part.channels.rms for item, v in branches])
    two = sum(v.shape[0] for item, v in branches if item.sea.two_systems) / S.shape[0]
    return {"Hs": Band.of(whole), "Tp": Band.of(periods), "gamma": Band.of(peaks), "Hs_jonswap": Band.of(heights),
            "omega": omega, "S": Band.of(S), "noise_std": {label: Band.of(noise[:, i])
                                                          for i, label in enumerate(labels)},
            "systems": 2 if two > 0.5 else 1, "two_systems": two, "relation": part.haskind[0].source}


def force_model(part: SpectralLikelihood, u: FloatArray, v: FloatArray) -> ForceModel:
    """Return the spectra of one draw on the smoother's grid."""
    model, channels = part.model, part.channels
    omega = np.linspace(0.0, 1.6 * HIGHEST * channels.frequency, FORCE_GRID + 1)
    w = np.maximum(omega, omega[1])
    K = part.form.K(part.form.theta(u), w)
    X = relation(model, w)[0].exciting_force(np.einsum("wjj->wj", K.real))
    impedance = rigid_impedance(model, w) + 1j * w[:, None, None] * K
    motion = np.linalg.solve(impedance, X[:, :, None])[:, :, 0]
    factors = (1j * w[:, None]) ** channels.derivative / channels.rms
    return ForceModel(omega, X, motion[:, channels.dof] * factors, part.sea.density(v, omega), part.noise(v))


def estimate_force(branches: Sequence[Draws]) -> ForceEstimate:
    """Return the force of a record over (some of) the draws u, v in each structure."""
    rows = [(part, u[i], v[i]) for part, u, v in branches for i in range(u.shape[0])]
    pick = np.unique(np.linspace(0, len(rows) - 1, min(FORCE_DRAWS, len(rows))).astype(int))
    channels = branches[0][0].channels
    y = (channels.y - np.nanmean(channels.y, axis=0)) / channels.rms
    return smooth_force([force_model(*rows[i]) for i in pick], y, channels.start, channels.dt,
                        2.0 * np.pi / channels.frequency)


def compare_forces(study: Study, record: Record, found: ForceEstimate, idle: ForceEstimate) -> dict[str, float]:
    """Return how far the force is from doing nothing's, and both errors where the record carries the true force."""
    size = np.sqrt(np.mean(found.mean**2))
    out = {"change": float(np.sqrt(np.mean((found.mean - idle.mean) ** 2)) / size)}
    measured = record.get("force", study.model.dofs)
    if measured is not None and measured.shape == found.mean.shape:
        good = np.isfinite(measured)
        rms = np.sqrt(np.mean(measured[good] ** 2))
        for key, estimate in (("do_nothing_error", idle), ("identified_error", found)):
            out[key] = float(np.sqrt(np.mean((estimate.mean - measured)[good] ** 2)) / rms) if rms > 0.0 else np.nan
    return out


def _effective_warning(effective: float) -> tuple[str, ...]:
    if effective >= LEAST_EFFECTIVE:
        return ()
    return (f"the posterior is represented by only {effective:.0f} effective draws; bands were widened for it, but may "
            "still be too narrow",)
