"""Kill -9 and a full disk at every write: the old file or the new one, and the same bits when it is done again."""

import shutil

import fault_jobs
import faults
import pytest

import radiation_ss as rss
from radiation_ss.blind import generate

pytestmark = pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="needs processes that can be forked")


@pytest.mark.parametrize("name", fault_jobs.files())
def test_a_file_is_there_whole_or_as_it_was(name, tmp_path):
    if name.endswith(".parquet"):
        pytest.importorskip("pyarrow")
    write = fault_jobs.files()[name]
    content = []
    for version in (0, 1):
        (tmp_path / str(version)).mkdir()
        write(tmp_path / str(version), version)
        content.append(faults.content(tmp_path / str(version)))
    size = (tmp_path / "1" / name).stat().st_size
    ways = [(faults.killed_at, n) for n in range(1, 20)] + [(faults.killed_beyond, n) for n in (0, size // 2)]
    ended = False
    for number, (kill, place) in enumerate(ways):
        if kill is faults.killed_at and ended:
            continue  # it has fewer operations: killed at a later one it runs to its end again
        folder = tmp_path / f"kill{number}"
        shutil.copytree(tmp_path / "0", folder)
        killed, wrong = faults.wrong_after_a_kill(lambda where: write(where, 1), folder, kill, place, *content)
        assert wrong is None, (kill.__name__, place, wrong)
        ended = not killed
    for limit in (0, size // 2):
        with faults.files_no_longer_than(limit):
            assert faults.wrong_on_a_full_disk(lambda where: write(where, 1), folder, name) is None


@pytest.mark.parametrize("name, operations", [("repeat", range(1, 40, 4)), ("blind run", (1, 6, 15, 24))])
def test_what_is_killed_goes_on_to_the_same_bits(name, operations, tmp_path):
    job = fault_jobs.resumed()[name]
    (tmp_path / "whole").mkdir()
    job(tmp_path / "whole")
    whole = faults.content(tmp_path / "whole")
    for operation in operations:
        folder = tmp_path / str(operation)
        folder.mkdir()
        killed, wrong = faults.wrong_after_a_kill(job, folder, faults.killed_at, operation, {}, whole)
        assert wrong is None, (operation, wrong)
        if not killed:
            break  # it has fewer operations


def test_a_folder_of_results_is_there_whole_or_as_it_was(tmp_path):
    write = fault_jobs.folders()["identification"]
    write(tmp_path, 0)
    before = faults.content(tmp_path)
    for limit in (0, 3000, 30_000):
        with faults.files_no_longer_than(limit):
            assert faults.wrong_on_a_full_disk(lambda where: write(where, 1), tmp_path, tmp_path.name) is None
        assert faults.content(tmp_path) == before


def test_a_blind_run_goes_on_with_its_own_settings_alone(tmp_path):
    folder = tmp_path / "run"
    faults.killed_at(lambda where: generate(where, 2, 7, kinds=("decays",), groups=("none",)), folder, 12)
    assert not (folder / "blind.json").exists()
    with pytest.raises(rss.InputError, match=r"other settings was begun here \(cases\)"):
        generate(folder, 3, 7, kinds=("decays",), groups=("none",))
    with pytest.raises(rss.InputError, match=r"\(seed\)"):
        generate(folder, 2, 8, kinds=("decays",), groups=("none",))
    assert generate(folder, 2, kinds=("decays",), groups=("none",)).cases == 2
