"""The control-design stories: each runs, and says what it is there to say."""

import functools
import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib import pyplot as plt

EXAMPLES = Path(__file__).parents[1] / "examples"
STORIES = {"01_capytaine_file_to_lqr": 2, "02_passive_wave_energy": 1, "03_reactive_wave_energy": 1, "04_lqg_heave": 2,
           "05_roll_damping": 2, "06_time_step_and_gap": 1, "07_mpc_and_ekf": 1}


@pytest.fixture(scope="module")
def study():
    """Return what a story finds; each is worked out once."""
    sys.path.insert(0, str(EXAMPLES))
    yield functools.cache(lambda name: importlib.import_module(name).study())
    sys.path.remove(str(EXAMPLES))
    sys.modules.pop("bodies", None)


def test_capytaine_file_to_lqr(study):
    found = study("01_capytaine_file_to_lqr")
    assert found["model"].fit.passive and found["relative_error"] < 0.05
    # LQR is optimal for the body it was designed on, with 60 degrees of phase margin or more (Safonov & Athans 1977).
    assert found["cost_with_radiation"] <= found["cost_got"]
    assert found["phase_margin"] >= 60.0
    assert 0.0 < found["gap"] < 0.3


def test_passive_take_off(study):
    found = study("02_passive_wave_energy")
    rows = found["rows"]
    # The best damper is the one of the right model; the bound is half of what passes (Evans 1976).
    assert rows["right"]["got"] == max(row["got"] for row in rows.values()) <= found["bound"]
    assert rows["constant coefficients"]["predicted"] > found["bound"]
    # 1800 s of a narrow sea: the mean power scatters by about 5 %.
    assert found["simulated"] == pytest.approx(rows["right"]["predicted"], rel=0.1)


def test_predictive_control_holds_the_body_and_the_filter_beats_its_sensor(study):
    _, free, held = study("07_mpc_and_ekf")
    heave, estimated, wave, found, control = held
    assert heave.std() < free[0].std() / 3.0 and abs(control).max() <= 4.0 + 1e-6
    assert (estimated - heave)[100:].std() < 1e-4  # the sensor's noise
    assert (found - wave)[100:].std() < 0.5 * wave.std()


def test_reactive_take_off(study):
    found = study("03_reactive_wave_energy")
    rows = found["rows"]
    passive = study("02_passive_wave_energy")
    assert passive["rows"]["right"]["got"] < rows["right"]["got"] < found["bound"]
    assert found["bound"] == pytest.approx(passive["bound"], rel=0.02)  # two ways: conjugate impedance, |X|^2 / (8 B)
    assert rows["not passive"]["predicted"] > 2.0 * found["bound"] > 2.0 * rows["not passive"]["got"]
    assert found["margin"] < found["passive_margin"]
    assert found["gain_margin"] == pytest.approx(-1.0 / rows["right"]["spring"], rel=1e-3)  # static divergence


def test_lqg_with_the_filters_force(study):
    found = study("04_lqg_heave")
    rows = found["rows"]
    assert found["force_error"] < 0.1 < found["spoilt_error"]
    assert rows["LQG, force from the dual filter"]["heave"] < 0.5 * rows["LQG, white force"]["heave"] < 0.5
    assert all(row["margin"] > 0.0 and row["sensitivity"] >= 1.0 for row in rows.values())


def test_roll_damping(study):
    found = study("05_roll_damping")
    rows = found["rows"]
    assert rows["coupled"]["roll"] == pytest.approx(0.5 * found["free"], rel=0.01)
    assert rows["no coupling"]["gain"] > 1.5 * rows["coupled"]["gain"]
    assert rows["no coupling"]["gap"] < 0.05 < rows["coupled"]["margin"]


def test_time_step_and_gap(study):
    found = study("06_time_step_and_gap")
    assert not found["reports"]["zoh", 0.05].passive and found["reports"]["tustin", 0.05].passive
    for _, gap, left, stable in found["rows"]:
        if gap < found["margin"]:
            assert stable and left > 0.0
    assert any(not stable for *_, stable in found["rows"])


@pytest.mark.parametrize("name", STORIES)
def test_pictures(study, name):
    figures = importlib.import_module(name).draw(study(name))
    assert len(figures) == STORIES[name] and all(figure.axes for figure in figures.values())
    plt.close("all")


def test_runs_as_a_script_from_anywhere(tmp_path):
    command = [sys.executable, "-W", "error", str(EXAMPLES / "06_time_step_and_gap.py"), "--out", "pictures"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "nu-gap" in done.stdout and (tmp_path / "pictures" / "06_time_step.png").is_file()
