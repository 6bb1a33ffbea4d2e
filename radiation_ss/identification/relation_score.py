"""Tests of what the spectral method takes for granted: only waves damp, A_inf is right, and nothing reflects.

Score (Lagrange multiplier) tests: each departure is a parameter that is zero in the model. Its score at the most
probable parameters, and the information left for it once all other parameters are free, give a statistic and a one-step
estimate of the departure. The statistic's distribution is simulated: a short record has few waves, and its scores are
sums of few exponentially distributed powers, far from chi-square in the tail. A wrong size of X looks like another sea
and cannot be tested from motion alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.identification.haskind import wave_numbers
from radiation_ss.identification.spectral import Departure, SpectralLikelihood
from radiation_ss.identification.study import Inference, Study

# Chance of a warning about a healthy record, 5 % in all: of the body (shared among its departures), and of a wall.
DOUBT, WALL = 0.04, 0.01
STEP = 1e-3
SIMULATED = 999
MOST_DISTANCES = 40
NARROW = 4.0        # bins that a ripple of a reflection must span to be seen


@dataclass(frozen=True, eq=False)
class Variant:
    """The same likelihood with something about the body changed by plus and minus a step."""

    up: SpectralLikelihood
    down: SpectralLikelihood
    step: float

    def slope(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return the spectra's derivative by the change, shape (nw, p, p)."""
        return np.asarray((self.up.spectra(number, u, v) - self.down.spectra(number, u, v)) / (2.0 * self.step))


