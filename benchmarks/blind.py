"""The withheld check at full size: sealed cases, diagnosed by a process that cannot read the labels, then scored.

    python benchmarks/blind.py FOLDER... [--cases 200] [--score-only] [--so-far]

Writes the table into docs/validation/blind.md. Seal, hash and answers stay in FOLDER; FOLDER-sealed holds the labels.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.pages import write_table
from radiation_ss.gap.blind import run, score
from radiation_ss.gap.blind.runner import seal_of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--cases", type=int, default=200, help="in each folder")
    parser.add_argument("--score-only", action="store_true", help="open the seal of a run that is done")
    parser.add_argument("--so-far", action="store_true", help="score the cases answered so far")
    parser.add_argument("--no-oracle", action="store_true", help="leave the comparison with the told diagnosis out")
    args = parser.parse_args()
    if not args.score_only:
        for folder in args.folders:
            run(folder, args.cases)
    scored = score(*args.folders, oracle=not args.no_oracle, so_far=args.so_far)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    seals = "\n".join(f"* {seal_of(folder)}" for folder in args.folders)
    text = (f"{seals}\n\nCommit at scoring {commit.strip()}. Rerun: "
            f"`python benchmarks/blind.py FOLDER --cases {args.cases}` (a fresh seal each time).\n\n{scored}")
    write_table(ROOT / "docs" / "validation" / "blind.md", text)
    print(text)


if __name__ == "__main__":
    main()
