"""Waves of a record go to one direction of X: the stated one, or none is taken."""

import numpy as np
import pytest
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss import HydroData
from radiation_ss.cli import main

OMEGA = np.linspace(2.0, 12.0, 40)
TIME = np.arange(0.0, 60.0, 0.02)


def body(*forces):
    """The tank's body, with X of several directions, 0, 90, ... deg."""
    model = tank_model()
    table = np.ones((OMEGA.size, 1, 1))
    X = np.tile(np.asarray(forces, dtype=complex)[None, :, None], (OMEGA.size, 1, 1))
    return model.replace(hydro=HydroData(OMEGA, table, 0.0 * table, A_inf=[[1.0]], dofs=("Heave",), M=model.M,
                                         C=model.C, X=X, directions=np.radians(90.0 * np.arange(len(forces)))))


def test_a_record_without_motion_is_answered_from_rest():
    model, force = body(1.0), np.sin(3.0 * TIME)
    alone = rss.simulate(model, rss.Record(TIME, {"Heave_force": force})).outputs
    plant = rss.cummins(model)
    assert np.abs(alone[0] - by_hand(plant, force)).max() < 2e-3 * np.abs(alone[0]).max()


def by_hand(plant, force):
    """Runge-Kutta steps of half a sample, the force linear between samples."""
    x, found, h = np.zeros(plant.nstates), [], TIME[1]
    for now, after in zip(force, np.append(force[1:], force[-1])):
        found.append(plant.C[0] @ x)
        for a, b in ((now, (now + after) / 2.0), ((now + after) / 2.0, after)):
            k1 = plant.A @ x + plant.B[:, 0] * a
            k2 = plant.A @ (x + 0.25 * h * k1) + plant.B[:, 0] * (a + b) / 2.0
            k3 = plant.A @ (x + 0.25 * h * k2) + plant.B[:, 0] * (a + b) / 2.0
            k4 = plant.A @ (x + 0.5 * h * k3) + plant.B[:, 0] * b
            x = x + h / 12.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return np.array(found)


def test_the_stated_direction_makes_the_force():
    model, waves = body(100.0, 300.0, 50.0), 0.01 * np.cos(5.0 * TIME)
    inside = (TIME > 15.0) & (TIME < 45.0)
    for stated, size in (("0", 100.0), ("90 deg", 300.0), (45, 200.0), ("180", 50.0), ("-180", 50.0)):
        run = rss.Record(TIME, {"wave_elevation": waves}, meta={"heading": stated})
        found = rss.simulate(model, run).inputs
        np.testing.assert_allclose(found[0, inside], size * waves[inside], atol=0.01 * size * 0.01)


def test_a_direction_is_not_guessed():
    model = body(100.0, 300.0)
    run = rss.Record(TIME, {"wave_elevation": np.cos(5.0 * TIME), "Heave": 0.01 * np.cos(5.0 * TIME)}, name="run 3")
    for call in (lambda: rss.simulate(model, run), lambda: rss.diagnose(model, run),
                 lambda: rss.identify(model, run, "prediction-error"), lambda: rss.identify(model, run)):
        with pytest.raises(rss.InputError, match="run 3: X of the model is for waves to 0, 90 deg; say"):
            call()
    for stated in ("beam", "nan", "120"):
        with pytest.raises(rss.InputError, match=r"heading|direction"):
            rss.simulate(model, rss.Record(run.time, run.channels, meta={"heading": stated}))


def test_a_body_under_way_meets_waves_at_other_frequencies_than_those_of_X():
    waves = {"wave_elevation": 0.01 * np.cos(5.0 * TIME), "Heave": 0.01 * np.cos(5.0 * TIME)}
    run = rss.Record(TIME, waves, name="run 3", speed=0.5)
    for call in (lambda: rss.simulate(body(1.0), run), lambda: rss.diagnose(body(1.0), run),
                 lambda: rss.identify(body(1.0), run, "prediction-error")):
        with pytest.raises(rss.InputError, match=r"run 3: speed 0.5 m/s, .*encounter_frequency"):
            call()
    known = rss.Record(TIME, {**waves, "Heave_force": np.sin(5.0 * TIME)}, kind="waves", speed=0.5)
    assert rss.simulate(body(1.0), known).outputs.shape[1] == TIME.size


def test_directions_that_are_alike_need_no_word():
    record = rss.Record(TIME, {"wave_elevation": np.cos(5.0 * TIME)})
    alike, one = (rss.simulate(model, record).outputs for model in (body(100.0, 100.0), body(100.0)))
    np.testing.assert_array_equal(alike, one)


