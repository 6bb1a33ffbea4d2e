"""Prediction errors: a fit where the force is known. Laws that its residuals ask for are taken out of A and B."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.channels import known_elevation, known_force, motion_channels, strong_bins, thinned
from radiation_ss.identification.force import wave_force
from radiation_ss.identification.laws import (
    FORCE,
    LATE,
    LINEAR,
    dampers,
    followed,
    law_warnings,
    lawful_draws,
    least_of,
    placed,
    score_laws,
    strength,
    taken_apart,
)
from radiation_ss.identification.motion_likelihood import MotionLikelihood, NoiseRules, motion_likelihoods
from radiation_ss.identification.study import Findings, Study, cautious, with_body_held
from radiation_ss.inference.laplace import Climb, Peak, Target, find_peak, sample
from radiation_ss.inference.scales import noise_of
from radiation_ss.records.record import Record

NEAR = Climb(steps=6, rough=True)  # towards a mode that is sought anew, of laws along the motion that it gives
TAKEN_OUT = "it is taken out of A and B as far as the records tell it from them"


def attribute(study: Study, parts: list[MotionLikelihood],
              ) -> tuple[list[MotionLikelihood], Target, Peak, dict[str, dict[str, float]], list[str]]:
    """Return the parts with the laws that they ask for, target, mode, the score tests, and the laws' names.

    The law with the largest score becomes a force of unknown strength along the measured motion, and the rest is tested
    again. Records with a force of their own are asked before those whose force comes from the elevation.
    """
    (parts, start, laws), tests = first_fit(study, parts), dict[str, dict[str, float]]()
    sure = any(part.wave is None for part in parts)
    chance = study.rules.nonlinear if sure else study.rules.nonlinear_elevation
    while True:
        target = study.target(parts)
        peak = find_peak(target, start)
        asked = [part for part in parts if part.wave is None or not sure]
        left = {name: row for name, row in score_laws(target, peak, asked).items() if name not in laws}
        tests |= left
        # What a few tolerances of mass, stiffness and radiation explain together is no error of the recorded force.
        chances = {name: study.rules.nonlinear_elevation if taken_apart(name)[0] in FORCE else chance for name in left}
        name = min((name for name, row in left.items() if row["estimate"] > least_of(study, name)
                    and row["p"] < chances[name] / len(left)), key=lambda item: left[item]["p"], default=None)
        if name is None or len(laws) >= study.rules.most_laws:
            return parts, target, peak, tests, laws
        laws.append(name)
        parts, peak = with_laws(study, parts, peak.phi, laws)
        start = peak.phi


def with_laws(study: Study, parts: list[MotionLikelihood], phi: FloatArray,
              laws: Sequence[str]) -> tuple[list[MotionLikelihood], Peak]:
    """Return the parts with the last of some laws added, and their mode, from a mode without it.

    With the law the filtered motion is another, and the law along it, as are size and delay of the recorded force. A
    fit to a wrong force is no start for the right one: the model's own numbers are.
    """
    kind, recorded = taken_apart(laws[-1])[0], [name for name in laws[:-1] if taken_apart(name)[0] in FORCE]
    for round_, rules in enumerate((*(NEAR,) * (4 if kind == LATE else 1), None)):
        for name in (*recorded, laws[-1]):
            parts, phi = followed(study, parts, study.target(parts), phi, name)
        target = study.target(parts)
        if kind in FORCE and round_ == 0:
            phi = from_body(study, parts, target, np.r_[np.zeros(study.n_u), phi[study.n_u:]])
        peak = find_peak(target, phi, rules)
        phi = peak.phi
    return parts, peak


def first_fit(study: Study, parts: list[MotionLikelihood]) -> tuple[list[MotionLikelihood], FloatArray, list[str]]:
    """Return the parts, where their fit begins, and the linear damping that they begin with, mostly none.

    A damper that the model lacks is no radiation: without it the climb ends where mass, stiffness and gain all shrink
    alike, or nowhere. It is there where numbers of the model are moved farther than is believed and it fits better.
    """
    target = study.target(parts)
    start = from_body(study, parts, target, np.zeros(target.size))
    plain = climbed(target, start)
    without = parts, start if plain is None else plain.phi, list[str]()
    if plain and np.abs(plain.phi[study.form.active.size:study.n_u]).max(initial=0.0) < study.rules.doubt:
        return without
    damped, reached, asked = with_dampers(study, parts, start)
    if reached is None or (plain and plain.evidence > reached.evidence):
        return without
    return damped, reached.phi, asked


def weighed_dampers(study: Study, parts: list[MotionLikelihood],
                    peak: Peak) -> tuple[list[MotionLikelihood], list[Peak], list[str]]:
    """Return the parts with linear damping, the modes with and without it, and its names.

    X follows B by Haskind's relation: a damper smaller than X's tolerance goes into B and leaves no sign. So both are
    weighed by their evidence, as likely as each other before the records.
    """
    damped, reached, names = with_dampers(study, parts, peak.phi)
    if reached is None:
        return parts, [peak], []
    columns = [at for law, at in placed(study.target(damped), damped) if law.name in names]
    return damped, [reached, peak.with_zeros(columns)], names


def undamped(study: Study, parts: list[MotionLikelihood], target: Target, peak: Peak,
             least: float = 1e-12) -> list[Peak]:
    """Return the mode without the linear damping of a mode; none if that has none, or it is not reached.

    Nor is one looked for whose probability is less than `least` by the normal distribution about the mode.
    """
    columns = [at for law, at in placed(target, parts) if taken_apart(law.name)[0] in LINEAR]
    if not columns:
        return []
    there = np.linalg.inv(peak.fisher)[np.ix_(columns, columns)]
    if chi2.sf(peak.phi[columns] @ np.linalg.solve(there, peak.phi[columns]), len(columns)) < least:
        return []
    bare = [replace(part, laws=tuple(law for law in part.laws if taken_apart(law.name)[0] not in LINEAR))
            for part in parts]
    reached = climbed(study.target(bare), np.delete(peak.phi, columns))
    return [] if reached is None else [reached.with_zeros(columns)]


def with_dampers(study: Study, parts: list[MotionLikelihood],
                 start: FloatArray) -> tuple[list[MotionLikelihood], Peak | None, list[str]]:
    """Return the parts with linear damping wherever they have none, its mode above a start, its names.

    The mode is None where it is not reached or the model does not lack damping: there some takes damping from it.
    """
    damped, target = parts, study.target(parts)
    have = {law.name for part in parts for law in part.laws}
    names = [name for name in dampers(study.model.dofs) if name not in have]
    for _ in range(2):  # the body moves once the dampers are nearly as strong as they are, along the motion as it was
        for name in names:
            damped, start = followed(study, damped, target, start, name)
            target = study.target(damped)
        start = from_body(study, damped, target, start)
    names = [name for name in names if any(law.name == name for part in damped for law in part.laws)]
    reached = climbed(target, start, NEAR) if names else None
    for name in names:
        if reached is not None:
            damped, start = followed(study, damped, target, reached.phi, name)
            reached = climbed(study.target(damped), start, NEAR if name != names[-1] else None)
    lacking = reached is not None and all(
        strength(name, placed(study.target(damped), damped), reached.phi[None])[0] > least_of(study, name)
        for name in names)
    return damped, reached if lacking else None, names


def from_body(study: Study, parts: Sequence[MotionLikelihood], target: Target, phi: FloatArray) -> FloatArray:
    """Return phi with the most probable nuisance parameters for its body."""
    u = phi[:study.n_u]
    return np.concatenate([u, *(with_body_held(part, u, phi[at], 50).phi
                                for part, at in zip(parts, target.places[-len(parts):]))])


def climbed(target: Target, start: FloatArray, rules: Climb | None = None) -> Peak | None:
    """Return the mode above a start; None if none is reached."""
    try:
        return find_peak(target, start, rules)
    except SolverError:
        return None


def by_prediction_error(study: Study) -> Findings:
    """Return what the records say when the force is known."""
    parts, warnings, floors, bands = list[MotionLikelihood](), list[str](), list[float](), []
    for record in study.records:
        new = record_likelihoods(study, record)
        floor = NoiseRules().least_force
        if new[0].wave is not None:
            warnings.append(f"record {record.name}: the force comes from the wave elevation by the model's X, which "
                            "follows the damping by Haskind's relation; an error of X that changes with frequency, and "
                            f"is larger than {study.rules.tolerances['force']:.0%}, goes into A and B")
            elevation = record.channels["wave_elevation"]
            elevation = elevation[np.isfinite(elevation)]
            floor = max(floor, noise_of(elevation) / float(elevation.std()))
        parts += new
        floors += [floor] * len(new)
        for part in new:  # the lowest and highest frequency at which any motion has a thousandth of its largest density
            strong = strong_bins(part.channels.power, 1e-3)
            bands.append((max(int(strong[0]), 1) * part.channels.spacing, int(strong[-1]) * part.channels.spacing))
    parts, tests, found, draws, share, evidence = posterior(study, parts)
    places = study.target(parts).places[-len(parts):]
    centre, errors = draws.mean(axis=0), {}
    for part, at, floor in zip(parts, places, floors):
        u, v = centre[:study.n_u], centre[at]
        warnings += misfit_warnings(part, u, v, floor, study.rules.misfit)
        name = part.channels.name + ("" if part.model.n == study.model.n else f": {', '.join(part.model.dofs)}")
        errors[name] = {key: float(np.sqrt(np.mean(part.run(body, v)[0] ** 2)))
                        for key, body in (("do_nothing", np.zeros(study.n_u)), ("identified", u))}
    bodies = draws[:, :study.n_u]
    told = [law for law in found if tests[law]["p"] < study.rules.nonlinear]
    # With the prior's standard deviation, the largest of all records. What hardly any draw has is not there.
    units = {name: max(law.unit for part in parts for law in part.laws if law.name == name) for name in found}
    damping = {name: (values, units[name]) for name, values in found.items()
               if taken_apart(name)[0] in LINEAR and np.median(np.abs(values)) > 1e-6 * units[name]}
    return Findings(bodies, {"one_step_error": errors, "nonlinearity_test": tests},
                    (*warnings, *law_warnings(tests, told, TAKEN_OUT)), passive=share,
                    centre=cautious(study, bodies, bands), damping=damping, bands=tuple(bands), evidence=evidence)


def posterior(study: Study, parts: list[MotionLikelihood],
              ) -> tuple[list[MotionLikelihood], dict[str, dict[str, float]], dict[str, FloatArray], FloatArray, float,
                         float]:
    """Return parts with their laws, the laws' tests, draws of their coefficients, draws, passive share, evidence."""
    parts, target, peak, tests, laws = attribute(study, parts)
    peaks, weighed = [peak], list[str]()
    if all(part.wave is not None for part in parts):
        parts, peaks, weighed = weighed_dampers(study, parts, peak)
        target = study.target(parts)
    elif bare := undamped(study, parts, target, peak):
        peaks, weighed = [peak, *bare], [law for law in laws if taken_apart(law)[0] in LINEAR]
    draws, share = sample(target, peaks, study.rng, study.rules.draws, study.rules.least_passive)
    own = placed(target, parts)
    draws = lawful_draws(study, own, draws)
    found = {law: strength(law, own, draws) for law in dict.fromkeys((*laws, *weighed))}
    for law, values in found.items():
        sure = float(values.mean() ** 2 / max(values.var(), 1e-300))
        tested = {} if law in weighed else tests.get(law, {})
        tests[law] = {"statistic": sure, "p": float(chi2.sf(sure, 1)), **tested,
                      "estimate": float(values.mean()), "std": float(values.std())}
    return parts, tests, found, draws, share, float(np.logaddexp.reduce([peak.evidence for peak in peaks]))


