"""Records from files: what goes in comes back, and bad input gets one sentence with its place."""

import gzip
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import radiation_ss as rss
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.records import channel_unit, suspicions, without_faults


def written(folder: Path, text: str, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def wave_record(kind="waves", **more):
    time = np.arange(200) * 0.05
    channels = {"Heave": 0.1 * np.sin(2.0 * time), "Heave_force": 3.0 * np.cos(2.0 * time), **more}
    return rss.Record(time, channels, kind=kind, name="run 7", start="at rest", meta={"tank": "north"})


@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz", "run.parquet"])
def test_written_record_comes_back_bit_for_bit(tmp_path, name):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
    record = wave_record(wave_elevation=np.where(np.arange(200) % 3, np.nan, 0.02 * np.sin(np.arange(200))))
    rss.write_record(record, tmp_path / name)
    back = rss.read_record(tmp_path / name)
    assert back.kind == record.kind and back.name == record.name and back.start == record.start
    assert dict(back.meta) == {"tank": "north"}
    np.testing.assert_array_equal(back.time, record.time)
    assert list(back.channels) == list(record.channels)
    for channel, values in record.channels.items():
        np.testing.assert_array_equal(back.channels[channel], values)


@given(values=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=20),
       steps=st.lists(st.floats(1e-5, 1.0), min_size=20, max_size=20))
def test_any_number_and_any_jitter_survive_the_text(tmp_path_factory, values, steps):
    time = np.cumsum(steps)[: len(values)]
    path = tmp_path_factory.mktemp("record") / "run.csv"
    rss.write_record(rss.Record(time, {"Roll": values}, kind="motion-only"), path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        back = rss.read_record(path)
    np.testing.assert_array_equal(back.time, time)
    np.testing.assert_array_equal(back.channels["Roll"], values)


def test_gzip_of_one_record_is_the_same_file_each_time(tmp_path):
    for name in ("a.csv.gz", "b.csv.gz"):
        rss.write_record(wave_record(), tmp_path / name)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()


def test_comments_may_have_a_unit_behind_the_key_and_any_case(tmp_path):
    path = written(tmp_path, "# speed [m/s]: 2\n# Probe [m]: -1.5\n# HEADING: 90\ntime [s],Heave [m]\n0,1\n1,2\n")
    record = rss.read_record(path)
    assert record.speed == 2.0 and dict(record.meta) == {"probe": "-1.5 m", "heading": "90"}
    with pytest.raises(rss.InputError, match=r"line 3: comment 'heading' says '0', another one .* line 1, '90'"):
        rss.read_record(written(tmp_path, "# Heading: 90\n# probe: 0\n# heading: 0\ntime [s],Heave [m]\n0,1\n1,2\n"))
    with pytest.raises(rss.InputError, match="comment 'speed': '4 kn' found, m/s needed"):
        rss.read_record(written(tmp_path, "# speed [kn]: 4\ntime [s],Heave [m]\n0,1\n1,2\n"))


def test_comments_several_rates_and_spellings(tmp_path):
    path = written(tmp_path, "\ufeff# kind: waves\n# name: sea 3\n# start: 2018-04-11\n# probe: wp4, north\n"
                             "time [s],Roll[rad], Roll_force [Nm],Sway_acceleration [m/s²]\n"
                             "0.0,0.1,2,\n0.01,,,0.5\n0.02,nan,,0.4\n0.03,0.2,1,\n")
    record = rss.read_record(path)
    assert (record.kind, record.name, record.start) == ("waves", "sea 3", "2018-04-11")
    assert dict(record.meta) == {"probe": "wp4, north"}
    assert record.dofs == ("Roll", "Sway")
    np.testing.assert_array_equal(record.channels["Roll"], [0.1, np.nan, np.nan, 0.2])
    np.testing.assert_array_equal(record.get("acceleration", ["Sway"]), [[np.nan, 0.5, 0.4, np.nan]])


@pytest.mark.parametrize("columns, kind", [
    ({"Heave_force": [0, 0, 0]}, "decay"), ({"Heave_force": [0, 1, 0]}, "forced"),
    ({"Heave_force": [0, 1, 0], "wave_elevation": [0, 1, 0]}, "waves"), ({"wave_elevation": [0, 1, 0]}, "waves"),
    ({}, "motion-only"), ({"Heave_force": [0, np.nan, 0]}, "decay")])
def test_kind_is_inferred_from_the_columns_when_absent(tmp_path, columns, kind):
    columns = {"time": [0.0, 0.1, 0.2], "Heave": [0.0, 1.0, 0.5], **columns}
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values()))]
    assert rss.read_record(written(tmp_path, "\n".join(rows))).kind == kind
    if kind != "decay":
        assert rss.read_record(written(tmp_path, "\n".join(rows)), kind="forced").kind == "forced"


