"""Quadratic drag and a stiffness that changes with displacement: asked for, named, and taken out of A and B.

A fit of a linear model puts most of such a force down to other parameters and the rest down to a random force, so that
its residuals look healthy. Score (Lagrange multiplier) tests ask instead for the one shape that the departure would
have, with all other parameters free: -c v|v| and -c x^3, with x and v from the model's own one-step predictions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.identification.motion_likelihood import Law, MotionLikelihood
from radiation_ss.identification.study import Study
from radiation_ss.inference.laplace import Peak, Target, find_peak

UNITS = {"quadratic drag": "N s^2/m^2 or N m s^2", "cubic stiffness": "N/m^3 or N m"}


def laws_of(part: MotionLikelihood, u: FloatArray, v: FloatArray) -> list[Law]:
    """Return the laws of each degree of freedom along the predicted motion; their force peaks at the force's scale."""
    channels, out = part.channels, list[Law]()
    if not np.isfinite(channels.y).all():
        return out
    predicted = part.predicted(u, v)
    for j, dof in enumerate(part.model.dofs):
        order = {int(channels.derivative[i]): i for i in np.flatnonzero(channels.dof == j)}
        shapes = dict[str, FloatArray]()
        if 0 in order:
            x = predicted[:, order[0]]
            shapes["cubic stiffness"] = x**3
            velocity = CubicSpline(channels.time, x)(channels.time, 1)
        elif 1 in order:
            velocity = predicted[:, order[1]]
        else:
            continue
        shapes["quadratic drag"] = velocity * np.abs(velocity)
        for kind, shape in shapes.items():
            coefficient = float(part.force_scale[j]) / float(np.abs(shape).max())
            force = np.zeros_like(part.force)
            force[:, j] = -coefficient * shape
            out.append(Law(f"{kind} [{dof}]", force, coefficient))
    return out


def score_laws(target: Target, peak: Peak, parts: Sequence[MotionLikelihood]) -> dict[str, dict[str, float]]:
    """Return, for each law, the one-step estimate of its coefficient with standard deviation, statistic and p.

    Coefficients are those of -c v|v| and -c x^3 in SI units, shared by all records. Degrees of freedom whose
    displacement or velocity no record carries are left out.
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

    A fit of a linear model puts most of a drag down to other parameters. The law with the largest score is made a force
    of unknown strength along the measured motion, and the rest is tested again, so that one law is not named twice. A
    force from the elevation is too unsure to be told from a law.
    """
    laws, tests, start = list[str](), dict[str, dict[str, float]](), np.zeros(study.target(parts).size)
    while True:
        target = study.target(parts)
        peak = find_peak(target, start)
        left = {name: row for name, row in score_laws(target, peak, [p for p in parts if p.wave is None]).items()
                if name not in laws}
        tests |= left
        name = min(left, key=lambda item: left[item]["p"], default=None)
        if name is None or len(laws) == study.rules.most_laws or left[name]["p"] >= study.rules.nonlinear / len(left):
            return parts, target, peak, tests, laws
        laws.append(name)
        u, moved = peak.phi[:study.n_u], []
        for part, at in zip(parts, target.places[-len(parts):]):
            law = next((item for item in laws_of(part, u, peak.phi[at]) if item.name == name), None)
            moved.append((part, peak.phi[at]) if law is None else part.with_law(law, peak.phi[at]))
        parts, start = [part for part, _ in moved], np.concatenate([u, *(v for _, v in moved)])


def law_warnings(tests: dict[str, dict[str, float]], laws: Sequence[str]) -> tuple[str, ...]:
    """Return a warning for each nonlinear law that the records ask for."""
    return tuple(f"the body does not look linear: the records ask for {name} of {tests[name]['estimate']:.3g} +- "
                 f"{tests[name]['std']:.2g} {UNITS[name.split(' [')[0]]} (p = {tests[name]['p']:.2g}); with the force "
                 "known it is taken out of A and B as far as the records tell it from them: run diagnose"
                 for name in laws)
