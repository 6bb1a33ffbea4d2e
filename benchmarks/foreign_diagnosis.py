"""Diagnose cases that somebody else made, and score the answers against their labels.

    python benchmarks/foreign_diagnosis.py CASES LABELS [--only PREFIX] [--out TABLE.json]
    python benchmarks/foreign_diagnosis.py CASES LABELS --write TABLE.json ...

The second form writes the table of docs/validation/real_data.md from what runs of the first have left. CASES holds one
folder a case (model.nc, record_*.csv, unseen*.csv); LABELS one json a case with `accept`, for each cause the names that
are right, and `causes`. Or beside CASES stands index.json, by case the files' names, tolerances and units, a case has
make_model.py with `make()`, and a label has for each cause the `nearest` names, its `family`, and whether it is
`outside` of what a library may hold: there "unknown" is right, too.
"""

from __future__ import annotations

import argparse
import json
import runpy
import sys
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from benchmarks.pages import write_table

PAGE = ROOT / "docs" / "validation" / "real_data.md"
START, END = "<!-- cases: written by the benchmark -->", "<!-- end of cases -->"


# Names of one thing, in the force or in the sensor, in one formula or the other.
SAME = ({"sensor_gain", "excitation_gain"}, {"sensor_delay", "excitation_delay", "clock_offset"},
        {"constant_force", "sensor_bias"}, {"hysteresis", "bouc_wen"}, {"parametric_stiffness", "wave_stiffness"},
        {"quadratic_drag", "morison_drag", "crossflow_drag"}, {"linear_damping", "viscous_memory"})

# Causes whose labels were made before the library had their effects.
SINCE = {"end stops on both sides": {"end_stop"}, "water on deck that drains slowly": {"water_on_deck"},
         "slowly varying drift force (Newman)": {"wave_drift"}, "relative_damping": {"linear_morison_drag"},
         "slamming": {"wave_slamming"}}


def posed(case: Path) -> tuple[rss.Model, list[rss.Record], list[rss.Record], dict]:
    """Return model, records, withheld records and options of `diagnose`."""
    index = case.parents[1] / "index.json"
    if not index.exists():
        return (rss.read_model(case / "model.nc"), [rss.read_record(p) for p in sorted(case.glob("record*.csv"))],
                [rss.read_record(p) for p in sorted(case.glob("unseen*.csv"))], {})
    said = json.loads(index.read_text())[case.name]
    seen, unseen = ([rss.read_record(case / name, **said["read"]) for name in said[k]] for k in ("records", "withheld"))
    options = {"tolerance": said["tolerance"], "absent": said["effects_absent"]}
    return runpy.run_path(str(case / said["model"]))["make"](), seen, unseen, options


def accepted(label: dict) -> list[list[str]]:
    """Return, for each cause, the names that are right."""
    if "accept" in label:
        return [[*names, *SINCE.get(cause["name"], ())] for names, cause in zip(label["accept"], label["causes"])]
    found = []
    for cause in label["causes"]:
        names = {*cause["nearest"], *cause["family"], *SINCE.get(cause.get("name", ""), ())}
        names = names.union(*(same for same in SAME if same & names))
        found.append(sorted(names | {f"common_{name}" for name in names}))
    return found


def diagnosed(case: Path, **options: object) -> dict:
    """Diagnose one case with options of `diagnose`."""
    model, records, unseen, own = posed(case)
    began = time.process_time()
    found = rss.diagnose(model, records, withhold=unseen, **own, **options)
    names = sorted({f"{e.name}@{e.dof}" for e in found.verdict.effects})
    return {"status": found.verdict.status, "names": names, "probability": found.verdict.probability,
            "sets": found.verdict.indistinguishable, "before": found.how_far.gap_before, "dofs": model.dofs,
            "recalibrated": found.how_far.gap_retuned,
            "after": found.how_far.gap_after, "noise": found.how_far.noise_floor,
            "seconds": time.process_time() - began,
            "rows": {f"{r.cause} {r.dof}".strip(): round(r.share, 3) for r in found.budget.rows},
            "inclusion": {f"{r.cause}@{r.dof}": r.inclusion for r in found.budget.rows if r.inclusion is not None},
            "parameters": {f"{e.name}@{e.dof}": {k: list(v) for k, v in e.parameters.items()}
                           for e in found.verdict.effects}}


