"""The command line: radiation-ss VERB ... (see `radiation-ss --help`)."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

from radiation_ss.cli.arguments import parser
from radiation_ss.cli.interrupts import interrupts
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
        except BaseException as error:
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
