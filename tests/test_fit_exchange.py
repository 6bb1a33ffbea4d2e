"""Models in the forms of other tools, and the audit, against published models whose scores are known."""

import gzip

import control as ct
import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat
from scipy.linalg import block_diag

import radiation_ss as rss
from radiation_ss import read_fit
from radiation_ss.errors import InputError
from radiation_ss.fit import Port

DOFS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
OMEGA = np.linspace(0.05, 5.0, 60)


@pytest.fixture(scope="module")
def fit():
    port = Port(3, 3, 2, 2)
    a, b = port.realise(np.random.default_rng(3).uniform(0.4, 1.5, port.size))
    model = rss.RadiationFit(("Heave", "Pitch"), a, 1e3 * b, 1e3 * b.T, order=3, A_inf=np.eye(2))
    K = model.frequency_response(OMEGA)
    A = np.eye(2) + K.imag / OMEGA[:, None, None]
    data = rss.HydroData(OMEGA, A, K.real, np.eye(2), dofs=model.dofs, rho=1025.0)
    return model.replace(data=data)


def mss(data, name):
    arrays = np.load(data / "bem" / f"mss_{name}.npz")
    positive = arrays["w"] > 0.0
    return rss.HydroData(arrays["w"][positive], arrays["A"][positive], arrays["B"][positive], arrays["Ainf"], dofs=DOFS)


@pytest.mark.parametrize("suffix", [".json", ".ss", ".h5", ".mat"])
def test_every_form_is_read_back_as_the_same_transfer_function(fit, suffix, tmp_path):
    score = rss.audit(fit.write(tmp_path / f"model{suffix}"), fit.data)
    assert score.relative_error < 1e-9 and score.passive and score.asymmetry < 1e-9
    assert score.dofs == ("Heave", "Pitch")


@pytest.mark.parametrize("suffix", [".json", ".ss", ".h5", ".mat"])
def test_a_motion_that_does_not_radiate_is_read_back(fit, suffix, tmp_path):
    b, c = np.zeros((fit.states, 3)), np.zeros((3, fit.states))
    b[:, :2], c[:2] = fit.b, fit.c
    still = rss.RadiationFit(("Heave", "Pitch", "Yaw"), fit.a, b, c, order=fit.order)
    found = read_fit(still.write(tmp_path / f"yaw{suffix}"))
    assert found.dofs == still.dofs and not found.frequency_response(OMEGA)[:, 2].any()
    assert_allclose(found.frequency_response(OMEGA), still.frequency_response(OMEGA), rtol=1e-9, atol=1e-9)
    M, C = np.eye(3), np.diag([2.0, 3.0, 0.0])
    assert rss.cummins((M, C, np.eye(3)), tmp_path / f"yaw{suffix}").ninputs == 3


def test_two_bodies_keep_their_places(tmp_path):
    rng = np.random.default_rng(0)
    port = Port(2, 2, 2)
    a, b = port.realise(rng.uniform(0.4, 1.5, port.size))
    fit = rss.RadiationFit(("float__Heave", "spar__Heave"), a, b, b.T, order=2)
    K = fit.frequency_response([1.0])[0]
    openfast = read_fit(fit.write(tmp_path / "two.ss"))
    assert openfast.dofs == ("body1__Heave", "body2__Heave")
    assert_allclose(openfast.frequency_response([1.0])[0], K, rtol=1e-12)
    bemio = read_fit(fit.write(tmp_path / "two.h5"))
    assert bemio.dofs == ("float__Heave", "spar__Heave")  # what has no states is left out
    assert_allclose(bemio.frequency_response([1.0])[0], K, rtol=1e-9)


def test_a_model_without_radiation_has_no_place_in_bemios_form(tmp_path):
    with pytest.raises(InputError, match=r"none\.h5: a model without radiation has no states to write"):
        rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0).fit.write(tmp_path / "none.h5")
    assert not list(tmp_path.iterdir())


def test_a_file_of_six_that_says_no_more_is_of_the_motions_that_radiate_and_the_body_has(fit, tmp_path):
    path = fit.write(tmp_path / "six.ss")
    path.write_text(path.read_text().replace("; of Heave, Pitch", ""))
    assert read_fit(path).dofs == DOFS
    body = fit.data.replace(M=np.eye(2), C=np.diag([2.0, 3.0]))
    assert rss.cummins(body, path).ninputs == 2


