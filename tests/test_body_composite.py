"""The composite against python-control's own feedback and the frequency-domain equation of motion."""

import control as ct
import numpy as np
import pytest
from plant_bodies import coupled_model, tank_fit, tank_model

import radiation_ss as rss
from radiation_ss import as_model


@pytest.mark.parametrize("model", [tank_model(), coupled_model(), coupled_model(("Surge", "Heave", "Pitch"), 3)])
def test_composite_is_the_equation_of_motion_in_the_frequency_domain(model):
    omega = np.geomspace(0.01, 100.0, 40)
    n = model.n
    w = omega[:, None, None]
    dynamic = model.C - w**2 * (model.M + model.A_inf) + 1j * w * (model.fit.frequency_response(omega) + model.D)
    expected = np.linalg.inv(dynamic)
    response = np.moveaxis(np.asarray(ct.frequency_response(rss.cummins(model), omega, squeeze=False).frdata), -1, 0)
    assert response[:, :n] == pytest.approx(expected, rel=1e-8)
    assert response[:, n:2 * n] == pytest.approx(1j * w * expected, rel=1e-8)
    assert response[:, 2 * n:] == pytest.approx(-(w**2) * expected, rel=1e-8)


def test_composite_is_the_feedback_of_body_and_radiation():
    model = coupled_model()
    body = rss.rigid_body(model)
    speeds = ct.ss(body.A, body.B, body.C[model.n:2 * model.n], body.D[model.n:2 * model.n])
    loop = ct.feedback(speeds, model.fit.to_ss())
    omega = np.geomspace(0.1, 10.0, 20)
    ours = ct.frequency_response(rss.cummins(model), omega).frdata[model.n:2 * model.n]
    assert ours == pytest.approx(ct.frequency_response(loop, omega).frdata, rel=1e-9)


def test_names():
    system = rss.cummins(coupled_model(("float__Heave", "spar__Heave")), name="rm3")
    assert system.input_labels == ["float_heave_force", "spar_heave_force"]
    assert system.output_labels == ["float_heave", "spar_heave", "float_heave_vel", "spar_heave_vel",
                                    "float_heave_acc", "spar_heave_acc"]
    assert system.state_labels[-4:] == ["float_heave", "spar_heave", "float_heave_vel", "spar_heave_vel"]
    assert system.name == "rm3"


def test_matrices_in_place_of_a_model():
    model = tank_model()
    by_hand = rss.cummins((model.M, model.C, model.A_inf), tank_fit())
    assert np.array_equal(by_hand.A, rss.cummins(model).A)


def test_spring_and_damper_shift_the_static_response():
    model = tank_model()
    moored = rss.cummins(model, stiffness={"Heave": 100.0}, damping=[[5.0]])
    assert moored.dcgain()[0] == pytest.approx(1.0 / (model.C[0, 0] + 100.0))
    w = 7.0
    extra = 1.0 / moored(1j * w)[0] - 1.0 / rss.cummins(model)(1j * w)[0]
    assert extra == pytest.approx([100.0 + 5.0j * w])


@pytest.mark.parametrize("call, words", [
    (lambda: rss.cummins(([[1.0]], [[1.0]], [[1.0]])), "fit"),
    (lambda: rss.cummins((1.0, 2.0), tank_fit()), "three matrices"),
    (lambda: rss.cummins(([[1.0]], [[1.0]], [[-3.0]]), tank_fit()), "positive definite"),
    (lambda: rss.cummins(tank_model(), tank_fit("Roll")), "degrees of freedom"),
    (lambda: rss.cummins(tank_model(), stiffness={"Roll": 1.0}), "Roll"),
    (lambda: rss.rigid_body(([[1.0]], [[1.0]], [[1.0]])), "dofs"),
    (lambda: rss.rigid_body(tank_model(), ["Pitch"]), "the body's are"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()


def test_model_with_another_memory():
    model = tank_model()
    assert as_model(model, tank_fit()).fit is not model.fit


@pytest.mark.parametrize("depth", [0.03, -0.2])
def test_about_the_centre_of_gravity_the_body_moves_the_same(depth):
    # (A.1)-(A.11): motion at O is T times motion at G; the force at G is T' times the force at O.
    model = coupled_model(("Sway", "Roll"), seed=4)
    about_g = model.at((0.0, 0.0, -depth), origin=(0.0, 0.0, 0.0))
    T = np.array([[1.0, -depth], [0.0, 1.0]])  # z up; the paper's y is down
    omega = np.geomspace(0.1, 10.0, 30)
    K = about_g.fit.frequency_response(omega)
    assert K == pytest.approx(T.T @ model.fit.frequency_response(omega) @ T, rel=1e-10)
    K_o, l_g = model.fit.frequency_response(omega), -depth  # the paper's products written out, (A.8)-(A.11)
    assert K[:, 0, 1] == pytest.approx(K_o[:, 0, 1] + l_g * K_o[:, 0, 0], rel=1e-9)
    assert K[:, 1, 1] == pytest.approx(K_o[:, 1, 1] + 2.0 * l_g * K_o[:, 0, 1] + l_g**2 * K_o[:, 0, 0], rel=1e-9)
    at_o, at_g = (np.moveaxis(ct.frequency_response(rss.cummins(m), omega).frdata[:2], -1, 0) for m in (model, about_g))
    assert T @ at_g @ T.T == pytest.approx(at_o, rel=1e-9)
    assert about_g.fit.passive and model.fit.passive
    back = about_g.at((0.0, 0.0, 0.0), origin=(0.0, 0.0, -depth))
    assert model.M == pytest.approx(back.M)


def test_point_of_a_model_without_data_must_be_said():
    with pytest.raises(rss.InputError, match="origin"):
        coupled_model().at((0.0, 0.0, -1.0))


def test_data_of_more_motions_than_the_fit_are_refused():
    model = coupled_model(("Heave", "Pitch"))
    omega = np.linspace(0.1, 30.0, 40)
    K = model.fit.frequency_response(omega)
    data = rss.HydroData(omega, model.A_inf + K.imag / omega[:, None, None], K.real, model.A_inf, dofs=model.dofs,
                         M=model.M, C=model.C)
    heave = model.fit.select(["Heave"])
    with pytest.raises(rss.InputError, match=r"fit: it is of Heave, and .* Pitch too; take data.select\(\['Heave'\]\)"):
        rss.cummins(data, heave)
    assert rss.cummins(data.select("Heave"), heave).input_labels == ["heave_force"]


def test_two_degrees_of_freedom_are_never_one_signal():
    pair = ("Float__Heave", "float__Heave")
    fit = rss.RadiationFit(pair, np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    with pytest.raises(rss.InputError, match="Float__Heave and float__Heave would both be the signal 'float_heave'"):
        rss.cummins(rss.Model(pair, np.eye(2), np.eye(2), np.eye(2), fit))
