"""Jobs on any executor, handed out a bounded number ahead; linear algebra held to one core."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

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


P = ParamSpec("P")
R = TypeVar("R")


def on_one_core(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with linear algebra held to one thread while it runs; the caller's setting comes back."""
    @wraps(function)
    def limited(*args: P.args, **options: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **options)

    return limited
