"""From what sensors measured to what a record holds; what looks wrong with a record by itself."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import radiation_ss as rss
from radiation_ss.errors import InputWarning
from radiation_ss.records import suspicions

TIME = np.arange(0.0, 60.0, 0.02)


def sea(seed, time=TIME):
    rng = np.random.default_rng(seed)
    w, phase = rng.uniform(3.0, 7.0, 40), rng.uniform(0.0, 2.0 * np.pi, 40)
    arg = np.outer(w, time) + phase[:, None]
    return np.cos(arg).sum(0) * 0.01, (-w @ np.sin(arg)) * 0.01, (-(w**2) @ np.cos(arg)) * 0.01


def waving():
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 20.0, 40)).select("Heave").times(0.3)
    return rss.Model.from_hydro(section.replace(M=[[5.0]]), order=3)


def test_elevation_at_the_body_with_jitter_and_gaps_of_another_rate():
    drawn = rss.realise(rss.jonswap(0.05, 1.2), 160.0, 0.02, seed=2)
    rng = np.random.default_rng(0)
    time = drawn.time[1000:7000] + rng.uniform(-2e-3, 2e-3, 6000)
    probe = np.interp(time, drawn.time, drawn.elevation)
    probe[1::2] = np.nan
    record = rss.Record(time, {"wave_elevation": probe, "Heave": np.sin(time)}, meta={"probe": "-4.0 m"})
    found = rss.at_the_body(record).channels["wave_elevation"]
    there = np.interp(time, drawn.time, drawn.elevation_at(4.0))
    known = np.isfinite(found)
    assert known[::2].sum() > 1500 and not known[1::2].any()
    assert np.std(found[known] - there[known]) < 0.08 * np.std(there)
    np.testing.assert_array_equal(rss.at_the_body(record, 4.0).channels["wave_elevation"], found)
    with pytest.raises(rss.InputError, match=r"probe.* measured at -4 m, and the body is at 0; at_the_body"):
        rss.identify(waving(), record, "prediction-error")
    with pytest.raises(rss.InputError, match="measured at -4 m"):
        rss.simulate(waving(), record)
    carried = rss.at_the_body(record)
    assert carried.meta["probe"] == "0" and rss.simulate(waving(), carried).outputs.shape[1] == time.size


def test_a_place_of_the_probe_that_is_not_understood_is_not_the_body():
    time = np.arange(0.0, 20.0, 0.05)
    for stated in ("-5 ft", "2.5 m upstream", "-1.5, 0", "ten", "wp4", "inf"):
        record = rss.Record(time, {"wave_elevation": np.sin(6.0 * time)}, meta={"probe": stated})
        with pytest.raises(rss.InputError, match=r"is no place .* write metres"):
            rss.simulate(waving(), record)
        assert rss.at_the_body(record, 0.5).meta["probe"] == "0"


@pytest.mark.parametrize("record, words", [
    (rss.Record(TIME, {"Heave": np.sin(TIME)}), "no channel wave_elevation"),
    (rss.Record(TIME, {"wave_elevation": np.sin(TIME)}), "place of the probe"),
    (rss.Record(TIME, {"wave_elevation": np.sin(TIME)}, meta={"probe": "wp4"}), "'wp4' is no place"),
    (rss.Record(TIME, {"wave_elevation": np.sin(TIME)}, meta={"probe": "1"}, speed=1.0), "at rest only"),
    (rss.Record(TIME, {"wave_elevation": np.where((TIME > 9) & (TIME < 10), np.nan, np.sin(TIME))},
                meta={"probe": "1"}), "no sample from"),
])
def test_an_elevation_that_cannot_be_carried(record, words):
    with pytest.raises(rss.InputError, match=words):
        rss.at_the_body(record)


def test_degrees_become_radians(tmp_path):
    (tmp_path / "run.csv").write_text("time [s],Roll [deg],Roll_velocity [deg/s],Heave [m]\n0,90,180,1\n1,0,0,2\n")
    for read in (rss.read_record(tmp_path / "run.csv"),
                 rss.read_record(tmp_path / "run.csv", degrees=("Roll", "Roll_velocity"))):
        assert read.channels["Roll"][0] == pytest.approx(np.pi / 2.0) and read.channels["Heave"][0] == 1.0
    (tmp_path / "run.csv").write_text("time,Roll,Roll_velocity,Heave\n0,1,180,1\n1,0,0,2\n")
    turned = rss.in_radians(rss.read_record(tmp_path / "run.csv"))
    assert turned.channels["Roll_velocity"][0] == pytest.approx(np.pi) and turned.channels["Heave"][0] == 1.0
    for degrees, words in ((("Heave",), "its unit is m"), (("Pitch",), "no column 'Pitch'")):
        with pytest.raises(rss.InputError, match=words):
            rss.read_record(tmp_path / "run.csv", degrees=degrees)
    with pytest.raises(rss.InputError, match="none of its rotations"):
        rss.in_radians(turned, "Heave")


def test_accelerometers_of_a_body_that_turns():
    # What sensors fixed to a body read, by rotation matrices: e . R'(acceleration of the point + g z).
    (sway, _, sway_a), (heave, _, heave_a), (roll, _, roll_a) = (sea(seed) for seed in range(3))
    roll, roll_a = 0.2 * roll, 0.2 * roll_a
    places = np.array([[0.0, 0.13, 0.05], [0.0, -0.13, 0.05], [0.0, 0.0, -0.05]])
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    turn = Rotation.from_rotvec(np.outer(roll, [1.0, 0.0, 0.0])).as_matrix()
    readings = []
    for r, e in zip(places, axes):
        point = np.einsum("tij,j->ti", turn, r) + np.column_stack([0.0 * sway, sway, heave])
        a = np.gradient(np.gradient(point, TIME, axis=0), TIME, axis=0) + [0.0, 0.0, 9.81]
        readings.append(np.einsum("tji,tj->ti", turn, a) @ e)
    angles = rss.Record(TIME, {"Roll": roll})
    found = rss.from_accelerometers(TIME, readings, places, axes, ["Sway", "Heave", "Roll"], rotations=angles)
    inside = slice(10, -10)
    for name, true in (("Sway", sway_a), ("Heave", heave_a), ("Roll", roll_a)):
        error = found[f"{name}_acceleration"][inside] - true[inside]
        assert np.std(error) < 0.02 * np.std(true), name
    with pytest.raises(rss.InputError, match="give the angles"):
        rss.from_accelerometers(TIME, readings, places, axes, ["Sway", "Heave", "Roll"])
    with pytest.raises(rss.InputError, match="cannot tell"):
        rss.from_accelerometers(TIME, readings[:1], places[:1], axes[:1], ["Heave", "Roll"])
    with pytest.raises(rss.InputError, match="unit vectors"):
        rss.from_accelerometers(TIME, readings, places, 2.0 * axes, ["Heave"])


def test_accelerometers_of_the_flume_agree_with_its_camera(data):
    # Sundsdal et al. 2025, free in heave and roll: sensors at y = +-0.12995 m, the camera at 20 Hz.
    path = sorted((data / "ntnu_section" / "free_sway_heave_roll").glob("*.csv"))[0]
    table = np.genfromtxt(path, delimiter=",", names=True)
    t = table["time_s"]
    part = (t > 30.0) & (t < 45.0)
    pair = np.array([table["acc_heave_sb_m_s2"], table["acc_heave_ps_m_s2"]])[:, part]
    pair = pair - pair.mean(axis=1, keepdims=True) + 9.81
    found = rss.from_accelerometers(t[part], pair, [[0, -0.12995, 0], [0, 0.12995, 0]], [[0, 0, 1], [0, 0, 1]],
                                    ["Heave", "Roll"])
    heave = table["heave_cam_m"][part]
    camera, logger = rss.Record(t[part], {"Heave": heave}), rss.Record(t[part] + 1.7, found)
    offset, alike = rss.clock_offset(camera, logger, "Heave", "Heave_acceleration", largest=3.0)
    assert alike > 0.9
    # Regular waves: the offset is known up to their period.
    crests = np.flatnonzero((heave[1:-1] > heave[:-2]) & (heave[1:-1] >= heave[2:]) & (heave[1:-1] > 0.5 * heave.max()))
    period = np.median(np.diff(t[part][crests]))
    assert abs((offset + 1.7 + 0.5 * period) % period - 0.5 * period) < 0.06


@pytest.mark.parametrize("delay", [-3.21, 0.4, 12.0])
def test_clocks_of_a_displacement_and_a_noisy_acceleration(delay):
    rng = np.random.default_rng(0)
    camera_time = np.arange(5.0, 50.0, 0.05)
    heave = sea(1, camera_time)[0]
    logger_time = np.arange(0.0, 60.0, 0.01) - delay
    acceleration = sea(1, logger_time + delay)[2]
    camera = rss.Record(camera_time, {"Heave": heave + 0.02 * heave.std() * rng.standard_normal(heave.size)})
    logger = rss.Record(logger_time, {"Heave_acceleration": acceleration + 0.1 * acceleration.std()
                                      * rng.standard_normal(acceleration.size)})
    offset, alike = rss.clock_offset(camera, logger, "Heave", "Heave_acceleration")
    assert offset == pytest.approx(delay, abs=0.005) and alike > 0.9
    assert rss.clock_offset(logger, camera, "Heave_acceleration", "Heave")[0] == pytest.approx(-delay, abs=0.005)
    both = rss.joined(camera, logger, offset)
    assert set(both.channels) == {"Heave", "Heave_acceleration"}
    assert np.isfinite(both.channels["Heave"]).sum() == camera_time.size


@pytest.mark.parametrize("width, delay", [(0.02, 5.15), (0.02, 7.35), (0.01, 7.35), (0.01, -8.0), (0.005, -5.1)])
def test_clocks_of_a_packet_of_waves_anywhere_in_the_records(width, delay):
    t, late = np.arange(0.0, 60.0, 0.05), np.arange(2.0, 71.0, 0.02)
    camera, logger = (np.exp(-width * (x - 30.0) ** 2) * np.sin(3.0 * x) for x in (t, late + delay))
    one, other = rss.Record(t, {"Heave": camera}), rss.Record(late, {"Heave": logger})
    offset, alike = rss.clock_offset(one, other, "Heave", largest=10.0)
    all_lags = np.correlate(np.interp(late, t, camera), logger, "full")  # own: the largest is the offset
    assert 0.02 * (np.argmax(all_lags) - late.size + 1) == pytest.approx(delay, abs=0.02)
    assert offset == pytest.approx(delay, abs=0.005) and alike > 0.999
    with pytest.raises(rss.InputError, match="turned sign"):
        rss.clock_offset(one, rss.Record(late, {"Heave": -logger}), "Heave", largest=10.0)


def test_clocks_that_have_nothing_in_common():
    with pytest.raises(rss.InputError, match="nowhere alike"):
        rss.clock_offset(rss.Record(TIME, {"Heave": 0.0 * TIME}), rss.Record(TIME, {"Heave": sea(1)[0]}), "Heave")
    one, other = rss.Record(TIME, {"Heave": sea(1)[0]}), rss.Record(TIME, {"Heave": sea(2)[0], "Roll": sea(3)[0]})
    with pytest.raises(rss.InputError, match="nowhere alike"):
        rss.clock_offset(one, other, "Heave")
    with pytest.raises(rss.InputError, match="not one degree of freedom"):
        rss.clock_offset(one, other, "Heave", "Roll")
    with pytest.raises(rss.InputError, match="no channel 'Roll'"):
        rss.clock_offset(one, other, "Roll")
    with pytest.raises(rss.InputError, match="both have a channel 'Heave'"):
        rss.joined(one, other)


def test_a_pitch_whose_sign_is_turned_against_its_rate():
    x, v, a = sea(4)
    assert suspicions(rss.Record(TIME, {"Pitch": x, "Pitch_velocity": v, "Pitch_acceleration": a})) == ()
    (said,) = suspicions(rss.Record(TIME, {"Pitch": -x, "Pitch_velocity": v}))
    assert "Pitch_velocity is minus the rate of change of Pitch" in said
    assert "sign" in suspicions(rss.Record(TIME, {"Pitch": x, "Pitch_acceleration": -a}))[0]


def test_speed_in_knots_is_suspected():
    record = rss.Record(TIME, {"Heave": sea(1)[0]}, speed=15.5)
    assert "write 7.974" in suspicions(record)[0]
    assert suspicions(rss.Record(TIME, {"Heave": sea(1)[0]}, speed=7.974)) == ()


def test_small_angles_in_degrees_are_suspected():
    assert "in degrees" in suspicions(rss.Record(TIME, {"Pitch": 100.0 * sea(1)[0]}))[0]


@pytest.mark.parametrize("ratio", [0.01, 0.03, 0.1])
@pytest.mark.parametrize("held", [0, 50])
def test_a_decay_that_does_not_say_so(tmp_path, ratio, held):
    rng = np.random.default_rng(0)
    time = np.maximum(TIME - TIME[held], 0.0)
    roll = 0.15 * np.exp(-ratio * 2.5 * time) * np.cos(2.5 * time) + 1e-4 * rng.standard_normal(time.size)
    rss.write_record(rss.Record(TIME, {"Roll": roll}, kind="decay"), tmp_path / "run.csv")
    assert rss.read_record(tmp_path / "run.csv").kind == "decay"
    text = (tmp_path / "run.csv").read_text().replace("# kind: decay\n", "")
    (tmp_path / "run.csv").write_text(text)
    with pytest.warns(InputWarning, match="add `# kind: decay`"):
        rss.read_record(tmp_path / "run.csv")


def test_a_sea_is_no_decay():
    for seed in range(40):
        assert suspicions(rss.Record(TIME, {"Heave": sea(seed)[0]}, kind="motion-only"), stated=False) == ()


def test_two_sensors_read_one_after_the_other_need_no_endless_grid():
    time = np.sort(np.concatenate([np.arange(2000) * 0.05, np.arange(2000) * 0.05 + 1e-7]))
    record = rss.Record(time, {"Heave": np.sin(time), "Heave_velocity": np.cos(time)}, kind="motion-only")
    assert suspicions(record) == ()


def test_a_record_prints_in_ten_lines():
    channels = {f"b{k}__{dof}{s}": TIME for k in range(2) for dof in ("Heave", "Roll") for s in ("", "_force")}
    record = rss.Record(TIME, {**channels, "Yaw": np.full(TIME.size, np.nan), "odd $\\frac{$": TIME}, speed=1.0,
                        name="a/b$\\frac{$\n<script>")
    lines = repr(record).splitlines()
    assert len(lines) <= 10 and max(map(len, lines)) <= 160
    page = record._repr_html_()
    assert "<svg" in page and "<script>" not in page


@pytest.mark.parametrize("reading, told", [(9.81, False), (1.0, True), (-9.81, True), (0.0, True)])
def test_an_accelerometer_without_its_gravity_is_doubted(reading, told, recwarn):
    """In units of g, with a turned sign, or with its mean taken off."""
    rss.from_accelerometers(TIME, [reading + 0.1 * np.sin(TIME)], [[0, 0, 0.1]], [[0, 0, 1]], ["Heave"])
    assert [w.category for w in recwarn] == [InputWarning] * told
    assert all("accelerometer 1: its mean is" in str(w.message) for w in recwarn)


def test_clocks_far_apart_and_turned_signs_are_named():
    heave, _, acceleration = sea(4)
    camera = rss.Record(TIME, {"Heave": heave}, name="camera")
    for origin, sign, words in ((1.7e9, 1.0, "logger at 1700000000 s; no offset within 5 s"),
                                (1.3, -1.0, "alike with a turned sign")):
        logger = rss.Record(TIME + origin, {"Heave_acceleration": sign * acceleration}, name="logger")
        with pytest.raises(rss.InputError, match=words):
            rss.clock_offset(camera, logger, "Heave", "Heave_acceleration", largest=5.0)


@pytest.mark.parametrize("depth", [0.0, -1.0, np.nan])
def test_a_probe_in_no_water_is_refused(depth):
    with pytest.raises(rss.InputError, match=r"depth: .*positive"):
        rss.at_the_body(rss.Record(TIME, {"wave_elevation": sea(1)[0]}), 2.0, depth=depth)


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_sensor_is_told_though_the_records_overlap_in_part(seed):
    rng, w = np.random.default_rng(seed), np.linspace(1.5, 6.0, 60)
    phase = rng.uniform(0.0, 2.0 * np.pi, 60)
    t, late = np.arange(0.0, 200.0, 0.05), np.arange(0.0, 150.0, 0.02)
    camera = rss.Record(t, {"Heave": np.cos(np.outer(t, w) + phase).sum(1)})
    logger = rss.Record(late, {"Heave_acceleration": (w**2 * np.cos(np.outer(late + 2.34, w) + phase)).sum(1)})
    with pytest.raises(rss.InputError, match="turned sign"):
        rss.clock_offset(camera, logger, "Heave", "Heave_acceleration")


def test_angles_that_end_before_the_accelerometers_are_refused():
    angles = rss.Record(TIME[:-20], {"Roll": 0.1 * np.sin(TIME[:-20])})
    with pytest.raises(rss.InputError, match="rotations: Roll is measured from"):
        rss.from_accelerometers(TIME, [np.zeros(TIME.size)], [[0, 0, 0]], [[0, 1, 0]], ["Sway"], rotations=angles)


def test_the_pair_that_clock_offset_returns_is_no_offset():
    heave, pitch = rss.Record(TIME, {"Heave": TIME}), rss.Record(TIME, {"Pitch": TIME})
    with pytest.raises(rss.InputError, match="the first that clock_offset returns"):
        rss.joined(heave, pitch, (1.0, 0.9))


def test_rotations_of_ones_own_are_turned_into_radians():
    flap = rss.Record(TIME, {"flap": np.full(TIME.size, 90.0), "gap": TIME}, units={"flap": "rad", "gap": "m"})
    turned = rss.in_radians(flap)
    assert turned.channels["flap"] == pytest.approx(np.pi / 2) and np.array_equal(turned.channels["gap"], TIME)
    with pytest.raises(rss.InputError, match="none of its rotations"):
        rss.in_radians(flap, "gap")


@pytest.mark.parametrize("late", [-4.0, 0.5, 1.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_sensors_of_one_motion_that_differ_in_time_are_told_by_how_much(seed, late):
    noise, (heave, _, acceleration) = np.random.default_rng(seed), sea(seed)
    later = sea(seed, TIME - late)[0]
    read = {"Heave": 0.01 * heave.std(), "Heave_acceleration": 0.02 * acceleration.std()}
    for motion, told in ((heave, False), (later, True)):
        values = dict(zip(read, (motion, acceleration)))
        record = rss.Record(TIME, {n: y + read[n] * noise.standard_normal(TIME.size) for n, y in values.items()})
        said = suspicions(record)
        assert len(said) == told
        for text in said:
            lag, way = re.match(r"Heave_acceleration comes (\S+) s (\w+) than the second rate", text).groups()
            assert float(lag) == pytest.approx(abs(late), abs=0.01) and way == ("earlier" if late > 0.0 else "later")
