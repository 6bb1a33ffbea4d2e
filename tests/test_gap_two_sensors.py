"""Displacement and acceleration of one motion against each other: clocks that differ from record to record."""

import numpy as np
import pytest
from plant_bodies import coupled_model

import radiation_ss as rss
from radiation_ss.effects import library
from radiation_ss.gap.where.two_sensors import fault, ratio_rows, unlike_clocks
from radiation_ss.simulation.run import simulate

TYPICAL = 1.0  # rad/s


def two_sensors(delay, gain, noise, rng, name):
    """Return a record of a motion in closed form: displacement late and scaled, acceleration exact but for noise."""
    time = np.arange(0.0, 200.0, 0.2)
    omega, phase = rng.uniform(0.7, 1.3, (12, 1)), rng.uniform(0.0, 2.0 * np.pi, (12, 1))
    x = (1.0 + gain) * np.cos(omega * (time - delay) + phase).sum(axis=0)
    a = -(omega**2 * np.cos(omega * time + phase)).sum(axis=0)
    channels = {"Heave": x, "Heave_acceleration": a}
    noisy = {k: v + noise * v.std() * rng.standard_normal(v.size) for k, v in channels.items()}
    return rss.Record(time, noisy, name=name)


@pytest.mark.parametrize("seed", range(5))
def test_gain_and_delay_are_those_of_the_sensor(seed):
    rng = np.random.default_rng(seed)
    delay, gain = rng.uniform(-0.6, 0.6), rng.uniform(-0.2, 0.2)
    found_gain, found_delay, covariance = fault(ratio_rows(two_sensors(delay, gain, 0.01, rng, "r"), "Heave", TYPICAL))
    assert abs(found_delay - delay) < 5.0 * np.sqrt(covariance[1, 1])
    assert abs(found_gain - gain) < 5.0 * np.sqrt(covariance[0, 0])


@pytest.mark.parametrize("seed", range(5))
def test_clocks_that_differ_are_told_and_only_those(seed):
    rng = np.random.default_rng(seed)
    delays = {"a": -0.05, "b": 0.02, "c": 0.06}
    apart = [two_sensors(delay, -0.1, 0.02, rng, name) for name, delay in delays.items()]
    (said,) = unlike_clocks(apart, {"Heave": TYPICAL})
    assert "clock_offset" in said and all(f" s in {name}" in said for name in delays)
    assert unlike_clocks(apart[:1], {"Heave": TYPICAL}) == ()
    for delay, gain in ((0.0, 0.0), (0.08, 0.0), (0.05, -0.1)):
        together = [two_sensors(delay, gain, 0.02, rng, name) for name in delays]
        assert unlike_clocks(together, {"Heave": TYPICAL}) == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_decay_beside_waves_is_no_other_clock(seed):
    """The acceleration of a released body is exact; its tapered spectrum is not -w^2 times that of the motion."""
    rng = np.random.default_rng(seed)
    time, damping = np.arange(0.0, 60.0, 0.2), rng.uniform(0.05, 0.2)
    pole = -damping + 1j * np.sqrt(1.0 - damping**2)
    moved = {"Heave": np.exp(pole * time).real, "Heave_acceleration": (pole**2 * np.exp(pole * time)).real}
    released = {k: v + 0.003 * v.std() * rng.standard_normal(v.size) for k, v in moved.items()}
    decays = [rss.Record(time, released, kind="decay", name=name) for name in ("d", "e")]
    assert unlike_clocks([*decays, two_sensors(0.0, 0.0, 0.003, rng, "w")], {"Heave": TYPICAL}) == ()


def test_an_offset_clock_is_found_where_it_is_named():
    """Each record's displacement is late by a time of its own; forces and accelerations keep their clock."""
    model, rng, delays = coupled_model(("Heave",)), np.random.default_rng(3), (-0.25, 0.1, 0.3)
    records = []
    for k, delay in enumerate(delays):
        time = np.arange(0.0, 150.0, 0.25)
        omega, phase = rng.uniform(0.4, 1.2, (8, 1)), rng.uniform(0.0, 6.28, (8, 1))
        force = 1e5 * np.cos(omega * time + phase).sum(axis=0)
        motion = np.asarray(simulate(model, (time, force[None])).outputs)
        late = np.asarray(simulate(model, (time, force[None]), [("sensor_delay", "Heave", {"delay": delay})]).outputs)
        seen = {"Heave": late[0], "Heave_acceleration": motion[2]}
        noisy = {name: v + 0.005 * v.std() * rng.standard_normal(v.size) for name, v in seen.items()}
        records.append(rss.Record(time, noisy | {"Heave_force": force}, name=f"r{k}"))
    plain = rss.diagnose(model, records, pairs=False)
    assert plain.verdict.status != "no_gap" and any("clock_offset" in note for note in plain.notes)
    named = rss.diagnose(model, records, [*library(), "clock_offset"], pairs=False)
    (effect,) = named.verdict.effects
    assert named.verdict.status == "effect" and effect.name == "clock_offset"
    value, deviation = effect.parameters["delay"]  # of the first record
    assert abs(value - delays[0]) < 4.0 * deviation
    assert named.how_far.gap_after < 0.2 * plain.how_far.gap_after