def test_openfast_header(fit, tmp_path):
    lines = fit.write(tmp_path / "model.ss").read_text().splitlines()
    assert lines[1].split("%")[0].split() == ["1"] * 6
    assert lines[2].split()[0] == "6"
    assert len(lines) == 4 + 6 + 6 + 6


def test_bemio_keeps_an_existing_file_and_its_density(fit, tmp_path):
    path = tmp_path / "hydro.h5"
    with h5py.File(path, "w") as file:
        file["simulation_parameters/rho"] = [[1025.0]]
        file["body1/properties/name"] = "buoy"
    fit.write(path)
    with h5py.File(path, "r+") as file:
        assert file["body1/properties/name"][()] == b"buoy"
        file["simulation_parameters/rho"][...] = 1000.0
    with pytest.raises(InputError, match=r"density 1000 kg/m\^3 in the file, 1025"):
        fit.write(path)


def test_bemio_finds_each_body_by_its_name_in_a_file_that_is_there(tmp_path):
    """Fits with the bodies in another order, or of one of them, go to the groups of these bodies."""
    a, b, c = np.diag([-1.0, -2.0, -3.0]), np.eye(3)[:, :2], np.diag([4.0, 5.0, 6.0])[:2]
    pairs = {dofs: rss.RadiationFit(dofs, a, b[:, order], c[order], 3)
             for dofs, order in ((("Barge__Heave", "Float__Heave"), [0, 1]),
                                 (("Float__Heave", "Barge__Heave"), [1, 0]))}
    alone = rss.RadiationFit(("Float__Heave",), [[-2.0]], [[1.0]], [[5.0]], 1)
    path = tmp_path / "two.h5"
    for fit in (*pairs.values(), alone):
        with h5py.File(path, "w") as file:
            for k, name in enumerate(("Barge", "Float")):
                file[f"body{k + 1}/properties/name"] = name
        read = read_fit(fit.write(path))
        assert read.dofs == tuple(sorted(fit.dofs))
        order = [fit.dofs.index(dof) for dof in read.dofs]
        np.testing.assert_allclose(read.frequency_response(OMEGA),
                                   fit.frequency_response(OMEGA)[:, order][:, :, order], atol=1e-12)
    with pytest.raises(InputError, match=r"two\.h5: body 'Buoy' in the fit, Barge, Float in the file"):
        rss.RadiationFit(("Buoy__Heave",), [[-2.0]], [[1.0]], [[5.0]], 1).write(path)


@pytest.mark.parametrize("name, states, error", [("fpso", 69, 0.147), ("tanker", 55, 0.437)])
def test_audit_of_published_models(data, name, states, error):
    score = rss.audit(data / "bem" / f"mss_{name}.npz", mss(data, name))
    assert score.states == states and score.stable and not score.passive
    assert score.relative_error == pytest.approx(error, abs=1e-3)


def test_audit_of_bemio_sphere(data):
    hydro = rss.read_hydro(data / "bem" / "formats" / "sphere_bemio.h5")
    score = rss.audit(data / "bem" / "formats" / "sphere_bemio.h5", hydro)
    # BEMIO states the R^2 of its own heave kernel as 0.98; it is not passive all the same.
    assert score.entry_error[2, 2] < 0.3
    assert score.stable and not score.passive


def test_audit_takes_control_systems_by_name(fit):
    system = fit.to_ss()
    assert rss.audit(system, fit.data).relative_error < 1e-12
    swapped = system[::-1, ::-1]
    swapped = ct.ss(swapped.A, swapped.B, swapped.C, swapped.D, inputs=["pitch_vel", "heave_vel"], outputs=2)
    assert rss.audit(swapped, fit.data).relative_error < 1e-12
    nameless = ct.ss(system.A, system.B, system.C, system.D)
    assert rss.audit(nameless, fit.data).relative_error < 1e-12
    with pytest.raises(InputError, match="discrete"):
        rss.audit(ct.sample_system(system, 0.1), fit.data)


