"""Tests of laws with all their seeds, and the studies of tests/studies.txt, which take long.

A plain run of the tests tries one seed of each law and leaves the studies out.

    OMP_NUM_THREADS=1 python benchmarks/all_seeds.py [file of tests/ ...] [option of pytest ...]
"""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    given = [argument for argument in sys.argv[1:] if not argument.startswith("-")]
    studies = (ROOT / "tests" / "studies.txt").read_text(encoding="utf-8")
    files = given or sorted(str(path) for path in (ROOT / "tests").glob("test_*.py")
                            if "from seeds import some" in path.read_text(encoding="utf-8")
                            or path.name in studies)
    options = [argument for argument in sys.argv[1:] if argument.startswith("-")]
    return subprocess.run([sys.executable, "-m", "pytest", *files, *options], cwd=ROOT, check=False,
                          env={**os.environ, "RADIATION_SS_SEEDS": "all"}).returncode


if __name__ == "__main__":
    sys.exit(main())
