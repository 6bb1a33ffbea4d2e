"""Tasks of a blind run in diagnosing processes: python -m radiation_ss.blind.worker FOLDER TASK... [--attached]."""

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import made_folder, write_whole
from radiation_ss.blind.seal import lock_out, seal_of, sealed_folder
from radiation_ss.body.model import Model
from radiation_ss.errors import RadiationError
from radiation_ss.parallel import spread
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import read_record

ATTEMPTS = 2  # a process that somebody kills is started once more
TASKS = 4     # in one process at most: starting it costs some seconds, a diagnosis ten
# Ctrl-C in a terminal reaches this process too: it ends without a traceback, and its parent says why.
WORKER = """import signal
signal.signal(signal.SIGINT, signal.SIG_DFL)
from radiation_ss.blind.worker import main
main()"""
# One thread each: sums in the same order, so the same digits, however many processes share the machine.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def in_own_process(folder: Path, tasks: Sequence[str], attempt: int) -> str:
    """Do tasks in a process that ends with this one; return what it said. `attempt`: for caching executors."""
    command = [sys.executable, "-c", WORKER, str(folder), *tasks, "--attached"]
    environment = {**os.environ, **THREADS, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True) as process:
        return process.stdout.read() if process.stdout else ""


def carry_out(folder: Path, tasks: Sequence[str], executor: Executor | None = None,
              job: Callable[[Path, Sequence[str], int], str] = in_own_process) -> None:
    """Do the tasks that are not done, each process locked out of the labels; print a line for each.

    Every result is a file, so a killed process or worker loses only what it had in hand, and the next call goes on.
    """
    folder = folder.resolve()
    left = unfinished(folder, tasks)
    for attempt in range(ATTEMPTS):
        size = max(1, min(TASKS, len(left) // 16))
        jobs = [(folder, tuple(left[i:i + size]), attempt) for i in range(0, len(left), size)]
        for _, said in spread(job, jobs, executor):
            print(said, end="", flush=True)
        left = unfinished(folder, left)
    if left:
        raise RadiationError(f"{folder}: {left[0]} and {len(left) - 1} more have no result, for their process was "
                             "ended; run again to go on")


def unfinished(folder: Path, tasks: Sequence[str]) -> list[str]:
    """Return the tasks without a result."""
    return [task for task in tasks if not result_file(folder, task).exists()]


def carry_out_one(folder: Path, task: str, tolerance: float) -> str:
    """Do one task, "003" or, told the effect's name, "003:quadratic_drag"; any failure becomes the case's status."""
    name, _, told = task.partition(":")
    case, out = folder / "cases" / name, result_file(folder, task)
    made_folder(out.parent)
    result: dict[str, Any] = {}
    try:
        status = diagnosed(case, out, told, tolerance, result)
    except Exception as error:  # a diagnosis of any kind may fail; the other cases of the run have to go on
        status = result["error"] = f"{type(error).__name__}: {error}"
    write_whole(out, json.dumps(result))
    return status.splitlines()[0]


def result_file(folder: Path, task: str) -> Path:
    """Return the file that is there when a task is done."""
    name, _, told = task.partition(":")
    return folder / "oracle" / f"{name}.json" if told else folder / "answers" / name / "answer.json"


def diagnosed(case: Path, out: Path, told: str, tolerance: float, result: dict[str, Any]) -> str:
    """Diagnose a case, maybe told its effect's name, put predictions and seconds into the result; return a status."""
    import radiation_ss as rss

    model = rss.read_model(case / "MODEL.nc")
    records = [read_record(path) for path in sorted(case.glob("*.csv")) if path.name != "unseen.csv"]
    known: dict[str, Any] = {"effects": [told], "present": [told]} if told else {}
    began = time.process_time()
    diagnosis = rss.diagnose(model, records, tolerance=tolerance, seed=0, **known)
    if not told:
        result["seconds"] = time.process_time() - began
    corrected = out.with_name(f"{case.name}-corrected.json" if told else "corrected.json")
    diagnosis.corrected.write(corrected)
    found = predictions(model, corrected, read_record(case / "unseen.csv"))
    if told:
        result["oracle"] = found["corrected"]
        return f"told {told}"
    report = diagnosis.to_dict()
    write_whole(out.with_name("report.json"), json.dumps(report))
    result["predictions"] = found
    return str(report["verdict"]["status"])


def predictions(model: Model, corrected: Path, unseen: Record) -> dict[str, list[list[float]]]:
    """Return the displacements of the unseen test, nominal and corrected; nothing where its force is unknown."""
    import radiation_ss as rss
    from radiation_ss.simulation.corrected_files import read_corrected

    if unseen.kind == "motion-only":
        return {}
    effects = read_corrected(corrected, model).actives(model)
    return {name: np.asarray(rss.simulate(model, unseen, items).outputs)[: model.n].tolist()
            for name, items in (("nominal", ()), ("corrected", effects))}


def end_with_parent() -> None:
    """Wait for the end of standard input, which only the end of the parent brings, and end."""
    os.read(0, 1)
    os._exit(1)


def main() -> None:
    """Do the tasks that are not done, locked out of the sealed labels."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--attached", action="store_true")
    args = parser.parse_args()
    lock_out(sealed_folder(args.folder))
    if args.attached:
        threading.Thread(target=end_with_parent, daemon=True).start()
    tolerance = seal_of(args.folder).tolerance
    for task in args.tasks:
        if not result_file(args.folder, task).exists():
            print(f"{task}: {carry_out_one(args.folder, task, tolerance)}", flush=True)


if __name__ == "__main__":
    main()
