"""Where a model, data or a record is expected, a file's name, a dataset, a frame or a native system does as well."""

import numpy as np
import pytest
from plant_bodies import tank_model

import radiation_ss as rss

TIME = np.arange(0.0, 12.0, 0.05)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A model with data, and a decay of it with drag, on disk and in memory."""
    folder = tmp_path_factory.mktemp("files")
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 25.0, 40), depth=0.45)
    data = section.select("Heave").times(0.297).replace(M=[[52.4 / 9.81]])
    rss.write_hydro(data, folder / "tank.nc")
    model = rss.read_model(folder / "tank.nc", order=3)
    model.write(folder / "model.nc")
    start = np.zeros(model.fit.states + 2)
    start[-2] = 0.03
    motion = rss.simulate(model, (TIME, np.zeros((1, TIME.size))), [("quadratic_drag", {"coefficient": 150.0})],
                          start=start).outputs[0]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(TIME.size)
    record = rss.Record(TIME, {"Heave": motion + noise}, kind="decay", name="decay")
    rss.write_record(record, folder / "decay.csv")
    return {"model": str(folder / "model.nc"), "data": folder / "tank.nc", "record": str(folder / "decay.csv"),
            "read": (model, data, record)}


def test_a_file_gives_what_its_content_gives(files):
    model, data, record = files["read"]
    assert np.array_equal(rss.fit_radiation(files["data"], 3).a, rss.fit_radiation(data, 3).a)
    assert np.array_equal(rss.fit_radiation(data.to_xarray(), 3).a, rss.fit_radiation(data, 3).a)
    assert rss.audit(model.fit, files["data"]).relative_error == rss.audit(model.fit, data).relative_error
    for got in (rss.simulate(files["model"], files["record"]), rss.simulate(files["model"], record.to_pandas())):
        assert got.outputs.shape[1] == TIME.size
    assert np.allclose(rss.simulate(files["model"], files["record"]).outputs, rss.simulate(model, record).outputs)
    pulse = np.eye(1, 20)[0]
    assert np.allclose(rss.linear_response(files["model"], TIME[:20], pulse).outputs,
                       rss.linear_response(model, TIME[:20], pulse).outputs)
    assert np.allclose(rss.sampled(files["model"], 0.05).A, rss.sampled(model, 0.05).A)
    sea = rss.realise(rss.jonswap(0.01, t01=1.0), 10.0, 0.05, seed=0, directions=data.directions)
    assert np.array_equal(rss.exciting_force(files["model"], sea), rss.exciting_force(model, sea))
    for given in (files["model"], rss.cummins(model)):
        assert np.allclose(rss.rigid_body(given).A, rss.rigid_body(model).A)


def test_whatever_takes_data_a_fit_or_a_record_takes_a_file(files, tmp_path):
    model, data, record = files["read"]
    fit = model.fit.write(tmp_path / "fit.json")
    for body in (files["data"], data.to_xarray()):
        assert np.allclose(rss.cummins(body, fit).A, rss.cummins(data, model.fit).A)
        rss.write_hydro(body, tmp_path / "again.nc")
        assert np.array_equal(rss.read_hydro(tmp_path / "again.nc").B, data.B)
    direction = data.directions[0]
    assert np.array_equal(rss.fit_excitation(files["data"], direction, 6).a, rss.fit_excitation(data, direction, 6).a)
    for given in (files["record"], record.to_pandas(), record.to_xarray()):
        assert rss.in_radians(given).dofs == record.dofs
        assert abs(rss.clock_offset(given, record, "Heave")[0]) < 1e-3
        rss.write_record(given, tmp_path / "again.csv")
        again = rss.read_record(tmp_path / "again.csv")
        assert again.kind == "decay" and np.array_equal(again.channels["Heave"], record.channels["Heave"])
    with pytest.raises(rss.InputError, match="wave_elevation"):
        rss.at_the_body(files["record"])
    with pytest.raises(rss.InputError, match="both have a channel"):
        rss.joined(files["record"], files["record"])


def test_what_is_asked_of_records_takes_files_and_native_systems(files):
    model, _, record = files["read"]
    few = ["quadratic_drag", "cubic_stiffness"]
    for body, given in ((files["model"], files["record"]), (model.to_ss(), [files["record"]])):
        assert [e.name for e in rss.diagnose(body, given, few).verdict.effects] == ["quadratic_drag"]
        assert rss.isolability(body, given, few).labels == rss.isolability(model, [record], few).labels
    assert rss.plan_tests(files["model"], 0.03, few, tests=["decay"]).to_dict()["tests"]
    found = rss.identify(files["model"], files["record"], "prediction-error", draws=50)
    assert found.dofs == ("Heave",)


def test_half_an_order_is_no_order():
    data = tank_model().to_ss()
    with pytest.raises(rss.InputError, match="order"):
        rss.fit_radiation(rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 20)), 2.5)
    with pytest.raises(rss.InputError, match="HydroData"):
        rss.fit_radiation(data, 2)


def test_what_takes_no_file_says_what_does(files):
    with pytest.raises(rss.InputError, match=r"fit_radiation takes coefficients and files"):
        rss.fitfrd(files["data"], 3)
    with pytest.raises(rss.InputError, match="read_record reads a file"):
        rss.Record(files["record"])
