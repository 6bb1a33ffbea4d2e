"""Up to which frequency a motion is taken from its sensor: not by chance, and not less than it moves."""

import numpy as np

import radiation_ss as rss
from radiation_ss.inference import measured_motion

TIME = np.arange(0.0, 14.0, 0.04)


def clear(seed, fast):
    """Heave driven at 2.5 rad/s, with a fast part at 11 rad/s, and white noise; the model alone looks up to 8.75."""
    rng, model = np.random.default_rng(seed), rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=12.0)
    x = 0.1 * np.sin(2.5 * TIME) + fast * np.sin(11.0 * TIME) + 5e-4 * rng.standard_normal(TIME.size)
    run = measured_motion(model, rss.Record(TIME, {"Heave": x, "Heave_force": x}, kind="prescribed"))
    return run.clear[0] > 9.0


def test_few_lines_of_noise_stand_out_of_it_by_chance_and_are_no_motion():
    assert sum(clear(seed, 0.0) for seed in range(100)) <= 5
    assert all(clear(seed, 1.5e-3) for seed in range(20))
