"""The control-design stories: each runs, and says what it is there to say."""

import importlib
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def story():
    sys.path.insert(0, str(EXAMPLES))
    yield lambda name: importlib.import_module(name)
    sys.path.remove(str(EXAMPLES))
    sys.modules.pop("bodies", None)


def test_capytaine_file_to_lqr(story):
    found = story("01_capytaine_file_to_lqr").study()
    assert found["model"].fit.passive and found["relative_error"] < 0.05
    # LQR is optimal for the body it was designed on, with 60 degrees of phase margin or more (Safonov & Athans 1977).
    assert found["cost_with_memory"] <= found["cost_got"]
    assert found["phase_margin"] >= 60.0
    assert 0.0 < found["gap"] < 0.3


def test_passive_take_off(story):
    found = story("02_passive_wave_energy").study()
    rows = found["rows"]
    # The best damper is the one of the right model; the bound is half of what passes (Evans 1976).
    assert rows["right"]["got"] == max(row["got"] for row in rows.values()) <= found["bound"]
    assert rows["no memory"]["promised"] > found["bound"]
    # 1800 s of a narrow sea: the mean power scatters by about 5 %.
    assert found["simulated"] == pytest.approx(rows["right"]["promised"], rel=0.1)


def test_reactive_take_off(story):
    found = story("03_reactive_wave_energy").study()
    rows = found["rows"]
    passive = story("02_passive_wave_energy").study()
    assert passive["rows"]["right"]["got"] < rows["right"]["got"] < found["bound"]
    assert found["bound"] == pytest.approx(passive["bound"], rel=0.02)  # two ways: conjugate impedance, |X|^2 / (8 B)
    assert rows["not passive"]["promised"] > 2.0 * found["bound"] > 2.0 * rows["not passive"]["got"]
    assert found["margin"] < found["passive_margin"]
    assert found["gain_margin"] == pytest.approx(-1.0 / rows["right"]["spring"], rel=1e-3)  # static divergence


def test_lqg_with_the_filters_force(story):
    found = story("04_lqg_heave").study()
    rows = found["rows"]
    assert found["force_error"] < 0.1 < found["spoilt_error"]
    assert rows["LQG, force from the dual filter"]["heave"] < 0.5 * rows["LQG, white force"]["heave"] < 0.5
    assert all(row["margin"] > 0.0 and row["sensitivity"] >= 1.0 for row in rows.values())


def test_roll_damping(story):
    found = story("05_roll_damping").study()
    rows = found["rows"]
    assert rows["coupled"]["roll"] == pytest.approx(0.5 * found["free"], rel=0.01)
    assert rows["no coupling"]["gain"] > 1.5 * rows["coupled"]["gain"]
    assert rows["no coupling"]["gap"] < 0.05 < rows["coupled"]["margin"]


def test_time_step_and_gap(story):
    found = story("06_time_step_and_gap").study()
    assert not found["reports"]["zoh", 0.05].passive and found["reports"]["tustin", 0.05].passive
    for _, gap, left, stable in found["rows"]:
        if gap < found["margin"]:
            assert stable and left > 0.0
    assert any(not stable for *_, stable in found["rows"])