def record_likelihoods(study: Study, record: Record) -> list[MotionLikelihood]:
    """Return the likelihoods of one record, one for each group of coupled degrees of freedom."""
    channels, known = motion_channels(study.model, record), known_force(study.model, record)
    if known is not None:
        return motion_likelihoods(study.model, study.form, *thinned(channels, known))
    elevation = known_elevation(record)
    channels, column = thinned(channels, elevation[:, None])
    trim = min(round(NoiseRules().edge * channels.period / channels.dt), column.shape[0] // 5)
    wave = wave_force(study.model, study.form, column[:, 0], channels.dt, channels.frequency,
                      study.rules.tolerances["force"], trim)
    channels = channels.cut(trim, channels.y.shape[0] - trim)
    nominal = wave.force(study.form.own, np.zeros(study.n_u), np.zeros(wave.size))
    return motion_likelihoods(study.model, study.form, channels, nominal, wave)


def misfit_warnings(part: MotionLikelihood, u: FloatArray, v: FloatArray, floor: float, chance: float,
                    unsure: float = 1.5) -> list[str]:
    """Return a warning if prediction errors are larger than sensor noise, and the noise of the force column, explain.

    The fit's own random force takes all it cannot explain; here it has the size that the column shows (at least
    `floor`). Squared innovations are held against chi^2, overall and in the worst period. `unsure`: factor of the
    noise's variance.
    """
    c = part.channels
    e, s = part.run(u, as_measured(part, v, floor))
    there, period = np.isfinite(c.y), max(1, round(c.period / c.dt))
    edge = 0 if part.wave is None else round(part.rules.edge * period)
    kept = slice(edge, c.y.shape[0] - edge)
    square, used = np.where(there, e**2 / s, 0.0).sum(axis=1)[kept], there.sum(axis=1)[kept]
    if used.sum() < period:
        return []
    starts = np.arange(0, square.size, period)
    total = np.r_[np.add.reduceat(square, starts), square.sum()]
    count = np.maximum(np.r_[np.add.reduceat(used, starts), used.sum()], 1)
    excess, limits = total / count, chi2.ppf(1.0 - chance / count.size, count) / count
    worst = int(np.argmax(excess / limits))
    if excess[worst] < unsure * limits[worst]:
        return []
    noise = float(np.sqrt(np.median(s[there])))
    where = "" if worst == starts.size else f" in its worst period, about {c.time[kept][starts[worst]]:.4g} s"
    return [f"record {c.name}: from one sample to the next the linear model leaves "
            f"{noise * np.sqrt(excess[worst]):.2%} of the motion{where}, noise of the columns explains {noise:.2%}; "
            "the bands hold only if the rest is noise: run diagnose first"]


def as_measured(part: MotionLikelihood, v: FloatArray, floor: float) -> FloatArray:
    """Return the nuisance parameters with the random force at the noise that the force column shows."""
    p, n, rules = part.channels.count, part.model.n, part.rules
    shown = np.array([noise_of(column) for column in part.force.T])
    level = np.maximum(shown / part.force_scale, floor)
    out = v.copy()
    out[p:p + n] = np.minimum(out[p:p + n], np.log(level / rules.level) / rules.spread)
    return out
