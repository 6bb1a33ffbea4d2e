"""Prediction errors: a fit where the force is known, and what nonlinear laws its residuals ask for.

A fit of a linear model puts most of a quadratic drag, or of a stiffness that changes with displacement, down to other
parameters and the rest down to a random force, so that its residuals look healthy. Score (Lagrange multiplier) tests
ask instead for the one shape that the departure would have, with all other parameters free: -c v|v|, -c v/|v| and
-c x^3, with x and v as the model's own filter has them. What is asked for is named, and taken out of A and B.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, mode
from radiation_ss.identification.channels import known_elevation, known_force, motion_channels, strong_bins, thinned
from radiation_ss.identification.force import wave_force
from radiation_ss.identification.motion_likelihood import Law, MotionLikelihood, NoiseRules, motion_likelihoods
from radiation_ss.identification.study import Findings, Study, cautious
from radiation_ss.inference.laplace import Peak, Target, find_peak, sample
from radiation_ss.inference.scales import noise_of
from radiation_ss.records.record import Record

UNITS = {"quadratic drag": ("N s^2/m^2", "N m s^2/rad^2"), "cubic stiffness": ("N/m^3", "N m/rad^3"),
         "dry friction": ("N", "N m")}

TAKEN_OUT = "it is taken out of A and B as far as the records tell it from them"


def laws_of(part: MotionLikelihood, u: FloatArray, v: FloatArray, onset: float = 0.1) -> list[Law]:
    """Return the laws of each degree of freedom along the filtered motion; their force peaks at the force's scale.

    Friction is rounded below the share `onset` of the velocity's rms.
    """
    channels, out = part.channels, list[Law]()
    if not np.isfinite(channels.y).all():
        return out
    filtered = part.filtered(u, v)
    for j, dof in enumerate(part.model.dofs):
        order = {int(channels.derivative[i]): i for i in np.flatnonzero(channels.dof == j)}
        shapes = dict[str, FloatArray]()
        if 0 in order:
            x = filtered[:, order[0]]
            shapes["cubic stiffness"] = x**3
            velocity = CubicSpline(channels.time, x)(channels.time, 1)
        elif 1 in order:
            velocity = filtered[:, order[1]]
        else:
            continue
        shapes["quadratic drag"] = velocity * np.abs(velocity)
        shapes["dry friction"] = velocity / np.hypot(velocity, onset * velocity.std())
        for kind, shape in shapes.items():
            coefficient = float(part.force_scale[j]) / float(np.abs(shape).max())
            force = np.zeros_like(part.force)
            force[:, j] = -coefficient * shape
            out.append(Law(f"{kind} [{dof}]", force, coefficient))
    return out


def score_laws(target: Target, peak: Peak, parts: Sequence[MotionLikelihood]) -> dict[str, dict[str, float]]:
    """Return, for each law, the one-step estimate of its coefficient with standard deviation, statistic and p.

    Coefficients of the laws in SI units, shared by all records that carry displacement or velocity.
    """
    gradient, u = target.local(peak.phi)[1], peak.phi[:target.n_u]
    found: dict[str, list[tuple[float, float, FloatArray]]] = {}
    for part, at in zip(target.likelihoods, target.places):
        if not isinstance(part, MotionLikelihood) or not any(part is own for own in parts):
            continue
        v = peak.phi[at]
        for law in laws_of(part, u, v):
            score, information, cross = part.score_of(law, u, v)
            row = np.zeros(peak.phi.size)
            row[np.r_[0:target.n_u, at]] = cross / law.unit
            found.setdefault(law.name, []).append((score / law.unit, information / law.unit**2, row))
    out = {}
    for name, rows in found.items():
        cross = np.sum([row for _, _, row in rows], axis=0)
        projected = np.linalg.solve(peak.fisher, cross)
        left = sum(information for _, information, _ in rows) - float(cross @ projected)
        score = sum(value for value, _, _ in rows) - float(gradient @ projected)
        if left > 0.0:
            out[name] = {"estimate": score / left, "std": left**-0.5, "statistic": score**2 / left,
                         "p": float(chi2.sf(score**2 / left, 1))}
    return out


def attribute(study: Study, parts: list[MotionLikelihood],
              ) -> tuple[list[MotionLikelihood], Target, Peak, dict[str, dict[str, float]], list[str]]:
    """Return the parts with the laws that they ask for, target, mode, the score tests, and the laws' names.

    The law with the largest score becomes a force of unknown strength along the measured motion, and the rest is tested
    again. Records with a force of their own are asked before those whose force comes from the elevation.
    """
    laws, tests, start = list[str](), dict[str, dict[str, float]](), np.zeros(study.target(parts).size)
    sure = any(part.wave is None for part in parts)
    chance = study.rules.nonlinear if sure else study.rules.nonlinear_elevation
    while True:
        target = study.target(parts)
        peak = find_peak(target, start)
        asked = [part for part in parts if part.wave is None or not sure]
        left = {name: row for name, row in score_laws(target, peak, asked).items() if name not in laws}
        tests |= left
        name = min(left, key=lambda item: left[item]["p"], default=None)
        if name is None or len(laws) == study.rules.most_laws or left[name]["p"] >= chance / len(left):
            return parts, target, peak, tests, laws
        laws.append(name)
        for _ in range(2):      # with the law the filtered motion is another, and the law along it
            parts, start = followed(study, parts, target, peak, name)
            target = study.target(parts)
            peak = find_peak(target, start)


def followed(study: Study, parts: Sequence[MotionLikelihood], target: Target, peak: Peak,
             name: str) -> tuple[list[MotionLikelihood], FloatArray]:
    """Return the parts with the law along the filtered motion of the mode, added or made anew, and where it starts."""
    u, moved = peak.phi[:study.n_u], []
    for part, at in zip(parts, target.places[-len(parts):]):
        v = peak.phi[at]
        law = next((item for item in laws_of(part, u, v) if item.name == name), None)
        have = next((k for k, item in enumerate(part.laws) if item.name == name), None)
        if law is None:
            moved.append((part, v))
        elif have is None:
            moved.append(part.with_law(law, v))
        else:
            unit = part.laws[have].unit
            law = Law(name, law.force * (unit / law.unit), unit)
            moved.append((replace(part, laws=(*part.laws[:have], law, *part.laws[have + 1:])), v))
    return [part for part, _ in moved], np.concatenate([u, *(v for _, v in moved)])


def strength(name: str, parts: Sequence[MotionLikelihood], places: Sequence[slice],
             draws: FloatArray) -> dict[str, float]:
    """Return mean and deviation of a law's coefficient [SI] by all records that have it, from draws (nd, d)."""
    found = [law.unit * draws[:, at][:, part.first_law + k] for part, at in zip(parts, places)
             for k, law in enumerate(part.laws) if law.name == name]
    weights = np.array([1.0 / max(float(column.var()), 1e-300) for column in found])
    means = np.array([column.mean() for column in found])
    return {"estimate": float(weights @ means / weights.sum()), "std": float(weights.sum() ** -0.5)}


