"""What the command line says, where it writes, and how it ends: by an error, or by Ctrl-C.

Results go to standard output; errors, warnings, notes and progress are log records of one line on standard error.
"""

import _thread
import argparse
import json
import logging
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import Any, NoReturn

from radiation_ss.errors import InputError, RadiationError

LOG = logging.getLogger("radiation_ss")
NOTE = logging.INFO + 5  # shown unless --quiet; progress, at INFO, only with --verbose
logging.addLevelName(NOTE, "NOTE")
Tell = Callable[[str, float], None]
INTERRUPTED = 130  # the shell's status of a program that Ctrl-C ended


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, as all other messages of the program."""

    def error(self, message: str) -> NoReturn:
        """Leave with status 2 and one line."""
        if message.startswith("unrecognized arguments: ") and "arguments: -" not in message:
            message += " (an option that may be repeated takes one value each time: --withhold A --withhold B)"
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


class OneLine(logging.Formatter):
    """Log records as `radiation-ss: text`, warnings marked."""

    def format(self, record: logging.LogRecord) -> str:
        """Return one line."""
        mark = "warning: " if record.levelno == logging.WARNING else ""
        return f"radiation-ss: {mark}{' '.join(record.getMessage().split())}"


@contextmanager
def log_to_stderr(args: argparse.Namespace) -> Iterator[None]:
    """Show log records on standard error, as --verbose and --quiet ask, inside the block."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(OneLine())
    before = LOG.level
    LOG.setLevel(logging.INFO if args.verbose else logging.ERROR if args.quiet else NOTE)
    LOG.addHandler(handler)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(before)


def note(text: object) -> None:
    """Say what a reader of the result should know."""
    LOG.log(NOTE, "%s", text)


def warn(message: Warning | str, *_: object) -> None:
    """Show a warning without the place in the sources; stands in for `warnings.showwarning`."""
    LOG.warning("%s", message)


def say(args: argparse.Namespace, result: Any, text: str) -> None:
    """Print the result: JSON where it was asked for, else text."""
    show(json.dumps(result, indent=1, default=float) if args.json else text)


def show(text: str) -> None:
    """Print a text at once: what a full or closed standard output says must not come after the program's end."""
    if sys.stdout is None:
        LOG.warning("standard output is closed; the result is not printed")
        return
    try:
        print(text, flush=True)
    except OSError as error:
        error.filename = "standard output"
        raise


def check_file(path: Path | None, suffixes: tuple[str, ...] = ()) -> None:
    """Refuse an output file that could not be written, before any work is done; None is none."""
    if path is None:
        return
    if path.is_dir():
        raise InputError(f"--out {path}: a folder; the name of a file is needed")
    if suffixes and not path.name.endswith(suffixes):
        raise InputError(f"--out {path}: the name must end with one of {', '.join(suffixes)}")
    if not path.parent.is_dir():
        raise InputError(f"--out {path}: the folder {path.parent} does not exist")
    _check_writable(path.parent, path)


def check_folder(path: Path | None) -> None:
    """Refuse an output folder that could not be written, before any work is done; it is not made here. None is none."""
    if path is None:
        return
    nearest = next(place for place in (path.absolute(), *path.absolute().parents) if place.exists())
    if not nearest.is_dir():
        raise InputError(f"--out {path}: {nearest} is a file; the name of a folder is needed")
    _check_writable(nearest, path)


def _check_writable(folder: Path, path: Path) -> None:
    """Refuse a folder that takes no file; only the attempt shows it (permissions, a read-only or virtual system)."""
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"--out {path}: nothing can be written into {folder} ({error.strerror or error})") from None


@contextmanager
def progress_bar(args: argparse.Namespace, what: str = "") -> Iterator[Tell | None]:
    """Yield a callable(text, share) that tells of progress of `what`; None where nobody is watching."""
    if args.verbose:
        yield log_stages(what)
        return
    if args.quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None if what else 1.0)
        yield lambda text, share: bar.update(task, description=text, completed=share, total=1.0)


def log_stages(what: str) -> Tell:
    """Return a callable(text, share) that logs each text once."""
    told: set[str] = set()

    def tell(text: str, share: float) -> None:
        if text not in told:
            told.add(text)
            LOG.info("%s (%.0f %%)", text, 100.0 * share)

    if what:
        LOG.info("%s", what)
    return tell


def failed(error: BaseException, interrupted: bool) -> int:
    """Say why a verb stopped, in one line; return the exit status."""
    status, text = 2 if isinstance(error, (InputError, OSError)) else 1, str(error)
    if interrupted or isinstance(error, KeyboardInterrupt):
        status, text = INTERRUPTED, "interrupted; every output is as it was, or whole"
    elif not isinstance(error, Exception):
        raise error
    elif isinstance(error, BrokenPipeError):  # who reads the output, `head` say, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 0
    elif isinstance(error, OSError) and error.strerror:
        text = f"{str(error.filename)[:300]}: {error.strerror}" if error.filename else error.strerror
    elif not isinstance(error, (RadiationError, OSError)):
        at = traceback.extract_tb(error.__traceback__)[-1]
        text = (f"internal error: {type(error).__name__}: {error} ({Path(at.filename).name}, line {at.lineno}); "
                "please report it with the command")
    LOG.error("%s", text)
    return status


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
    """Watch for Ctrl-C in the block, not in a thread nor where the caller does; at its end a `program` ignores it."""
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
