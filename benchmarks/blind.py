"""The withheld check at full size: sealed cases, diagnosed by a process that cannot read the labels, then scored.

    python benchmarks/blind.py FOLDER... [--cases 200] [--mix standard] [--kinds ...] [--workers 2] [--score-only]
        [--drift .03] [--so-far] [--no-page]

Writes the table and the row of the seal into docs/validation/blind.md. Seal, hash and answers stay in FOLDER;
FOLDER-sealed holds the labels. `--mix nulls` hides nothing, each kind of record and body in turn: false alarms alone.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.pages import write_table
from radiation_ss.blind import run, score
from radiation_ss.blind.causes import ALL
from radiation_ss.blind.seal import read_run, seal_of

PAGE = ROOT / "docs" / "validation" / "blind.md"
END_OF_SEALS = "<!-- end of seals -->"


def log_seals(folders: Sequence[Path], commit: str) -> None:
    """Add one row for each seal that the page does not list yet: cases, answers, when opened, by which program."""
    content = PAGE.read_text(encoding="utf-8")
    before, marked, after = content.partition(END_OF_SEALS)
    if not marked:
        raise ValueError(f"{PAGE}: the mark {END_OF_SEALS} is missing")
    number = max(int(word) for line in before.splitlines() if line.startswith("| ")
                 and (word := line.split("|")[1].strip()).isdigit())
    now = time.strftime("%Y-%m-%d, %H:%M UTC", time.gmtime())
    for folder in folders:
        seal, cases = seal_of(folder), read_run(folder, so_far=True)
        if seal.sha256[:12] in before:
            continue
        number += 1
        nothing = sum(case.group == "none" for case in cases)
        before += (f"| {number} | {seal.cases}, of them {len(cases)} answered, {nothing} with nothing hidden | {now} | "
                   f"sealed {seal.sealed}, labels {seal.sha256[:12]}...; commit {commit} |\n")
    PAGE.write_text(before + marked + after, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--cases", type=int, default=200, help="in each folder")
    parser.add_argument("--mix", default="standard",
                        help="standard, nulls, or shares of the classes, as in none=.5,single=.5")
    parser.add_argument("--kinds", nargs="+", default=list(ALL), choices=ALL, help="of records, in turn")
    parser.add_argument("--drift", type=float, help="share of the motion by which every sensor's zero wanders")
    parser.add_argument("--no-page", action="store_true", help="print the table only")
    parser.add_argument("--score-only", action="store_true", help="open the seal of a run that is done")
    parser.add_argument("--so-far", action="store_true", help="score the cases answered so far")
    parser.add_argument("--no-oracle", action="store_true", help="leave the comparison with the told diagnosis out")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes that diagnose (default: 1)")
    args = parser.parse_args()
    with ThreadPoolExecutor(args.workers) as executor:
        if not args.score_only:
            for folder in args.folders:
                run(folder, args.cases, mix=args.mix, kinds=args.kinds, drift=args.drift, executor=executor)
        scored = score(*args.folders, oracle=not args.no_oracle, so_far=args.so_far, executor=executor)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    seals = "\n".join(f"* {seal_of(folder)}" for folder in args.folders)
    text = (f"{seals}\n\nCommit at scoring {commit.strip()}. Rerun: "
            f"`python benchmarks/blind.py FOLDER --cases N [--mix nulls]` (a fresh seal each time).\n\n{scored}")
    if not args.no_page:
        write_table(PAGE, text.partition("\n### records")[0])  # the page has the table of all cases, the output all
        log_seals(args.folders, commit.strip())
    print(text)


if __name__ == "__main__":
    main()
