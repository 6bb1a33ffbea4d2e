"""fit_radiation against known truth and the laws that every fit must keep."""

import os
import signal
import threading

import numpy as np
import pytest
from fit_systems import data_of, random_passive
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import block_diag

import radiation_ss as rss
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.fit import block_problem, frequency_response, observer_form, order_of, solved

TANK = observer_form((1093.3195, 236.4745, 22.6247), (107.4617, 12.6381, 0.5801))  # Hanaki 2022, Table 3, Case-2


@pytest.mark.parametrize("handler", [signal.default_int_handler, None])
def test_an_interrupt_inside_ipopt_is_raised(handler, capfd):
    """IPOPT returns as if it were done; a program whose handler raises nothing goes on."""
    import casadi as cs

    x = cs.SX.sym("x", 60)
    weights = np.random.default_rng(0).standard_normal((60, 60))
    slow = cs.nlpsol("slow", "ipopt", {"x": x, "f": cs.sumsqr(cs.sin(weights @ x)) + 1e-3 * cs.sumsqr(x)}, {
        "ipopt": {"hessian_approximation": "limited-memory", "tol": 1e-300, "acceptable_iter": 0, "max_iter": 10**6,
                  "max_wall_time": 1.5, "print_level": 0, "sb": "yes"}, "print_time": False})
    seen = []
    before = signal.signal(signal.SIGINT, handler or (lambda *_: seen.append(1)))
    press = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    press.start()
    try:
        if handler:
            with pytest.raises(KeyboardInterrupt):
                solved(slow, x0=np.ones(60))
        else:
            assert solved(slow, x0=np.ones(60))[0] and seen
    finally:
        press.join()
        assert signal.signal(signal.SIGINT, before) is not None
    assert "WARNING" not in capfd.readouterr().err


def test_known_system_is_found_again():
    data = data_of(*TANK)
    fit = rss.fit_radiation(data, 3)
    assert fit.states == 3 and fit.stable and fit.passive
    assert fit.relative_error < 1e-5
    assert_allclose(np.sort_complex(np.linalg.eigvals(fit.a)), np.sort_complex(np.linalg.eigvals(TANK[0])), rtol=1e-3)
    assert_allclose(fit.kernel([0.0, 0.1, 0.5])[:, 0, 0],
                    data_kernel := rss.RadiationFit(("Heave",), *TANK, order=3).kernel([0.0, 0.1, 0.5])[:, 0, 0],
                    atol=1e-4 * data_kernel[0])


@pytest.mark.parametrize("seed", range(3))
def test_joint_fit_is_passive_reciprocal_and_close(seed):
    truth = random_passive(6, 2, seed)
    data = data_of(*truth, omega=np.linspace(0.05, 6.0, 60), dofs=("Surge", "Pitch"))
    fit = rss.fit_radiation(data, 4)
    K = fit.frequency_response(np.linspace(0.0, 180.0, 4001))
    eigenvalues = np.linalg.eigvalsh(0.5 * (K + np.conj(np.swapaxes(K, 1, 2))))
    assert eigenvalues.min() >= -1e-9 * eigenvalues.max()
    assert_allclose(K, np.swapaxes(K, 1, 2), atol=1e-12 * np.abs(K).max())
    assert fit.passive and fit.relative_error < 0.05


def test_uncoupled_degrees_of_freedom_share_no_states():
    systems = [random_passive(4, 2, 1), random_passive(2, 1, 2)]
    a = block_diag(*[s[0] for s in systems])
    b = block_diag(*[s[1] for s in systems])
    data = data_of(a, b, b.T, omega=np.linspace(0.05, 6.0, 60), dofs=("Surge", "Pitch", "Heave"))
    fit = rss.fit_radiation(data.select(["Surge", "Heave", "Pitch"]), 2)
    assert fit.blocks == (("Surge", "Pitch"), ("Heave",))
    assert np.all(fit.frequency_response(1.0)[0, 1, [0, 2]] == 0.0)


@pytest.mark.parametrize("order", [3, 4])
def test_zero_and_points_hold_exactly(order):
    truth = random_passive(6, 1, 5, zero=True)
    omega = np.linspace(0.05, 6.0, 120)
    data = data_of(*truth, omega=omega)
    points = omega[[30, 70]] if order == 4 else omega[[40]]
    fit = rss.fit_radiation(data, order, at_zero="zero", points=points)
    wanted = data.K[np.isin(omega, points)]
    assert_allclose(fit.frequency_response(points), wanted, rtol=1e-8)
    assert abs(fit.frequency_response(0.0)[0, 0, 0]) < 1e-12 * np.abs(data.K).max()
    assert fit.passive


