"""Exact confounds and what splits them."""

import numpy as np
from gap_cases import tank_case
from plant_bodies import tank_model

from radiation_ss.gap.isolability import isolability
from radiation_ss.simulation.record import Record
from radiation_ss.simulation.run import simulate

NAMES = ["constant_force", "sensor_bias", "quadratic_drag", "excitation_gain", "sensor_gain", "linear_stiffness"]


def test_a_steady_load_and_a_sensor_bias_cannot_be_told_apart_by_decays():
    model, records = tank_case([], seed=3, kinds=("decay", "decay"), duration=15.0)
    found = isolability(model, records, NAMES)
    assert ("sensor_bias on Heave", "constant_force on Heave") in found.indistinguishable or (
        "constant_force on Heave", "sensor_bias on Heave") in found.indistinguishable
    assert "second" in found.next_record or "static" in found.next_record
    assert not any("excitation" in label for label in found.labels)  # no force acts


def test_force_and_sensor_gain_are_twins_in_waves_and_an_accelerometer_splits_them():
    model = tank_model()
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 30.0, 0.05)
    force = 3.0 * np.cos(7.0 * time) + 2.0 * np.cos(8.3 * time + 1.0)
    outputs = simulate(model, (time, force[None])).outputs
    x, a = (np.asarray(outputs[k]) * 1.0 for k in (0, 2))
    x, a = (v + 0.01 * v.std() * rng.standard_normal(v.size) for v in (x, a))
    plain = Record(time, {"Heave": x, "Heave_force": force}, kind="waves")
    both = plain.with_channels(Heave_acceleration=a)
    names = ["excitation_gain", "sensor_gain"]
    one, two = isolability(model, [plain], names), isolability(model, [both], names)
    assert one.indistinguishable and not two.indistinguishable
    assert two.separation[0, 1] > 5.0 * max(one.separation[0, 1], 0.1)
