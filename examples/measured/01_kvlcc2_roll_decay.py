"""Why does a tanker's roll decay differ from potential flow? Diagnosed on two thirds, checked on the last third.

The model is made of the stated particulars and the inviscid simulation; nothing about the cause is told.

    RADIATION_SS_DATA=DATA python examples/measured/01_kvlcc2_roll_decay.py [folder for the page]
"""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from benchmarks import kvlcc2_roll, measured


def study(data: Path, out: Path):
    """Build model and records, diagnose the first two thirds of the decay, keep the page."""
    kvlcc2_roll.build(data / "kvlcc2_roll", out)
    model = rss.read_model(out / "kvlcc2.nc")
    seen, withheld = (rss.read_record(out / f"kvlcc2_run1_{part}.csv") for part in ("seen", "withheld"))
    diagnosis = rss.diagnose(model, [seen], tolerance=0.02, withhold=[withheld])
    diagnosis.save(out)
    return diagnosis


if __name__ == "__main__":
    folder = measured.data_folder()
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    if folder is None:
        print("The measured data are absent: set RADIATION_SS_DATA to their folder.")
    else:
        print(study(folder, out))
        print(f"Page: {out / 'report.html'}")
