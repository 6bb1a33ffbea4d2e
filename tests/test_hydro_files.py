"""Reading and writing coefficients: every format against an independent statement of the same numbers."""

import numpy as np
import pytest
import xarray as xr

import radiation_ss as rss
from radiation_ss.hydro.data import HydroData

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
        return ds.assign_coords(period=2 * np.pi / ds["omega"]).swap_dims(omega="period").drop_vars("omega")


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


def test_a_minimal_dataset_is_read_and_says_what_was_assumed(tmp_path):
    one = np.ones((3, 1, 1))
    dims = ("omega", "influenced_dof", "radiating_dof")
    xr.Dataset({"added_mass": (dims, one), "radiation_damping": (dims, one)},
               coords={"omega": [1.0, 2.0, 3.0], "influenced_dof": ["Heave"], "radiating_dof": ["Heave"]},
               ).to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc", rho=1025.0)
    assert (got.rho, got.g, got.depth, got.X, got.A_inf) == (1025.0, 9.81, np.inf, None, None)
    assert any("water_depth" in note and "inf assumed" in note for note in got.notes)


def test_unknown_reference_point_is_said_not_guessed(tmp_path):
    ds = separated(capytaine_like(made_up())).drop_vars("rotation_center")
    ds.to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert np.isnan(got.reference_point).all()
    assert any("Pitch" in note and "reference_point" in note for note in got.notes)


def test_frequencies_without_result_are_left_out_and_named(tmp_path, caplog):
    ds = separated(capytaine_like(made_up()))
    for name in ("added_mass", "radiation_damping"):
        ds[name][2] = np.nan
    ds.to_netcdf(tmp_path / "x.nc")
    got = rss.read_hydro(tmp_path / "x.nc")
    assert got.omega.size == 6
    assert "no radiation result" in caplog.text and any("left out" in note for note in got.notes)


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
    (lambda ds: ds.assign_coords(forward_speed=2.0), "forward_speed"),
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
