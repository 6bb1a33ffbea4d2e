"""Live use: clear refusals, no dependence on the clock's origin or on cuts of a record, short steps, sampled plants."""

import gc
import time
import warnings

import numpy as np
import pytest

import radiation_ss as rss
from benchmarks.coupled_body import body
from benchmarks.heave_tank import BAND, POINTS, TRUTH, error, known, sea_record, start, tank, with_force


def samples_of(record):
    return [{"time": float(t), **{name: float(v[i]) for name, v in record.channels.items()}}
            for i, t in enumerate(record.time)]


@pytest.mark.parametrize(("sample", "word"), [
    ({"time": 0.0, "heave": 1.0}, "'heave' is unknown"), ({"Heave": 1.0}, "`time`"),
    ({"time": np.nan, "Heave": 1.0}, "`time`"), ({"time": 0.0, "Heave": "1.0"}, "finite number"),
    ({"time": 0.0, "Heave": np.inf}, "finite number"), ({"time": 0.0, "wave_elevation": 0.1}, "is unknown"),
    ([0.0, 1.0], "list found; a mapping")])
def test_a_step_that_cannot_be_meant_is_refused(sample, word):
    live = rss.DualEnKF(tank()).prepare(sea_record(0, duration=1.0)[0])
    with pytest.raises(rss.InputError, match=word):
        live.step(sample)


def test_an_option_that_there_is_not_is_named():
    with pytest.raises(rss.InputError, match=r"'ensemble' is unknown.*n_ensemble"):
        rss.DualEnKF(tank(), ensemble=50)
    with pytest.raises(rss.InputError, match="a1"):
        rss.DualEnKF(tank(), prior=[0.1, 0.2])
    with pytest.raises(rss.InputError, match="R: 'small'; a number"):
        rss.DualEnKF(tank(), preset="paper", R="small")
    with pytest.raises(rss.InputError, match="noise: channel 'heave' is unknown; use any of Heave, Heave_velocity"):
        rss.DualEnKF(tank(), noise={"heave": 1e-4})
    one, two = (rss.DualEnKF(tank(), seed=0, noise={"Heave": level}).run(sea_record(1, duration=5.0)[0]).force.mean
                for level in (1e-4, np.array(1e-4)))
    assert np.array_equal(one, two)
    for level in (0.0, -1e-4, np.nan, "a", np.array([1e-4])):
        with pytest.raises(rss.InputError, match=r"noise of Heave: .*above 0"):
            rss.DualEnKF(tank(), noise={"Heave": level})
    with pytest.raises(rss.InputError, match="Q_theta: an option of the paper's filter"):
        rss.DualEnKF(tank(), Q_theta=1e-6)


def sailed(seed, size=1.0, period=0.9, duration=20.0):
    """Return displacement and acceleration of the tank in a sea of 60 waves, by the impedance of each of them."""
    rng, time, model = np.random.default_rng(seed), np.arange(0.0, duration, 0.02), tank()
    omega = 2.0 * np.pi / period * (0.7 + rng.random(60))
    K = model.fit.frequency_response(omega)[:, 0, 0]
    motion = (rng.standard_normal((60, 2)) @ [1.0, 1.0j] * np.exp(-0.5 * (omega * period / 6.3 - 1.0) ** 2 / 0.04)
              / (-omega**2 * (model.M + model.A_inf)[0, 0] + 1j * omega * K + model.C[0, 0]))
    x, a = ((np.exp(1j * np.outer(time, omega)) @ part).real for part in (motion, -omega**2 * motion))
    return rss.Record(time, {name: size * (row + 0.01 * row.std() / size * rng.standard_normal(time.size))
                             for name, row in (("Heave", x), ("Heave_acceleration", a))})