def test_points_of_a_matrix_hold_exactly():
    truth = random_passive(8, 2, 1, zero=True)
    data = data_of(*truth, omega=np.linspace(0.05, 6.0, 60), dofs=("Surge", "Pitch"))
    point = data.omega[20]
    fit = rss.fit_radiation(data, 6, at_zero="zero", points=[point])
    assert_allclose(fit.frequency_response(point)[0], data.K[20], atol=1e-8 * np.abs(data.K[20]).max(), rtol=0.0)
    assert fit.passive and np.abs(fit.frequency_response(0.0)).max() < 1e-12 * np.abs(data.K).max()


@pytest.mark.parametrize("points, said", [({7.0: 1.0}, "frequencies, as"), ("abc", "not an array of numbers"),
                                          ([[4.0, 5.0]], "shape"), ([99.0], "outside the data")])
def test_points_that_are_no_frequencies_of_the_data_are_refused(points, said):
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 22.0, 20)).select("Heave")
    with pytest.raises(rss.InputError, match=f"points: .*{said}"):
        rss.fit_radiation(data, 3, points=points)


def test_points_that_cost_the_fit_are_warned_of_and_make_no_feedthrough():
    section = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 30)).select(("Sway", "Roll"))
    with pytest.warns(InputWarning, match="more states than order 3"):
        fit = rss.fit_radiation(section, 3, points=[5.0])
    assert np.abs(np.linalg.eigvals(fit.a)).max() < 20.0 * section.omega[-1]
    free = rss.fit_radiation(section, 3)
    assert f"relative error is {fit.relative_error:.2g}, without them {free.relative_error:.2g}" in fit.notes[-1]


def test_points_of_an_asymmetric_matrix_are_met_by_its_mean_and_said():
    data = data_of(*random_passive(8, 2, 1), omega=np.linspace(0.05, 6.0, 60), dofs=("Surge", "Pitch"))
    B, point = data.B.copy(), float(data.omega[20])
    B[:, 0, 1] *= 1.01
    fit = rss.fit_radiation(data.replace(B=B), 6, points=[point])
    K = data.replace(B=B).K[20]
    assert_allclose(fit.frequency_response(point)[0], 0.5 * (K + K.T), rtol=1e-6)
    assert "not symmetric there, Surge-Pitch by up to 0." in fit.notes[0]


def test_contradictory_points_are_refused():
    data = data_of(*TANK)
    bad = data.replace(B=np.where(data.omega[:, None, None] > 30.0, -0.01, data.B))
    with pytest.raises(InputError, match="no passive model can meet"):
        rss.fit_radiation(bad, 3, points=[35.0])


def test_price_of_passivity_and_free_fit():
    # Table 3, 2D-BEM: not passive above 34.9 rad/s, so the passive fit must differ and the free one need not.
    data = data_of(*observer_form((1130.3213, 230.9063, 22.0178), (105.7441, 12.9617, 0.5849)))
    passive = rss.fit_radiation(data, 3)
    free = rss.fit_radiation(data, 3, passive=False)
    assert passive.passive and not free.passive and free.stable
    assert free.relative_error < 1e-5 < passive.relative_error < 0.02
    assert passive.price_of_passivity() == (passive.relative_error, free.relative_error)


def test_papers_method_is_there_to_compare():
    data = data_of(*TANK, omega=np.linspace(0.2, 80.0, 400))
    fit = rss.fit_radiation(data, 3, method="quasi-newton")
    assert fit.states == 3 and fit.method == "quasi-newton"
    t = np.linspace(0.0, 0.4, 30)
    truth = rss.RadiationFit(("Heave",), *TANK, order=3).kernel(t)
    assert np.abs(fit.kernel(t) - truth).max() < 0.1 * truth.max()


@pytest.mark.parametrize("omega", [[0.5, 1.0, 1.5, 3.0, 5.0], np.linspace(0.4, 6.0, 5), np.linspace(0.05, 1.0, 40)])
@pytest.mark.parametrize("passive", [True, False])
def test_exact_samples_are_met_however_few_and_wherever_the_band_ends(omega, passive):
    # 8 numbers in 10 equations. Resonances at 1.16 and 2.33 rad/s, narrower than such frequencies would resolve.
    a = block_diag([[-0.8, -1.5], [1.0, 0.0]], [[-1.5, -6.0], [1.0, 0.0]])
    b, c = np.array([[2e5], [0.0], [1e5], [0.0]]), np.array([[1.0, 0.0, 1.0, 0.0]])
    truth = data_of(a, b, c, np.linspace(0.0, 9.0, 50)[1:])
    fit = rss.fit_radiation(data_of(a, b, c, np.asarray(omega)), 4, passive=passive)
    miss = np.abs(fit.frequency_response(truth.omega) - truth.K).max()
    assert fit.relative_error < 1e-10 and miss < 1e-8 * np.abs(truth.K).max()


