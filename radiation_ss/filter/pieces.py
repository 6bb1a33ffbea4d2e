"""Long work in short pieces: a generator that yields after each piece and returns its result at the end."""

from __future__ import annotations

from collections.abc import Generator
from typing import Generic, TypeVar

Result = TypeVar("Result")
Pieces = Generator[None, None, Result]


def finish(work: Pieces[Result]) -> Result:
    """Do all of the work at once."""
    return Job(work).run(None)  # type: ignore[return-value]


class Job(Generic[Result]):
    """Work that is done a few pieces at a time; what comes out does not depend on how many."""

    def __init__(self, work: Pieces[Result]) -> None:
        self.work, self.done, self.finished = work, 0, False
        self.result: Result | None = None

    def run(self, pieces: int | None) -> Result | None:
        """Do at most some pieces, all that are left for None; return the result once there is one."""
        while not self.finished and (pieces is None or pieces > 0):
            try:
                next(self.work)
            except StopIteration as end:
                self.result, self.finished = end.value, True
            self.done += 1
            pieces = None if pieces is None else pieces - 1
        return self.result
