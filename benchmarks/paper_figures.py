"""Run every script of examples/paper and keep what it prints: the paper's number beside ours.

    OMP_NUM_THREADS=1 python benchmarks/paper_figures.py [--write] [--full] [--pictures FOLDER]
"""

import argparse
import os
import subprocess
import sys
import tempfile

from validation import ROOT, publish

SCRIPTS = ("fig04", "fig05", "fig08", "fig09", "table3", "fig10", "fig11", "fig12", "fig13", "fig14", "fig15", "fig16",
           "fig17")


def main(write, full, pictures):
    printed, environment = {}, {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        for name in SCRIPTS:
            command = [sys.executable, str(ROOT / "examples" / "paper" / f"{name}.py"), "--out", pictures or folder,
                       "--runs", "1000"]
            run = subprocess.run([*command, *(["--full"] if full else [])], env=environment, capture_output=True,
                                 text=True, check=True)
            lines = [line for line in run.stdout.splitlines() if not line.startswith("picture:")]
            printed[name] = "\n".join(["```text", *lines, "```"])
    members = 500 if full else 100
    size = (f"1000 runs in Figs. 9, 10 and Table 3, as in the paper; {members} members in Figs. 14 to 17, with "
            "`--full` the paper's 500.")
    publish("paper", write, size=size, **printed)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write docs/validation/paper.md")
    parser.add_argument("--full", action="store_true", help="the paper's number of members in Figs. 14 to 17")
    parser.add_argument("--pictures", help="folder to keep the pictures in")
    arguments = parser.parse_args()
    main(arguments.write, arguments.full, arguments.pictures)
