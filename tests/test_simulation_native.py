"""The model with effects as a system of python-control; six degrees of freedom keep their energy."""

import control as ct
import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model
from scipy.interpolate import CubicSpline

import radiation_ss as rss
from radiation_ss.effects import activate
from radiation_ss.simulation import Corrected, Rollout, nonlinear_system, prepare, state_equations

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


@pytest.mark.parametrize("effects", [
    [], [("quadratic_drag", {"coefficient": 150.0}), ("sensor_gain", {"gain": 0.1}), ("sensor_bias", {"bias": 0.01})],
    [("tank_resonance", {"coupling": 2.0, "frequency": 6.5, "damping_ratio": 0.03}),
     ("added_inertia", {"inertia": 1.0}), ("excitation_gain", {"gain": 0.1}), ("cubic_stiffness", {"stiffness": 2e5})]])
def test_the_native_system_moves_as_simulate_does(effects):
    """Both on a force that is zero at first; python-control's integrator on splines of the same force."""
    model, corrected = tank_model(), Corrected({("nominal_stiffness", "Heave"): 0.01}, activate(effects, ("Heave",)))
    time = np.arange(0.0, 3.0, 0.01)
    force = 8.0 * np.sin(3.0 * time) ** 2 * np.cos(7.0 * time)
    system = corrected.to_nlsys(model)
    read = np.asarray(rss.simulate(model, (time, force), corrected, step=0.001).outputs)
    assert np.array_equal(read, rss.simulate(model, (time, force), corrected.actives(model), step=0.001).outputs)
    fine = np.arange(0.0, time[-1], 0.0002)
    result = ct.input_output_response(system, fine, CubicSpline(time, force)(fine), evaluation_times=time[:-1],
                                      solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-12})
    # python-control draws straight lines between the force's samples: h^2 w^2 / 8 of the force, 4e-7 of it.
    for found, expected in zip(np.asarray(result.outputs), read[:, :-1]):
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_names_and_linearisation_are_those_of_the_composite():
    model = coupled_model()
    with pytest.warns(rss.errors.InputWarning, match="excitation_delay on Sway left out"):
        system = nonlinear_system(model, [("linear_damping", "Roll", {"coefficient": 3e5}),
                                          ("excitation_delay", "Sway", {"delay": 0.1})])
    plant = model.attached(damping={"Roll": 3e5}).to_ss()
    assert system.input_labels == plant.input_labels and system.output_labels == plant.output_labels
    assert system.params["left_out"] == ("excitation_delay on Sway",)
    linear = ct.linearize(system, np.zeros(system.nstates), np.zeros(2))
    at = 1j * np.geomspace(0.1, 5.0, 20)
    assert np.allclose(linear(at), plant(at), rtol=1e-5, atol=1e-5 * np.abs(plant(at)).max())


def test_waves_are_inputs_where_an_effect_needs_them():
    model = tank_model()
    system = nonlinear_system(model, [("morison_drag", {"coefficient": 100.0})])
    assert system.input_labels == ["heave_force", "wave_elevation", "wave_elevation_rate", "wave_envelope",
                                   "heave_orbital", *(f"heave_orbital_below_{k}" for k in (1, 2, 3))]
    drag = nonlinear_system(model, [("morison_drag", {"coefficient": 100.0, "depth": 2.0 / 3.0})])
    for one, flow in ((system, 0.3), (drag, 0.15)):
        still = one.output(0.0, np.zeros(5), np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.2, 0.15, 0.1]))
        assert still[2] == pytest.approx(100.0 * flow**2 / (model.M + model.A_inf)[0, 0])


def test_the_forward_speed_is_an_input_where_an_effect_needs_it():
    model = tank_model()
    system = nonlinear_system(model, [("lift_damping", {"coefficient": 5.0})])
    assert system.input_labels == ["heave_force", "speed"]
    moved = system.output(0.0, np.array([0.0, 0.0, 0.0, 0.0, 0.2]), np.array([0.0, 3.0]))
    assert moved[2] == pytest.approx(-5.0 * 3.0 * 0.2 / (model.M + model.A_inf)[0, 0])


