"""Faults of the machine: killed processes, full disks, two processes at one output, damaged caches, Ctrl-C."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import fault_jobs as jobs
import faults
import numpy as np

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start

ROOT = Path(__file__).resolve().parents[1]
Found = tuple[int, list[str]]
OPERATIONS = 200        # more than any job has
STOPPED = "radiation-ss: interrupted; every output is as it was, or whole"


def written():
    """Return for each thing that is written (its name, what writes the old version, what writes the new one)."""
    pairs = {**jobs.files(), **jobs.folders()}
    found = [(name, lambda folder, write=write: write(folder, 0), lambda folder, write=write: write(folder, 1))
             for name, write in pairs.items()]
    return found + [(name, lambda folder: None, job) for name, job in jobs.resumed().items()]


def versions(old, new):
    """Return the content of a folder with the old, and of one with the new version."""
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        old(Path(one))
        new(Path(two))
        sizes = sorted({path.stat().st_size for path in Path(two).rglob("*") if path.is_file()})
        return faults.content(Path(one)), faults.content(Path(two)), sizes


def killed(kill, places) -> Found:
    """Kill each job at each place, over an older version of its files, and do it again."""
    tries, wrong = 0, []
    for name, old, new in written():
        before, after, sizes = versions(old, new)
        for place in places(sizes):
            with tempfile.TemporaryDirectory() as folder:
                old(Path(folder))
                ended, what = faults.wrong_after_a_kill(new, Path(folder), kill, place, before, after)
            tries += 1
            wrong += [f"{name}, {place}: {what}"] if what else []
            if not ended:
                break
    return tries, wrong


def kill_operations() -> Found:
    """Kill -9 before every single operation on a file: opening, flushing, renaming, making or removing a folder."""
    return killed(faults.killed_at, lambda sizes: range(1, OPERATIONS))


def kill_bytes() -> Found:
    """Killed by the system within a write: at byte 0, at shares of each file, at its last byte."""
    return killed(faults.killed_beyond, lambda sizes: sorted({int(share * size) for size in sizes for share in (
        0.0, 0.01, 0.3, 0.7, 0.99)} - set(sizes)))


@contextmanager
def small_disk(folder: Path, size: str = "1m"):
    """Mount a file system of 1 MB; says False where this is not allowed."""
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True)
    try:
        yield done.returncode == 0
    finally:
        if done.returncode == 0:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def full_disk() -> Found:
    """Write everything to a file system of 1 MB that has 0 to a few blocks left, over an older version of the files."""
    tries, wrong = 0, []
    for name, old, new in written():
        _, after, sizes = versions(old, new)
        for free in sorted({0, 1, *(max(size // 4096 + extra, 0) for size in sizes for extra in (-1, 0))}):
            with tempfile.TemporaryDirectory() as place, small_disk(Path(place)) as mounted:
                if not mounted:
                    return tries, ["a file system of 1 MB cannot be mounted here; run as root"]
                folder = Path(place) / "out"
                folder.mkdir()
                old(folder)
                _fill(Path(place) / "filler", free)
                what = faults.wrong_on_a_full_disk(new, folder, str(folder))
                if what == "no error":      # it had room enough
                    what = None
                elif name in jobs.resumed() and (what is None or what.startswith("left")):
                    (Path(place) / "filler").unlink()       # what is left is taken up again
                    new(folder)
                    what = None if faults.content(folder) == after else "not resumed to the same files"
                tries += 1
                wrong += [f"{name}, {free} blocks free: {what}"] if what else []
    return tries, wrong


def _fill(path: Path, free: int) -> None:
    """Fill a disk but for some blocks of 4 kB."""
    with open(path, "wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
        file.truncate(max(0, path.stat().st_size // 4096 * 4096 - 4096 * free))


def checkpoint_resumed(kills=60) -> Found:
    """A filter that saves itself is killed at every operation of the saves, loaded and run on: the same bits."""
    record, _ = sea_record(2, duration=4.0)
    samples = [{"time": float(t), **{name: float(v[k]) for name, v in record.channels.items()}}
               for k, t in enumerate(record.time)]

    def run(folder):
        path = folder / "filter.npz"
        live = (rss.DualEnKF.load(path) if path.exists()
                else rss.DualEnKF(start(2), seed=2, n_ensemble=16).prepare(record))
        first = int(np.searchsorted(record.time, live.time + 1e-6)) if np.isfinite(live.time) else 0
        for k in range(first, len(samples)):
            live.step(samples[k])
            if k % 40 == 39:
                live.save(path)
        return live

    def digest(live):
        return hashlib.sha256(b"".join(np.asarray(v).tobytes() for _, v in sorted(live.engine.arrays().items()))
                              ).hexdigest()

    with tempfile.TemporaryDirectory() as folder:
        whole = digest(run(Path(folder)))
    wrong, tries = [], 0
    for operation in range(1, kills + 1):
        with tempfile.TemporaryDirectory() as name:
            ended = faults.killed_at(run, Path(name), operation)
            tries += 1
            if digest(run(Path(name))) != whole:
                wrong.append(f"killed at operation {operation}: other bits")
            if not ended:
                break
    return tries, wrong


def blind_answers() -> Found:
    """The process that diagnoses a case of a blind run is killed at each of its writes; the answers are the same."""
    from radiation_ss.blind.worker import carry_out_one

    def answered(folder):
        carry_out_one(folder / "blind", "000", 0.02)

    def said(folder):
        place = folder / "blind" / "answers" / "000"
        return {path.name: re.sub(r'"seconds": [\d.e-]+', "", path.read_text()) for path in place.glob("[!.]*")}

    def made(folder):
        jobs.generate(folder / "blind", 1, 5, kinds=("decays",), groups=("none",), bodies=("heave",))

    wrong, tries = [], 0
    with tempfile.TemporaryDirectory() as name:
        made(Path(name))
        answered(Path(name))
        whole = said(Path(name))
    for operation in range(1, OPERATIONS):
        with tempfile.TemporaryDirectory() as name:
            made(Path(name))
            ended = faults.killed_at(answered, Path(name), operation)
            half = [key for key, text in said(Path(name)).items() if text != whole.get(key)]
            answered(Path(name))
            tries += 1
            if half or said(Path(name)) != whole:
                wrong.append(f"killed at operation {operation}: {half or 'other answers'}")
            if not ended:
                break
    return tries, wrong


def two_processes(rounds=10) -> Found:
    """Two processes write to one output while a third reads it: one of the two versions, whole; studies the same."""
    tries, wrong = 0, []
    for name, write in jobs.files().items():
        with tempfile.TemporaryDirectory() as place:
            folder, good = Path(place), []
            for version in (0, 1):
                with tempfile.TemporaryDirectory() as other:
                    write(Path(other), version)
                    good.append(faults.content(Path(other))[name])
            write(folder, 0)
            children = {_forked(write, (folder, version), rounds) for version in (0, 1)}
            while children:
                children -= {child for child in children if os.waitpid(child, os.WNOHANG)[0]}
                tries += 1
                if _look(folder, name) not in good:
                    wrong.append(f"{name}: neither version")
            if [path.name for path in folder.iterdir()] != [name]:
                wrong.append(f"{name}: left {sorted(path.name for path in folder.iterdir())}")
    for name, job in jobs.resumed().items():
        with tempfile.TemporaryDirectory() as alone, tempfile.TemporaryDirectory() as both:
            job(Path(alone))
            children = [_forked(job, (Path(both),), 1) for _ in range(2)]
            statuses = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
            tries += 1
            if any(statuses) or faults.content(Path(alone)) != faults.content(Path(both)):
                wrong.append(f"{name}: two processes, other files or failed {statuses}")
    return tries, wrong


def _look(folder, name):
    """Return the digest of the file as it stands at one moment."""
    raw = (folder / name).read_bytes()
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / name).write_bytes(raw)
        return faults.content(Path(place))[name]


def _forked(job, arguments, rounds):
    """Do a job some times in a child; return its number."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            for _ in range(rounds):
                job(*arguments)
            status = 0
        finally:
            os._exit(status)
    return child