def test_the_free_fit_is_never_worse_than_the_passive_one(data):
    # WAMIT's sphere, all samples alike: the descent of the free form ended above the passive model.
    heave = rss.read_hydro(data / "bem" / "formats" / "sphere.1", rho=1000.0).select("Heave")
    passive, free = (rss.fit_radiation(heave, 6, passive=kind, weight=np.ones(420)) for kind in (True, False))
    assert free.relative_error <= passive.relative_error * (1.0 + 1e-9) and free.stable


def test_an_order_that_was_chosen_is_that_of_the_model():
    truth = data_of(*random_passive(4, 1, 7), omega=np.linspace(0.02, 8.4, 60))
    assert order_of(block_problem(truth, [0]), 3) == 3
    a, b, c = (block_diag(part, part) for part in random_passive(4, 1, 7))
    two = data_of(a, b, c, omega=truth.omega, dofs=("Surge", "Heave"))
    assert order_of(block_problem(two, [0, 1]), 7) == 4  # motions that do not couple: parts


def test_order_is_chosen_and_the_path_kept():
    # Two resonances apart from each other: order 4, no less.
    a = block_diag([[-0.4, 1.0], [-1.0, 0.0]], [[-1.2, 3.0], [-3.0, 0.0]])
    b = np.array([[1.0], [0.0], [1.5], [0.0]])
    fit = rss.fit_radiation(data_of(a, b, b.T, omega=np.linspace(0.05, 6.0, 150)), at_zero="zero")
    (path,) = fit.path
    assert fit.order == 4 and [trial.order for trial in path][:3] == [2, 3, 4]
    assert path[-1].held_out < 0.01 <= path[0].held_out
    assert len(fit.plot_path().axes) == 1


def test_spikes_are_listed_and_do_not_pull():
    clean = data_of(*random_passive(4, 1, 7, zero=True), omega=np.linspace(0.05, 6.0, 150))
    B = clean.B.copy()
    spiked = [40, 90]
    B[spiked] += 0.5 * B.max()
    B[120] = -0.05 * B.max()
    fit = rss.fit_radiation(clean.replace(B=B), 4, at_zero="zero")
    found = {(s.kind, s.omega) for s in fit.suspects}
    assert {("spike", clean.omega[k]) for k in spiked} | {("negative damping", clean.omega[120])} <= found
    K = fit.frequency_response(clean.omega)
    assert np.linalg.norm(K - clean.K) < 0.03 * np.linalg.norm(clean.K)
    assert fit.whole_error == pytest.approx(rss.audit(fit, fit.data).relative_error)
    assert f", relative error {fit.relative_error:.4f} ({fit.whole_error:.4f} with the samples that" in str(fit)


def test_noise_does_not_couple():
    rng = np.random.default_rng(0)
    a, b, c = random_passive(4, 1, 1)
    two = block_diag(a, a), block_diag(b, b), block_diag(c, c)
    data = data_of(*two, omega=np.linspace(0.05, 6.0, 80), dofs=("Surge", "Heave"))
    noise = 0.02 * data.B.max() * rng.normal(size=data.B.shape) * np.array([[0.0, 1.0], [1.0, 0.0]])
    fit = rss.fit_radiation(data.replace(B=data.B + noise), 4)
    assert fit.blocks == (("Surge",), ("Heave",))


def test_resonances_are_as_wide_as_the_data_resolve():
    rng = np.random.default_rng(2)
    data = data_of(*TANK, omega=np.linspace(0.5, 40.0, 30))
    noisy = data.replace(B=data.B + 0.05 * data.B.max() * rng.normal(size=data.B.shape))
    poles = np.linalg.eigvals(rss.fit_radiation(noisy, 8).a)
    oscillating = np.abs(poles.imag) > 1.0
    assert (poles.real[oscillating] < -0.4 * np.diff(data.omega)[0]).all()


