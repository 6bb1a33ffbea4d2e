"""A test of what the spectral method takes for granted: only waves damp (Haskind's relation), and A_inf is right.

Score (Lagrange multiplier) test: each departure is a parameter that is zero in the model. Its score at the most
probable parameters, and the information left for it once all other parameters are free, give a chi-square statistic of
one degree of freedom, and a one-step estimate of the departure. What a reflection or a wrong |X| does to the spectrum
looks like another sea and cannot be tested from motion alone; it shows in the sea's deviation from JONSWAP.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.spectral import SpectralLikelihood, Variant
from radiation_ss.filter.study import Inference, Study
from radiation_ss.plant.model import Model

DOUBT = 0.05        # p value below which a warning is given (shared among the departures tested)
STEP = 1e-3


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
    """Return, for each departure, its one-step estimate and standard deviation (in its unit), statistic and p value."""
    n, phi = study.n_u, inference.peak.phi
    damping = np.array([np.mean([part.mean_damping(phi[:n])[j] for part in parts]) for j in range(study.model.n)])
    tried = departures(study.model, damping)
    size, extra = phi.size, len(tried)
    score, information = np.zeros(extra), np.zeros((size + extra, size + extra))
    offset = n
    for part in parts:
        variants = tuple(Variant(replace(part, model=up), replace(part, model=down), STEP)
                         for up, down in tried.values())
        where = np.r_[0:n, offset:offset + part.size, size:size + extra]
        _, gradient, fisher = part.local(phi[:n], phi[offset:offset + part.size], variants)
        score += gradient[n + part.size:]
        information[np.ix_(where, where)] += fisher
        offset += part.size
    cross = information[size:, :size]
    left = np.diag(information[size:, size:] - cross @ np.linalg.solve(inference.peak.fisher, cross.T))
    out = {}
    for name, s, info in zip(tried, score, np.maximum(left, 1e-12)):
        out[name] = {"estimate": float(s / info), "std": float(info**-0.5), "statistic": float(s**2 / info),
                     "p": float(chi2.sf(s**2 / info, 1))}
    return out


def doubts(found: dict[str, dict[str, float]]) -> tuple[str, ...]:
    """Return warnings for departures that the records ask for."""
    said = []
    for name, row in found.items():
        if row["p"] * len(found) < DOUBT:
            unit = "the radiation damping" if name.startswith("damping") else "A_inf"
            said.append(f"Haskind's relation is in doubt: the motion asks for {name} of {row['estimate']:+.2f} "
                        f"+- {row['std']:.2f} of {unit} (p = {row['p']:.1e}); A and B may be off by more than "
                        "their bands")
    return tuple(said)