def damaged_cache(tries=12) -> Found:
    """numba's cache on disk cut, emptied or overwritten: compiled again, the same bits."""
    code = ("import sys; sys.path[:0] = ['tests', '.']\nfrom benchmarks.heave_tank import sea_record, start\n"
            "import radiation_ss as rss\n"
            "e = rss.DualEnKF(start(1), n_ensemble=8).run(sea_record(1, duration=1.0)[0])\n"
            "print(e.force.mean.tobytes().hex())")
    wrong, rng = [], np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as cache:
        def run():
            done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
                                  env={**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": str(ROOT)})
            return done.stdout + done.stderr
        whole = run()
        for k in range(tries):
            for path in [path for path in Path(cache).rglob("*.nb?") if path.is_file() and path.stat().st_size]:
                raw = bytearray(path.read_bytes())
                if k % 4 == 0:
                    raw = raw[:int(rng.integers(len(raw)))]
                elif k % 4 == 1:
                    raw = bytearray()
                elif k % 4 == 2:
                    raw[int(rng.integers(len(raw)))] ^= 255
                else:
                    raw = bytearray(rng.bytes(len(raw)))
                path.write_bytes(raw)
            if run() != whole:
                wrong.append(f"damage {k}: another result, or words on standard error")
    return tries, wrong


def interrupts(tries=24) -> Found:
    """Ctrl-C at random moments of each verb: one line, status 130, and the output whole or as it was."""
    wrong, rng = [], np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        jobs.model(0).write(folder / "model.nc")
        from gap_cases import tank_case

        for k, record in enumerate(tank_case([], 1, duration=15.0)[1]):
            rss.write_record(record, folder / f"r{k}.csv")
        verbs = {"fit": ["model.nc", "--out", "out/fit.json"], "identify": ["model.nc", "r2.csv", "--out", "out/id"],
                 "diagnose": ["model.nc", "r0.csv", "r2.csv", "--out", "out/dia"],
                 "simulate": ["model.nc", "r2.csv", "--out", "out/p.csv"], "plan": ["model.nc", "--out", "out/plan"],
                 "blind": ["run", "out/blind", "--cases", "2", "--seed", "3"]}
        whole: dict[str, set[str]] = {}

        def started(verb, out):
            words = [word.replace("out/", f"{out}/") for word in verbs[verb]]
            return subprocess.Popen([sys.executable, "-m", "radiation_ss", verb, *words], cwd=folder, text=True,
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
                                    env={**os.environ, "PYTHONPATH": str(ROOT)})

        for k in range(tries):
            verb = list(verbs)[k % len(verbs)]
            with tempfile.TemporaryDirectory(dir=folder) as out, tempfile.TemporaryDirectory(dir=folder) as other:
                process = started(verb, out)
                time.sleep(rng.uniform(1.0, 8.0))
                os.killpg(process.pid, signal.SIGINT)       # as a terminal does, to all processes
                said = process.communicate(timeout=120)[1].strip().splitlines()
                left = {path.name for path in Path(out).rglob("*") if path.is_file() and verb != "blind"}
                if left and verb not in whole:
                    started(verb, other).communicate()
                    whole[verb] = {path.name for path in Path(other).rglob("*") if path.is_file()}
                told = process.returncode == 0 or (process.returncode, said) == (130, [STOPPED])
                if not told or left not in (set(), whole.get(verb)):
                    wrong.append(f"{verb}: status {process.returncode}, left {left}, said {said}")
    return tries, wrong


ATTACKS = {
    "kill -9 before every operation on a file, then again: old or new, then the same bits": kill_operations,
    "killed within a write, at many bytes, then again": kill_bytes,
    "a file system of 1 MB that is full, at every write": full_disk,
    "a filter killed at every operation of its saves, resumed bit for bit": checkpoint_resumed,
    "a blind run's diagnosing process killed at every write, resumed": blind_answers,
    "two processes at one output, a third that reads": two_processes,
    "damaged numba cache": damaged_cache, "Ctrl-C at random moments of each verb": interrupts}
