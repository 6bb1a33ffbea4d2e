"""Channels that hang: found wherever they let go, and never taken for a force or a body that is held."""

import numpy as np
import pytest
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.records import suspicions, without_faults

TIME = np.arange(0.0, 90.0, 0.05)


def sea(rng, low=3.0, high=10.0):
    """Return a random signal of unit rms with frequencies between two [rad/s]."""
    omega, phase = np.sort(rng.uniform(low, high, 40)), rng.uniform(0.0, 2.0 * np.pi, 40)
    x = np.cos(np.outer(TIME, omega) + phase).sum(axis=1)
    return x / x.std()


def left_out_of(name, values, kind="forced"):
    kept, said = without_faults(rss.Record(TIME, {name: values}, kind=kind))
    return np.flatnonzero(np.isnan(kept.channels[name])), said


@pytest.mark.parametrize("name", ["Heave", "Heave_force", "wave_elevation"])
@pytest.mark.parametrize("first", [300, 700, 1100])
def test_a_hang_is_found_whatever_its_length_and_wherever_the_motion_is_at_its_end(name, first):
    rng = np.random.default_rng(4)
    whole = sea(rng) + 0.01 * rng.standard_normal(TIME.size)
    for count in (10, 20, 50, 100, 120, 130, 170, 200, 400, 500, TIME.size - first):
        values = whole.copy()
        values[first: first + count] = values[first]
        missing, said = left_out_of(name, values)
        assert np.array_equal(missing, np.arange(first + 1, first + count)), count
        assert len(said) == 1 and f"{name} of" in said[0] and f"{count - 1} of {TIME.size} samples" in said[0]
        assert any("hangs" in text for text in suspicions(rss.Record(TIME, {name: values}, kind="forced")))


def lawful_forces(rng):
    """Yield forces that repeat themselves as whoever drives the body wants it, by what they are."""
    noise, white = 0.01 * rng.standard_normal(TIME.size), rng.standard_normal(TIME.size)
    yield "zero", np.zeros(TIME.size)
    yield "constant", np.full(TIME.size, 1.3)
    yield "stepped", np.repeat(rng.standard_normal(18), 100)
    yield "stepped in three levels", np.repeat(rng.choice([-1.0, 0.0, 2.0], 60), 30)
    yield "square", np.sign(np.sin(2.0 * TIME) + 1e-9)
    yield "pulses", 0.4 + (np.sin(2.0 * TIME) > 0.98)
    yield "taps", np.where(rng.random(TIME.size) < 0.01, white, 0.0)
    yield "held by a converter", (sea(rng) + noise)[np.arange(TIME.size) // 7 * 7]
    yield "noise in two levels", np.repeat(rng.choice([-1.0, 1.0], TIME.size // 2), 2)
    yield "random in two levels", rng.choice([-1.0, 1.0], TIME.size)
    yield "off at last", np.where(TIME < 60.0, sea(rng) + noise, 0.0)
    yield "off at first", np.where(TIME > 20.0, sea(rng) + noise, 0.7)
    yield "white, with pauses at its middle", np.where(np.sin(0.4 * TIME) > 0.5, 2.5, 2.5 + white)
    yield "sweep, then held", np.sin(np.minimum(TIME, 60.0) ** 2 / 20.0)
    yield "clipped by the actuator", np.clip(sea(rng), -0.8, 0.8)


@pytest.mark.parametrize("seed", range(4))
def test_a_force_that_is_held_is_no_hang(seed):
    for what, force in lawful_forces(np.random.default_rng(seed)):
        for quantum in (0.0, 1e-3, 0.05):
            seen = np.round(force / quantum) * quantum if quantum else force
            missing, said = left_out_of("Heave_force", seen)
            assert not missing.size and not said, (what, quantum)
            assert not any("hangs" in text for text in suspicions(rss.Record(TIME, {"Heave_force": seen}))), what


@pytest.mark.parametrize("quantum", [1e-6, 1e-3, 0.01, 0.05])
@pytest.mark.parametrize("name, noise", [("Heave", 0.0), ("Heave", 0.1), ("wave_elevation", 0.1), ("Heave_force", 0.4)])
def test_a_signal_that_hardly_moves_is_no_hang(quantum, name, noise):
    """Noise is in levels: that of a coarse sensor does not show where nothing moves."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        since = np.maximum(TIME - 20.0, 0.0)
        for x in (sea(rng, 0.02, 0.2), np.cos(2.0 * since) * np.exp(-0.3 * since), 0.2 * sea(rng) * (TIME > 30.0),
                  np.sin(3.0 * since) * np.exp(-0.1 * since)):
            levels = np.round(x / quantum + noise * rng.standard_normal(x.size))
            missing, said = left_out_of(name, quantum * levels, "motion-only")
            assert not missing.size, (seed, said)


def test_loads_and_places_of_a_static_test_are_read_many_times():
    rng = np.random.default_rng(0)
    load = np.r_[rng.standard_normal(60), np.repeat(rng.standard_normal(4), 12)]
    record = rss.Record(np.arange(load.size), {"Roll": 0.01 * load, "Roll_force": load}, kind="static")
    assert not any("hangs" in text for text in suspicions(record))


@pytest.mark.parametrize("name", ["Heave", "Heave_force"])
def test_the_second_half_of_a_record_that_hangs_is_no_gap_of_the_model(name):
    model, rng = tank_model(), np.random.default_rng(2)
    force = sea(rng, 4.0, 11.0)
    step = rss.simulate(model, (TIME, force[None]))
    heave = np.asarray(step.outputs[0])
    channels = {"Heave": heave + 0.01 * heave.std() * rng.standard_normal(TIME.size),
                "Heave_force": force + 0.01 * rng.standard_normal(TIME.size)}
    channels[name][900:] = channels[name][900]
    found = rss.diagnose(model, rss.Record(TIME, channels, kind="forced"),
                         effects=["quadratic_drag", "coulomb_friction", "sensor_gain"])
    assert found.verdict.status == "no_gap"
    assert any(f"{name} of" in note and "899 of 1800 samples" in note for note in found.notes)
