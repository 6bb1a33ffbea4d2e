"""Forces that set in at once, in records that are sampled coarsely: held against SciPy's stiff integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import radiation_ss as rss

MASS, STIFFNESS, DAMPING, FRICTION = 2.0, 8.0, 0.16, 0.6
EFFECTS = ["coulomb_friction", "quadratic_drag", "linear_damping", "linear_stiffness", "added_inertia",
           "viscous_memory"]


def moved(time: float, state: np.ndarray) -> list[float]:
    """Return velocity and acceleration."""
    friction = FRICTION * np.tanh(state[1] / 0.01)
    return [state[1], -(DAMPING * state[1] + STIFFNESS * state[0] + friction) / MASS]


def decays(seed: int, samples: int, count: int = 6) -> list[rss.Record]:
    """Return decays with dry friction, `samples` readings a period, noise of 1 %."""
    rng, records = np.random.default_rng(seed), []
    time = np.arange(0.0, 14.0 * np.pi, np.pi / samples)
    for k in range(count):
        start = rng.uniform(0.6, 1.2) * rng.choice([-1, 1])
        path = solve_ivp(moved, (0.0, time[-1]), [start, 0.0], t_eval=time, method="Radau", rtol=1e-8, atol=1e-10)
        heave = path.y[0] + 0.01 * np.std(path.y[0]) * rng.normal(size=time.size)
        records.append(rss.Record(time, {"Heave": heave}, kind="decay", name=f"decay {k}"))
    return records


@pytest.mark.parametrize("seed", [1])
def test_friction_of_coarsely_sampled_decays_is_named_with_its_size(seed):
    """Six readings a period do not show where the motion turns: the equation error's friction is 20 % too small."""
    records = decays(seed, samples=6)
    model = rss.body(dof="Heave", mass=MASS, added_mass=0.0, C=STIFFNESS, damping_ratio=0.02)
    found = rss.diagnose(model, records[:-1], EFFECTS, withhold=records[-1])
    assert [effect.name for effect in found.verdict.effects] == ["coulomb_friction"]
    value, std = found.verdict.effects[0].parameters["force"]
    assert abs(value - FRICTION) < 3.0 * std < 0.25 * FRICTION
