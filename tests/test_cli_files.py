"""From files to files: every verb on the paper's tank, and one clear line for bad input."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from radiation_ss import HydroData, Record, body, read_fit, read_record, write_hydro, write_record
from radiation_ss.cli import main
from radiation_ss.report import tank_hydro, tank_model
from radiation_ss.simulation import linear_response


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model file, and a decay of a body with more damping than the model knows."""
    place = tmp_path_factory.mktemp("files")
    hydro = tank_hydro(40)
    write_hydro(hydro, place / "tank.nc")
    model = tank_model(hydro).replace(D=np.array([[8.0]]))
    time = np.arange(0.0, 12.0, 0.02)
    response = linear_response(model, time, np.zeros((1, time.size)), displacement=[0.02])
    rng = np.random.default_rng(1)
    heave = response.outputs[0] + 2e-5 * rng.standard_normal(time.size)
    write_record(Record(time, {"Heave": heave, "Heave_force": np.zeros(time.size)}, kind="decay", name="decay"),
                 place / "decay.csv")
    write_record(read_record(place / "decay.csv").window(0.0, 5.0), place / "short.csv")
    return place


def run(*words):
    return main([str(word) for word in words])


def test_check_says_what_it_found(folder, capsys):
    assert run("check", folder / "tank.nc", "--json") == 0
    assert json.loads(capsys.readouterr().out)


