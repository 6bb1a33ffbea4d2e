"""Motion without a known force: nonlinear effects show by their harmonics, linear ones never."""

import numpy as np
import pytest
from plant_bodies import tank_model

from radiation_ss.gap.diagnose import diagnose
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate


def motion_records(effects, seed, count=3, noise=0.005):
    """Motion of the tank in random waves whose force is not told."""
    model, rng = tank_model(), np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.04)
    records = []
    for k in range(count):
        omega = np.linspace(5.0, 11.0, 90) + rng.uniform(-0.03, 0.03, 90)
        size = 3.0 * (k + 1) / count * np.exp(-(((omega - 7.5) / 1.0) ** 2))
        force = (size * rng.rayleigh(1.0, 90)) @ np.cos(np.outer(omega, time) + rng.uniform(0.0, 2 * np.pi, (90, 1)))
        outputs = simulate(model, (time, force[None]), effects).outputs
        x, a = np.asarray(outputs[0]), np.asarray(outputs[2])
        x, a = (v + noise * v.std() * rng.standard_normal(v.size) for v in (x, a))
        records.append(Record(time, {"Heave": x, "Heave_acceleration": a}, kind="motion-only", name=f"sea {k + 1}"))
    return model, records


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("effects", [[], [("linear_damping", {"coefficient": 15.0})],
                                     [("linear_stiffness", {"stiffness": 120.0})]])
def test_linear_causes_are_never_named(effects, seed):
    model, records = motion_records(effects, seed)
    found = diagnose(model, records)
    assert found.verdict.status == "no_gap"
    assert {"linear_damping", "linear_stiffness", "added_inertia"} <= set(found.not_testable)


@pytest.mark.parametrize("seed", range(2))
def test_a_hardening_spring_is_found_with_its_size(seed):
    model, records = motion_records([("cubic_stiffness", {"stiffness": 4e5})], seed)
    found = diagnose(model, records[:2], withhold=records[2:])
    assert [e.name for e in found.verdict.effects] == ["cubic_stiffness"]
    value, deviation = found.verdict.effects[0].parameters["stiffness"]
    assert abs(value - 4e5) < 4.0 * deviation + 0.1 * 4e5
    cubic = next(c for c in found.which if [e.name for e in c.effects] == ["cubic_stiffness"])
    none = next(c for c in found.which if not c.effects)
    assert cubic.gap_after < none.gap_after == none.gap_before == cubic.gap_before
    assert "Outside the waves' own band" in str(found) and "unseen data the gap" not in str(found)


def test_a_sensor_that_disagrees_with_another_is_found():
    model, records = motion_records([("sensor_delay", {"delay": 0.03})], 5)
    found = diagnose(model, records)
    assert "sensor_delay" in [e.name for e in found.verdict.effects]
    assert found.verdict.effects[0].parameters["delay"][0] == pytest.approx(0.03, abs=0.005)
