"""The force of an elevation: how much of a record's ends it is unsure in, and X that is given too coarsely."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss import HydroData
from radiation_ss.inference import parted
from radiation_ss.simulation import coarse_excitation, exciting_force, mean_frequency, unsure_edge

MIDDLE = 6.0  # rad/s
PERIODS, LONGEST, TURN = 1.5, 1.0 / 6.0, 1.0


def body(X, omega):
    model = tank_model()
    table = np.ones((omega.size, 1, 1))
    X = np.asarray(X, dtype=complex)[:, None, None]
    return model.replace(hydro=HydroData(omega, table, 0.0 * table, A_inf=[[1.0]], dofs=("Heave",), M=model.M,
                                         C=model.C, X=X))


def sea(rng, time):
    omega = np.linspace(4.0, 8.0, 400) + rng.uniform(0.0, 0.01, 400)
    size = rng.rayleigh(size=400) * np.exp(-(((omega - MIDDLE) / 1.0) ** 2))
    waves = np.exp(1j * np.outer(time, omega)) * (size * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, 400)))
    return omega, waves


def record(time, elevation):
    return rss.Record(time, {"Heave": elevation, "wave_elevation": elevation}, name="run 2")


@pytest.mark.parametrize("seed", range(6))
def test_the_edge_is_what_a_long_body_reaches(seed):
    """A body of sections that see the waves from 4 s before to 4 s after: X = sin(4 w) / (4 w)."""
    rng, half = np.random.default_rng(seed), 4.0
    long = np.arange(-20.0, 80.0, 0.05)
    omega, waves = sea(rng, long)
    force = (waves * np.sinc(omega * half / np.pi)).sum(axis=1).real
    at = np.linspace(2.0, 12.0, 400)
    model = body(np.sinc(at * half / np.pi), at)
    inside = (long >= 0.0) & (long < 60.0)
    seen = record(long[inside], waves[inside].sum(axis=1).real)
    edge = unsure_edge(model, seen)
    assert edge >= half
    time, found = seen.time, exciting_force(model, seen)[0](seen.time)
    error = np.abs(found - force[inside]) / force[inside].std()
    short = PERIODS * 2.0 * np.pi / mean_frequency(time, seen.channels["wave_elevation"])
    sure, before = ((time > cut) & (time < 60.0 - cut) for cut in (edge, short))
    # Below the 1 % noise of a good record, where 1.5 periods left many times that.
    assert np.sqrt(np.mean(error[sure] ** 2)) < 0.01 and np.sqrt(np.mean(error[before] ** 2)) > 0.05


@pytest.mark.parametrize("seed", range(3))
def test_a_gap_of_the_motion_takes_no_force_from_the_parts_beside_it(seed):
    rng, half, time = np.random.default_rng(seed), 4.0, np.arange(0.0, 120.0, 0.05)
    omega, waves = sea(rng, time)
    force = (waves * np.sinc(omega * half / np.pi)).sum(axis=1).real
    elevation, at = waves.sum(axis=1).real, np.linspace(2.0, 12.0, 400)
    model, gap = body(np.sinc(at * half / np.pi), at), (time > 58.0) & (time < 60.0)
    seen = record(time, elevation).with_channels(Heave=np.where(gap, np.nan, elevation))
    parts, _ = parted(model, seen)
    assert len(parts) == 2
    for part, (first, last) in zip(parts, ((0.0, 58.0), (60.0, 120.0))):
        edge = unsure_edge(model, part)
        inside = (part.time >= part.time[0] + edge) & (part.time <= part.time[-1] - edge)
        sure = part.time[inside]
        assert first <= sure[0] and sure[-1] <= last and np.isfinite(part.channels["Heave"][inside]).all()
        assert min(sure[0] - first, last - sure[-1]) < 0.1  # nothing is lost beside the gap
        error = exciting_force(model, part)[0](sure) - np.interp(sure, time, force)
        assert np.sqrt(np.mean(error**2)) < 0.01 * force.std()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0), st.floats(10.0, 200.0))
def test_never_less_than_before_nor_more_than_a_record_can_spare(seed, delay, duration):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 0.1)
    seen = record(time, sea(rng, time)[1].sum(axis=1).real)
    at = np.linspace(2.0, 12.0, 100)
    edge = unsure_edge(body(rng.standard_normal() * np.exp(-1j * delay * at), at), seen)
    least = PERIODS * 2.0 * np.pi / mean_frequency(time, seen.channels["wave_elevation"])
    length = time[-1]
    assert min(least, LONGEST * length) <= edge <= LONGEST * length
    known = seen.with_channels(Heave_force=0.0 * time)
    assert unsure_edge(body(np.ones(at.size), at), known) == 0.0


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 29).map(lambda tenths: (tenths + 0.3) / 10.0))
def test_a_turn_of_more_than_a_radian_is_told(seed, turn):
    rng, time = np.random.default_rng(seed), np.arange(0.0, 60.0, 0.1)
    seen = record(time, sea(rng, time)[1].sum(axis=1).real)
    at = np.arange(2.0, 12.0, 0.2)
    model = body(np.exp(-1j * turn / 0.2 * at), at)
    said = coarse_excitation(model, seen)
    assert bool(said) == (turn > TURN)
    if said:
        assert f"X of Heave turns by {turn:.1f} rad between" in said[0] and "run 2" in said[0]
    assert not coarse_excitation(model, seen.with_channels(Heave_force=0.0 * time))


def test_turns_where_there_is_no_force_do_not_matter():
    time = np.arange(0.0, 60.0, 0.1)
    seen = record(time, sea(np.random.default_rng(0), time)[1].sum(axis=1).real)
    at = np.arange(0.5, 25.0, 0.1)
    far = np.where((at < 2.5) | (at > 10.0), np.exp(30j * at), 1.0)  # beyond the sea's energy
    assert not coarse_excitation(body(far, at), seen)
    assert not coarse_excitation(body(at - MIDDLE, at), seen)  # a force that changes its sign turns by pi at zero


@pytest.mark.parametrize("seed", range(4))
def test_where_no_word_comes_the_force_is_right(seed):
    """The X of a body that is even fore and aft has signs in place of phases: steps of 1.2 and .2 rad."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 60.0, 0.05)
    omega, waves = sea(rng, time)
    seen, edge = record(time, waves.sum(axis=1).real), slice(200, -200)
    force = (waves * np.sinc(omega * 4.0 / np.pi)).sum(axis=1).real
    for step, told in ((0.3, True), (0.05, False)):
        at = np.arange(2.0, 12.0, step)
        model = body(np.sinc(at * 4.0 / np.pi), at)
        error = np.std(exciting_force(model, seen)[0](time)[edge] - force[edge]) / np.std(force[edge])
        assert bool(coarse_excitation(model, seen)) == told
        assert told or error < 0.02


