"""Diagnoses of measured campaigns, told nothing of the cause: a tanker's roll decay, a ship section in a wave flume.

    RADIATION_SS_DATA=DATA python benchmarks/real_data.py [FOLDER for pages and files]

Prints the tables and writes them into docs/validation/real_data.md.
"""

from __future__ import annotations

import datetime
import importlib.util
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "examples" / "measured")]

import radiation_ss as rss
from benchmarks import kvlcc2_roll, measured
from benchmarks.pages import write_table


def example(name: str):
    """Return one of the examples of measured data as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / "measured" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def verdict_lines(diagnosis) -> list[str]:
    """Return verdict, ledger and best candidates of a diagnosis as markdown lines."""
    report = diagnosis.to_dict()
    verdict, far = report["verdict"], report["how_far"]
    low, high = far["interval"]
    lines = [f"Verdict: **{verdict['status']}**, probability {verdict['probability']:.3g}.", "",
             "| effect | dof | parameter | value | 2 sd |", "|---|---|---|---|---|"]
    lines += [f"| {e['name']} | {e['dof']} | {name} | {value:.4g} | {2 * sd:.2g} |"
              for e in verdict["effects"] for name, (value, sd) in e["parameters"].items()]
    sets = [" + ".join(names) if isinstance(names, list) else str(names) for names in verdict["indistinguishable"]]
    lines += ["", f"Cannot be told apart: {'; '.join(sets) or 'nothing'}. Not testable with these records: "
              f"{', '.join(verdict['not_testable']) or 'nothing'}.", "",
              "| gap on unseen data | nominal | retuned | with the effects | noise |", "|---|---|---|---|---|",
              f"| {', '.join(far['on'])} | {far['gap_before']:.4f} | {far['gap_retuned']:.4f} | {far['gap_after']:.4f} "
              f"| {far['noise_floor']:.4f} |", "",
              f"Shrinkage {far['shrinkage']:.3f} ({low:.3f} to {high:.3f}).", "",
              "| candidate | log evidence | gap before | gap after |", "|---|---|---|---|"]
    lines += [f"| {' + '.join(e['name'] for e in c['effects']) or 'none'} | {c['log_evidence']:.1f} | "
              f"{c['gap_before']:.4f} | {c['gap_after']:.4f} |" for c in report["candidates"][:6]]
    return [*lines, ""]


def tanker(data: Path, out: Path) -> list[str]:
    """Return the lines on the roll decay."""
    diagnosis = example("01_kvlcc2_roll_decay").study(data, out / "kvlcc2")
    omega, rate = kvlcc2_roll.decay_rate(*kvlcc2_roll.columns(data / "kvlcc2_roll" / kvlcc2_roll.SIMULATED))
    return ["## KVLCC2, roll decay at no speed, run 1", "",
            f"Nominal model: stated particulars; natural frequency {omega:.4f} rad/s and decay rate {rate:.5f} 1/s of "
            "the inviscid simulation. Diagnosed on the first two thirds of the decay, checked on the last third.", "",
            *verdict_lines(diagnosis)]


def flume(data: Path, out: Path) -> list[str]:
    """Return the lines on heave, and on sway and heave together without and with what the rig measured of itself."""
    study = example("02_ntnu_heave")
    lines = ["## Ship section in a wave flume, heave", "",
             "Force: run with the section held. Motion: run of the same wave with the section free in sway and heave. "
             f"Tolerances: {study.TOLERANCE}.", "", *verdict_lines(study.study(data, out / "ntnu"))]
    both = rss.read_model(out / "ntnu" / "ntnu_sway_heave.nc", order=4)
    rig = "sway and heave, the guides' friction and the section's drift as measured"
    for title, stem in (("sway and heave", "sway_heave"), (rig, "sway_heave_friction")):
        records = [rss.read_record(path) for path in sorted((out / "ntnu").glob(f"*_{stem}.csv"))]
        diagnosis = rss.diagnose(both, records, tolerance=study.TOLERANCE)
        diagnosis.save(out / f"ntnu_{stem}")
        lines += [f"## Ship section in a wave flume, {title}", "", *verdict_lines(diagnosis)]
    return lines


def main() -> None:
    data = measured.data_folder()
    if data is None:
        print("The measured data are absent: set RADIATION_SS_DATA to their folder.")
        return
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    began = time.process_time()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    lines = [f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}, commit {commit.strip()}. Rerun: "
             "`RADIATION_SS_DATA=DATA python benchmarks/real_data.py FOLDER`.", "",
             *tanker(data, out), *flume(data, out),
             f"Processor time {time.process_time() - began:.0f} s.", ""]
    text = "\n".join(lines)
    write_table(ROOT / "docs" / "validation" / "real_data.md", text)
    print(text)


if __name__ == "__main__":
    main()