def test_audit_takes_transfer_functions_or_says_why_not(fit):
    heave = rss.fit_radiation(fit.data.select("Heave"), 3)
    score = rss.audit(ct.ss2tf(heave.to_ss()), heave.data)
    assert score.relative_error == pytest.approx(heave.relative_error, rel=1e-6)
    with pytest.raises(InputError, match="no state space follows"):
        rss.audit(ct.tf([1.0, 0.0, 0.0], [1.0, 2.0]), heave.data)


def renamed(data, *dofs):
    return rss.HydroData(data.omega, data.A, data.B, data.A_inf, dofs=dofs, rho=data.rho)


def test_audit_refuses_another_body_of_the_same_size(fit, tmp_path):
    spar = rss.RadiationFit(("spar__Heave", "spar__Pitch"), fit.a, fit.b, fit.c, order=3)
    for names in (("sphere__Heave", "sphere__Pitch"), ("Heave", "Pitch"), ("spar__Surge", "spar__Sway")):
        with pytest.raises(InputError, match=rf"spar_heave, spar_pitch, the data's {names[0]}, {names[1]}"):
            rss.audit(spar, renamed(fit.data, *names))
    with pytest.raises(InputError, match="heave, pitch, the data's Surge, Sway"):
        rss.audit(fit, renamed(fit.data, "Surge", "Sway"))
    assert rss.audit(spar, renamed(fit.data, "spar__Heave", "spar__Pitch")).relative_error < 1e-12


def test_audit_says_that_it_compares_by_position(fit, tmp_path):
    with pytest.warns(rss.errors.InputWarning, match="heave, pitch, the data's spar__Heave, spar__Pitch"):
        assert rss.audit(fit, renamed(fit.data, "spar__Heave", "spar__Pitch")).relative_error < 1e-12
    pair = rss.RadiationFit(("float__Heave", "spar__Heave"), fit.a, fit.b, fit.c, order=3)
    with pytest.warns(rss.errors.InputWarning, match="body1_heave, body2_heave, the data's float__Heave, spar__Heave"):
        rss.audit(pair.write(tmp_path / "two.ss"), renamed(fit.data, "float__Heave", "spar__Heave"))


def test_unreadable_models_are_named(fit, tmp_path):
    (tmp_path / "model.ss").write_text("one\n1 1\n2\n0\n1 2 3\n")
    with pytest.raises(InputError, match=r"model.ss: 1 rows"):
        read_fit(tmp_path / "model.ss")
    (tmp_path / "model.h5").write_text("not HDF5")
    with pytest.raises(InputError, match="not a readable radiation model"):
        read_fit(tmp_path / "model.h5")
    with pytest.raises(InputError, match="unknown form"):
        fit.write(tmp_path / "model.txt")
    foreign = rss.RadiationFit(("lid",), fit.a, fit.b[:, :1], fit.c[:1], order=1)
    with pytest.raises(InputError, match="'lid' has no place"):
        foreign.write(tmp_path / "other.ss")


def test_plots_are_drawn(fit):
    from matplotlib import pyplot as plt

    figure = fit.plot()
    assert len(figure.axes) == 8
    plt.close(figure)
    with pytest.raises(InputError, match="without its data"):
        fit.replace(data=None).plot()
    for entries in (fit.data, "Heave", ["Heave"], [("Heave", 1)]):
        with pytest.raises(InputError, match=rf"plot: entries: pairs of names .*; found {type(entries).__name__} "):
            fit.plot(entries)
    assert len(fit.plot([("Heave", "Pitch")]).axes) == 4


def hydrodyn_force(path, omega):
    """Return HydroDyn's radiation force for unit velocities exp(i w t), from SS_Radiation.f90 line by line.

    Head, enabled degrees of freedom, states, states of each; then the rows of A, B and C. x' = A x + B dq, and y = C x
    is added to the loads on the platform (WAMIT.f90): the force itself.
    """
    words = [line.split() for line in path.read_text(errors="replace").splitlines()]
    n = sum(word in ("0", "1") for word in words[1])
    assert [int(word) for word in words[1][:n]] == [1] * n, "HydroDyn enables all degrees of freedom"
    N = int(words[2][0])
    assert sum(int(word) for word in words[3][:n]) == N
    A, B, C = (np.array(words[first:last], dtype=float)
               for first, last in ((4, 4 + N), (4 + N, 4 + 2 * N), (4 + 2 * N, 4 + 2 * N + n)))
    return np.array([C @ np.linalg.solve(1j * w * np.eye(N) - A, B) for w in omega])


