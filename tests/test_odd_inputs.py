"""Odd inputs through the command line: the same numbers, or one line and status 2; never a traceback, never a hang."""

import warnings

import numpy as np
import odd_inputs
import pytest
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.hydro import strip_theory

CASES = odd_inputs.cases()


@pytest.mark.parametrize("name", CASES)
def test_odd_inputs_end_as_they_should(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")     # what the command line prints
        assert odd_inputs.wrong_with(*CASES[name]) is None


def test_a_seed_that_is_none_is_refused():
    with pytest.raises(rss.InputError, match="seed"):
        rss.realise(rss.jonswap(2.0, tp=8.0), 100.0, 0.25, seed=-1)
    model, time = tank_model(), np.arange(0.0, 20.0, 0.05)
    with pytest.raises(rss.InputError, match="seed"):
        rss.DualEnKF(model, seed=-1)
    record = rss.Record(time, {"Heave": np.cos(5.4 * time) * np.exp(-0.1 * time)}, kind="decay")
    for work in (rss.diagnose, rss.identify):
        with pytest.raises(rss.InputError, match="seed"):
            work(model, [record], seed=1.5)


@pytest.mark.parametrize("work", [rss.diagnose, rss.identify, rss.isolability, rss.simulate, rss.prescribed_force])
@pytest.mark.parametrize("given, found", [([[1.0, 2.0, 3.0]], "list"), (5, "int"), ([None], "NoneType"),
                                          ({"a": 1}, "dict")])
def test_what_is_no_record_is_refused(work, given, found):
    with pytest.raises(rss.InputError, match=rf"record: a Record, .* {found} found"):
        work(tank_model(), given)


def test_several_records_where_one_is_needed_and_tests_without_names_are_refused():
    record = rss.Record(np.arange(0.0, 20.0, 0.05), {"Heave": np.zeros(400)}, kind="decay")
    with pytest.raises(rss.InputError, match="a list of 2 found; give one record"):
        rss.simulate(tank_model(), [record, record])
    for tests in (5, [[1, 2]]):
        with pytest.raises(rss.InputError, match="tests: beginnings of names"):
            rss.plan_tests(tank_model(), tests=tests)
    with pytest.raises(rss.InputError, match="int found"):
        rss.plan_tests(tank_model(), tests={"a": 1})


SECTION = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 12)).select("Heave")


@pytest.mark.parametrize("work, words", [
    (lambda: SECTION.replace(reference_point=(1.0, 2.0)), r"reference_point .*shape \(2,\) found"),
    (lambda: SECTION.replace(reference_point=(1.0, 2.0, "x")), "reference_point .*not an array"),
    (lambda: tank_model().at((0.0, 0.0), origin=(0.0, 0.0, 0.0)), r"reference_point .*shape \(2,\) found"),
    (lambda: tank_model().attached(stiffness="stiff"), "stiffness: not an array"),
    (lambda: SECTION.kernel([]), "times must be finite"), (lambda: SECTION.kernel(["x"]), "t: not an array"),
    (lambda: SECTION.kernel([[1.0]]), r"t: shape \(1, 1\) found"),
    (lambda: rss.encounter_frequency(1.0, 3.0, depth=-10.0), "depth: must be positive, or inf"),
    (lambda: rss.wave_frequencies(0.2, 8.0, 0.0, depth=np.nan), "depth: must be positive, or inf"),
    (lambda: rss.realise(rss.jonswap(2.0, tp=8.0), 60.0, 0.25).elevation_at(1.0, depth=0.0), "depth: must be positive"),
    (lambda: rss.sampled(tank_model(), 0.1, band=-1.0), "band: must be positive"),
    (lambda: rss.fit_excitation(SECTION, np.pi / 2, states=2.5), "states: 2.5 found"),
    (lambda: rss.fit_excitation(SECTION, np.pi / 2, states=4, lead=np.nan), "lead .*not finite"),
    (lambda: rss.sampled(tank_model(), 0.1, seed=-1), "seed: -1"),
    (lambda: rss.realise(rss.jonswap(2.0, tp=8.0), 60.0, 0.25, directions=[np.nan]), "directions .*not finite"),
    (lambda: rss.realise(rss.jonswap(2.0, tp=8.0), 60.0, 0.25, directions=[0.0, 1.0], spreading=[np.nan, 1.0]),
     "spreading: .*not finite"),
    (lambda: rss.as_model(("a", "b", "c"), tank_model().fit), "M: not an array"),
    (lambda: rss.read_hydro(".", format="wamit"), "a folder; one of the files of the run"),
    (lambda: strip_theory([(0.0, rss.lewis_section(1.0, 0.5, 0.9)), (1.0, None)], [1.0, 2.0], gyradii=(1.0, 2.0)),
     r"gyradii .*shape \(2,\) found")])
