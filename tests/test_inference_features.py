"""The force of an effect along a measured motion."""

import numpy as np
import pytest
from plant_bodies import tank_model
from scipy.signal import lsim

import radiation_ss as rss
from radiation_ss.effects import activate
from radiation_ss.effects.further import fractional
from radiation_ss.inference.features import features
from radiation_ss.inference.measured_motion import measured_motion


@pytest.mark.parametrize("frequency", [2.0, 8.0, 40.0])
def test_own_states_that_are_fast_for_the_sampling_follow_their_equation(frequency):
    model, time = tank_model(), np.arange(0.0, 20.0, 0.08)
    record = rss.Record(time, {"Heave": 0.02 * np.exp(-0.1 * time) * np.cos(6.0 * time)}, kind="decay")
    run = measured_motion(model, record)
    active, = activate([("viscous_memory", {"coefficient": 1.0, "frequency": frequency})], ("Heave",))
    (feature,), = features(model, active, [run])
    poles, whole, residues = fractional(3)
    v = run.v[0]
    wanted = -whole * v
    for pole, residue in zip(frequency * poles, residues):
        wanted -= residue * lsim(([1.0, 0.0], [1.0, pole]), v, run.time - run.time[0])[1]
    assert run.dt * frequency * poles.max() > 1.5
    np.testing.assert_allclose(feature.force[0], wanted, atol=0.01 * np.abs(wanted).max())
