"""Kills, cut files and damaged caches: the old checkpoint or the new one, and one sentence on what is damaged."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "filter.npz"
    filter_ = rss.DualEnKF(start(0), n_ensemble=10).prepare(sea_record(0, duration=1.0)[0])
    filter_.step({"time": 0.0, "Heave": 1e-3})
    filter_.save(path)
    return path


def test_every_damage_to_a_checkpoint_is_said(saved, tmp_path):
    whole, rng, silent = saved.read_bytes(), np.random.default_rng(0), 0
    expected = rss.DualEnKF.load(saved).engine.arrays()
    path = tmp_path / "damaged.npz"
    for trial in range(300):
        data = bytearray(whole)
        kind = trial % 3
        if kind == 0:
            data = data[:rng.integers(0, len(data))]
        elif kind == 1:
            data[rng.integers(0, len(data))] ^= 1 << rng.integers(0, 8)
        else:
            at = rng.integers(0, len(data) - 64)
            data[at:at + 64] = bytes(64)
        path.write_bytes(bytes(data))
        try:
            found = rss.DualEnKF.load(path).engine.arrays()
        except rss.InputError as error:
            assert str(path) in str(error) and len(str(error)) < 600
        else:  # a byte that no reader looks at: then nothing may have changed
            silent += 1
            for name, values in expected.items():
                np.testing.assert_array_equal(found[name], values)
    assert silent < 150


def test_a_missing_or_foreign_file_is_no_checkpoint(tmp_path):
    with pytest.raises(rss.InputError, match="no such file"):
        rss.DualEnKF.load(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", a=np.arange(3))
    with pytest.raises(rss.InputError, match="no digest"):
        rss.DualEnKF.load(tmp_path / "other.npz")


SAVING = """
import itertools, sys
import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
live = rss.DualEnKF(start(0), n_ensemble=10).prepare(sea_record(0, duration=1.0)[0])
for k in itertools.count():
    live.step({"time": 0.01 * k, "Heave": 1e-3})
    live.save(sys.argv[1])
    print(k, flush=True)
"""


def test_kill_9_while_saving_leaves_a_checkpoint_that_loads(tmp_path):
    path, rng = tmp_path / "filter.npz", np.random.default_rng(1)
    for _ in range(4):
        with subprocess.Popen([sys.executable, "-c", SAVING, str(path)], cwd=ROOT, stdout=subprocess.PIPE, text=True,
                              env={**os.environ, "PYTHONPATH": str(ROOT)}) as run:
            last = int(run.stdout.readline())
            time.sleep(rng.uniform(0.0, 0.2))
            run.send_signal(signal.SIGKILL)
            last = max([last, *(int(line) for line in run.stdout.read().split("\n")[:-1])])
        again = rss.DualEnKF.load(path)
        # What was reported as saved is there; one more may be.
        assert again.time in (pytest.approx(0.01 * last), pytest.approx(0.01 * (last + 1)))
        again.step({"time": again.time + 0.01, "Heave": 1e-3})


def test_a_full_disk_leaves_the_checkpoint_that_was_there(saved, tmp_path, monkeypatch):
    path = tmp_path / "filter.npz"
    path.write_bytes(saved.read_bytes())
    live = rss.DualEnKF.load(path)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(rss.InputError, match=r"cannot be written .No space left"):
        live.save(path)
    assert path.read_bytes() == saved.read_bytes() and [p.name for p in tmp_path.iterdir()] == ["filter.npz"]
    with pytest.raises(rss.InputError, match="nowhere"):
        live.save(tmp_path / "nowhere" / "filter.npz")


def draw(seed):
    return {"draw": np.random.default_rng(seed).standard_normal(3)}


def test_a_damaged_chunk_is_done_again_and_a_damaged_study_is_said(tmp_path):
    expected = rss.repeat(draw, 12, chunk=4, folder=tmp_path)
    chunk = tmp_path / "chunk-000001.npz"
    chunk.write_bytes(chunk.read_bytes()[:100])
    with pytest.warns(RuntimeWarning, match=r"chunk-000001\.npz.*done again"):
        again = rss.repeat(draw, 12, chunk=4, folder=tmp_path)
    np.testing.assert_array_equal(again["draw"], expected["draw"])
    for damage in ("", "{", "[]", "null", "[" * 100_000):
        (tmp_path / "study.json").write_text(damage)
        with pytest.raises(rss.InputError, match=r"study\.json: (not a readable|one JSON object)"):
            rss.repeat(draw, 12, chunk=4, folder=tmp_path)
    (tmp_path / "study.json").unlink()
    np.testing.assert_array_equal(rss.repeat(draw, 12, chunk=4, folder=tmp_path)["draw"], expected["draw"])


def test_a_damaged_numba_cache_is_compiled_again(tmp_path):
    """Of compiled functions within compiled ones; which they are matters to no line of the cache."""
    code = ("import numpy as np\nfrom radiation_ss.inference import innovations\n"
            "from radiation_ss.simulation import exact_step, propagate\n"
            "one, y = np.eye(1), np.sin(np.arange(50.0))[:, None]\n"
            "x = propagate(exact_step(-one, one, 0.1), y, np.zeros(1))\n"
            "e, s = innovations(0.9 * one, one, one, np.ones(1), one, x, y, 1e-5)\n"
            "print(e.tobytes().hex(), s.tobytes().hex())")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}

    def run():
        return subprocess.run([sys.executable, "-W", "ignore", "-c", code], env=environment, stdout=subprocess.PIPE,
                              check=True).stdout

    first = run()
    files = sorted(path for path in tmp_path.rglob("*.nb?") if path.is_file())
    assert len(files) == 6  # an index and the code of each function: each kind of damage to both
    for k, path in enumerate(files):
        data = path.read_bytes()
        path.write_bytes([data[:len(data) // 2], b"", bytes(len(data))][k % 3])
    assert run() == first
