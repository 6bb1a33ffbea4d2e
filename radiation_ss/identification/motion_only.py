"""The method "spectral": memory, sea and exciting force from motion only, by whole records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.filter.estimate import Band
from radiation_ss.identification.channels import known_force, motion_channels, thinned
from radiation_ss.identification.families import Race, mixed, sea_mode, structures
from radiation_ss.identification.force import ForceSpectra, receptance_times_X, relation, smooth_force
from radiation_ss.identification.motion_likelihood import MotionLikelihood, motion_likelihoods
from radiation_ss.identification.prediction_error import law_warnings, score_laws
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.spectral import SpectralLikelihood, spectral_likelihood
from radiation_ss.identification.study import Findings, Study, cautious
from radiation_ss.records.record import Record

LEFT_IN = "motion alone leaves it in A and B, and its size is the first step from a linear fit"
Seas: TypeAlias = Sequence[tuple[SpectralLikelihood, FloatArray]]       # a record's likelihood and draws of its sea


def by_motion_only(study: Study) -> Findings:
    """Return what the spectral method finds: one body, one sea for each record; decay tests join in with zero force."""
    parts, warnings, decays = [], [], list[MotionLikelihood]()
    runs = [record for record in study.records if record.kind != "decay"]
    if not runs:
        raise InputError("records: only decay tests; use method 'prediction-error'")
    for record in study.records:
        channels = motion_channels(study.model, record)
        if record.kind == "decay":
            known = known_force(study.model, record)
            assert known is not None
            decays += motion_likelihoods(study.model, study.form, *thinned(channels, known))
            continue
        part, said = spectral_likelihood(study.model, study.form, channels)
        parts.append(part)
        warnings += [text for text in said if text not in warnings]
    branches = mixed(study, structures(study, parts, decays, Race()), decays)
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    changes = {}
    for i, (record, part) in enumerate(zip(runs, parts)):
        name, seas = record.name, [branch.sea(i) for branch in branches]
        families = dict.fromkeys(part.sea.prior.families, 0.0)
        for branch, (own, _) in zip(branches, seas):
            families[own.sea.name] += branch.probability
        sea[name] = describe_sea(seas, families)
        free = sum(share for family, share in families.items() if "free" in family or "lumpy" in family)
        if free >= 0.5:
            warnings.append(f"record {name}: the sea is not JONSWAP-like (free with a probability of {free:.0%}); "
                            "motion alone says little of the body in such a sea, and the answer stays near the model")
        force[name] = estimate_force([(own, branch.draws[:, :study.n_u], v)
                                      for branch, (own, v) in zip(branches, seas)])
        idle = sea_mode(part, np.zeros(study.n_u)).phi[None]
        changes[name] = compare_forces(study, record, force[name], estimate_force(
            [(part, np.zeros((1, study.n_u)), idle)]))
    best = branches[0]
    if best.structure.apart:
        warnings.append("with a sea of one system in every record no body that is near the model explains the motion: "
                        "the seas repeat or have lines, or the body has what the model lacks (drag), which goes into A "
                        "and B here; the bands do not hold that: run diagnose on records with a known force")
    tests = score_laws(best.target, best.structure.modes[0], decays)
    asked = [name for name, row in tests.items() if row["p"] < study.rules.nonlinear / len(tests)]
    u = np.vstack([branch.draws[:, :study.n_u] for branch in branches])
    share = sum(branch.probability * branch.share for branch in branches)
    bands = tuple(part.band for part in parts)
    return Findings(u, {"force": changes, "nonlinearity_test": tests},
                    (*warnings, *law_warnings(tests, asked, LEFT_IN)), sea, force, share,
                    cautious(study, u, bands), bands)


def describe_sea(seas: Seas, families: dict[str, float]) -> dict[str, Any]:
    """Return the spectrum, and Hs, Tp, gamma of its JONSWAP part, with bands, of the draws in each structure."""
    part = seas[0][0]
    first, labels = part.coefficients[0], part.channels.labels
    omega = np.linspace(first.omega[0], first.omega[-1], 80)
    rows = [np.array(item.sea.natural(v)) for item, v in seas if item.sea.family.systems]
    systems = dict(zip(("Hs_jonswap", "Tp", "gamma"), map(Band.of, np.hstack(rows)))) if rows else {}
    S = np.concatenate([item.sea.density(v, omega) for item, v in seas])
    noise = np.concatenate([np.sqrt(item.noise(v)) * part.channels.rms for item, v in seas])
    return {"Hs": Band.of(4.0 * np.sqrt(np.trapezoid(S, omega, axis=1))), **systems, "omega": omega,
            "S": Band.of(S),
            "noise_std": {label: Band.of(noise[:, i]) for i, label in enumerate(labels)},
            "families": families, "two_systems": families["two systems"], "relation": part.haskind[0].source}


def force_model(part: SpectralLikelihood, u: FloatArray, v: FloatArray, points: int = 400) -> ForceSpectra:
    """Return the spectra of one draw on the smoother's grid."""
    channels = part.channels
    omega = np.linspace(0.0, 1.6 * part.rules.highest * channels.frequency, points + 1)
    w = np.maximum(omega, omega[1])
    X, motion = receptance_times_X(part.model, part.form, u, w, relation(part.model, part.form, w)[0])
    factors = (1j * w[:, None]) ** channels.derivative / channels.rms
    low, high = (float(f(f(item.omega[[0, -1]]) for item in part.coefficients)) for f in (min, max))
    # Beyond the bins that are used the sea is not known to be there.
    sea = part.sea.density(v, omega) * np.exp(-np.maximum(np.maximum(low - omega, omega - high), 0.0) * 20.0 / low)
    return ForceSpectra(omega, X, motion[:, channels.dof] * factors, sea, part.noise(v), part.unexplained(v))


def estimate_force(branches: Sequence[tuple[SpectralLikelihood, FloatArray, FloatArray]],
                   draws: int = 16) -> ForceEstimate:
    """Return the force of a record over (some of) the draws u, v in each structure."""
    rows = [(part, u[i], v[i]) for part, u, v in branches for i in range(u.shape[0])]
    pick = np.unique(np.linspace(0, len(rows) - 1, min(draws, len(rows))).astype(int))
    channels = branches[0][0].channels
    y = (channels.y - np.nanmean(channels.y, axis=0)) / channels.rms
    return smooth_force([force_model(*rows[i]) for i in pick], y, channels)


def compare_forces(study: Study, record: Record, found: ForceEstimate, idle: ForceEstimate) -> dict[str, float]:
    """Return how far the force is from the prior model's, and both errors where the record carries the true force."""
    size = np.sqrt(np.mean(found.mean**2))
    out = {"change": float(np.sqrt(np.mean((found.mean - idle.mean) ** 2)) / size)}
    measured = record.get("force", study.model.dofs)
    if measured is not None and measured.shape == found.mean.shape:
        good = np.isfinite(measured)
        rms = np.sqrt(np.mean(measured[good] ** 2))
        for key, estimate in (("do_nothing_error", idle), ("identified_error", found)):
            out[key] = float(np.sqrt(np.mean((estimate.mean - measured)[good] ** 2)) / rms) if rms > 0.0 else np.nan
    return out
