"""Records as instruments give them: begun under way, by one wrong clock, with one wrong zero; truths by SciPy."""

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import cont2discrete, dlsim
from seeds import some

import radiation_ss as rss

FIT = rss.RadiationFit(("Heave",), np.array([[0.0, 1.0], [-9.0, -3.0]]), np.array([[0.0], [1.0]]),
                       np.array([[0.0, 4.0]]), 2)
MODEL = rss.Model(("Heave",), [[2.0]], [[1.0]], [[8.0]], FIT)
F = np.array([[0.0, 1.0, 0.0, 0.0], [-8.0 / 3.0, 0.0, 0.0, -4.0 / 3.0], [0.0, 0.0, 0.0, 1.0], [0.0, 1.0, -9.0, -3.0]])
G = np.array([[0.0], [1.0 / 3.0], [0.0], [0.0]])  # states: displacement, velocity, two of the radiation


def decay(size, begin, seed, dt=0.1, count=400):
    """A release from rest at 0; the record's first sample is at `begin` [s]."""
    step, state = expm(F * dt), expm(F * begin) @ np.array([size, 0.0, 0.0, 0.0])
    motion = np.empty(count)
    for k in range(count):
        motion[k], state = state[0], step @ state
    noise = 0.002 * motion.std() * np.random.default_rng(seed).normal(size=count)
    return rss.Record(dt * np.arange(count), {"Heave": motion + noise}, kind="decay", name=f"decay {seed}")


@pytest.mark.parametrize("begin", [0.0, 0.7, 1.5, 2.9])
def test_a_decay_that_is_recorded_from_later_on_is_no_gap(begin):
    """The period is 3.5 s; what the body did before its record still acts on it, and is no cause."""
    found = rss.diagnose(MODEL, [decay(0.3, begin, 0), decay(-0.2, begin, 1)], withhold=decay(0.25, begin, 2))
    assert found.verdict.status == "no_gap"


def driven(seed, low, high, dt=0.1, count=1500):
    """Time, an irregular force, displacement and velocity from rest; the force has circular frequencies low to high."""
    rng = np.random.default_rng(seed)
    time, omega = dt * np.arange(count), rng.uniform(low, high, 40)
    force = 8.0 * rng.uniform(0.2, 1.0, 40) @ np.cos(np.outer(omega, time) + rng.uniform(0, 6.28, (40, 1)))
    force *= np.clip(time / 10.0, 0.0, 1.0)
    moved = dlsim(cont2discrete((F, G, np.eye(4), np.zeros((4, 1))), dt, method="foh"), force[:, None])[1]
    return time, force, moved[:, 0], moved[:, 1], rng


