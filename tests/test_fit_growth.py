"""What growth, signatures, the solvers' shares and many degrees of freedom must keep."""

import control as ct
import numpy as np
import pytest
from fit_systems import data_of, random_passive
from numpy.testing import assert_allclose
from scipy.special import j0

import radiation_ss as rss
from radiation_ss.errors import InputError
from radiation_ss.fit import frequency_response, port_of, to_polynomials

OMEGA = np.linspace(0.05, 6.0, 40)


def array_of(count, spacing=2.0):
    """Return point absorbers in a row: B_ij = B J0(k r_ij), and A by the Kramers-Kronig relation on a fine grid."""
    fine = np.arange(1, 4001) * 0.01
    shape = fine**3 * np.exp(-(fine**2))
    distance = spacing * np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    omega = np.linspace(0.0625, 3.9625, 40)      # midway between points of the fine grid
    K = np.zeros((omega.size, count, count), dtype=complex)
    for i, j in zip(*np.triu_indices(count)):
        B = shape * j0(fine**2 / 9.81 * 4.0 * distance[i, j])
        at = np.interp(omega, fine, B)
        principal = ((B - at[:, None]) / (omega[:, None] ** 2 - fine**2)).sum(axis=1) * 0.01
        K[:, i, j] = K[:, j, i] = at - 2j / np.pi * omega * principal
    A_inf = np.eye(count)
    return rss.HydroData(omega, A_inf + K.imag / omega[:, None, None], K.real, A_inf,
                         dofs=tuple(f"b{k}__Heave" for k in range(count)))


@pytest.mark.parametrize("n1, n2", [(2, 1), (1, 2)])
def test_odd_models_are_found_whichever_half_has_the_odd_state(n1, n2):
    # K = B1^T (s + D1 + G (s + D2)^-1 G^T)^-1 B1 with so many states in each half, two inputs.
    rng = np.random.default_rng(n1)
    G, b = rng.uniform(1.0, 2.0, (n1, n2)), rng.uniform(0.5, 1.5, (n1, 2))
    a = np.block([[-np.diag(rng.uniform(0.3, 0.8, n1)), G], [-G.T, -np.diag(rng.uniform(0.3, 0.8, n2))]])
    b = np.vstack([b, np.zeros((n2, 2))])
    data = data_of(a, b, b.T, omega=OMEGA, dofs=("Surge", "Pitch"))
    if n1 == 1:      # rank one: the two inputs are one motion
        assert rss.fit_radiation(data, 3).relative_error < 1e-3
    else:
        assert min(rss.fit_radiation(data, order).relative_error for order in (2, 3)) < 1e-3


def test_more_states_are_never_worse():
    data = data_of(*random_passive(7, 2, 5), omega=OMEGA, dofs=("Surge", "Pitch"))
    errors = [rss.fit_radiation(data, order, weight=np.ones(OMEGA.size)).relative_error for order in range(1, 5)]
    assert (np.diff(errors) <= 1e-3 * np.array(errors[:-1])).all()
    single = data.select("Surge")
    errors = [rss.fit_radiation(single, order, weight=np.ones(OMEGA.size)).relative_error for order in range(1, 7)]
    assert (np.diff(errors) <= 1e-3 * np.array(errors[:-1]) + 1e-7).all()


def test_chosen_order_is_never_worse_than_six():
    rng = np.random.default_rng(4)
    data = data_of(*random_passive(6, 2, 9), omega=OMEGA, dofs=("Surge", "Pitch"))
    noise = 0.03 * np.abs(data.B).max() * rng.normal(size=data.B.shape)
    noisy = data.replace(B=data.B + noise + np.swapaxes(noise, 1, 2))
    chosen, six = rss.fit_radiation(noisy), rss.fit_radiation(noisy, 6)
    assert chosen.path and chosen.relative_error <= 1.002 * six.relative_error


def test_the_result_says_which_solver_did_what():
    data = data_of(*random_passive(6, 2, 2), omega=OMEGA, dofs=("Surge", "Pitch"))
    (note,) = rss.fit_radiation(data, 2).notes
    assert note.startswith("Surge, Pitch: Levenberg-Marquardt from the modes") and "IPOPT" in note
    (note,) = rss.fit_radiation(data.select("Surge"), 3).notes
    assert note.startswith("Surge: Levenberg-Marquardt from the modes") and "IPOPT" in note


