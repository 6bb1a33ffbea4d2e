"""A plan made without any record: against simulated differences, exact twins, and an actual diagnosis."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss import Record
from radiation_ss.simulation import simulate

NAMES = ["quadratic_drag", "coulomb_friction", "cubic_stiffness", "linear_damping", "constant_force", "sensor_bias",
         "excitation_gain", "sensor_gain"]


@cache
def tank_plan():
    return rss.plan_tests(tank_model(), 0.04, NAMES)


def in_waves(effects=(), start=None):
    """Motion of the tank in given waves."""
    time = np.arange(0.0, 20.0, 0.04)
    force = 3.0 * np.cos(7.0 * time) + 2.0 * np.cos(8.3 * time + 1.0)
    outputs = simulate(tank_model(), (time, force[None]), effects, start=start).outputs
    return time, force, np.asarray(outputs[0])


def test_the_map_is_that_of_simulated_differences():
    time, force, motion = in_waves()
    names = ["quadratic_drag", "coulomb_friction", "cubic_stiffness"]
    # With exact numbers of the model only the start is free: five states, of which the memory's have a prior.
    plan = rss.plan_tests(tank_model(), effects=names, tolerance=1e-6, noise=0.01, gap=0.05,
                          tests={"waves": Record(time, {"Heave": motion, "Heave_force": force})})
    v = np.gradient(motion, time)
    width = 0.3 * np.std(v)
    shape = {"width": width, "sharpness": 2.0}
    small = {"quadratic_drag": {"coefficient": 0.02}, "coulomb_friction": {"force": 1e-4},
             "cubic_stiffness": {"stiffness": 10.0}}
    # A change of the motion of 5 % rms under noise of 1 % is 5 standard deviations in each sample.
    columns = {}
    for name in names:
        ((key, value),) = small[name].items()  # both signs, for friction has steps of its own
        high, low = (in_waves([(name, {key: sign * value} | (shape if key == "force" else {}))])[2] for sign in (1, -1))
        difference = high - low
        columns[name] = 5.0 * difference / np.sqrt(np.mean(difference**2))
    starts = np.stack([in_waves(start=1e-4 * row)[2] - motion for row in np.eye(5)], axis=1)
    for i, name in enumerate(names):
        i = plan.labels.index(f"{name} on Heave")
        left = left_of(columns[name], starts)
        assert left * 0.999 < plan.detectability[i] < np.linalg.norm(columns[name]) * 1.001
        assert plan.detectability[i] == pytest.approx(left, rel=0.05)
        for other in set(names) - {name}:
            j = plan.labels.index(f"{other} on Heave")
            beside = left_of(columns[name], np.column_stack([starts, columns[other]]))
            assert plan.separation[i, j] == pytest.approx(beside, rel=0.05)


def left_of(column, others):
    """Norm of what others leave of a column."""
    others = others / np.linalg.norm(others, axis=0)
    return np.linalg.norm(column - others @ np.linalg.lstsq(others, column, rcond=None)[0])


@settings(max_examples=25)
@given(st.permutations(range(14)), st.integers(1, 13))
def test_a_test_more_never_lowers_what_is_known(order, count):
    plan = tank_plan()
    names = [plan.tests[k].name for k in order]
    few, more = plan.together(names[:count]), plan.together(names[:count + 1])
    for before, after in zip(few, more):
        assert np.all(after >= before * (1.0 - 1e-6) - 1e-3)  # rounding of exact twins


def test_twins_stay_inseparable_and_the_reason_is_told():
    plan = tank_plan()
    twins = [c for c in plan.confounded if set(c.pair) == {"constant_force on Heave", "sensor_bias on Heave"}]
    assert len(twins) == 1 and twins[0].exact and "second displacement sensor" in twins[0].why
    assert "constant_force on Heave / sensor_bias on Heave" in str(plan) or (
        "sensor_bias on Heave / constant_force on Heave" in str(plan))


def test_an_accelerometer_splits_the_gain_of_force_and_sensor_and_a_decay_does_not():
    plan = tank_plan()
    i, j = (plan.labels.index(f"{name} on Heave") for name in ("sensor_gain", "excitation_gain"))
    _, plain = plan.together(["waves with force, large", "forced sweep, large", "waves with force, small",
                              "decay, large"])
    size, both = plan.together(["waves with force, large + accelerometer"])
    assert plain[i, j] < 1e-3 * size[i] and both[i, j] > 0.5 * size[i] > 5.0


@pytest.mark.parametrize("tests, noise", [(("decay",), 0.03), (("decay", "waves"), 0.1), (None, 0.2)])
def test_the_plan_does_what_the_whole_menu_does_and_no_test_of_it_can_go(tests, noise):
    plan = rss.plan_tests(tank_model(), effects=NAMES, noise=noise, tests=tests)

    def counted(names):
        size, left = plan.together(names)
        return int((size >= 5.0).sum() + (np.minimum(left, left.T)[np.triu_indices(size.size, 1)] >= 5.0).sum())

    chosen = list(plan.chosen)
    assert counted(chosen) == sum(plan.reachable) == plan.steps[-1].seen + plan.steps[-1].apart
    for name in chosen if len(chosen) > 1 else []:
        assert counted([other for other in chosen if other != name]) < counted(chosen)
    assert len(plan.unseen) == len(NAMES) - plan.reachable[0]  # what no test can show is listed, too


@pytest.mark.parametrize("truth, values", [("quadratic_drag", {"coefficient": 25.0}),
                                           ("coulomb_friction", {"force": 0.15, "width": 0.01})])
def test_a_set_found_to_separate_does_so_in_a_diagnosis(truth, values):
    model, names = tank_model(), ["quadratic_drag", "coulomb_friction", "cubic_stiffness"]
    plan = rss.plan_tests(model, 0.04, names, tests=("decay",))
    assert plan.reachable == (3, 3)
    rng, measured = np.random.default_rng(1), []
    for record in plan.records:
        start = np.array([0.0, 0.0, 0.0, record.channels["Heave"][0], 0.0])
        outputs = np.asarray(simulate(model, (record.time, np.zeros((1, record.time.size))), [(truth, "Heave", values)],
                                      start=start).outputs)
        channels = {"Heave": outputs[0], "Heave_acceleration": outputs[2]}
        noisy = {k: x + 0.01 * x.std() * rng.standard_normal(x.size)
                 for k, x in channels.items() if k in record.channels}
        measured.append(Record(record.time, noisy, kind="decay", name=record.name))
    found = rss.diagnose(model, measured, effects=names)
    assert [effect.name for effect in found.verdict.effects] == [truth]


def test_nonsense_is_refused_in_a_sentence():
    model = tank_model()
    for words, said in (({"noise": 0.0}, "noise"), ({"gap": -1.0}, "gap"), ({"amplitude": -0.1}, "amplitude"),
                        ({"amplitude": {"Roll": 0.1}}, "amplitude: none for Heave"), ({"sea": (1.0, 5.0)}, "X"),
                        ({"tests": ("towing",)}, "decay"), ({"tests": {}}, "menu"), ({"tolerance": 2.0}, "tolerance")):
        with pytest.raises(rss.InputError, match=said):
            rss.plan_tests(model, **words)
    motion = {"Heave": np.sin(8.0 * np.arange(0.0, 20.0, 0.04))}
    for kind, said in (("motion-only", "no known force"), ("prescribed", "a given motion")):
        force = {"Heave_force": motion["Heave"]} if kind == "prescribed" else {}
        with pytest.raises(rss.InputError, match=said):
            rss.plan_tests(model, tests={"own": Record(np.arange(0.0, 20.0, 0.04), motion | force, kind=kind)})
    with pytest.raises(rss.InputError, match="not on the menu"):
        tank_plan().together(["towing"])


def test_picture_and_files(tmp_path):
    plan = tank_plan()
    plan.save(tmp_path)
    assert (tmp_path / "plan.json").stat().st_size > 500 and (tmp_path / "plan.png").stat().st_size > 10_000
    assert set(plan.to_dict()["tests"]) == {test.name for test in plan.tests}
    assert len(plan.plot().axes) == 3


def test_an_effect_of_other_motions_is_not_for_want_of_a_test():
    """Water on deck weighs on the heave; a body in surge has waves all the same."""
    body = rss.body(dof="Surge", mass=4e6, added_mass=1e6, C=5e4, damping_ratio=0.03)
    unseen = {item.effect: item.why for item in rss.plan_tests(body, 0.5, ["water_on_deck", "linear_damping"],
                                                                tests=("decay",)).unseen}
    assert "Heave" in unseen["water_on_deck"]


def test_a_small_test_alone_is_as_telling_as_on_the_menu():
    """Its effects and its sensors' noise are those of the full amplitude, which other tests have."""
    whole, alone = (rss.plan_tests(tank_model(), 0.04, NAMES[:3], tests=tests) for tests in (None, ["decay, small"]))
    names = [t.name for t in whole.tests]
    seen = dict(zip(whole.labels, whole.single[names.index("decay, small")]))
    assert all(t.name.startswith("decay, small") for t in alone.tests)
    for label, value in zip(alone.labels, alone.single[0]):
        assert value == pytest.approx(seen[label], rel=0.15)  # the typical velocity is that of all records


def test_a_plan_takes_the_tolerance_that_the_model_states():
    stated = tank_model().replace(tolerance={"stiffness": 0.2})
    one, other, sure = (rss.plan_tests(body, 0.04, ["linear_stiffness"], tolerance, tests=["decay, large"]).single[0, 0]
                        for body, tolerance in ((stated, None), (tank_model(), {"stiffness": 0.2}), (stated, 0.02)))
    assert one == pytest.approx(other) and one < 0.5 * sure


def test_a_small_decay_alone_has_the_effects_of_a_large_one():
    """What needs a force or waves acts in neither, though other tests of the menu give the sizes."""
    small, large = (rss.plan_tests(tank_model(), 0.04, tests=[test]) for test in ("decay, small", "decay, large"))
    assert set(small.labels) == set(large.labels) and "excitation_gain on Heave" not in small.labels


def test_a_plan_of_decays_of_what_nothing_restores_says_so():
    surge = rss.body(dof="Surge", mass=10.0, added_mass=3.0)
    with pytest.raises(rss.InputError, match="there is no decay, as nothing oscillates: C restores no Surge"):
        rss.plan_tests(surge, 0.1, tests=["decay"])
