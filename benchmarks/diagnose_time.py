"""Time of a diagnosis: 5 records of 40 s, the whole library, one core. Writes docs/validation/diagnose_time.md."""

import subprocess
import sys
import time
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from gap_cases import tank_case

from radiation_ss.gap.diagnose import diagnose

KINDS = ("decay", "decay", "waves", "waves", "waves")
CASES = {"no effect": [], "quadratic drag": [("quadratic_drag", {"coefficient": 60.0})],
         "coulomb friction": [("coulomb_friction", {"force": 0.4, "width": 0.005})],
         "drag and cubic stiffness": [("quadratic_drag", {"coefficient": 60.0}),
                                      ("cubic_stiffness", {"stiffness": 5e4})]}


def main():
    diagnose(*tank_case([], kinds=("decay",), duration=8.0))  # compile once
    rows = []
    for name, effects in CASES.items():
        model, records = tank_case(effects, seed=1, kinds=KINDS, duration=40.0)
        start, clock = time.process_time(), time.perf_counter()
        found = diagnose(model, records[:4], withhold=records[4:])
        rows.append((name, found.verdict.status, ", ".join(e.name for e in found.verdict.effects) or "none",
                     time.process_time() - start, time.perf_counter() - clock))
        print(*rows[-1])
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    lines = ["# Time of a diagnosis", "",
             f"{date.today()}, commit {commit.strip()}. Asked: at most 10 s on one core for 5 records of 40 s (4 "
             "fitted, 1 withheld) with the whole library. `python benchmarks/diagnose_time.py`.", "",
             "| case | verdict | effects | processor time [s] | wall time [s] |", "|---|---|---|---|---|"]
    lines += [f"| {a} | {b} | {c} | {d:.1f} | {e:.1f} |" for a, b, c, d, e in rows]
    (ROOT / "docs" / "validation").mkdir(parents=True, exist_ok=True)
    (ROOT / "docs" / "validation" / "diagnose_time.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
