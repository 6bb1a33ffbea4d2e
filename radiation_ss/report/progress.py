"""Progress: a bar on a terminal, log records with --verbose, silence elsewhere."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Tell = Callable[[str, float], None]
LOG = logging.getLogger("radiation_ss")


@contextmanager
def progress_bar(args: argparse.Namespace, what: str = "") -> Iterator[Tell | None]:
    """Yield a callable(text, share) that tells of progress; None where nobody is watching.

    Parameters
    ----------
    args : Namespace
        With `quiet` and `verbose`.
    what : str
        Of work whose share is unknown: shown as long as it runs.
    """
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
