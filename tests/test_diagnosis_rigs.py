"""Statics, tows and moored bodies made here by closed forms and SciPy: what a diagnosis says of them."""

import numpy as np
import pytest
from plant_bodies import tank_model
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import StateSpace, lfilter, lsim
from seeds import some

import radiation_ss as rss
from radiation_ss.effects import Line, catenary, effect_named, named
from radiation_ss.simulation import check_units, drifting

PATH = np.repeat(np.concatenate([np.linspace(0, 1, 6), np.linspace(0.8, -1, 10), np.linspace(-0.8, 1, 10)]), 10)


def static(rng, friction, stiffness, name, size=0.05):
    """Steps of position held until at rest; dry friction keeps the way that the body came."""
    step = np.sign(np.diff(PATH, prepend=0.0))
    way = step[np.maximum.accumulate(np.where(step != 0.0, np.arange(PATH.size), 0))]
    x = size * PATH
    force = stiffness * x + friction * way
    return rss.Record(2.0 * np.arange(PATH.size), {"Heave": x + 2e-4 * size * rng.standard_normal(PATH.size),
                                                   "Heave_force": force + 0.02 * rng.standard_normal(PATH.size)},
                      kind="static", name=name)


@pytest.mark.parametrize("friction, stiffness, names", [(0.0, 201.0, set()), (1.0, 201.0, {"coulomb_friction"}),
                                                       (0.0, 230.0, {"linear_stiffness"})])
def test_statics_show_friction_by_the_way_the_body_came_and_stiffness(friction, stiffness, names):
    rng = np.random.default_rng(1)
    model = rss.body(dof="Heave", mass=5.0, added_mass=0.0, C=200.0)
    found = rss.diagnose(model, [static(rng, friction, stiffness, k) for k in "ab"],
                         withhold=[static(rng, friction, stiffness, "c", 0.04)],
                         absent=["sensor_gain", "excitation_gain"])  # no static test tells a stiffness from them
    assert {e.name for e in found.verdict.effects} == names
    if friction:
        value, deviation = found.verdict.effects[0].parameters["force"]
        assert abs(value - friction) < 3.0 * deviation and deviation < 0.2
    assert found.how_far.gap_after < 0.02


