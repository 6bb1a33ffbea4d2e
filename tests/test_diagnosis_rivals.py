"""Wrong zeros beside a cause, which no record tells from a steady force, and a motion that a sensor cannot see."""


import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from seeds import some

import radiation_ss as rss
from radiation_ss.diagnosis import Grounds, Named, verdict

DOFS = ("Heave", "Pitch")
M, B, C = np.diag([2.0, 0.5]), np.diag([0.25, 0.1]), np.diag([8.0, 3.0])
MODEL = rss.Model(DOFS, M, np.zeros((2, 2)), C, rss.RadiationFit(DOFS, np.zeros((0, 0)), np.zeros((0, 2)),
                                                                 np.zeros((2, 0)), 0), D=B)
TIME = np.arange(0.0, 40.0, 0.05)


def released(offset, seed, damping=1.0):
    """Return displacements of the linear body let go from an offset, by the exponential of its matrix."""
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, C), -np.linalg.solve(M, damping * B)]])
    step, state, found = expm(A * 0.05), np.r_[offset, 0.0, 0.0], []
    for _ in TIME:
        found.append(state[:2])
        state = step @ state
    return np.array(found).T + 2e-4 * np.random.default_rng(seed).normal(size=(2, TIME.size))


@pytest.mark.parametrize("seed", range(1))
def test_zeros_that_are_off_hide_no_damping_and_get_no_name(seed):
    zero = np.array([[0.006], [-0.004]])
    records = [rss.Record(TIME, dict(zip(DOFS, released(start, 10 * seed + k, damping=2.0) + zero)), kind="decay",
                          name=f"decay {k}")
               for k, start in enumerate([(0.1, 0.05), (-0.08, 0.06), (0.05, -0.1)])]
    found = rss.diagnose(MODEL, records)
    assert {(effect.name, effect.dof) for effect in found.verdict.effects} == {("linear_damping", d) for d in DOFS}
    bands = np.array(found.where.bands)  # of both motions and all records: side by side, and the shares of one gap
    assert np.all(bands[1:, 0] >= bands[:-1, 1]) and bands[:, 2].sum() == pytest.approx(1.0)
    for dof in DOFS:  # which of the two is off matters to no name, and both are listed
        listed = {e.name for choice in found.which for e in choice.effects if e.dof == dof}
        assert {"constant_force", "sensor_bias"} <= listed


def test_a_motion_below_the_noise_of_its_sensor_makes_no_gap():
    quiet = released((0.1, 0.0), 5)  # in pitch nothing but noise, and a zero that is off by twenty times of it
    unseen = rss.Record(TIME, dict(zip(DOFS, quiet + np.array([[0.0], [0.004]]))), kind="decay", name="unseen")
    known = rss.Record(TIME, dict(zip(DOFS, released((0.1, 0.05), 6))), kind="decay", name="seen")
    found = rss.diagnose(MODEL, known, withhold=unseen)
    assert found.how_far.gap_before < 0.05 and found.verdict.status == "no_gap"


@pytest.mark.parametrize("delay", [0.2, -0.3])
def test_a_large_delay_is_one_delay(delay):
    """To first order in a delay of .2 or .3 rad a delay of the force beside one of the sensor would do better."""
    model = rss.body(dof="Heave", mass=10.0, added_mass=5.0, C=300.0, damping_ratio=0.03)
    M, D, K, late, time = 15.0, model.D[0, 0], 300.0, delay / np.sqrt(20.0), np.arange(0.0, 80.0, 0.04)
    omega = np.linspace(0.5, 1.9, 60) * np.sqrt(20.0)
    records = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        waves = np.exp(1j * rng.uniform(0.0, 6.28, 60))
        def signal(t, gain):
            return (np.exp(1j * np.outer(t, omega)) @ (waves * gain)).real  # noqa: B023
        x = signal(time - late, 1.0 / (K - omega**2 * M + 1j * omega * D))
        x += 0.002 * x.std() * rng.normal(size=time.size)
        records.append(rss.Record(time, {"Heave": x, "Heave_force": signal(time, 1.0)}, kind="forced", name=f"r{seed}"))
    found = rss.diagnose(model, records)
    # Sensor and force delayed say the same.
    sets = found.verdict.indistinguishable or [[effect.name for effect in found.verdict.effects]]
    assert sets and {some for (some,) in sets} <= {"excitation_delay", "sensor_delay"}
    (row,) = [row for row in found.budget.rows if row.cause.endswith("_delay")]
    (value, deviation), = row.parameters.values()
    assert abs(value - late) < 2.0 * deviation


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_delay_of_all_motions_is_one_effect(seed):
    rng, late, omega = np.random.default_rng(seed), 0.08, np.linspace(0.8, 4.5, 60)
    waves = np.exp(1j * rng.uniform(0.0, 6.28, (2, 60)))
    phases = np.exp(1j * np.outer(TIME, omega))
    channels = {}
    for i, dof in enumerate(DOFS):
        answer = waves[i] * np.exp(-1j * omega * late) / (C[i, i] - omega**2 * M[i, i] + 1j * omega * B[i, i])
        x = (phases @ answer).real
        channels |= {dof: x + 0.002 * x.std() * rng.normal(size=TIME.size), f"{dof}_force": (phases @ waves[i]).real}
    found = rss.diagnose(MODEL, rss.Record(TIME, channels, kind="forced", name="late"))
    sets = found.verdict.indistinguishable or [[effect.name for effect in found.verdict.effects]]
    assert sets and {label for some in sets for label in some} <= {"common_sensor_delay", "common_excitation_delay"}
    (row,) = [row for row in found.budget.rows if row.cause.startswith("common")]
    value, std = row.parameters["delay"]
    assert abs(value - late) < 3.0 * std and std < 0.02 / 2.0  # the force's phase, .02 rad at 2 rad/s, in two motions


