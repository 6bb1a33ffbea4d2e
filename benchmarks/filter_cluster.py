"""How much faster `repeat` and `blind run` are on two Dask workers than on one, and whether the answers are the same.

    OMP_NUM_THREADS=1 python benchmarks/filter_cluster.py [--runs 400] [--cases 6] [--write]

Scheduler and workers are processes of their own on loopback.
"""

import contextlib
import hashlib
import io
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

from distributed import Client
from heave_tank import sea_record, tank
from validation import ROOT, arguments, publish, table

import radiation_ss as rss
from radiation_ss.blind import generate, run
from radiation_ss.blind.seal import sealed_folder
from radiation_ss.filter import FilterStudy


def spent():
    """Return processor time of this process and of those that it started and saw end [s]."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


@contextmanager
def cluster(count, folder):
    """Yield a client of a scheduler with so many workers; end them all."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "benchmarks"), *sys.path[1:]])}
    where, quiet = str(folder / f"scheduler{count}.json"), {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    python = [sys.executable, "-m"]
    commands = [[*python, "distributed.cli.dask_scheduler", "--host", "tcp://127.0.0.1", "--port", "0",
                 "--no-dashboard", "--scheduler-file", where]]
    commands += [[*python, "distributed.cli.dask_worker", "--scheduler-file", where, "--nthreads", "1", "--no-nanny",
                  "--no-dashboard", "--host", "127.0.0.1", "--local-directory", str(folder / f"worker{count}-{i}")]
                 for i in range(count)]
    processes = []
    try:
        for command in commands:
            processes.append(subprocess.Popen(command, cwd=folder, env=environment, **quiet))
            while not Path(where).exists() and processes[-1].poll() is None:
                time.sleep(0.1)
        with Client(scheduler_file=where, timeout=120) as client:
            client.wait_for_workers(count, timeout=120)
            yield client
    finally:
        for process in processes:
            process.kill()
            process.wait()


def digest(results):
    """Return a hash of the arrays of a study."""
    return hashlib.sha256(b"".join(results[name].tobytes() for name in sorted(results))).hexdigest()


def answered(folder):
    """Return a hash of the answers of a blind run, without the time they took."""
    answers = [json.loads(path.read_text()) for path in sorted(folder.glob("answers/*/answer.json"))]
    reports = [path.read_text() for path in sorted(folder.glob("answers/*/report.json"))]
    return hashlib.sha256(json.dumps([[{**a, "seconds": 0} for a in answers], reports]).encode()).hexdigest()


def repeated(runs):
    study = FilterStudy(tank(), sea_record(1)[0], preset="paper")

    def job(pool, folder):
        return digest(rss.repeat(study, runs, chunk=10, executor=pool))

    return job


def blind(cases, folder):
    with contextlib.redirect_stdout(io.StringIO()):
        generate(folder / "cases", cases, 1, kinds=("decays",), bodies=("heave",), mix="nulls")

    def job(pool, name):
        place = folder / name
        shutil.copytree(folder / "cases", place)
        shutil.copytree(sealed_folder(folder / "cases"), sealed_folder(place))
        with contextlib.redirect_stdout(io.StringIO()):
            run(place, executor=pool)
        return answered(place)

    return job


def measure(jobs, folder):
    """Return for each job the rows of one and two workers."""
    found = {name: [] for name in jobs}
    for count in (1, 2):
        with cluster(count, folder) as client:
            for name, job in jobs.items():
                pool = client.get_executor(pure=False)
                job_name = f"{name.split()[0].strip('`')}{count}"
                before, wall = client.run(spent), time.perf_counter()
                answer = job(pool, job_name)
                wall = time.perf_counter() - wall
                after = client.run(spent)
                found[name].append((wall, sorted(after[key] - before[key] for key in after), answer))
    return found


def main(write, runs, cases):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        jobs = {f"`repeat`, {runs} runs of Fig. 9": repeated(runs),
                f"`blind run`, {cases} cases": blind(cases, folder)}
        next(iter(jobs.values()))(None, "")  # compiles, so that no worker has to
        found = measure(jobs, folder)
    rows = []
    for name, ((wall_1, spent_1, answer_1), (wall_2, spent_2, answer_2)) in found.items():
        rows.append([name, f"{wall_1:.1f}", f"{wall_2:.1f}", f"{wall_1 / wall_2:.2f}", f"{sum(spent_1):.1f}",
                     " + ".join(f"{one:.1f}" for one in spent_2), f"{sum(spent_1) / max(spent_2):.2f}",
                     "yes" if answer_1 == answer_2 else "no"])
    publish("filter_speed", write, cluster=table(
        ["job", "one worker, wall clock [s]", "two [s]", "ratio", "one worker, processor [s]", "two [s]",
         "ratio to the busier", "same answers"], rows),
        cluster_load=f"Load while this ran: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores.")


if __name__ == "__main__":
    main(*arguments(__doc__, "filter_speed", runs=400, cases=6))