def towed(speed, lift):
    time = np.arange(0.0, 25.0, 0.04)
    inertia, C = 10.0, 100.0

    def rate(t, s):
        return s[1], -(C * s[0] + (0.8 + lift * speed) * s[1]) / inertia

    roll = solve_ivp(rate, time[[0, -1]], (0.15, 0.0), t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    noise = np.random.default_rng(int(10 * speed)).standard_normal(time.size)
    return rss.Record(time, {"Roll": roll + 3e-4 * noise}, kind="decay", name=f"{speed} m/s", speed=speed)


def test_damping_that_grows_with_speed_is_lift():
    model = rss.Model(("Roll",), [[10.0]], [[0.0]], [[100.0]], rss.RadiationFit(
        ("Roll",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0), [[0.8]])
    found = rss.diagnose(model, [towed(speed, 2.0) for speed in (0.0, 0.5, 1.0)], withhold=[towed(0.75, 2.0)])
    assert [e.name for e in found.verdict.effects] == ["lift_damping"]
    value, deviation = found.verdict.effects[0].parameters["coefficient"]
    assert abs(value - 2.0) < 3.0 * deviation and deviation < 0.3
    assert found.how_far.gap_after < 0.02


def test_lines_pull_down_the_slope_of_their_energy():
    effect, dofs = effect_named("mooring_lines"), ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
    rng = np.random.default_rng(0)
    numbers = rng.standard_normal(len(effect.parameters))
    p, at = named(effect, list(numbers)), rng.standard_normal(6)

    def energy(x):
        of = dict(zip(dofs, x))
        terms = [np.prod([of[m] for m in name.split("_")]) for name in effect.parameters]
        half = [0.5 if len(set(name.split("_"))) == 1 and name.count("_") == 1 else 1.0 for name in effect.parameters]
        return float(np.sum(numbers * half * terms))

    class Motion:
        def __init__(self, dof, x):
            self.dof, self.x = dof, x

    signals = [Motion(dof, x) for dof, x in zip(dofs, at)]
    signals[0].all = signals
    force = effect.force(signals[0], p)
    for i in range(6):
        step = 1e-5 * np.eye(6)[i]
        assert force[i] == pytest.approx(-(energy(at + step) - energy(at - step)) / 2e-5, rel=1e-6, abs=1e-7)


def test_a_column_of_noise_is_no_wrong_unit():
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 30.0, 0.03)
    motion = {"Heave": 1e-4 * rng.standard_normal(time.size),
              "Heave_acceleration": 2e-3 * rng.standard_normal(time.size),
              "Roll": 0.1 * np.exp(-0.05 * time) * np.cos(3.0 * time)}
    record = rss.Record(time, motion, kind="decay", name="roll")
    model = rss.body(dof=["Heave", "Roll"], mass=40.0, C={"Heave": 2400.0, "Roll": 90.0}, gyradius=0.447,
                     added_mass={"Heave": 20.0, "Roll": 2.0}, damping_ratio={"Heave": 0.05, "Roll": 0.05})
    check_units(model, [record])
    # Coloured noise of two sensors at rest, one a hundred times what the other's slope would be.
    slow = lfilter([1.0], [1.0, -0.95], rng.standard_normal((2, time.size)))
    still = {**motion, "Heave": 1e-3 * slow[0], "Heave_acceleration": 1e-4 * slow[1]}
    check_units(model, [rss.Record(time, still, kind="decay", name="roll")])
    heave = 0.1 * np.exp(-0.2 * time) * np.cos(6.0 * time)
    moving = rss.Record(time, {**motion, "Heave": heave, "Heave_velocity": 100.0 * np.gradient(heave, time)}, "decay")
    with pytest.raises(rss.InputError, match="Heave_velocity"):
        check_units(model, [moving])


@pytest.mark.parametrize("speed, restored, told", [(0.02, 0.0, True), (0.0, 0.0, False), (0.02, 50.0, False)])
def test_a_free_body_that_waves_carry_along_is_said_to_drift(speed, restored, told):
    time = np.arange(0.0, 30.0, 0.05)
    channels = {"Sway": 0.02 * np.sin(5.0 * time) + speed * time, "wave_elevation": 0.02 * np.cos(5.0 * time)}
    model = rss.body(dof="Sway", mass=10.0, added_mass=4.0, C=restored)
    said = drifting(model, rss.Record(time, channels, kind="waves", name="sea"))
    assert bool(said) is told
    for sentence in said:
        assert abs(float(sentence.split("drifts by ")[1].split()[0]) - 0.6) < 0.01


@pytest.mark.parametrize("rounding", [0.0, 1e-14, -1e-14])
def test_rounding_of_a_stiffness_that_is_zero_is_no_stiffness(rounding):
    """Panel programs write 1e-14 N/m for a submerged body: no natural period follows from that."""
    time = np.arange(0.0, 60.0, 0.05)
    model = rss.Model(("float__Heave", "ball__Heave"), np.diag([5.0, 4.0]), np.zeros((2, 2)),
                      np.diag([200.0, rounding]), rss.RadiationFit(("float__Heave", "ball__Heave"), np.zeros((0, 0)),
                                                                  np.zeros((0, 2)), np.zeros((2, 0)), 0))
    assert "ball__Heave  M 4, A_inf 0 kg, C 0 N/m; no oscillation" in str(model)

    def waves(seed):
        rng = np.random.default_rng(seed)
        omega, phase = rng.uniform(2.0, 8.0, 12), rng.uniform(0.0, 6.0, (2, 12))
        size = np.array([[1.0], [0.4]])

        def push(t):
            return (size * np.cos(omega * t + phase)).sum(axis=1)

        def rate(t, s):
            take_off = 25.0 * (s[0] - s[1]) + 4.0 * (s[2] - s[3])
            return *s[2:], *((push(t) - [200.0 * s[0] + take_off, -take_off]) / [5.0, 4.0])

        motion = solve_ivp(rate, time[[0, -1]], np.zeros(4), t_eval=time, rtol=1e-8, atol=1e-10).y[:2]
        noisy = motion + 2e-3 * motion.std() * rng.standard_normal(motion.shape)
        forces = np.array([push(t) for t in time]).T
        return rss.Record(time, dict(zip(model.dofs, noisy))
                          | {f"{dof}_force": f for dof, f in zip(model.dofs, forces)}, kind="forced", name=str(seed))

    found = rss.diagnose(model, waves(0), withhold=waves(1), effects=["relative_damping", "relative_stiffness"])
    assert {e.name for e in found.verdict.effects} == {"relative_damping", "relative_stiffness"}
    assert found.how_far.gap_after < 0.02


def test_a_catenary_of_the_users_own_lines_is_an_effect_to_consider():
    """An effect that is in no library, given as it is: two lines whose pull is weighed by its closed form here."""
    from scipy.optimize import brentq

    length, weight, depth, distance = 60.0, 20.0, 10.0, 57.0

    def pull_of(apart):
        """Horizontal tension of an inextensible line of which a part lies on the bed."""
        return brentq(lambda H: length - np.sqrt(depth * (depth + 2 * H / weight))
                      + H / weight * np.arccosh(1 + weight * depth / H) - apart, 1.0, 1e6)

    places = np.linspace(distance - 1.5, distance + 1.5, 601)
    pull = CubicSpline(places, [pull_of(apart) for apart in places])
    time, rng = np.arange(0.0, 120.0, 0.1), np.random.default_rng(0)

    def decay(start, name):
        def rate(t, s):
            return s[1], (pull(distance - s[0]) - pull(distance + s[0]) - 8.0 * s[1]) / 400.0
        surge = solve_ivp(rate, time[[0, -1]], (start, 0.0), t_eval=time, rtol=1e-8).y[0]
        return rss.Record(time, {"Surge": surge + 1e-3 * rng.standard_normal(time.size)}, kind="decay", name=name)

    lines = catenary([Line(length, weight, depth, distance, heading) for heading in (0.0, np.pi)])
    model = rss.body(dof="Surge", mass=400.0, added_mass=0.0).attached(damping={"Surge": 8.0})
    found = rss.diagnose(model, decay(1.2, "a"), withhold=decay(0.9, "b"), effects=[lines, "quadratic_drag"])
    assert [e.name for e in found.verdict.effects] == ["catenary"]
    value, deviation = found.verdict.effects[0].parameters["share"]
    assert abs(value - 1.0) < max(3.0 * deviation, 0.01) and found.how_far.gap_after < 0.02
    assert "catenary (share" in str(found) and " 1)" not in str(found)
    with pytest.raises(rss.InputError, match="absent and present"):
        rss.diagnose(model, decay(1.2, "a"), effects=[lines], absent="catenary", present="catenary")


def test_waves_in_which_a_motion_was_not_read_tell_nothing_of_it():
    """Surge let go in still water, heave read in waves: no effect of waves on surge has a size."""
    rng, model = np.random.default_rng(3), rss.body(
        dof=("Surge", "Heave"), mass=5.0, added_mass={"Surge": 2.0, "Heave": 2.0}, C={"Surge": 20.0, "Heave": 200.0},
        damping_ratio={"Surge": 0.05, "Heave": 0.05})
    time = 0.05 * np.arange(1200)
    frequency = np.sqrt(20.0 / 7.0)
    surge = 0.1 * np.exp(-0.05 * frequency * time) * np.cos(np.sqrt(1.0 - 0.05**2) * frequency * time)
    let_go = rss.Record(time, {"Surge": surge + 2e-4 * rng.standard_normal(time.size)}, kind="decay", name="let go")
    line = np.exp(4j * time)
    heave = 2.0 * line / (200.0 - 7.0 * 16.0 + 4j * 2.0 * 0.05 * np.sqrt(200.0 * 7.0))
    read = heave.real + 2e-5 * rng.standard_normal(time.size)
    waves = rss.Record(time, {"Heave": read, "Heave_force": 2.0 * line.real, "Surge_force": 0.0 * time,
                              "wave_elevation": 0.01 * line.real}, kind="waves", name="waves")
    assert rss.diagnose(model, [let_go, waves]).verdict.status == "no_gap"


@pytest.mark.parametrize("cut", [0.0, 0.25])
def test_friction_that_gives_before_it_slips_is_told_of_records_that_begin_under_way(cut):
    """Wen's law by SciPy; two of the records do not slip, and one begins while the friction holds a part."""
    model, rng, m = tank_model(), np.random.default_rng(2), 3
    inertia, C = float((model.M + model.A_inf)[0, 0]), float(model.C[0, 0])
    force, reach = 0.3 * C * 0.01, 0.01

    def rate(t, s):
        x, v, z = s[m:]
        pull = model.fit.c[0] @ s[:m] + model.D[0, 0] * v + C * x + force * z
        turn = v / reach * (1.0 - (0.5 + 0.5 * np.sign(v * z)) * abs(z) ** 2)
        return [*(model.fit.a @ s[:m] + model.fit.b[:, 0] * v), v, -pull / inertia, turn]

    records = []
    for k, size in enumerate((0.004, 0.008, 0.03)):
        time, late = np.arange(0.0, 12.0, 0.03), cut * (k == 0)
        path = solve_ivp(rate, (0.0, 14.0), [0.0] * m + [size, 0.0, 0.0], t_eval=time + late, rtol=1e-8, atol=1e-10)
        x = path.y[m] + 2e-5 * rng.standard_normal(time.size)
        records.append(rss.Record(time, {"Heave": x}, kind="decay", name=f"{k}"))
    found = rss.diagnose(model, records, effects=["hysteresis", "linear_stiffness", "constant_force", "quadratic_drag"])
    (effect,) = found.verdict.effects
    assert effect.name == "hysteresis"
    for name, value in (("force", force), ("reach", reach)):
        mean, deviation = effect.parameters[name]
        assert abs(mean - value) < 3.0 * deviation + 0.05 * value


def test_a_gap_shorter_than_two_slow_periods_keeps_what_the_fast_motion_tells():
    """Surge swings in 30 s and heave in 2 s; a record of 20 s has a gap in heave."""
    fit = rss.RadiationFit(("Surge", "Heave"), -np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), 1)
    model = rss.Model(("Surge", "Heave"), np.diag([100.0, 100.0]), np.zeros((2, 2)), np.diag([4.4, 987.0]), fit,
                      D=np.diag([4.0, 40.0]))
    rng = np.random.default_rng(0)

    def decay(length, size, lost):
        time = np.arange(0.0, length, 0.05)
        x = [solve_ivp(lambda t, s, c, d, k: [s[1], -(c * s[0] + d * s[1] + k * s[1] * abs(s[1])) / 100.0],
                       (0.0, length), [a, 0.0], t_eval=time, rtol=1e-8, args=of).y[0]
             for a, *of in zip(size, (4.4, 987.0), (4.0, 40.0), (0.0, 150.0))]
        x = [row + 1e-3 * max(size) * rng.standard_normal(time.size) for row in x]
        x[1][(time > lost) & (time < lost + 1.5)] = np.nan
        return rss.Record(time, {"Surge": x[0], "Heave": x[1]}, kind="decay")

    found = rss.diagnose(model, [decay(120.0, (0.5, 0.1), 500.0), decay(20.0, (0.02, 0.3), 9.0)],
                         effects=["quadratic_drag", "linear_damping"])
    assert [(e.name, e.dof) for e in found.verdict.effects] == [("quadratic_drag", "Heave")]


