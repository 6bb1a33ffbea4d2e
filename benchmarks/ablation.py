"""What each number that decides a verdict is good for: diagnose cases by another hand with one of them idle at a time.

    python benchmarks/ablation.py CASES LABELS [--every N] [--out TABLE.json]

A number that only the verdict uses is tried on one search; the others are searched anew. Folders as in
`foreign_diagnosis.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.foreign_diagnosis import diagnosed, judged
from radiation_ss.diagnosis import diagnose as steps
from radiation_ss.diagnosis.rules import Rules

VERDICT = {"matters": 1e-6, "false_alarm": 0.05, "unexplained": math.inf, "plausible": math.inf}
SEARCH = {"visible": 0.0, "refinements": 0, "search.inclusion": 0.5, "search.rare": 0.1, "search.most": 2,
          "search.beam": 1, "search.width": 3, "search.least": -math.inf, "search.sizes.largest": 1.0,
          "search.sizes.cut": 50.0, "discrepancy.unexplained": 1e-6, "discrepancy.ambient": 1e-6,
          "discrepancy.coherent": 1e-6, "discrepancy.wandering": 1e-6, "discrepancy.offset": 1e-6,
          "discrepancy.by_record": 1e-6, "discrepancy.saturation": 1e9, "resolution.noise_floor": 1e-9}


def with_rule(rules: object, path: str, value: float) -> object:
    """Return the rules with one number changed, named by its path."""
    head, _, rest = path.partition(".")
    return replace(rules, **{head: with_rule(getattr(rules, head), rest, value) if rest else value})  # type: ignore[type-var]


def answers(case: Path, label: dict) -> dict[str, str]:
    """Return the judgement with all rules, and with each of them idle."""
    searches: list = []
    search = steps.searched

    def kept(*args: object) -> object:
        if not searches:
            searches.append(search(*args))
        return searches[0]

    found = {"none": once(case, label, Rules(), kept)}
    found |= {path: once(case, label, with_rule(Rules(), path, value), kept) for path, value in VERDICT.items()}
    found |= {path: once(case, label, with_rule(Rules(), path, value), search) for path, value in SEARCH.items()}
    return found


def once(case: Path, label: dict, rules: object, search: object) -> str:
    """Return the judgement of one diagnosis."""
    try:
        with mock.patch.object(steps, "searched", search):
            return judged(diagnosed(case, rules=rules), label)
    except Exception as error:
        return type(error).__name__


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", type=Path)
    parser.add_argument("labels", type=Path)
    parser.add_argument("--every", type=int, default=3)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    table: dict[str, dict[str, str]] = {}
    for case in sorted(given.cases.iterdir())[:: given.every]:
        label = given.labels / f"{case.name}.json"
        if label.exists():
            began = time.process_time()
            table[case.name] = answers(case, json.loads(label.read_text()))
            print(case.name, Counter(table[case.name].values()), f"{time.process_time() - began:.0f} s", flush=True)
            if given.out:
                given.out.write_text(json.dumps(table, indent=1))
    for path in next(iter(table.values())):
        print(f"| {path} | {dict(Counter(row[path] for row in table.values()))} |")


if __name__ == "__main__":
    main()