def law_warnings(tests: dict[str, dict[str, float]], laws: Sequence[str], done: str) -> Iterator[str]:
    """Yield a warning for each nonlinear law that the records ask for, with what was done about it."""
    for name in laws:
        kind, dof = name.removesuffix("]").split(" [")
        yield (f"the body does not look linear: the records ask for {name} of {tests[name]['estimate']:.3g} +- "
               f"{tests[name]['std']:.2g} {UNITS[kind][mode(dof) in ROTATIONS]} (p = {tests[name]['p']:.2g}); {done}: "
               "run diagnose")


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
    parts, target, peak, tests, laws = attribute(study, parts)
    draws, share = sample(target, [peak], study.rng, study.rules.draws, study.rules.least_passive)
    for law in laws:
        tests[law] |= strength(law, parts, target.places[-len(parts):], draws)
    centre, errors = draws.mean(axis=0), {}
    for part, at, floor in zip(parts, target.places[-len(parts):], floors):
        u, v = centre[:study.n_u], centre[at]
        warnings += misfit_warnings(part, u, v, floor, study.rules.misfit)
        name = part.channels.name + ("" if part.model.n == study.model.n else f": {', '.join(part.model.dofs)}")
        errors[name] = {key: float(np.sqrt(np.mean(part.run(body, v)[0] ** 2)))
                        for key, body in (("do_nothing", np.zeros(study.n_u)), ("identified", u))}
    bodies = draws[:, :study.n_u]
    return Findings(bodies, {"one_step_error": errors, "nonlinearity_test": tests},
                    (*warnings, *law_warnings(tests, laws, TAKEN_OUT)), passive=share,
                    centre=cautious(study, bodies, bands), bands=tuple(bands))


def record_likelihoods(study: Study, record: Record) -> list[MotionLikelihood]:
    """Return the likelihoods of one record, one for each group of coupled degrees of freedom."""
    channels, known = motion_channels(study.model, record), known_force(study.model, record)
    if known is not None:
        return motion_likelihoods(study.model, study.form, *thinned(channels, known))
    elevation = known_elevation(study.model, record)
    if elevation is None:
        raise InputError(f"record {record.name}: the force is not known (no <Dof>_force column, not "
                         "'# kind: decay', no wave_elevation with X in the model); method 'spectral' needs none")
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