@pytest.mark.parametrize("times", [0.5, 1.3, 2.0])
def test_a_force_several_times_too_small_or_large_is_a_gain_and_the_sensor_its_twin(times):
    model = rss.body(dof="Heave", mass=2.0e5, added_mass=1.0e5, C=3.0e5, damping_ratio=0.05)
    time, rng = np.arange(0.0, 200.0, 0.05), np.random.default_rng(0)
    force = 3.0e4 * np.convolve(rng.normal(size=time.size), np.hanning(40), "same")
    moved = rss.simulate(model, (time, times * force[None])).outputs[0]
    record = rss.Record(time, {"Heave": moved + 0.01 * moved.std() * rng.normal(size=time.size), "Heave_force": force},
                        kind="forced")
    found = rss.diagnose(model, record, effects=["excitation_gain", "sensor_gain", "linear_stiffness", "added_inertia"])
    assert set(found.verdict.indistinguishable[:2]) == {("excitation_gain",), ("sensor_gain",)}
    assert found.how_far.gap_after < 1.1 * found.how_far.noise_floor


@pytest.mark.parametrize("ratio", [0.01, 0.025])
def test_a_model_with_too_much_damping_is_told_by_how_much(ratio):
    model, body = (rss.body(dof="Heave", mass=2.0e5, added_mass=1.0e5, C=3.0e5, damping_ratio=r) for r in (0.05, ratio))
    time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(0)
    moved = rss.simulate(body, (time, np.zeros((1, time.size))), start={"Heave": 1.0}).outputs[0]
    record = rss.Record(time, {"Heave": moved + 0.003 * rng.normal(size=time.size)}, kind="decay")
    rivals = rss.diagnose(model, record).verdict.indistinguishable
    assert rivals[0] == ("linear_damping",)
    assert ("delayed_feedback",) in rivals  # what feeds the motion, as a late spring does, is as rare
    found = rss.diagnose(model, record, absent=["delayed_feedback"])
    assert [effect.name for effect in found.verdict.effects] == ["linear_damping"]
    value, std = found.verdict.effects[0].parameters["coefficient"]
    assert abs(value - (body.D - model.D)[0, 0]) < 3.0 * std < 0.3 * abs(value)


def test_a_model_brings_its_tolerance_and_an_argument_is_before_it():
    """The closed form of a decay, stiffness 8 % off."""
    given = {"dof": "Heave", "mass": 1000.0, "C": 1e4, "added_mass": 580.0, "damping_ratio": 0.05}
    model, unsure = rss.body(**given), rss.body(**given, tolerance={"stiffness": 0.1})
    pole, time = np.roots([1580.0, model.D[0, 0], 1.08e4])[0], np.arange(0.0, 40.0, 0.05)
    x = 0.1 * (np.exp(pole * time) * (1.0 + 1j * pole.real / pole.imag)).real
    record = rss.Record(time, {"Heave": x + 2e-4 * np.random.default_rng(0).standard_normal(time.size)}, kind="decay")
    considered = ["linear_stiffness", "quadratic_drag"]
    found, said = rss.diagnose(unsure, record, considered), rss.diagnose(unsure, record, considered, tolerance=0.02)
    stiffness = next(n for n in found.recalibrated if n.name == "stiffness")
    assert found.verdict.status == "no_gap" and stiffness.tolerance == pytest.approx(0.1)
    assert abs(stiffness.value - 0.08) < 3.0 * stiffness.std and said.verdict.status != "no_gap"


