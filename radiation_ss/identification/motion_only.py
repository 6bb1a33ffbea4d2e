"""The spectral method: radiation memory, sea and exciting force from motion only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.identification.channels import known_force, motion_channels, thinned
from radiation_ss.identification.force_known import law_warnings
from radiation_ss.identification.force_smoother import ForceModel, smooth_force
from radiation_ss.identification.haskind import relation
from radiation_ss.identification.nonlinear_score import DOUBT, score_nonlinear
from radiation_ss.identification.prediction_error import MotionLikelihood, motion_likelihoods
from radiation_ss.identification.result import Band, ForceEstimate
from radiation_ss.identification.sea_structure import Branch, family_probabilities, mixed, sea_mode, structures
from radiation_ss.identification.spectral import SpectralLikelihood, receptance_times_X, spectral_likelihood
from radiation_ss.identification.study import Findings, Study, cautious
from radiation_ss.records.record import Record

FORCE_DRAWS = 16
FORCE_GRID = 400            # frequencies of the smoother's spectral integral

Draws: TypeAlias = tuple[SpectralLikelihood, FloatArray, FloatArray]     # a record's likelihood, body and sea draws


def by_motion_only(study: Study) -> Findings:
    """Return what the spectral method finds: one body, one sea for each record; decay tests join in with zero force."""
    parts, warnings, decays = [], [], list[MotionLikelihood]()
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
    branches = mixed(study, structures(study, parts, decays), decays)
    best = branches[0]
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    gains, changes = {}, {}
    for i, record in enumerate(runs):
        name, shares = record.name, [split(study.n_u, branch, i) for branch in branches]
        sea[name] = describe_sea([(part, v) for part, _, v in shares], family_probabilities(branches, i))
        warnings += sea_warnings(name, sea[name])
        force[name] = estimate_force(shares)
        idle = sea_mode(parts[i], np.zeros(study.n_u))
        offset = study.n_u + sum(part.size for part in best.parts[:i])
        mode, v = best.inference.peak.phi, slice(offset, offset + best.parts[i].size)
        gains[name] = (float(best.parts[i].values(mode[None, :study.n_u], mode[None, v])[0])
                       - float(parts[i].values(np.zeros((1, study.n_u)), idle.phi[None])[0]))
        changes[name] = compare_forces(study, record, force[name], estimate_force(
            [(parts[i], np.zeros((1, study.n_u)), idle.phi[None])]))
    decay_test = score_nonlinear(best.inference.target, best.inference.peak, decays)
    asked = [name for name, row in decay_test.items() if row["p"] < DOUBT / len(decay_test)]
    warnings += law_warnings(decay_test, asked)
    baseline = {"log_likelihood_gain": gains, "force": changes, "nonlinearity_test": decay_test}
    u = np.vstack([branch.draws[:, :study.n_u] for branch in branches])
    share = sum(branch.probability * branch.inference.share for branch in branches)
    bands = tuple(part.band for part in parts)
    return Findings(u, baseline, tuple(warnings), sea, force, share, cautious(study, u, bands), bands)


def sea_warnings(name: str, sea: dict[str, Any]) -> list[str]:
    """Return what a user must know of a sea that is not JONSWAP-like."""
    free = sea["families"]["free"] + sea["families"]["lumpy"]
    if free < 0.5:
        return []
    return [f"record {name}: the sea is not JONSWAP-like (free or lumpy with a probability of {free:.0%}); motion "
            "alone says little of the body in such a sea, and the answer stays near the model"]


def split(n_u: int, branch: Branch, number: int) -> Draws:
    """Return a record's likelihood, body and nuisance draws in one structure of the seas."""
    part, offset = branch.parts[number], n_u + sum(item.size for item in branch.parts[:number])
    return part, branch.draws[:, :n_u], branch.draws[:, offset:offset + part.size]


def describe_sea(branches: Sequence[tuple[SpectralLikelihood, FloatArray]],
                 families: Mapping[str, float]) -> dict[str, Any]:
    """Return the spectrum, and Hs, Tp, gamma of its JONSWAP part, with bands, of draws v in each structure."""
    part = branches[0][0]
    first, labels = part.coefficients[0], part.channels.labels
    omega = np.linspace(first.omega[0], first.omega[-1], 80)
    rows = [np.array(item.sea.natural(v)) for item, v in branches if not item.sea.free]
    systems = dict(zip(("Hs_jonswap", "Tp", "gamma"), map(Band.of, np.hstack(rows)))) if rows else {}
    S = np.concatenate([item.sea.density(v, omega) for item, v in branches])
    whole = 4.0 * np.sqrt(np.trapezoid(S, omega, axis=1))
    noise = np.concatenate([np.sqrt(item.noise(v)) * part.channels.rms for item, v in branches])
    return {"Hs": Band.of(whole), **systems, "omega": omega, "S": Band.of(S),
            "noise_std": {label: Band.of(noise[:, i]) for i, label in enumerate(labels)},
            "families": dict(families), "two_systems": families["two systems"], "relation": part.haskind[0].source}


def force_model(part: SpectralLikelihood, u: FloatArray, v: FloatArray) -> ForceModel:
    """Return the spectra of one draw on the smoother's grid."""
    channels = part.channels
    omega = np.linspace(0.0, 1.6 * part.settings.highest * channels.frequency, FORCE_GRID + 1)
    w = np.maximum(omega, omega[1])
    X, motion = receptance_times_X(part.model, part.form, u, w, relation(part.model, w)[0])
    factors = (1j * w[:, None]) ** channels.derivative / channels.rms
    low, high = (float(f(f(item.omega[[0, -1]]) for item in part.coefficients)) for f in (min, max))
    # Beyond the bins that are used the sea is not known to be there.
    sea = part.sea.density(v, omega) * np.exp(-np.maximum(np.maximum(low - omega, omega - high), 0.0) * 20.0 / low)
    return ForceModel(omega, X, motion[:, channels.dof] * factors, sea, part.noise(v), part.unexplained(v))


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