def told_live(first, record, factors, **options):
    """Return what a filter prepared on one record warns of when another one's samples come live, times factors."""
    live = rss.DualEnKF(tank(), seed=0, **options).prepare(first)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for sample in samples_of(record):
            live.step({name: value * factors.get(name, 1.0) for name, value in sample.items()})
    return [str(w.message) for w in said if w.category is RuntimeWarning]


@pytest.mark.parametrize("factors", [{"Heave": 1000.0}, {"Heave": -1.0}, {"Heave": 0.01}, {"Heave_acceleration": -1.0},
                                     {"Heave_acceleration": 1 / 9.81}, {"Heave": 1e3, "Heave_acceleration": 1e3}])
def test_live_samples_in_another_unit_or_sign_are_told_once(factors):
    said = told_live(sailed(1), sailed(2), factors)
    assert len(said) == 1 and "check that units and signs" in said[0]
    assert "Heave [m]" in said[0] or "Heave_acceleration [m/s^2]" in said[0]


@pytest.mark.parametrize("name", ["Heave", "Heave_acceleration"])
def test_one_channel_alone_in_another_unit_is_told(name):
    first, record = (rss.Record(r.time, {name: r.channels[name]}) for r in (sailed(1), sailed(2)))
    assert len(told_live(first, record, {name: 1000.0})) == 1


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("size", "period"), [(1.0, 0.9), (3.0, 0.9), (3.0, 1.4), (0.1, 0.9), (2.0, 0.6)])
def test_honest_live_samples_of_another_sea_are_not_told_of(seed, size, period):
    assert not told_live(sailed(seed), sailed(10 + seed, size, period), {})


@pytest.mark.parametrize("origin", [1024.0, 1.7e9, -3.3])
def test_the_origin_of_time_does_not_matter(origin):
    record, force = sea_record(1, duration=20.0)
    record = with_force(record, force, 1)
    moved = rss.Record(record.time + origin, dict(record.channels))
    one, two = (rss.DualEnKF(start(1), seed=1, omega=BAND).run(r) for r in (record, moved))
    size = one.force.mean.std()
    # Times of 1.7e9 s are known to 2.4e-7 s: 1e-5 of the interval, 1e-8 of the record.
    np.testing.assert_allclose(two.force.mean, one.force.mean, atol=1e-5 * size)
    np.testing.assert_allclose(two.theta[:, -1], one.theta[:, -1], rtol=1e-4)


def test_a_clock_that_was_set_is_refused_at_once_and_harms_nothing():
    """From seconds since the start to seconds since 1970: the filter would run through all of them."""
    live, other = (rss.DualEnKF(tank()).prepare(sea_record(0, duration=1.0)[0]) for _ in range(2))
    begun = time.monotonic()
    for filter_ in (live, other):
        filter_.step({"time": 1.0, "Heave": 0.001})
    with pytest.raises(rss.InputError, match=r"time: 1700000001 s comes 1.7e\+09 s after the sample before"):
        live.step({"time": 1.7e9 + 1.0, "Heave": 0.001})
    assert time.monotonic() - begun < 10.0
    one, two = (filter_.step({"time": 1.01, "Heave": 0.001}) for filter_ in (live, other))
    assert np.array_equal(one.force, two.force) and one.time == two.time == 1.01


def test_rounded_times_give_the_numbers_of_exact_ones():
    record, _ = sea_record(2, duration=20.0)
    rounded = rss.Record(np.round(record.time * (1.0 + 1e-9), 5), dict(record.channels))
    one, two = (rss.DualEnKF(start(2), seed=2, points=known(POINTS)).run(r).force.mean for r in (record, rounded))
    np.testing.assert_allclose(two, one, atol=1e-5 * one.std())