def test_a_model_predictive_control_can_use_the_casadi_function():
    """Heave held down by the force that CasADi's optimiser finds: the least one whose steady state is the target."""
    import casadi as ca

    model = tank_model()
    function = state_equations(model, [("cubic_stiffness", {"stiffness": 2e5})])
    opti = ca.Opti()
    x, u = opti.variable(5), opti.variable(1)
    rate, _ = function(0.0, x, u)
    opti.minimize(u**2)
    opti.subject_to(rate == 0.0)
    opti.subject_to(x[3] == 0.02)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    assert float(opti.solve().value(u)) == pytest.approx(model.C[0, 0] * 0.02 + 2e5 * 0.02**3, rel=1e-6)


def energy(model, state, k3):
    """Kinetic energy, springs, the radiation model's own (a = J - R, c = b'), and the mooring's potential."""
    m, n = model.fit.states, model.n
    r, x, v = np.split(state[:, :m + 2 * n], [m, m + n], axis=1)
    quadratic = [np.einsum("ti,ij,tj->t", y, matrix, y) for y, matrix in
                 ((r, np.eye(m)), (x, model.C), (v, model.M + model.A_inf))]
    return 0.5 * sum(quadratic) + 0.25 * k3 * np.sum(x[:, [0, 1]] ** 4, axis=1), r, v


@pytest.mark.parametrize("moored", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_six_degrees_of_freedom_keep_their_energy_balance(seed, moored):
    """Stored energy changes by the work of the force less what radiation, drag and friction take."""
    model = coupled_model(SIX, seed)
    model = model.replace(C=np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 0.0]) * model.C)
    k3, drag = 4e4 if moored else 0.0, 2e5
    effects = [("quadratic_drag", dof, {"coefficient": drag}) for dof in ("Sway", "Roll")]
    if moored:
        model = model.replace(C=model.C + np.diag([5e4, 5e4, 0.0, 0.0, 0.0, 8e4]))
        effects += [("mooring_restoring", dof, {"cubic": k3}) for dof in ("Surge", "Sway")]
    time, rng = np.arange(0.0, 60.0, 0.1), np.random.default_rng(seed)
    w = rng.uniform(0.3, 1.2, (6, 5))
    force = 1e5 * np.sum(np.sin(w[:, :, None] * time + rng.uniform(0.0, 6.28, (6, 5, 1))), axis=1)
    actives = activate(effects, model.dofs)
    h = 0.02
    rollout, p = Rollout(model, actives, h), np.concatenate([a.vector for a in actives])
    record = rss.Record(time, {**dict.fromkeys(SIX, 0.0 * time), **{f"{d}_force": f for d, f in zip(SIX, force)}},
                        kind="forced")
    prepared = prepare(model, record, h)
    grid = prepared.grid
    state = rollout.run(np.zeros(rollout.ns), rollout.drive(prepared, p), grid, p).state
    stored, r, v = energy(model, state, k3)
    acting = np.stack([f(np.clip(grid, 0.0, time[-1])) for f in prepared.force], axis=1)
    R = -0.5 * (model.fit.a + model.fit.a.T)
    lost = np.einsum("ti,ij,tj->t", r, R, r) + drag * np.sum(np.abs(v[:, [1, 3]]) ** 3, axis=1)
    assert np.all(lost >= 0.0)
    power = np.sum(acting * v, axis=1) - lost
    balance = np.concatenate([[0.0], np.cumsum(0.5 * h * (power[1:] + power[:-1]))])
    inside = grid <= time[-1]
    # The trapezoidal rule over h = 0.02 s of motions below 2 rad/s: h^2 w^2 / 12 of the power.
    assert np.abs(stored - balance)[inside].max() < 2e-3 * stored.max()
    found = np.asarray(rss.simulate(model, (time, force), effects).outputs)[:6]
    exact = state[:, model.fit.states:model.fit.states + 6].T
    expected = np.stack([np.interp(time, grid, row) for row in exact])
    assert np.abs(found - expected).max() < 3e-3 * np.abs(expected).max()
