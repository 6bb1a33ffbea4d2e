"""The withheld check at full size: sealed cases, diagnosed by a process that cannot read the labels, then scored.

    python benchmarks/blind.py FOLDER [--cases 200] [--score-only] [--so-far]

Writes docs/validation/blind_table.md. Seal, hash and answers stay in FOLDER; FOLDER-sealed holds the labels.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from radiation_ss.gap.blind import run, score
from radiation_ss.gap.blind.runner import seal_of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--score-only", action="store_true", help="open the seal of a run that is done")
    parser.add_argument("--so-far", action="store_true", help="score the cases answered so far")
    parser.add_argument("--no-oracle", action="store_true", help="leave the comparison with the told diagnosis out")
    args = parser.parse_args()
    if not args.score_only:
        run(args.folder, args.cases)
    scored = score(args.folder, oracle=not args.no_oracle, so_far=args.so_far)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    seal = seal_of(args.folder)
    text = (f"# Withheld check: the table\n\n{seal}. Commit at scoring {commit.strip()}.\n"
            f"Rerun: `python benchmarks/blind.py FOLDER --cases {seal.cases}` (a fresh seal each time).\n\n{scored}")
    (ROOT / "docs" / "validation" / "blind_table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
