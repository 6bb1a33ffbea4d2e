"""Reading and writing coefficients: every format against an independent statement of the same numbers."""

import gzip
from pathlib import Path

import h5py
import hydro_samples as samples
import numpy as np
import pytest
import xarray as xr

import radiation_ss as rss
from radiation_ss import HydroData

FIELDS = ("omega", "A", "B", "A_inf", "A_zero", "M", "C", "D", "X", "directions")


def made_up(dofs=("Surge", "Heave", "Pitch"), seed=0, **changes):
    """Return full data of random numbers: every field there, nothing symmetric by accident."""
    rng = np.random.default_rng(seed)
    n, nw = len(dofs), 7
    fields = dict(omega=np.sort(rng.uniform(0.1, 3.0, nw)), A=rng.normal(size=(nw, n, n)),
                  B=rng.normal(size=(nw, n, n)), A_inf=rng.normal(size=(n, n)), dofs=dofs, rho=1025.3, g=9.80665,
                  depth=43.7, M=rng.normal(size=(n, n)), C=rng.normal(size=(n, n)), D=rng.normal(size=(n, n)),
                  X=rng.normal(size=(nw, 2, n)) + 1j * rng.normal(size=(nw, 2, n)), directions=[0.0, 0.7],
                  reference_point=(0.1, 0.2, -0.3), A_zero=rng.normal(size=(n, n)))
    return HydroData(**{**fields, **changes})


def assert_same(one, other, fields=FIELDS):
    assert one.dofs == other.dofs
    assert (one.rho, one.g, one.depth) == (other.rho, other.g, other.depth)
    np.testing.assert_array_equal(one.reference_point, other.reference_point)
    for name in fields:
        first, second = getattr(one, name), getattr(other, name)
        assert (first is None) == (second is None), name
        if first is not None:
            np.testing.assert_array_equal(first, second, err_msg=name)


@pytest.mark.parametrize("changes", [{}, {"A_inf": None}, {"A_zero": None}, {"X": None, "directions": None},
                                     {"M": None, "C": None, "D": None}, {"depth": np.inf}])
def test_what_is_written_comes_back_exactly(tmp_path, changes):
    data = made_up(**changes)
    rss.write_hydro(data, tmp_path / "model.nc")
    assert_same(rss.read_hydro(tmp_path / "model.nc"), data)


def test_what_is_written_is_in_capytaines_form(tmp_path):
    """Stated once more from Capytaine's side, so that reader and writer cannot be wrong together."""
    data = made_up()
    rss.write_hydro(data, tmp_path / "model.nc")
    with xr.open_dataset(tmp_path / "model.nc") as ds:
        force = ds.excitation_force.sel(complex="re") + 1j * ds.excitation_force.sel(complex="im")
        heave = force.sel(influenced_dof="Heave", omega=data.omega).transpose("omega", "wave_direction")
        np.testing.assert_array_equal(heave.values, np.conj(data.X[:, :, 1]))
        limit = ds.added_mass.sel(omega=np.inf, influenced_dof="Surge", radiating_dof="Pitch")
        assert float(limit) == data.A_inf[0, 2]
        assert np.isnan(force.sel(omega=np.inf)).all()
        damping = ds.radiation_damping.sel(influenced_dof="Pitch", radiating_dof="Surge", omega=data.omega)
        np.testing.assert_array_equal(damping.values, data.B[:, 2, 0])
        assert (float(ds.rho), float(ds.g), float(ds.water_depth)) == (data.rho, data.g, data.depth)
        assert set(ds.data_vars) >= {"inertia_matrix", "hydrostatic_stiffness", "friction"}
        # Without these Capytaine's export_dataset(format="wamit") writes no .1 and no .3
        assert float(ds.forward_speed) == 0.0
        np.testing.assert_allclose(ds.period.sel(omega=data.omega), 2.0 * np.pi / data.omega)


def test_two_bodies_and_one_degree_of_freedom_come_back(tmp_path):
    for dofs in (("float__Heave", "spar__Heave"), ("Heave",)):
        data = made_up(dofs)
        rss.write_hydro(data, tmp_path / "model.nc")
        assert_same(rss.read_hydro(tmp_path / "model.nc"), data)


def capytaine_like(data):
    """Return the dataset that Capytaine would hold for `data`: e^{-iwt}, complex numbers, limits as rows."""
    square = ("omega", "influenced_dof", "radiating_dof")
    A = np.concatenate([data.A, data.A_inf[None]])
    B = np.concatenate([data.B, np.zeros((1, data.n, data.n))])
    X = np.concatenate([np.conj(data.X), np.full((1, *data.X.shape[1:]), np.nan + 0j)])
    return xr.Dataset(
        {"added_mass": (square, A), "radiation_damping": (square, B), "inertia_matrix": (square[1:], data.M),
         "hydrostatic_stiffness": (square[1:], data.C),
         "excitation_force": (("omega", "wave_direction", "influenced_dof"), X)},
        coords={"omega": np.append(data.omega, np.inf), "influenced_dof": list(data.dofs),
                "radiating_dof": list(data.dofs), "wave_direction": data.directions, "rho": data.rho, "g": data.g,
                "water_depth": data.depth, "rotation_center": ("space_coordinate", list(data.reference_point))})


