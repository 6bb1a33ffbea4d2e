"""Linear response against python-control, the convolution integral and closed forms."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from plant_bodies import convolution_response, coupled_model, tank_model
from scipy.linalg import expm

import radiation_ss as rss
from radiation_ss.simulation import Kernel, exact_step, left_over, linear_response, propagate, step_size

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


@pytest.mark.parametrize("model", [tank_model(), coupled_model(), coupled_model(SIX)], ids=lambda m: str(m.n))
def test_same_numbers_as_python_control(model):
    rng = np.random.default_rng(1)
    t = 0.05 * np.arange(12295)
    system = rss.cummins(model)
    u, x0 = rng.standard_normal((model.n, t.size)), rng.standard_normal(system.nstates)
    theirs = ct.forced_response(system, t, u, x0)
    ours = linear_response(model, t, u, x0=x0)
    assert ours.y == pytest.approx(theirs.y, abs=1e-10 * np.abs(theirs.y).max())
    assert ours.output_labels == theirs.output_labels
    states = propagate(exact_step(*model.matrices(), 0.05), u.T, x0)
    assert (states @ system.C.T + u.T @ system.D.T).T == pytest.approx(theirs.y, abs=1e-10 * np.abs(theirs.y).max())


def test_defective_dynamics_are_stepped_together():
    # A double integrator has one eigenvector; under a constant force x = t^2 / 2 exactly.
    system = ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    t = np.linspace(0.0, 10.0, 1001)
    y = linear_response(system, t, np.ones(t.size)).y
    assert y[0] == pytest.approx(t**2 / 2.0, abs=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_jitter_changes_nothing_for_a_force_that_is_linear_in_time(seed):
    model, rng = tank_model(), np.random.default_rng(seed)
    even = np.linspace(0.0, 4.0, 81)
    uneven = np.unique(np.concatenate([even, rng.uniform(0.0, 4.0, 50)]))
    force = 2.0 + 3.0 * even
    regular = linear_response(model, even, force, displacement=[0.01])
    jitter = linear_response(model, uneven, 2.0 + 3.0 * uneven, displacement=[0.01])
    assert jitter.y[:, np.isin(uneven, even)] == pytest.approx(regular.y, abs=1e-11)


def test_decay_against_the_convolution_integral():
    # Trapezoidal convolution of the kernel itself, error O(dt^2): Richardson leaves the fourth order.
    model = coupled_model()
    moved, answers = [0.3, -0.2], []
    for dt in (0.02, 0.01):
        t = dt * np.arange(round(20.0 / dt) + 1)
        force = np.stack([1e5 * np.sin(0.8 * t), 2e5 * np.cos(0.5 * t)])
        answers.append(convolution_response(model.M + model.A_inf, model.C, model.fit.kernel(t), dt, force,
                                            displacement=moved)[:, :: round(0.02 / dt)])
    limit = (4.0 * answers[1] - answers[0]) / 3.0
    t = 0.0025 * np.arange(8001)
    ours = linear_response(model, t, np.stack([1e5 * np.sin(0.8 * t), 2e5 * np.cos(0.5 * t)]), displacement=moved)
    size = np.abs(limit).max()
    assert np.abs(answers[0] - limit).max() > 1e-6 * size  # the check below is finer than the plain rule
    assert ours.y[:2, ::8] == pytest.approx(limit, abs=2e-6 * size)


def test_energy_is_lost_to_the_radiation_only():
    model = tank_model()
    t = np.linspace(0.0, 20.0, 8001)
    response = linear_response(model, t, np.zeros(t.size), displacement=[0.02])
    x, v = response.y[0], response.y[1]
    energy = 0.5 * (model.M + model.A_inf)[0, 0] * v**2 + 0.5 * model.C[0, 0] * x**2
    radiated = linear_response(model.fit.to_ss(), t, v).y[0]
    work = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (radiated[1:] * v[1:] + radiated[:-1] * v[:-1]))])
    assert energy + work == pytest.approx(np.full(t.size, energy[0]), rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_s_noise_says_nothing_of_how_fast_a_motion_is(seed):
    # Nothing restores sway. At rest its sensor reads noise; in motion, the same sensor reads a slow swing.
    model, rng = coupled_model(), np.random.default_rng(seed)
    model = model.replace(C=np.diag([0.0, model.C[1, 1]]))
    t = np.arange(0.0, 200.0, 0.1)
    roll, noise = np.exp(-0.01 * t) * np.cos(0.8 * t), 1e-3 * rng.standard_normal(t.size)
    at_rest, alone, slow = (rss.Record(t, {"Roll": roll, **other}, kind="decay")
                            for other in ({"Sway": noise}, {}, {"Sway": np.cos(0.2 * t) + noise}))
    assert step_size(model, [at_rest]) == step_size(model, [alone])
    assert step_size(model, [slow]) == step_size(model, [alone])
    fast = rss.Record(t, {"Roll": roll, "Sway": np.cos(9.0 * t) + noise}, kind="decay")
    assert step_size(model, [fast]) < 0.2 * step_size(model, [alone])


@pytest.mark.parametrize("call, words", [
    (lambda m: linear_response(m, [0.0, 1.0], [1.0, np.nan]), "finite"),
    (lambda m: linear_response(m, [1.0, 0.0], [1.0, 1.0]), "ascending"),
    (lambda m: linear_response(m, [0.0, 1.0], [1.0]), "force"),
    (lambda m: linear_response(m, [0.0, 1.0], [1.0, 1.0], x0=[0.0] * 5, velocity=[1.0]), "not both"),
    (lambda m: linear_response(ct.ss(0.5, 1, 1, 0, 1.0), [0.0, 1.0], [1.0, 1.0]), "discrete"),
    (lambda m: linear_response(m.to_ss(), [0.0, 1.0], [1.0, 1.0], velocity=[1.0]), "Model"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call(tank_model())


def test_a_start_may_name_displacements():
    model = coupled_model(("Heave", "Pitch"))
    still = np.linspace(0.0, 5.0, 51), np.zeros((2, 51))
    state = np.zeros(model.fit.states + 4)
    state[model.fit.states + 1] = 0.1
    np.testing.assert_array_equal(rss.simulate(model, still, start={"Pitch": 0.1}).outputs,
                                  rss.simulate(model, still, start=state).outputs)


@pytest.mark.parametrize("start, words", [
    ({"pitch": 0.1}, "start: degree of freedom 'pitch' is not among"), ({"Pitch": "far"}, "start: not an array of"),
    ({"Pitch": None}, "start: "), ("Pitch", "start: not an array of numbers"),
    ([0.1], r"start: shape \(1,\) found")])
def test_a_start_that_is_none_is_said(start, words):
    with pytest.raises(rss.InputError, match=words):
        rss.simulate(coupled_model(("Heave", "Pitch")), (np.linspace(0.0, 5.0, 51), np.zeros((2, 51))), start=start)


@pytest.mark.parametrize("seed", range(3))
def test_forces_left_by_an_earlier_motion_do_not_depend_on_the_states_coordinates(seed):
    """Any states of the same K leave the same forces, and what a random motion left is within them."""
    rng, time, n = np.random.default_rng(seed), np.arange(0.0, 30.0, 0.1), 2
    model = coupled_model(("Sway", "Heave"), seed)
    fit, m = model.fit, model.fit.states
    T = rng.standard_normal((m, m)) * 10.0 ** rng.uniform(-3.0, 3.0, m)
    other = replace(fit, a=np.linalg.solve(T, fit.a @ T), b=np.linalg.solve(T, fit.b), c=fit.c @ T)
    past = np.array([[0.4], [0.7]]) * rng.standard_normal((n, 2000))
    found, turned = (left_over(each, time, past) for each in (model, model.replace(fit=other)))
    one, two = (np.einsum("kit,kis->its", each, each) for each in (found, turned))
    np.testing.assert_allclose(one, two, atol=2e-3 * np.abs(one).max())
    z = np.zeros(m)
    step = expm(fit.a * 0.1)
    for v in past.T:
        z = step @ (z + fit.b @ v * 0.1)
    left = np.stack([fit.c @ np.linalg.matrix_power(step, k) @ z for k in range(time.size)], axis=1)
    columns = (found / np.abs(left).max(axis=1)[:, None]).reshape(len(found), -1).T
    rest = (left / np.abs(left).max(axis=1)[:, None]).ravel()
    rest = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
    assert np.abs(rest).max() < 0.03


def test_no_earlier_motion_leaves_a_force_where_none_makes_waves():
    """A state that no velocity drives has no variance; its force is not of one, and the other motion's stays."""
    time, past = np.arange(0.0, 20.0, 0.1), np.random.default_rng(0).standard_normal((2, 500))
    a, b, c = np.array([[-0.5, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.eye(3, 2), np.zeros((2, 3))
    b[1, 1], c[0, 0], c[1, 2] = 0.0, 2e6, 1e6  # N
    both = rss.Model(("Heave", "Yaw"), np.eye(2), np.eye(2), np.eye(2), rss.RadiationFit(("Heave", "Yaw"), a, b, c, 3))
    heave = rss.RadiationFit(("Heave",), a[:2, :2], b[:2, :1], c[:1, :2], 2)
    alone = left_over(rss.Model(("Heave",), [[1.0]], [[1.0]], [[1.0]], heave), time, past[:1])
    found = left_over(both, time, past)
    np.testing.assert_allclose(np.abs(found[:, 0]), np.abs(alone[:, 0]), atol=1e-9 * np.abs(alone).max())
    assert not found[:, 1].any()


@pytest.mark.parametrize("seed", range(3))
def test_a_kernel_gives_what_stepping_gives(seed):
    """Responses from rest by the fast Fourier transform and by the recursion, within the transform's round-off."""
    rng, model = np.random.default_rng(seed), coupled_model(("Heave", "Pitch"), seed)
    F, G = model.matrices()
    step, H = exact_step(F, G, 0.1), rng.standard_normal((3, F.shape[0]))
    force = rng.standard_normal((2, 400)) * [[1.0], [seed > 0]]
    expected = H @ propagate(step, force.T, np.zeros(F.shape[0])).T
    found = Kernel.of(step, H, 400).respond(force)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("end", [20.0, 20.3, 37.11])
def test_the_last_samples_of_a_simulation_are_as_good_as_the_others(end):
    model = tank_model()
    t = np.arange(0.0, end, 0.01)
    force = 100.0 * np.sin(4.0 * t) * np.minimum(t / 5.0, 1.0) ** 2
    theirs = ct.forced_response(model.to_ss(), t, force).outputs
    miss = np.abs(np.asarray(rss.simulate(model, (t, force[None])).outputs - theirs))
    # A sine is off by the same in each period but for the phase of its samples; a force that stops, by ten times that.
    assert (miss[:, -20:].max(axis=1) < 1.1 * miss[:, 20:-20].max(axis=1)).all()
