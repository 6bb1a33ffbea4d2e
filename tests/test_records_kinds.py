"""What a record states of itself: kind, speed, sound times."""

import pickle

import numpy as np
import pytest

import radiation_ss as rss

TIME = np.arange(0.0, 2.0, 0.1)
ROLL = {"Roll": 0.1 * np.cos(3.0 * TIME)}


@pytest.mark.parametrize("kind", ["prescribed", "static", "decay", "forced", "waves", "motion-only"])
@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_each_kind_and_a_speed_come_back_from_each_form(tmp_path, kind, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    record = rss.Record(TIME, ROLL, kind=kind, speed=0.97)
    rss.write_record(record, tmp_path / f"run{suffix}")
    back = rss.read_record(tmp_path / f"run{suffix}")
    assert (back.kind, back.speed) == (kind, 0.97)
    assert pickle.loads(pickle.dumps(back)).speed == 0.97


def test_a_prescribed_record_needs_a_motion():
    with pytest.raises(rss.InputError, match="prescribed states that the motion is given"):
        rss.Record(TIME, {"Roll_force": TIME, "wave_elevation": TIME}, kind="prescribed")


@pytest.mark.parametrize("said, speed", [("0.97", 0.97), ("-1.5 m/s", -1.5), ("2 [m/s]", 2.0), ("0", 0.0)])
def test_speed_of_a_file(tmp_path, said, speed):
    (tmp_path / "run.csv").write_text(f"# speed: {said}\ntime,Roll\n0,0.1\n1,0.2\n")
    assert rss.read_record(tmp_path / "run.csv").speed == speed


@pytest.mark.parametrize("said, words", [
    ("15.5 kn", "m/s needed; write 7.974"), ("15.5 knots", "7.974"), ("36 km/h", "write 10"), ("3 ft/s", "m/s needed"),
    ("fast", "not a speed"), ("nan", "not a speed"), ("1_0", "not a speed"), ("١", "not a speed")])
def test_a_speed_in_other_units_is_named(tmp_path, said, words):
    (tmp_path / "run.csv").write_text(f"# speed: {said}\ntime,Roll\n0,0.1\n1,0.2\n", encoding="utf-8")
    with pytest.raises(rss.InputError, match=words):
        rss.read_record(tmp_path / "run.csv")


def test_a_speed_that_is_none():
    for speed in (np.nan, np.inf, "fast", None):
        with pytest.raises(rss.InputError, match="speed"):
            rss.Record(TIME, ROLL, speed=speed)


@pytest.mark.parametrize("jump", [30 * 86400.0, 1e9])
def test_a_clock_that_jumps_is_refused_with_its_row(tmp_path, jump):
    time = np.where(np.arange(TIME.size) < 12, TIME, TIME + jump)
    with pytest.raises(rss.InputError, match="sample 12: the clock jumps by"):
        rss.Record(time, ROLL)
    rows = "\n".join(f"{t},0.1" for t in time)
    (tmp_path / "run.csv").write_text(f"# name: x\ntime,Roll\n{rows}\n")
    with pytest.raises(rss.InputError, match="line 15, column 'time': the clock jumps by"):
        rss.read_record(tmp_path / "run.csv")


def test_a_pause_in_a_long_record_is_lawful():
    time = np.concatenate([np.arange(0.0, 3600.0, 0.5), np.arange(7300.0, 10000.0, 0.5)])
    assert rss.Record(time, {"Heave": np.sin(time)}).time.size == time.size
    assert rss.Record([0.0, 1000.0, 2000.0], {"Surge": [0.0, 1.0, 2.0]}, kind="static").kind == "static"


@pytest.mark.parametrize("held", [0, 100, 500])     # 25 s of 80
def test_a_decay_without_its_kind_is_asked_for_it(held):
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.02)
    time = np.arange(0.0, 55.0, 0.05)
    drag = ("quadratic_drag", "Roll", {"coefficient": 20.0})
    swung = rss.simulate(model, (time, np.zeros((1, time.size))), drag, start={"Roll": 0.24}).outputs[0]
    roll = np.r_[np.full(held, 0.24), swung] + 1e-3 * np.random.default_rng(0).standard_normal(time.size + held)
    record = rss.Record(0.05 * np.arange(roll.size), {"Roll": roll}, name="held")
    found = rss.diagnose(model, record, effects=["quadratic_drag", "linear_damping"])
    assert any("Roll dies away" in note and "`# kind: decay`" in note for note in found.notes)