def separated(ds):
    """Split the exciting force as Capytaine's `separate_complex_values` does."""
    X = ds["excitation_force"]
    ds = ds.drop_vars("excitation_force")
    ds["excitation_force"] = (("complex", *X.dims), np.stack([X.values.real, X.values.imag]))
    return ds.assign_coords(complex=["re", "im"])


PRESENT = tuple(name for name in FIELDS if name not in ("D", "A_zero"))


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy", "netcdf4"])
def test_datasets_written_by_xarray_are_read(tmp_path, engine):
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    data = made_up()
    separated(capytaine_like(data)).to_netcdf(tmp_path / "x.nc", engine=engine)
    assert_same(rss.read_hydro(tmp_path / "x.nc"), data, PRESENT)


@pytest.mark.filterwarnings("ignore:You are writing invalid netcdf")
def test_complex_numbers_may_be_stored_whole(tmp_path):
    data = made_up()
    capytaine_like(data).to_netcdf(tmp_path / "x.nc", engine="h5netcdf", invalid_netcdf=True)
    assert_same(rss.read_hydro(tmp_path / "x.nc"), data, PRESENT)


def shuffle(ds):
    return ds.isel(omega=[3, 0, 7, 2, 6, 1, 5, 4])


def reorder(ds):
    return ds.isel(radiating_dof=[2, 0, 1]).transpose("radiating_dof", "complex", ...)


def by_period(ds):
    with np.errstate(divide="ignore"):
        period = (2 * np.pi / ds["omega"]).assign_attrs(units="s")
    return ds.assign_coords(period=period).swap_dims(omega="period").drop_vars("omega")


def parts_of_the_force(ds):
    ds["diffraction_force"] = 0.25 * ds["excitation_force"]
    ds["Froude_Krylov_force"] = 0.75 * ds["excitation_force"]
    return ds.drop_vars("excitation_force")


def sized_dimensions(ds):
    return ds.expand_dims(rho=[float(ds.rho)], water_depth=[float(ds.water_depth)])


def bytes_for_names(ds):
    return ds.assign_coords(radiating_dof=np.array(ds.radiating_dof.values, "S"))


@pytest.mark.parametrize("form", [shuffle, reorder, by_period, parts_of_the_force, sized_dimensions, bytes_for_names])
def test_the_form_of_the_dataset_does_not_matter(tmp_path, form):
    data = made_up()
    form(separated(capytaine_like(data))).to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    for name in PRESENT:
        np.testing.assert_allclose(getattr(got, name), getattr(data, name), rtol=1e-14, err_msg=name)


def test_a_single_selected_degree_of_freedom_is_read(tmp_path):
    data = made_up()
    ds = separated(capytaine_like(data)).sel(radiating_dof="Heave", influenced_dof="Heave", wave_direction=0.7)
    ds.to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    want = data.select("Heave")
    np.testing.assert_array_equal(got.A, want.A)
    np.testing.assert_array_equal(got.X, want.X[:, 1:])
    assert got.directions == [0.7]


def test_an_inertia_that_is_not_known_is_left_out_with_a_note(tmp_path):
    ds = separated(capytaine_like(made_up()))
    inertia = ds["inertia_matrix"].values.copy()
    inertia[0], inertia[:, 0] = np.nan, np.nan
    ds["inertia_matrix"] = ds["inertia_matrix"].dims, inertia
    ds.to_netcdf(tmp_path / "x.nc")
    found = rss.read_hydro(tmp_path / "x.nc")
    assert found.M is None and any(f"not known of {found.dofs[0]}" in note for note in found.notes)


def test_a_minimal_dataset_is_read_and_says_what_was_assumed(tmp_path):
    one = np.ones((3, 1, 1))
    dims = ("omega", "influenced_dof", "radiating_dof")
    xr.Dataset({"added_mass": (dims, one), "radiation_damping": (dims, one)},
               coords={"omega": [1.0, 2.0, 3.0], "influenced_dof": ["Heave"], "radiating_dof": ["Heave"]},
               ).to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc", rho=1025.0)
    assert (got.rho, got.g, got.depth, got.X, got.A_inf) == (1025.0, 9.81, np.inf, None, None)
    assert any("depth is not in the file; inf assumed" in note for note in got.notes)


def test_unknown_reference_point_is_said_not_guessed(tmp_path):
    ds = separated(capytaine_like(made_up())).drop_vars("rotation_center")
    ds.to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert np.isnan(got.reference_point).all()
    assert any("Pitch" in note and "reference_point" in note for note in got.notes)
    with pytest.raises(rss.InputError, match="reference point is not known"):
        got.at((0.0, 0.0, 0.0))