def test_a_decay_states_that_the_force_is_zero():
    record = rss.Record([0.0, 0.1], {"Heave": [1.0, 0.9]}, kind="decay")
    np.testing.assert_array_equal(record.get("force", ["Heave"]), [[0.0, 0.0]])
    assert record.get("velocity", ["Heave"]) is None
    with pytest.raises(InputError, match="no force acts, but Heave_force"):
        rss.Record([0.0, 0.1], {"Heave": [1.0, 0.9], "Heave_force": [0.0, 1.0]}, kind="decay")


GOOD = "time [s],Heave [m]\n0,1\n0.1,2\n"


@pytest.mark.parametrize("text, words", [
    ("time [s],Heave [furlong]\n0,1\n", ["line 1", "column 2", "unit [furlong]", "Heave may be in m, cm, mm, ft, in"]),
    ("time [Ms],Heave [m]\n0,1\n", ["column 1", "[Ms]", "time may be in s, ms, us, min, h, d"]),
    ("time [s],Roll (mm)\n0,1\n", ["[mm]", "Roll may be in rad, mrad, deg"]),
    ("time [s],Heave_force [kg]\n0,1\n", ["[kg]", "N, mN, kN"]),     # a mass
    ("time [s],Heave_force [kn]\n0,1\n", ["[kn]", "N, mN, kN"]),     # a speed
    ("time [s],Roll_force [MN M]\n0,1\n", ["[MN M]", "mN"]),
    ("time [s],Roll_force [kN]\n0,1\n", ["[kN]", "kN", "times m, cm"]),
    ("time [s],Heave moment [N m]\n0,1\n", ["'Heave moment'", "not one of"]),
    ("time [s],hieve [m]\n0,1\n", ["'hieve'", "not one of", "did you mean 'Heave'"]),
    ("time Heave\n0 1\n", ["line 1", "'time Heave'", "a comma, a semicolon or a tab"]),
    ("time [s],,Heave [m]\n0,1,\n", ["column 2", "ends without a separator"]),
    ("time [s],Heave [m],\n0,1,\n0.1,2,5\n", ["line 3", "3 cells, but the header has 2"]),
    ("time [s],Heave [m],\n0,1,\n0.1,\n", ["line 3", "1 cells, but the header has 2"]),
    ("Heave [m],time [s]\n1,0\n#N/A,0.1\n2,#NV\n", ["line 4", "no time"]),
    ("t\0i\0m\0e\0,\0H\0e\0a\0v\0e\0\n\0", ["line 1", "UTF-16", "CSV UTF-8"]),
    ("time,Heave\n2024-05-01 10:20:00,1\n", ["line 2", "column 'time'", "time of day; seconds from the first sample"]),
    ("time [s],Heave [m],probe [m]\n0,1,1\n", ["column 3", "'probe'", "ignore="]),
    ("time [s],Heave [m],Heave\n0,1,1\n", ["column 3", "twice"]),
    ("t,time,Heave\n0,0,1\n", ["column 2", "twice"]),
    ("time,eta [m]\n0,1\n", ["'eta'", "did you mean 'wave_elevation'"]),
    ("Heave [m]\n1\n", ["no column `time [s]`"]),
    ("time;Heave,\n0;1\n", ["line 1", "commas and semicolons found"]),
    ("time;Heave\n0;1,5\n1;2.5\n", ["line 3", "points and commas"]),
    ("time\tHeave\n0\t1,5\n1\t2.5\n", ["line 3", "points and commas", "tabs"]),
    ("time,Roll\ns,gon\n0,1\n", ["line 1", "[gon]", "rad, mrad, deg"]),
    ("time [s],Heave [mm]\ns,mm\n0,1\n", ["line 2", "'s' is not a number"]),
    ("Run 12, regular waves\ntime,Heave\n0,1\n", ["line 1: no cell of it names a channel", "begin with #"]),
    ("0,1\n0.1,2\n", ["line 1: no cell of it names a channel"]),
    (GOOD + "0.2,abc\n", ["line 4", "column 'Heave'", "'abc' is not a number"]),
    (GOOD + "0.2,inf\n", ["line 4", "'inf' is not a number"]),
    (GOOD + "0.2,1,5\n", ["line 4", "3 cells, but the header has 2"]),
    ("time [s],Heave [m]\n0,0,1,5\n", ["line 2", "4 cells, but the header has 2", "decimal marks, semicolons"]),
    (GOOD + ",1\n", ["line 4", "column 'time'", "no time"]),
    (GOOD + "0.05,1\n", ["line 4", "column 'time'", "comes after 0.1 s"]),
    ("time [s],Heave [m]\n0.3,0\n0.1,0.1\n0.2,0.2\n", ["line 3", "column 'Heave' does", "header", "swapped"]),
    ("# name: x\n" + GOOD + "0.1,1\n", ["line 5", "0.1 s is there twice"]),
    ("# kind: storm\n" + GOOD, ["kind 'storm' is unknown", "decay"]),
    ("# kind = decay\n" + GOOD, ["line 1", "write `# kind: ...`"]),
    (GOOD + "# kind: decay\n0.2,3\n", ["line 4", "'# kind: decay' stands below the header"]),
    ("# only a comment\n", ["no header"]), ("time [s],Heave [m]\n0,1\n", ["at least two"]),
])
def test_bad_file_is_one_sentence_with_its_place(tmp_path, text, words):
    with pytest.raises(InputError) as error:
        rss.read_record(written(tmp_path, text))
    message = str(error.value)
    assert "run.csv" in message and "\n" not in message
    for word in words:
        assert word in message