@pytest.mark.parametrize("n1, n2", [(1, 1), (2, 1), (1, 2), (2, 2), (3, 1)])
def test_an_entry_has_the_port_form_of_its_own_signature(n1, n2):
    rng = np.random.default_rng([n1, n2])
    G, b1 = rng.uniform(0.5, 2.0, (n1, n2)), rng.uniform(0.5, 1.5, (n1, 1))
    a = np.block([[-np.diag(rng.uniform(0.3, 0.9, n1)), G], [-G.T, -np.diag(rng.uniform(0.3, 0.9, n2))]])
    b = np.vstack([b1, np.zeros((n2, 1))])
    e1, e2, H, V = port_of(*to_polynomials(a, b, b.T))
    assert (e1.size, e2.size) == (n1, n2)
    found = np.block([[-np.diag(e1**2), H], [-H.T, -np.diag(e2**2)]]), np.vstack([V, np.zeros((n2, 1))])
    K = frequency_response(a, b, b.T, OMEGA)
    # A start, inverted through roots of Gramians: half the digits at worst, far below the error of any fit.
    assert_allclose(frequency_response(*found, found[1].T, OMEGA), K, atol=1e-4 * np.abs(K).max(), rtol=0.0)


def test_a_spike_of_a_coupling_that_is_not_reciprocal_is_not_followed():
    clean = array_of(2).replace(dofs=("a", "b"))
    B, fit = clean.B.copy(), rss.fit_radiation(clean, 2)
    B[10, 0, 1] += 0.3 * np.abs(clean.B).max()
    K, other = (f.frequency_response(clean.omega) for f in (fit, rss.fit_radiation(clean.replace(B=B), 2)))
    assert np.linalg.norm(other - K) < 0.01 * np.linalg.norm(K)


@pytest.mark.filterwarnings("ignore:.*with the values met that were asked for")
@pytest.mark.parametrize("omega", [1.98, 2.0])
def test_points_that_rounding_spoils_are_projected_and_said(data, omega):
    # Two coaxial bodies in heave radiate one wave: the damping has rank one, and 1e-7 of rounding makes it indefinite.
    # At 1.98 rad/s it is singular, to 9e-10, and no solver meets that exactly.
    arrays = np.load(data / "bem" / "bem_wecsim_rm3.npz")
    pair = rss.HydroData(arrays["w"], arrays["A"], arrays["B"], arrays["Ainf"],
                         dofs=tuple(f"{body}__{k}" for body in "ab" for k in range(6))).select(("a__2", "b__2"))
    fit = rss.fit_radiation(pair, 4, at_zero="zero", points=[omega])
    at = int(np.flatnonzero(np.isclose(pair.omega, omega))[0])
    assert any("projected" in note for note in fit.notes) and fit.passive
    size = np.sqrt(np.abs(np.einsum("wii->wi", pair.K)).max(axis=0))
    mean = 0.5 * (pair.K[at] + pair.K[at].T)
    assert np.abs((fit.frequency_response(omega)[0] - mean) / np.outer(size, size)).max() < 5e-6


def test_points_beyond_rounding_are_refused_with_the_repair():
    bodies = array_of(2)
    worse = bodies.B + 0.5 * np.abs(bodies.B).max() * np.array([[-1.0, 1.0], [1.0, -1.0]])
    with pytest.raises(InputError, match=r"it; data.clean\(negative_damping=True\)"):
        rss.fit_radiation(bodies.replace(B=worse), 4, points=[float(bodies.omega[12])])


@pytest.mark.parametrize("even", [True, False])
def test_many_bodies_are_fitted_with_a_proof(even):
    # A row of equal spacing is its own mirror image: two parts, coupled within each only. A row with gaps is not.
    kept = range(12) if even else (0, 1, 3, 4, 5, 6, 8, 9, 11, 12, 13, 14)
    data = array_of(kept[-1] + 1).select([f"b{k}__Heave" for k in kept])
    fit = rss.fit_radiation(data, 4)
    assert fit.states == 48 and fit.passive and fit.passivity_margin == 0.0 and fit.relative_error < 0.1
    assert ("2 parts that symmetry decouples" if even else "L-BFGS") in fit.notes[0]
    K = fit.frequency_response(np.r_[0.0, np.geomspace(1e-3, 100.0, 400)])
    values = np.linalg.eigvalsh(0.5 * (K + np.conj(np.swapaxes(K, 1, 2))))
    assert values.min() >= -1e-12 * values.max()
    assert_allclose(K, np.swapaxes(K, 1, 2), atol=1e-10 * np.abs(K).max())


