"""What the examples on measured data share: where the data lie and where results go."""

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks import measured


def run(study):
    """Run study(data folder, folder of the results) and print what it returns; say so where the data are absent."""
    options = argparse.ArgumentParser()
    options.add_argument("--out", type=Path, help="folder for results (default: a temporary one)")
    out = options.parse_known_args()[0].out or Path(tempfile.mkdtemp())
    data = measured.data_folder()
    if data is None:
        print("The measured data are absent: set RADIATION_SS_DATA to their folder.")
        return
    print(study(data, out))
    print(f"Page: {out / 'report.html'}")
