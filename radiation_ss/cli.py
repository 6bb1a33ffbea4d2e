"""The command line: radiation-ss VERB ... (see `radiation-ss --help`)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from radiation_ss.errors import InputError


def parser() -> argparse.ArgumentParser:
    """Return the argument parser with all verbs."""
    from radiation_ss import __version__

    top = argparse.ArgumentParser(prog="radiation-ss", description="Radiation subsystems: fit, identify, diagnose.")
    top.add_argument("--version", action="version", version=__version__)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 when done, 2 for bad input, 1 for a failure of ours."""
    try:
        parser().parse_args(argv)
    except InputError as error:
        print(f"radiation-ss: {error}", file=sys.stderr)
        return 2
    return 0
