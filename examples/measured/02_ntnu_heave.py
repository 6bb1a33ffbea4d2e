"""Added mass and damping of a ship section from its motion in waves, beside the panel method; then the diagnosis.

The wave excitation force is that of the run with the section held, the motion that of the run of the same wave with the
section free (Sundsdal et al. 2025).

    RADIATION_SS_DATA=DATA python examples/measured/02_ntnu_heave.py [--out FOLDER]
"""

import campaign
import numpy as np

import radiation_ss as rss
from benchmarks import ntnu_section

TOLERANCE = {"mass": 0.02, "stiffness": 0.02, "A_inf": 0.05, "kernel": 0.1, "force": 0.05}


def study(data, out):
    """Build model and records, identify A33 and B33 at each wave, diagnose all heave records together."""
    files = ntnu_section.build(data / "ntnu_section", out)
    model = rss.read_model(out / "ntnu_heave.nc", order=4)
    records = [rss.read_record(path) for path in files if path.name.endswith("_heave.csv") and "sway" not in path.name]
    for record in records:
        omega = float(record.meta["omega"])
        steady = record.window(float(record.meta["steady from"]), np.inf)
        found = rss.identify(model, steady, "prediction-error", omega=[omega])
        for name, band, panel in (("A33", found.A, model.hydro.A), ("B33", found.B, model.hydro.B)):
            low, mean, high = (getattr(band, side)[0, 0, 0] for side in ("lower", "mean", "upper"))
            computed = np.interp(omega, model.hydro.omega, panel[:, 0, 0])
            print(f"{omega:.3f} rad/s: {name} {mean:.1f} ({low:.1f} to {high:.1f}), panel method {computed:.1f}")
    diagnosis = rss.diagnose(model, records, tolerance=TOLERANCE)
    diagnosis.save(out)
    return diagnosis


if __name__ == "__main__":
    campaign.run(study)