@pytest.mark.parametrize("kind", ["forced", "static"])
@pytest.mark.parametrize("constant", [0.5, -1.0, 2.0])
def test_a_constant_force_is_corrected_by_what_the_sentence_says(kind, constant):
    """A moored surge by lsim under known forces and a constant that the model lacks: in metres constant / C."""
    rng, (m, c, k) = np.random.default_rng(0), (80.0, 4.0, 8.0)
    model = rss.body(dof="Surge", mass=60.0, added_mass=20.0, C=k).attached(damping={"Surge": c})
    if kind == "static":
        time, force = np.arange(9.0), np.linspace(-4.0, 4.0, 9)
        x = (force + constant) / k
    else:
        time = np.arange(0.0, 60.0, 0.02)
        omega, phase = rng.uniform(1.0, 6.0, 15), rng.uniform(0.0, 6.28, 15)
        force = 8.0 * np.cos(np.multiply.outer(time, omega) + phase).sum(axis=-1)
        x = lsim(([1.0], [m, c, k]), force + constant, time)[1]
    record = rss.Record(time, {"Surge": x + 2e-4 * rng.standard_normal(time.size), "Surge_force": force}, kind=kind)
    found = rss.diagnose(model, record)
    left = rss.simulate(model, record, found.corrected).outputs[0] - x
    assert found.verdict.indistinguishable[0] == ("constant_force",)
    assert set(found.verdict.indistinguishable) == {("constant_force",), ("sensor_bias",)}
    assert np.sqrt(np.mean(left**2)) < 0.04 * abs(constant) / k  # a record's own zero, by its prior, takes .03 of it
    assert found.how_far.gap_after < 0.04 * found.how_far.gap_before
    assert found.budget.closed_by("constant_force", "Surge") == pytest.approx(found.how_far.gap_before, rel=0.02)
    assert "with the first" in found.sentence
    alone = rss.diagnose(model, record, effects=["linear_stiffness"])
    assert "none of them being corrected" in alone.sentence and not alone.corrected.effects


