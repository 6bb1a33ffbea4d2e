"""The noise that a fit leaves.

The discrepancy is as smooth as a sensor's drift, and takes a part of it: what it leaves is less than the noise, and
evidence for anything smooth is more than it should be. Expectation and maximisation (Dempster, Laird and Rubin 1977)
give back what was taken. Under a noise the sizes d of the directions D have the posterior mean m and the covariance S;
the next noise is that of

    E[(r - D d) (r - D d)'] = (r - D m) (r - D m)' + D S D'.

Only of sensors that drift beyond doubt: of a law that is missing the discrepancy shall take what it can.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from radiation_ss.gap.posterior.eliminated import eliminated
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.noise import Noise, coloured
from radiation_ss.gap.posterior.red_noise import drifting
from radiation_ss.gap.posterior.steps import placed

LOWER = 0.9  # of the floors, which are estimates
ROUNDS, SAME = 5, 0.005  # rounds at most; change of a deviation's logarithm below which they end


def noise_left(found: Fit, floors: tuple[float, ...]) -> Noise:
    """Return the noise of each channel that a fit leaves, its other parameters as they are."""
    setting, least = found.problem.setting, tuple(LOWER * floor for floor in floors)
    noise = coloured(found.point.residuals, least)
    drifts = drifting(found) if setting.unnamed else []
    if not any(drifts):
        return noise
    q, point = found.q, found.point
    for _ in range(ROUNDS):
        free = eliminated(setting, noise)
        here = placed(found.problem, noise, free, q, point)
        q, point = here.q, here.point
        inverse = solve_triangular(free.root, np.eye(free.root.shape[0]))  # S is its square
        parts = [np.column_stack([r, D @ inverse]) if drift else left for drift, r, D, left
                 in zip(drifts, point.residuals, setting.discrepancy, found.point.residuals)]
        last, noise = noise, coloured(parts, least)
        if max(abs(np.log(a / b)) for a, b in zip(noise.deviation, last.deviation)) < SAME:
            break
    return noise