def test_numbers_that_make_no_sense_are_refused(work, words):
    with pytest.raises(rss.InputError, match=words):
        work()


def test_one_name_is_one_name(tmp_path):
    assert rss.rigid_body(([[2.0]], [[8.0]], [[0.0]]), "Heave").input_labels == ["heave_force"]
    tank_model().write(tmp_path / "tank.nc")
    assert rss.read_model(tmp_path / "tank.nc", dofs="Heave").dofs == ("Heave",)


@pytest.mark.parametrize("time, heave, words", [
    (np.array(["2024-01-01", "2024-01-02"], "datetime64[s]"), [1.0, 2.0], "dates or times"),
    (np.array([0, 1], "timedelta64[s]"), [1.0, 2.0], "dates or times"),
    ([0.0, 1.0], [[1.0, 2.0], [3.0]], "not an array"), ([0.0, 1.0], [10**400, 2], "not an array"),
    ([0.0, 1.0], [1j, 2.0], "complex"), (["a", "b"], [1.0, 2.0], "not an array")])
def test_arrays_that_hold_no_numbers_are_refused(time, heave, words):
    with pytest.raises(rss.InputError, match=words):
        rss.Record(time, {"Heave": heave})


def test_masked_samples_are_missing():
    heave = np.ma.masked_array([1.0, 2.0, 3.0], [False, True, False])
    assert np.array_equal(rss.Record([0.0, 1.0, 2.0], {"Heave": heave}).channels["Heave"], [1.0, np.nan, 3.0],
                          equal_nan=True)


@pytest.mark.parametrize("item", ["quadratic_drag", 3, ("quadratic_drag", {"coefficient": "x"}),
                                  ("quadratic_drag", {"coefficient": np.nan})])
def test_what_is_no_effect_is_refused(item):
    with pytest.raises(rss.InputError, match="effect"):
        rss.simulate(tank_model(), (np.arange(3.0), np.zeros((1, 3))), [item])


def test_numbers_without_sense_are_refused():
    time = np.arange(0.0, 20.0, 0.05)
    record = rss.Record(time, {"Heave": np.cos(5.4 * time) * np.exp(-0.1 * time)}, kind="decay")
    for words in ({"tolerance": "2%"}, {"tolerance": {"mass": "x"}}, {"effects": ["coulomb_friction"] * 2},
                  {"withhold": record}):
        with pytest.raises(rss.InputError, match=r"tolerance|twice|withheld"):
            rss.diagnose(tank_model(), record, **words)
    with pytest.raises(rss.InputError, match="noise"):
        rss.isolability(tank_model(), record, noise=np.nan)
    with pytest.raises(rss.InputError, match="samples"):
        rss.realise(rss.jonswap(1.0, tp=3.0), 1e15, 0.1)


def test_one_name_is_a_list_of_one(tmp_path):
    model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    time = np.arange(0.0, 30.0, 0.05)
    drag = ("quadratic_drag", "Heave", {"coefficient": 3.0})
    single = rss.simulate(model, (time, np.zeros((1, time.size))), drag, start=[0.1, 0.0]).outputs
    np.testing.assert_array_equal(
        single, rss.simulate(model, (time, np.zeros((1, time.size))), [drag], start=[0.1, 0.0]).outputs)
    record = rss.Record(time, {"Heave": single[0]}, kind="decay")
    named, listed = (rss.diagnose(model, record, **{name: form("quadratic_drag") for name in ("effects", "present")},
                                  absent=form("coulomb_friction")) for form in (str, lambda name: [name]))
    assert named.verdict.effects[0].name == "quadratic_drag" and str(named) == str(listed)
    assert rss.isolability(model, record, "quadratic_drag").labels == rss.isolability(
        model, record, ["quadratic_drag"]).labels
    assert rss.plan_tests(model, effects="quadratic_drag", tests="decay").labels
    (tmp_path / "a.csv").write_text("# kind: decay\ntime [s],Heave [m],Heave_velocity [m/s]\n0,1,2\n1,1,2\n2,0,1\n")
    assert set(rss.read_record(tmp_path / "a.csv", ignore="Heave_velocity").channels) == {"Heave"}
