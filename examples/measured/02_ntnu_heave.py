"""
Heave of a ship section in regular waves
========================================

Diagnosis of a ship section's heave in regular waves of a flume.

The wave excitation force is that of the run with the section held, the motion that of the run of the same wave with the
section free (Sundsdal et al. 2025).

    RADIATION_SS_DATA=DATA python examples/measured/02_ntnu_heave.py [--out FOLDER]
"""

import campaign

import radiation_ss as rss
from benchmarks import ntnu_section

TOLERANCE = {"mass": 0.02, "stiffness": 0.02, "A_inf": 0.05, "kernel": 0.1, "force": 0.05}


def study(data, out):
    """Build model and records, diagnose all heave records together."""
    files = ntnu_section.build(data / "ntnu_section", out)
    model = rss.read_model(out / "ntnu_heave.nc", order=4)
    records = [rss.read_record(path) for path in files if path.name.endswith("_heave.csv") and "sway" not in path.name]
    diagnosis = rss.diagnose(model, records, tolerance=TOLERANCE)
    diagnosis.save(out)
    return diagnosis


if __name__ == "__main__":
    campaign.run(study)
