"""Identification with the force known (measured, a decay's zero, from the elevation): climb, test, attribute, draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.identification.channels import known_elevation, known_force, motion_channels, thinned
from radiation_ss.identification.misfit import misfit_warnings, unsure_force
from radiation_ss.identification.nonlinear_score import DOUBT, departures, score_nonlinear
from radiation_ss.identification.posterior import Likelihood, Peak, find_peak
from radiation_ss.identification.prediction_error import MotionLikelihood, motion_likelihoods, wave_force
from radiation_ss.identification.study import Findings, Inference, Study
from radiation_ss.records.record import Record

MOST_LAWS = 2       # nonlinear laws that are taken into the model
REACH_OF_X = 2.0    # periods at each end of a record where a force from the elevation is wrong


def by_prediction_error(study: Study) -> Findings:
    """Return what the records say when the force is known."""
    parts: list[MotionLikelihood] = []
    warnings, unsure, bands = [], [], []
    for record in study.records:
        new, source = record_likelihoods(study, record)
        if source.startswith("wave elevation"):
            warnings.append(f"record {record.name}: the force comes from the wave elevation by the model's X, which "
                            f"follows the damping by Haskind's relation and may be {study.error_of_X:.0%} off; a "
                            "larger error of X goes into A and B")
        parts += new
        unsure += [unsure_force(record, source)] * len(new)
        bands += [band_with_power(part) for part in new]
    parts, peak, tests, laws = attribute(study, parts, [])
    inference = study.drawn(study.target(parts), [peak])
    centre = inference.draws.mean(axis=0)
    for part, v, (floor, edge) in zip(parts, inference.target.parts(centre)[-len(parts):], unsure):
        warnings += misfit_warnings(part, centre[:study.n_u], v, floor=floor, edge=edge)
    baseline = {**prediction_gaps(study, parts, inference), "nonlinearity_test": tests}
    return Findings(inference.draws[:, :study.n_u], baseline, (*warnings, *law_warnings(tests, laws)),
                    passive=inference.share, bands=tuple(bands))


def record_likelihoods(study: Study, record: Record) -> tuple[list[MotionLikelihood], str]:
    """Return the likelihoods of one record, one for each group of coupled degrees of freedom, and the force's source.

    Raises
    ------
    InputError
        If the force is not known.
    """
    channels, known = motion_channels(study.model, record), known_force(study.model, record)
    if known is not None:
        return motion_likelihoods(study.model, study.form, *thinned(channels, known[0])), known[1]
    elevation = known_elevation(study.model, record)
    if elevation is None:
        raise InputError(f"record {record.name}: the force is not known (no <Dof>_force column, not "
                         "'# kind: decay', no wave_elevation with X in the model); method 'spectral' needs none")
    channels, column = thinned(channels, elevation[:, None])
    trim = min(round(REACH_OF_X * 2.0 * np.pi / channels.frequency / channels.dt), column.shape[0] // 5)
    wave = wave_force(study.model, study.form.own, column[:, 0], channels.dt, channels.frequency, study.error_of_X, trim)
    channels = replace(channels, y=channels.y[trim:-trim], start=channels.start + trim * channels.dt)
    nominal = wave.force(study.form.own, np.zeros(study.n_u), np.zeros(wave.size))
    return motion_likelihoods(study.model, study.form, channels, nominal, wave), "wave elevation and X"


def band_with_power(part: MotionLikelihood, floor: float = 1e-3) -> tuple[float, float]:
    """Return the lowest and highest frequency [rad/s] at which any motion has `floor` of its largest density."""
    y = np.nan_to_num(part.channels.y) / part.channels.rms
    power = np.abs(np.fft.rfft(y * np.hanning(y.shape[0])[:, None], axis=0)) ** 2
    smooth = np.array([np.convolve(column, np.ones(3) / 3.0, mode="same") for column in power.T])
    good = np.flatnonzero((smooth > floor * smooth.max(axis=1, keepdims=True)).any(axis=0))
    spacing = 2.0 * np.pi / (y.shape[0] * part.channels.dt)
    return float(max(good[0], 1) * spacing), float(good[-1] * spacing)


def attribute(study: Study, parts: list[MotionLikelihood], others: Sequence[Likelihood],
              ) -> tuple[list[MotionLikelihood], Peak, dict[str, dict[str, float]], list[str]]:
    """Return the parts with the nonlinear laws that they ask for, the mode, the score tests, and the laws' names.

    A fit of a linear model puts most of a drag down to other parameters. The law with the largest score is made a force
    of unknown strength along the measured motion, and the rest is tested again, so that one law is not named twice.
    """
    target = study.target([*others, *parts])
    peak = find_peak(target, np.zeros(target.size))
    # A force from the elevation is too unsure to be told from a nonlinear law.
    measured = [part for part in parts if part.wave is None]
    tests, laws = score_nonlinear(target, peak, measured), list[str]()
    first = dict(tests)
    while len(laws) < MOST_LAWS:
        left = {name: row for name, row in tests.items() if name not in laws}
        name = min(left, key=lambda item: left[item]["p"], default=None)
        if name is None or left[name]["p"] >= DOUBT / len(left):
            break
        laws.append(name)
        old = target.parts(peak.phi)[-len(parts):]
        new = [with_law(part, peak.phi[:study.n_u], v, name) for part, v in zip(parts, old)]
        head = peak.phi[:peak.phi.size - sum(part.size for part in parts)]
        parts = [part for part, _ in new]
        target = study.target([*others, *parts])
        peak = find_peak(target, np.concatenate([head, *(v for _, v in new)]))
        tests = score_nonlinear(target, peak, [part for part in parts if part.wave is None])
        first |= {key: row for key, row in tests.items() if key not in laws}
    return parts, peak, first, laws


def slot(part: MotionLikelihood) -> int:
    """Return where the last law's strength stands in the nuisance parameters."""
    return part.channels.count + 2 * part.model.n + len(part.extra) - 1