def test_diagnose_says_that_X_is_coarse():
    time = np.arange(0.0, 40.0, 0.1)
    rng = np.random.default_rng(0)
    waves = sea(rng, time)[1].sum(axis=1).real
    at = np.arange(2.0, 12.0, 0.4)
    model = body(100.0 * np.exp(-4j * at), at)
    force = exciting_force(model, record(time, waves))[0](time)
    moved = np.asarray(rss.simulate(model, (time, force[None])).outputs[0])
    found = rss.diagnose(model, rss.Record(time, {"Heave": moved + 1e-2 * moved.std() * rng.standard_normal(time.size),
                                                  "wave_elevation": waves}, name="sea"), effects=["quadratic_drag"])
    assert any("X of Heave turns by 1.6 rad" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_a_short_record_is_checked_by_a_force_that_is_sure(seed):
    """Twenty waves, none withheld: the last third, seven of them, is predicted by the waves before it, too."""
    rng, long = np.random.default_rng(seed), np.arange(-30.0, 50.0, 0.05)
    omega, waves = sea(rng, long)
    at = np.linspace(2.0, 12.0, 400)
    model = body(20.0 * np.sinc(0.8 * at / np.pi), at)
    force = (20.0 * waves * np.sinc(0.8 * omega / np.pi)).sum(axis=1).real
    moved = np.asarray(rss.simulate(model, (long, force[None])).outputs[0])
    inside = (long >= 0.0) & (long < 20.0)
    seen = rss.Record(long[inside], {"Heave": moved[inside] + 0.005 * moved.std() * rng.standard_normal(inside.sum()),
                                     "wave_elevation": waves[inside].sum(axis=1).real}, name="short")
    found = rss.diagnose(model, seen, effects=["quadratic_drag"])
    assert found.how_far.gap_before < 0.02  # noise .005; by the last third's own waves alone .04 to .14


@pytest.mark.parametrize("level", [0.0, 0.1])
def test_a_probe_in_still_water_makes_no_force_and_no_edge(level):
    time, at = np.arange(0.0, 40.0, 0.1), np.linspace(2.0, 12.0, 100)
    model, swing = body(np.ones(at.size), at), np.exp(-0.05 * time) * np.cos(6.0 * time)
    still = record(time, np.full(time.size, level)).with_channels(Heave=swing)
    assert unsure_edge(model, still) == 0.0
    assert rss.diagnose(model, still, effects=["quadratic_drag"]).verdict.status == "no_gap"