def test_published_openfast_model_is_the_force_on_the_body(data):
    folder = data / "bem" / "formats" / "iea15"
    hydro = rss.read_hydro(folder / "UMaineSemi.1", rho=1025.0)
    force = hydrodyn_force(folder / "UMaineSemi.ss", hydro.omega)
    diagonal = np.arange(6)
    # The force opposes the motion where the platform radiates: Re y < 0 at the peak of the damping.
    peak = np.argmax(hydro.B[:, diagonal, diagonal], axis=0)
    assert (force[peak, diagonal, diagonal].real < 0.0).all()
    score = rss.audit(folder / "UMaineSemi.ss", hydro)
    expected = [np.linalg.norm(force[:, k, k] + hydro.K[:, k, k]) / np.linalg.norm(hydro.K[:, k, k]) for k in diagonal]
    assert_allclose(np.diag(score.entry_error), expected, rtol=1e-6)
    assert max(expected) < 0.16 and score.certificate.margin > -0.05


def test_written_openfast_model_damps_the_motion_in_hydrodyn(fit, tmp_path):
    path = fit.write(tmp_path / "model.ss")
    force = hydrodyn_force(path, OMEGA)
    assert_allclose(force[:, [[2], [4]], [2, 4]], -fit.data.K, rtol=1e-9, atol=1e-9 * np.abs(fit.data.K).max())
    assert not np.delete(np.delete(force, [2, 4], axis=1), [2, 4], axis=2).any()


def wecsim_radiation(path, omega, rho):
    """Return K from bodyClass.m (irfInfAddedMassAndDamping): a block on the diagonal for each entry, C times rho."""
    with h5py.File(path) as file:
        group = file["body1/hydro_coeffs/radiation_damping/state_space"]
        it, A, B, C = (group[name][()] for name in ("it", "A/all", "B/all", "C/all"))
    sizes = it.astype(int)
    a = block_diag(*(A[i, j, :n, :n] for (i, j), n in np.ndenumerate(sizes)))
    b, c, at = np.zeros((len(a), 6)), np.zeros((6, len(a))), 0
    for (i, j), n in np.ndenumerate(sizes):
        b[at:at + n, j], c[i, at:at + n] = B[i, j, :n, 0], rho * C[i, j, 0, :n]
        at += n
    return np.array([c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) for w in omega])


def test_written_bemio_model_is_the_radiation_of_wecsim(fit, tmp_path):
    K = wecsim_radiation(fit.write(tmp_path / "model.h5"), OMEGA, fit.data.rho)
    assert_allclose(K[:, [[2], [4]], [2, 4]], fit.data.K, rtol=1e-9, atol=1e-9 * np.abs(fit.data.K).max())
    assert not np.delete(np.delete(K, [2, 4], axis=1), [2, 4], axis=2).any()


