"""Decays whose file begins before the release: the body held away from rest is not free motion."""

import numpy as np
import pytest
from plant_bodies import tank_model
from scipy.integrate import solve_ivp

import radiation_ss as rss
from radiation_ss.records import since_release
from radiation_ss.simulation import let_go, simulate

PERIOD = 4.0


def decay(rng, noise, *, held=0.0, damping=0.05, step=0.1):
    """Return a motion 0.3 cos from rest away from its place, that of a body held until then before it."""
    time = np.arange(0.0, 8.0 * PERIOD + held, step)
    omega = 2.0 * np.pi / PERIOD
    since = np.maximum(time - held, 0.0)
    turning = omega * np.sqrt(1.0 - damping**2)
    x = 0.3 * np.exp(-damping * omega * since) * (np.cos(turning * since)
                                                  + damping * omega / turning * np.sin(turning * since))
    x += noise * 0.3 * rng.standard_normal(x.size)
    return rss.Record(time, {"Heave": x}, kind="decay", name="run")


@pytest.mark.parametrize("seed", range(20))
def test_the_record_begins_at_the_release(seed):
    rng = np.random.default_rng(seed)
    held = rng.uniform(0.3, 3.0) * PERIOD
    for noise in (0.0, 0.01, 0.02):
        record, (said,) = since_release(decay(rng, noise, held=held, damping=rng.uniform(0.01, 0.3)))
        # 1 - cos of the phase since the release is 5 %, and 4 standard deviations of the noise, when it is seen.
        late = np.arccos(1.0 - 0.05 - 4.5 * noise) / (2.0 * np.pi) * PERIOD
        assert held - 0.2 <= record.time[0] <= held + 1.5 * late + 0.1
        assert "held until" in said and "run" in said


@pytest.mark.parametrize("seed", range(20))
def test_all_motions_are_let_go_at_once(seed):
    rng = np.random.default_rng(seed)
    held = rng.uniform(0.3, 0.8) * PERIOD
    fast, slow = (decay(rng, 0.01, held=k * held, step=0.1 * k).channels["Heave"] for k in (1, 1 / 5))
    # The second motion is as slow as if time were five times as short.
    size = min(fast.size, slow.size)
    both = rss.Record(0.1 * np.arange(size), {"Roll": fast[:size], "Sway": slow[:size]}, kind="decay", name="run")
    record, said = since_release(both)
    assert said and abs(record.time[0] - held) < 0.1 * PERIOD


@pytest.mark.parametrize("seed", range(20))
def test_a_free_decay_stays_whole(seed):
    rng = np.random.default_rng(seed)
    for noise in (0.0, 0.01, 0.05):
        for damping in (0.01, 0.1, 0.5):
            record = decay(rng, noise, damping=damping, step=rng.choice([0.02, 0.1, 0.3]))
            cut = record.window(rng.uniform(0.0, PERIOD), np.inf)  # a file that begins in the middle of the motion
            for whole in (record, cut):
                assert since_release(whole) == (whole, ())


def test_waves_are_not_looked_at():
    record = decay(np.random.default_rng(0), 0.01, held=2.0 * PERIOD)
    driven = rss.Record(record.time, dict(record.channels), kind="motion-only")
    assert since_release(driven) == (driven, ())


@pytest.mark.parametrize("seed", range(4))
def test_a_body_held_before_its_decay_is_no_unknown_effect(seed):
    model, record, _ = held_and_free(seed)
    found = rss.diagnose(model, record, effects=["quadratic_drag", "linear_damping", "coulomb_friction"])
    assert found.verdict.status == "no_gap"
    assert any("run 3: the body is held until" in note for note in found.notes)


