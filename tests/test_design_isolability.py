"""Exact confounds and what splits them."""

from dataclasses import replace

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from seeds import some

from radiation_ss import Record, isolability
from radiation_ss.errors import InputError
from radiation_ss.simulation import simulate

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
    # A force that may be off by 15 % hides most of a gain of 30 %, alone and beside the sensor's.
    one, two = (isolability(model, [record], names, tolerance=0.005) for record in (plain, both))
    assert one.indistinguishable and not two.indistinguishable
    assert two.separation[0, 1] > 5.0 * max(one.separation[0, 1], 0.1)
    assert set(isolability(model, [plain], names, tolerance=0.15).not_testable) == set(one.labels)


@pytest.mark.parametrize("seed", some(range(2)))
def test_motion_alone_shows_nonlinear_effects_and_no_linear_one(seed):
    model, records = tank_case([], seed, kinds=("waves", "waves"))
    alone = [replace(r, kind="motion-only", channels={"Heave": r.channels["Heave"]}) for r in records]
    known, unknown = isolability(model, records), isolability(model, alone)
    size, left = dict(zip(known.labels, known.detectability)), dict(zip(unknown.labels, unknown.detectability))
    for name in ("linear_stiffness", "linear_damping", "added_inertia", "tank_resonance"):
        assert size[f"{name} on Heave"] > 3.0 and f"{name} on Heave" in unknown.not_testable
    assert {"constant_force on Heave", "sensor_bias on Heave", "sensor_gain on Heave"} <= set(unknown.not_testable)
    assert "excitation_gain on Heave" not in left
    for name in ("cubic_stiffness", "quadratic_drag", "coulomb_friction"):
        assert 3.0 < left[f"{name} on Heave"] < 0.5 * size[f"{name} on Heave"]


def test_what_shows_falls_with_the_noise():
    model, records = tank_case([], 0)
    names = ["cubic_stiffness", "quadratic_drag"]
    low, high = (isolability(model, records, names, noise=noise) for noise in (0.01, 0.1))
    assert low.labels == high.labels and np.all(low.detectability > 2.0 * high.detectability)
    assert np.all(low.detectability < 10.0 * high.detectability)  # ten times the noise is the most that it can cost


def test_no_record_and_no_effect_are_refused():
    model, records = tank_case([], 0, kinds=("decay",))
    with pytest.raises(InputError, match="none given"):
        isolability(model, [])
    with pytest.raises(InputError, match="empty list"):
        isolability(model, records, [])