@pytest.mark.parametrize("name, order", [("wecsim_sphere", 4), ("wecsim_cylinder", 4), ("wecsim_ellipsoid", 4)])
def test_industry_data_give_passive_models(data, name, order):
    arrays = np.load(data / "bem" / f"bem_{name}.npz")
    hydro = rss.HydroData(arrays["w"], arrays["A"], arrays["B"], arrays["Ainf"],
                          dofs=("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"))
    fit = rss.fit_radiation(hydro, order, at_zero="zero")
    grid = np.concatenate([[0.0], np.geomspace(1e-4, 30.0 * hydro.omega[-1], 3000)])
    K = fit.frequency_response(grid)
    size = np.sqrt(np.einsum("wii->wi", K).real.max(axis=0))
    radiates = np.ix_(np.arange(grid.size), size > 0.0, size > 0.0)  # a body of revolution makes no waves in yaw
    eigenvalues = np.linalg.eigvalsh((0.5 * (K + np.conj(np.swapaxes(K, 1, 2))))[radiates]
                                     / np.outer(size, size)[np.ix_(size > 0.0, size > 0.0)])
    assert eigenvalues.min() >= -1e-9 * eigenvalues.max()
    assert fit.stable and fit.passive and fit.relative_error < 0.08


def test_value_at_zero_holds():
    data = data_of(*TANK)
    fit = rss.fit_radiation(data, 3, at_zero=0.08)
    assert_allclose(fit.frequency_response(0.0), [[[0.08]]], rtol=1e-9)


@settings(max_examples=15)
@given(st.integers(2, 9), st.integers(1, 4), st.booleans(), st.integers(0, 2**32 - 1))
def test_port_form_is_positive_real_and_symmetric(states, m, zero, seed):
    a, b, c = random_passive(states, m, seed, zero)
    assert np.linalg.eigvalsh(a + a.T).max() <= 1e-12
    K = frequency_response(a, b, c, np.linspace(0.01, 10.0, 50))
    assert_allclose(K, np.swapaxes(K, 1, 2), atol=1e-9 * np.abs(K).max())


@pytest.mark.parametrize("options, message", [
    ({"order": 0}, "order: 0"),
    ({"order": 1, "at_zero": "zero"}, "order 2 at least"),
    ({"order": 3, "points": [100.0]}, "outside the data"),
    ({"order": 2, "points": [1.0, 2.0, 3.0, 4.0, 5.0]}, "more than order 2 can carry"),
    ({"order": 3, "at_zero": "origin"}, "at_zero: 'origin'"),
    ({"order": 3, "at_zero": -1.0}, "positive semidefinite"),
    ({"order": 3, "weight": [1.0, 2.0]}, "weight: shape"),
    ({"order": 90}, "more coefficients than 80 frequencies"),
    ({"order": 3, "method": "magic"}, "method: 'magic'"),
    ({"order": 3, "method": "quasi-newton", "points": [7.0]}, "cannot hold them"),
])
def test_bad_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        rss.fit_radiation(data_of(*TANK), **options)


def test_bad_data_are_named():
    data = data_of(*TANK)
    with pytest.raises(InputError, match="2 frequencies"):
        rss.fit_radiation(data.replace(omega=data.omega[:2], A=data.A[:2], B=data.B[:2]), 2)
    still = data.replace(A=np.broadcast_to(data.A_inf, data.A.shape), B=np.zeros(data.B.shape))
    with pytest.raises(InputError, match="K is zero"):
        rss.fit_radiation(still, 2)


def test_a_fit_that_does_not_follow_its_data_names_the_motion_and_why():
    data = data_of(*TANK)
    negative = data.replace(B=-data.B)
    with pytest.warns(InputWarning, match="K of Heave, whose damping B is negative on average: no passive model does"):
        rss.fit_radiation(negative, 2)
    assert "negative damping" in {found.kind for found in negative.check().problems}
    both = block_diag(TANK[0], TANK[0]), block_diag(TANK[1], TANK[1]), block_diag(TANK[2], TANK[2])
    B = (two := data_of(*both, dofs=("Heave", "Sway"))).B.copy()
    B[:, 1, 1] *= -1.0
    with pytest.warns(InputWarning) as said:
        rss.fit_radiation(two.replace(B=B), 3)
    assert len(said) == 1 and "Sway" in str(said[0].message) and "Heave" not in str(said[0].message)


def test_an_estimated_A_inf_is_said_with_its_uncertainty():
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60)).select("Heave")
    made = rss.fit_radiation(data.replace(A_inf=None), 3)
    assert made.notes[0].startswith("A_inf estimated by Kramers-Kronig with standard uncertainty Heave ")
    assert made.A_inf[0, 0] == pytest.approx(data.A_inf[0, 0], rel=0.02)
    assert not any("A_inf" in note for note in rss.fit_radiation(data, 3).notes)


def test_too_few_frequencies_to_tell_a_missing_A_inf_are_said():
    data = data_of(*TANK, omega=np.array([3.0]))
    with pytest.raises(InputError, match="A_inf is missing, and 1 frequency cannot tell it"):
        rss.fit_radiation(data.replace(A_inf=None), 2)
    with pytest.raises(InputError, match="at least 3 are needed for a fit"):
        rss.fit_radiation(data, 2)
