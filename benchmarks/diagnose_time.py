"""Time of a diagnosis: 5 records of 40 s, the whole library, one core; and of the command line with its start.

Writes docs/validation/diagnose_time.md.

With --opened, the slowest cases of opened withheld checks (folders of `radiation-ss blind`) are diagnosed again and
compared with the processor time that their answers tell.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy asks how many there are

import numpy as np
from gap_cases import tank_case

from radiation_ss.blind.runner import make
from radiation_ss.body.convert import read_model
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.diagnose import diagnose
from radiation_ss.records.record_files import read_record

KINDS = ("decay", "decay", "waves", "waves", "waves")
GOAL = 10.0  # s
CASES = {"no effect": [], "quadratic drag": [("quadratic_drag", {"coefficient": 60.0})],
         "coulomb friction": [("coulomb_friction", {"force": 0.4, "width": 0.005})],
         "drag and cubic stiffness": [("quadratic_drag", {"coefficient": 60.0}),
                                      ("cubic_stiffness", {"stiffness": 5e4})]}


# Of the withheld check's generator: sway coupled with roll, two decays and two seas of 35 to 85 s.
COUPLED = {"sway and roll, no effect": ("none", 0.0), "sway and roll, one effect": ("single", 0.0),
           "sway and roll, two effects": ("pair", 0.0), "sway and roll, no effect, sensors that drift": ("none", 0.015)}


def coupled_case(group, drift):
    """Return the model, the records and the unseen one of a case with two degrees of freedom."""
    case = make(np.random.SeedSequence([7, 0]), group, "sway-roll", "decays+waves", drift)
    return Model.from_hydro(case.data), list(case.records), case.unseen


def timed(name, model, records, unseen):
    """Diagnose; return a row of the table."""
    start, clock = time.process_time(), time.perf_counter()
    found = diagnose(model, records, withhold=[unseen])
    row = (name, found.verdict.status, ", ".join(f"{e.name} on {e.dof}" for e in found.verdict.effects) or "none",
           time.process_time() - start, time.perf_counter() - clock)
    print(*row, flush=True)
    return row


def by_command_line():
    """Return (what, processor seconds, asked) of the demo with nothing compiled yet, again, and of a diagnosis."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        demo, run = Path(folder) / "demo", "import sys; from radiation_ss.cli import main; sys.exit(main(sys.argv[1:]))"
        files = [str(demo / name) for name in ("tank.nc", "decay_40mm.csv", "waves_40mm.csv")]
        diagnosis = ["diagnose", *files, "--withhold", str(demo / "waves_50mm_unseen.csv"), "--out", f"{folder}/gap"]
        surroundings = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/compiled", "PYTHONPATH": str(ROOT)}
        for what, words, asked in (("first demo, nothing compiled", ["demo", "--out", str(demo)], 20),
                                   ("demo again", ["demo", "--out", str(demo)], ""), ("diagnose, heave", diagnosis, 5)):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, "-c", run, *words], env=surroundings, check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            rows.append((what, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, asked))
            print(*rows[-1], flush=True)
    return rows


def slowest(folder, count):
    """Return name, status and seconds, then and now, of the slowest cases of an opened check."""
    told = {path.parent.name: json.loads(path.read_text()) for path in folder.glob("answers/*/answer.json")}
    then = sorted(((answer["seconds"], name) for name, answer in told.items() if "seconds" in answer), reverse=True)
    tolerance = json.loads((folder / "blind.json").read_text())["tolerance"]
    rows = []
    for before, name in then[:count]:
        case, start = folder / "cases" / name, time.process_time()
        records = [read_record(path) for path in sorted(case.glob("*.csv")) if path.name != "unseen.csv"]
        found = diagnose(read_model(case / "MODEL.nc"), records, tolerance=tolerance)
        rows.append((f"{folder.name} {name}", found.verdict.status, before, time.process_time() - start))
        print(*rows[-1], flush=True)
    return rows


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--opened", nargs="*", type=Path, default=[])
    options.add_argument("--slowest", type=int, default=3)
    chosen = options.parse_args()
    diagnose(*tank_case([], kinds=("decay",), duration=8.0))  # compile once
    rows = []
    for name, effects in CASES.items():
        model, records = tank_case(effects, seed=1, kinds=KINDS, duration=40.0)
        rows.append(timed(name, model, records[:4], records[4]))
    rows += [timed(name, *coupled_case(*case)) for name, case in COUPLED.items()]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    lines = ["# Time of a diagnosis", "",
             f"{date.today()}, commit {commit.strip()}. Asked: at most 10 s on one core for 5 records of 40 s (4 "
             "fitted, 1 withheld) with the whole library. `python benchmarks/diagnose_time.py`.", "",
             "|case|verdict|effects|processor time [s]|", "|---|---|---|---|"]
    lines += [f"|{a}|{b}|{c}|{d:.1f}|" for a, b, c, d, _ in rows]
    slow = [row for row in rows if row[3] > GOAL]
    lines += ["", f"{len(rows) - len(slow)} of {len(rows)} cases are within {GOAL:.0f} s." + (
        " Slower: " + "; ".join(row[0] for row in slow) + "." if slow else "")]
    lines += ["", "By the command line:", "", "|command|processor time [s]|asked|", "|---|---|---|"]
    lines += [f"|{a}|{b:.1f}|{c}|" for a, b, c in by_command_line()]
    hard = [row for folder in chosen.opened for row in slowest(folder, chosen.slowest)]
    if hard:
        lines += ["", f"The {chosen.slowest} slowest cases of each opened withheld check, as diagnosed when they were "
                  "sealed and now:", "", "| check and case | verdict | then [s] | now [s] |", "|---|---|---|---|"]
        lines += [f"| {a} | {b} | {c:.0f} | {d:.1f} |" for a, b, c, d in hard]
    (ROOT / "docs" / "validation").mkdir(parents=True, exist_ok=True)
    (ROOT / "docs" / "validation" / "diagnose_time.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