def test_one_clock_that_drifts_is_named_by_displacement_and_velocity():
    rate, records = 1.5e-3, []
    for seed in range(3):
        time, force, *motion, rng = driven(seed, 0.8, 4.0)
        even = time[:-20]  # the sensors' clock says t at (1 + rate) t
        x, v = (CubicSpline(time, y)(even * (1.0 + rate)) for y in motion)
        records.append(rss.Record(even, {
            "Heave": x + 2e-3 * x.std() * rng.normal(size=even.size),
            "Heave_velocity": v + 2e-3 * v.std() * rng.normal(size=even.size),
            "Heave_force": force[:-20]}, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(MODEL, records[:2], withhold=records[2])
    assert [effect.name for effect in found.verdict.effects] == ["clock_drift"]
    value, std = found.verdict.effects[0].parameters["rate"]
    assert abs(value - rate) < 3.0 * std < rate


def test_a_zero_that_all_records_share_is_told_where_the_force_is_far_larger_than_what_restores():
    """Waves of three to seven times the natural frequency: a zero of half the motion is 2 % of the force."""
    records = []
    for seed in range(5):
        time, force, x, _, rng = driven(seed, 5.0, 12.0, count=600)
        read = x + 0.05 + 2e-3 * x.std() * rng.normal(size=x.size)
        assert 0.25 < 0.05 / x.std() < 0.5 and 8.0 * 0.05 < 0.03 * force.std()
        records.append(rss.Record(time, {"Heave": read, "Heave_force": force}, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(MODEL, records[:4], ["sensor_bias", "constant_force", "quadratic_drag"], withhold=records[4])
    assert set(found.verdict.indistinguishable) == {("sensor_bias",), ("constant_force",)}
    assert found.how_far.gap_after < 0.1 < 0.3 < found.how_far.gap_before


@pytest.mark.parametrize("late", [0.1, 1.2])
def test_a_delay_is_told_however_large_it_is(late):
    """The period is 3.5 s: of 1.2 s the slope at none tells as little as that of a cosine a third of its period on.

    One sensor, one force: whose clock is late is told by the motion before the record alone, so either name is right.
    """
    records = []
    for seed in (4, 5):
        time, force, x, _, rng = driven(seed, 0.8, 4.0)
        told = CubicSpline(time, force)(time[:-20] + late)  # the force acts later than recorded
        records.append(rss.Record(time[:-20], {"Heave": (x + 2e-3 * x.std() * rng.normal(size=x.size))[:-20],
                                               "Heave_force": told}, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(MODEL, records[0], withhold=records[1])
    sets = found.verdict.indistinguishable or [[effect.name for effect in found.verdict.effects]]
    assert set(sets[0]) <= {"excitation_delay", "sensor_delay"} >= set(sets[-1])
    value, std = next(row.parameters["delay"] for row in found.budget.rows if row.cause in sets[0])
    assert abs(value - late) < 3.0 * std < 0.05  # s


DRAG_OR_DAMPING = ["quadratic_drag", "linear_damping"]


@pytest.fixture(scope="module")
def dragged():
    """A model, a decay of its body with drag, and the diagnosis of this displacement alone."""
    fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    time = np.arange(0.0, 24.0, 0.05)
    motion = rss.simulate(model, (time, 0.0 * time[None]), [("quadratic_drag", {"coefficient": 400.0})],
                          start={"Heave": 0.1}).outputs[0]
    record = rss.Record(time, {"Heave": motion + 1e-4 * np.random.default_rng(0).standard_normal(time.size)},
                        kind="decay")
    return model, record, rss.diagnose(model, record, DRAG_OR_DAMPING)


@pytest.mark.parametrize("channel, value, noise", [
    ("Heave_acceleration", 0.0, 0.0), ("Heave_acceleration", 9.81, 0.0), ("Heave_acceleration", 0.0, 0.02),
    ("Heave_velocity", 0.01, 0.0)])
def test_a_dead_sensor_is_left_out(dragged, channel, value, noise):
    """The diagnosis is that of the record without it."""
    model, record, alone = dragged
    reading = value + noise * np.random.default_rng(1).standard_normal(record.time.size)
    dead = rss.diagnose(model, record.with_channels(**{channel: reading}), DRAG_OR_DAMPING)
    assert dead.how_far.gap_before == pytest.approx(alone.how_far.gap_before, rel=1e-6)
    assert dead.verdict.probability == pytest.approx(alone.verdict.probability, rel=1e-6)
    assert any("dead sensor, left out" in note for note in dead.notes)


@pytest.fixture(scope="module")
def heaving():
    """A model of heave and pitch, channels without pitch of a body with drag by scipy, and their diagnosis."""
    M, C, D = np.array([[1400.0, 40.0], [40.0, 800.0]]), np.diag([30000.0, 15000.0]), np.diag([900.0, 400.0])
    rigid = rss.RadiationFit(("Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model, time = rss.Model(("Heave", "Pitch"), 0.6 * M, 0.4 * M, C, rigid, D=D), np.arange(0.0, 40.0, 0.05)
    force = np.array([400.0 * np.sin(4.0 * time) + 300.0 * np.sin(5.3 * time), 200.0 * np.cos(4.4 * time)])

    def rate(t, state):
        pull = np.array([np.interp(t, time, row) for row in force])
        drag = np.array([2500.0 * np.abs(state[2]) * state[2], 0.0])
        return np.concatenate([state[2:], np.linalg.solve(M, pull - D @ state[2:] - C @ state[:2] - drag)])

    heave = solve_ivp(rate, (0.0, 40.0), np.zeros(4), t_eval=time, rtol=1e-7, atol=1e-9).y[0]
    heave += 3e-4 * np.random.default_rng(0).standard_normal(time.size)
    channels = {"Heave": heave, "Heave_force": force[0], "Pitch_force": force[1]}
    missing = rss.Record(time, {**channels, "Pitch": np.full(time.size, np.nan)})
    return model, time, channels, rss.diagnose(model, missing, DRAG_OR_DAMPING)


@pytest.mark.parametrize("reading", [0.0, 0.3])
def test_a_motion_whose_channel_is_dead_is_left_out(heaving, reading):
    """The diagnosis is that of the record without it; the truth by scipy's integrator, where the other motion moves."""
    model, time, channels, alone = heaving
    dead = rss.diagnose(model, rss.Record(time, {**channels, "Pitch": np.full(time.size, reading)}), DRAG_OR_DAMPING)
    assert [e.name for e in dead.verdict.effects] == ["quadratic_drag"]
    assert dead.how_far.gap_before == pytest.approx(alone.how_far.gap_before, rel=1e-6)
    assert any("Pitch of record is constant" in note for note in dead.notes)


@pytest.mark.parametrize("zero", [9.81, -0.8])  # m/s^2: gravity, a usual bias
def test_the_mean_of_an_acceleration_is_no_gap(zero):
    """An accelerometer alone, of a body that is as its model says, in a sea by python-control's response."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 90.0, 0.05)
    force = sum(np.cos(w * time + phase) for w, phase in zip(rng.uniform(1.0, 3.0, 40), rng.uniform(0.0, 6.3, 40)))
    still = np.concatenate([np.zeros(1200), force * np.minimum(time / 5.0, 1.0)])  # it moves as long as it remembers
    body = ct.ss(F, G, [[0.0, 1.0, 0.0, 0.0]], 0)
    speed = ct.forced_response(body, 0.05 * np.arange(still.size), still).outputs
    reading = np.gradient(speed, 0.05)[1200:] + zero + 2e-3 * rng.standard_normal(time.size)
    found = rss.diagnose(MODEL, rss.Record(time, {"Heave_acceleration": reading, "Heave_force": still[1200:]},
                                           kind="forced"), ["quadratic_drag", "linear_damping"])
    assert found.verdict.status == "no_gap"
    assert found.how_far.gap_before < 0.03 and any("gravity or the sensor" in note for note in found.notes)


def driven_pair(seed, dt=0.1, count=1200):
    """Forces on heave and pitch that are coupled by stiffness, displacements and velocities (count, 2), a generator."""
    rng = np.random.default_rng(seed)
    time, omega, phase = dt * np.arange(count), rng.uniform(0.8, 3.5, (2, 14)), rng.uniform(0, 6.28, (2, 14))
    force = np.array([[20.0], [10.0]]) * np.cos(omega[:, :, None] * time + phase[:, :, None]).sum(1)
    M, C, D = PAIR.M + PAIR.A_inf, PAIR.C, PAIR.D
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, C), -np.linalg.solve(M, D)]])
    B = np.concatenate([np.zeros((2, 2)), np.linalg.inv(M)])
    moved = dlsim(cont2discrete((A, B, np.eye(4), np.zeros((4, 2))), dt, method="foh"), force.T)[1]
    return time, force, moved[:, :2], moved[:, 2:], rng


RIGID = rss.RadiationFit(("Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
PAIR = rss.Model(("Heave", "Pitch"), np.diag([100.0, 40.0]), np.zeros((2, 2)), [[400.0, 40.0], [40.0, 120.0]], RIGID,
                 D=np.diag([20.0, 8.0]))


@pytest.mark.parametrize(("cause", "number", "size"), [("sensor_delay", "delay", 0.15), ("cross_axis", "share", 0.12)])
def test_what_all_sensors_of_a_motion_have_in_common_is_one_effect(cause, number, size):
    """Pitch by displacement and velocity, both of them late or with a part of heave."""
    records = []
    for seed in range(3):
        time, force, *motion, rng = driven_pair(seed, count=800)
        channels = {"Heave_force": force[0], "Pitch_force": force[1]}
        for y, quantity in zip(motion, ("", "_velocity")):
            heave, pitch = y.T
            pitch = CubicSpline(time, pitch)(np.maximum(time - size, 0.0)) if cause == "sensor_delay" else \
                pitch + size * heave
            for dof, read in (("Heave", heave), ("Pitch", pitch)):
                channels[dof + quantity] = read + 0.01 * read.std() * rng.normal(size=time.size)
        records.append(rss.Record(time, channels, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(PAIR, records[:2], withhold=records[2])
    assert [(e.name, e.dof.split(",")[0]) for e in found.verdict.effects] == [(cause, "Pitch")]
    parameters = found.verdict.effects[0].parameters
    assert parameters["all_sensors"] == (1.0, 0.0)
    assert abs(parameters[number][0] - size) < 4.0 * parameters[number][1] < 0.4 * size


@pytest.mark.parametrize("gain", [0.1, 0.2])
def test_one_of_two_sensors_that_reads_too_much_is_told_from_the_force_by_the_other(gain):
    time, force, x, v, rng = driven(3, 0.8, 4.0)
    a = np.gradient(v, time, edge_order=2)
    channels = {"Heave": (1.0 + gain) * x + 0.01 * x.std() * rng.normal(size=time.size),
                "Heave_acceleration": a + 0.01 * a.std() * rng.normal(size=time.size), "Heave_force": force}
    found = rss.diagnose(MODEL, rss.Record(time, channels, kind="forced", name="sea"))
    (named,) = found.verdict.effects
    value, std = named.parameters["gain"]
    assert named.name == "sensor_gain" and "all_sensors" not in named.parameters
    assert abs(value - gain) < 3.0 * std and found.how_far.gap_after < 0.02


@pytest.mark.parametrize(("late", "gain"), [(0.0, 0.3), (0.0, 1.0 / 9.81 - 1.0), (0.3, 0.0)])
@pytest.mark.parametrize("seed", some([5, 6]))
def test_a_wrong_second_sensor_is_named_by_its_channel_beside_a_right_displacement(seed, late, gain):
    """An accelerometer that reads too much, in g, or late: the motion goes as the model says."""
    time, force, x, v, rng = driven(seed, 0.8, 4.0)
    a = (1.0 + gain) * CubicSpline(time, v)(np.maximum(time - late, 0.0), 1)
    channels = {"Heave": x + 0.01 * x.std() * rng.normal(size=time.size),
                "Heave_acceleration": a + 0.02 * a.std() * rng.normal(size=time.size), "Heave_force": force}
    found = rss.diagnose(MODEL, rss.Record(time, channels, kind="forced", name="sea"))
    (named,) = found.verdict.effects
    number, size = ("delay", late) if late else ("gain", gain)
    assert (named.name, named.channels) == (f"sensor_{number}", ("Heave_acceleration",))
    assert abs(named.parameters[number][0] - size) < 0.02 * abs(size)
    assert f"sensor_{number} on Heave_acceleration" in found.sentence and found.how_far.gap_after < 0.02


@pytest.mark.parametrize("seed", some(range(2)))
@pytest.mark.parametrize(("wrong", "words"), [
    ("kgf", "Heave_force taken from kgf to N"), ("order", "Heave and Pitch exchanged"),
    ("clock", "Heave_acceleration comes 5 s earlier")])
def test_what_columns_may_be_instead_leads_the_verdict(tmp_path, seed, wrong, words):
    if wrong == "order":
        time, force, x, _, rng = driven_pair(seed)
        model, motion, forces = PAIR, dict(zip(("Pitch", "Heave"), x.T)), force
    else:
        time, force, x, v, rng = driven(seed, 0.8, 4.0)
        model, motion, forces = MODEL, {"Heave": x}, [force / 9.81 if wrong == "kgf" else force]
        if wrong == "clock":
            motion = {"Heave": np.interp(time - 5.0, time, x), "Heave_acceleration": np.gradient(v, time)}
    channels = {name: y + 0.01 * y.std() * rng.normal(size=time.size) for name, y in motion.items()}
    channels |= {f"{dof}_force": row for dof, row in zip(model.dofs, forces)}
    found = rss.diagnose(model, rss.Record(time, channels, kind="forced", name="sea"), ["quadratic_drag"])
    assert found.verdict.status in ("unknown_effect", "ambiguous")
    assert found.sentence.startswith("First check record sea, ") and words in found.sentence.split("As the columns")[0]
    found.save(tmp_path / "out")
    assert words in (tmp_path / "out" / "report.html").read_text() and found.sentence == str(found)


def test_clocks_that_differ_from_record_to_record_are_told_of_the_records():
    """The motion of each sea stands so much later in its file than the force; without lags nothing is said."""
    def told(lags):
        records = []
        for seed, lag in enumerate(lags):
            time, force, x, _, rng = driven(seed, 0.8, 4.0, count=800)
            kept = slice(20, -20)
            late = CubicSpline(time, x)(time[kept] - lag) + 2e-3 * x.std() * rng.normal(size=time[kept].size)
            records.append(rss.Record(time[kept], {"Heave": late, "Heave_force": force[kept]}, kind="forced",
                                      name=f"sea {seed}"))
        return [text for text in rss.diagnose(MODEL, records[:2], withhold=records[2:]).notes if "clocks" in text]

    texts = told((0.05, -0.05, 0.06, -0.06))
    assert any(text.startswith("Record sea 2: its motion comes 0.0") and " later" in text for text in texts)
    assert any(text.startswith("Record sea 3: its motion comes 0.0") and " earlier" in text for text in texts)
    assert not told((0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("zero, status", [(0.0, "no_gap"), (0.1, "ambiguous")])
def test_a_zero_that_is_off_in_one_record_is_a_sensor_or_a_steady_force(zero, status):
    """Shares of the motion's rms; the other records have none, so no cause of them all has it."""
    records = []
    for seed in range(3):
        time, force, x, _, rng = driven(seed, 0.8, 4.0)
        read = x + x.std() * (zero * (seed == 1) + 0.01 * rng.normal(size=time.size))
        records.append(rss.Record(time, {"Heave": read, "Heave_force": force}, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(MODEL, records)
    assert found.verdict.status == status
    assert set(found.verdict.indistinguishable) == ({("constant_force",), ("sensor_bias",)} if zero else set())
    assert ("known place" in found.verdict.next_record) == bool(zero)
