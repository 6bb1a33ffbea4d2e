"""The noise of a recorded force moves the model although it never moved the body."""

import numpy as np
import pytest

import radiation_ss as rss
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.posterior.setting import setting_of
from radiation_ss.gap.tolerance import input_noise
from radiation_ss.gap.tolerance.null_fit import null_fit, tolerant
from radiation_ss.simulation.run import simulate

TIME = np.arange(0.0, 60.0, 0.04)
SHARE = 0.003  # of the force's rms


def soft_body():
    """A body on a soft mooring: natural frequency 1.1 rad/s, damping a few per cent, waves at 3 to 6 rad/s."""
    fit = rss.RadiationFit(("Sway",), np.array([[-3.0, -20.0], [1.0, 0.0]]), np.array([[150.0], [0.0]]),
                           np.array([[1.0, 0.0]]), 2)
    return rss.Model(("Sway",), [[50.0]], [[30.0]], [[100.0]], fit)


def waves(model, seed, share=SHARE, kind="waves"):
    rng = np.random.default_rng(seed)
    omega = rng.uniform(3.0, 6.0, 40)
    force = np.cos(np.outer(TIME, omega) + rng.uniform(0.0, 2.0 * np.pi, 40)).sum(axis=1) * (kind == "waves")
    start = np.zeros(model.fit.states + 2)
    start[model.fit.states] = 0.02
    x = simulate(model, (TIME, force[None]), (), start=start).outputs[0]
    noisy = force + share * force.std() * rng.standard_normal(TIME.size)
    measured = x + 0.004 * x.std() * rng.standard_normal(TIME.size)
    return rss.Record(TIME, {"Sway": measured, "Sway_force": noisy}, kind=kind, name=f"{kind}{seed}"), force.std()


def test_columns_have_the_variance_that_simulated_noise_has(monkeypatch):
    """60 white forces through the integrator against the closed form, over the second half of the record.

    The answer's bandwidth of about 0.1 rad/s leaves some 2 T dw / pi = 2 degrees of freedom a run, so 60 runs give the
    variance to sqrt(2 / 120) = 13 %; the estimated level of the force's noise adds 2 x 3 %. Three of that: 45 %.
    """
    monkeypatch.setattr(input_noise, "HEARD", 0.0)
    model = soft_body()
    record, size = waves(model, 0)
    found, _ = null_fit(setting_of(model, [record], tolerances(0.02)))
    (columns,) = input_noise.input_errors(found)
    late = found.problem.setting.records[0].channels[0].time > 30.0
    expected = np.mean(np.sum(columns[late] ** 2, axis=1))
    rng = np.random.default_rng(1)
    start = np.zeros(model.fit.states + 2)
    runs = [simulate(model, (TIME, SHARE * size * rng.standard_normal((1, TIME.size))), (), start=start).outputs[0]
            for _ in range(60)]
    assert np.mean(np.array(runs)[:, TIME > 30.0] ** 2) == pytest.approx(expected, rel=0.45)


def test_a_zero_force_has_no_noise():
    model = soft_body()
    record, _ = waves(model, 0, kind="decay")
    found, _ = null_fit(setting_of(model, [record], tolerances(0.02)))
    assert input_noise.input_errors(found)[0].shape == (TIME.size, 0)


@pytest.mark.parametrize("seed", range(4))
def test_a_noisy_force_is_no_gap(seed):
    """With the noise's answers free, nominal numbers stay where they are and nothing is named."""
    model = soft_body()
    records = [waves(model, 10 * seed + k)[0] for k in range(2)]
    wide, _ = tolerant(setting_of(model, records, tolerances(0.02)))
    setting = wide.problem.setting
    assert setting.unnamed > setting.tolerated  # some directions are the input's
    pulls = wide.q[-setting.unnamed:]
    # Unit normal by the prior: the sum of squares of n exceeds n + 4 sqrt(2 n) in less than one of 1000 cases.
    assert np.sum(pulls**2) < pulls.size + 4.0 * np.sqrt(2.0 * pulls.size)
    assert rss.diagnose(model, records, pairs=False).verdict.status == "no_gap"


def test_one_elevation_is_one_input_to_all_degrees_of_freedom():
    """The force on each degree of freedom is X times the same numbers."""
    model = soft_body()
    omega = np.linspace(0.2, 10.0, 50)
    X = np.exp(-0.1 * omega)[:, None, None] * (100.0 + 30.0j)
    K = model.fit.to_ss()(1j * omega) if model.n > 1 else np.asarray(model.fit.to_ss()(1j * omega)).reshape(-1, 1, 1)
    hydro = rss.HydroData(omega, model.A_inf + K.imag / omega[:, None, None], K.real, A_inf=model.A_inf,
                          dofs=model.dofs, X=X, C=model.C, M=model.M)
    at = input_noise.wave_force_at(model.replace(hydro=hydro), np.array([0.1, 5.0, 11.0]))
    np.testing.assert_allclose(at[:, 0], [X[0, 0, 0], (100.0 + 30.0j) * np.exp(-0.5), 0.0], rtol=1e-3)