def test_an_array_of_bodies_is_a_small_bemio_file_and_is_read_back_with_its_own_states(tmp_path):
    """The form has a subsystem for each two of 72 motions; written in full these are 96 MB."""
    rng, count, modes = np.random.default_rng(4), 12, 24
    w, z = rng.uniform(0.3, 3.0, modes), rng.uniform(0.05, 0.7, modes)
    shape = rng.normal(size=(modes, count)) * 10.0 ** rng.uniform(-3.0, 3.0, count)
    b, c = np.kron(shape, [[0.0], [1.0]]), np.kron(shape.T, [[0.0, 1.0]])
    b, c = np.r_[b, shape[:2]], np.c_[c, shape[:2].T]       # and two real poles
    a = block_diag(*([[0.0, 1.0], [-p * p, -2.0 * q * p]] for p, q in zip(w, z)), -0.7, -1.9)
    turn = np.linalg.qr(rng.normal(size=a.shape))[0]
    dofs = tuple(f"b{k}__Heave" for k in range(count))
    fit = rss.RadiationFit(dofs, turn.T @ a @ turn, turn.T @ b, c @ turn, order=4)
    path = fit.write(tmp_path / "array.h5")
    found, K = read_fit(path), fit.frequency_response(OMEGA)
    assert path.stat().st_size < 3e6 and found.states == fit.states and found.dofs == fit.dofs
    size = np.sqrt(np.abs(np.einsum("wii->wi", K)).max(axis=0))
    assert_allclose(found.frequency_response(OMEGA) / np.outer(size, size), K / np.outer(size, size), atol=1e-12)
    with h5py.File(path, "r+") as file:     # a few bytes that state what no memory holds
        group = file["body1/hydro_coeffs/radiation_damping/state_space"]
        del group["A/all"]
        group.create_dataset("A/all", (6, 72, 9000, 9000), "f8", chunks=(1, 1, 9000, 9000))
        group["it"][0, :40] = 9000
    with pytest.raises(InputError, match=r"array\.h5: unpacks to \d{11} bytes"):
        read_fit(path)


def test_an_entry_of_a_bemio_file_has_only_the_poles_that_it_shows(tmp_path):
    """Heave and roll share one of three parts of the radiation; the others reach one of the two, or neither."""
    a = block_diag(*([[0.0, 1.0], [-w * w, -2.0 * z * w]] for w, z in ((2.0, 0.6), (3.0, 0.5), (2.5, 0.8))))
    shape = np.array([[1.0, 0.25, 0.0], [0.1, 1.5, 0.7], [0.0, 0.3, -1.0]])
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    b = np.kron(shape, [[0.0], [1.0]])
    c = np.kron(shape.T * [900.0, 500.0, 300.0], [[0.0, 1.0]])
    fit = rss.RadiationFit(("Heave", "Pitch", "Roll"), turn.T @ a @ turn, turn.T @ b, c @ turn, order=6)
    with h5py.File(fit.write(tmp_path / "three.h5")) as file:
        states = file["body1/hydro_coeffs/radiation_damping/state_space/it"][()]
    assert states[np.ix_([2, 4, 3], [2, 4, 3])].tolist() == [[4, 4, 2], [4, 6, 4], [2, 4, 4]]
    found = read_fit(tmp_path / "three.h5").select(fit.dofs).frequency_response(OMEGA)
    assert_allclose(found, fit.frequency_response(OMEGA), rtol=1e-9, atol=1e-9 * 900.0)


def test_axes_of_mss_files_are_turned_and_poles_on_the_axis_are_no_crash(tmp_path):
    # MSS has x forward, y starboard, z down: surge-heave couples with the other sign than with z up.
    cells = {key: np.empty((6, 6), dtype=object) for key in ("Ar", "Br", "Cr")}
    for cell in cells.values():
        cell[...] = [[np.zeros((0, 0))] * 6] * 6
    for (i, j), gain in {(0, 0): 3.0, (2, 2): 3.0, (0, 2): 1.0, (2, 0): 1.0}.items():
        cells["Ar"][i, j], cells["Br"][i, j] = np.array([[-1.0, -2.0], [1.0, 0.0]]), np.array([[1.0], [0.0]])
        cells["Cr"][i, j] = np.array([[gain, 0.0]])
    savemat(tmp_path / "vessel.mat", {"vesselABC": cells})
    K = read_fit(tmp_path / "vessel.mat").frequency_response([1.0])[0]
    s = 1j
    assert_allclose(K[[0, 0, 2, 2], [0, 2, 0, 2]], np.array([3.0, -1.0, -1.0, 3.0]) * s / (s**2 + s + 2.0), rtol=1e-12)

    # An integrator that the input does not reach, as in MSS's semisub: K is as before, but not stable.
    cells["Ar"][0, 0] = np.array([[-1.0, -2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    cells["Br"][0, 0], cells["Cr"][0, 0] = np.array([[1.0], [0.0], [0.0]]), np.array([[3.0, 0.0, 1.0]])
    savemat(tmp_path / "vessel.mat", {"vesselABC": cells})
    A = np.zeros((OMEGA.size, 6, 6))
    K = read_fit(tmp_path / "vessel.mat").frequency_response(OMEGA)
    data = rss.HydroData(OMEGA, A + K.imag / OMEGA[:, None, None], K.real, np.zeros((6, 6)), dofs=DOFS)
    score = rss.audit(tmp_path / "vessel.mat", data)
    assert not score.stable and not score.passive and score.relative_error < 1e-9


@pytest.fixture(scope="module")
def semisub(data, tmp_path_factory):
    folder, source = tmp_path_factory.mktemp("iea15"), data / "bem" / "formats" / "iea15"
    (folder / "UMaineSemi.1").write_bytes((source / "UMaineSemi.1").read_bytes())
    (folder / "UMaineSemi.3").write_bytes(gzip.decompress((source / "UMaineSemi.3.gz").read_bytes()))
    return rss.read_hydro(folder / "UMaineSemi.1", rho=1025.0)


def hydrodyn_excitation(path, omega):
    """Return the force per metre of elevation from SS_Excitation.f90: x' = A x + B eta(t + tc), y = C x."""
    words = [line.split() for line in path.read_text(errors="replace").splitlines()]
    tc, N = float(words[2][0]), int(words[3][0])
    assert sum(int(word) for word in words[4][:6]) == N
    A, B, C = (np.array(words[first:last], dtype=float)
               for first, last in ((5, 5 + N), (5 + N, 5 + 2 * N), (5 + 2 * N, 11 + 2 * N)))
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(N) - A, B))[:, 0] * np.exp(1j * w * tc) for w in omega])


