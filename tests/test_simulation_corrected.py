"""The corrected model as a linear one: equivalent linearisation, table of coefficients, file."""

import control as ct
import numpy as np
import pytest
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.effects import activate
from radiation_ss.errors import InputError
from radiation_ss.simulation import Corrected, equivalent, linearise, read_corrected


def corrected(effects=(), nominal=None, **more):
    return Corrected(nominal or {}, activate(effects, ("Heave",)), {}, **more)


@pytest.mark.parametrize("name, values, k, b", [
    # Closed forms of the describing functions: 8/(3 pi) c a w, 3/4 k a^2, 4 F/(pi a w).
    ("quadratic_drag", {"coefficient": 60.0}, 0.0, 8.0 / (3.0 * np.pi) * 60.0 * 0.02 * 7.0),
    ("cubic_stiffness", {"stiffness": 5e4}, 0.75 * 5e4 * 0.02**2, 0.0),
    ("coulomb_friction", {"force": 0.4, "width": 1e-5}, 0.0, 4.0 * 0.4 / (np.pi * 0.02 * 7.0)),
    ("linear_damping", {"coefficient": 3.0}, 0.0, 3.0),
])
def test_equivalent_spring_and_damper_are_the_closed_forms(name, values, k, b):
    found = equivalent(tank_model(), corrected([(name, values)]).effects[0], 0.02, 7.0)
    # 128 samples of a period: the kink of a sign function is placed to 1/128 of it.
    assert found == pytest.approx((k, b), rel=1e-3, abs=1e-9 * max(k, b))


def test_linear_correction_gives_the_motion_that_simulate_gives():
    model, time = tank_model(), np.arange(0.0, 12.0, 0.01)
    force = np.sin(6.0 * time) * np.minimum(time, 1.0)
    found = corrected([("tank_resonance", {"coupling": 2.0, "frequency": 6.5, "damping_ratio": 0.05}),
                       ("linear_damping", {"coefficient": 4.0})],
                      {("nominal_inertia", "Heave"): 0.03, ("nominal_stiffness", "Heave"): -0.02,
                       ("nominal_kernel", "Heave"): 0.05, ("nominal_kernel_shape_1", "Heave"): 0.02})
    exact = rss.simulate(model, (time, force[None]), found.actives(model)).outputs[0]
    plant = found.to_ss(model)
    assert plant.state_labels == found.to_nlsys(model).state_labels
    linear = ct.forced_response(plant, time, force[None]).outputs[0]
    # The rollout interpolates the force by a cubic, forced_response by lines: h^2 w^2/8 of the force.
    assert np.abs(linear - exact).max() < 2e-3 * np.abs(exact).max()


@pytest.mark.parametrize("amplitude", [None, 5.0])
def test_lines_of_the_whole_body_are_linear_about_rest(amplitude):
    """Against a rollout whose motion is so small that only the slope at rest acts; frequencies differ by its square."""
    dofs, time = ("Surge", "Sway", "Yaw"), np.arange(0.0, 400.0, 0.5)
    rigid = rss.RadiationFit(dofs, np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), 0)
    model = rss.Model(dofs, np.diag([2e7, 2e7, 2e10]), np.diag([1e7, 1e7, 1e10]), np.zeros((3, 3)), rigid)
    lines, = activate([("mooring_lines",
                        {"Surge_Surge": 7e4, "Sway_Sway": 5e4, "Yaw_Yaw": 9e7, "Surge_Yaw_Yaw": 1e6})], dofs)
    found = Corrected({}, (lines,), {}, {dof: (1.0, 0.05) for dof in dofs})
    start = 1e-4 * np.array([1.0, -0.5, 0.001, 0.0, 0.0, 0.0])
    exact = rss.simulate(model, (time, np.zeros((3, time.size))), found.effects, start=start).outputs[:3]
    linear = ct.initial_response(found.to_ss(model, amplitude), time, start).outputs[:3]
    assert np.abs(linear - exact).max() < 1e-3 * np.abs(exact).max()


