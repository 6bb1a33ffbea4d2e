"""Added mass and damping of a ship section from its motion in waves, and where the rest of the gap lies.

The exciting force is that of the run with the section held, the motion that of the run of the same wave with the
section free (Sundsdal et al. 2025). Beside the estimates stand the panel method's values.

    RADIATION_SS_DATA=DATA python examples/measured/02_ntnu_heave.py [folder for the page]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from benchmarks import measured, ntnu_section

TOLERANCE = {"mass": 0.02, "stiffness": 0.02, "A_inf": 0.05, "kernel": 0.1, "force": 0.05}


def coefficients(model, records):
    """Return (omega, [low, mean, high] of A33, of B33, panel A33, panel B33) at each steady wave."""
    rows = []
    for record in records:
        omega = float(record.meta["omega"])
        steady = record.window(float(record.meta["steady from"]), np.inf)
        found = rss.identify(model, steady, "prediction-error", omega=[omega])
        band = [[float(getattr(q, name)[0, 0, 0]) for name in ("lower", "mean", "upper")] for q in (found.A, found.B)]
        panel = [float(np.interp(omega, model.hydro.omega, q[:, 0, 0])) for q in (model.hydro.A, model.hydro.B)]
        rows.append((omega, *band, *panel))
    return rows


def study(data: Path, out: Path):
    """Build model and records, identify A33 and B33 at each wave, diagnose all heave records together."""
    files = ntnu_section.build(data / "ntnu_section", out)
    model = rss.read_model(out / "ntnu_heave.nc", order=4)
    records = [rss.read_record(path) for path in files if path.name.endswith("_heave.csv")
               and "sway" not in path.name]
    diagnosis = rss.diagnose(model, records, tolerance=TOLERANCE)
    diagnosis.save(out)
    return coefficients(model, records), diagnosis


if __name__ == "__main__":
    folder = measured.data_folder()
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    if folder is None:
        print("The measured data are absent: set RADIATION_SS_DATA to their folder.")
    else:
        rows, diagnosis = study(folder, out)
        for omega, A, B, panel_A, panel_B in rows:
            print(f"{omega:.3f} rad/s: A33 {A[1]:.1f} ({A[0]:.1f} to {A[2]:.1f}) kg, panel method {panel_A:.1f}; "
                  f"B33 {B[1]:.0f} ({B[0]:.0f} to {B[2]:.0f}) kg/s, panel method {panel_B:.0f}")
        print(diagnosis)
        print(f"Page: {out / 'report.html'}")
