"""A blind run over an executor: the same answers for any number of workers, none lost, errors kept with their case."""

import json
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from radiation_ss import blind
from radiation_ss.blind import sealed_folder
from radiation_ss.errors import RadiationError

ROOT = Path(__file__).parents[1]


def answers(folder):
    """What a run answered, without the time it took."""
    found = {}
    for place in sorted((folder / "answers").iterdir()):
        result = json.loads((place / "answer.json").read_text())
        result.pop("seconds", None)
        if "error" in result:
            result["error"] = result["error"].replace(str(folder), "")
        files = [(place / name).read_text() for name in ("report.json", "corrected.json") if (place / name).is_file()]
        found[place.name] = (result, *files)
    return found


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A run of two cases, one record each, one process after the other; the unseen test of case 001 is no record."""
    folder = tmp_path_factory.mktemp("blind") / "run"
    blind.generate(folder, 2, 12, kinds=("decays",), groups=("single", "none"), bodies=("heave",))
    for record in folder.glob("cases/*/decay[12].csv"):
        record.unlink()
    (folder / "cases" / "001" / "unseen.csv").write_text("this is\nno record\n")
    blind.run(folder)
    return folder


@pytest.fixture
def again(alone, tmp_path):
    """The same cases without answers."""
    folder = tmp_path / "run"
    shutil.copytree(alone, folder, ignore=shutil.ignore_patterns("answers", "oracle"))
    shutil.copytree(sealed_folder(alone), sealed_folder(folder))
    return folder


def test_an_error_in_the_prediction_is_kept_with_its_case(alone):
    done = answers(alone)
    assert [name for name, (result, *_) in done.items() if "error" in result] == ["001"]
    assert all(set(result["predictions"]) == {"nominal", "corrected"}
               for name, (result, *_) in done.items() if name != "001")


def test_two_workers_answer_and_are_told_as_one_is(alone, again):
    with ThreadPoolExecutor(2) as pool:
        blind.run(again, executor=pool)
        spread = blind.score(again, oracle=True, executor=pool)
    assert answers(again) == answers(alone)
    by_one = blind.score(alone, oracle=True)
    told = [sorted((p.name, p.read_text().replace(str(folder), "")) for p in (folder / "oracle").iterdir())
            for folder in (again, alone)]
    assert told[0] == told[1] and told[0]
    assert [row for row in spread.rows if row.count] == [row for row in by_one.rows if row.count]


@pytest.mark.filterwarnings("ignore")  # of Dask's own clean-up
def test_dask_gives_the_same_answers_and_a_killed_worker_loses_none(alone, again, cluster):
    from distributed import Client

    where, processes = cluster

    def kill_one():
        while not list(again.glob("answers/*/answer.json")):
            time.sleep(0.02)
        processes[1].kill()

    with Client(scheduler_file=where, timeout=120) as client:
        client.wait_for_workers(2, timeout=120)
        killer = threading.Thread(target=kill_one)
        killer.start()
        blind.run(again, executor=client.get_executor())
        killer.join(10)
    assert processes[1].wait(10) < 0
    assert answers(again) == answers(alone)


def finish(folder, tasks):
    for task in tasks:
        path = blind.result_file(folder, task)
        path.parent.mkdir(parents=True)
        path.write_text("{}")


def test_a_killed_process_is_started_again_and_answers_are_kept(tmp_path):
    (tmp_path / "run").mkdir()
    calls = []

    def killed_at_first(folder, tasks, attempt):
        calls.append((tasks, attempt))
        if attempt or tasks != ("001",):
            finish(folder, tasks)
        return ""

    blind.carry_out(tmp_path / "run", ["000", "001", "002"], job=killed_at_first)
    assert calls == [(("000",), 0), (("001",), 0), (("002",), 0), (("001",), 1)]


def test_a_task_whose_process_ends_every_time_is_reported_after_the_others_are_done(tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(RadiationError, match="000 and 0 more have no result"):
        blind.carry_out(tmp_path / "run", ["000", "001"],
                        job=lambda folder, tasks, attempt: "" if tasks == ("000",) else finish(folder, tasks) or "")
    assert blind.unfinished(tmp_path / "run", ["000", "001"]) == ["000"]


def test_a_diagnosing_process_ends_with_the_one_that_started_it(again):
    command = [sys.executable, "-m", "radiation_ss.blind.worker", str(again), "000", "--attached"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdin.close()
        assert process.wait(60) == 1
    assert blind.unfinished(again, ["000"]) == ["000"]


def test_the_process_of_a_job_is_locked_out_of_the_labels(again):
    """A case whose records are a link to the sealed motion is refused, whoever carries it out."""
    case = again / "cases" / "000"
    (case / "decay0.csv").unlink()
    (case / "decay0.csv").symlink_to(sealed_folder(again) / "000" / "unseen.csv")
    shutil.rmtree(again / "cases" / "001")
    with ThreadPoolExecutor(1) as pool:
        blind.run(again, executor=pool)
    assert "decay0.csv: sealed" in answers(again)["000"][0]["error"]