def test_kind_in_any_case(tmp_path):
    assert rss.read_record(written(tmp_path, "# Kind: Decay\n" + GOOD)).kind == "decay"
    assert rss.read_record(written(tmp_path, "# kind: decay;\n" + GOOD.replace(",", ";"))).kind == "decay"


def test_files_that_are_none_or_no_text(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        rss.read_record(tmp_path / "absent.csv")
    with pytest.raises(InputError, match=r"is \.csv, \.csv\.gz or \.parquet"):
        rss.read_record(written(tmp_path, "x", "run.txt"))
    with pytest.raises(InputError, match="gzipped CSV"):
        rss.read_record(written(tmp_path, "x", "run.csv.gz"))
    (tmp_path / "latin.csv").write_bytes(gzip.compress(b"time"))
    with pytest.raises(InputError, match="CSV text"):
        rss.read_record(tmp_path / "latin.csv")
    (tmp_path / "windows.csv").write_bytes("Time (s),Pitch (°)\n0,1\n".encode("cp1252") + bytes([0x81]))
    with pytest.raises(InputError, match=r"windows\.csv: .*not in UTF-8.*`CSV UTF-8`"):
        rss.read_record(tmp_path / "windows.csv")
    with pytest.raises(InputError, match="written as"):
        rss.write_record(wave_record(), tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="field of the record itself"):
        rss.write_record(rss.Record([0, 1], {"Heave": [0, 1]}, meta={"Name": "x"}), tmp_path / "run.csv")
    with pytest.raises(InputError, match="a key begins with a letter"):
        rss.write_record(rss.Record([0, 1], {"Heave": [0, 1]}, meta={"1": "x"}), tmp_path / "run.csv")


TIME = np.arange(0.0, 30.0, 0.02)
WAVE = np.sin(2.1 * TIME)


@pytest.mark.parametrize("channels, word", [
    ({"Heave": 80.0 * WAVE}, "millimetres"), ({"Roll": 20.0 * WAVE}, "degrees"),
    ({"Heave": 0.1 * WAVE, "Heave_velocity": 210.0 * np.cos(2.1 * TIME)}, "wrong unit"),
    ({"Heave": 0.0 * WAVE + 0.3}, "dead channel"), ({"Heave_force": 0.0 * WAVE + 5.0, "Heave": WAVE}, "dead channel"),
    ({"Heave": np.clip(WAVE, -0.9, 2.0)}, "clipped at a minimum"), ({"Heave": np.minimum(WAVE, 0.8)}, "a maximum"),
    ({"Heave": np.where((TIME > 9.0) & (TIME < 9.5), np.sin(2.1 * 9.0), WAVE)}, "24 samples repeat .* hangs"),
    ({"Heave": WAVE[np.arange(TIME.size) // 5 * 5]}, "1200 samples repeat .* slower than the log"),
    ({"Heave": np.full(TIME.size, np.nan)}, "0 sample"),
    ({"Heave": np.where((TIME > 3.0) & (TIME < 3.2), -999.0, 0.1 * WAVE)}, "samples of -999, far from all others"),
    ({"Heave": 0.1 * WAVE - 12.0}, "take off the reading at rest"),
    ({"Heave_acceleration": 0.4 * WAVE + 9.8}, "gravity is in it"),
    ({"wave_elevation": 0.02 * WAVE + 3.6}, "take off the reading at rest"),
    ({"Heave": 0.1 * WAVE, "Heave_velocity": 0.21 / 0.5144 * np.cos(2.1 * TIME)}, r"1\.94 times the rate .*in knots?"),
    ({"Heave": 0.1 * WAVE, "Heave_acceleration": -0.441 / 9.81 * WAVE}, r"0\.1\d+ times the second rate"),
])
def test_suspicious_channels_are_named(tmp_path, channels, word):
    record = rss.Record(TIME, channels, kind="motion-only")
    assert any(re.search(word, sentence) for sentence in suspicions(record))
    assert "millimetres" not in " ".join(suspicions(record)) or word == "millimetres"
    rss.write_record(record, tmp_path / "run.csv")
    with pytest.warns(InputWarning, match=word):
        rss.read_record(tmp_path / "run.csv")


@pytest.mark.parametrize("code", [-999.0, -9999.0, 999.9, -99.0, 1e20, -1e30, np.float32(-999.9), -32768.0, 9.96921e36])
def test_a_lone_code_for_a_missing_sample_is_told_as_such_alone(tmp_path, code):
    """Nor is it an amplitude in millimetres, and the reading at rest is that of the others."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    heave = 0.1 * WAVE + noise
    heave[200] = code if code != 9.96921e36 else 9.969209968386869e36
    (said,) = suspicions(rss.Record(TIME, {"Heave": heave}, kind="motion-only"))
    assert said.startswith(f"Heave: 1 sample of {code:g}, far from all others; does it stand for a missing one?")
    blow = rss.Record(TIME, {"Heave_force": np.where(TIME == TIME[200], 1.2345 * code, heave)}, kind="forced")
    assert not any("missing" in text for text in suspicions(blow))
    (tmp_path / "run.csv").write_text("time [s],Roll [deg]\n" + "".join(
        f"{t:.2f},{code if k == 200 else 20.0 * x:.6g}\n" for k, (t, x) in enumerate(zip(TIME, heave))))
    with pytest.warns(InputWarning, match=r"Roll: 1 sample of .* \(.* deg\), far from all others") as told:
        record = rss.read_record(tmp_path / "run.csv")
    assert len(told) == 1
    fit = rss.RadiationFit(("Roll",), [[-3.0]], [[4.0]], [[1.0]], 1)
    body = rss.Model(("Roll",), [[50.0]], [[30.0]], [[300.0]], fit)
    with pytest.raises(InputError, match=r"^record run, Roll: 1 sample of .*Leave such cells empty$"):
        rss.identify(body, record)


def test_codes_of_both_ends_and_a_reading_within_the_others():
    values = np.round(60.0 * WAVE)
    assert suspicions(rss.Record(TIME, {"Heave_force": np.where(TIME == 10.0, 99.0, values)}, kind="forced")) == ()
    values[[7, 80, 81, 300]] = -999.0, 1e20, 1e20, -9999.0
    said = [text for text in suspicions(rss.Record(TIME, {"Heave_force": values}, kind="forced")) if "missing" in text]
    assert [text.split(", far")[0].split(": ")[1] for text in said] == [
        "1 sample of -9999", "1 sample of -999", "2 samples of 1e+20"]


@pytest.mark.parametrize("shown", [0.0, None])
@pytest.mark.parametrize("seed", range(3))
def test_what_a_hanging_sensor_shows_is_left_out(seed, shown):
    """Nothing of a sensor that repeats a value in motion is a measurement, but where it began and after it went on."""
    rng = np.random.default_rng(seed)
    sea = sum(rng.normal() * np.cos(w * TIME + rng.uniform(0, 6)) for w in np.linspace(1.0, 3.0, 12)) * 0.2
    first = int(np.argmax(np.abs(np.gradient(sea[300:1200])))) + 300
    values = sea + 1e-3 * rng.normal(size=TIME.size)
    values[first: first + 40] = values[first] if shown is None else shown
    kept, said = without_faults(rss.Record(TIME, {"Heave": values}, kind="motion-only"))
    missing = np.flatnonzero(np.isnan(kept.channels["Heave"]))
    np.testing.assert_array_equal(missing, np.arange(first + 1, first + 40))
    assert len(said) == 1 and "39 of 1500 samples repeat" in said[0]


@pytest.mark.parametrize("times", [2, 3.5, 20])
def test_of_a_sensor_slower_than_the_log_each_reading_is_taken_once(times):
    """Readings of a random sea with noise, held until the next; the log's rate need not be a multiple of theirs."""
    sea = np.random.default_rng(1).normal(size=1500) * 0.01 + WAVE
    last = (np.floor(np.arange(TIME.size) / times) * times).astype(int)
    kept, said = without_faults(rss.Record(TIME, {"Heave": sea[last]}, kind="motion-only"))
    np.testing.assert_array_equal(np.isfinite(kept.channels["Heave"]), np.append(True, np.diff(last) > 0))
    assert len(said) == 1 and "slower than the log" in said[0]


def test_a_sentence_on_all_samples_has_looked_at_all():
    time, heave = np.arange(500.0) / 10.0, np.full(500, 0.3)
    assert "over all 500 samples" in suspicions(rss.Record(time, {"Heave": heave}), most=200)[0]
    moves_late = rss.Record(time, {"Heave": np.where(time < 30.0, 0.3, np.sin(time))})
    assert suspicions(moves_late, most=200) == ()
    wave = np.sin(2.1 * time)
    said = suspicions(rss.Record(time, {"Heave": 0.1 * wave, "Heave_velocity": 210.0 * np.cos(2.1 * time)}), most=200)
    assert "the first 200 rows" in said[-1]
    said = suspicions(rss.Record(time, {"Heave": np.minimum(wave, 0.5)}), most=200)
    assert "samples of the first 200)" in said[0]


def test_loads_that_are_changed_by_hand_take_minutes():
    assert suspicions(rss.Record(60.0 * np.arange(5.0), {"Roll": 0.01 * np.arange(5.0)}, kind="static")) == ()


@pytest.mark.parametrize("damping", [0.01, 0.3, 1.5])
def test_the_rate_of_a_decay_is_no_other_unit(damping):
    """x = exp(-z t) cos t and its rate, exact: a cut edge is no factor, whatever the damping."""
    time = np.arange(0.0, 40.0, 0.05)
    decay = np.exp(-damping * time)
    channels = {"Heave": decay * np.cos(time), "Heave_velocity": -decay * (damping * np.cos(time) + np.sin(time))}
    assert suspicions(rss.Record(time, channels, kind="decay")) == ()


def test_offsets_need_no_times(tmp_path):
    text = "Roll [deg];Roll_force [N m]\n-3,0;-5,0\n0;0\n3,0;5,0\n"
    stated = rss.read_record(written(tmp_path, "# kind: static\n" + text))
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"Roll [deg]": [-3.0, 0.0, 3.0], "Roll_force": [-5.0, 0.0, 5.0]})
    asked = rss.read_record(written(tmp_path, text), kind="static")
    for record in (stated, asked, rss.as_record(frame, kind="static")):
        assert record.time.tolist() == [0.0, 1.0, 2.0]
        assert record.channels["Roll"] == pytest.approx(np.pi / 60.0 * np.array([-1.0, 0.0, 1.0]))
    rss.write_record(stated, tmp_path / "again.csv")
    assert rss.read_record(tmp_path / "again.csv").kind == "static"
    with pytest.raises(InputError, match=r"no column `time \[s\]`"):
        rss.read_record(written(tmp_path, text))


def test_offsets_without_a_kind_are_asked_for_it():
    record = rss.Record(60.0 * np.arange(9.0), {"Roll": 0.01 * np.arange(9.0), "Roll_force": np.arange(9.0)},
                        kind="forced")
    assert "# kind: static" in suspicions(record)[0]


def test_time_in_milliseconds_or_days_is_suspected():
    assert "milliseconds" in suspicions(rss.Record(TIME * 1000.0, {"Heave": WAVE}))[0]
    assert "time [d]" in suspicions(rss.Record(45000.0 + TIME / 86400.0, {"Heave": WAVE}))[0]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("quantum", [1e-9, 0.01, 0.05])
def test_sound_records_raise_no_suspicion(seed, quantum):
    rng = np.random.default_rng(seed)
    sea = sum(rng.normal() * np.cos(w * TIME + rng.uniform(0, 6)) for w in np.linspace(1.0, 3.0, 12)) * 0.2
    noisy = sea + 1e-3 * rng.normal(size=TIME.size)
    held = np.where(TIME < 3.0, 1.0, np.cos(2.0 * (TIME - 3.0)) * np.exp(-0.1 * (TIME - 3.0)))
    sticking = np.interp(0.2 * TIME % 1.0, [0.0, 0.2, 0.5, 0.7, 1.0], [0.0, np.pi, np.pi, 2.0 * np.pi, 2.0 * np.pi])
    for values in (sea, noisy, held, WAVE, np.cos(sticking)):  # the last stops for 1.5 s between half swings of 1 s
        record = rss.Record(TIME, {"Heave": np.round(values / quantum) * quantum,
                                   "Heave_velocity": np.gradient(values, TIME)}, kind="motion-only")
        assert suspicions(record) == ()


def test_units_of_channels():
    assert channel_unit("float__Pitch_force") == "N m"
    assert channel_unit("Sway_acceleration") == "m/s^2"
    with pytest.raises(InputError, match="not one of"):
        channel_unit("Hooke")


@pytest.mark.parametrize("text", [
    "\ufefftime;Heave\ns;m\n0;1,5\n0,1;-2e-1\n", "time [s];Heave [m]\n0;1.5\n0.1;-2e-1\n",
    "time,Heave\n[s],(m)\n0,1.5\n.1,-.2\n", "Time (s)\tHeave (mm)\n0\t1500\n0.1\t-200\n",
    "t [s]\tHeave\n0,0\t1,5\n0,1\t-0,2\n", "time, s;Heave, cm\n# a, b.\n0;150\n0,1;-20\n",
    '"time, ms","Heave, mm"\n"0","1500"\n"100","-200"\n', "Time;Heave\n\nms;mm\n0;1500,0\n100;-200\n"])
def test_tables_of_spreadsheets(tmp_path, text):
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8")
    record = rss.read_record(path)
    assert record.time.tolist() == pytest.approx([0.0, 0.1])
    assert record.channels["Heave"].tolist() == pytest.approx([1.5, -0.2])


@pytest.mark.parametrize("cell, channel, one", [
    ("Heave [m]", "Heave", 1.0), ("heave (mm)", "Heave", 1e-3), ("Heave, cm", "Heave", 1e-2),
    ("Sway_in", "Sway", 0.0254), ("Pitch (deg)", "Pitch", np.pi / 180.0), ("PITCH/°", "Pitch", np.pi / 180.0),
    ("Roll angle [mrad]", "Roll", 1e-3), ("Pitch rate [deg/s]", "Pitch_velocity", np.pi / 180.0),
    ("heave_vel_mm/s", "Heave_velocity", 1e-3), ("Heave acceleration [g]", "Heave_acceleration", 9.80665),
    ("Heave acc (mm/s²)", "Heave_acceleration", 1e-3), ("Surge_acceleration [m s-2]", "Surge_acceleration", 1.0),
    ("Yaw_acceleration, °/s^2", "Yaw_acceleration", np.pi / 180.0), ("Heave_force (kN)", "Heave_force", 1e3),
    ("Heave force [kgf]", "Heave_force", 9.80665), ("Roll force [kN m]", "Roll_force", 1e3),
    ("Roll moment (N mm)", "Roll_force", 1e-3), ("Roll_force [mNm]", "Roll_force", 1e-3),
    ("Pitch_force [MN·m]", "Pitch_force", 1e6), ("Wave elevation (mm)", "wave_elevation", 1e-3),
    ("buoy__heave (mm)", "buoy__Heave", 1e-3)])
def test_the_unit_that_a_header_states_is_converted_and_said(tmp_path, cell, channel, one):
    text = f'Time (ms);"{cell}";probe (V)\n0;1;1\n20;2;1\n'
    record = rss.read_record(written(tmp_path, text), ignore=("probe",))
    assert record.time.tolist() == pytest.approx([0.0, 0.02])
    assert record.channels[channel].tolist() == pytest.approx([one, 2.0 * one])
    said = record.meta["converted"]
    assert said.startswith("time from ms") and (f"{channel} from " in said) == (one != 1.0)


PLAIN = "time [s],Heave [m],Roll [deg]\n0,1.5,90\n0.5,,180\n1,2.5,-90\n"
EXCEL = PLAIN.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize("text, encoding", [
    ("sep=;\n" + EXCEL, "utf-8"), ("sep=,\n" + PLAIN, "utf-8-sig"), (PLAIN.replace(",", "\t"), "utf-16"),
    (PLAIN.replace("\n", ",\n"), "utf-8"), (EXCEL.replace("\n", ";;\n"), "utf-8"), ("# x: y;;\n" + EXCEL, "utf-8"),
    (PLAIN.replace("\n", ",\n").replace(",", "\t"), "utf-16"), (PLAIN.replace(",,", ",#N/A,"), "utf-8"),
    (EXCEL.replace(";;", ";#NV;"), "utf-8"), (PLAIN.upper(), "utf-8"), (PLAIN.replace("deg", "°"), "cp1252"),
    (PLAIN.replace(" [s]", "").replace(" [m]", "").replace(" [deg]\n", ",\ns,m,deg,\n"), "utf-8"),
    (EXCEL.replace(" [m]", " [KN]").replace("Heave", "Heave vel").replace("1,5", "2,7").replace("2,5", "4,5"), "utf-8"),
    ("Heave,time,Roll (°)\n1.5,0,90\n#N/A,0.5,180\n2.5,1,-90\n", "utf-8")])
def test_what_spreadsheets_and_loggers_write_is_the_same_table(tmp_path, text, encoding):
    (tmp_path / "run.csv").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        record = rss.read_record(tmp_path / "run.csv")
    factor = 1852.0 / 3600.0 * 1.8 if "KN" in text else 1.0
    np.testing.assert_allclose(record.time, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(next(v for n, v in record.channels.items() if "Heave" in n) / factor, [1.5, np.nan, 2.5])
    np.testing.assert_allclose(record.channels["Roll"], np.pi * np.array([0.5, 1.0, -0.5]))
    assert sum("read as Windows text (cp1252)" in str(w.message) and "'°'" in str(w.message) for w in said) == (
        encoding == "cp1252")


@pytest.mark.parametrize("header, ignore, left", [
    ("Probe 3,Heave", "probe_3", ["Heave"]), ("Probe 3,Heave", "Probe 3", ["Heave"]), ("P,Heave", "p", ["Heave"]),
    ("Sway acc,Heave", "sway_acc", ["Heave"]), ("Heave,Roll", "wave", ["Heave", "Roll"]),
    ("Probe,probe,Heave", "probe", None)])       # one is named: the other is not left out with it
def test_a_column_to_leave_out_is_named_as_channels_are(tmp_path, header, ignore, left):
    rows = [",".join([str(k)] * (header.count(",") + 2)) for k in range(3)]
    path = written(tmp_path, "\n".join([f"time,{header}", *rows]))
    if left is None:
        with pytest.raises(InputError, match="column 2 'Probe'"):
            rss.read_record(path, ignore=(ignore,))
    else:
        assert list(rss.read_record(path, ignore=(ignore,)).channels) == left


def test_degrees_are_converted_once(tmp_path):
    path = written(tmp_path, "time,pitch [deg]\n0,1\n1,2\n")
    for degrees in ((), "Pitch", ("pitch",)):
        assert rss.read_record(path, degrees=degrees).channels["Pitch"] == pytest.approx(np.deg2rad([1.0, 2.0]))
    plain = rss.read_record(written(tmp_path, "time,Pitch\n0,1\n1,2\n"), degrees="Pitch")
    assert plain.meta["converted"] == "Pitch from deg"
    rss.write_record(plain, path)           # in SI, and so it stays
    assert rss.read_record(path).channels["Pitch"] == pytest.approx(plain.channels["Pitch"], rel=1e-15)
    with pytest.raises(InputError, match=r"said to be in degrees, but the header has \[rad\]"):
        rss.read_record(path, degrees="Pitch")
