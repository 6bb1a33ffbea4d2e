"""Ctrl-C on the command line: whatever a library makes of it, the program stops with one line."""

from __future__ import annotations

import _thread
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import Any


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