def test_a_split_record_gives_the_force_of_the_whole_within_its_band():
    inside = []
    for seed in range(4):
        record, _ = sea_record(seed, duration=40.0)
        late = record.window(20.0, np.inf)
        whole = rss.DualEnKF(start(seed), seed=seed, points=known(POINTS)).run(record)
        part = rss.DualEnKF(start(seed), seed=seed, points=known(POINTS)).run(late)
        count = part.time.size - 200  # the second half starts without the first one's state
        gap = np.abs(part.force.mean - whole.force.mean[:, -part.time.size:])[:, -count:]
        inside.append(np.mean(gap <= (part.force.upper - part.force.mean)[:, -count:]))
    assert np.mean(inside) > 0.95


def test_a_record_taken_in_any_pieces_gives_the_same_bits_while_parameters_learn():
    from radiation_ss.inference import channels

    record, force = sea_record(3, duration=6.0)
    record = with_force(record, force, 3)
    y = channels(record, ("Heave",))
    found = []
    for cuts in ([], [1, 63, 64, 65, 100, 130, 333], list(range(1, 600))):
        filter_ = rss.DualEnKF(start(3), seed=3).prepare(record)
        for first, last in zip([0, *cuts], [*cuts, record.time.size]):
            filter_.advance(record.time[first:last], y[:, first:last])
        found.append(filter_.engine.arrays())
    for other in found[1:]:
        for name, values in found[0].items():
            np.testing.assert_array_equal(other[name], values, err_msg=name)
    assert found[0]["theta"].std() > 0.0 and (found[0]["information"] != 0.0).any()


def test_no_live_step_is_long_while_parameters_learn():
    record, force = sea_record(4, duration=45.0)
    record = with_force(record, force, 4)
    samples, taken = samples_of(record), []
    gc.freeze()  # as the guide says: else collections of what other tests left are timed, too
    for _ in range(3):  # the same steps: of a shared machine the least time is the step's own
        live, times = rss.DualEnKF(start(4), seed=4).prepare(record), []
        for sample in samples:
            begin = time.process_time()
            live.step(sample)
            times.append(time.process_time() - begin)
        taken.append(times)
    gc.unfreeze()
    times = np.min(taken, axis=0)
    theta = live.engine.state.theta[:, -2]
    assert error(tank(theta).fit.frequency_response(BAND)) < 0.02  # it did learn
    # 4096 samples taken again at once, with their members drawn, cost 100 ms.
    assert np.quantile(times, 0.999) < 10e-3 and np.sum(times > 10e-3) <= 2


def test_a_filter_saved_while_it_learns_goes_on_bit_for_bit(tmp_path):
    record, force = sea_record(5, duration=3.0)
    samples = samples_of(with_force(record, force, 5))
    whole = rss.DualEnKF(start(5), seed=5).prepare(with_force(record, force, 5))
    for k, sample in enumerate(samples):
        if k in (64, 70, 135, 160):
            assert k not in (70, 135) or whole.engine.job is not None
            whole.save(tmp_path / "filter.npz")
            again = rss.DualEnKF.load(tmp_path / "filter.npz")
            for later in samples[k:k + 80]:
                out = again.step(later)
            saved = k
        expected = whole.step(sample)
        if k == saved + 79 if k > 64 else False:
            for a, b in zip(out, expected):
                np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("method", [None, "zoh", "foh", "tustin"])
@pytest.mark.parametrize("dofs", [1, 2])
def test_a_state_space_is_the_model_it_was_made_from(method, dofs):
    import control as ct

    model = tank() if dofs == 1 else body(2, 3, ((0, 1),)).replace(dofs=("Sway", "Roll"), fit=body(
        2, 3, ((0, 1),)).fit.replace(dofs=("Sway", "Roll")))
    plant = model.to_ss()
    if method is not None:
        plant = rss.sampled(plant, 0.02, method).to_ss()
    # Coordinates of its own, which a user's plant has.
    T = np.random.default_rng(0).standard_normal(plant.A.shape) + 3.0 * np.eye(len(plant.A))
    mixed = ct.ss(np.linalg.solve(T, plant.A @ T), np.linalg.solve(T, plant.B), plant.C @ T, plant.D, plant.dt,
                  inputs=plant.input_labels, outputs=plant.output_labels, name="mine")
    found = rss.DualEnKF(mixed).model
    assert found.dofs == model.dofs
    np.testing.assert_allclose(found.M + found.A_inf, model.M + model.A_inf, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.C, model.C, rtol=1e-5, atol=1e-5 * np.abs(model.C).max())
    np.testing.assert_allclose(found.fit.frequency_response(BAND), model.fit.frequency_response(BAND), rtol=1e-4,
                               atol=1e-5 * np.abs(model.fit.frequency_response(BAND)).max())