def test_a_model_of_any_name_becomes_a_system():
    """python-control allows no points in a system's name; a section's name says its breadth."""
    rigid = rss.RadiationFit(("Roll",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    model = rss.Model(("Roll",), [[2.0]], [[1.0]], [[50.0]], rigid, name="section: b = 0.1 m")
    found = corrected([])
    assert found.to_ss(model).name == found.to_nlsys(model).name == "section_b_0_1_m_corrected"


def test_corrected_model_has_the_plant_of_the_correction_and_its_table():
    model = tank_model()
    found = corrected([("linear_damping", {"coefficient": 4.0})],
                      {("nominal_inertia", "Heave"): 0.03, ("nominal_kernel", "Heave"): 0.05})
    better, plant = found.model(model), found.to_ss(model)
    at = 1j * np.linspace(1.0, 20.0, 30)
    assert rss.cummins(better)(at) == pytest.approx(plant(at), rel=1e-9)
    assert rss.cummins(better).state_labels == plant.state_labels == found.to_nlsys(model).state_labels
    assert better.A_inf[0, 0] + better.M[0, 0] == pytest.approx(1.03 * (model.A_inf + model.M)[0, 0])
    assert np.allclose(better.fit.frequency_response([5.0]), 1.05 * model.fit.frequency_response([5.0]))


def test_a_slower_memory_is_in_the_corrected_model_and_its_table():
    model, values = tank_model(), {"share": -0.1, "slower": 0.6, "longer": 0.5}
    better = corrected([("radiation_damping", values)]).model(model)
    w = np.linspace(1.0, 15.0, 30)
    a, b, c = model.fit.a, model.fit.b, model.fit.c

    def kernel(pace):
        return np.array([c @ np.linalg.solve(1j * each * np.eye(len(a)) - pace * a, b) for each in w])

    expected = (1.0 - 0.1 - 0.6) * kernel(1.0) + 0.6 * kernel(1.0 / 1.5)
    found = better.fit.to_ss()(1j * w)
    np.testing.assert_allclose(np.asarray(found).reshape(w.shape), expected[:, 0, 0], rtol=1e-9)
    assert better.fit.stable


def test_the_table_of_a_corrected_model_has_the_slower_memory():
    model = tank_model()
    omega = np.linspace(1.0, 15.0, 40)
    K = model.fit.frequency_response(omega)
    table = rss.HydroData(omega, model.A_inf + K.imag / omega[:, None, None], K.real, A_inf=model.A_inf,
                          dofs=("Heave",), M=model.M, C=model.C)
    body = model.replace(hydro=table)
    better = corrected([("radiation_damping", {"slower": 1.0, "longer": 0.5})]).model(body)
    # K(t / 1.5) has the transform 1.5 K(1.5 w).
    stretched = 1.5 * model.fit.frequency_response(1.5 * omega)
    np.testing.assert_allclose(better.hydro.B, stretched.real, rtol=1e-9)
    np.testing.assert_allclose(better.hydro.A, model.A_inf + stretched.imag / omega[:, None, None], rtol=1e-9)


def test_amplitude_is_asked_for_where_it_matters_and_only_there():
    model, drag = tank_model(), corrected([("quadratic_drag", {"coefficient": 60.0})])
    with pytest.raises(InputError, match="amplitude"):
        linearise(model, drag)
    assert linearise(model, drag, 0.0).D[0, 0] == 0.0
    assert linearise(model, corrected([("slow_drift", {"cosine": 1.0, "frequency": 0.3})])).left_out == (
        "slow_drift on Heave",)


def test_a_file_comes_back_as_it_was(tmp_path):
    found = corrected([("quadratic_drag", {"coefficient": 60.0})], {("nominal_inertia", "Heave"): 0.03},
                      motion={"Heave": (0.02, 7.0)})
    found.write(tmp_path / "corrected.json")
    again = read_corrected(tmp_path / "corrected.json", tank_model())
    assert again.to_dict() == found.to_dict()


@pytest.mark.parametrize(("other", "word"), [
    (lambda m: m.replace(M=1.2 * m.M), "inertia M [+] A_inf of Heave was"),
    (lambda m: m.replace(C=1.05 * m.C), "stiffness C of Heave was"),
    (lambda m: m.replace(dofs=("Pitch",), fit=m.fit.replace(dofs=("Pitch",))), "is of Heave, the model given has Pi")])
def test_the_file_of_another_body_is_refused(tmp_path, other, word):
    model, path = tank_model(), tmp_path / "corrected.json"
    found = corrected([("quadratic_drag", {"coefficient": 60.0})], motion={"Heave": (0.02, 7.0)},
                      body={"Heave": (float(model.M[0, 0] + model.A_inf[0, 0]), float(model.C[0, 0]))})
    found.write(path)
    assert read_corrected(path, model).to_dict() == found.to_dict()
    for use in (lambda body: read_corrected(path, body), found.model, found.to_ss, found.to_nlsys):
        use(model)
        with pytest.raises(InputError, match=word):
            use(other(model))


def test_a_file_of_a_model_with_another_fit_is_told_so(tmp_path):
    corrected(nominal={("nominal_kernel_shape_6", "Heave"): 0.03}).write(tmp_path / "corrected.json")
    with pytest.raises(InputError, match=r"'nominal_kernel_shape_6'.*with the same fit of its radiation"):
        read_corrected(tmp_path / "corrected.json", tank_model())


@pytest.mark.parametrize("nominal", [0.0, 0.04])
def test_a_gain_of_the_recorded_force_is_in_the_linear_plant(nominal):
    """At rest C x is the force that acts: (1 + gain) (1 + share) times the recorded one."""
    model = tank_model()
    better = corrected([("excitation_gain", {"gain": 0.25})], {("nominal_force", "Heave"): nominal})
    still = better.to_ss(model)(0j)[0, 0].real
    assert still * model.C[0, 0] == pytest.approx(1.25 * (1.0 + nominal), rel=1e-9)
    system = better.to_nlsys(model)
    linear = ct.linearize(system, np.zeros(system.nstates), [0.0])
    at = 1j * np.array([3.0, 7.0, 12.0])
    np.testing.assert_allclose(np.ravel(better.to_ss(model)[:, 0](at)), np.ravel(linear(at)), rtol=1e-6)


def test_drag_of_strips_damps_both_motions_of_a_linear_plant():
    """In heave alone 8/(3 pi) c A w, and of a small pitch <2 c |v| r^2>, 4/pi c A w L^2 / 12."""
    fit = rss.RadiationFit(("Heave", "Pitch"), -np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), 1)
    model = rss.Model(("Heave", "Pitch"), np.diag([50.0, 6.0]), np.diag([20.0, 2.0]), np.diag([1200.0, 90.0]), fit)
    c, length, size, omega = 150.0, 1.8, 0.1, 4.0
    drag = activate([("crossflow_drag", "Heave,Pitch", {"coefficient": c, "length": length})], model.dofs)
    found = Corrected({}, drag, {}, {"Heave": (0.05, omega), "Pitch": (0.05, omega)})
    D = found.model(model, {"Heave": size, "Pitch": 0.0}).D
    heave = 8.0 / (3.0 * np.pi) * c * size * omega
    np.testing.assert_allclose(D, np.diag([heave, 1.5 * heave * length**2 / 12.0]), rtol=0.01, atol=1e-6)
    assert not found.model(model, 0.0).D.any()


def test_what_takes_a_model_takes_a_system_and_a_step_is_a_time():
    model, drag = tank_model(), corrected([("linear_damping", {"coefficient": 3.0})])
    np.testing.assert_allclose(drag.to_ss(rss.cummins(model)).poles(), drag.to_ss(model).poles(), rtol=1e-6)
    still = rss.Record(np.arange(0.0, 2.0, 0.05), {"Heave": np.full(40, 0.01)}, kind="decay")
    for step in (0.0, -1.0, np.nan, "x"):
        with pytest.raises(InputError, match=r"step: .*positive time"):
            rss.simulate(model, still, step=step)
    with pytest.raises(InputError, match="rules: dict found"):
        rss.diagnose(model, still, rules={"matters": 0.01})
