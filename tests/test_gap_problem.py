"""The least-squares problem: exact derivatives, evidence against a closed form, score against refit."""

import numpy as np
import pytest
from gap_cases import tank_case

from radiation_ss.effects import activate
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.how_far.ledger import errors_on, pooled_gap
from radiation_ss.gap.posterior.fitting import fit
from radiation_ss.gap.posterior.noise import autoregression, floor_of, white
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.simulation.prepare import Channel
from radiation_ss.simulation.run import simulate


@pytest.fixture(scope="module")
def setting():
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=1, kinds=("decay", "waves"))
    return setting_of(model, records, tolerances(0.02))


@pytest.mark.parametrize("name", ["quadratic_drag", "coulomb_friction", "added_inertia", "sensor_delay", "clock_drift",
                                  "excitation_delay", "tank_resonance", "hysteresis", "slack_mooring", "slow_drift",
                                  "parametric_stiffness", "actuator_saturation"])
def test_derivatives_are_those_of_the_prediction(setting, name):
    term = next(t for t in terms_of(setting) if t.active.name == name)
    problem = Problem(setting, (term,))
    rng = np.random.default_rng(0)
    q = 0.3 * np.abs(rng.standard_normal(problem.size))
    point = problem.at(q)
    for column in [*range(len(setting.nominal)), *problem.columns(0)]:
        h = 1e-5
        shift = h * (np.arange(q.size) == column)
        high, low = problem.at(q + shift, slopes=False), problem.at(q - shift, slopes=False)
        for k, slope in enumerate(point.slopes):
            numeric = (low.residuals[k] - high.residuals[k]) / (2.0 * h)
            # At the record's ends the force is held: there a delay has a one-sided derivative.
            assert np.linalg.norm(slope[:, column] - numeric) < 0.03 * np.linalg.norm(numeric) + 1e-9, (name, column)


def test_autoregression_recovers_its_coefficients():
    rng = np.random.default_rng(3)
    values = np.zeros(20000)
    for k in range(2, values.size):
        values[k] = 1.2 * values[k - 1] - 0.5 * values[k - 2] + rng.standard_normal()
    _, deviation, taps = autoregression(values, 4)
    # Asymptotic standard error of an AR coefficient is about sqrt((1 - phi^2) / n) = 0.006.
    assert deviation == pytest.approx(1.0, abs=0.03)
    assert taps[1:3] == pytest.approx([-1.2, 0.5], abs=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_noise_floor_sees_the_noise_and_not_the_motion(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 40.0, 0.05)
    residual = 0.1 * np.sin(6.0 * time) + 0.01 * rng.standard_normal(time.size)
    found = floor_of(Channel(0, "displacement", time, residual), residual, 6.0)
    # Median of about 400 exponential ordinates: relative error of the variance near 7 %.
    assert found == pytest.approx(0.01, rel=0.12)


def test_fit_reaches_a_stationary_point(setting):
    problem = Problem(setting)
    noise = white([1e-3] * sum(len(item.channels) for item in setting.records))
    found = fit(problem, noise, np.zeros(problem.size))
    assert found.converged
    gradient = sum(s.T @ (r / 1e-6) for s, r in zip(found.point.slopes, found.point.residuals)) - found.q
    assert float(gradient @ found.covariance @ gradient) < 1e-2
    curvature = sum(s.T @ (s / 1e-6) for s in found.point.slopes) + np.eye(found.q.size)
    assert np.allclose(found.curve.root.T @ found.curve.root, curvature, rtol=1e-8, atol=1e-6 * np.abs(curvature).max())


@pytest.mark.parametrize("name, effect", [
    ("tank_resonance", {"coupling": 2.0, "frequency": 6.5, "damping_ratio": 0.03}),
    ("hysteresis", {"force": 0.5, "reach": 0.01})])
def test_own_states_of_an_effect_may_be_off_rest_at_the_start(name, effect):
    model, records = tank_case([], seed=3, kinds=("decay",), duration=15.0)
    actives, own = activate([(name, effect)], model.dofs), {"tank_resonance": [0.05, 0.2], "hysteresis": [0.8]}[name]
    start = np.array([0.0, 0.0, 0.0, 0.03, 0.0, *own])
    record = records[0].with_channels(Heave=simulate(model, records[0], actives, start=start).outputs[0])
    # In the prediction: with the true effect and only its start unknown the record is met.
    assert pooled_gap(errors_on(model, actives, record)) < 0.01
    # In the fit: the derivatives by these starts are those of the prediction.
    setting = setting_of(model, [record], tolerances(0.02))
    problem = Problem(setting, (next(t for t in terms_of(setting) if t.active.name == name),))
    q = 0.3 * np.abs(np.random.default_rng(0).standard_normal(problem.size))
    slopes = problem.at(q).slopes[0]
    assert len(problem.kicked) == len(own)
    for column in problem.kicked.values():
        shift = 1e-5 * (np.arange(q.size) == column)
        low, high = (problem.at(q + sign * shift, slopes=False).residuals[0] for sign in (-1.0, 1.0))
        numeric = (low - high) / 2e-5
        assert np.linalg.norm(slopes[:, column] - numeric) < 1e-4 * np.linalg.norm(numeric)
