"""The model as a value: its tolerances, what stands for it, a body without stiffness."""

import pickle

import control as ct
import numpy as np
import pytest
from plant_bodies import DENOMINATOR, NUMERATOR, coupled_model, tank_model

import radiation_ss as rss


def test_tolerances_travel_with_the_model():
    model = tank_model().replace(tolerance={"kernel": 0.2, "mass": 0.1})
    assert dict(model.tolerance) == {"mass": 0.1, "kernel": 0.2}
    assert dict(pickle.loads(pickle.dumps(model)).tolerance) == {"mass": 0.1, "kernel": 0.2}
    assert dict(model.attached(stiffness={"Heave": 1.0}).tolerance) == {"mass": 0.1, "kernel": 0.2}
    assert dict(tank_model().tolerance) == {}


@pytest.mark.parametrize("tolerance, words", [
    ({"masses": 0.1}, "'masses' is unknown"), ({"mass": 5.0}, "between 0 and 1"), ({"mass": np.nan}, "between 0 and 1"),
    ({"force": 0.0}, "between")])
def test_bad_tolerances_are_said(tolerance, words):
    with pytest.raises(rss.InputError, match=words):
        tank_model().replace(tolerance=tolerance)


@pytest.mark.parametrize("model", [tank_model(), coupled_model(), coupled_model(("float__Heave", "spar__Pitch"), 3)])
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_state_space_in_any_coordinates_is_its_model(model, seed):
    model = model.replace(D=0.1 * model.C)
    system = rss.cummins(model)
    if seed is not None:
        T = np.random.default_rng(seed).standard_normal(system.A.shape) + 3.0 * np.eye(system.nstates)
        system = ct.ss(np.linalg.solve(T, system.A @ T), np.linalg.solve(T, system.B), system.C @ T, system.D,
                       inputs=system.input_labels, outputs=system.output_labels)
    back = rss.as_model(system)
    assert back.dofs == model.dofs
    assert back.M == pytest.approx(model.M + model.A_inf, rel=1e-7) and not back.A_inf.any()
    for name in ("C", "D"):
        assert getattr(back, name) == pytest.approx(getattr(model, name), rel=1e-6, abs=1e-6 * np.abs(model.C).max())
    omega = np.geomspace(0.1, 10.0, 20)
    K = model.fit.frequency_response(omega)
    assert back.fit.frequency_response(omega) == pytest.approx(K, rel=1e-5, abs=1e-6 * np.abs(K).max())


def test_a_body_without_radiation_as_state_space():
    body = rss.rigid_body(tank_model())
    assert rss.as_model(body).fit.states == 0
    assert rss.as_model(body).C == pytest.approx(tank_model().C)


@pytest.mark.parametrize("system, words", [
    (ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, inputs=["u"], outputs=["heave", "heave_vel"]),
     "'u'"),
    (ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, inputs=["heave_force"], outputs=["heave", "v"]),
     "'heave_vel' is missing"),
    (ct.ss([[0.0, 2.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, inputs=["heave_force"],
           outputs=["heave", "heave_vel"]), "rate of change"),
    (ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.0]], np.eye(2), 0, inputs=["heave_force"],
           outputs=["heave", "heave_vel"]), "no inertia"),
    (ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, inputs=["bend_force"], outputs=["bend", "bend_vel"]),
     "'bend' is not one of"),
    (ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, 0.1, inputs=["heave_force"],
           outputs=["heave", "heave_vel"]), "continuous"),
    (3.0, "float found"),
])
def test_what_is_no_model_is_said(system, words):
    with pytest.raises(rss.InputError, match=words):
        rss.as_model(system, None if hasattr(system, "A") else tank_model().fit)


@pytest.mark.parametrize("made", [lambda: rss.cummins(tank_model(), 2), lambda: rss.Model.from_hydro(None, 2)])
def test_an_order_is_no_fit(made):
    with pytest.raises(rss.InputError, match=r"fit: a RadiationFit .*int found"):
        made()


