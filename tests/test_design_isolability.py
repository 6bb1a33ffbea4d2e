"""Exact confounds and what splits them."""

from dataclasses import replace

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from radiation_ss.gap.motion.spectra import even_record, fit_library
from radiation_ss.gap.posterior.setting import scales_of
from test_gap_motion_only import motion_records

from radiation_ss import isolability
from radiation_ss.effects import effect_named
from radiation_ss.errors import InputError
from radiation_ss.records.record import Record
from radiation_ss.simulation.prepare import prepare, step_size
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


@pytest.mark.parametrize("seed", range(3))
def test_motion_alone_shows_nonlinear_effects_and_sensors_and_nothing_linear(seed):
    model, records = motion_records([], seed, count=2)
    found = isolability(model, records)
    size = dict(zip(found.labels, found.detectability))
    for name in ("linear_damping", "linear_stiffness", "added_inertia", "excitation_gain", "constant_force"):
        assert size[f"{name} on Heave"] == 0.0 and f"{name} on Heave" in found.not_testable
    for name in ("quadratic_drag", "cubic_stiffness", "sensor_delay", "sensor_gain"):
        assert f"{name} on Heave" not in found.not_testable
    assert "decay" in found.next_record
    plain = [replace(r, channels={"Heave": r.channels["Heave"]}) for r in records]
    alone = isolability(model, plain)
    assert {"sensor_delay on Heave", "sensor_gain on Heave"} <= set(alone.not_testable)


def test_in_motion_alone_what_shows_falls_with_the_noise():
    names = ["cubic_stiffness", "quadratic_drag"]
    low, high = (isolability(*motion_records([], 0, noise=noise), names) for noise in (0.01, 0.1))
    assert low.labels == high.labels
    assert np.all(low.detectability > high.detectability)


def test_in_motion_alone_the_map_says_how_sure_a_strength_will_be():
    # The strength that fits a linear body's motion scatters about 0 by one over the detectability.
    scatter = []
    for seed in range(8):
        model, records = motion_records([], seed, count=2)
        found = isolability(model, records, ["quadratic_stiffness"])
        h = step_size(model, records)
        scales = scales_of(model, [prepare(model, r, h) for r in records], 0)
        evens = [even_record(model, r, scales.omega) for r in records]
        fitted = fit_library(model, evens, [effect_named("quadratic_stiffness")], {"Heave": scales})[0]
        scatter.append(float(fitted.values[0]) * found.detectability[0])
    # A chi-square of 8 degrees of freedom lies between 1.3 and 21.9 with probability .99.
    assert 1.3 < np.sum(np.square(scatter)) < 21.9


def test_a_record_without_displacement_is_refused():
    model, records = motion_records([], 0, count=1)
    bare = replace(records[0], channels={"Heave_acceleration": records[0].channels["Heave_acceleration"]})
    with pytest.raises(InputError, match="displacement"):
        isolability(model, bare)