def test_fit_writes_a_passive_subsystem(folder, tmp_path, capsys):
    out = tmp_path / "fit.json"
    assert run("fit", folder / "tank.nc", "--order", 3, "--points", 5.0, "--out", out, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    fit = read_fit(out)
    assert said["passive"] and fit.passive and fit.order == 3
    K = tank_hydro(40)
    at = int(np.argmin(np.abs(K.omega - 5.0)))
    assert abs(fit.frequency_response(K.omega[at])[0, 0, 0] - K.K[at, 0, 0]) < 0.02 * np.abs(K.K).max()


def test_a_plan_needs_no_record(folder, tmp_path, capsys):
    out = tmp_path / "plan"
    words = ("plan", folder / "tank.nc", "--order", 3, "--amplitude", 0.04, "--tests", "decay", "waves", "--json",
             "--effects", "quadratic_drag", "linear_damping", "cubic_stiffness")
    assert run(*words, "--out", out) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((out / "plan.json").read_text(encoding="utf-8")) and said["plan"]
    assert (out / "plan.png").stat().st_size > 10_000
    assert any(name.startswith("waves with elevation") for name in said["tests"])
    assert run(*words, "--sea", 0.02, -1.0) == 2
    assert "Tp" in capsys.readouterr().err


def test_diagnosis_and_corrected_prediction(folder, tmp_path, capsys):
    out = tmp_path / "diagnosis"
    assert run("diagnose", folder / "tank.nc", folder / "decay.csv", "--order", 3, "--out", out, "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["schema"] == "radiation_ss.diagnosis/1"
    assert (out / "report.html").stat().st_size > 10_000
    predicted = {}
    for name, extra in (("as given", []), ("corrected", ["--corrected", out / "corrected.json"])):
        target = tmp_path / f"{name}.csv"
        words = ["simulate", folder / "tank.nc", folder / "decay.csv", "--order", 3, "--out", target, *extra]
        assert run(*words) == 0
        predicted[name] = read_record(target).channels["Heave"]
    measured = read_record(folder / "decay.csv").channels["Heave"]
    gap = {name: np.sqrt(np.mean((x - measured) ** 2) / np.mean(measured**2)) for name, x in predicted.items()}
    assert gap["corrected"] < 0.2 * gap["as given"]


def test_identification_from_a_decay(folder, tmp_path, capsys):
    words = ["identify", folder / "tank.nc", folder / "short.csv", "--method", "prediction-error", "--order", 3]
    assert run(*words, "--out", tmp_path, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "radiation_ss.identification/1" and found["dofs"] == ["Heave"]
    assert np.shape(found["A"]["mean"]) == (len(found["omega"]), 1, 1)
    assert run(*words, "--out", tmp_path) == 0
    shown = capsys.readouterr().out
    assert "Heave at " in shown and "% of it from the data" in shown


def bad_cases(folder, tmp_path):
    (tmp_path / "text.csv").write_text("time [s],Heave [m]\n0,1\n1,two\n")
    (tmp_path / "sway.csv").write_text("# kind: decay\ntime [s],Sway [m]\n0,1\n1,2\n2,1\n")
    (tmp_path / "broken.nc").write_bytes(b"not a dataset")
    data = HydroData([1.0, 2.0, 3.0, 4.0], np.ones((4, 1, 1)), np.ones((4, 1, 1)), np.ones((1, 1)), ("Heave",))
    write_hydro(data, tmp_path / "no_inertia.nc")
    tank, decay, out = folder / "tank.nc", folder / "decay.csv", ["--order", 3, "--out", tmp_path / "out"]
    return {
        "no such file": (["check", tmp_path / "absent.nc"], "absent.nc"),
        "not a dataset": (["check", tmp_path / "broken.nc"], "broken.nc"),
        "text in a number cell": (["diagnose", tank, tmp_path / "text.csv", *out], "line 3"),
        "another degree of freedom": (["diagnose", tank, tmp_path / "sway.csv", *out], "Sway"),
        "no inertia": (["diagnose", tmp_path / "no_inertia.nc", decay, *out], "inertia"),
        "order zero": (["fit", tank, *out, "--order", 0], "order"),
        "unknown method": (["identify", tank, decay, "--method", "magic", *out], "magic"),
        "no tolerance": (["diagnose", tank, decay, "--tolerance", -1, *out], "tolerance"),
        "unknown tolerance": (["diagnose", tank, decay, "--tolerance", "colour=0.1", *out], "colour"),
    }


@pytest.mark.parametrize("depth, water", [(0.45, "water of 0.45 m"), (np.inf, "deep water")])
def test_a_probe_that_stands_elsewhere_is_carried_to_the_body(depth, water, tmp_path, capsys):
    """The oracle is the dispersion relation, solved here: a wave of 6 rad/s lags by k x behind the probe at -x."""
    write_hydro(tank_hydro(40).replace(depth=depth), tmp_path / "tank.nc")
    k = brentq(lambda k: 9.81 * k * np.tanh(k * depth) - 36.0, 1e-3, 100.0)
    time = np.arange(0.0, 80.0, 0.02)
    motion = {}
    for name, place in (("body", 0.0), ("probe", -1.5)):
        record = Record(time, {"wave_elevation": 0.01 * np.cos(6.0 * time - k * place)}, kind="waves",
                        meta={"probe": str(place)} if place else {})
        write_record(record, tmp_path / f"{name}.csv")
        assert run("simulate", tmp_path / "tank.nc", tmp_path / f"{name}.csv", "--order", 3,
                   "--out", tmp_path / "out.csv") == 0
        said = capsys.readouterr().err
        assert (f"carried from the probe at -1.5 m to the body, in {water}" in said) == (name == "probe")
        found = read_record(tmp_path / "out.csv").window(40.0, 60.0)
        motion[name] = found.channels["Heave"] @ np.exp(-6.0j * found.time)
    # A wrong way would turn the phase by twice k x = 11 rad; the ends of the record, in truth endless, count for 1 %.
    assert abs(motion["probe"] / motion["body"] - 1.0) < 0.01


def test_a_fit_that_misses_the_file_is_told(tmp_path, capsys):
    omega = np.linspace(0.2, 6.0, 60)
    B = np.exp(-(((omega - 2.0) / 0.5) ** 2))[:, None, None]  # with an A like that: no causal pair
    write_hydro(HydroData(omega, 3.0 - 0.2 * B, B, np.full((1, 1), 3.0), ("Heave",)), tmp_path / "odd.nc")
    assert run("fit", tmp_path / "odd.nc", "--order", 3, "--out", tmp_path / "fit.json") == 0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "radiation-ss check" in said[0] and "off the file's coefficients" in said[0]


def test_an_order_that_is_too_low_is_told(tmp_path, capsys):
    omega = np.linspace(0.2, 30.0, 150)
    s = 1j * omega[:, None, None]
    K = s / (s**2 + s + 9.0) + s / (s**2 + s + 25.0)
    write_hydro(HydroData(omega, 3.0 + K.imag / omega[:, None, None], K.real, np.full((1, 1), 3.0), ("Heave",)),
                tmp_path / "fine.nc")
    for order, lines in ((2, 1), (4, 0)):
        assert run("fit", tmp_path / "fine.nc", "--order", order, "--out", tmp_path / "fit.json") == 0
        said = capsys.readouterr().err.splitlines()
        assert len(said) == lines and all("a higher --order than 2, or none, fits closer" in text for text in said)


@pytest.mark.filterwarnings("default")
def test_one_line_each_for_notes_warnings_and_failures(folder, tmp_path, capsys, monkeypatch):
    text = (folder / "decay.csv").read_text()
    lines = text.splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("time"))
    extra = [*lines[:head], lines[head] + ",Probe 3,Heave_velocity", *(line + ",1,0" for line in lines[head + 1:])]
    (tmp_path / "dead.csv").write_text("\n".join(extra))
    words = ["simulate", folder / "tank.nc", tmp_path / "dead.csv", "--order", 3, "--out", tmp_path / "p.csv"]
    assert run(*words) == 2
    hint = re.search(r"or (--ignore .*?)\)$", capsys.readouterr().err.strip())[1]
    assert run(*words, *shlex.split(hint)) == 0     # as it is typed
    shown = capsys.readouterr().err.splitlines()
    assert len(shown) == 1 and shown[0].startswith("radiation-ss: warning: ") and "dead channel" in shown[0]

    def broken(*_, **__):
        raise KeyError("x")

    monkeypatch.setattr("radiation_ss.read_record", broken)
    capsys.readouterr()
    assert run(*words) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "internal error" in said[0] and "KeyError" in said[0]


@pytest.mark.parametrize("name", ["no such file", "not a dataset", "text in a number cell", "another degree of freedom",
                                  "no inertia", "order zero", "unknown method", "no tolerance", "unknown tolerance"])
def test_bad_input_is_one_line_and_status_two(name, folder, tmp_path, capsys):
    words, named = bad_cases(folder, tmp_path)[name]
    assert run(*words) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1 and named in said[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("verb, words, named", [
    ("fit", ["--out", "absent/fit.json"], "absent"), ("fit", ["--out", "."], "a folder"),
    ("identify", ["decay.csv", "--out", "tank.nc"], "a file"),
    ("diagnose", ["decay.csv", "--out", "tank.nc"], "a file"),
    ("diagnose", ["decay.csv", "--out", "tank.nc/gap"], "tank.nc is a file"),
    pytest.param("diagnose", ["decay.csv", "--out", "/proc/gap"], "nothing can be written into /proc",
                 marks=pytest.mark.skipif(not Path("/proc").is_dir(), reason="no /proc")),
    ("check", ["--out", "x.txt"], "must end with one of .png, .svg, .pdf"),
    ("simulate", ["decay.csv", "--heading", "30", "--out", "p.csv"], "--heading is for --sea"),
    ("simulate", ["--decay", "Heave=0.01", "--heading", "30", "--out", "p.csv"], "--heading is for --sea"),
    ("simulate", ["decay.csv", "--duration", "3", "--out", "p.csv"], "--duration is for --sea and --decay"),
    ("identify", ["decay.csv", "--preset", "paper", "--method", "spectral", "--out", "x"], "leave out --method"),
    ("simulate", ["decay.csv", "--out", "motion.txt"], ".csv"), ("simulate", ["--out", "p.csv"], "--decay"),
    ("simulate", ["--order", "3", "--decay", "Pitch=1", "--out", "p.csv"], "Heave"),
    ("simulate", ["--order", "3", "--decay", "Heave=deep", "--out", "p.csv"], "not a number")])
def test_output_is_checked_before_any_work(verb, words, named, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    if named not in ("Heave", "not a number"):
        monkeypatch.setattr("radiation_ss.read_hydro", None)  # would be work
    assert run(verb, "tank.nc", *words) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and named in said[0]


def test_an_interrupt_is_one_line_and_leaves_nothing(folder, tmp_path, capsys, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("radiation_ss.report.identification_files.coefficients", stopped)   # after identify.json
    words = ["identify", folder / "tank.nc", folder / "short.csv", "--method", "prediction-error", "--order", 3]
    assert run(*words, "--out", tmp_path / "body") == 130
    assert capsys.readouterr().err.splitlines() == ["radiation-ss: interrupted; every output is as it was, or whole"]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_enough_is_no_failure(folder, unbuffered):
    """`radiation-ss check ... | head -1`, where the pipe is closed before anything is written."""
    program = subprocess.Popen([sys.executable, "-m", "radiation_ss", "check", str(folder / "tank.nc")],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               env={**os.environ, "PYTHONUNBUFFERED": unbuffered})
    program.stdout.close()
    assert program.stderr.read() == b"" and program.wait() == 0
    program.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_or_closed_standard_output_is_named(folder):
    for place, status, said in ((">/dev/full", 2, b"standard output: No space left on device\n"),
                                (">&-", 0, b"warning: standard output is closed; the result is not printed\n")):
        command = f"exec {sys.executable} -m radiation_ss check {folder / 'tank.nc'} {place}"
        done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE)
        assert (done.returncode, done.stderr) == (status, b"radiation-ss: " + said)


def test_a_fit_with_an_order_is_one_too_many(folder, tmp_path, capsys):
    fit = tmp_path / "fit.json"
    assert run("fit", folder / "tank.nc", "--order", 3, "--out", fit) == 0
    words = ["simulate", folder / "tank.nc", folder / "decay.csv", "--fit", fit, "--out", tmp_path / "p.csv"]
    assert run(*words) == 0
    capsys.readouterr()
    assert run(*words, "--order", 4) == 2
    assert "fit: given, and order too" in capsys.readouterr().err


def test_a_decay_without_a_record_has_the_period_of_the_model(folder, tmp_path):
    """Zeros of the motion against the pole of the composite system, by NumPy's eigenvalues."""
    out = tmp_path / "release.csv"
    assert run("simulate", folder / "tank.nc", "--order", 3, "--decay", "Heave=0.02", "--out", out, "--quiet") == 0
    record = read_record(out)
    heave, time = record.channels["Heave"], record.time
    assert record.kind == "decay" and heave[0] == 0.02
    pole = max(np.linalg.eigvals(tank_model(tank_hydro(40)).to_ss().A), key=lambda s: s.imag)
    up = np.flatnonzero((heave[:-1] < 0.0) & (heave[1:] >= 0.0))[:3]
    crossings = time[up] - heave[up] * (time[up + 1] - time[up]) / (heave[up + 1] - heave[up])
    np.testing.assert_allclose(np.diff(crossings), 2.0 * np.pi / pole.imag, rtol=0.02)


def test_the_angle_of_a_release_says_its_unit(tmp_path, capsys):
    out, model = tmp_path / "release.csv", tmp_path / "ship.nc"
    body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.01).write(model)
    words = ["simulate", model, "--out", out, "--duration", 5, "--quiet", "--decay"]
    assert run(*words, "Roll=10") == 2
    assert "10 rad is 573 degrees; write Roll=10deg, or Roll=10rad" in capsys.readouterr().err
    assert run(*words, "Roll=10mm") == 2
    assert "Roll may be in rad, mrad, deg" in capsys.readouterr().err
    for said, meant in (("10deg", np.pi / 18.0), ("100 mrad", 0.1), ("-0.2", -0.2), ("1e-1", 0.1)):
        assert run(*words, f"Roll={said}") == 0
        assert read_record(out).channels["Roll"][0] == pytest.approx(meant, rel=1e-12)


@pytest.mark.parametrize("words, said", [
    (["--decay", "Heave=40"], "more than gravity does; write Heave=40mm, or Heave=40m"),
    (["--decay", "Heave=0,04"], "the decimal mark is a point"),
    (["--decay", "Heave"], "write Heave=0.1"),
    (["--decay", "Heave=0.04", "Heave=0.05"], "Heave is there twice"),
    (["--sea", 20, 1.1], "11 steep, and waves break at 0.14; HS is in m, TP in s"),
    (["--sea", 0.02, 1100], "600 s hold 0.55 peak periods, 3 are needed"),
])
def test_what_no_release_and_no_sea_can_be_is_refused(words, said, folder, tmp_path, capsys):
    assert run("simulate", folder / "tank.nc", "--order", 3, "--out", tmp_path / "p.csv", *words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not (tmp_path / "p.csv").exists()


def test_a_record_in_the_place_of_the_model_is_named(folder, tmp_path, capsys):
    (tmp_path / "run.csv").write_text("time [s],Heave [m]\n0,1\n")
    assert run("identify", tmp_path / "run.csv", folder / "tank.nc", "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert all(words in said for words in ("run.csv: a record by its name", "the model comes first", "HydroData(omega"))


@pytest.mark.parametrize("words", [["simulate", "--decay", "Heave=0.02", "--out", "p.csv"],
                                   ["plan", "--tests", "decay"]])
def test_what_a_file_lacks_is_said_once(words, folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = xr.load_dataset(folder / "tank.nc")
    for name in ("added_mass", "radiation_damping"):
        data[name][3] = np.nan
    data.assign_attrs({}).to_netcdf("holes.nc")
    assert run(words[0], "holes.nc", "--order", 3, *words[1:]) == 0
    assert capsys.readouterr().err.count("no radiation result (NaN)") == 1


def test_a_sea_without_a_record_has_its_height(folder, tmp_path, capsys):
    out = tmp_path / "sea.csv"
    words = ["simulate", folder / "tank.nc", "--order", 3, "--sea", 0.02, 1.2, "--out", out]
    assert run(*words, "--heading", 10) == 2
    assert "--heading 10: the model's file has wave excitation forces from 90 to 90 deg" in capsys.readouterr().err
    assert run(*words, "--verbose") == 0  # a section has one direction, abeam
    assert "motion of" in capsys.readouterr().err
    record = read_record(out)
    assert 4.0 * record.channels["wave_elevation"].std() == pytest.approx(0.02, rel=0.05)
    assert record.channels["Heave"].std() > 0.0 and record.time[-1] > 590.0


def test_a_sea_beyond_the_band_of_the_force_says_what_is_left_out(folder, tmp_path, capsys):
    narrow, hydro = tmp_path / "narrow.nc", tank_hydro(40)
    kept = hydro.omega < 14.0
    write_hydro(hydro.replace(omega=hydro.omega[kept], A=hydro.A[kept], B=hydro.B[kept], X=hydro.X[kept]), narrow)
    words = ["simulate", narrow, "--order", 3, "--sea", 0.02, 1.2, "--duration", 60, "--out", tmp_path / "sea.csv"]
    assert run(*words) == 2
    assert "the sea's energy lies outside the frequencies of X (0.0% below 0.3 rad/s, " in capsys.readouterr().err
    assert run(*words, "--outside", 0.05) == 0
    said = capsys.readouterr().err
    assert "rad/s) and exerts no force" in said and "narrow.nc" in said
    assert "exerts no force" in read_record(tmp_path / "sea.csv").meta["left_out"]