@pytest.mark.parametrize("seed, times", [(0, 3.0), (1, -3.0)])
def test_a_number_off_by_three_tolerances_is_told_and_by_one_of_them_is_no_gap(times, seed):
    """The closed form of a decay whose frequency is not the model's: inertia or stiffness, by a number or an effect."""
    model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    rate, omega = 0.5 * model.D[0, 0] / 2.0, 2.0 * (1.0 - 0.5 * times * 0.02)
    waves = np.exp(-rate * TIME) * (np.cos(omega * TIME) + rate / omega * np.sin(omega * TIME))
    rng = np.random.default_rng(seed)
    moved = {start: start * waves + 2e-4 * rng.normal(size=TIME.size) for start in (0.1, -0.07, 0.05)}
    records = [rss.Record(TIME, {"Heave": x}, kind="decay", name=f"from {start}") for start, x in moved.items()]
    stated, wide = (rss.diagnose(model, records[:2], withhold=records[2], tolerance=t) for t in (0.02, 0.06))
    told = {label for labels in stated.verdict.indistinguishable for label in labels}
    assert stated.verdict.status in ("ambiguous", "effect")
    assert (told | {e.name for e in stated.verdict.effects}) & {"added_inertia", "linear_stiffness"}
    assert wide.verdict.status == "no_gap" and wide.how_far.gap_after < 0.1 * wide.how_far.gap_before


@pytest.mark.parametrize("clear", [(), ("tank_resonance",), ("hysteresis", "tank_resonance")])
def test_effects_that_stand_out_are_in_every_set_of_those_that_stand_for_each_other(clear):
    names = ("excitation_delay", "hysteresis", "sensor_delay", "tank_resonance")
    grounds = Grounds(tuple(Named(name, "Heave", {}, {}, 1.0) for name in clear), (), (), (names,), 1.0, 0.0, 0.9, 0.0,
                      whole=False, checked=True, matter=True, shrinks=True, grows=False, closes=True, outside=False,
                      plausible=True, moved=False, surprising=False, no_more=0.4, first=1.0)
    status, _, sets = verdict(grounds, ["Heave"])
    assert status == "ambiguous" and all(told[:-1] == clear for told in sets)
    assert {told[-1] for told in sets} == set(names) - set(clear)


@pytest.mark.parametrize("outside, told", [(False, "ambiguous"), (True, "unknown_effect")])
def test_a_sure_effect_is_never_no_gap_where_the_unseen_gap_stays(outside, told):
    """What the rows bear out may not predict: of impacts, a motion soon goes another way."""
    grounds = Grounds((Named("end_stop", "Heave", {}, {}, 1.0),), (), (), (("end_stop",),), 1.0, 0.0, 0.0, 0.0,
                      whole=True, checked=True, matter=True, shrinks=False, grows=False, closes=False, outside=outside,
                      plausible=True, moved=False, surprising=False, no_more=0.4, first=1.0)
    status, _, sets = verdict(grounds, ["Heave"])
    assert status == told and sets == ((("end_stop",),) if told == "ambiguous" else ())


def test_what_predicts_unseen_records_no_better_may_be_absent():
    grounds = Grounds((), (), (), (("relative_stiffness",), ("coupling_stiffness",)), 0.0, 0.1, 0.9, 0.0, whole=False,
                      checked=True, matter=True, shrinks=False, grows=True, closes=False, outside=False, plausible=True,
                      moved=False, surprising=False, no_more=0.4, first=0.5)
    status, _, sets = verdict(grounds, ["Heave"])
    assert status == "ambiguous" and sets == ((), ("relative_stiffness",), ("coupling_stiffness",))


@pytest.mark.parametrize("sets", [((), ("linear_stiffness",)), (("linear_stiffness",),)])
def test_that_nothing_is_there_is_no_answer_where_it_is_rather_not_so(sets):
    grounds = Grounds((), (), (), sets, 0.0, 0.4, 0.9, 0.0, whole=True, checked=True, matter=False, shrinks=True,
                      grows=False, closes=True, outside=False, plausible=True, moved=True, surprising=False,
                      no_more=0.4, first=0.4)
    status, chance, told = verdict(grounds, ["Heave"])
    assert (status, chance, told) == ("ambiguous", 0.4, ((), ("linear_stiffness",)))


def test_effects_that_close_a_gap_against_each_other_are_unknown():
    grounds = Grounds((Named("cubic_stiffness", "Roll", {}, {}, 1.0),), (), (),
                      (("cubic_stiffness", "quintic_stiffness"),), 0.9, 0.0, 0.45, 0.0, whole=True, checked=True,
                      matter=True, shrinks=True, grows=False, closes=True, outside=False, plausible=True, moved=False,
                      surprising=False, no_more=0.4, first=0.9)
    assert verdict(grounds, ["Roll"]) == ("unknown_effect", 0.55, ())