def test_frequency_response_data_are_fitted_as_they_are():
    system = ct.ss([[-0.4, 1.0], [-1.0, 0.0]], [[1.0], [0.0]], [[1.0, 0.0]], 0.0, inputs="u", outputs="y")
    frd = ct.frd(system, OMEGA)
    fitted = rss.fitfrd(frd, 2)
    assert fitted.nstates == 2 and fitted.input_labels == frd.input_labels
    assert_allclose(fitted(1j * OMEGA), system(1j * OMEGA), rtol=1e-5, atol=1e-6)
    data = data_of(*random_passive(4, 1, 3), omega=OMEGA)
    assert rss.fit_radiation(data.to_frd(), 4).dofs == ("heave",)
    with pytest.raises(InputError, match="frequencies above zero"):
        rss.fitfrd(ct.frd(system, np.r_[0.0, OMEGA]), 2)
    with pytest.raises(InputError, match=r"discrete response \(dt = 0.1 s\)"):
        rss.fitfrd(ct.FRD(frd.frdata, OMEGA, dt=0.1), 2)
    with (pytest.warns(rss.errors.InputWarning, match="passive=False"),      # feeds energy in: no passive model is near
          pytest.warns(rss.errors.InputWarning, match="negative on average")):
        rss.fitfrd(-1.0 * frd, 2)
    with pytest.raises(InputError, match="list found"):
        rss.fit_radiation([1.0, 2.0], 2)


@pytest.mark.parametrize("order", [2.5, "3", True])
def test_orders_are_whole_numbers(order):
    with pytest.raises(InputError, match="whole number of states"):
        rss.fit_radiation(data_of(*random_passive(4, 1, 3), omega=OMEGA), order)


def test_texts_are_short_and_notebooks_get_a_picture():
    fit = rss.fit_radiation(data_of(*random_passive(4, 1, 3), omega=OMEGA), 4)
    assert len(repr(fit).splitlines()) <= 10 and len(repr(rss.audit(fit, fit.data)).splitlines()) <= 10
    assert "<svg" in fit._repr_html_() and "<svg" not in fit.replace(data=None)._repr_html_()


def troubled(kind, seed):
    """Return two coupled motions with what public files have: a step, a spike, noise, or dense samples."""
    rng = np.random.default_rng(seed)
    omega = np.linspace(0.05, 6.0, 330 if kind == "dense" else 90)
    data = data_of(*random_passive(7, 2, seed), omega=omega, dofs=("Surge", "Pitch"))
    A, B = data.A.copy(), data.B.copy()
    at = int(rng.integers(40, 70))
    if kind == "step":        # OC3's yaw: the added mass jumps by a tenth and stays
        A[at:, 1, 1] -= 0.1 * np.abs(data.K[:, 1, 1]).max() / omega[at]
    if kind == "spike":       # an irregular frequency, larger than all else (ITI barge)
        B[at, 0, 0] += 20.0 * np.abs(data.K[:, 0, 0]).max()
    if kind in ("noise", "dense"):
        noise = 0.05 * np.abs(B).max() * rng.normal(size=B.shape)
        B += noise + noise.swapaxes(1, 2)
    return data.replace(A=A, B=B)


@pytest.mark.parametrize("kind, seed", [("step", 2), ("spike", 1), ("noise", 1), ("dense", 1)])
def test_more_states_are_never_worse_on_troubled_data(kind, seed):
    data = troubled(kind, seed)
    for part in (data, data.select("Pitch")):
        errors = np.array([rss.fit_radiation(part, order).relative_error for order in (4, 6, 7, 8)])
        assert (errors[1:] <= 1.001 * np.minimum.accumulate(errors)[:-1] + 1e-6).all(), errors


def test_a_large_spike_does_not_rule_the_fit():
    data = troubled("spike", 1)
    fit = rss.fit_radiation(data, 8)
    clean = np.abs(data.B[:, 0, 0] - np.median(data.B[:, 0, 0])) < 5.0 * np.abs(data.B[:, 1, 1]).max()
    miss = (data.K - fit.frequency_response(data.omega))[clean]
    assert fit.suspects and np.linalg.norm(miss) < 0.3 * np.linalg.norm(data.K[clean])