def held_and_free(seed, held=2.0):
    """Return the tank's model, a decay from 20 mm that is held before, and what it does from the release on."""
    model, rng = tank_model(), np.random.default_rng(seed)
    time = np.arange(0.0, 8.0, 0.02)
    start = np.zeros(model.matrices()[0].shape[0])
    start[model.fit.states] = 0.02
    free = np.asarray(simulate(model, (time, np.zeros((1, time.size))), start=start).outputs)
    seen = np.concatenate([np.full(round(held / 0.02), 0.02), free[0]])
    seen = seen + 1e-4 * rng.standard_normal(seen.size)
    record = rss.Record(0.02 * np.arange(seen.size), {"Heave": seen}, kind="decay", name="run 3")
    return model, record, free


@pytest.mark.parametrize("seed", range(4))
def test_simulate_holds_the_body_and_then_lets_it_go(seed):
    model, record, free = held_and_free(seed)
    found = np.asarray(simulate(model, record).outputs)
    until = round(2.0 / 0.02)
    late = 6  # samples by which a release is seen late: 1 - cos of their phase is 5 %, and 4.5 times the noise's .5 %
    # The start is fitted to 1.5 periods, some 60 samples, of noise .5 %: four numbers are known to 1 % at worst.
    assert np.abs(found[0, until + late:] - free[0, late:]).max() < 0.02 * 0.02
    assert np.allclose(found[0, :until - 1], found[0, 0], rtol=0.0, atol=1e-12)
    # A mean over 100 samples, of which the last ones are on their way.
    assert abs(found[0, 0] - 0.02) < 0.02 * (4.0 * 0.005 / 10.0 + 0.07 * late / 100.0)
    assert not found[1:, :until - 1].any()
    whole = simulate(model, record.window(2.0, np.inf)).outputs[0]
    assert np.abs(np.asarray(whole) - free[0]).max() < 0.02 * 0.02


@pytest.mark.parametrize("seed", range(3))
def test_identify_and_isolability_take_what_is_free(seed):
    model, record, _ = held_and_free(seed)
    cut, _ = since_release(record)
    whole, part = (rss.identify(model, r, "prediction-error", draws=50) for r in (record, cut))
    assert np.array_equal(whole.A.mean, part.A.mean) and np.array_equal(whole.B.lower, part.B.lower)
    assert any("run 3: the body is held until" in w for w in whole.warnings)
    assert not any("held until" in w for w in part.warnings)
    names = ["quadratic_drag", "linear_stiffness"]
    assert np.array_equal(rss.isolability(model, record, names).detectability,
                          rss.isolability(model, cut, names).detectability)


def test_a_record_that_does_not_move_the_model_is_refused():
    model, time = tank_model(), np.arange(0.0, 8.0, 0.02)
    roll = rss.Record(time, {"Roll": 0.3 * np.cos(time), "Roll_force": 0.0 * time}, kind="decay", name="run 4")
    with pytest.raises(rss.InputError, match=r"run 4: its columns, Roll, Roll_force, .* Heave, Heave_force or wave"):
        simulate(model, roll)
    assert simulate(model, roll, start={"Heave": 0.02}).outputs[0, 0] == 0.02
    assert not np.any(simulate(model, roll.with_channels(Heave_force=0.0 * time)).outputs)


def restored(damping=0.05):
    """Return the body whose free motion `decay` is."""
    return rss.body(dof="Heave", mass=50.0, added_mass=0.0, C=50.0 * (2.0 * np.pi / PERIOD) ** 2,
                    damping_ratio=damping)


def joined(*parts, rng, noise=0.003, step=0.1):
    """Return a decay of paths one after the other, with noise of a share of .3."""
    x = np.concatenate(parts)
    x = x + noise * 0.3 * rng.standard_normal(x.size)
    return rss.Record(step * np.arange(x.size), {"Heave": x}, kind="decay", name="run")