def test_written_excitation_has_half_the_error_of_the_published_one(data, semisub, tmp_path):
    k = int(np.argmin(np.abs(semisub.directions)))
    X, active = semisub.X[:, k], [0, 2, 4]

    def errors(force):
        return np.linalg.norm((force - X)[:, active], axis=0) / np.linalg.norm(X[:, active], axis=0)

    published = hydrodyn_excitation(data / "bem" / "formats" / "iea15" / "UMaineSemi.ssexctn", semisub.omega)
    # Surge and pitch of the published file have the opposite sign of WAMIT's .3; that is not counted against it.
    theirs = errors(published * np.array([-1.0, 1.0, 1.0, 1.0, -1.0, 1.0]))
    fit = rss.fit_excitation(semisub, 0.0, states=38)
    path = fit.write(tmp_path / "UMaineSemi.ssexctn")
    assert (errors(hydrodyn_excitation(path, semisub.omega)) <= 0.5 * theirs).all()
    assert np.linalg.eigvals(fit.a).real.max() < 0.0 and fit.lead > 0.0
    again = rss.read_excitation(path)
    assert_allclose(again.frequency_response(semisub.omega), fit.frequency_response(semisub.omega), rtol=1e-6,
                    atol=1e-9 * np.abs(X).max())


def test_excitation_that_cannot_be_fitted_is_named(fit, semisub, tmp_path):
    with pytest.raises(InputError, match="no wave excitation forces"):
        rss.fit_excitation(fit.data)
    with pytest.raises(InputError, match="direction: 5 deg found"):
        rss.fit_excitation(semisub, np.radians(5.0))
    with pytest.raises(InputError, match="states: 400"):
        rss.fit_excitation(semisub, states=400)
    published = tmp_path / "marin_semi.ss"  # WEIS gives OC4's excitation model that name
    published.write_text("SS_Excitation_Fitting v1.00.01: State-Spaces Matrices\n0  %Wave heading angle\n")
    with pytest.raises(InputError, match="read_excitation reads it"):
        rss.audit(published, fit.data)
    (tmp_path / "bad.ssexctn").write_text("one\n0\n12\n2\n2 0 0 0 0 0\n1 2\n")
    with pytest.raises(InputError, match="1 rows of numbers; 2 states need"):
        rss.read_excitation(tmp_path / "bad.ssexctn")


