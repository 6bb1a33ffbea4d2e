"""Prescribed motion, static tests and free bodies: closed forms, and the same numbers the other way round."""

import numpy as np
import pytest
from plant_bodies import coupled_model, tank_fit, tank_model

import radiation_ss as rss
from radiation_ss import Model
from radiation_ss.effects import activate
from radiation_ss.errors import InputError
from radiation_ss.simulation import check_units, doubts, equilibrium, prescribed_force, step_size, turned

TIME = np.arange(0.0, 40.0, 0.02)


def free_sway():
    """A body that nothing restores."""
    return Model(("Sway",), [[10.0]], [[6.0]], [[0.0]], tank_fit("Sway"))


def narrow(rng, time):
    w = np.linspace(2.0, 8.0, 40)
    return (20.0 * np.exp(-(((w - 5.0) / 1.5) ** 2))) @ np.cos(np.outer(w, time) + rng.uniform(0.0, 6.28, (40, 1)))


@pytest.mark.parametrize("w", [2.0, 5.0, 9.0])
def test_the_force_of_a_harmonic_motion_is_the_impedance(w):
    """C - w^2 (M + A_inf) + i w K(iw) times the amplitude, once the start has died out."""
    model, size = tank_model(), 0.02
    record = rss.Record(TIME, {"Heave": size * np.sin(w * TIME)}, kind="prescribed")
    force = np.asarray(prescribed_force(model, record).outputs).ravel()
    impedance = (model.C - w**2 * (model.M + model.A_inf) + 1j * w * model.fit.frequency_response([w])[0])[0, 0]
    expected = size * np.imag(impedance * np.exp(1j * w * TIME))
    late = (TIME > 10.0) & (TIME < 38.0)
    assert np.abs(force - expected)[late].max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("effects", [[], [("quadratic_drag", "Sway", {"coefficient": 3e5})],
                                     [("hysteresis", "Roll", {"force": 5e4, "reach": 0.05, "sharpness": 1.0})],
                                     [("added_inertia", "Roll", {"inertia": 2e5})]])
def test_the_motion_under_a_force_takes_that_force(effects):
    """simulate and prescribed_force are each other's inverse."""
    model, time = coupled_model(), np.arange(0.0, 80.0, 0.05)
    ramp = np.minimum(time / 10.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(time / 10.0, 1.0))
    force = np.stack([1e5 * np.cos(0.8 * time), 5e4 * np.sin(0.6 * time)]) * ramp
    moved = np.asarray(rss.simulate(model, (time, force), effects).outputs)
    record = rss.Record(time, dict(zip(model.dofs, moved)), kind="prescribed")
    found = np.asarray(prescribed_force(model, record, effects).outputs)
    assert np.abs(found - force)[:, 40:-40].max() < 0.01 * np.abs(force).max()


def test_a_body_under_way_is_not_taken_for_one_at_rest():
    model, w = tank_model(), 6.0
    whole = rss.Record(TIME, {"Heave": 0.02 * np.cos(w * TIME)}, kind="prescribed")
    cut = rss.Record(TIME[1000:], {"Heave": 0.02 * np.cos(w * TIME[1000:])}, kind="prescribed")
    before = np.asarray(prescribed_force(model, whole).outputs).ravel()[1000:]
    found = np.asarray(prescribed_force(model, cut).outputs).ravel()
    assert np.abs(found - before)[20:-20].max() < 0.01 * np.abs(before).max()


def test_predicting_a_prescribed_record_predicts_its_force():
    from radiation_ss.simulation import predict_record

    model = tank_model()
    record = rss.Record(TIME, {"Heave": 0.02 * np.sin(5.0 * TIME), "Heave_force": 0.0 * TIME}, kind="prescribed")
    found = predict_record(model, record)
    assert np.array_equal(found.channels["Heave_force"], np.asarray(prescribed_force(model, record).outputs).ravel())
    with pytest.raises(InputError, match="prescribed_force predicts the force"):
        rss.simulate(model, record)


