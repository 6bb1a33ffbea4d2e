"""Dropouts of a camera or a radio link: taken as missing where they are beyond doubt, never from a sharp motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.simulation import SpikeRules, measured_freely, simulate, without_spikes

PERIOD = 1.0


def sea(rng, count, rate):
    """Return times and a random motion of unit rms about one cycle per PERIOD."""
    time = np.arange(count) / rate
    omega = 2.0 * np.pi * rng.uniform(0.5, 1.8, 40)
    size = rng.rayleigh(size=40) * np.exp(-(((omega / (2.0 * np.pi) - 1.0) / 0.25) ** 2))
    x = size @ np.cos(np.outer(omega, time) + rng.uniform(0.0, 2.0 * np.pi, (40, 1)))
    return time, x / x.std()


def struck(rng, count, rate, stiffer):
    """Return times, position and speed of an oscillator that strikes a rigid stop (stiffer None) or a hard spring."""
    fine, omega, stop = 30, 2.0 * np.pi / PERIOD, rng.uniform(0.3, 0.8)
    dt, drive, back = 1.0 / rate / fine, rng.uniform(0.6, 1.4) * omega, rng.uniform(0.2, 1.0)
    x, v, path = 0.0, 0.0, []
    for i in range(count * fine):
        if i % fine == 0:
            path.append((x, v))
        push = 0.0 if stiffer is None else stiffer * omega**2 * max(x - stop, 0.0)
        v += dt * (0.2 * omega**2 * np.cos(drive * i * dt) - omega**2 * x - 0.1 * omega * v - push)
        x += dt * v
        v = -back * v if stiffer is None and x > stop and v > 0.0 else v
    return np.arange(count) / rate, *np.array(path).T


def sharp(rng, rate):
    """Return one motion of every kind, sharp ones among them."""
    time, waves = sea(rng, 500, rate)
    since = np.maximum(time - rng.uniform(0.0, 4.0), 0.0)
    yield "sea", waves
    yield "dying sea", waves * np.exp(-time / time[-1] * rng.uniform(0.0, 9.0))
    yield "release", np.cos(2.0 * np.pi * since) * np.exp(-rng.uniform(0.02, 1.5) * since)
    yield "friction", np.maximum(1.0 - 0.05 * np.floor(2.0 * time), 0.0) * np.cos(2.0 * np.pi * time)
    yield "steps", np.cumsum(rng.random(time.size) < 0.01) + 0.1 * np.cos(time)
    _, bounced, _ = struck(rng, 300, rate, None)
    yield "end stop", bounced
    _, x, v = struck(rng, 300, rate, 10.0 ** rng.uniform(0.0, 3.0))
    yield "snap", x
    yield "speed in a snap", v


@pytest.mark.parametrize("seed", range(12))
def test_no_sharp_motion_loses_a_sample(seed):
    rng = np.random.default_rng(seed)
    rate = rng.choice([6.0, 8.0, 12.0, 24.0, 50.0])
    for noise in (0.0, 1e-3, 0.01, 0.05):
        for name, x in sharp(rng, rate):
            seen = x + noise * x.std() * rng.standard_normal(x.size)
            seen[rng.random(x.size) < rng.choice([0.0, 0.1])] = np.nan
            record = rss.Record(np.arange(x.size) / rate, {"Heave": seen}, kind="motion-only")
            kept, said = without_spikes(record, PERIOD)
            assert kept is record and not said, (name, noise, said)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(2.0, 200.0), st.floats(0.0, 0.3))
def test_noise_alone_loses_no_sample(seed, rate, noise):
    rng = np.random.default_rng(seed)
    time, x = sea(rng, 400, rate)
    record = rss.Record(time, {"Heave": x + noise * rng.standard_normal(x.size)}, kind="motion-only")
    assert without_spikes(record, PERIOD) == (record, ())


@pytest.mark.parametrize("seed", range(10))
def test_spikes_are_missing_and_the_rest_is_untouched(seed):
    rng = np.random.default_rng(seed)
    time, x = sea(rng, 1000, 24.0)
    clean = x + 0.01 * rng.standard_normal(x.size)
    at = 40 + 60 * np.arange(15) + rng.integers(0, 40, 15)
    # A corner explains all but .18 of a spike's square beside a quintic through 13 samples: 5 deviations more than it
    # leaves are 12 of the noise, and what the noise itself does to that is 3 of them. Twice that is seen.
    size = 2.0 * (max(SpikeRules().apart, 12.0) + 3.0) * 0.01 * rng.uniform(1.0, 20.0, 15)
    spiked = clean.copy()
    spiked[at] += size * rng.choice([-1.0, 1.0], 15)
    accelerations = {"Heave_acceleration": spiked, "Heave_force": spiked, "wave_elevation": spiked}
    record = rss.Record(time, {"Heave": spiked, **accelerations}, name="run 7")
    kept, (said,) = without_spikes(record, PERIOD)
    assert np.array_equal(np.flatnonzero(np.isnan(kept.channels["Heave"])), at)
    others = np.setdiff1d(np.arange(x.size), at)
    assert np.array_equal(kept.channels["Heave"][others], clean[others])
    for name in accelerations:
        assert np.array_equal(kept.channels[name], spiked)
    assert "15 of 1000 samples stand apart" in said and "Heave of run 7" in said


def test_a_swing_of_one_sample_is_no_spike():
    time = np.arange(0.0, 120.0, 0.4)
    since = np.maximum(time - 20.0, 0.0)
    record = rss.Record(time, {"Heave": np.cos(2.0 * np.pi * since) * np.exp(-1.4 * since)}, kind="decay")
    assert without_spikes(record, PERIOD) == (record, ())


@pytest.mark.parametrize("seed", [1, 2])
def test_dropouts_are_no_unknown_effect(seed):
    model, rng = tank_model(), np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.02)
    omega = np.linspace(4.0, 12.0, 60)
    force = np.exp(-(((omega - 8.0) / 1.5) ** 2)) @ np.cos(np.outer(omega, time) + rng.uniform(0, 6.28, (60, 1)))
    x = np.array(simulate(model, (time, force[None])).outputs[0])
    x += 0.01 * x.std() * rng.standard_normal(x.size)
    out = rng.random(x.size) < 0.003
    x[out] += 1.5 * x.std() * rng.choice([-1.0, 1.0], out.sum())
    record = rss.Record(time, {"Heave": x, "Heave_force": force}, name="sea")
    found = rss.diagnose(model, record, effects=["quadratic_drag", "coulomb_friction", "cubic_stiffness"])
    assert found.verdict.status == "no_gap"
    assert any("stand apart" in note for note in found.notes)
    assert np.isnan(measured_freely(model, record)[0].channels["Heave"]).sum() >= 1


def test_a_diagnosis_says_what_it_leaves_out():
    fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    time = np.arange(0.0, 12.0, 0.02)
    heave = 0.1 * np.exp(-0.5 * time) * np.cos(6.0 * time) + 3e-4 * np.random.default_rng(0).standard_normal(time.size)
    assert not rss.diagnose(model, rss.Record(time, {"Heave": heave}, kind="decay"), effects=["quadratic_drag"]).notes
    heave[200] += 0.05
    found = rss.diagnose(model, rss.Record(time, {"Heave": heave}, kind="decay"), effects=["quadratic_drag"])
    assert len(found.notes) == 1 and "1 of 600 samples" in found.notes[0] and "4 s" in found.notes[0]
