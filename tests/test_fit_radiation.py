"""fit_radiation against known truth and the laws that every fit must keep."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import block_diag

import radiation_ss as rss
from radiation_ss.errors import InputError
from radiation_ss.fit.port import Port
from radiation_ss.fit.rational import frequency_response, observer_form

OMEGA = np.linspace(0.5, 40.0, 80)
TANK = observer_form((1093.3195, 236.4745, 22.6247), (107.4617, 12.6381, 0.5801))  # Hanaki 2022, Table 3, Case-2


def data_of(a, b, c, omega=OMEGA, dofs=("Heave",), A_inf=None):
    n = len(dofs)
    K = frequency_response(a, b, c, omega)
    A_inf = 2.0 * np.eye(n) if A_inf is None else A_inf
    return rss.HydroData(omega, A_inf + K.imag / omega[:, None, None], K.real, A_inf, dofs=dofs)


def random_passive(states, m, seed, zero=False):
    rng = np.random.default_rng(seed)
    port = Port.of(states, m, zero)
    a, b = port.realise(rng.uniform(0.4, 1.5, port.size) * rng.choice([-1.0, 1.0], port.size))
    return a, b, b.T


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


def test_value_at_zero_holds():
    data = data_of(*TANK)
    fit = rss.fit_radiation(data, 3, at_zero=0.08)
    assert_allclose(fit.frequency_response(0.0), [[[0.08]]], rtol=1e-9)


@settings(max_examples=15, deadline=None)
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