def lift(begin, periods, rng, smooth):
    """Return a path to .3 in some periods, even or with a start and an end at rest, without its last sample."""
    u = np.linspace(0.0, 1.0, int(periods * PERIOD / 0.1), endpoint=False)
    return begin + (0.3 - begin) * (u * u * (3.0 - 2.0 * u) if smooth else u)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_before_the_release_of_a_pushed_body_is_left_out(seed):
    rng = np.random.default_rng(seed)
    damping, rest, hold = rng.uniform(0.01, 0.2), rng.uniform(0.0, 3.0), rng.uniform(0.0, 3.0)
    before = np.concatenate([np.zeros(int(rest * PERIOD / 0.1)), lift(0.0, rng.uniform(1.0, 6.0), rng, seed % 2),
                             np.full(int(hold * PERIOD / 0.1), 0.3)])
    free = decay(rng, 0.0, damping=damping).channels["Heave"]
    model = restored(damping * rng.uniform(0.5, 1.5))
    for noise in (0.0, 0.003, 0.02):
        record, (said,) = let_go(model, joined(before, free, rng=rng, noise=noise))
        # The averages are over half a period: what is not held at last is known to a quarter of that.
        assert -0.1 <= record.time[0] - 0.1 * before.size + 1e-9 < 0.125 * PERIOD
        assert "pushed and held until" in said


@pytest.mark.parametrize("seed", range(5))
def test_what_is_between_two_decays_is_left_out(seed):
    rng = np.random.default_rng(seed)
    free = decay(rng, 0.0, damping=0.02).channels["Heave"]
    first = free[:int(rng.uniform(4.0, 7.0) * PERIOD / 0.1)]
    between = np.concatenate([lift(first[-1], 3.0, rng, seed % 2), np.full(40, 0.3)])
    record, (said,) = let_go(restored(), joined(first, between, free, rng=rng))
    out = record.time[np.isnan(record.channels["Heave"])]
    start, end = 0.1 * first.size, 0.1 * (first.size + between.size)
    assert start - PERIOD < out[0] < start + 0.25 * PERIOD and abs(out[-1] - end) < 0.25 * PERIOD
    assert "a force that is not in the model acts from" in said
    found = rss.diagnose(restored(0.02), record.with_channels(Heave=joined(first, between, free, rng=rng).channels[
        "Heave"]), effects=["quadratic_drag"])
    assert found.verdict.status == "no_gap"


@pytest.mark.parametrize("seed", range(5))
def test_a_body_that_is_stopped_is_not_looked_at_any_more(seed):
    rng = np.random.default_rng(seed)
    free = decay(rng, 0.0, damping=0.02).channels["Heave"]
    first = free[:int(rng.uniform(3.0, 6.0) * PERIOD / 0.1)]
    for place in (0.0, first[-1]):
        record, said = let_go(restored(), joined(first, np.full(100, place), rng=rng))
        assert abs(record.time[-1] - 0.1 * first.size) < 0.5 * PERIOD
        assert "s on; that is left out" in said[0]


@pytest.mark.parametrize("law", [lambda x, v: -0.05 * np.tanh(v / 1e-3), lambda x, v: -0.6 * v * abs(v),
                                 lambda x, v: -0.4 * x, lambda x, v: 0.3 * x, lambda x, v: -0.5 * v,
                                 lambda x, v: 6.0 * x**3, lambda x, v: 0.1, lambda x, v: -3.0 * v],
                         ids=["friction", "drag", "stiffer", "softer", "damping", "softening", "offset", "overdamped"])
def test_what_resists_or_restores_a_body_is_no_push(law):
    rng, omega = np.random.default_rng(0), 2.0 * np.pi / PERIOD
    for start in (0.3, -0.1):
        moved = solve_ivp(lambda t, s: [s[1], -omega**2 * s[0] - 0.04 * omega * s[1] + law(*s)], (0.0, 60.0),
                          [start, 0.0], t_eval=np.arange(0.0, 60.0, 0.1), rtol=1e-7, max_step=0.05)
        for noise in (0.0, 0.003):
            record = joined(moved.y[0], rng=rng, noise=noise)
            assert let_go(restored(), record) == (record, ())
