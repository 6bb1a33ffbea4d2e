"""Models on disk and on the screen."""

import os
import re
import warnings

import control as ct
import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model

import radiation_ss as rss

xr = pytest.importorskip("xarray")


def same(one, other):
    for name in ("M", "A_inf", "C", "D"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("a", "b", "c"):
        np.testing.assert_array_equal(getattr(one.fit, name), getattr(other.fit, name))
    assert (one.dofs, one.name, dict(one.tolerance)) == (other.dofs, other.name, dict(other.tolerance))


@pytest.mark.parametrize("model", [
    tank_model(), coupled_model(), coupled_model(("float__Heave", "spar__Pitch"), 3),
    rss.body(dof="Surge", mass=1.0, added_mass=0.5), rss.body(dof="Roll", mass=1.0, GM=0.1, period=2.0)])
def test_a_written_model_comes_back_to_the_last_bit(tmp_path, model):
    model = model.replace(D=0.1 * model.C, name="ö/ $1", tolerance={"mass": 0.1})
    model.write(tmp_path / "m.nc")
    same(rss.read_model(tmp_path / "m.nc"), model)
    same(rss.as_model(str(tmp_path / "m.nc")), model)
    assert os.listdir(tmp_path) == ["m.nc"]


def test_other_tools_find_the_coefficients_of_the_model_in_the_file(tmp_path):
    model = coupled_model()
    model.write(tmp_path / "m.nc")
    with xr.open_dataset(tmp_path / "m.nc") as data:
        at = data.isel(omega=40)
        w = float(at.omega)
        K = model.fit.frequency_response([w])[0]
        K = 0.5 * (K + K.T)
        np.testing.assert_allclose(at["radiation_damping"], K.real)
        np.testing.assert_allclose(at["added_mass"], model.A_inf + K.imag / w)
        np.testing.assert_array_equal(data["inertia_matrix"], model.M)


def test_coefficients_that_somebody_changed_are_fitted_anew(tmp_path):
    model = tank_model()
    model.write(tmp_path / "m.nc")
    with xr.open_dataset(tmp_path / "m.nc") as opened:
        data = opened.load()
    told = rss.read_hydro(tmp_path / "m.nc")
    changed = told.replace(B=2.0 * told.B, A=2.0 * told.A - told.A_inf)
    group = xr.open_dataset(tmp_path / "m.nc", group="radiation_ss").load()
    rss.write_hydro(changed, tmp_path / "n.nc")
    group.to_netcdf(tmp_path / "n.nc", mode="a", group="radiation_ss", engine="h5netcdf")
    assert data["omega"].size == changed.omega.size + 1
    again = rss.read_model(tmp_path / "n.nc")
    K = again.fit.frequency_response(changed.omega)[:, 0, 0].real
    assert np.linalg.norm(K - changed.B[:, 0, 0]) < 0.1 * np.linalg.norm(changed.B)


def test_part_of_the_degrees_of_freedom(tmp_path):
    model = coupled_model(("Surge", "Heave", "Pitch"), 3)
    model.write(tmp_path / "m.nc")
    part = rss.read_model(tmp_path / "m.nc", dofs=("Pitch", "Surge"))
    omega = np.geomspace(0.1, 3.0, 10)
    np.testing.assert_allclose(part.fit.frequency_response(omega),
                               model.fit.frequency_response(omega)[:, [2, 0]][:, :, [2, 0]])
    assert rss.read_model(tmp_path / "m.nc", order=2).fit.order == 2
    model.fit.write(tmp_path / "fit.json")
    given = rss.read_model(tmp_path / "m.nc", tmp_path / "fit.json", dofs=("Pitch", "Surge"))
    np.testing.assert_allclose(given.fit.frequency_response(omega), part.fit.frequency_response(omega), rtol=1e-6)
    with pytest.raises(rss.InputError, match="Heave"):
        rss.read_model(tmp_path / "m.nc", part.fit, dofs=("Pitch", "Heave"))


def test_all_degrees_of_freedom_in_another_order(tmp_path):
    model, turned, omega = coupled_model(("Surge", "Heave", "Pitch"), 3), [2, 0, 1], np.geomspace(0.1, 3.0, 10)
    model.write(tmp_path / "m.nc")
    for fit in (None, model.fit):
        found = rss.read_model(tmp_path / "m.nc", fit, dofs=("Pitch", "Surge", "Heave"))
        np.testing.assert_allclose(found.fit.frequency_response(omega),
                                   model.fit.frequency_response(omega)[:, turned][:, :, turned], rtol=1e-6)


@pytest.mark.parametrize("content, words", [
    ("{", "damaged"), ("[]", "damaged"), ('{"schema": "x/9"}', "schema"), ("[" * 100000, "damaged")])
def test_a_damaged_group_is_one_sentence(tmp_path, content, words):
    rss.write_hydro(rss.read_hydro(written(tmp_path)), tmp_path / "n.nc")
    xr.Dataset({"model": content}).to_netcdf(tmp_path / "n.nc", mode="a", group="radiation_ss", engine="h5netcdf")
    with pytest.raises(rss.InputError, match=words) as error:
        rss.read_model(tmp_path / "n.nc")
    assert len(str(error.value)) < 1000


def written(folder):
    tank_model().write(folder / "m.nc")
    return folder / "m.nc"


def test_where_it_cannot_be_written(tmp_path):
    with pytest.raises(rss.InputError, match=r"\.nc"):
        tank_model().write(tmp_path / "m.txt")
    with pytest.raises(rss.InputError, match="does not exist"):
        tank_model().write(tmp_path / "none" / "m.nc")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("model", [
    tank_model(), coupled_model(("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")).replace(tolerance={"mass": 0.1}),
    coupled_model([f"b{k}__{d}" for k in range(2) for d in ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")])])
def test_a_model_prints_in_ten_lines(model):
    lines = repr(model).splitlines()
    assert len(lines) <= 10 and max(map(len, lines)) <= 160
    page = model._repr_html_()
    assert page.startswith("<pre>Model") and "<svg" in page


def test_a_name_cannot_break_the_page():
    assert "<script>" not in tank_model().replace(name="<script>alert(1)</script>")._repr_html_()


def doubted(c, **changes):
    """Return what is said of K(s) = 500 c s / (s^2 + 4 s + 60) beside data of c = 1, and the motion's system."""
    omega = np.linspace(0.5, 40.0, 80)
    K = 500j * omega / (60.0 - omega**2 + 4j * omega)
    data = rss.HydroData(omega, (8.0 + K.imag / omega)[:, None, None], K.real[:, None, None], [[8.0]], "Heave",
                         M=[[12.0]], C=[[600.0]])
    fit = rss.RadiationFit(("Heave",), [[0.0, 1.0], [-60.0, -4.0]], [[0.0], [500.0]], [[0.0, c]], 2,
                           whole_error=0.01, rho=1000.0).replace(**changes)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made = rss.cummins(data, fit)
    assert np.allclose(made.A, rss.cummins(rss.Model.from_hydro(data, order=2), fit).A)
    return [str(one.message) for one in said]


@pytest.mark.filterwarnings("ignore::radiation_ss.errors.InputWarning")
def test_a_fit_of_another_body_is_refused_and_one_that_is_a_little_off_is_told():
    assert doubted(1.0) == doubted(1.015) == doubted(1.15, whole_error=0.1) == doubted(1.08, whole_error=np.nan) == []
    assert re.match("fit: its K is off the coefficients of the data by 6 %, and it states 1 %; is it", doubted(1.06)[0])
    assert "it states 1 %; it is for 1025 kg/m^3, these are for 1000; is it of this" in doubted(1.0, rho=1025.0)[0]
    for c, off in ((150.0, "14900 %"), (0.01, "99 %")):
        with pytest.raises(rss.InputError, match=f"by {off}, and it states 1 %: it is of another body"):
            doubted(c)
    with pytest.raises(rss.InputError, match="fit: not stable"):
        doubted(1.0, a=[[0.0, 1.0], [-60.0, 4.0]])
    assert "can give energy to the body" in doubted(-0.1, whole_error=1.0)[0]


def test_a_model_s_own_radiation_is_not_doubted_when_it_is_read_again(tmp_path):
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 22.0, 30)).select("Heave")
    model = rss.Model.from_hydro(section.replace(M=[[16.0]]), order=3)
    model.replace(fit=model.fit.replace(c=3.0 * model.fit.c)).write(tmp_path / "m.nc")
    assert rss.read_model(tmp_path / "m.nc").dofs == ("Heave",)


def test_a_model_saved_again_without_its_group_is_told_in_our_words(tmp_path):
    tank_model().write(tmp_path / "m.nc")
    with xr.open_dataset(tmp_path / "m.nc", engine="h5netcdf") as dataset:
        dataset.load().to_netcdf(tmp_path / "again.nc", engine="h5netcdf")
    with pytest.raises(rss.InputError, match=r"write the model again .field 'radiation_ss' is missing"):
        rss.read_model(tmp_path / "again.nc")


def test_a_system_without_damping_of_its_own_has_none():
    plant = rss.cummins(coupled_model())
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal(plant.A.shape))[0]  # in other coordinates
    other = ct.ss(turn @ plant.A @ turn.T, turn @ plant.B, plant.C @ turn.T, plant.D, inputs=plant.input_labels,
                  outputs=plant.output_labels)
    assert not rss.body(other).D.any() and " D " not in str(rss.body(other))
    damped = rss.cummins(coupled_model().attached(damping=[[1e-3, 0.0], [0.0, 0.0]]))
    assert rss.body(damped).D[0, 0] == pytest.approx(1e-3, rel=0.1)