@pytest.mark.parametrize(("load", "drag"), [(0.0, 0.0), (0.1, 0.0), (2.0, 0.0), (0.5, 20.0)])
def test_a_steady_load_that_carries_a_free_body_away_is_told_with_its_size(load, drag):
    """By SciPy's integrator. It was a tolerance of the force's zero, and no gap, with metres of drift."""
    time, rng = np.arange(0.0, 40.0, 0.02), np.random.default_rng(1)
    omega, phase = rng.uniform(1.0, 6.0, 15), rng.uniform(0.0, 6.28, 15)

    def force(t):
        return 8.0 * np.cos(np.multiply.outer(t, omega) + phase).sum(axis=-1)

    x = solve_ivp(lambda t, s: [s[1], (force(t) - 4.0 * s[1] - drag * s[1] * abs(s[1]) + load) / 80.0], time[[0, -1]],
                  [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-11, max_step=0.05).y[0]
    record = rss.Record(time, {"Surge": x + 2e-4 * rng.standard_normal(time.size), "Surge_force": force(time)},
                        kind="forced")
    model = rss.body(dof="Surge", mass=60.0, added_mass=20.0).attached(damping={"Surge": 4.0})
    found = rss.diagnose(model, record)
    assert (found.verdict.status == "no_gap") == (load == 0.0)
    assert [e.name for e in found.verdict.effects] == ["quadratic_drag"] * (drag > 0.0)
    sizes = {e.name: e.values for e in found.corrected.effects}
    assert sorted(sizes) == ["constant_force"] * (load > 0.0) + ["quadratic_drag"] * (drag > 0.0)
    if load:
        assert sizes["constant_force"]["force"] == pytest.approx(load, rel=0.05)
        assert found.how_far.gap_after < 0.05 * found.how_far.gap_before


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_taut_line_stiffer_than_the_water_is_found_in_its_own_shape(seed):
    """A line of 2.8 C that falls slack: from the starts of its shape alone six smooth effects look likelier."""
    rng, time, records = np.random.default_rng(seed), 0.05 * np.arange(600), []
    model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=50.0, damping_ratio=0.02)

    def moved(force, start):
        found = solve_ivp(lambda t, z: [z[1], 0.5 * (force(t) - 140.0 * max(z[0] + 0.025, 0.0) + 3.5 - 50.0 * z[0]
                                                     - 0.4 * z[1])], (0.0, time[-1]), [start, 0.0], t_eval=time,
                          max_step=0.005, rtol=1e-8, atol=1e-10).y[0]
        return found + 0.003 * found.std() * rng.standard_normal(time.size)

    for start in (0.1, -0.14):
        records.append(rss.Record(time, {"Heave": moved(lambda t: 0.0, start)}, kind="decay", name=f"from {start} m"))
    omega, (a, b) = rng.uniform(3.0, 12.0, 40), 0.35 * rng.normal(size=(2, 40))
    force = CubicSpline(fine := np.arange(0.0, 30.1, 0.01), np.cos(np.outer(fine, omega)) @ a
                        + np.sin(np.outer(fine, omega)) @ b)
    records.append(rss.Record(time, {"Heave": moved(force, 0.0), "Heave_force": force(time)}, kind="forced"))
    line, = rss.diagnose(model, records).verdict.effects
    assert line.name == "slack_mooring" and line.parameters["stiffness"][0] == pytest.approx(140.0, rel=0.05)