def test_centre_of_mass_stands_in_for_the_rotation_centre_and_bodies_may_have_their_own(tmp_path):
    ds = separated(capytaine_like(made_up()))
    ds.rename(rotation_center="center_of_mass").to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert got.reference_point == (0.1, 0.2, -0.3) and any("centre of mass" in note for note in got.notes)
    ds = separated(capytaine_like(made_up(("Surge", "Heave")))).drop_vars("rotation_center")
    ds.assign_coords(center_of_mass=("space_coordinate", [0.0, 0.0, -1.0])).to_netcdf(tmp_path / "still.nc")
    assert not any("rotation" in note for note in rss.read_hydro(tmp_path / "still.nc").notes)
    two = made_up(("a__Pitch", "b__Pitch"))
    ds = separated(capytaine_like(two)).drop_vars("rotation_center")
    for points, known in (([[0.0, 0.0, -1.0]] * 2, True), ([[0.0, 0.0, -1.0], [9.0, 0.0, -2.0]], False)):
        ds.assign_coords(rotation_center=(("body", "space_coordinate"), points), body=["a", "b"],
                         ).to_netcdf(tmp_path / "two.nc")
        got = rss.read_hydro(tmp_path / "two.nc")
        assert got.reference_point == (0.0, 0.0, -1.0) if known else np.isnan(got.reference_point).all()
        assert known or any("(9.0, 0.0, -2.0)" in note for note in got.notes)


def test_frequencies_without_result_are_left_out_and_named(tmp_path, caplog):
    ds = separated(capytaine_like(made_up()))
    for name in ("added_mass", "radiation_damping"):
        ds[name][2] = np.nan
    ds.to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert got.omega.size == 6
    assert "no radiation result" in caplog.text and any("left out" in note for note in got.notes)


@pytest.mark.parametrize("limit", [0.0, np.inf])
def test_a_limit_without_result_is_named(tmp_path, limit):
    ds = capytaine_like(made_up())
    ds = ds.assign_coords(omega=[*ds.omega.values[:-1], limit])
    ds["added_mass"][-1] = np.nan
    separated(ds).to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert got.A_zero is None and got.A_inf is None
    assert any(f"no added mass (NaN) at {limit:g} rad/s" in note for note in got.notes)
    ds["added_mass"][-1] = 1.0
    ds["added_mass"][-1, 0, 0] = np.nan
    separated(ds).to_netcdf(tmp_path / "y.nc")
    with pytest.raises(rss.InputError, match="is not finite"):
        rss.read_hydro(tmp_path / "y.nc")


def drop(name):
    return lambda ds: ds.drop_vars(name)


def nan_in(name):
    def form(ds):
        ds[name].values[..., 1, 0] = np.nan
        return ds
    return form


@pytest.mark.parametrize("form, message", [
    (drop("added_mass"), "added_mass is missing"),
    (drop("influenced_dof"), "no coordinate influenced_dof"),
    (lambda ds: ds.drop_vars("omega"), "no coordinate omega"),
    (nan_in("added_mass"), r"added mass at omega = .* rad/s, Heave, Surge is nan"),
    (nan_in("radiation_damping"), "radiation damping at omega"),
    (lambda ds: ds.isel(omega=[0, 1, 1, 2]), "is there twice"),
    (lambda ds: ds.assign_coords(omega=-ds.omega), "zero, positive or infinite"),
    (lambda ds: ds.assign_coords(rho=-3.0), "rho: must be positive"),
    (lambda ds: ds.assign_coords(omega=ds.omega.assign_attrs(units="Hz")), "omega is in 'Hz'; rad/s needed"),
    (lambda ds: by_period(ds).assign_coords(period=("period", np.ones(ds.omega.size), {"units": "ms"})),
     "period is in 'ms'; s needed"),
    (lambda ds: ds.assign_coords(rho=ds.rho.assign_attrs(units="t/m^3")), "'t' is no SI unit"),
    (lambda ds: ds.assign(added_mass=ds.added_mass.assign_attrs(units="t")), "added_mass is in 't'"),
    (lambda ds: ds.assign_coords(forward_speed=2.0), "forward_speed = 2 m/s; only zero speed is supported$"),
    (lambda ds: xr.concat([ds.assign_coords(forward_speed=v) for v in (0.0, 5.0)], "forward_speed"),
     r"forward_speed = 0, 5 m/s; .*; take ds.sel\(forward_speed=0\)$"),
    (lambda ds: ds.assign_coords(wave_direction=[0.0, 180.0]), "wave_direction reaches 180, too much for radians"),
    (lambda ds: ds.assign_coords(complex=["a", "b"]), r"\['re', 'im'\] is needed"),
    (lambda ds: ds.assign_coords(radiating_dof=["Surge", "Heave", "Sway"]), r"\['Sway'\] are not among"),
    (lambda ds: ds.assign_coords(radiating_dof=["Surge", "Heave", "Heave"]), "holds a name twice"),
    (lambda ds: ds.isel(omega=[-1]), "no frequency between zero and infinity"),
    (lambda ds: ds.assign(added_mass=ds.added_mass.astype(str)), "not numbers"),
    (lambda ds: ds.expand_dims(rho=[1000.0, 1025.0]), "rho has 2 values"),
])
def test_a_bad_dataset_is_one_clear_error(tmp_path, form, message):
    form(separated(capytaine_like(made_up()))).to_netcdf(tmp_path / "bad.nc")
    with pytest.raises(rss.InputError, match=message) as caught:
        rss.read_hydro(tmp_path / "bad.nc")
    assert "bad.nc" in str(caught.value)


