"""The command line: radiation-ss VERB ... (see `radiation-ss --help`)."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import Any

from radiation_ss.cli.arguments import parser
from radiation_ss.cli.output import complain, log_to_stderr, note, warn
from radiation_ss.errors import InputError, RadiationError

__all__ = ["main", "parser"]

INTERRUPTED = 130  # the shell's status of a program that Ctrl-C ended


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 when done, 2 for bad input, 1 for an internal error, 130 after Ctrl-C."""
    args = parser().parse_args(argv)
    args.notes = []
    with log_to_stderr(args), warnings.catch_warnings(), interrupts(argv is None) as watch:
        warnings.showwarning = warn  # type: ignore[assignment]
        try:
            args.action(args)
            watch.over = True
        except BaseException as error:  # the program's end: each becomes a line and a status, or goes on from failed()
            watch.over = True
            return failed(error, watch.seen)
        for text in args.notes:
            note(text)
    return 0


def failed(error: BaseException, interrupted: bool) -> int:
    """Say why a verb stopped, in one line; return the exit status."""
    if interrupted or isinstance(error, KeyboardInterrupt):
        complain("interrupted; every output is as it was, or whole")
        return INTERRUPTED
    if not isinstance(error, Exception):
        raise error
    if isinstance(error, BrokenPipeError):  # who reads the output, `head` say, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 0
    if isinstance(error, OSError) and error.strerror:
        complain(f"{str(error.filename or '')[:300]}: {error.strerror}")
        return 2
    if isinstance(error, (InputError, OSError)):
        complain(error)
        return 2
    if isinstance(error, RadiationError):
        complain(error)
        return 1
    at = traceback.extract_tb(error.__traceback__)[-1]
    complain(f"internal error: {type(error).__name__}: {error} ({Path(at.filename).name}, line {at.lineno}); "
             "please report it with the command")
    return 1


class Interrupted(KeyboardInterrupt):
    """Ctrl-C. A class of its own, because Python ends by the signal where exec() saw a bare KeyboardInterrupt."""


class Interrupts:
    """Whether Ctrl-C was pressed, and whether it still changes anything."""

    seen = False
    over = False

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Remember the interrupt and raise it; compiled code may turn it into another error."""
        if not self.over:
            self.seen = True
            raise Interrupted

    def repeat(self, lost: Any) -> None:
        """Interrupt again a moment later where the interrupt fell into code that can raise nothing (`__del__`)."""
        if isinstance(lost.exc_value, Interrupted):
            Timer(0.01, _thread.interrupt_main).start()
        else:
            sys.__unraisablehook__(lost)


@contextmanager
def interrupts(program: bool) -> Iterator[Interrupts]:
    """Watch for Ctrl-C inside the block; not in a thread, nor where the caller has a handler.

    After the block a `program` is at its end, where Ctrl-C has nothing to stop and is ignored.
    """
    watch, hook = Interrupts(), sys.unraisablehook
    if (current_thread() is not main_thread()
            or signal.getsignal(signal.SIGINT) is not signal.default_int_handler):
        yield watch
        return
    signal.signal(signal.SIGINT, watch.stop)
    sys.unraisablehook = watch.repeat
    try:
        yield watch
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if program else signal.default_int_handler)
        sys.unraisablehook = hook