@pytest.mark.parametrize("seed", some([2, 4]))
def test_a_pendulum_on_video_keeps_its_softening_where_damping_is_as_likely_to_be_there_as_not(seed):
    """55 degrees, 26 swings: without the damping that a single swing hardly shows any restoring slips out of phase."""
    length, weight = 0.334, 0.015 * 9.81
    swung = solve_ivp(lambda t, y: [y[1], -9.81 / length * np.sin(y[0]) - 0.0054 * abs(y[1]) * y[1] - 0.0164 * y[1]],
                      (0.0, 30.6), [0.968, -0.37], t_eval=np.arange(917) / 30.0, rtol=1e-9, atol=1e-10)
    noise = 0.011 * np.random.default_rng(seed).normal(size=swung.t.size)
    bob = rss.Record(swung.t, {"Pitch": swung.y[0] + noise}, kind="decay", name="bob")
    model = rss.body(dof="Pitch", C=weight * length, mass=0.015, gyradius=length, added_mass=0.0, damping_ratio=0.0)
    found = rss.diagnose(model, bob)
    assert found.verdict.status in ("effect", "ambiguous") and found.how_far.gap_after < 0.06
    told = found.verdict.indistinguishable or [[e.name for e in found.verdict.effects]]
    assert all("cubic_stiffness" in names for names in told)


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_stiffening_mooring_is_seen_beside_a_drift_force_that_makes_most_of_the_gap(seed):
    """Slow surge in waves: what no effect explains is a share of what the mooring holds, not of the waves' force."""
    rng, inertia, t = np.random.default_rng(seed), 2.26e7, np.arange(0.0, 2400.0, 0.5)
    stiffness, damping = inertia * 0.0628**2, 2.0 * 0.02 * 0.0628 * inertia
    w = 2.0 * np.pi / 11.0 * (np.linspace(0.4, 2.5, 150) + 0.007 * rng.uniform(-1.0, 1.0, 150))
    size = 1.25 / np.sqrt(150 / 2.0) * np.exp(-0.5 * ((w - 0.571) / 0.1) ** 2) * 2.6
    waves = np.exp(1j * (np.outer(t, w) + rng.uniform(0.0, 2.0 * np.pi, 150))) @ size
    force = 2.5e6 * waves.imag
    push = CubicSpline(t, force + 3e4 * np.abs(waves) ** 2)
    moved = solve_ivp(lambda t, y: [y[1], (push(t) - damping * y[1] - stiffness * y[0] - 120.0 * y[0] ** 3) / inertia],
                      (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=0.5, rtol=1e-6)
    surge, late = moved.y[0] + 0.02 * rng.normal(size=t.size), t >= 300.0
    sea = rss.Record(t[late], {"Surge": surge[late], "Surge_force": force[late], "wave_elevation": waves.real[late]},
                     kind="waves", name="sea")
    model = rss.body(dof="Surge", mass=1.4e7, added_mass=8.6e6, C=stiffness, damping_ratio=0.02)
    found = rss.diagnose(model, sea)
    assert {e.name for e in found.verdict.effects} == {"wave_drift", "cubic_stiffness"}
    value, std = next(e.parameters["stiffness"] for e in found.verdict.effects if e.name == "cubic_stiffness")
    assert abs(value - 120.0) < 3.0 * std < 60.0


@pytest.mark.parametrize("seed", some(range(2)))
def test_drag_beside_a_model_with_too_much_linear_damping_is_two_numbers_of_one_curve(seed):
    inertia, stiffness, t = 3.0, 12.0, np.arange(0.0, 60.0, 0.05)
    records = []
    for start in (0.4, 0.2):
        swung = solve_ivp(lambda t, y: [y[1], (-0.06 * y[1] - 0.5 * abs(y[1]) * y[1] - stiffness * y[0]) / inertia],
                          (0.0, t[-1]), [start, 0.0], t_eval=t, rtol=1e-9, atol=1e-12).y[0]
        noise = 0.001 * np.random.default_rng([seed, len(records)]).normal(size=t.size)
        records.append(rss.Record(t, {"Heave": swung + noise}, kind="decay", name=f"from {start} m"))
    model = rss.body(dof="Heave", mass=inertia, added_mass=0.0, C=stiffness, damping_ratio=0.02)    # D = .24 N s/m
    found = rss.diagnose(model, records)
    assert found.budget.against == 0.0
    sizes = {e.name: next(iter(e.parameters.values())) for e in found.verdict.effects}
    assert sizes.keys() == {"quadratic_drag", "linear_damping"}
    for name, true in (("quadratic_drag", 0.5), ("linear_damping", -0.18)):
        assert abs(sizes[name][0] - true) < 3.0 * sizes[name][1]
