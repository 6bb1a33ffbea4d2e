"""Degrees of freedom that are no rigid-body mode: their unit comes from the header, the caller or the file itself."""

import numpy as np
import pytest

import radiation_ss as rss
from radiation_ss.cli import main
from radiation_ss.errors import InputError

TIME = np.arange(0.0, 20.0, 0.05)
MOTION = 0.1 * np.exp(-0.2 * TIME) * np.cos(3.0 * TIME)


def written(folder, header, *columns, name="run.csv"):
    rows = "\n".join(",".join(f"{value:.12g}" for value in row) for row in zip(TIME, *columns))
    (folder / name).write_text(f"{header}\n{rows}\n")
    return folder / name


def flap_file(folder):
    """Write a model of a hinged flap that its file calls `flap`, and of a heave beside it."""
    fit = rss.RadiationFit(("flap", "Heave"), np.kron(np.eye(2), [[-8.0, -60.0], [1.0, 0.0]]),
                           np.kron(np.eye(2), [[40.0], [0.0]]), np.kron(np.eye(2), [[1.0, 0.0]]), 2)
    rss.Model(("flap", "Heave"), np.diag([50.0, 40.0]), np.diag([30.0, 20.0]), np.diag([700.0, 900.0]), fit
              ).write(folder / "flap.nc")
    return folder / "flap.nc"


@pytest.mark.parametrize("header, columns, unit, size", [
    ("time [s],bob [mm],bob_velocity [m/s]", (1e3 * MOTION, np.gradient(MOTION, TIME)), "m", 0.1),
    ("time [s],bob [deg],bob_force [N m]", (np.degrees(MOTION), 0.0 * TIME), "rad", 0.1),
    ("time [s],bob_force [N],bob", (0.0 * TIME, MOTION), "m", 0.1),
])
def test_the_header_says_the_unit_and_a_file_keeps_it(tmp_path, header, columns, unit, size):
    record = rss.read_record(written(tmp_path, header, *columns), dofs=("bob",), kind="decay")
    assert record.units == {"bob": unit} and record.dofs == ("bob",)
    assert record.channels["bob"][0] == pytest.approx(size)
    for name in ("again.csv", "again.csv.gz"):
        rss.write_record(record, tmp_path / name)
        again = rss.read_record(tmp_path / name)
        assert again.units == record.units
        np.testing.assert_array_equal(again.channels["bob"], record.channels["bob"])
    for other in (rss.Record.from_pandas(record.to_pandas(), dofs={"bob": unit}),
                  rss.as_record(record.to_xarray()), record.window(0.0, 5.0)):
        assert other.units == record.units
    assert f" to 0.1 {unit}\n" in f"{record}\n"


@pytest.mark.parametrize("header, dofs, words", [
    ("time [s],bob [m]", (), ["column 2", "'bob'", "dofs={'bob': 'm'}", "--dofs bob=m", "--ignore bob"]),
    ("time [s],bob 2 [m]", (), ["dofs={'bob 2': 'm'}", "--dofs 'bob 2'=m", "--ignore 'bob 2'"]),
    ("time [s],bob", ("bob",), ["column 2", "no unit", "`bob [m]` or `bob [rad]`"]),
    ("time [s],bob [V]", ("bob",), ["column 2", "[V]", "m or rad"]),
    ("time [s],bob [deg]", {"bob": "m"}, ["column 2", "of one kind", "m, rad"]),
    ("time [s],bob [m]", {"bob": "feet"}, ["'bob'", "'feet'", "m or rad"]),
])
def test_what_is_not_known_is_asked_for(tmp_path, header, dofs, words):
    with pytest.raises(InputError) as error:
        rss.read_record(written(tmp_path, header, MOTION), dofs=dofs)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_columns_of_one_degree_of_freedom_are_of_one_kind(tmp_path):
    with pytest.raises(InputError, match=r"column 3 'bob_force \[N\]'.*of one kind"):
        rss.read_record(written(tmp_path, "time [s],bob [deg],bob_force [N]", MOTION, 0.0 * TIME), dofs=["bob"])


def test_writing_asks_for_the_unit(tmp_path):
    record = rss.Record(TIME, {"bob": MOTION}, kind="decay")
    with pytest.raises(InputError, match=r"'bob'.*units=\{'bob': 'm'\}"):
        rss.write_record(record, tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_a_dataset_states_its_units():
    data = rss.Record(TIME, {"Heave": MOTION}, kind="decay").to_xarray()
    data["Heave"] = 1e3 * data["Heave"]
    data["Heave"].attrs["units"] = "mm"
    np.testing.assert_allclose(rss.as_record(data).channels["Heave"], MOTION)
    data["Heave"].attrs["units"] = "furlong"
    with pytest.raises(InputError, match="furlong"):
        rss.as_record(data)


def test_the_command_line_takes_the_names_from_the_model(tmp_path, capsys):
    model, out = str(flap_file(tmp_path)), tmp_path / "out.csv"
    run = str(written(tmp_path, "time [s],flap [deg],Heave [m],flap_force [N m],Heave_force [N]",
                      np.degrees(MOTION), 0.5 * MOTION, 0.0 * TIME, 0.0 * TIME))
    assert main(["simulate", model, run, "--out", str(out)]) == 0
    predicted = rss.read_record(out)
    assert predicted.units == {"flap": "rad"} and np.abs(predicted.channels["flap"][0] - 0.1) < 0.02
    assert main(["simulate", model, "--decay", "flap=5deg", "--out", str(out)]) == 2
    assert "flap is no rigid-body mode" in (said := capsys.readouterr().err) and "--dofs flap=m Heave" in said
    released = ["--decay", "flap=5deg", "Heave=0.1"]
    assert main(["simulate", model, *released, "--dofs", "flap=rad", "Heave", "--out", str(out)]) == 0
    assert rss.read_record(out).channels["flap"][0] == pytest.approx(np.radians(5.0))


@pytest.mark.parametrize("work", [
    lambda model, run: rss.simulate(model, run).outputs,
    lambda model, run: rss.prescribed_force(model, run).outputs,
    lambda model, run: rss.identify(model, run, "prediction-error", omega=[3.0], draws=20, most_laws=0).B.mean,
    lambda model, run: rss.DualEnKF(model, seed=0, n_ensemble=10).run(run).force.mean,
    lambda model, run: rss.isolability(model, run, ["quadratic_drag"]).detectability,
    lambda model, run: rss.diagnose(model, [run], ["quadratic_drag"]).to_dict()["how_far"]["gap_before"],
], ids=["simulate", "prescribed_force", "identify", "DualEnKF", "isolability", "diagnose"])
def test_whatever_takes_a_model_and_a_record_reads_the_names_of_the_model(tmp_path, work):
    model = rss.read_model(flap_file(tmp_path), dofs=["flap"])
    noisy = MOTION + 1e-4 * np.random.default_rng(0).normal(size=TIME.size)
    header = "time [s],flap [deg],flap_force [N m]"
    run = written(tmp_path, header, np.degrees(noisy), 0.0 * TIME)
    as_read = rss.read_record(run, dofs={"flap": "rad"})
    np.testing.assert_array_equal(work(model, str(run)), work(model, as_read))
    with pytest.raises(InputError, match="column 2 'flop"):
        work(model, written(tmp_path, header.replace("flap", "flop"), noisy, 0.0 * TIME, name="wrong.csv"))
