"""Shared fixtures: the folder of third-party data, which is never part of the repository; a small Dask cluster."""

import os
import subprocess
import sys
import time
from pathlib import Path

import matplotlib
import pytest
from hypothesis import settings

matplotlib.use("Agg")
settings.register_profile("tests", deadline=None)  # a busy machine is no failure
settings.load_profile("tests")
ROOT = Path(__file__).parents[1]


def data_folder() -> Path | None:
    places = [os.environ.get("RADIATION_SS_DATA", ""), str(Path(__file__).parents[2] / "shared" / "data")]
    return next((Path(p) for p in places if p and Path(p).is_dir()), None)


@pytest.fixture(scope="session")
def data() -> Path:
    folder = data_folder()
    if folder is None:
        pytest.skip("third-party data absent: set RADIATION_SS_DATA")
    return folder


def pytest_collection_modifyitems(config, items):
    """Leave out the studies, which take long, unless all seeds are asked for or one test is named."""
    if os.environ.get("RADIATION_SS_SEEDS") == "all" or any("::" in argument for argument in config.args):
        return
    studies = set((ROOT / "tests" / "studies.txt").read_text(encoding="utf-8").splitlines())
    left = [item for item in items if item.nodeid.partition("tests/")[2] in studies]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]


def _process(folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}", "OMP_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, "-m", *arguments], cwd=folder, env=environment,
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers, each a process of its own on loopback; the fixture ends what it started."""
    pytest.importorskip("distributed")
    where = str(tmp_path / "scheduler.json")
    processes = [_process(tmp_path, "distributed.cli.dask_scheduler", "--host", "tcp://127.0.0.1", "--port", "0",
                          "--no-dashboard", "--scheduler-file", where)]
    deadline = time.monotonic() + 120.0
    while not Path(where).exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    processes += [_process(tmp_path, "distributed.cli.dask_worker", "--scheduler-file", where, "--nthreads", "1",
                           "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--local-directory",
                           str(tmp_path / f"worker{i}")) for i in range(2)]
    yield where, processes
    for process in processes:
        process.kill()
        process.wait(10)
