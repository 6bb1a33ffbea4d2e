"""What naming the optional effects costs: false alarms and time. Writes docs/validation/optional_effects.md.

    python benchmarks/optional_effects.py
"""

import os
import subprocess
import sys
import time
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy asks how many there are

import numpy as np

from radiation_ss.blind.cases import make
from radiation_ss.body.model import Model
from radiation_ss.effects import library, optional
from radiation_ss.gap.diagnose import diagnose

NULLS = 20


def diagnosed(group, number, names):
    """Return status, named effects, remarks on a part, and processor time of a case of the generator."""
    case = make(np.random.SeedSequence([7, number]), group, "sway-roll", "decays+waves")
    begin = time.process_time()
    found = diagnose(Model.from_hydro(case.data), list(case.records), names, withhold=[case.unseen])
    row = (found.verdict.status, ", ".join(f"{e.name} on {e.dof}" for e in found.verdict.effects) or "none",
           [note for note in found.notes if "part of the gap" in note], time.process_time() - begin)
    print(group, number, len(names), *row, flush=True)
    return row


def main():
    plain, named = list(library()), [*library(), *optional()]
    diagnosed("none", NULLS + 1, plain)  # compile once
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    lines = ["# Optional effects", "",
             f"{date.today()}, commit {commit.strip()}. `python benchmarks/optional_effects.py`.", "",
             f"Sway coupled with roll, two decays and two seas, without and with {', '.join(optional())} named beside "
             "the library:", "", "| hidden | library: effects | time [s] | with optional ones: effects | time [s] |",
             "|---|---|---|---|---|"]
    for group in ("none", "single", "pair"):
        rows = [diagnosed(group, 0, names) for names in (plain, named)]
        lines.append(f"| {group} | {' | '.join(f'{effects} | {seconds:.1f}' for _, effects, _, seconds in rows)} |")
    nulls = [diagnosed("none", k, named) for k in range(1, NULLS + 1)]
    wrong = [row for row in nulls if row[0] != "no_gap" or row[2]]
    lines += ["", f"Of {NULLS} cases without any effect, the optional ones named, {len(wrong)} were given one or told "
              f"of a part{': ' + '; '.join(row[1] for row in wrong) if wrong else ''}."]
    (ROOT / "docs" / "validation" / "optional_effects.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
