"""Score tests of quadratic drag and of a stiffness that changes with displacement, where the force is known.

A fit of a linear model puts most of such a force down to other parameters and the rest down to a random force, so that
its residuals look healthy. Score (Lagrange multiplier) tests ask instead for the one shape that the departure would
have, with all other parameters free: -c v|v| and -c x^3, with x and v from the model's own one-step predictions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.identification.posterior import Likelihood, Peak, Target
from radiation_ss.identification.prediction_error import MotionLikelihood

DOUBT = 0.04        # chance of a warning about a linear body, shared among its departures
KINDS = ("quadratic drag", "cubic stiffness")


def score_nonlinear(target: Target, peak: Peak, parts: Sequence[Likelihood]) -> dict[str, dict[str, float]]:
    """Return, for each departure, the one-step estimate of its coefficient with standard deviation, statistic and p.

    Coefficients are those of -c v|v| and -c x^3 in SI units, shared by all records. Degrees of freedom whose
    displacement or velocity no record carries are left out.
    """
    gradient = target.local(peak.phi)[1]
    ends = target.n_u + np.cumsum([item.size for item in target.likelihoods], dtype=int)
    found: dict[str, list[tuple[float, float, FloatArray]]] = {}
    for part, end in zip(target.likelihoods, ends):
        if not any(part is own for own in parts):
            continue
        assert isinstance(part, MotionLikelihood)
        where = np.r_[0:target.n_u, end - part.size:end]
        u, v = peak.phi[:target.n_u], peak.phi[end - part.size:end]
        for item in departures(part, u, v):
            score, information, cross = part.score_of_force(u, v, item.force)
            row = np.zeros(peak.phi.size)
            row[where] = cross / item.unit
            found.setdefault(item.name, []).append((score / item.unit, information / item.unit**2, row))
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


@dataclass(frozen=True, eq=False)
class Departure:
    """A nonlinear law: its name, its force (nt, n) along the measured motion, and its coefficient there [SI]."""

    name: str
    force: FloatArray
    unit: float


def departures(part: MotionLikelihood, u: FloatArray, v: FloatArray, share: float = 1e-3) -> list[Departure]:
    """Return the laws of each degree of freedom; their force peaks at `share` of the force's scale."""
    channels, out = part.channels, list[Departure]()
    if not np.isfinite(channels.y).all():
        return out
    predicted = part.predicted(u, v)
    for j, dof in enumerate(part.model.dofs):
        order = {int(channels.derivative[i]): i for i in np.flatnonzero(channels.dof == j)}
        shapes: list[tuple[str, FloatArray]] = []
        if 0 in order:
            x = predicted[:, order[0]]
            shapes.append((KINDS[1], x**3))
            velocity = CubicSpline(channels.time, x)(channels.time, 1)
        elif 1 in order:
            velocity = predicted[:, order[1]]
        else:
            continue
        shapes.append((KINDS[0], velocity * np.abs(velocity)))
        for kind, shape in shapes:
            coefficient = share * float(part.force_scale[j]) / float(np.abs(shape).max())
            force = np.zeros_like(part.force)
            force[:, j] = -coefficient * shape
            out.append(Departure(f"{kind} [{dof}]", force, coefficient))
    return out
