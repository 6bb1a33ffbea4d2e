"""Jobs on any executor: handed out a bounded number ahead, taken back as they are ready."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any, TypeVar

Result = TypeVar("Result")
AHEAD = 64  # jobs handed to an executor ahead of what has come back


def spread(function: Callable[..., Result], jobs: Iterable[tuple[Any, ...]], executor: Executor | None = None,
           ) -> Iterator[tuple[int, Result]]:
    """Yield (number of the job, function(*job)) as they are ready; in turn and in this process without an executor.

    Jobs that have not begun are cancelled where a job raises or the caller stops.
    """
    if executor is None:
        for i, job in enumerate(jobs):
            yield i, function(*job)
        return
    waiting, flying = enumerate(jobs), dict[Future, int]()
    try:
        while True:
            for i, job in waiting:
                flying[executor.submit(function, *job)] = i
                if len(flying) >= AHEAD:
                    break
            if not flying:
                return
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                yield flying.pop(future), future.result()
    finally:
        for future in flying:
            future.cancel()
