"""Score tests of quadratic drag and of a stiffness that changes with displacement, where the force is known.

A fit of a linear model puts most of such a force down to other parameters and the rest down to a random force, so that
its residuals look healthy. Score (Lagrange multiplier) tests ask instead for the one shape that the departure would
have, with all other parameters free: -c v|v| and -c x^3, with x and v from the model's own one-step predictions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.identification.posterior import Likelihood, Peak, Target
from radiation_ss.identification.prediction_error import MotionLikelihood

DOUBT = 0.04        # chance of a warning about a linear body, shared among its departures
SMALL = 1e-3        # of the random force's scale: the step of the derivative
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
        for name, force, unit in departures(part, u, v):
            score, information, cross = part.score_of_force(u, v, force)
            row = np.zeros(peak.phi.size)
            row[where] = cross / unit
            found.setdefault(name, []).append((score / unit, information / unit**2, row))
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


def departures(part: MotionLikelihood, u: FloatArray, v: FloatArray) -> list[tuple[str, FloatArray, float]]:
    """Return name, a small force (nt, n) of the departure's shape, and its coefficient, for each degree of freedom."""
    e, _ = part.run(u, v)
    channels, out = part.channels, []
    if not np.isfinite(channels.y).all():
        return []
    predicted = channels.y - e * channels.rms
    for j, dof in enumerate(part.model.dofs):
        order = {int(channels.derivative[i]): i for i in np.flatnonzero(channels.dof == j)}
        shapes: list[tuple[str, FloatArray]] = []
        if 0 in order:
            x = predicted[:, order[0]]
            shapes.append((KINDS[1], x**3))
            velocity = np.gradient(x, channels.dt)
        elif 1 in order:
            velocity = predicted[:, order[1]]
        else:
            continue
        shapes.append((KINDS[0], velocity * np.abs(velocity)))
        for kind, shape in shapes:
            coefficient = SMALL * float(part.force_scale[j]) / float(np.abs(shape).max())
            force = np.zeros_like(part.force)
            force[:, j] = -coefficient * shape
            out.append((f"{kind} [{dof}]", force, coefficient))
    return out


def nonlinear_doubts(found: dict[str, dict[str, float]]) -> tuple[str, ...]:
    """Return warnings for departures that the records ask for."""
    said = []
    for name, row in found.items():
        if row["p"] >= DOUBT / len(found):
            continue
        unit = "N s^2/m^2 or N m s^2" if name.startswith(KINDS[0]) else "N/m^3 or N m"
        said.append(f"the body does not look linear: the records ask for {name} of {row['estimate']:.3g} +- "
                    f"{row['std']:.2g} {unit} (p = {row['p']:.2g}); part of it is now in A and B, whose bands do not "
                    "hold that: run diagnose first")
    return tuple(said)