def test_a_plan_states_the_direction_of_its_waves():
    model = body(100.0, 300.0)
    made = rss.plan_tests(model, 0.1, ["quadratic_drag", "linear_damping"], tests=("waves with elevation",))
    assert all(rss.simulate(model, record) is not None for record in made.records)


def test_what_is_identified_is_of_the_stated_direction():
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 25.0, 40), depth=0.45, gyradius=0.07)
    one = rss.Model.from_hydro(section.times(0.297).select("Heave"), order=3)
    ahead = 0.2j * one.hydro.X * (one.hydro.omega / 5.0)[:, None, None] ** 2
    both = np.concatenate([ahead, one.hydro.X], axis=1)
    model = one.replace(hydro=one.hydro.replace(X=both, directions=[0.0, np.pi / 2.0]))
    rng, time = np.random.default_rng(0), np.arange(0.0, 30.0, 0.05)
    omega, phase = rng.uniform(3.0, 9.0, 80), rng.uniform(0.0, 2.0 * np.pi, 80)
    waves = 2e-4 * np.cos(np.outer(time, omega) + phase).sum(axis=1)
    motion = rss.simulate(one, rss.Record(time, {"wave_elevation": waves})).outputs[0]
    heave = motion + 1e-2 * motion.std() * rng.standard_normal(time.size)
    channels = {"Heave": heave, "wave_elevation": waves}
    options = {"method": "prediction-error", "omega": [5.0], "draws": 20, "most_laws": 0}
    expected = rss.identify(one, rss.Record(time, channels), **options)
    found = rss.identify(model, rss.Record(time, channels, meta={"heading": "90"}), **options)
    np.testing.assert_allclose(found.B.mean, expected.B.mean, rtol=1e-6)
    # By the motion alone a recorded force changes neither answer nor direction.
    options |= {"method": "spectral"}
    force = {"Heave_force": np.cos(np.outer(time, omega) + phase).sum(axis=1)}
    alone, beside, other = (
        rss.identify(model, rss.Record(time, {"Heave": heave, **more}, meta={"heading": to}), **options)
        for more, to in (({}, "90"), (force, "90"), (force, "0")))
    assert beside.B.mean == pytest.approx(alone.B.mean) and other.B.mean != pytest.approx(alone.B.mean, rel=1e-3)
    assert any("'prediction-error' uses them" in text for text in beside.warnings)


def test_too_few_samples_are_not_another_body():
    time = np.arange(4.0)
    with pytest.raises(rss.InputError, match="fewer than two samples of the motion of Heave"):
        rss.simulate(body(1.0), rss.Record(time, {"Heave": [0.1, np.nan, np.nan, np.nan], "Heave_force": np.sin(time)}))


def test_a_sea_of_the_command_line_is_predicted_alike_as_a_record(tmp_path):
    """What --heading made of a sea is what its record, without the force, makes again."""
    body(100.0, 300.0).write(tmp_path / "tank.nc")
    assert main(["simulate", str(tmp_path / "tank.nc"), "--sea", ".01", "1", "--heading", "45", "--duration", "60",
                 "--outside", ".2", "--out", str(tmp_path / "sea.csv"), "--quiet"]) == 0
    made = rss.read_record(tmp_path / "sea.csv")
    bare = rss.Record(made.time, {"wave_elevation": made.channels["wave_elevation"]}, meta=made.meta)
    force = rss.simulate(rss.read_model(tmp_path / "tank.nc"), bare).inputs[0]
    inside = slice(made.time.size // 3, -made.time.size // 3)
    np.testing.assert_allclose(force[inside], made.channels["Heave_force"][inside], atol=0.02 * np.ptp(force))


def test_a_heading_is_the_same_a_turn_further(tmp_path):
    """As the record's comment is; -15 deg is between 270 and 360, and 360 is 0."""
    body(100.0, 300.0, 200.0, 150.0).write(tmp_path / "tank.nc")

    def force(degrees):
        assert main(["simulate", str(tmp_path / "tank.nc"), "--sea", ".01", "1", f"--heading={degrees}", "--duration",
                     "60", "--outside", ".2", "--out", str(tmp_path / "sea.csv"), "--quiet"]) == 0
        return rss.read_record(tmp_path / "sea.csv").channels["Heave_force"]

    for one, other in ((-15, 345), (360, 0)):
        np.testing.assert_allclose(force(one), force(other), rtol=1e-9, atol=1e-9)
