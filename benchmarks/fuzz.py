"""Try to break the package: damaged files, killed processes, full disks, impossible clocks, large work.

    python benchmarks/fuzz.py --write               every attack; about an hour of one core; root for the disk of 1 MB
    python benchmarks/fuzz.py --only "fit ." --tries 500 --keep FOLDER      damaged files of some forms alone
    python benchmarks/fuzz.py --only kill --write                           some attacks alone, renewed in the page
    python benchmarks/fuzz.py --only "large work: simulate" --write         one large work; "large work" is all

Exit status 1 if anything came but an InputError, the right numbers, or (where a digit was changed) numbers that stand
in the file; `--keep` writes those files. `--write` puts the tables into docs/validation/robustness.md.
"""

import argparse
import logging
import resource
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "benchmarks")]

import fuzz_faults
import fuzz_loads
import fuzz_numbers
import hydro_fuzz_targets
import other_fuzz_targets
from fuzzing import attack, table
from validation import commit, publish
from validation import table as markdown

PAGE = ROOT / "docs" / "validation" / "robustness.md"
DAMAGED = "damaged files of every form that is read"
ATTACKS = ["attack", "tries", "processor s"]
LOADS = ["work", "size", "processor s", "memory beyond the start, MB", "result"]


def damaged_files(tries, seed, only, keep):
    """Return the rows of all forms, and the outcomes that should not be."""
    targets = [t for module in (hydro_fuzz_targets, other_fuzz_targets) for t in module.targets()
               if only in t.name or only in DAMAGED]
    outcomes = list(attack(targets, -(-tries // max(1, len(targets))), seed))
    wrong = [o for o in outcomes if not o.allowed]
    for (name, kind, result, detail), count in Counter((o.target, o.kind, o.result, o.detail[:120])
                                                       for o in wrong).most_common(30):
        print(f"{count} x {name}, {kind}: {result} {detail}")
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
        for k, o in enumerate(wrong):
            (keep / f"{k:04d}_{o.target.replace(' ', '_')}_{o.kind}").write_bytes(o.content)
    return table(outcomes, targets), wrong


PROGRAMS = ("WAMIT", "AQWA", "NEMOH", "HAMS", "HydroStar", "OrcaFlex", "Capytaine", "BEMIO", "MSS")


def grouped(rows):
    """Return the rows of all forms by program, for the page; records apart, the package's other files together."""
    sums = {}
    for name, *counts, checksum in rows:
        word = name.partition(" ")[0]
        family = word if word in PROGRAMS else name if word == "record" else "other files of the package"
        before = sums.get((family, checksum), [0] * len(counts))
        sums[family, checksum] = [a + int(b) for a, b in zip(before, counts)]
    return [[family, tried(tries, failed), *counts, checksum]
            for (family, checksum), (tries, *counts, failed) in sums.items()]


def tried(tries, failed):
    """Return the number of tries, and of those that failed if any did."""
    return f"{tries}, failed {failed}" if failed else str(tries)


def processor_time():
    """Return the processor seconds of this process and its children."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def renewed(name, header, rows):
    """Return the table of a section of the page, those of its rows that were measured this time replaced."""
    _, _, rest = PAGE.read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")
    lines = [line.strip("| ").split(" | ") for line in rest.partition("<!-- end -->")[0].splitlines()[2:]]
    key = 2 if name == "loads" else 1       # of a load its size too
    if name == "files":                     # always measured whole
        return markdown(header, rows)
    there = {tuple(line[:key]): line for line in lines} | {tuple(map(str, row[:key])): row for row in rows}
    return markdown(header, there.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=20_000, help="damaged files in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="attacks, forms of files, or large work, whose name holds this")
    parser.add_argument("--keep", type=Path, help="a folder for the files that made a reader fail")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)  # the command line's errors are asked for
    rows, failed = [], 0
    for name, job in {**fuzz_faults.ATTACKS, **fuzz_numbers.ATTACKS}.items():
        if arguments.only in name:
            begin = processor_time()
            tries, wrong = job()
            rows.append([name, tried(tries, len(wrong)), f"{processor_time() - begin:.0f}"])
            failed += len(wrong)
            print(*rows[-1], *wrong[:20], sep="\n    ", flush=True)
            put(arguments.write, "attacks", ATTACKS, rows)
    begin = processor_time()
    forms, wrong = damaged_files(arguments.tries, arguments.seed, arguments.only, arguments.keep)
    failed += len(wrong)
    print(markdown(forms[0], forms[1:]))
    if arguments.only in DAMAGED:
        put(arguments.write, "files", [cell for cell in forms[0] if cell != "failures"], grouped(forms[1:]))
        tries = tried(sum(int(row[1]) for row in forms[1:]), len(wrong))
        put(arguments.write, "attacks", ATTACKS, [[DAMAGED, tries, f"{processor_time() - begin:.0f}"]])
    loads = fuzz_loads.loads(lambda row: put(arguments.write, "loads", LOADS, [row]), arguments.only)
    failed += sum(row[4].startswith("failed") for row in loads)
    return int(bool(failed))


def put(write, name, header, rows):
    """Print a table with the commit of each row; with `write` put its rows into the page."""
    header, rows = [*header, "commit"], [[*row, commit()] for row in rows]
    if rows:
        publish("robustness", write, **{name: renewed(name, header, rows) if write else markdown(header, rows)})


if __name__ == "__main__":
    sys.exit(main())
