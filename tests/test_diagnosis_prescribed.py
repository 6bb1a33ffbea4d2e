"""Driven motions with the force measured, made here from phasors: what a diagnosis says of the force's error."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter, lsim, savgol_filter
from seeds import some

import radiation_ss as rss
from radiation_ss.simulation import check_units

TIME = np.arange(0.0, 40.0, 0.02)


def model_of(dof, inertia, added, stiffness, memory):
    c1, c0, gain = memory
    fit = rss.RadiationFit((dof,), np.array([[0.0, 1.0], [-c0, -c1]]), np.array([[0.0], [1.0]]),
                           np.array([[0.0, gain]]), 2)
    return rss.Model((dof,), [[inertia]], [[added]], [[stiffness]], fit)


def driven(dof, numbers, size, middle, hidden, seed):
    """A sum of twelve sines; the true body's inertia, memory and stiffness are 1, -1.5 and 1.2 % off the model's."""
    rng = np.random.default_rng(seed)
    omega = middle * np.linspace(0.5, 1.6, 12)
    phasor = size / 3.0 * rng.uniform(0.4, 1.0, 12) * np.exp(2j * np.pi * rng.random(12))
    inertia, added, stiffness, (c1, c0, gain) = numbers
    memory = gain * 1j * omega / (c0 - omega**2 + 1j * omega * c1)
    x, v, linear = (np.real((phasor * part) @ np.exp(1j * np.outer(omega, TIME))) for part in (
        1.0, 1j * omega, 1.012 * stiffness - 1.01 * omega**2 * (inertia + added) + 0.985j * omega * memory))
    force = linear + hidden(x, v)
    noise = rng.standard_normal((2, TIME.size))
    return rss.Record(TIME, {dof: x + 2e-3 * x.std() * noise[0],
                             f"{dof}_force": force + 5e-3 * force.std() * noise[1]}, kind="prescribed", name=f"{seed}")


HEAVE = ("Heave", (40.0, 30.0, 2300.0, (3.0, 20.0, 120.0)), 0.05, 5.0)
SWAY = ("Sway", (40.0, 20.0, 0.0, (3.0, 20.0, 120.0)), 0.08, 4.0)
ROLL = ("Roll", (1.0, 0.3, 20.0, (3.0, 16.0, 0.6)), 0.12, 4.0)


@pytest.mark.parametrize("test, hidden, told", [
    (HEAVE, lambda x, v: 60.0 * v * np.abs(v), {"quadratic_drag": 60.0}), (HEAVE, lambda x, v: 0.0 * v, {}),
    (SWAY, lambda x, v: 80.0 * v * np.abs(v), {"quadratic_drag": 80.0}), (SWAY, lambda x, v: 0.0 * v, {}),
    (ROLL, lambda x, v: 0.06 * np.tanh(v / 0.01) + 150.0 * x**3, {"coulomb_friction": 0.06, "cubic_stiffness": 150.0}),
    (ROLL, lambda x, v: 3.0 * v**3, {"cubic_damping": 3.0}),
    (ROLL, lambda x, v: 30.0 * x**2 * v, {"angle_damping": 30.0}),
    (ROLL, lambda x, v: 2e4 * x**5, {"quintic_stiffness": 2e4}), (ROLL, lambda x, v: 0.0 * v, {})])
def test_driven_heave_sway_and_roll_tell_effects_with_their_size_and_no_others(test, hidden, told):
    dof, numbers, size, middle = test
    seen = [driven(dof, numbers, size * share, middle, hidden, seed) for seed, share in ((1, 0.8), (2, 1.0))]
    found = rss.diagnose(model_of(dof, *numbers), seen, withhold=[driven(dof, numbers, 0.9 * size, middle, hidden, 9)])
    assert {e.name for e in found.verdict.effects} == set(told)
    for effect in found.verdict.effects:
        value, deviation = next(iter(effect.parameters.values()))
        assert abs(value - told[effect.name]) < max(3.0 * deviation, 0.03 * told[effect.name])
    assert found.how_far.gap_after < 0.02 and 0.003 < found.how_far.noise_floor < 0.02
    assert ("% of the force" in found.sentence) == (found.verdict.status == "no_gap")
    assert "of the motion" not in found.sentence


@pytest.mark.parametrize("channel, gain, told", [("Heave_force", 1.2, 1.0 / 1.2 - 1.0), ("Heave", 1.15, 0.15)])
def test_the_gain_of_the_load_cell_and_of_the_motions_sensor_are_one_and_both_are_told(channel, gain, told):
    """The force F of motion x is read as 1.2 F, or x as 1.15 x: either cause makes of F (1 + told) F."""
    dof, numbers, size, middle = HEAVE

    def read(seed, share):
        record = driven(dof, numbers, share * size, middle, lambda x, v: 0.0 * v, seed)
        return record.with_channels(**{channel: gain * record.channels[channel]})

    found = rss.diagnose(model_of(dof, *numbers), [read(1, 0.8), read(2, 1.0)], withhold=[read(9, 0.9)])
    assert found.verdict.status == "ambiguous"
    assert {names for names in found.verdict.indistinguishable} >= {("excitation_gain",), ("sensor_gain",)}
    for choice in found.which[:2]:
        value, deviation = choice.effects[0].parameters["gain"]
        assert abs(value - told) < 3.0 * deviation < 0.06
    assert found.how_far.gap_after < 0.3 * found.how_far.gap_before


@pytest.mark.parametrize("late", [0.02, -0.02])
def test_a_load_cell_that_reads_late_or_early_is_told_with_its_delay(late):
    dof, numbers, size, middle = HEAVE

    def read(seed, share):
        record = driven(dof, numbers, share * size, middle, lambda x, v: 0.0 * v, seed)
        count = round(late / 0.02)
        return rss.Record(TIME[5:-5], {dof: record.channels[dof][5:-5], f"{dof}_force": np.roll(
            record.channels[f"{dof}_force"], count)[5:-5]}, kind="prescribed", name=record.name)

    found = rss.diagnose(model_of(dof, *numbers), [read(1, 0.8), read(2, 1.0)], withhold=[read(9, 0.9)])
    (effect,) = found.which[0].effects
    value, deviation = effect.parameters["delay"]
    assert effect.name in ("excitation_delay", "sensor_delay") and abs(value + late) < max(3.0 * deviation, 0.02 * 0.05)


@pytest.mark.parametrize("drag", [0.0, 60.0])
def test_a_coarse_reading_of_the_motion_is_noise_of_the_force_it_needs(drag):
    """Steps of a fiftieth of the largest motion: through the inertia they are most of what is left."""
    dof, numbers, size, middle = HEAVE

    def coarse(seed, share):
        found = driven(dof, numbers, size * share, middle, lambda x, v: drag * v * np.abs(v), seed)
        x = found.channels[dof] + 0.01 * size * np.random.default_rng(seed).standard_normal(TIME.size)
        return found.with_channels(**{dof: np.round(x / (0.05 * size)) * 0.05 * size})

    found = rss.diagnose(model_of(dof, *numbers), [coarse(1, 0.8), coarse(2, 1.0), coarse(3, 1.2)],
                         withhold=[coarse(9, 0.9)])
    assert [e.name for e in found.verdict.effects] == ["quadratic_drag"] * (drag > 0.0)
    assert found.verdict.status == ("effect" if drag else "no_gap")
    assert found.how_far.gap_after < 1.5 * found.how_far.noise_floor


def test_of_a_body_moved_in_one_way_its_own_force_is_enough():
    rigid = rss.RadiationFit(("Sway", "Roll"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Sway", "Roll"), [[40.0, 0.5], [0.5, 1.0]], np.diag([20.0, 0.3]), np.diag([0.0, 20.0]), rigid)
    x, v, a = (0.1 * w * f(3.0 * TIME) for w, f in ((1.0, np.sin), (3.0, np.cos), (-9.0, np.sin)))
    moment = 1.3 * a + 20.0 * x + 2.0 * np.abs(v) * v + 0.005 * np.random.default_rng(0).standard_normal(TIME.size)
    record = rss.Record(TIME, {"Roll": x, "Roll_force": moment}, kind="prescribed")
    found = rss.diagnose(model, record, effects=["quadratic_drag", "linear_damping", "cubic_stiffness"])
    (effect,) = found.verdict.effects
    assert (effect.name, effect.dof) == ("quadratic_drag", "Roll")
    assert effect.parameters["coefficient"][0] == pytest.approx(2.0, rel=0.03)
    with pytest.raises(rss.InputError, match="Sway_force has 0 samples"):
        rss.diagnose(model, record.with_channels(Sway=0.01 * np.sin(2.0 * TIME)))


def inclined(C, cubic, seed, rows=9):
    """An inclining test: heel at which the moments hold, by bisection; the times of the readings are uneven."""
    rng = np.random.default_rng(seed)
    moments = np.linspace(-120.0, 120.0, rows)
    low, high = np.full(rows, -1.0), np.full(rows, 1.0)
    for _ in range(60):
        middle = (low + high) / 2.0
        less = C * middle + cubic * middle**3 < moments
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    heel = middle + 2e-4 * rng.standard_normal(rows)
    times = np.cumsum(rng.uniform(60.0, 600.0, rows))
    return rss.Record(times, {"Roll": heel, "Roll_force": moments}, kind="static", name=f"inclining {seed}")


SHIP = {"dof": "Roll", "mass": 993.0, "GM": 0.0843, "gyradius": 0.341, "period": 2.545, "damping_ratio": 0.0017}


@pytest.mark.parametrize("share, cubic, told", [(1.0, 0.0, set()), (0.96, 0.0, set()), (1.0, 8e3, {"cubic_stiffness"})])
def test_an_inclining_test_of_nine_weights_tells_what_it_holds(share, cubic, told):
    ship = rss.body(**SHIP)
    for seed in range(2):
        found = rss.diagnose(ship, inclined(share * ship.C[0, 0], cubic, seed))
        assert {effect.name for effect in found.verdict.effects} == told
        assert found.how_far.gap_after < 0.04


@pytest.mark.parametrize("seed", some(range(3)))
def test_a_slow_pull_that_never_rests_shows_no_friction(seed):
    """One swing of the load in fifty natural periods, by lsim: the model's own damping holds back by a visible part."""
    rng, (m, c, k) = np.random.default_rng(seed), (300.0, 120.0, 300.0)
    rigid = rss.RadiationFit(("Surge",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    model = rss.Model(("Surge",), [[m]], [[0.0]], [[k]], rigid, D=[[c]])
    time = np.linspace(0.0, 100.0 * np.pi, 500)
    load = 40.0 * np.sin(2.0 * np.pi * time / time[-1])
    x = lsim(([1.0], [m, c, k]), load, time)[1] + 3e-4 * rng.standard_normal(time.size)
    found = rss.diagnose(model, rss.Record(time, {"Surge": x, "Surge_force": load}, kind="static"))
    assert found.verdict.status == "no_gap" and found.which[0].effects == ()


@pytest.mark.parametrize("seed", some(range(3)))
def test_even_steps_of_load_there_and_back_show_the_friction(seed):
    """Row numbers tell no speed: the model's damping along them, which has the shape of friction, does not act."""
    rng, force, k = np.random.default_rng(seed), 1.5, 40.0
    rigid = rss.RadiationFit(("Surge",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    model = rss.Model(("Surge",), [[60.0]], [[0.0]], [[k]], rigid, D=[[10.0]])
    load = np.r_[0.0:31.0:5.0, 25.0:-31.0:-5.0, -25.0:31.0:5.0, 25.0:-1.0:-5.0]
    held = force * np.r_[rng.choice([-1.0, 1.0]), np.sign(np.diff(load))]  # where the first place was reached from
    x = (load - held) / k + 1e-3 * rng.standard_normal(load.size)
    record = rss.Record(np.arange(load.size), {"Surge": x, "Surge_force": load}, kind="static")
    found = rss.diagnose(model, record)
    (effect,) = found.verdict.effects
    (value, deviation), = [v for name, v in effect.parameters.items() if name == "force"]
    assert effect.name == "coulomb_friction" and abs(value - force) < 2.0 * deviation


@pytest.mark.parametrize("seed", some(range(4)))
@pytest.mark.parametrize("steps", [(0, 1, -1, 2, -2, 3, -3, 4, -4), (0, 1, 2, 3, 4, 0, -1, -2, -3, -4)])
def test_an_inclining_test_to_both_sides_in_any_order_shows_no_gap(steps, seed):
    """Of loads that change sides at every step none lies between its neighbours': these do not show the noise."""
    model = rss.body(dof="Roll", mass=1000.0, GM=0.08, gyradius=0.34, period=2.6, damping_ratio=0.02)
    load = 10.0 * np.array(steps)
    angle = load / model.C[0, 0] + 1e-3 * np.random.default_rng(seed).standard_normal(load.size)
    record = rss.Record(np.arange(load.size), {"Roll": angle, "Roll_force": load}, kind="static")
    assert rss.diagnose(model, record).verdict.status == "no_gap"


def test_a_pull_out_tells_the_stiffness_that_the_model_lacks():
    rng, model = np.random.default_rng(0), rss.body(dof="Surge", mass=2e7, added_mass=1e7)
    x = np.concatenate([np.linspace(0.0, 20.0, 12), np.linspace(20.0, -20.0, 24)])
    pulled = rss.Record(30.0 * np.arange(36.0), {"Surge": x + 0.01 * rng.standard_normal(36), "Surge_force": 8e4 * x},
                        kind="static")
    (effect,) = rss.diagnose(model, pulled).verdict.effects
    assert effect.name == "linear_stiffness" and effect.parameters["stiffness"][0] == pytest.approx(8e4, rel=0.01)


def test_motions_that_the_rig_holds_need_no_force():
    """A rig logs all its axes: those that stand still, all zero, are not predicted."""
    rigid = rss.RadiationFit(("Sway", "Heave"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(rigid.dofs, np.diag([40.0, 40.0]), np.diag([20.0, 30.0]), np.diag([0.0, 2300.0]), rigid)
    w, rng = np.array([3.0, 4.5, 7.0]), np.random.default_rng(0)
    x, v, a = (0.02 * np.sum([w[k]**n * np.cos(w[k] * TIME + k + n * np.pi / 2.0) for k in range(3)], axis=0)
               for n in range(3))
    force = 70.0 * a + 2300.0 * x + 300.0 * np.abs(v) * v
    channels = {"Heave": x, "Heave_force": force + 2e-3 * force.std() * rng.standard_normal(TIME.size)}
    found = rss.diagnose(model, rss.Record(TIME, {**channels, "Sway": 0.0 * TIME}, kind="prescribed"))
    assert [(e.name, e.dof) for e in found.verdict.effects] == [("quadratic_drag", "Heave")]
    with pytest.raises(rss.InputError, match="Sway_force has 0 samples"):
        rss.diagnose(model, rss.Record(TIME, {**channels, "Sway": x}, kind="prescribed"))


def trimmed(k3, noise=2e-3):
    """A floating body with its centre of flotation off the origin, pulled and trimmed: heave follows without a load."""
    rigid = rss.RadiationFit(("Surge", "Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), 0)
    stiff = np.array([[3e4, 0.0, 0.0], [0.0, 1.6e6, 4.7e6], [0.0, 4.7e6, 6.1e7]])
    model = rss.Model(rigid.dofs, np.diag([5e5, 5e5, 3e7]), np.diag([1e5, 6e5, 1e7]), stiff, rigid)
    pull = np.concatenate([np.linspace(0.0, 6e4, 7), -np.linspace(1e4, 6e4, 6)])
    loads = np.stack([pull, 0.0 * pull, 50.0 * pull])
    x = np.linalg.solve(stiff, loads)
    x[0] = [next(r.real for r in np.roots([k3, 0.0, 3e4, -f] if k3 else [3e4, -f]) if abs(r.imag) < 1e-9) for f in pull]
    x += noise * np.abs(x).max(axis=1, keepdims=True) * np.random.default_rng(0).standard_normal(x.shape)
    named = zip(rigid.dofs, x, loads)
    return model, rss.Record(np.arange(13.0), {name: value for dof, y, f in named for name, value in
                                               ((dof, y), (f"{dof}_force", f))}, kind="static", name="trim")


@pytest.mark.parametrize("k3, told", [(0.0, []), (8e3, [("cubic_stiffness", "Surge")])])
def test_a_motion_that_follows_without_a_load_has_its_size_by_the_restoring_force(k3, told):
    found = rss.diagnose(*trimmed(k3))
    assert [(e.name, e.dof) for e in found.verdict.effects] == told
    assert found.how_far.gap_after < 0.01 and (found.how_far.gap_before > 0.1) == bool(told)


def test_a_body_that_is_inclined_heaves_though_no_column_says_so():
    """As `simulate` has it: pitch about a point that is not the centre of flotation is softer than with heave held."""
    model, record = trimmed(0.0)
    seen = rss.Record(record.time, {c: v for c, v in record.channels.items() if not c.startswith("Heave")},
                      kind="static")
    held = seen.channels["Pitch_force"] - model.C[2, 2] * seen.channels["Pitch"]
    assert held.std() > 0.2 * seen.channels["Pitch_force"].std()
    found = rss.diagnose(model, seen)
    assert found.verdict.status == "no_gap" and found.how_far.gap_before < 0.01


@pytest.mark.parametrize("factors, words", [
    ((180.0 / np.pi, 1.0), "Roll in degrees"), ((-1.0, 1.0), "goes against the load"),
    ((1.0, 1e-3), "Roll_force in N m")])
def test_units_and_signs_of_a_static_test_are_checked(factors, words):
    ship = rss.body(**SHIP)
    record = inclined(ship.C[0, 0], 0.0, 0)
    slipped = record.with_channels(**{name: factor * record.channels[name]
                                      for name, factor in zip(("Roll", "Roll_force"), factors)})
    with pytest.raises(rss.InputError, match=words):
        rss.diagnose(ship, slipped)


def test_a_decay_of_a_moored_body_tells_the_spring_that_the_model_lacks():
    model, time = rss.body(dof="Surge", mass=2e7, added_mass=1e7), np.arange(0.0, 1500.0, 1.0)
    omega = np.sqrt(8e4 / 3e7 * (1.0 - 0.03**2))
    rate = 0.03 * np.sqrt(8e4 / 3e7)
    runs = [rss.Record(time, {"Surge": size * np.exp(-rate * time) * (np.cos(omega * time) + rate / omega * np.sin(
        omega * time)) + 0.01 * np.random.default_rng(k).standard_normal(time.size)}, kind="decay", name=f"{size} m")
            for k, size in enumerate((15.0, 5.0, 10.0))]
    found = rss.diagnose(model, runs[:2], ["linear_stiffness", "linear_damping", "quadratic_drag"], withhold=runs[2:])
    told = {effect.name: effect.parameters for effect in found.verdict.effects}
    assert set(told) == {"linear_stiffness", "linear_damping"} and found.how_far.gap_after < 0.02
    assert told["linear_stiffness"]["stiffness"][0] == pytest.approx(8e4, rel=0.05)  # the inertia is known to 2 %


def test_an_inclining_test_beside_a_decay_raises_no_warning_and_tells_the_stiffness():
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.01)
    time, rng, stiffness = np.arange(0.0, 60.0, 0.02), np.random.default_rng(0), float(model.C[0, 0])
    stiffer = [("linear_stiffness", "Roll", {"stiffness": 0.1 * stiffness})]
    moved = rss.simulate(model, (time, np.zeros((1, time.size))), stiffer, start={"Roll": 0.2}).outputs[0]
    decay = rss.Record(time, {"Roll": moved + 1e-4 * rng.normal(size=time.size)}, kind="decay")
    load = np.array([0.0, 5.0, 10.0, 20.0, 30.0, -10.0, -20.0, -30.0])
    angle = load / (1.1 * stiffness) + 1e-4 * rng.normal(size=load.size)
    static = rss.Record(60.0 * np.arange(load.size), {"Roll": angle, "Roll_force": load}, kind="static")
    found = rss.diagnose(model, [decay, static], effects=["linear_stiffness", "added_inertia", "quadratic_drag"],
                         tolerance=0.01)
    assert [effect.name for effect in found.verdict.effects] == ["linear_stiffness"]
    value, std = found.verdict.effects[0].parameters["stiffness"]
    assert abs(value / stiffness - 0.1) < 3.0 * std / stiffness < 0.06


@pytest.mark.filterwarnings("ignore:Heave. with stiffness")  # which also says that these are not SI units
@pytest.mark.parametrize("unit", [1e-3, 1e6])
def test_a_static_test_hides_no_drag_of_a_decay_whatever_the_unit_of_force(unit):
    """The motion is in metres, the static test's error in newtons: neither is to outweigh the other by its unit."""
    mass, stiffness, drag = 2.0, 8.0, 3.0
    model = rss.body(dof="Heave", mass=mass * unit, added_mass=0.0, C=stiffness * unit, damping_ratio=0.01)
    time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(0)
    moved = solve_ivp(lambda t, s: [s[1], -(stiffness * s[0] + 0.08 * s[1] + drag * s[1] * abs(s[1])) / mass],
                      time[[0, -1]], [0.3, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    decay = rss.Record(time, {"Heave": moved + 2e-3 * moved.std() * rng.normal(size=time.size)}, kind="decay")
    load = unit * np.array([0.0, 0.4, 0.8, 1.2, 0.8, 0.4, 0.0, -0.4, -0.8, -1.2, -0.8, -0.4, 0.0])
    raised = load / (stiffness * unit) + 1e-4 * rng.normal(size=load.size)
    static = rss.Record(60.0 * np.arange(load.size), {"Heave": raised, "Heave_force": load}, kind="static")
    found = rss.diagnose(model, [decay, static])
    assert [effect.name for effect in found.verdict.effects] == ["quadratic_drag"]
    value, std = found.verdict.effects[0].parameters["coefficient"]
    assert abs(value / unit - drag) < 3.0 * std / unit < 0.5 * drag


@pytest.mark.parametrize("colour", [0.0, 0.95])
def test_a_pull_in_roll_says_nothing_of_heave_which_it_leaves_at_rest(colour):
    """Six hundred samples of nothing but noise: a model that were multiplied by zero in heave would explain them."""
    rigid = rss.RadiationFit(("Heave", "Roll"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Heave", "Roll"), np.diag([2.0, 1.0]), np.zeros((2, 2)), np.diag([8.0, 20.0]), rigid,
                      D=np.diag([0.08, 0.2]))
    time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(0)

    def moved(x, m, c, d, k):
        return solve_ivp(lambda t, s: [s[1], -(c * s[0] + (d + k * abs(s[1])) * s[1]) / m], time[[0, -1]], [x, 0.0],
                         t_eval=time, rtol=1e-9, atol=1e-12).y[0]

    def decay(heave, roll, name):
        motion = {"Heave": moved(heave, 2.0, 8.0, 0.08, 3.0), "Roll": moved(roll, 1.0, 20.0, 0.2, 0.0)}
        return rss.Record(time, {dof: x + 2e-3 * x.std() * rng.normal(size=time.size) for dof, x in motion.items()},
                          kind="decay", name=name)

    pull = np.sin(np.linspace(0.0, 6.0, 600))
    noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], rng.normal(size=600))
    static = rss.Record(np.arange(600.0), {"Heave": 2e-4 * noise, "Heave_force": np.zeros(600),
                                           "Roll": pull / 20.0 + 1e-4 * rng.normal(size=600), "Roll_force": pull},
                        kind="static")
    considered = ["quadratic_drag", "linear_damping", "linear_stiffness", "added_inertia", "sensor_gain",
                  "excitation_gain", "sensor_bias"]
    found = rss.diagnose(model, [decay(0.3, 0.1, "1"), static], considered, withhold=decay(0.2, 0.05, "2"))
    assert [(e.name, e.dof) for e in found.verdict.effects] == [("quadratic_drag", "Heave")]
    assert all(abs(number.value) < 3.0 * number.tolerance for number in found.recalibrated)


def test_noise_of_a_withheld_sweep_is_its_own():
    """It goes higher than those of the fit, so the motion's noise makes more force of it: no gap is left by that."""
    dof, numbers, size, middle = HEAVE
    seen = [driven(dof, numbers, size * share, middle, lambda x, v: 0.0 * v, seed)
            for seed, share in ((1, 0.8), (2, 1.0))]
    found = rss.diagnose(model_of(dof, *numbers), seen,
                         withhold=[driven(dof, numbers, size, 2.0 * middle, lambda x, v: 0.0 * v, 9)])
    lower = rss.diagnose(model_of(dof, *numbers), seen,
                         withhold=[driven(dof, numbers, size, middle, lambda x, v: 0.0 * v, 9)])
    assert found.verdict.status == lower.verdict.status == "no_gap"
    assert found.how_far.gap_after < 1.3 * found.how_far.noise_floor


def test_a_static_test_without_its_force_is_refused():
    x = 0.02 * np.random.default_rng(0).standard_normal(12)
    record = rss.Record(np.arange(12.0), {"Heave": x}, kind="static", name="pull")
    with pytest.raises(rss.InputError, match="pull: a static test needs the steady force"):
        rss.diagnose(model_of(*HEAVE[:1], *HEAVE[1]), record)


def test_a_second_sensor_tells_the_gain_of_the_first_from_the_load_cells():
    dof, numbers, size, middle = HEAVE

    def read(seed, share):
        record = driven(dof, numbers, share * size, middle, lambda x, v: 0.0 * v, seed)
        x = record.channels[dof]
        v = savgol_filter(x, 41, 5, deriv=1, delta=TIME[1])
        v += 0.02 * v.std() * np.random.default_rng(seed).standard_normal(TIME.size)
        return record.with_channels(**{dof: 1.15 * x, f"{dof}_velocity": v})

    found = rss.diagnose(model_of(dof, *numbers), [read(1, 0.8), read(2, 1.0)], withhold=[read(9, 0.9)])
    assert "excitation_gain" not in {e.name for e in found.which[0].effects}


def heeled(count, most, constant, seed):
    """An inclining test: heel under loads of both sides, and a constant moment that is not recorded."""
    load = np.linspace(-most, most, count)
    heel = (load + constant) / 821.2 + np.deg2rad(0.02) * np.random.default_rng(seed).normal(size=count)
    return rss.Record(np.arange(float(count)), {"Roll": heel, "Roll_force": load}, kind="static", name="inclining")


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_an_inclining_test_of_few_places_is_checked_by_what_was_fitted_and_says_so(count):
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, added_mass=19.0, damping_ratio=0.005)
    found = rss.diagnose(model, heeled(count, 60.0, 0.0, count))
    assert found.verdict.status == "no_gap"
    assert any("too few places for a part that no fit sees" in text for text in found.notes)


def test_where_a_constant_is_what_is_left_the_sentence_says_so():
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, added_mass=19.0, damping_ratio=0.005)
    found = rss.diagnose(model, heeled(9, 180.0, 8.0, 0))
    assert "a constant, 5." in found.sentence or {"sensor_bias", "constant_force"} & {
        name for names in found.verdict.indistinguishable for name in names}
    assert "constant" not in rss.diagnose(model, heeled(9, 180.0, 0.0, 0)).sentence


def test_a_constant_that_is_left_does_not_count_as_closed():
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, added_mass=19.0, damping_ratio=0.005)
    how = rss.diagnose(model, heeled(9, 180.0, 8.0, 0), absent=["sensor_bias", "constant_force"]).how_far
    left = (how.gap_after**2 - how.noise_floor**2) / (how.gap_before**2 - how.noise_floor**2)
    assert how.shrinkage == pytest.approx(1.0 - left, abs=1e-9)
    assert left > 0.5


@pytest.mark.parametrize("kind", ["static", "prescribed"])
@pytest.mark.parametrize("times", [0.6, 1.4])
def test_the_gain_of_one_of_two_coupled_motions_is_what_its_sensor_reads_more(kind, times):
    """Forces by the two equations of motion, harmonic by harmonic; Heave is read `times` its motion."""
    rigid = rss.RadiationFit(("Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    M, A, C = np.array([[40.0, 1.5], [1.5, 9.0]]), np.diag([20.0, 3.0]), np.array([[300.0, 20.0], [20.0, 90.0]])
    model, rng = rss.Model(("Heave", "Pitch"), M, A, C, rigid), np.random.default_rng(4)
    if kind == "static":
        time, F = np.arange(15.0), rng.uniform(-60.0, 60.0, (2, 15))
        x = np.linalg.solve(C, F)
    else:
        time, x, F = TIME, np.zeros((2, TIME.size)), np.zeros((2, TIME.size))
        for w in (2.1, 3.3, 4.6, 6.2, 7.9):
            one = np.array([0.02, 0.05])[:, None] * np.sin(w * TIME + rng.uniform(0.0, 6.28, (2, 1)))
            x, F = x + one, F + (C - w**2 * (M + A)) @ one
    F = F + 1e-3 * F.std() * rng.standard_normal(F.shape)
    read = x * [[times], [1.0]] + 3e-4 * x.std() * rng.standard_normal(x.shape)
    record = rss.Record(time, {"Heave": read[0], "Pitch": read[1], "Heave_force": F[0], "Pitch_force": F[1]}, kind=kind)
    (effect,) = rss.diagnose(model, record, effects=["sensor_gain"]).verdict.effects
    value, deviation = effect.parameters["gain"]
    assert effect.dof == "Heave" and abs(value - (times - 1.0)) < max(2.0 * deviation, 0.01) < 0.07


@pytest.mark.parametrize("test", [HEAVE, SWAY, ROLL])
@pytest.mark.parametrize("unit, newton", [("kgf", 9.80665), ("lbf", 4.4482216)])
def test_no_name_is_sure_where_a_unit_of_the_force_explains_as_much(test, unit, newton):
    dof, numbers, size, middle = test

    def read(seed, share):
        record = driven(dof, numbers, share * size, middle, lambda x, v: 0.0 * v, seed)
        return record.with_channels(**{f"{dof}_force": record.channels[f"{dof}_force"] / newton})

    found = rss.diagnose(model_of(dof, *numbers), [read(1, 0.8), read(2, 1.0)], withhold=[read(9, 0.9)])
    assert found.verdict.status in ("ambiguous", "unknown_effect") and not found.verdict.effects
    assert found.misreadings and unit in found.sentence.split("As the columns are read")[0]
    assert found.sentence.startswith("First check record")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("test", [HEAVE, SWAY, ROLL])
@pytest.mark.parametrize("times", [1e-3, 1e3])
def test_a_force_a_thousand_times_off_is_refused_in_every_driven_motion(test, times, seed):
    dof, numbers, size, middle = test
    model, record = model_of(dof, *numbers), driven(dof, numbers, size, middle, lambda x, v: 0.0 * v, seed)
    check_units(model, [record])
    with pytest.raises(rss.InputError, match=f"column {dof}_force or {dof}, .*check the units"):
        check_units(model, [record.with_channels(**{f"{dof}_force": times * record.channels[f"{dof}_force"]})])


@pytest.mark.parametrize("seed", range(3))
def test_a_moored_sway_moved_slowly_needs_what_its_lines_take_and_passes(seed):
    """Springs of the rig that the model lacks take 200 times the inertia's force, against it."""
    numbers, omega = SWAY[1], 0.4
    x = 0.1 * np.cos(omega * TIME + seed)
    force = (200.0 * 60.0 * omega**2) * x + 0.5 * np.random.default_rng(seed).standard_normal(TIME.size)
    record = rss.Record(TIME, {"Sway": x, "Sway_force": force}, kind="prescribed")
    assert check_units(model_of("Sway", *numbers), [record]) is None
