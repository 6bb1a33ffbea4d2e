"""Damage files many times: what do the readers make of it?

    python benchmarks/fuzz.py hydro 20000 [--seed 0] [--keep FOLDER]

Each target gets an equal share of the tries. Exit status 1 if anything but an InputError, the right numbers, or (where
a digit was changed) other numbers came of one; `--keep` writes those files.
"""

import argparse
import logging
import sys
from collections import Counter
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from fuzzing import attack, table


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", help="module tests/<what>_fuzz_targets.py with a function targets()")
    parser.add_argument("tries", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="targets whose name holds this")
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    logging.disable(logging.ERROR)
    targets = [t for t in import_module(f"{arguments.what}_fuzz_targets").targets() if arguments.only in t.name]
    outcomes = list(attack(targets, max(1, arguments.tries // len(targets)), arguments.seed))
    for row in table(outcomes):
        print("| " + " | ".join(row) + " |")
    failures = [o for o in outcomes if not o.allowed]
    for (name, kind, result, detail), count in Counter((o.target, o.kind, o.result, o.detail[:120])
                                                       for o in failures).most_common(30):
        print(f"{count} x {name}, {kind}: {result} {detail}")
    if arguments.keep:
        arguments.keep.mkdir(parents=True, exist_ok=True)
        for k, o in enumerate(failures):
            (arguments.keep / f"{k:04d}_{o.target.replace(' ', '_')}_{o.kind}").write_bytes(o.content)
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