def judged(answer: dict, label: dict) -> str:
    """Return right, partly, wrong, in the set, ambiguous, a false alarm, or the status."""
    bare, accept = {name.partition("@")[0] for name in answer.get("names", [])}, accepted(label)
    if answer["status"] == "unknown_effect" and label["causes"] and all(c.get("outside") for c in label["causes"]):
        return "right"
    if label["null"]:
        return "false alarm" if bare else "right" if answer["status"] == "no_gap" else f"null:{answer['status']}"
    told = [{part.partition(" on ")[0] for part in s} for s in answer.get("sets", ())]
    whole = any(matched(t, accept) == "right" for t in told if t)
    if bare:
        own = matched(bare, accept)
        return "in the set" if own == "partly" and whole else own
    if answer["status"] == "ambiguous":
        return "in the set" if whole else "ambiguous"
    return answer["status"]


def matched(names: set[str], accepted: list[list[str]]) -> str:
    """Hold names against the causes, for each of which several names are right."""
    if any(not any(name in cause for cause in accepted) for name in names):
        return "wrong"
    return "right" if all(any(name in cause for name in names) for cause in accepted) else "partly"


def summary(tables: list[dict]) -> str:
    """Return the table of how often each judgement was given, of cases with and without a cause."""
    kinds = ("right", "in the set", "partly", "ambiguous", "unknown_effect", "no_gap", "wrong", "false alarm")
    rows = ["|cases|number|" + "|".join(kinds) + "|refused|processor time, median, most|",
            "|" + "---|" * (len(kinds) + 4)]
    for table in tables:
        told = [a["judged"].removeprefix("null:") for a in table.values()]
        counts = [told.count(kind) for kind in kinds]
        spent = sorted(a["seconds"] for a in table.values() if "seconds" in a)
        first, last = min(table), max(table)
        rows.append(f"|{first}-{last}|{len(told)}|" + "|".join(map(str, counts))
                    + f"|{len(told) - sum(counts)}|{spent[len(spent) // 2]:.1f} s, {spent[-1]:.0f} s|")
    off = [case for table in tables
           for case, a in sorted(table.items()) if a["judged"] in ("wrong", "null:false alarm", "false alarm")]
    return "\n".join([*rows, "", "Wrong names: " + ", ".join(off) + "."])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", type=Path)
    parser.add_argument("labels", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="how names of cases begin")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--write", type=Path, nargs="+")
    given = parser.parse_args()
    if given.write:
        write_table(PAGE, summary([json.loads(path.read_text()) for path in given.write]), START, END)
        return
    warnings.simplefilter("ignore")
    table = {}
    for case in sorted({c for start in given.only for c in given.cases.glob(f"{start}*")}):
        place = given.labels / f"{case.name}.json"
        if not place.exists():
            continue
        label = json.loads(place.read_text())
        try:
            answer = diagnosed(case)
        except Exception as error:
            answer = {"status": f"{type(error).__name__}: {error}"[:200], "names": []}
        answer["judged"] = judged(answer, label)
        table[case.name] = answer
        truth = " + ".join(f"{c.get('name') or c['nearest']}@{c['dof']}" for c in label["causes"]) or "none"
        print(f"{case.name} {answer['judged']:12s} {truth:55s} -> {answer['status'][:90]} {answer['names']} "
              f"p {answer.get('probability', 0):.2f} gap {answer.get('before', 0):.3f} {answer.get('after', 0):.3f} "
              f"{answer.get('seconds', 0):.1f} s", flush=True)
    counts: dict[str, int] = {}
    for answer in table.values():
        counts[answer["judged"]] = counts.get(answer["judged"], 0) + 1
    print(counts, file=sys.stderr)
    if given.out:
        given.out.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