def test_what_symmetry_makes_zero_but_for_rounding_takes_no_states():
    """Of a section in beam seas surge has noise of a panel method, a millionth of the force."""
    data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 60)).select(["Sway", "Heave"])
    rng = np.random.default_rng(0)
    noise = 1e-6 * np.abs(data.X).max() * (rng.standard_normal(data.X.shape[:2]) + 1j)
    whole = data.replace(X=np.stack([noise, data.X[:, :, 1]], axis=2))
    alone = rss.fit_excitation(data.select("Heave"), data.directions[0], states=8)
    both = rss.fit_excitation(whole, data.directions[0], states=8)
    assert both.relative_error < 1.1 * alone.relative_error + 1e-3


def test_audit_says_that_a_model_looks_like_the_force_on_the_body(fit):
    opposite = rss.audit(ct.ss(fit.a, fit.b, -fit.c, np.zeros((2, 2)), inputs=["heave_vel", "pitch_vel"],
                               outputs=["heave_rad", "pitch_rad"]), fit.data)
    assert opposite.certificate.margin == pytest.approx(-1.0) and opposite.certificate.K_zero < 2.0
    assert opposite.relative_error == pytest.approx(2.0) and opposite.opposite_error < 1e-12
    assert "looks like -K, whose output is the force on the body" in str(opposite)
    assert "looks like" not in str(rss.audit(fit, fit.data))


def test_audit_of_a_model_that_is_wrong_with_either_sign_does_not_call_it_minus_the_model(fit):
    odd = rss.audit(ct.ss(-fit.a, fit.b, fit.c, np.zeros((2, 2))), fit.data)
    assert 1.0 < odd.opposite_error < odd.relative_error and "looks like" not in str(odd)


@pytest.mark.parametrize("share", [-0.1, 1e-3, 0.1, 1.0])
def test_the_passivity_margin_of_a_model_with_feed_through(share):
    """K = s / (s^2 + 0.8 s + 1) + D: its real part falls to D in the limits, and is D + 1 / 0.8 at most."""
    K, D = OMEGA / (1j * (1.0 - OMEGA**2) + 0.8 * OMEGA), 1.25 * share
    data = rss.HydroData(OMEGA, K.imag[:, None, None] / OMEGA[:, None, None], K.real[:, None, None], [[0.0]], "Heave")
    found = rss.audit(ct.ss([[-0.8, -1.0], [1.0, 0.0]], [[1.0], [0.0]], [[1.0, 0.0]], D), data).certificate
    assert found.margin == pytest.approx(D / max(1.25 + D, -D), rel=1e-6)
    assert found.passive == (D > 0.0) and found.relative_degree == 0


def test_openfast_states_belong_to_motions_that_are_there(fit, tmp_path):
    roll = rss.RadiationFit(("Roll",), [[0.0, -4.0], [1.0, -2.0]], [[3.0], [1.0]], [[0.0, 1.0]], 2)
    for model in (fit, fit.select(["Pitch"]), roll):
        owned = np.array(model.write(tmp_path / "model.ss").read_text().splitlines()[3].split()[:6], int)
        assert owned.sum() == model.states
        assert not owned[[dof not in model.dofs for dof in DOFS]].any()


def test_the_density_goes_along_from_file_to_file(fit, tmp_path):
    """WEC-Sim multiplies by the density of its own file: a fit of salt water stays one on its way through .json."""
    assert fit.data.rho == 1025.0
    with h5py.File(read_fit(fit.write(tmp_path / "fit.json")).write(tmp_path / "fit.h5")) as file:
        assert float(file["simulation_parameters/rho"][()].item()) == 1025.0
    again = read_fit(tmp_path / "fit.h5")
    assert again.density == 1025.0
    np.testing.assert_allclose(again.frequency_response(OMEGA), fit.frequency_response(OMEGA), rtol=1e-6, atol=1e-9)


def test_a_name_twice_is_refused_and_a_byte_order_mark_is_none_of_the_content(tmp_path):
    with pytest.raises(rss.InputError, match=r"\['Heave', 'Heave'\] hold a name twice"):
        rss.RadiationFit(("Heave", "Heave"), -np.eye(2), np.eye(2), np.eye(2), 1)
    fit = rss.RadiationFit(("Heave",), [[-1.0]], [[1.0]], [[2.0]], 1)
    path = fit.write(tmp_path / "fit.json")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert np.array_equal(rss.read_fit(path).c, fit.c)
