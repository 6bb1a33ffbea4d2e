"""The spectral method: radiation memory, sea and exciting force from motion only."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.identification.channels import known_force, motion_channels, thinned
from radiation_ss.filter.identification.force_smoother import ForceModel, smooth_force
from radiation_ss.filter.identification.haskind import relation
from radiation_ss.filter.identification.posterior import Likelihood, Peak, Target, find_peak
from radiation_ss.filter.identification.prediction_error import motion_likelihoods
from radiation_ss.filter.identification.relation_score import doubts, score_relation
from radiation_ss.filter.identification.result import Band, ForceEstimate
from radiation_ss.filter.identification.sea import BASIC
from radiation_ss.filter.identification.spectral import (
    HIGHEST,
    SpectralLikelihood,
    rigid_impedance,
    spectral_likelihood,
)
from radiation_ss.filter.identification.study import Findings, Inference, Study
from radiation_ss.simulation.record import Record

FORCE_DRAWS = 16
RELUCTANCE = 3.0                    # log odds against a second system of waves
SECOND_PERIODS = (0.65, 1.5)      # where a second system of waves is looked for, over the first's period
FORCE_GRID = 400            # frequencies of the smoother's spectral integral


class FixedBody:
    """A record's likelihood with the body held at one set of radiation parameters: only sea and noise are free."""

    def __init__(self, part: SpectralLikelihood, u: FloatArray) -> None:
        self.part, self.u, self.size = part, u, part.size

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood."""
        return self.part.value(self.u, v)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information in v."""
        value, gradient, fisher = self.part.local(self.u, v)
        n = self.u.size
        return value, gradient[n:], fisher[n:, n:]


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
    parts, start = choose_systems(study, parts, decays, start)
    inference = study.infer([*parts, *decays], start)
    u, offset = inference.draws[:, :study.n_u], study.n_u
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    gains, changes = {}, {}
    for part, record, (v0, value0) in zip(parts, runs, nothing):
        v = inference.draws[:, offset:offset + part.size]
        name = record.name
        sea[name] = describe_sea(part, v)
        force[name] = estimate_force(part, u, v)
        single = replace(part, sea=replace(part.sea, two_systems=False))
        idle = estimate_force(single, np.zeros((1, study.n_u)), v0[None])
        mode = inference.peak.phi
        gains[name] = part.value(mode[:study.n_u], mode[offset:offset + part.size]) - value0
        changes[name] = compare_forces(study, record, force[name], idle)
        offset += part.size
    relation_test = score_relation(study, parts, inference)
    baseline = {"log_likelihood_gain": gains, "force": changes, "haskind_test": relation_test}
    return Findings(u, baseline, (*warnings, *doubts(relation_test), *_effective_warning(inference)), sea, force,
                    inference.share)


def do_nothing(part: SpectralLikelihood, n_u: int) -> tuple[FloatArray, float]:
    """Return the most probable sea and noise with the body at the prior mean, and the log likelihood there."""
    u = np.zeros(n_u)
    peak = find_peak(Target(0, [FixedBody(part, u)], lambda _: True), np.zeros(part.size))
    return peak.phi, part.value(u, peak.phi)


def choose_systems(study: Study, parts: list[SpectralLikelihood], others: list[Likelihood],
                   start: FloatArray) -> tuple[list[SpectralLikelihood], FloatArray]:
    """Return the likelihoods with one or two wave systems in each sea, by evidence, and the parameters v to start from.

    The evidence is Laplace's, at the mode of body and all seas; a second system is looked for at shorter and longer
    periods with the body of that mode.
    """
    n = study.n_u
    best = find_peak(study.target([*parts, *others]), np.concatenate([np.zeros(n), start]))
    for i, part in enumerate(parts):
        offset = n + sum(item.size for item in parts[:i])
        two = replace(part, sea=replace(part.sea, two_systems=True))
        found = _second_system(two, best.phi[:n], best.phi[offset:offset + part.size])
        if found is None:
            continue
        tried = [*parts[:i], two, *parts[i + 1:]]
        try:
            peak = find_peak(study.target([*tried, *others]),
                             np.concatenate([best.phi[:offset], found, best.phi[offset + part.size:]]))
        except SolverError:
            continue
        if _evidence(peak) > _evidence(best) + RELUCTANCE:
            parts, best = tried, peak
    return parts, best.phi[n:]


def _second_system(two: SpectralLikelihood, u: FloatArray, v: FloatArray) -> FloatArray | None:
    """Return the most probable sea with two systems for a fixed body, from the one with one system; None if none is."""
    target, best = Target(0, [FixedBody(two, u)], lambda _: True), None
    for period in SECOND_PERIODS:
        start = np.concatenate([v[:BASIC], two.sea.standardised_second(0.3, period), v[BASIC:]])
        try:
            peak = find_peak(target, start)
        except SolverError:     # no second system there
            continue
        best = peak if best is None or peak.value > best.value else best
    return None if best is None else best.phi


def _evidence(peak: Peak) -> float:
    """Return Laplace's log evidence up to a constant; the prior is standard normal in every parameter."""
    return peak.value - 0.5 * float(np.linalg.slogdet(peak.fisher)[1])


def describe_sea(part: SpectralLikelihood, v: FloatArray) -> dict[str, Any]:
    """Return Hs, Tp, gamma of the JONSWAP part and the whole spectrum, with bands, of draws v."""
    heights, periods, peaks = part.sea.natural(v)
    first = part.coefficients[0]
    omega = np.linspace(first.omega[0], first.omega[-1], 80)
    S = part.sea.density(v, omega)
    whole = 4.0 * np.sqrt(np.trapezoid(S, omega, axis=1))
    noise = np.sqrt(part.noise(v)) * part.channels.rms
    return {"Hs": Band.of(whole), "Tp": Band.of(periods), "gamma": Band.of(peaks), "Hs_jonswap": Band.of(heights),
            "omega": omega, "S": Band.of(S), "noise_std": {label: Band.of(noise[:, i])
                                                          for i, label in enumerate(part.channels.labels)},
            "systems": 2 if part.sea.two_systems else 1, "relation": part.haskind[0].source}


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


def estimate_force(part: SpectralLikelihood, u: FloatArray, v: FloatArray) -> ForceEstimate:
    """Return the force of a record over (some of) the draws u, v."""
    pick = np.unique(np.linspace(0, u.shape[0] - 1, min(FORCE_DRAWS, u.shape[0])).astype(int))
    channels = part.channels
    y = (channels.y - np.nanmean(channels.y, axis=0)) / channels.rms
    return smooth_force([force_model(part, u[i], v[i]) for i in pick], y, channels.start, channels.dt,
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


def _effective_warning(inference: Inference) -> tuple[str, ...]:
    if inference.effective >= 50.0:
        return ()
    return (f"the posterior is represented by only {inference.effective:.0f} effective draws; bands may be too narrow",)