def carrying_a_tank(rng, mass=8.0, natural=0.8, ratio=0.03):
    """Return a moored body, whose inertia holds a tank's, and records in waves far above the tank's frequency.

    Body and tank are two masses, solved together; the records begin when both have been under way for 200 s.
    """
    M, A, C, D, time = 50.0, 10.0, 38.0, 2.0, np.arange(0.0, 280.0, 0.05)
    rigid = rss.RadiationFit(("Surge",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    model = rss.Model(("Surge",), [[M]], [[A]], [[C]], rigid, D=[[D]])
    inverse = np.linalg.inv([[M + A, mass], [mass, mass]])
    K, B = np.diag([C, mass * natural**2]), np.diag([D, 2.0 * ratio * natural * mass])
    both = StateSpace(np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ B]]),
                      np.vstack([np.zeros((2, 1)), inverse[:, :1]]), np.eye(4), np.zeros((4, 1)))
    records = []
    for k in range(3):
        waves, slow = np.linspace(3.0, 9.0, 300) + rng.uniform(0.0, 0.02, 300), np.linspace(0.3, 1.5, 60)
        force = 0.5 * np.cos(np.outer(time, waves) + rng.uniform(0.0, 6.3, 300)) @ np.exp(-((waves - 5.5) / 1.5) ** 2)
        force += 0.003 * np.cos(np.outer(time, slow) + rng.uniform(0.0, 6.3, 60)).sum(axis=1)
        x = lsim(both, force, time)[1][time >= 200.0, 0]
        records.append(rss.Record(time[time >= 200.0] - 200.0, {
            "Surge": x + 0.005 * x.std() * rng.standard_normal(x.size), "Surge_force": force[time >= 200.0]},
            name=f"waves_{k}"))
    return model, records


@pytest.mark.parametrize("seed", some(range(3)))
def test_a_tank_that_rings_below_the_waves_is_no_missing_mass(seed):
    model, records = carrying_a_tank(np.random.default_rng(seed))
    effects = ["tank_resonance", "added_inertia", "linear_stiffness", "linear_damping"]
    found = rss.diagnose(model, records[:2], withhold=records[2:], effects=effects)
    (tank,) = found.verdict.effects
    assert tank.name == "tank_resonance"
    for name, true in (("coupling", 8.0), ("frequency", 0.8), ("damping_ratio", 0.03), ("rigid", 1.0)):
        value, std = tank.parameters[name]
        assert abs(value - true) < 4.0 * std  # of twelve numbers the farthest