def with_law(part: MotionLikelihood, u: FloatArray, v: FloatArray, name: str) -> tuple[MotionLikelihood, FloatArray]:
    """Return the likelihood with a law as a force of unknown strength, and its nuisance parameters."""
    found = next((item for item in departures(part, u, v, share=1.0) if item.name == name), None)
    if found is None:
        return part, v
    new = replace(part, extra=(*part.extra, found.force), units=(*part.units, found.unit))
    new.__dict__["force_scale"] = part.force_scale
    return new, np.insert(v, slot(new), 0.0)


def law_warnings(tests: dict[str, dict[str, float]], laws: Sequence[str]) -> tuple[str, ...]:
    """Return a warning for each nonlinear law that the records ask for."""
    said = []
    for name in laws:
        unit = "N s^2/m^2 or N m s^2" if name.startswith("quadratic drag") else "N/m^3 or N m"
        row = tests[name]
        said.append(f"the body does not look linear: the records ask for {name} of {row['estimate']:.3g} +- "
                    f"{row['std']:.2g} {unit} (p = {row['p']:.2g}); with the force known it is taken out of A and B as "
                    "far as the records tell it from them: run diagnose")
    return tuple(said)


def prediction_gaps(study: Study, parts: list[MotionLikelihood], inference: Inference) -> dict[str, object]:
    """Return the one-step prediction error (rms over each channel's rms) at the prior mean and at the estimate."""
    centre, rows = inference.draws.mean(axis=0), {}
    for part, v in zip(parts, inference.target.parts(centre)[-len(parts):]):
        name = part.channels.name + ("" if part.model.n == study.model.n else f": {', '.join(part.model.dofs)}")
        rows[name] = {key: float(np.sqrt(np.mean(part.run(u, v)[0] ** 2)))
                      for key, u in (("do_nothing", np.zeros(study.n_u)), ("identified", centre[:study.n_u]))}
    return {"one_step_error": rows}