@dataclass(frozen=True, eq=False)
class Ripple:
    """A wall at a distance that sends back a small share r of the waves: |1 + r e^{i (2 k L + phase)}|^2 on the sea."""

    part: SpectralLikelihood
    distance: float
    phase: float

    def slope(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return the spectra's derivative by r at zero, shape (nw, p, p)."""
        omega = np.maximum(self.part.coefficients[number].fine, 1e-6)
        ripple = 2.0 * np.cos(2.0 * wave_numbers(self.part.model, omega) * self.distance + self.phase)
        return np.asarray(ripple[:, None, None] * self.part.spectra(number, u, v))


def departures(model: Model, damping: FloatArray) -> dict[str, tuple[Model, Model]]:
    """Return name -> models with the departure at plus and minus one step of its unit.

    The units are the radiation damping `damping` (n,) for a linear damping without waves, and A_inf for added mass.
    """
    out = {}
    for j, dof in enumerate(model.dofs):
        unit = np.zeros((model.n, model.n))
        unit[j, j] = damping[j] * STEP
        out[f"damping without waves [{dof}]"] = (model.replace(D=model.D + unit), model.replace(D=model.D - unit))
        unit = np.zeros((model.n, model.n))
        unit[j, j] = abs(model.A_inf[j, j]) * STEP
        out[f"added mass at infinite frequency [{dof}]"] = (model.replace(A_inf=model.A_inf + unit),
                                                            model.replace(A_inf=model.A_inf - unit))
    return out


def score_relation(study: Study, parts: list[SpectralLikelihood], inference: Inference) -> dict[str, dict[str, float]]:
    """Return, for each departure, its one-step estimate and standard deviation (in its unit), statistic and p value.

    Of a reflection (one degree of freedom only: others may see it with another sign) the distance [m] of the largest
    statistic is given, with the p value of the largest of so many; the estimate is the share of the wave height.
    """
    n, phi = study.n_u, inference.peak.phi
    damping = np.array([np.mean([part.mean_damping(phi[:n])[j] for part in parts]) for j in range(study.model.n)])
    tried = departures(study.model, damping)
    walls = distances(parts[0]) if study.model.n == 1 else np.empty(0)
    scores, left = _scores(study, parts, inference, [
        (*(Variant(replace(part, model=up), replace(part, model=down), STEP) for up, down in tried.values()),
         *(Ripple(part, wall, phase) for wall in walls for phase in (0.0, 0.5 * np.pi))) for part in parts])
    out = {}
    for i, name in enumerate(tried):
        out[name] = {"estimate": float(scores[0, i] / left[i, i]), "std": float(left[i, i]**-0.5),
                     **_tested(scores[:, i] ** 2 / left[i, i])}
    if walls.size:
        out["reflection"] = _reflection(walls, scores[:, len(tried):], left[len(tried):, len(tried):])
    return out


def _tested(statistics: FloatArray) -> dict[str, float]:
    """Return the first statistic, and its p value among the simulated ones that follow."""
    return {"statistic": float(statistics[0]), "p": float(np.mean(statistics >= statistics[0]))}


def distances(part: SpectralLikelihood) -> FloatArray:
    """Return distances [m] of a wall whose ripple is too fast for a smooth sea and slow enough for the record.

    The slowest has one cycle between two knots of the sea's deviation, the fastest one in NARROW bins, both at the
    motion's median frequency; steps are half a wave over the middle half of the band, so that ripples hardly overlap.
    """
    w, knots = part.channels.frequency, part.sea.knots
    slow = w * np.log(knots[1] / knots[0]) if knots.size else 0.5 * w
    fast = NARROW * max(part.coefficients, key=lambda item: item.y.shape[0]).spacing
    change = np.diff(wave_numbers(part.model, np.array([0.99, 1.01]) * w))[0] / (0.02 * w)
    step = np.pi / np.ptp(wave_numbers(part.model, np.array([0.7, 1.5]) * w))
    return np.asarray(np.arange(np.pi / (change * slow), np.pi / (change * fast), step)[:MOST_DISTANCES])


def _scores(study: Study, parts: list[SpectralLikelihood], inference: Inference,
            variants: list[tuple[Departure, ...]]) -> tuple[FloatArray, FloatArray]:
    """Return the departures' scores, observed (first row) and simulated, and the information left for them.

    At the mode the score of a departure is s_x - C F^-1 s, with s the gradient of the log posterior at the truth; the
    records' part of it is simulated, that of the prior (and of other likelihoods) is normal with their information.
    """
    n, phi, extra = study.n_u, inference.peak.phi, len(variants[0])
    size, offset = phi.size, n
    score, information = np.zeros(extra), np.zeros((size + extra, size + extra))
    simulated = np.zeros((SIMULATED, size + extra))
    for part, own in zip(parts, variants):
        where, v = np.r_[0:n, offset:offset + part.size, size:size + extra], phi[offset:offset + part.size]
        _, gradient, fisher = part.local(phi[:n], v, own)
        score += gradient[n + part.size:]
        information[np.ix_(where, where)] += fisher
        simulated[:, where] += part.simulated_scores(phi[:n], v, own, study.rng, SIMULATED)
        offset += part.size
    fisher, cross = inference.peak.fisher, information[size:, :size]
    values, vectors = np.linalg.eigh(fisher - information[:size, :size])
    rest = study.rng.standard_normal((SIMULATED, size)) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    projection = np.linalg.solve(fisher, cross.T)
    expected = simulated[:, size:] - (simulated[:, :size] + rest) @ projection
    return np.vstack([score, expected]), information[size:, size:] - cross @ projection + 1e-12 * np.eye(extra)


def _reflection(walls: FloatArray, scores: FloatArray, left: FloatArray) -> dict[str, float]:
    """Return the row of the wall with the largest statistic; p is that of the largest over all walls."""
    pairs = [slice(2 * i, 2 * i + 2) for i in range(walls.size)]
    estimates = [np.linalg.solve(left[pair, pair], scores[:, pair].T).T for pair in pairs]
    statistics = np.array([np.sum(scores[:, pair] * estimate, axis=1) for pair, estimate in zip(pairs, estimates)])
    best = int(np.argmax(statistics[:, 0]))
    std = float(np.sqrt(0.5 * np.trace(np.linalg.inv(left[pairs[best], pairs[best]]))))
    return {"estimate": float(np.linalg.norm(estimates[best][0])), "std": std, **_tested(statistics.max(axis=0)),
            "distance": float(walls[best])}


def doubts(found: dict[str, dict[str, float]]) -> tuple[str, ...]:
    """Return warnings for departures that the records ask for."""
    said, of_body = [], sum(name != "reflection" for name in found)
    for name, row in found.items():
        if row["p"] >= (WALL if name == "reflection" else DOUBT / of_body):
            continue
        size = f"{row['estimate']:+.2f} +- {row['std']:.2f}"
        if name == "reflection":
            said.append(f"waves seem to be sent back by something some {row['distance']:.2g} m away: {size} of their "
                        f"height (p = {row['p']:.3f}); the sea's spectrum, the force and its size may be off by more "
                        "than their bands")
            continue
        unit = "the radiation damping" if name.startswith("damping") else "A_inf"
        said.append(f"Haskind's relation is in doubt: the motion asks for {name} of {size} of {unit} "
                    f"(p = {row['p']:.3f}); A and B may be off by more than their bands")
    return tuple(said)
