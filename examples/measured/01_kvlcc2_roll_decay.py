"""
Roll decay of a tanker
======================

Why does a tanker's roll decay differ from potential flow? Diagnosed on two thirds, checked on the last third.

The model is made from the published particulars and the inviscid simulation.

    RADIATION_SS_DATA=DATA python examples/measured/01_kvlcc2_roll_decay.py [--out FOLDER]
"""

import campaign

import radiation_ss as rss
from benchmarks import kvlcc2_roll


def study(data, out):
    """Build model and records, diagnose the first two thirds of the decay, write the page."""
    kvlcc2_roll.build(data / "kvlcc2_roll", out)
    model = rss.read_model(out / "kvlcc2.nc")
    seen, withheld = (rss.read_record(out / f"kvlcc2_run1_{part}.csv") for part in ("seen", "withheld"))
    diagnosis = rss.diagnose(model, [seen], withhold=[withheld])
    diagnosis.save(out)
    return diagnosis


if __name__ == "__main__":
    campaign.run(study)
