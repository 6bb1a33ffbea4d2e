"""Records that nobody here made: a towed and a resting tanker in roll, a sphere's decay by three programs."""

import csv
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import radiation_ss as rss

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
SENSORS = {"sensor_gain", "sensor_delay", "sensor_bias", "tank_resonance", "clock_drift"}


def roll(folder, name, length):
    with (folder / "kvlcc2_roll" / name).open(newline="", encoding="utf-8") as file:
        rows = [(float(row["time_s"]), float(row["roll_rad"])) for row in csv.DictReader(file)]
    time, angle = np.array(rows).T
    start = int(np.argmax(np.abs(angle)))
    keep = (time >= time[start]) & (time < time[start] + length)
    return rss.Record(time[keep] - time[start], {"Roll": angle[keep]}, kind="decay", name="roll")


@cache
def tanker(folder):
    import kvlcc2_roll

    return rss.Model.from_hydro(kvlcc2_roll.nominal(folder / "kvlcc2_roll"))


@cache
def sphere(folder):
    hydro = rss.read_hydro(folder / "bem" / "formats" / "sphere_capytaine.nc").select(["Heave"])
    return rss.Model.from_hydro(hydro.replace(M=[[261.8e3]]))


def told(found):
    return {row.cause: row.inclusion for row in found.budget.rows if row.inclusion is not None}


@pytest.mark.parametrize("length", [45.0, 60.0, 80.0, 92.0])
def test_roll_at_rest_has_drag_and_a_cubic_restoring_at_every_length(data, length):
    found = rss.diagnose(tanker(data), roll(data, "roll_decay_0kn_run1_21337.csv", length))
    assert {e.name for e in found.verdict.effects} == {"quadratic_drag", "cubic_stiffness"}
    assert all(p < 0.1 for name, p in told(found).items() if name in SENSORS)


@pytest.mark.parametrize("length", [30.0, 60.0])
def test_roll_at_speed_has_linear_damping(data, length):
    found = rss.diagnose(tanker(data), roll(data, "roll_decay_15p5kn_21340.csv", length))
    assert told(found)["linear_damping"] >= 0.65  # at 60 s a drag alone may stand for it and a cubic restoring
    assert not SENSORS & {e.name for e in found.verdict.effects}


@pytest.mark.parametrize("program", ["proteusds", "marin", "nrel_cfd"])
def test_a_sphere_by_other_programs_has_no_sensor_or_tank(data, program):
    time, heave = np.loadtxt(data / "foreign" / "sphere_decay" / f"{program}.txt").T
    found = rss.diagnose(sphere(data), rss.Record(time, {"Heave": heave}, kind="decay", name=program))
    allowed = {"cubic_stiffness", "quadratic_stiffness", "linear_stiffness", "linear_damping", "quadratic_drag"}
    assert {e.name for e in found.verdict.effects} <= allowed
    assert all(p < 0.2 for name, p in told(found).items() if name not in allowed)
