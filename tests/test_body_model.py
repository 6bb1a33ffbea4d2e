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


def test_without_stiffness_a_steady_force_meets_only_the_slow_radiation():
    free = tank_model().replace(C=np.zeros((1, 1)))
    system = rss.cummins(free)
    push = ct.forced_response(system, np.linspace(0.0, 400.0, 40001), np.full((1, 40001), 2.0))
    # Against a steady force only K(0) works: the speed goes to f / K(0), K(0) the ratio of the constant terms (23).
    assert push.outputs[1, -1] == pytest.approx(2.0 * DENOMINATOR[0] / NUMERATOR[0], rel=1e-3)