def test_what_the_fit_leaves_out_is_said():
    clean = array_of(2)
    B, A = np.zeros((40, 3, 3)), np.broadcast_to(np.eye(3), (40, 3, 3)).copy()
    B[:, :2, :2], A[:, :2, :2] = clean.B, clean.A
    B[:, 2, 2] = 1e-8 * np.random.default_rng(0).normal(size=40)
    data = rss.HydroData(clean.omega, A, B, np.eye(3), dofs=("Surge", "Sway", "Heave"))
    fit = rss.fit_radiation(data, 3)
    assert fit.blocks == (("Surge", "Sway"),) and fit.states == 6 and np.isnan(fit.entry_error[2, 2])
    assert [part.size for part in fit.polynomials("Heave", "Heave")] == [0, 0] and fit.select(["Heave"]).states == 0
    assert fit.relative_error < 0.1 and "Heave: no radiation but numerical noise" in fit.notes[-1]
    assert rss.audit(fit, data).relative_error == pytest.approx(fit.whole_error, rel=1e-6)
    # Modes of one's own have units of their own: a small one is not noise.
    own = data.replace(dofs=("Surge", "Sway", "bending"))
    with pytest.warns(rss.errors.InputWarning, match="does not follow K of bending"):
        assert ("bending",) in rss.fit_radiation(own, 2).blocks
    B[:, 0, 1] += 5.0 * np.abs(B).max()
    with pytest.warns(rss.errors.InputWarning, match="does not follow K of Surge"):
        notes = rss.fit_radiation(data.replace(B=B), 3).notes
    assert any("the data themselves hold" in note for note in notes)


def test_few_frequencies_make_no_pole_far_beyond_them():
    """What does not fall within the band looks like a feedthrough, which a pole at -1000 rad/s would make."""
    omega = np.linspace(0.3, 2.0, 12)
    K = (0.2 + 1j * omega / (1.0 + 0.9j * omega - omega**2))[:, None, None]
    data = rss.HydroData(omega, 1.0 + K.imag / omega[:, None, None], K.real, [[1.0]], dofs=("Heave",))
    for order in (2, 3, 4):
        fit = rss.fit_radiation(data, order)
        assert np.abs(np.linalg.eigvals(fit.a)).max() < 60.0 and fit.relative_error < (0.1 if order == 2 else 0.01)


def test_a_free_fit_keeps_its_poles_near_the_band_and_is_no_worse_than_the_passive_one():
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), gyradius=0.07)
    data = section.select(["Sway", "Roll"])
    free, passive = rss.fit_radiation(data, 4, passive=False), rss.fit_radiation(data, 4)
    assert free.stable and np.abs(np.linalg.eigvals(free.a)).max() < 320.0
    assert free.relative_error <= passive.relative_error