def test_a_plant_without_a_time_step_is_refused():
    import control as ct

    plant = tank().to_ss()
    with pytest.raises(rss.InputError, match="without a time step"):
        rss.DualEnKF(ct.ss(plant.A, plant.B, plant.C, plant.D, True, inputs=plant.input_labels,
                           outputs=plant.output_labels))


def test_the_filter_runs_on_a_sampled_state_space_as_on_its_model():
    record, _ = sea_record(6, duration=10.0)
    plant = rss.sampled(tank(), 0.01, "foh").to_ss()
    ours, theirs = (rss.DualEnKF(p, seed=6, omega=BAND).run(record).force.mean for p in (tank(), plant))
    np.testing.assert_allclose(theirs, ours, atol=1e-4 * ours.std())


def test_plants_of_the_ensemble_are_those_of_its_members():
    record, _ = sea_record(7, duration=3.0)
    found = rss.DualEnKF(start(7), seed=7, omega=BAND, n_ensemble=30).run(record)
    plants = found.plants(30)
    assert len(plants) == 30 and len(found.plants(3)) == 3
    responses = np.array([plant(1j * BAND[5])[0, 0] for plant in plants])
    K = found.subsystems.K(found.members.T, BAND[5:6])[:, 0, 0, 0]
    w, model = BAND[5], found.model
    Z = -w**2 * (model.M + model.A_inf)[0, 0] + 1j * w * K + model.C[0, 0]
    np.testing.assert_allclose(responses, 1.0 / Z, rtol=1e-8)
    with pytest.raises(rss.InputError, match="31 asked for; from 1 to 30"):
        found.plants(31)


def test_the_papers_noise_is_what_is_asked_for():
    """Without noise on theta and without information (observations far noisier than signals), theta stays."""
    record, _ = sea_record(8, duration=2.0)
    still = rss.DualEnKF(start(8), seed=8, preset="paper", Q_theta=0.0, R=1e12).run(record)
    np.testing.assert_allclose(still.theta[:, -1], still.theta[:, 0], rtol=1e-3)
    # A random walk: its variance grows by Q at each step.
    wide = rss.DualEnKF(start(8), seed=8, preset="paper", prior=0.0, Q_theta=1e-4, R=1e12, n_ensemble=2000).run(record)
    steps = np.arange(1, record.time.size + 1)
    growth = wide.theta_std[0] ** 2 / wide.theta_std[0, 0] ** 2
    np.testing.assert_allclose(growth, steps, rtol=6.0 * np.sqrt(2.0 / 2000))
    with pytest.raises(rss.InputError, match="Q_state"):
        rss.DualEnKF(tank(), Q_state=-1.0)
    assert TRUTH.size == 6


@pytest.mark.parametrize("noise", [0.02, 0.2])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_accelerometer_alone_gives_the_force(seed, noise):
    """Its white noise, integrated twice, is larger than any slow motion: no scale may come from that."""
    record, force = sea_record(seed, duration=60.0, noise=noise)
    record = rss.Record(record.time, {"Heave_acceleration": record.channels["Heave_acceleration"]})
    found = rss.DualEnKF(tank(), seed=0).run(record).force.mean[0]
    late = record.time > 5.0
    assert np.linalg.norm(found[late] - force[late]) < 0.8 * np.linalg.norm(force[late])
