"""Waves that travel, against the dispersion relation solved by bisection and against probes in a flume."""

import numpy as np
import pytest
from scipy.optimize import bisect

import radiation_ss as rss
from radiation_ss.hydro import group_velocity, wave_number

G = 9.81


def k_of(w, depth):
    """Return k of w^2 = g k tanh(k h) by bisection."""
    if np.isinf(depth):
        return w**2 / G
    return bisect(lambda k: G * k * np.tanh(k * depth) - w**2, 1e-9, 1e3 * w**2 / G + 10.0 * w / np.sqrt(G * depth),
                  xtol=1e-14, rtol=1e-14)


@pytest.mark.parametrize("depth", [0.4, 5.0, np.inf])
def test_wave_number_and_group_speed(depth):
    for w in (0.3, 1.0, 3.0, 8.0):
        k = wave_number(w**2 / G, depth)
        assert k == pytest.approx(k_of(w, depth), rel=1e-9)
        step = 1e-5 * w
        slope = 2.0 * step / (k_of(w + step, depth) - k_of(w - step, depth))
        assert group_velocity(w, k, depth) == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize("depth", [20.0, np.inf])
@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi / 2.0, 2.5, np.pi])
def test_the_frequencies_that_meet_the_body_are_those_that_are_met(heading, depth):
    speed = 7.974
    for omega in (0.3, 0.6, 1.2):
        met = omega - k_of(omega, depth) * speed * np.cos(heading)
        assert rss.encounter_frequency(omega, speed, heading, depth=depth) == pytest.approx(met, rel=1e-9, abs=1e-12)
        waves = rss.wave_frequencies(abs(met), speed, heading, depth=depth)
        assert min(abs(w - omega) for w in waves) < 1e-6
        for w in waves:
            assert abs(w - k_of(w, depth) * speed * np.cos(heading)) == pytest.approx(abs(met), abs=1e-6)
    assert rss.wave_frequencies(0.5, 0.0) == pytest.approx((0.5,))


def test_following_seas_have_three_waves_up_to_tau_of_a_quarter():
    speed = 8.0
    low, high = 0.24 * G / speed, 0.26 * G / speed
    assert [len(rss.wave_frequencies(w, speed, 0.0)) for w in (low, high)] == [3, 1]


@pytest.mark.parametrize("depth, distance", [(np.inf, 6.0), (np.inf, -4.0), (1.0, 6.0)])
def test_a_random_sea_some_way_on(depth, distance):
    sea = rss.realise(rss.jonswap(0.05, 1.2), 160.0, 0.04, seed=2)
    part = slice(800, 3200)
    there = sea.elevation_at(distance, depth=depth)[part]
    found = rss.carry_elevation(sea.elevation[part], 0.04, distance, depth=depth)
    known = np.isfinite(found)
    assert known.sum() > 1200
    assert known[-1] if distance > 0.0 else known[0]
    assert np.std(found[known] - there[known]) < 0.06 * np.std(there)


@pytest.mark.parametrize("run", ["1041_1.csv", "1081_1.csv.gz", "1101_1.csv"])
def test_probes_in_a_flume(data, run):
    # Sundsdal et al. 2025: probes at y = 3.00 and 5.50 m, depth 1.0 m, from the wave front on, no model in.
    table = np.genfromtxt(data / "ntnu_section" / "waves" / run, delimiter=",", names=True)
    t = table["time_s"]
    found = rss.carry_elevation(table["wp1_m"], float(np.median(np.diff(t))), 2.5, depth=1.0)
    part = (t > 16.0) & (t < 33.0)
    assert np.corrcoef(found[part], table["wp4_m"][part])[0, 1] > 0.995
    assert np.corrcoef(table["wp1_m"][part], table["wp4_m"][part])[0, 1] < 0.9


@pytest.mark.parametrize("call, words", [
    (lambda: rss.carry_elevation([0.0, np.nan, 1.0], 0.1, 1.0), "not finite"),
    (lambda: rss.carry_elevation(np.sin(np.arange(100) * 0.3), 0.1, 1e4), "too short"),
    (lambda: rss.carry_elevation(np.zeros(10), -0.1, 1.0), "dt: must be positive"),
    (lambda: rss.wave_frequencies(0.0, 1.0), "encounter: must be positive"),
    (lambda: rss.encounter_frequency(1.0, np.nan), "finite"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()


@pytest.mark.parametrize("wrong", [{"share": 2.0}, {"share": 1.0}, {"g": 0.0}])
def test_arguments_out_of_their_range_are_refused(wrong):
    with pytest.raises(rss.InputError, match=next(iter(wrong))):
        rss.carry_elevation(np.cos(np.arange(0.0, 20.0, 0.05)), 0.05, 1.0, **wrong)
