"""What damage does to the force's band: it opens while samples are missing or wrong, and closes afterwards."""

import numpy as np
import pytest

import radiation_ss as rss
from benchmarks.heave_tank import BAND, POINTS, known, sea_record, start
from radiation_ss import Record

BEFORE, MEANWHILE, AFTER = slice(600, 1200), slice(1200, 1500), slice(1600, 3000)

# Least (mean, largest) width meanwhile over the width before. In the gap, and when the only sensor is dead, the band
# has to open to that of the force itself, which is 60 (all sensors) or 4 (displacement alone) times what it was.
OPENS = {("gap", "all"): (30.0, 50.0), ("missing", "all"): (1.1, 2.0), ("spikes", "all"): (1.02, 1.5),
         ("velocity dead", "all"): (1.03, 1.03), ("gap", "displacement"): (3.0, 4.0),
         ("missing", "displacement"): (1.02, 1.15), ("spikes", "displacement"): (1.003, 1.05),
         ("displacement dead", "displacement"): (3.0, 4.0)}


def hurt(record, kind, sensors, rng):
    """Return the record with 3 s of damage from 12 s on."""
    channels = {name: v.copy() for name, v in record.channels.items() if sensors == "all" or name == "Heave"}
    for name, values in channels.items():
        part = values[MEANWHILE]
        if kind == "gap":
            part[:] = np.nan
        elif kind == "missing":
            part[rng.random(part.size) < 0.2] = np.nan
        elif kind == "spikes":
            part[rng.random(part.size) < 0.05] += 20.0 * values.std()
        elif {"velocity dead": "Heave_velocity", "displacement dead": "Heave"}[kind] == name:
            part[:] = values[1199]
    return Record(record.time, channels)


@pytest.mark.parametrize(("kind", "sensors"), OPENS)
def test_the_band_opens_and_the_filter_recovers(kind, sensors):
    covered, mean, largest = [], [], []
    for seed in range(4):
        record, force = sea_record(seed)
        filter_ = rss.DualEnKF(start(seed), seed=seed, points=known(POINTS), omega=BAND)
        estimate = filter_.run(hurt(record, kind, sensors, np.random.default_rng(seed)))
        width, inside = (estimate.force.upper - estimate.force.lower)[0], abs(estimate.force.mean[0] - force)
        covered.append(np.mean(inside[MEANWHILE] <= 0.5 * width[MEANWHILE]))
        mean.append(width[MEANWHILE].mean() / width[BEFORE].mean())
        largest.append(width[MEANWHILE].max() / width[BEFORE].mean())
        assert width[AFTER].mean() < 1.02 * width[BEFORE].mean()
        assert inside[AFTER].std() < 1.5 * inside[BEFORE].std()
        assert np.mean(inside[AFTER] <= 0.5 * width[AFTER]) > 0.85
    least = OPENS[kind, sensors]
    assert np.median(mean) > least[0] and np.median(largest) > least[1]
    # Three seconds are three waves: one of four tanks may be half outside.
    assert np.mean(covered) > 0.8