def test_a_static_test_rests_where_the_springs_hold_it():
    """Linear: C^-1 f. Hardening: the real root of C x + k x^3 = f, by Cardano's formula."""
    coupled = coupled_model()
    force = np.random.default_rng(0).normal(0.0, 1e5, (7, 2))
    assert np.allclose(equilibrium(coupled, force), np.linalg.solve(coupled.C, force.T).T, rtol=1e-9)
    model, k = tank_model(), 4e5
    C, loads = model.C[0, 0], np.linspace(-60.0, 60.0, 5)
    record = rss.Record(np.arange(5.0), {"Heave": np.zeros(5), "Heave_force": loads}, kind="static")
    effects = [("cubic_stiffness", {"stiffness": k}), ("sensor_gain", {"gain": 0.1})]
    found = rss.simulate(model, record, effects)
    p, q = C / k, -loads / k
    root = np.sqrt(q**2 / 4.0 + p**3 / 27.0)
    expected = np.cbrt(-q / 2.0 + root) + np.cbrt(-q / 2.0 - root)
    assert np.allclose(np.asarray(found.outputs)[0], 1.1 * expected, rtol=1e-6, atol=1e-9)
    assert not np.asarray(found.outputs)[1:].any()


def test_a_static_test_of_a_free_body_is_refused_until_something_restores():
    record = rss.Record(np.arange(3.0), {"Sway": np.zeros(3), "Sway_force": [0.0, 1.0, 2.0]}, kind="static")
    with pytest.raises(InputError, match="nothing restores Sway"):
        rss.simulate(free_sway(), record)
    moored = rss.simulate(free_sway(), record, [("linear_stiffness", {"stiffness": 4.0})])
    assert np.asarray(moored.outputs)[0] == pytest.approx([0.0, 0.25, 0.5])


@pytest.mark.parametrize("coefficient", [0.0, 20.0, 400.0])
@pytest.mark.parametrize("C", [0.0, 5.0])
def test_a_free_body_under_way_is_predicted_from_its_own_record(coefficient, C):
    """What a withheld record of sway needs: a start fitted where drag asks for finer steps than the body."""
    model, rng, time = free_sway().replace(C=[[C]]), np.random.default_rng(0), np.arange(0.0, 60.0, 0.02)
    force, effects = narrow(rng, time), [("quadratic_drag", {"coefficient": coefficient})]
    moved = np.asarray(rss.simulate(model, (time, force), effects).outputs)[0]
    late = time > 20.0
    record = rss.Record(time[late], {"Sway": moved[late] + 1e-4 * rng.standard_normal(late.sum()),
                                     "Sway_force": force[late]})
    found = np.asarray(rss.simulate(model, record, effects).outputs)[0]
    assert np.sqrt(np.mean((found - moved[late]) ** 2)) < 5e-3 * moved[late].std()


@pytest.mark.parametrize("effect, rate", [
    (("quadratic_drag", {"coefficient": 400.0}), lambda x, v: 2.0 * 400.0 * v / 16.0),
    (("coulomb_friction", {"force": 2.0, "width": 0.002, "sharpness": 0.0}), lambda x, v: 2.0 / 0.002 / 16.0),
    (("hysteresis", {"force": 1e-6, "reach": 5e-3, "sharpness": 0.0}), lambda x, v: v / 5e-3)])
def test_steps_follow_the_rates_of_effects(effect, rate):
    """Closed forms of the slope of the velocity's rate, or of the own state's, at three times the motion's rms."""
    model, w = free_sway(), 5.0
    record = rss.Record(TIME, {"Sway": 0.1 * np.sin(w * TIME), "Sway_force": np.sin(w * TIME)})
    x = 3.0 * 0.1 / np.sqrt(2.0)
    found = step_size(model, [record], activate([effect], model.dofs))
    assert found == pytest.approx(1.0 / rate(x, w * x), rel=0.05)
    assert found < step_size(model, [record])


@pytest.mark.parametrize("seed", range(4))
def test_a_free_bodys_sign_is_checked_as_any_others(seed):
    model, rng, time = free_sway(), np.random.default_rng(seed), np.arange(0.0, 120.0, 0.05)
    force = narrow(rng, time)
    moved = np.asarray(rss.linear_response(model, time, force).outputs)[0]
    late = time > 40.0
    record = rss.Record(time[late], {"Sway": moved[late] + 1e-3 * rng.standard_normal(late.sum()),
                                     "Sway_force": force[late]})
    check_units(model, [record])
    assert not turned(model, record)
    wrong = record.with_channels(Sway=-record.channels["Sway"])
    assert any("moves against the recorded force" in said for said in turned(model, wrong))


