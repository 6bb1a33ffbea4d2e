"""The gap of static tests, made here by closed forms: the order of their rows does not choose what it is."""

import numpy as np
import pytest

import radiation_ss as rss

SHIP = {"dof": "Roll", "mass": 993.0, "GM": 0.0843, "gyradius": 0.341, "added_mass": 19.0, "damping_ratio": 0.005}
UP = np.arange(-10.0, 11.0)
ORDERS = {"up": UP, "down": UP[::-1], "to both sides": np.array(sorted(UP, key=abs)),
          "there and back": np.r_[0.0:11.0:2.0, 8.0:-11.0:-2.0, -8.0:1.0:2.0],
          "shuffled": np.random.default_rng(7).permutation(UP)}


def inclined(model, degrees, law, *, name="inclining", seed=1):
    heel = np.deg2rad(degrees)
    seen = heel + np.deg2rad(0.005) * np.random.default_rng(seed).standard_normal(heel.size)
    load = law(model.C[0, 0], heel)
    return rss.Record(np.arange(float(heel.size)), {"Roll": seen, "Roll_force": load}, kind="static", name=name)


@pytest.mark.parametrize("order", ORDERS)
def test_a_stiffness_that_is_a_tenth_off_makes_an_eleventh_of_the_load_in_any_order(order):
    model = rss.body(**SHIP)
    record = inclined(model, ORDERS[order], lambda C, heel: 1.1 * C * heel)
    found = rss.diagnose(model, record, effects=["linear_stiffness"], tolerance={"stiffness": 0.02})
    assert found.how_far.gap_before == pytest.approx(0.1 / 1.1, rel=0.02)
    assert found.how_far.gap_after < 0.005


@pytest.mark.parametrize("order", ["there and back", "shuffled"])
def test_what_grows_with_the_heel_is_seen_wherever_the_record_ends(order):
    """Of places around zero alone the cubic has no share: the gap is over the whole range of loads."""
    model, heel = rss.body(**SHIP), np.deg2rad(ORDERS[order])
    own, cubic = model.C[0, 0] * heel, 4.0 * model.C[0, 0] * heel**3
    found = rss.diagnose(model, inclined(model, ORDERS[order], lambda C, x: C * x + 4.0 * C * x**3),
                         effects=["cubic_stiffness"])
    whole = np.sqrt(np.sum(cubic**2) / np.sum((own + cubic) ** 2))
    assert [e.name for e in found.verdict.effects] == ["cubic_stiffness"]
    assert found.how_far.gap_before == pytest.approx(whole, rel=0.25)
    assert found.how_far.gap_after < 0.2 * whole


def test_the_way_to_a_place_is_known_where_the_places_between_are_unseen():
    """Friction holds against the way that the body came; of every third place alone it has another one at a turn."""
    model = rss.body(**SHIP)
    there = np.r_[0.0:11.0:2.0, 8.0:-11.0:-2.0, -8.0:11.0:2.0, 8.0:-1.0:-2.0]
    way = np.sign(np.diff(there, prepend=-1.0))
    record = inclined(model, there, lambda C, heel: C * heel + 4.0 * way)
    found = rss.diagnose(model, record, effects=["coulomb_friction", "linear_stiffness"])
    assert [e.name for e in found.verdict.effects] == ["coulomb_friction"]
    assert found.how_far.gap_after < 0.1 * found.how_far.gap_before


def test_a_place_without_its_load_tells_nothing_but_the_way():
    model = rss.body(**SHIP)
    record = inclined(model, ORDERS["there and back"], lambda C, heel: 1.1 * C * heel)
    load = record.channels["Roll_force"].copy()
    load[[3, 4, 9]] = np.nan
    found = rss.diagnose(model, record.with_channels(Roll_force=load), effects=["linear_stiffness"])
    rows = np.flatnonzero(np.isfinite(load))
    fewer = rss.diagnose(model, rss.Record(np.arange(float(rows.size)), {
        name: values[rows] for name, values in record.channels.items()}, kind="static", name="inclining"),
        effects=["linear_stiffness"])
    assert found.verdict.status == fewer.verdict.status
    assert found.how_far.gap_before == pytest.approx(fewer.how_far.gap_before, rel=0.02)


@pytest.mark.parametrize("share", [0.5, 0.7, 0.85, 1.2, 1.4, 2.0])
def test_a_stiffness_and_the_gains_of_sensor_and_load_cell_are_one_in_a_static_test(share):
    """A stiffness of `share` C, a sensor that reads 1 / share and a load of 1 / share make the same places."""
    model, load = rss.body(**SHIP), np.linspace(-80.0, 80.0, 9)
    heel = load / (share * model.C[0, 0])
    heel = heel + 0.005 * heel.std() * np.random.default_rng(3).standard_normal(9)
    record = rss.Record(np.arange(9.0), {"Roll": heel, "Roll_force": load}, kind="static", name="inclining")
    found = rss.diagnose(model, record)
    alone = {tuple(e.name for e in choice.effects): choice.log_evidence for choice in found.which}
    assert found.verdict.status == "ambiguous" and not found.verdict.effects
    assert set(found.verdict.indistinguishable) >= {("linear_stiffness",), ("sensor_gain",), ("excitation_gain",)}
    assert alone["sensor_gain",] == pytest.approx(alone["excitation_gain",], abs=0.1)
    assert alone["linear_stiffness",] == pytest.approx(alone["sensor_gain",], abs=2.5)
    left = rss.simulate(model, record, found.corrected).outputs[0] - heel
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(heel) and found.how_far.gap_after < 0.02


