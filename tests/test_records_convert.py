"""Records from and to the tables of other people's tools."""

import numpy as np
import pytest

import radiation_ss as rss
from radiation_ss.records import to_pandas, to_xarray

pd = pytest.importorskip("pandas")
TIME = np.arange(0.0, 5.0, 0.1)
RECORD = rss.Record(TIME, {"Heave": np.cos(TIME), "Heave_force": np.where(TIME > 2.0, np.nan, TIME)}, kind="forced",
                    name="run 7", start="noon", speed=1.5, meta={"tank": "north"})


def same(one, other):
    np.testing.assert_array_equal(one.time, other.time)
    assert list(one.channels) == list(other.channels)
    for name, values in one.channels.items():
        np.testing.assert_array_equal(values, other.channels[name])
    for what in ("kind", "name", "start", "speed"):
        assert getattr(one, what) == getattr(other, what)
    assert dict(one.meta) == dict(other.meta)


def test_to_pandas_and_back():
    frame = to_pandas(RECORD)
    assert frame["Heave"].loc[0.0] == 1.0
    same(rss.as_record(frame), RECORD)
    same(rss.as_record(frame.reset_index()), RECORD)


def test_a_frame_makes_a_record_by_itself():
    frame = pd.DataFrame({"time [s]": [0.0, 0.1, 0.2], "Heave [m]": [0.1, 0.08, 0.03]})
    assert rss.Record(frame).kind == "motion-only"
    record = rss.Record(frame, kind="decay", name="run 5")
    assert (record.dofs, record.kind, record.name) == (("Heave",), "decay", "run 5")
    np.testing.assert_array_equal(record.channels["Heave"], [0.1, 0.08, 0.03])


def test_a_written_file_read_by_pandas_is_the_record(tmp_path):
    rss.write_record(RECORD, tmp_path / "run.csv")
    exact = {"float_precision": "round_trip"} if pd.__version__.startswith("2.") else {}  # pandas 2: else one bit off
    frame = pd.read_csv(tmp_path / "run.csv", comment="#", **exact)
    back = rss.as_record(frame, kind="forced")
    np.testing.assert_array_equal(back.channels["Heave_force"], RECORD.channels["Heave_force"])
    same(rss.as_record(tmp_path / "run.csv"), RECORD)
    same(rss.as_record(str(tmp_path / "run.csv")), RECORD)
    assert rss.as_record(RECORD) is RECORD


def test_an_index_of_dates_or_differences():
    values = {"Roll": [0.1, 0.0, -0.1]}
    dates = pd.DataFrame(values, index=pd.date_range("2018-04-11 10:20", periods=3, freq="50ms"))
    found = rss.as_record(dates)
    assert found.start == "2018-04-11T10:20:00" and found.time == pytest.approx([0.0, 0.05, 0.1])
    steps = pd.DataFrame(values, index=pd.to_timedelta([0.0, 0.5, 1.0], unit="s"))
    assert rss.as_record(steps).time == pytest.approx([0.0, 0.5, 1.0])


def test_an_index_says_its_unit_or_that_it_is_no_time():
    values, tens = {"Roll": [0.1, 0.0, -0.1]}, [0, 10, 20]
    frame = pd.DataFrame(values, index=pd.Index(tens, name="time [ms]"))
    assert rss.as_record(frame).time == pytest.approx([0.0, 0.01, 0.02])
    stated = frame.rename_axis("time").to_xarray()
    stated["time"].attrs["units"] = "ms"
    assert rss.as_record(stated).time == pytest.approx([0.0, 0.01, 0.02])
    for bad, words in ((frame.rename_axis("sample"), "its index is 'sample'"),
                       (stated.drop_vars("time"), "only counts the rows")):
        with pytest.raises(rss.InputError, match=words):
            rss.as_record(bad)
    assert rss.as_record(frame.rename_axis("sample"), kind="static").time.tolist() == tens


def test_labels_of_two_levels_are_name_and_unit():
    frame = pd.DataFrame([[0.0, 90.0], [0.1, 45.0]])
    frame.columns = pd.MultiIndex.from_tuples([("time", "s"), ("Roll", "deg")])
    assert rss.as_record(frame).channels["Roll"][0] == pytest.approx(np.pi / 2.0)


def test_integers_with_gaps():
    frame = pd.DataFrame({"time": [0, 1, 2], "Heave": pd.array([1, None, 3], dtype="Int64")})
    np.testing.assert_array_equal(rss.as_record(frame).channels["Heave"], [1.0, np.nan, 3.0])


@pytest.mark.parametrize("columns, words", [
    ({"Heave": [0.0, 1.0]}, "only counts the rows"),
    ({"time": [0.0, 1.0], "Roll [gon]": [0.0, 1.0]}, "rad, mrad, deg"),
    ({"time": [0.0, 1.0], "Heave": ["a", "b"]}, "numbers needed"), ({"time": [1.0, 0.0], "Heave": [0.0, 1.0]}, "row 1"),
    ({"time": [0.0, 1.0], "Heave": [0.0, np.inf]}, "infinite"), ({"time": [0.0, np.nan], "Heave": [0.0, 1.0]}, "row 1"),
    ({"time": [0.0, 1.0], "Heave": [True, False]}, "numbers needed")])
def test_bad_frames_are_one_sentence(columns, words):
    with pytest.raises(rss.InputError, match=words):
        rss.as_record(pd.DataFrame(columns))


def test_the_units_of_a_frame_and_of_parquet(tmp_path):
    frame = pd.DataFrame({"Time (ms)": [0.0, 100.0], "Roll [deg]": [0.0, 90.0], "Heave_force (kN)": [1.0, 2.0]})
    pytest.importorskip("pyarrow")
    frame.to_parquet(tmp_path / "run.parquet")
    for record in (rss.as_record(frame), rss.read_record(tmp_path / "run.parquet")):
        assert record.time == pytest.approx([0.0, 0.1]) and record.channels["Roll"][1] == pytest.approx(np.pi / 2.0)
        assert record.channels["Heave_force"].tolist() == [1000.0, 2000.0]
        assert record.meta["converted"] == "time from ms, Roll from deg, Heave_force from kN"


def test_what_is_no_record():
    with pytest.raises(rss.InputError, match="list found"):
        rss.as_record([1, 2])


def test_to_xarray_carries_units_and_comments():
    data = to_xarray(RECORD)
    assert data["Heave_force"].attrs["units"] == "N" and data.attrs["speed"] == 1.5
    np.testing.assert_array_equal(data["Heave"].sel(time=TIME[3]), RECORD.channels["Heave"][3])


@pytest.mark.parametrize("arguments, words", [({"withold": RECORD}, r"diagnose\(\) .*'withold'"),
                                              ({"model": None}, r"diagnose\(\) .*'model'")])
def test_a_wrong_argument_is_told_with_the_functions_name(arguments, words):
    with pytest.raises(TypeError, match=words):
        rss.diagnose("model.nc", RECORD, **arguments)