def test_what_is_not_what_it_looks_like_is_noted(tmp_path):
    data = made_up()
    ds = separated(capytaine_like(data)).rename(excitation_force="diffraction_force")
    ds.assign_coords(influenced_dof=["Surge", "heave", "Pitch"], radiating_dof=["Surge", "heave", "Pitch"]).to_netcdf(
        tmp_path / "x.nc")
    found = rss.read_hydro(tmp_path / "x.nc")
    assert found.X is None and any("only diffraction_force is there" in note for note in found.notes)
    assert any("heave: none of Surge, Sway, Heave" in note for note in found.notes)


def test_a_contradicting_option_is_refused(tmp_path):
    rss.write_hydro(made_up(), tmp_path / "x.nc")
    with pytest.raises(rss.InputError, match="rho = 1000 given, but the file says 1025"):
        rss.read_hydro(tmp_path / "x.nc", rho=1000.0)


def test_a_damaged_file_is_an_input_error(tmp_path):
    rss.write_hydro(made_up(), tmp_path / "x.nc")
    whole = (tmp_path / "x.nc").read_bytes()
    for size in (0, 4, 100, 600, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.nc").write_bytes(whole[:size])
        with pytest.raises(rss.InputError, match=r"cut\.nc"):
            rss.read_hydro(tmp_path / "cut.nc")


@pytest.mark.parametrize("content, words", [
    (b"", r"x\.nc: the file is empty$"), (b"hello\n", r"x\.nc: is text, not netCDF; "),
    ("omega; Häve\r\n".encode() * 600, r"x\.nc: is text, not netCDF; "),
    (bytes(range(128, 256)), r"x\.nc: not a readable netCDF dataset \(neither netCDF nor HDF5 by its first bytes\)$")])
def test_what_is_no_netcdf_is_told_without_the_words_of_a_library(tmp_path, content, words):
    (tmp_path / "x.nc").write_bytes(content)
    with pytest.raises(rss.InputError, match=words):
        rss.read_hydro(tmp_path / "x.nc")
    with pytest.raises(rss.InputError, match=words):
        rss.read_model(tmp_path / "x.nc")


def test_an_empty_file_of_any_program_is_said_to_be_empty(tmp_path):
    for name in ("x.1", "x.out", "x.h5", "x.mat", "x.lis", "x.yml"):
        (tmp_path / name).touch()
        with pytest.raises(rss.InputError, match=rf"{name}: the file is empty$"):
            rss.read_hydro(tmp_path / name)


def test_a_pointer_of_git_lfs_is_named(tmp_path):
    for name in ("rm3.h5", "rm3.out", "rm3.nc"):
        (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
        with pytest.raises(rss.InputError, match=rf"{name}: a pointer of Git LFS"):
            rss.read_hydro(tmp_path / name)


def test_missing_and_unknown_files_are_input_errors(tmp_path):
    with pytest.raises(rss.InputError, match="no such file"):
        rss.read_hydro(tmp_path / "none.nc")
    (tmp_path / "x.xyz").write_text("1 2 3")
    with pytest.raises(rss.InputError, match="format"):
        rss.read_hydro(tmp_path / "x.xyz")
    with pytest.raises(rss.InputError, match=r"\.nc"):
        rss.write_hydro(made_up(), tmp_path / "x.h5")
    with pytest.raises(rss.InputError, match="does not exist"):
        rss.write_hydro(made_up(), tmp_path / "no" / "x.nc")


def test_real_capytaine_file_against_wamit_numbers(data):
    """WEC-Sim's RM3 run of Capytaine and WAMIT agree in heave away from the float's irregular frequencies."""
    got = rss.read_hydro(data / "bem" / "formats" / "rm3_capytaine.nc")
    wamit = np.load(data / "bem" / "bem_wecsim_rm3.npz")
    i, low = got.index("rm3_float__Heave"), got.omega < 1.5
    reference = np.interp(got.omega, wamit["w"], wamit["A"][:, 2, 2]) * 1000.0
    np.testing.assert_allclose(got.A[low, i, i], reference[low], rtol=0.05)
    # Long waves: the exciting force is the restoring force, in phase with the elevation.
    assert got.X[0, 0, i] == pytest.approx(got.C[i, i], rel=0.01)


ALL = ("omega", "A", "B", "A_inf", "C", "M", "X", "directions")


def assert_close(got, want, fields, rtol=1e-8):
    assert got.n == want.n
    for name in fields:
        first, second = getattr(got, name), getattr(want, name)
        np.testing.assert_allclose(first, second, rtol=rtol, atol=rtol * np.abs(second).max(), err_msg=name)


@pytest.mark.parametrize("bodies", [("",), ("body1", "body2")])
def test_wamit_files_give_back_the_dimensional_coefficients(tmp_path, bodies):
    data = samples.body_data(bodies)
    path = samples.wamit(data, tmp_path, length=2.0)
    got = rss.read_hydro(path, rho=1025.0, g=data.g, depth=data.depth, length=2.0)
    assert got.dofs == data.dofs and got.depth == data.depth
    assert_close(got, data, ("omega", "A", "B", "A_inf", "C", "X", "directions"))
    assert np.isnan(got.reference_point).all()
    for suffix in (".3", ".hst"):
        assert_close(rss.read_hydro(path.with_suffix(suffix), rho=1025.0, g=data.g, length=2.0), data, ("A", "X", "C"))


@pytest.mark.parametrize("packed", [(".1", ".3", ".hst"), (".3",), (".1",)])
def test_gzipped_files_of_a_run_are_read_with_the_plain_ones(tmp_path, packed):
    data, path = samples.body_data(("",)), samples.wamit(samples.body_data(("",)), tmp_path, length=2.0)
    for suffix in packed:
        plain = path.with_suffix(suffix)
        Path(f"{plain}.gz").write_bytes(gzip.compress(plain.read_bytes()))
        plain.unlink()
    asked = Path(f"{path}.gz") if ".1" in packed else path
    assert_close(rss.read_hydro(asked, rho=1025.0, g=data.g, length=2.0), data, ("A", "B", "X", "C"))
    asked.write_bytes(gzip.compress(b"1.0 1 1 2.0 3.0\n" * 99)[:-9])
    with pytest.raises(rss.InputError, match=rf"{asked.name}: cannot be read \(Compressed file ended"):
        rss.read_hydro(asked, format="wamit")


def test_a_gzipped_file_of_numbers_is_to_be_unpacked(tmp_path):
    (tmp_path / "run.nc.gz").write_bytes(gzip.compress(b"CDF"))
    with pytest.raises(rss.InputError, match=r"run\.nc\.gz: gzipped.*`gunzip`"):
        rss.read_hydro(tmp_path / "run.nc.gz")


@pytest.mark.parametrize("bodies, depth", [(("",), 35.0), (("body1", "body2"), np.inf)])
def test_wamit_out_gives_gravity_length_depth_and_axes(tmp_path, bodies, depth):
    data = samples.body_data(bodies, depth=depth)
    out = samples.wamit_out(data, tmp_path)
    got = rss.read_hydro(out, rho=1025.0)
    assert (got.g, got.depth, got.reference_point) == (9.80665, depth, (0.0, 0.0, -2.0))
    assert_close(got, data, ("omega", "A", "B", "A_inf", "directions"))
    np.testing.assert_allclose(np.abs(got.X), np.abs(data.X), rtol=1e-8)
    assert np.abs(np.angle(got.X / data.X)).max() <= np.deg2rad(0.5001)
    # Roll, pitch and yaw restoring moments have no line of their own in a .out below the diagonal.
    for first in range(2, data.n, 6):
        block = slice(first, first + 3)
        np.testing.assert_allclose(got.C[block, block], data.C[block, block], rtol=1e-8)
    samples.wamit(data, tmp_path)
    beside = rss.read_hydro(tmp_path / "body.1", rho=1025.0)
    assert (beside.g, beside.depth, beside.reference_point) == (9.80665, depth, (0.0, 0.0, -2.0))
    assert_close(beside, data, ("omega", "A", "B", "A_inf", "C", "X", "directions"), rtol=1e-6)


def test_wamit_frequencies_instead_of_periods(tmp_path):
    data = samples.body_data()
    path = samples.wamit(data, tmp_path, limits=False)
    for suffix in (".1", ".3"):
        rows = path.with_suffix(suffix).read_text().splitlines()
        turned = [f" {2 * np.pi / float(r.split()[0]):.12e} {' '.join(r.split()[1:])}" for r in rows[1:]]
        extra = [f" 0.0 {i} {j} 7.0" for i in range(1, 7) for j in range(1, 7)] if suffix == ".1" else []
        path.with_suffix(suffix).write_text("\n".join(extra + turned))
    got = rss.read_hydro(path, rho=1025.0, g=data.g, length=2.0, first_column="omega")
    assert_close(got, data, ("omega", "A", "B", "X"))
    assert got.A_zero[0, 0] == 7.0 * 1025.0 * 8.0


def test_options_that_make_no_sense_are_refused(tmp_path):
    path = samples.wamit(samples.body_data(), tmp_path)
    for options, message in (({"length": 0.0}, "length: must be"), ({"rho": -1.0}, "rho: must be"),
                             ({"depth": 0.0}, "depth: must be"), ({"first_column": "Hz"}, "is none of"),
                             ({"format": "nastran"}, "not known"), ({"format": "nemoh"}, "Nemoh.cal is missing")):
        with pytest.raises(rss.InputError, match=message):
            rss.read_hydro(path, **options)
    rss.write_hydro(made_up(), tmp_path / "x.nc")
    with pytest.raises(rss.InputError, match="is for WAMIT files"):
        rss.read_hydro(tmp_path / "x.nc", length=1.0)
    with pytest.raises(TypeError):
        rss.read_hydro(path, density=1025.0)


def test_a_folder_of_no_run_is_told_which_of_its_files_can_be_read(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "readme.txt").write_text("no coefficients")
    with pytest.raises(rss.InputError, match=r"no run of NEMOH \(Nemoh.cal\), HAMS .* or HydroStar .* are files$"):
        rss.read_hydro(tmp_path / "empty")
    path = samples.wamit(samples.body_data(), tmp_path)
    with pytest.raises(rss.InputError, match=f"give one of its files: {path.stem}\\.1, {path.stem}\\.3"):
        rss.read_hydro(path.parent)


def test_wamit_without_density_says_so(tmp_path, caplog):
    got = rss.read_hydro(samples.wamit(samples.body_data(), tmp_path))
    assert got.rho == 1000.0 and "do not carry the density" in caplog.text
    assert any("rho is not in the file; 1000 assumed" in note for note in got.notes)
    assert any("length is not in the file; 1 assumed" in note for note in got.notes)


def test_modes_that_were_not_run_are_not_invented(tmp_path):
    data = samples.body_data()
    path = samples.wamit(data, tmp_path)
    keep = [line for line in path.read_text().splitlines()[1:] if {"3", "5"} >= set(line.split()[1:3])]
    path.write_text("\n".join(keep))
    got = rss.read_hydro(path, rho=1025.0, g=data.g, length=2.0)
    assert got.dofs == ("Heave", "Pitch")
    assert_close(got, data.select(("Heave", "Pitch")), ("A", "B", "A_inf", "X", "C"))


@pytest.mark.parametrize("depth", [35.0, np.inf])
@pytest.mark.parametrize("bodies", [("",), ("body1", "body2")])
def test_nemoh_folder(tmp_path, bodies, depth):
    data = samples.body_data(bodies, depth=depth, A_inf=None)
    got = rss.read_hydro(samples.nemoh(data, tmp_path / "run"))
    assert got.dofs == data.dofs and got.reference_point == data.reference_point
    assert (got.rho, got.g, got.depth) == (data.rho, data.g, depth)
    assert_close(got, data, ("omega", "A", "B", "X", "directions") + (("M", "C") if len(bodies) == 1 else ()))
    assert got.A_inf is None


def test_nemoh_files_may_lie_in_subfolders(tmp_path):
    data = samples.body_data(A_inf=None)
    folder = samples.nemoh(data, tmp_path / "run")
    for name, place in (("RadiationCoefficients.tec", "results"), ("KH.dat", "Mesh")):
        (folder / place).mkdir(exist_ok=True)
        (folder / name).rename(folder / place / name)
    assert_close(rss.read_hydro(folder / "Nemoh.cal"), data, ("A", "B", "X", "C", "M"))


@pytest.mark.parametrize("bodies, centres", [(("",), ((0.0, 0.0, -2.0),)), (("",), ((12.5, -3.0, -2.0),)),
                                             (("body1", "body2"), ((5.0, 0.0, -2.0), (-7.0, 1.0, -4.0)))])
def test_aqwa_phases_come_from_the_centre_of_gravity_to_the_origin(tmp_path, bodies, centres):
    data = samples.body_data(bodies)
    got = rss.read_hydro(samples.aqwa(data, tmp_path, centres))
    assert (got.rho, got.g, got.depth) == (data.rho, data.g, data.depth)
    assert_close(got, data, ALL, rtol=1e-6)
    assert got.reference_point == centres[0] if len(bodies) == 1 else np.isnan(got.reference_point).all()


def test_aqwa_before_version_18_2_has_no_number_before_the_depth(tmp_path):
    data = samples.body_data()
    path = samples.aqwa(data, tmp_path)
    text = path.read_text().replace("* FREQUENCY ARE OUTPUT, IF LHFR OPTION IS ON\n", "")
    path.write_text(text.replace(" 1 35.000 1025.000", " 35.000 1025.000"))
    got = rss.read_hydro(path)
    assert (got.rho, got.g, got.depth) == (data.rho, data.g, data.depth)
    assert_close(got, data, ALL, rtol=1e-6)


@pytest.mark.parametrize("unit, turn, words", [("rad", 1.0, "taken so"), (b"[rad]", 1.0, "taken so"),
                                               ("rad", 180.0 / np.pi, "taken as degrees"),
                                               ("deg", 180.0 / np.pi, "")])
def test_bemio_directions_are_in_the_unit_that_they_can_be_in(tmp_path, unit, turn, words):
    data = samples.body_data()
    path = samples.bemio(data, tmp_path)
    with h5py.File(path, "r+") as file:
        file["simulation_parameters/wave_dir"][:] = turn * data.directions[:, None]
        file["simulation_parameters/wave_dir"].attrs["units"] = unit
    got = rss.read_hydro(path)
    np.testing.assert_allclose(got.directions, data.directions, rtol=1e-12)
    assert [words in note for note in got.notes if "wave_dir" in note] == [True] * bool(words)


def test_bemio_with_magnitude_and_phase_alone_has_its_force(tmp_path):
    data = samples.body_data()
    path = samples.bemio(data, tmp_path)
    with h5py.File(path, "r+") as file:
        force = file["body1/hydro_coeffs/excitation"]
        X = force["re"][()] + 1j * force["im"][()]
        del force["re"], force["im"]
        force["mag"], force["phase"] = np.abs(X), np.angle(X)
    np.testing.assert_allclose(rss.read_hydro(path).X, data.X, rtol=1e-9, atol=1e-9 * np.abs(data.X).max())


@pytest.mark.parametrize("depth", [35.0, np.inf])
@pytest.mark.parametrize("names, bodies", [(("body",), ("",)), (("float", "spar"), ("float", "spar"))])
def test_bemio_h5(tmp_path, names, bodies, depth):
    data = samples.body_data(bodies, depth=depth)
    got = rss.read_hydro(samples.bemio(data, tmp_path, names))
    assert got.dofs == data.dofs and got.reference_point == data.reference_point
    assert (got.rho, got.g, got.depth) == (data.rho, data.g, depth)
    assert_close(got, data, ("omega", "A", "B", "A_inf", "C", "X", "directions"), rtol=1e-12)


@pytest.mark.parametrize("names, bodies", [(("body",), ("",)), (("float", "spar"), ("float", "spar"))])
def test_bemio_of_a_nemoh_run_has_a_row_for_each_motion(tmp_path, names, bodies):
    """BEMIO takes the zones of RadiationCoefficients.tec as rows; each is of one motion, its columns are forces."""
    data = samples.body_data(bodies)
    path = samples.bemio(data, tmp_path, names)
    with h5py.File(path, "r+") as file:
        del file["bem_data/code"]
        file["bem_data/code"] = "NEMOH"
    got = rss.read_hydro(path)
    for name in ("A", "B", "A_inf"):
        np.testing.assert_allclose(getattr(got, name), np.swapaxes(getattr(data, name), -1, -2), rtol=1e-12)
    assert_close(got, data, ("omega", "C", "X", "directions"), rtol=1e-12)


def test_mss_vessel_axes_are_turned_up(tmp_path):
    data = samples.body_data(reference_point=(0.0, 0.0, 0.0))
    got = rss.read_hydro(samples.mss(data, tmp_path))
    assert (got.rho, got.g, got.depth) == (data.rho, data.g, data.depth)
    assert_close(got, data, ALL, rtol=1e-12)
    assert "those at 5 m/s left out" in str(got)


def cut(text):
    return text[:2 * len(text) // 3]


def swap(old, new):
    def form(text):
        assert old in text
        return text.replace(old, new, 1)
    return form


@pytest.mark.parametrize("writer, name, form, message", [
    (samples.wamit, "body.1", cut, r"body\.1"),
    (samples.wamit, "body.1", lambda t: t + " 1.0 1 1\n", r"body\.1, line .*: 3 columns found, 4 or 5 needed"),
    (samples.wamit, "body.1", lambda t: t + " 1.0 1 1 nan 0.0\n", r"line .*'nan' is not a finite number"),
    (samples.wamit, "body.1", lambda t: t + " 1.0 1 1 ***** 0.0\n", "not a finite number"),
    (samples.wamit, "body.1", lambda t: t + " 1.0 1.5 1 2.0 0.0\n", "mode 1.5 is not a whole number"),
    (samples.wamit, "body.1", lambda t: t + t.splitlines()[-1], "is there twice"),
    (samples.wamit, "body.3", cut, r"body\.3"),
    (samples.wamit, "body.3", lambda t: t + " 1.0 0.0 1 1.0\n", "4 columns found, 7 needed"),
    (samples.wamit, "body.hst", lambda t: t + " 1 1 1.0\n", "are there twice"),
    (samples.wamit, "body.1", lambda t: "\n", "no added mass"),
    (samples.wamit_out, "body.out", cut, r"body\.out"),
    (samples.wamit_out, "body.out", swap("Gravity:     9", "Gravity:     x9"), "gravity"),
    (samples.aqwa, "body.AH1", cut, r"body\.AH1"),
    (samples.aqwa, "body.AH1", swap("COG", "GOC"), "block COG"),
    (samples.aqwa, "body.AH1", swap("GENERAL", "GENERIC"), "block GENERAL"),
    (samples.nemoh, "RadiationCoefficients.tec", cut,
     "the file is cut off|columns found|zones found|ends within a number"),
    (samples.nemoh, "RadiationCoefficients.tec", swap("rad/s", "furlong"), "unit of the first column"),
    (samples.nemoh, "ExcitationForce.tec", swap("beta", "gamma"), "no direction"),
    (samples.nemoh, "Nemoh.cal", cut, "Nemoh.cal"),
    (samples.nemoh, "KH.dat", cut, "KH.dat"),
])
def test_bad_text_files_name_file_and_line(tmp_path, writer, name, form, message):
    path = writer(samples.body_data(), tmp_path)
    place = next(p for p in (tmp_path / name, path / name) if p.exists())
    place.write_text(form(place.read_text()))
    with pytest.raises(rss.InputError, match=message):
        rss.read_hydro(path)


def test_h5_of_somebody_else_is_refused(tmp_path):
    import h5py

    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["measurements/force"] = np.arange(3.0)
    with pytest.raises(rss.InputError, match="not a BEMIO file"):
        rss.read_hydro(tmp_path / "x.h5")
    path = samples.bemio(samples.body_data(), tmp_path)
    with h5py.File(path, "a") as file:
        del file["body1/hydro_coeffs/excitation/im"]
    half = rss.read_hydro(path)
    assert half.X is None and any("body1/hydro_coeffs/excitation/im missing; X is left" in n for n in half.notes)
    with h5py.File(path, "a") as file:
        del file["body1/hydro_coeffs/radiation_damping/all"]
    with pytest.raises(rss.InputError, match="radiation_damping/all is missing"):
        rss.read_hydro(path)
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(rss.InputError, match="not a readable HDF5 file"):
        rss.read_hydro(path)


def test_mat_of_somebody_else_is_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "x.mat", {"signal": [1.0, 2.0]})
    with pytest.raises(rss.InputError, match="no structure 'vessel'"):
        rss.read_hydro(tmp_path / "x.mat")
    savemat(tmp_path / "x.mat", {"vessel": {"freqs": [1.0, 2.0], "A": np.ones((6, 6, 2))}})
    with pytest.raises(rss.InputError, match=r"vessel\.B is missing"):
        rss.read_hydro(tmp_path / "x.mat")
    (tmp_path / "x.mat").write_bytes(b"MATLAB 7.3 MAT-file" + b"\0" * 200)
    with pytest.raises(rss.InputError, match=r"x\.mat"):
        rss.read_hydro(tmp_path / "x.mat")


SPHERE = ("sphere.1", "sphere.out", "sphere_capytaine.nc", "nemoh3_sphere", "sphere_bemio.h5", "sphere.AH1")


@pytest.mark.parametrize("name", SPHERE)
def test_one_sphere_from_all_formats(data, name):
    """Four programs, five meshes, two densities and depths: per density they agree within their panels.

    Below 1.8 rad/s: NEMOH's run has irregular frequencies at 2.24 (heave) and 2.78 rad/s (surge). Above 0.8 rad/s: the
    BEMIO file is of another depth.
    """
    folder = data / "bem" / "formats"
    reference, got = rss.read_hydro(folder / "sphere.1"), rss.read_hydro(folder / name)
    assert got.rho == (1025.0 if name == "sphere.AH1" else 1000.0)
    assert got.depth == (200.0 if name == "sphere_bemio.h5" else 50.0)
    band = (got.omega > 0.8) & (got.omega < 1.8)
    still = int(np.argmin(np.abs(got.directions)))
    for i, j in ((0, 0), (2, 2), (4, 4), (0, 4), (4, 0), (1, 3)):
        for field in ("A", "B"):
            want = np.interp(got.omega, reference.omega, getattr(reference, field)[:, i, j] / reference.rho)
            error = getattr(got, field)[:, i, j] / got.rho - want
            assert np.abs(error[band]).max() < 0.025 * np.abs(want[band]).max(), (field, i, j)
    for i in (0, 2, 4):
        want = np.interp(got.omega, reference.omega, reference.X[:, 0, i]) / reference.rho / reference.g
        error = got.X[:, still, i] / got.rho / got.g - want
        assert np.abs(error[band]).max() < 0.025 * np.abs(want[band]).max(), ("X", i)
    assert got.C[2, 2] / got.rho / got.g == pytest.approx(np.pi * 25.0, rel=2e-3)


def test_wamit_run_is_the_same_in_its_own_files(data):
    folder = data / "bem" / "formats"
    numeric, printed = (rss.read_hydro(folder / name, rho=1000.0) for name in ("sphere.1", "sphere.out"))
    for field in ("A", "B", "A_inf", "A_zero"):
        np.testing.assert_array_equal(getattr(numeric, field), getattr(printed, field))
    reference = np.load(data / "bem" / "bem_wecsim_sphere.npz")
    np.testing.assert_allclose(numeric.A, 1000.0 * reference["A"], rtol=1e-12)
    np.testing.assert_allclose(numeric.B, 1000.0 * reference["B"], rtol=2e-6, atol=1e-12)


def test_command_line_takes_what_a_wamit_file_does_not_carry(tmp_path, capsys):
    from radiation_ss.cli import main

    path = samples.wamit(samples.body_data(nw=9), tmp_path)
    assert main(["check", str(path), "--rho", "1025", "--length", "2"]) == 0
    assert "rho 1025 kg/m^3" in capsys.readouterr().out
    rss.write_hydro(made_up(), tmp_path / "x.nc")
    assert main(["check", str(tmp_path / "x.nc"), "--rho", "1000"]) == 2
    assert "the file says 1025" in capsys.readouterr().err
