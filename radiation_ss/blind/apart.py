"""Tasks of a blind run in diagnosing processes of their own, started here or by the workers of any executor."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

from radiation_ss.blind.diagnosing import result_file
from radiation_ss.errors import RadiationError
from radiation_ss.parallel import spread

ATTEMPTS = 2  # a process that somebody kills is started once more
TASKS = 4     # in one process at most: starting it costs some seconds, a diagnosis ten
# Ctrl-C in a terminal reaches this process too: it ends without a traceback, and its parent says why.
WORKER = """import signal
signal.signal(signal.SIGINT, signal.SIG_DFL)
from radiation_ss.blind.worker import main
main()"""
# One thread each: sums in the same order, so the same digits, however many processes share the machine.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def carry_out(folder: Path, tasks: Sequence[str], executor: Executor | None = None) -> None:
    """Do the tasks that are not done, each process locked out of the labels; print a line for each.

    Every result is a file, so a killed process or worker loses only what it had in hand, and the next call goes on.

    Raises
    ------
    RadiationError
        If a task has no result in the end because its process was ended twice.
    """
    folder = folder.resolve()
    left = unfinished(folder, tasks)
    for attempt in range(ATTEMPTS):
        size = max(1, min(TASKS, len(left) // 16))
        jobs = [(folder, tuple(left[i:i + size]), attempt) for i in range(0, len(left), size)]
        for _, said in spread(in_own_process, jobs, executor):
            print(said, end="", flush=True)
        left = unfinished(folder, left)
    if left:
        raise RadiationError(f"{folder}: {left[0]} and {len(left) - 1} more have no result, for their process was "
                             "ended; run again to go on")


def unfinished(folder: Path, tasks: Sequence[str]) -> list[str]:
    """Return the tasks without a result."""
    return [task for task in tasks if not result_file(folder, task).exists()]


def in_own_process(folder: Path, tasks: Sequence[str], attempt: int) -> str:
    """Do some tasks in a new process, which ends when this one does; return what it said.

    `attempt` makes a second attempt another call for executors that remember calls.
    """
    command = [sys.executable, "-c", WORKER, str(folder), *tasks, "--attached"]
    environment = {**os.environ, **THREADS, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True) as process:
        return process.stdout.read() if process.stdout else ""