def test_without_stiffness_a_steady_force_meets_only_the_slow_radiation():
    free = tank_model().replace(C=np.zeros((1, 1)))
    system = rss.cummins(free)
    push = ct.forced_response(system, np.linspace(0.0, 400.0, 40001), np.full((1, 40001), 2.0))
    # Against a steady force only K(0) works: the speed goes to f / K(0), K(0) the ratio of the constant terms (23).
    assert push.outputs[1, -1] == pytest.approx(2.0 * DENOMINATOR[0] / NUMERATOR[0], rel=1e-3)


def test_a_negative_stiffness_is_no_oscillation_and_named_where_it_is_read_checked_and_simulated():
    omega = np.linspace(0.1, 30.0, 60)
    K = tank_model().fit.frequency_response(omega)
    A_inf = tank_model().A_inf
    data = rss.HydroData(omega, A_inf + K.imag / omega[:, None, None], K.real, A_inf, dofs=("Heave",),
                         M=tank_model().M, C=-tank_model().C)
    words = "C < 0 in Heave: the body is statically unstable"
    with pytest.warns(rss.errors.InputWarning, match=words):
        model = rss.Model.from_hydro(data, tank_model().fit)
    assert "statically unstable (C < 0)" in str(model) and "period" not in str(model)
    assert words in data.check().text()
    time = np.linspace(0.0, 60.0, 601)
    with pytest.raises(rss.errors.SolverError, match=f"{words} there$"):
        rss.simulate(model, (time, np.ones((1, time.size))))


@pytest.mark.parametrize("which, remedy", [("A_inf", r"data.clean\(symmetric=True\)"), ("M", "check the mass matrix")])
def test_an_inertia_that_is_not_symmetric_makes_energy_and_is_named_by_fit_and_composite(which, remedy):
    model = coupled_model(("Heave", "Pitch"))
    known = {"M": model.M, "A_inf": model.A_inf}
    shift = 0.2 * np.sqrt(np.prod(np.diag(model.M + model.A_inf)))
    known[which] = known[which] + np.array([[0.0, shift], [-shift, 0.0]]) / 2.0
    words = f"{which} of Heave-Pitch and of its transpose differ by 20 % of the inertia.*not passive.*{remedy}"
    with pytest.warns(rss.errors.InputWarning, match=words):
        body = rss.cummins((known["M"], model.C, known["A_inf"]), model.fit)
    omega = np.linspace(0.1, 30.0, 400)
    response = body(1j * omega)[2:4]        # velocities by forces: of a passive body its Hermitian part is not negative
    hermitian = 0.5 * (response + np.conj(np.swapaxes(response, 0, 1))).transpose(2, 0, 1)
    assert np.linalg.eigvalsh(hermitian).min() < -0.01 * np.linalg.eigvalsh(hermitian).max()
    K = model.fit.frequency_response(omega)
    A = known["A_inf"] + K.imag / omega[:, None, None]
    data = rss.HydroData(omega, A, K.real, known["A_inf"], dofs=model.dofs, M=known["M"], C=model.C)
    with pytest.warns(rss.errors.InputWarning, match=words):
        fit = rss.fit_radiation(data, 3)
    assert fit.passive
    with pytest.warns(rss.errors.InputWarning, match=words):
        rss.cummins(data, fit)


def test_only_motions_with_negative_stiffness_are_statically_unstable():
    model = coupled_model(("Heave", "Pitch"))
    c = np.diag(model.C)
    assert "unstable" not in str(model.replace(C=np.diag([c[0], 0.0])))
    one = str(model.replace(C=np.diag([c[0], -0.1 * c[1]]))).splitlines()
    assert "period" in one[1] and "unstable" in one[2]
    coupled = 1.1 * np.sqrt(c[0] * c[1])            # both diagonals positive: the matrix is not
    assert str(model.replace(C=[[c[0], coupled], [coupled, c[1]]])).count("statically unstable") == 2
