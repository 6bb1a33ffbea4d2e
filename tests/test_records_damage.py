"""Files that are cut, flipped, huge or strange: a right answer or one bounded sentence, never anything else."""

import gzip
import os
import subprocess
import sys
import tracemalloc
import warnings
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import radiation_ss as rss
from radiation_ss.atomic import write_whole, written_whole
from radiation_ss.errors import InputWarning

TIME = np.arange(0.0, 20.0, 0.1)
RECORD = rss.Record(TIME, {"Heave": np.sin(TIME), "Heave_force": np.where(TIME > 5.0, np.nan, np.cos(TIME))},
                    kind="forced", name="größe 7", speed=1.25, meta={"tank": "north, wall"})
FORMS = ("run.csv", "run.csv.gz", "run.parquet")


def content(record):
    """What a record says, byte for byte."""
    return (record.kind, record.name, record.start, record.speed, dict(record.meta), record.time.tobytes(),
            {name: values.tobytes() for name, values in record.channels.items()})


def outcome(path):
    """Return what reading gives: the content, or the sentence."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        try:
            return content(rss.read_record(path))
        except rss.InputError as error:
            assert path.name in str(error) and len(str(error)) < 1500 and "\n" not in str(error)
            return None


@pytest.fixture(params=FORMS)
def written(request, tmp_path):
    """The record in one of its forms: the name of the file, and its bytes."""
    if request.param.endswith("parquet"):
        pytest.importorskip("pyarrow")
    rss.write_record(RECORD, tmp_path / request.param)
    return request.param, (tmp_path / request.param).read_bytes()


def test_every_flipped_byte_is_refused_or_read_as_it_stands(tmp_path, written):
    form, whole = written
    rng = np.random.default_rng(0)
    for at in rng.choice(len(whole), 400, replace=False):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << rng.integers(8)
        (tmp_path / form).write_bytes(damaged)
        found = outcome(tmp_path / form)
        if form == "run.csv.gz" and found is not None:      # gzip has a checksum: only its own head may be touched
            assert found == content(RECORD)


def test_a_file_that_is_cut_is_no_shorter_record(tmp_path, written):
    form, whole = written
    for end in np.linspace(1, len(whole) - 2, 60, dtype=int):
        (tmp_path / form).write_bytes(whole[:end])
        found = outcome(tmp_path / form)
        if form != "run.csv":                               # text has no end mark: it may end at any number
            assert found is None


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 10_000), st.sampled_from(
    [b"", b",", b"\n", b"\r", b'"', b"#", b"_", b"\x00", b"\xff", b"nan", b"1e999", b"0x10", b"\xd9\xa1", b" ", b"\t",
     b"-", b"Heave", b"# kind: waves\n", b"[", b"9" * 400])), min_size=1, max_size=4))
@pytest.mark.filterwarnings("ignore:.*read as Windows text")  # what 0xff makes of it, and said
def test_text_with_pieces_put_in(tmp_path, edits):
    rss.write_record(RECORD, tmp_path / "run.csv")
    text = bytearray((tmp_path / "run.csv").read_bytes())
    for at, piece in edits:
        text[at % len(text):at % len(text)] = piece
    (tmp_path / "odd.csv").write_bytes(text)
    if (found := outcome(tmp_path / "odd.csv")) is not None:
        rss.write_record(rss.read_record(tmp_path / "odd.csv"), tmp_path / "again.csv")
        assert outcome(tmp_path / "again.csv") == found


@pytest.mark.parametrize("end", ["\r", "\r\n", "\n"])
def test_line_ends_of_any_system(tmp_path, end):
    rss.write_record(RECORD, tmp_path / "run.csv")
    text = (tmp_path / "run.csv").read_text(encoding="utf-8").replace("\n", end)
    (tmp_path / "run.csv").write_bytes(text.encode())
    assert outcome(tmp_path / "run.csv") == content(RECORD)


@pytest.mark.parametrize("cell", ["1_000", "١", "inf", "-Infinity", "1e999", "0x10", "1,5", "--1", "1 2", "None"])
def test_what_python_alone_takes_for_a_number(tmp_path, cell):
    (tmp_path / "run.csv").write_text(f"time,Heave\n0,1\n1,{cell}\n", encoding="utf-8")
    with pytest.raises(rss.InputError, match="line 3"):
        rss.read_record(tmp_path / "run.csv")


@pytest.mark.parametrize("text, words", [
    ("time,Heave\n0,1\n1," + "9" * 2_000_000 + "\n", "line 3: longer than"),
    ("x" * 3_000_000, "line 1: longer than"), ("time,Heave\n0," + "a" * 200_000 + "\n", "line 2"),
    ("time," + "b" * 300_000 + "\n0,1\n", "column 2"), ("# name: x\x00y\ntime,Heave\n0,1\n1,2\n", None)])
def test_long_lines_give_short_messages(tmp_path, text, words):
    (tmp_path / "run.csv").write_text(text)
    if words is None:
        assert rss.read_record(tmp_path / "run.csv").name == "x\x00y"
        return
    with pytest.raises(rss.InputError, match=words) as error:
        rss.read_record(tmp_path / "run.csv")
    assert len(str(error.value)) < 1500


def test_numbers_that_stand_across_two_pieces_of_text(tmp_path):
    time = np.arange(60_000) * 0.01
    record = rss.Record(time, {"Roll": 0.1 * np.sin(time), "Roll_force": np.full(time.size, np.nan)}, kind="forced")
    rss.write_record(record, tmp_path / "run.csv")
    assert (tmp_path / "run.csv").stat().st_size > 1.5 * 2**20
    assert outcome(tmp_path / "run.csv") == content(record)
    text = (tmp_path / "run.csv").read_text()
    (tmp_path / "run.csv").write_text(text.replace("\n599.98,", "\n599.98x,"))
    with pytest.raises(rss.InputError, match=r"line 60002, column 'time': '599\.98x'"):
        rss.read_record(tmp_path / "run.csv")


@pytest.mark.parametrize("row, words", [(b"0,0\n", "more than 1e"), (b"0" * 40, "longer than"), (b"\n", "unpacks to")])
def test_a_gzip_bomb_is_refused_in_bounded_memory(tmp_path, monkeypatch, row, words):
    monkeypatch.setattr("radiation_ss.records.csv_files.PIECE", 2**16 if row != b"\n" else 2**12)
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    with open(tmp_path / "run.csv.gz", "wb") as file:
        file.write(packer.compress(b"time,Heave\n"))
        for _ in range(20):
            file.write(packer.compress(row * 400_000))
        file.write(packer.flush())
    tracemalloc.start()
    with pytest.raises(rss.InputError, match=words):
        rss.read_record(tmp_path / "run.csv.gz", largest=1_000_000)
    assert tracemalloc.get_traced_memory()[1] < 300e6
    tracemalloc.stop()


def test_a_file_with_more_numbers_than_allowed(tmp_path):
    for form in FORMS[:2]:
        rss.write_record(RECORD, tmp_path / form)
        with pytest.raises(rss.InputError, match="`largest`"):
            rss.read_record(tmp_path / form, largest=100)


def test_parquet_that_states_odd_things(tmp_path):
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = pa.table({"time": [0.0, 1.0], "Heave": [0.0, 1.0]})
    for metadata, words in (({b"\xff\xfe": b"x"}, "Parquet"), ({b"kind": b"\xff"}, "Parquet"),
                            ({b"speed": b"fast"}, "not a speed"), ({b"kind": b"storm"}, "unknown")):
        parquet.write_table(table.replace_schema_metadata(metadata), tmp_path / "run.parquet")
        with pytest.raises(rss.InputError, match=words):
            rss.read_record(tmp_path / "run.parquet")
    for odd in ({"time": [0.0, 1.0], "Heave": [[1.0], [2.0]]}, {"time": [0.0, 1.0], "Heave": ["a", "b"]},
                {"time": [0.0, 1.0], "Heave": [0.0, np.inf]}):
        parquet.write_table(pa.table(odd), tmp_path / "run.parquet")
        with pytest.raises(rss.InputError, match="Heave"):
            rss.read_record(tmp_path / "run.parquet")


def test_names_that_are_no_files():
    for name in ("a\x00b.csv", "x" * 5000 + ".csv"):
        with pytest.raises(rss.InputError):
            rss.read_record(name)


@given(st.text(max_size=40) | st.sampled_from(["a/b$\\frac{$", "a\nb", "", " x ", '"q"', "\ud800", "x" * 5000]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_record_keeps_any_name(tmp_path, name):
    record = rss.Record([0.0, 1.0], {"Heave": [0.0, 1.0]}, name=name, kind="forced")
    rss.write_record(record, tmp_path / "run.csv")
    assert rss.read_record(tmp_path / "run.csv").name == name


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    write_whole(tmp_path / "a.txt", "old")
    with pytest.raises(RuntimeError), written_whole(tmp_path / "a.txt") as beside:
        beside.write_text("half")
        raise RuntimeError
    with pytest.raises(rss.InputError, match=r"a\.txt: cannot be written"), written_whole(tmp_path / "a.txt") as beside:
        raise OSError(28, "No space left on device")
    assert (tmp_path / "a.txt").read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]
    (tmp_path / "link").symlink_to(tmp_path / "a.txt")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "a.txt").read_text() == "new"


def test_a_write_that_is_killed_leaves_the_old_file(tmp_path):
    rss.write_record(RECORD, tmp_path / "run.csv")
    script = ("import os, signal, sys, numpy as np, radiation_ss as rss\n"
              "files = sys.modules[rss.write_record.__module__]\n"
              "keep = files.write_csv\n"
              "def killed(*given, **more):\n"
              "    keep(*given, **more); os.kill(os.getpid(), signal.SIGKILL)\n"
              "files.write_csv = killed\n"
              "rss.write_record(rss.Record([0.0, 1.0], {'Heave': [0.0, 1.0]}), 'run.csv')\n")
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=False,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    assert done.returncode == -9
    assert outcome(tmp_path / "run.csv") == content(RECORD)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_full_disk_names_the_path():
    with pytest.raises(rss.InputError, match="/dev/full: cannot be written"), written_whole("/dev/full") as beside:
        beside.write_bytes(b"x" * 100_000)


def test_gzip_of_text_that_is_not_gzip(tmp_path):
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress(b"time,Heave\n0,1\n1,2\n")[:-4])
    assert outcome(tmp_path / "run.csv.gz") is None
