"""Many runs: the same numbers however they are carried out, on disk as they come, and nothing lost."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
from radiation_ss.filter import FilterStudy, run_seed


class Counted:
    """A cheap study that notes its calls in a file, so that they can be counted across processes."""

    def __init__(self, log, pause=0.0):
        self.log, self.pause = str(log), pause

    def __call__(self, seed):
        with open(self.log, "a") as file:
            file.write(f"{seed}\n")
        time.sleep(self.pause)
        return {"draw": np.random.default_rng(seed).standard_normal(3)}


def calls(log):
    return len(Path(log).read_text().splitlines()) if Path(log).exists() else 0


def study(**options):
    return FilterStudy(start(1), sea_record(1, duration=2.0)[0], preset="paper", n_ensemble=20, **options)


def test_results_are_the_same_to_the_last_bit_on_any_number_of_workers():
    alone = rss.repeat(study(), 12, seed=3, chunk=5)
    for workers in (1, 2, 3):
        with ThreadPoolExecutor(workers) as pool:
            pooled = rss.repeat(study(), 12, seed=3, chunk=5, executor=pool)
        for name, values in alone.items():
            np.testing.assert_array_equal(pooled[name], values)
    assert alone["theta"].shape == (12, 6) and not alone["diverged"].any()
    assert np.unique(alone["theta"][:, 0]).size == 12


def test_the_session_that_compiles_has_the_bits_of_those_that_take_the_code_from_the_cache(tmp_path):
    root = Path(__file__).parents[1]
    code = ("from test_filter_repeat import study\nimport radiation_ss as rss\n"
            "print(rss.repeat(study(draws='three-point'), 2, seed=3)['theta'].tobytes().hex())")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": f"{root}{os.pathsep}{root / 'tests'}"}
    said = [subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, check=True).stdout
            for _ in range(2)]
    assert said[0] == said[1] and len(said[0]) > 100


def test_a_run_of_the_study_is_the_filter_with_that_seed():
    runs = rss.repeat(study(), 3, seed=5, chunk=1)
    estimate = rss.DualEnKF(start(1), seed=run_seed(5, 2), preset="paper", n_ensemble=20).run(
        sea_record(1, duration=2.0)[0])
    np.testing.assert_array_equal(runs["theta"][2], estimate.theta[:, -1])


def test_a_stopped_study_goes_on_where_it_was(tmp_path):
    task, seen = Counted(tmp_path / "log"), []

    def stop(done, total):
        seen.append(done)
        if done >= 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rss.repeat(task, 20, folder=tmp_path / "runs", chunk=4, progress=stop)
    assert seen == [4, 8]
    resumed = rss.repeat(task, 20, folder=tmp_path / "runs", chunk=4)
    assert calls(tmp_path / "log") == 20
    np.testing.assert_array_equal(resumed["draw"], rss.repeat(task, 20, chunk=7)["draw"])


def test_a_folder_is_not_continued_with_another_study(tmp_path):
    rss.repeat(Counted(tmp_path / "a"), 2, folder=tmp_path / "runs")
    with pytest.raises(rss.InputError, match="another study"):
        rss.repeat(Counted(tmp_path / "b"), 2, folder=tmp_path / "runs")
    with pytest.raises(rss.InputError, match="another study"):
        rss.repeat(Counted(tmp_path / "a"), 2, seed=1, folder=tmp_path / "runs")


def test_the_studys_error_reaches_the_caller():
    with ThreadPoolExecutor(2) as pool, pytest.raises(rss.InputError, match="preset"):
        rss.repeat(FilterStudy(start(1), sea_record(1, duration=2.0)[0], preset="none"), 4, executor=pool)


@pytest.mark.filterwarnings("ignore")  # of Dask's own clean-up
def test_dask_gives_the_same_numbers_and_loses_nothing_with_a_worker(cluster, tmp_path):
    from distributed import Client

    where, processes = cluster
    with Client(scheduler_file=where, timeout=120) as client:
        client.wait_for_workers(2, timeout=120)
        pool = client.get_executor(pure=False)
        task, killed = Counted(tmp_path / "log", pause=0.05), []

        def kill_one(done, total):
            if done >= 8 and not killed:
                killed.append(True)
                processes[1].kill()

        far = rss.repeat(task, 40, seed=2, chunk=2, executor=pool, progress=kill_one)
        assert killed and processes[1].wait(10) < 0
        filtered = rss.repeat(study(), 4, seed=3, chunk=2, executor=pool)
    np.testing.assert_array_equal(far["draw"], rss.repeat(Counted(tmp_path / "local"), 40, seed=2)["draw"])
    np.testing.assert_array_equal(filtered["theta"], rss.repeat(study(), 4, seed=3)["theta"])


def test_a_study_that_cannot_be_pickled_needs_no_folder(tmp_path):
    assert rss.repeat(lambda seed: {"a": np.ones(2)}, 3)["a"].shape == (3, 2)
    with pytest.raises(rss.InputError, match="task: cannot be pickled"):
        rss.repeat(lambda seed: {"a": np.ones(2)}, 3, folder=tmp_path)
