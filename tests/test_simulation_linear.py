"""Linear response against python-control, the convolution integral and closed forms; derivatives against the truth."""

import control as ct
import numpy as np
import pytest
from plant_bodies import convolution_response, coupled_model, tank_model

import radiation_ss as rss
from radiation_ss.records import fourier_derivatives, smoother_derivatives, with_derivatives
from radiation_ss.simulation import exact_step, linear_response, propagate

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


@pytest.mark.parametrize("call, words", [
    (lambda m: linear_response(m, [0.0, 1.0], [1.0, np.nan]), "finite"),
    (lambda m: linear_response(m, [1.0, 0.0], [1.0, 1.0]), "ascending"),
    (lambda m: linear_response(m, [0.0, 1.0], [1.0]), "force"),
    (lambda m: linear_response(m, [0.0, 1.0], [1.0, 1.0], x0=[0.0] * 5, velocity=[1.0]), "not both"),
    (lambda m: linear_response(ct.ss(0.5, 1, 1, 0, 1.0), [0.0, 1.0], [1.0, 1.0]), "discrete"),
    (lambda m: linear_response(m.to_ss(), [0.0, 1.0], [1.0, 1.0], velocity=[1.0]), "Model"),
    (lambda m: fourier_derivatives([1.0, 2.0], 0.1), "8"),
    (lambda m: smoother_derivatives(np.arange(20.0), np.ones(20)), "constant"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call(tank_model())


def measured_heave(seed, noise=1e-5):
    """Heave of the tank model in a random sea: truth (3, nt), measured displacement, time."""
    sea = rss.realise(rss.jonswap(0.01, t01=0.9), 30.0, 0.01, seed=seed)
    truth = linear_response(tank_model(), sea.time, 300.0 * sea.elevation).y
    return sea.time, truth, truth[0] + noise * np.random.default_rng(seed).standard_normal(sea.time.size)


@pytest.mark.parametrize("seed", range(4))
def test_fourier_derivatives_and_the_noise_they_claim(seed):
    _, truth, y = measured_heave(seed)
    found = fourier_derivatives(y, 0.01)
    assert found.noise == pytest.approx(1e-5, rel=0.1)
    inner = slice(300, -300)  # the ends: a sine series knows no acceleration there
    for row, share in ((0, 0.005), (1, 0.01), (2, 0.03)):
        error = np.std((found.values - truth)[row, inner])
        assert error < share * np.std(truth[row])
        assert 0.7 < error / np.mean(found.std[row, inner]) < 3.5  # above 1: what the series cuts off


def test_fourier_noise_formula_is_the_scatter_of_pure_noise():
    runs = [fourier_derivatives(np.random.default_rng(s).standard_normal(200), 0.1, cutoff=8.0, noise=1.0)
            for s in range(600)]
    scatter = np.std([run.values for run in runs], axis=0)
    # 600 runs: 2.9 % standard error of a standard deviation; the formula leaves out the line through two noisy ends.
    assert scatter[1:, 20:-20] == pytest.approx(runs[0].std[1:, 20:-20], rel=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_smoother_with_jitter_and_gaps_is_calibrated(seed):
    t, truth, y = measured_heave(seed)
    rng = np.random.default_rng(seed + 50)
    keep = np.sort(rng.choice(t.size, 2000, replace=False))
    y = y[keep].copy()
    y[rng.random(y.size) < 0.1] = np.nan
    y[700:720] = np.nan
    found = smoother_derivatives(t[keep], y)
    assert found.noise == pytest.approx(1e-5, rel=0.15)
    z = (found.values - truth[:, keep]) / found.std
    for row in range(3):
        assert 0.85 < np.mean(np.abs(z[row]) < 1.96) <= 1.0
        assert 0.5 < np.sqrt(np.mean(z[row] ** 2)) < 1.4


@pytest.mark.parametrize("method", ["smoother", "fourier"])
def test_record_gets_the_channels_it_lacks(method):
    t, truth, y = measured_heave(0)
    record = rss.Record(t, {"Heave": y})
    more, std = with_derivatives(record, method=method)
    assert set(more.channels) == {"Heave", "Heave_velocity", "Heave_acceleration"}
    assert set(std) == {"Heave_velocity", "Heave_acceleration"}
    error = (more.channels["Heave_velocity"] - truth[1])[400:-400]
    assert np.abs(error).max() < 0.03 * np.abs(truth[1]).max()