@pytest.mark.parametrize("times", [0.6, 1.4, 1.8])
def test_a_gain_is_what_the_sensor_reads_more_however_large_it_is(times):
    model, load = rss.body(**SHIP), np.linspace(-60.0, 60.0, 15)
    heel = times * load / model.C[0, 0]
    heel = heel + 5e-5 * np.random.default_rng(2).standard_normal(15)
    record = rss.Record(np.arange(15.0), {"Roll": heel, "Roll_force": load}, kind="static", name="inclining")
    found = rss.diagnose(model, record, effects=["sensor_gain"])
    (effect,) = found.verdict.effects
    assert effect.parameters["gain"][0] == pytest.approx(times - 1.0, abs=0.02)
    left = rss.simulate(model, record, found.corrected).outputs[0] - heel
    assert np.linalg.norm(left) < 0.005 * np.linalg.norm(heel) and found.how_far.gap_after < 0.005


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [0.15, 0.3, 4.0])
def test_a_far_factor_of_load_and_place_is_no_more_a_stiffness_than_a_gain(share, seed):
    """F = share C x: the three causes are one number however far it is from 1."""
    model = rss.body(**SHIP)
    record = inclined(model, UP, lambda C, x: share * C * x, seed=seed)
    found = rss.diagnose(model, record)
    same = {("linear_stiffness",), ("sensor_gain",), ("excitation_gain",)}
    assert found.verdict.status == "ambiguous" and set(found.verdict.indistinguishable) >= same
    assert 0.1 < found.verdict.probability < 0.5
    if share < 1.0:  # of a rig whose cells are known
        alone = rss.diagnose(model, record, effects=["linear_stiffness", "cubic_stiffness"])
        assert [e.name for e in alone.verdict.effects] == ["linear_stiffness"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("unit, newton", [("kgf", 9.80665), ("lbf", 4.4482216)])
def test_a_load_in_another_unit_is_told_before_any_name(unit, newton, seed):
    model = rss.body(**SHIP)
    record = inclined(model, UP, lambda C, x: C * x / newton, seed=seed)
    for effects in (None, ["linear_stiffness"]):
        found = rss.diagnose(model, record, effects=effects)
        assert found.verdict.status == "ambiguous" and not found.verdict.effects and found.verdict.probability <= 0.5
        (said,) = found.misreadings
        assert f"force in {unit} is" in said and found.sentence.startswith(f"First check {said}")
    right = rss.diagnose(model, inclined(model, UP, lambda C, x: C * x, seed=seed))
    assert not right.misreadings and right.verdict.status == "no_gap" and "% of the force" in right.sentence


@pytest.mark.parametrize("loads", [np.r_[0:301:50, 250:-301:-50, -250:1:50].astype(float),
                                   np.r_[0:301:10, 290:-301:-10, -290:301:10].astype(float)])
@pytest.mark.parametrize("friction", [20.0, 60.0])
def test_places_where_friction_holds_the_body_while_its_load_turns_are_left_out_and_told(loads, friction):
    """There friction is whatever the balance asks, up to its own: no law of the way holds."""
    model = rss.body(dof="Heave", mass=1000.0, added_mass=0.0, C=2300.0, damping_ratio=0.02)
    at, places = 0.0, []
    for load in loads:
        left = load - 2300.0 * at
        at = at if abs(left) <= friction else (load - np.sign(left) * friction) / 2300.0
        places.append(at)
    seen = np.array(places) + 1e-3 * np.random.default_rng(1).standard_normal(loads.size)
    record = rss.Record(np.arange(float(loads.size)), {"Heave": seen, "Heave_force": loads}, kind="static", name="pull")
    found = rss.diagnose(model, record)
    assert [e.name for e in found.verdict.effects] == ["coulomb_friction"]
    value, std = found.verdict.effects[0].parameters["force"]
    assert abs(value - friction) < 4.0 * std < 0.15 * friction
    assert found.how_far.gap_after < 0.2 * found.how_far.gap_before
    assert any("stays while its load turns" in note for note in found.notes)


def test_a_body_that_only_springs_hold_is_nowhere_told_to_stay():
    model, heel = rss.body(**SHIP), ORDERS["there and back"]
    found = rss.diagnose(model, inclined(model, heel, lambda C, x: 1.1 * C * x), effects=["linear_stiffness"])
    assert not any("stays while its load turns" in note for note in found.notes)