def test_a_point_between_the_frequencies_is_met_near_the_truth():
    data = data_of(*random_passive(5, 1, 3), omega=np.linspace(0.2, 6.0, 30), dofs=("Heave",))
    fine = data_of(*random_passive(5, 1, 3), omega=np.linspace(0.2, 6.0, 59), dofs=("Heave",))
    at = np.arange(11, 49, 8)  # halfway
    line = 0.5 * (data.K[at // 2, 0, 0] + data.K[at // 2 + 1, 0, 0]) - fine.K[at, 0, 0]
    met = [rss.fit_radiation(data, 6, points=[fine.omega[k]]) for k in at]
    off = [fit.frequency_response(fine.omega[[k]])[0, 0, 0] - fine.K[k, 0, 0] for k, fit in zip(at, met)]
    assert np.median(np.abs(off)) < 0.3 * np.median(np.abs(line))
    assert all("lie between the frequencies" in fit.notes[0] for fit in met)


def test_a_coupled_fit_of_order_one_without_damping_at_rest_is_refused():
    with pytest.raises(rss.InputError, match="needs order 2"):
        rss.fit_radiation(array_of(2), 1, at_zero="zero")


@pytest.mark.parametrize("seed", range(3))
def test_couplings_that_contradict_their_transpose_put_no_damping_on_the_motions(seed):
    """Both couplings too large, by different amounts: no passive model follows their mean."""
    clean = data_of(*random_passive(4, 2, seed), omega=np.linspace(0.2, 6.0, 40), dofs=("Sway", "Roll"))
    B, other = clean.B.copy(), ([0, 1], [1, 0])
    size = np.sqrt(np.abs(clean.K[:, 0, 0]).max() * np.abs(clean.K[:, 1, 1]).max())
    B[:, *other] += np.sign(B[:, *other]) * [0.1, 0.5] * size
    fit = rss.fit_radiation(clean.replace(B=B), 4)
    K = fit.frequency_response(clean.omega)
    for i in range(2):
        assert np.linalg.norm(K[:, i, i] - clean.K[:, i, i]) < 0.03 * np.linalg.norm(clean.K[:, i, i])


def irregular(data, at, residue):
    """Return data with an undamped resonance at a frequency of residue `residue` of the largest |K| times it."""
    K = residue * np.abs(data.K).max() * data.omega / (at**2 - data.omega**2)
    return data.replace(A=data.A + (K / data.omega)[:, None, None])


@pytest.mark.parametrize("order", [4, 6])
def test_the_beginning_of_a_resonance_above_the_band_is_told_and_not_followed(order):
    truth = data_of(*random_passive(4, 1, 7, zero=True), omega=np.linspace(0.02, 8.4, 210))
    data = irregular(truth, 8.6, 0.3)
    assert np.abs(data.K[-1]).max() > 0.3 * np.abs(truth.K).max()
    fit = rss.fit_radiation(data, order)
    K, below = fit.frequency_response(truth.omega), truth.omega < 7.0
    assert np.linalg.norm((K - truth.K)[below]) < 0.06 * np.linalg.norm(truth.K[below])
    assert {"not causal"} == {s.kind for s in fit.suspects}
    assert any("just above it: Heave 8.6 rad/s" in f.message for f in data.check().findings)


def test_the_flanks_of_an_irregular_frequency_are_doubted_with_it():
    truth = data_of(*random_passive(4, 1, 7), omega=np.linspace(0.02, 8.4, 210))
    fit = rss.fit_radiation(irregular(truth, 4.02, 0.005), 6)
    assert {3.989, 4.03, 4.07} <= {round(s.omega, 3) for s in fit.suspects}


@pytest.mark.parametrize("order, most", [(4, 0.02), (6, 0.03)])
def test_two_programs_runs_of_one_sphere_give_one_model(data, order, most):
    # WAMIT's ends in an irregular frequency, which Capytaine's, with a lid, has not.
    wamit = rss.read_hydro(data / "bem" / "formats" / "sphere.1", rho=1000.0).select("Heave")
    other = rss.read_hydro(data / "bem" / "formats" / "sphere_capytaine.nc").select("Heave").with_A_inf()
    assert rss.audit(rss.fit_radiation(wamit, order), other).relative_error < most


@pytest.mark.parametrize("at_zero", ["zero", "free"])
def test_no_resonance_is_invented_above_the_band(data, at_zero):
    # Damping and added mass of an ellipsoid fall smoothly where the file ends: nothing resonates above.
    arrays = np.load(data / "bem" / "bem_wecsim_ellipsoid.npz")
    known = arrays["w"] > 0.0
    body = rss.HydroData(arrays["w"][known], arrays["A"][known][:, 2:3, 2:3], arrays["B"][known][:, 2:3, 2:3],
                         arrays["Ainf"][2:3, 2:3], dofs=("Heave",), rho=1.0)
    fit = rss.fit_radiation(body, 8, at_zero=at_zero)
    above = np.abs(fit.frequency_response(np.linspace(1.0, 10.0, 20000) * body.omega[-1]))
    assert above.max() < np.abs(body.K).max() and fit.relative_error < 0.03


@pytest.mark.parametrize("name", ["mss_tanker", "mss_fpso"])
def test_a_joint_fit_is_the_same_at_any_scale_in_any_order_and_for_any_axes(data, name):
    arrays, dofs = np.load(data / "bem" / f"{name}.npz"), ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
    known = arrays["w"] > 0.0
    parts = arrays["A"][known], arrays["B"][known], arrays["Ainf"]

    def fitted(order=range(6), signs=(1.0,) * 6, ratio=1.0):
        order, turn = list(order), np.array(signs) * ratio ** np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
        A, B, A_inf = (part * np.outer(turn, turn) for part in parts)  # Froude's law, with the units below
        A, B, A_inf = (part[..., order, :][..., order] for part in (ratio**3 * A, ratio**2.5 * B, ratio**3 * A_inf))
        body = rss.HydroData(arrays["w"][known] / np.sqrt(ratio), A, B, A_inf, dofs=[dofs[k] for k in order])
        K = rss.fit_radiation(body, 4, at_zero="zero").frequency_response(np.array([0.3, 0.5, 0.9]) / np.sqrt(ratio))
        back = np.argsort(order)
        return K[:, back][:, :, back] / (ratio**2.5 * np.outer(turn, turn))

    first = fitted()
    size = np.sqrt(np.abs(np.einsum("wii->wi", first)).max(axis=0))
    flipped = fitted(signs=(1.0, -1.0, -1.0, 1.0, -1.0, -1.0))
    for other in (fitted(order=(4, 2, 0, 5, 3, 1)), flipped, fitted(ratio=0.02)):
        assert_allclose(other / np.outer(size, size), first / np.outer(size, size), atol=1e-7)