def test_a_slow_test_of_the_rig_passes_with_a_word_and_slow_waves_do_not():
    model = tank_model()
    slow = 0.02 * np.sin(0.1 * 2.0 * np.pi * TIME / 4.0)
    channels = {"Heave": slow, "Heave_force": model.C[0, 0] * slow}
    for kind in ("forced", "prescribed", "static"):
        check_units(model, [rss.Record(TIME, channels, kind=kind)])
    assert any("the motion's frequency" in said for said in doubts(model, rss.Record(TIME, channels, kind="forced")))
    with pytest.raises(InputError, match="forced, prescribed and static tests may be as slow"):
        check_units(model, [rss.Record(TIME, channels, kind="waves")])


def test_a_drive_near_the_natural_frequency_witnesses_the_time_of_a_slow_motion():
    """What a slow force moves that nobody records, by its stiffness; in milliseconds the drive is slow, too."""
    model = tank_model()
    natural = float(np.sqrt(model.C[0, 0] / (model.M + model.A_inf)[0, 0]))
    force = 1e-3 * model.C[0, 0] * np.sin(natural * TIME)
    moved = np.asarray(rss.linear_response(model, TIME, force[None]).outputs)[0] + 0.5 * np.sin(0.16 * TIME)
    record = rss.Record(TIME, {"Heave": moved, "Heave_force": force}, kind="waves")
    check_units(model, [record])
    with pytest.raises(InputError, match=r"column time.*the motion's frequency"):
        check_units(model, [rss.Record(1e3 * TIME, record.channels, kind="waves")])


@pytest.mark.parametrize("C", [0.0, 8e4 / 30.0])
def test_a_mooring_that_the_model_lacks_swings_as_its_spring_says(C):
    model = rss.body(dof="Surge", mass=2e7, added_mass=1e7, C=C)
    time = np.arange(0.0, 600.0, 1.0)
    moved = rss.simulate(model, (time, np.zeros((1, time.size))), [("linear_stiffness", {"stiffness": 8e4 - C})],
                         start=[10.0, 0.0]).outputs[0]
    assert moved == pytest.approx(10.0 * np.cos(np.sqrt(8e4 / 3e7) * time), abs=0.01)


def softly_moored():
    """A body of flat coefficients with a period of 114 s."""
    omega = np.linspace(0.2, 2.0, 30)
    flat = np.ones((30, 1, 1))
    hydro = rss.HydroData(omega, 7e4 * flat, 2e3 * flat, A_inf=[[7e4]], dofs=("Surge",), M=[[2.6e5]], C=[[1e3]],
                          X=np.full((30, 1, 1), 5e5 + 0j), directions=[0.0])
    fit = rss.RadiationFit(("Surge",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    return rss.Model(("Surge",), [[2.6e5]], [[7e4]], [[1e3]], fit, D=[[2e4]], hydro=hydro)


def test_a_slowly_swinging_body_follows_the_waves_of_its_elevation():
    model = softly_moored()
    time = np.arange(0.0, 600.0, 0.25)
    record = rss.Record(time, {"Surge": np.zeros(time.size), "wave_elevation": np.cos(time)}, kind="waves")
    moved = rss.simulate(model, record, start=np.zeros(2)).outputs[0]
    inside = (time > 200.0) & (time < 500.0)
    size = 5e5 / abs(1e3 - 3.3e5 + 2e4j)
    assert np.abs(np.exp(-1j * time[inside]) @ moved[inside]) / inside.sum() * 2.0 == pytest.approx(size, rel=0.02)


@pytest.mark.parametrize("column, lost", [("Surge_force", np.s_[:5]), ("Surge_force", np.s_[400:405]),
                                          ("Surge_force", np.s_[-5:]), ("wave_elevation", np.s_[400:405])])
def test_no_motion_is_made_of_a_force_that_is_not_there(column, lost):
    model, time = softly_moored(), np.arange(0.0, 40.0, 0.05)
    row = np.cos(time)
    rss.simulate(model, rss.Record(time, {column: row}, kind="waves"))
    row[lost] = np.nan
    with pytest.raises(InputError, match="no sample from"):
        rss.simulate(model, rss.Record(time, {column: row}, kind="waves"))
