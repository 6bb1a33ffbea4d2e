"""
A roll decay at rest and under way
==================================

A decay in a spreadsheet, at rest and under way: a model from README numbers, and what differs by speed.

    RADIATION_SS_DATA=DATA python examples/measured/03_kvlcc2_speed.py [--out FOLDER]
"""

import campaign
import numpy as np

import radiation_ss as rss


def decay(path, speed, last=np.inf):
    """Read time [s] and roll [rad] from the release (the largest angle) on."""
    columns = np.genfromtxt(path, delimiter=",", names=True)
    time, roll = columns["time_s"], columns["roll_rad"]
    keep = (np.arange(time.size) >= np.argmax(np.abs(roll))) & (time < last)
    return rss.Record(time[keep], {"Roll": roll[keep]}, kind="decay", name=f"{speed} m/s", speed=speed)


def study(data, out):
    """Make the model of stated particulars and the inviscid period; diagnose both runs together."""
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.0017)
    runs = data / "kvlcc2_roll"
    at_rest = decay(runs / "roll_decay_0kn_run1_21337.csv", 0.0)
    under_way = decay(runs / "roll_decay_15p5kn_21340.csv", 0.97, last=80.0)  # the carriage stops then
    diagnosis = rss.diagnose(model, [at_rest, under_way])
    diagnosis.save(out)
    return diagnosis


if __name__ == "__main__":
    campaign.run(study)
