"""Noise that is not white: a sensor whose zero drifts, tones far above the motion; and what is not noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_cases import tank_case
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular, toeplitz
from scipy.optimize import minimize
from scipy.stats import chi2

from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.gap.posterior.drift import Drift, binned, drift_of, misfit
from radiation_ss.gap.posterior.fitting import fit_free_noise
from radiation_ss.gap.posterior.noise import coloured
from radiation_ss.gap.posterior.noise_left import noise_left
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.red_noise import drifting, eventful, is_drift, noise_in, steady
from radiation_ss.gap.posterior.setting import setting_of
from radiation_ss.gap.tolerance.null_fit import null_fit
from radiation_ss.simulation.prepare import Channel


def drawn(drift, size, rng):
    """Return white noise beside a stationary first-order drift."""
    d = np.empty(size)
    d[0] = np.sqrt(drift.variance) * rng.standard_normal()
    new = np.sqrt((1.0 - drift.memory**2) * drift.variance) * rng.standard_normal(size)
    for k in range(1, size):
        d[k] = drift.memory * d[k - 1] + new[k]
    return d + np.sqrt(drift.white) * rng.standard_normal(size)


@settings(max_examples=50, deadline=None)
@given(white=st.floats(1e-4, 1.0), variance=st.floats(1e-3, 1.0), memory=st.floats(0.05, 0.999))
def test_the_innovations_are_those_of_the_covariance(white, variance, memory):
    """Whitening by the Cholesky factor of the covariance itself agrees in the steady state and at the first sample."""
    drift = Drift(white, variance, memory)
    size = 80
    covariance = toeplitz(variance * memory ** np.arange(size)) + white * np.eye(size)
    values = np.random.default_rng(0).standard_normal(size)
    exact = solve_triangular(cholesky(covariance, lower=True), values, lower=True)
    ours = drift.innovations(values) / np.sqrt(drift.predicted + drift.white)
    assert ours[0] == pytest.approx(exact[0], rel=1e-9)
    # The gain settles with the square of the filter's pole; what is left of the start dies with the pole itself.
    settled = drift.pole ** (size - 1)
    scale = np.abs(exact).max() * (1.0 + np.sqrt(variance / white))
    assert abs(ours[-1] - exact[-1]) <= size * settled * scale + 1e-9 * scale


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_is_found_and_leaves_white_noise(seed):
    rng, truth, size = np.random.default_rng(seed), Drift(1e-4, 9e-4, 0.94), 2000
    values = drawn(truth, size, rng)
    found = drift_of(values)
    assert found is not None
    innovations = found.innovations(values)
    # Autocorrelations of white noise have a standard deviation of 1 / sqrt(size).
    for lag in (1, 2, 5, 20):
        assert abs(np.corrcoef(innovations[lag:], innovations[:-lag])[0, 1]) < 4.5 / np.sqrt(size)
    assert np.var(innovations) == pytest.approx(truth.predicted + truth.white, rel=5.0 * np.sqrt(2.0 / size))


@settings(max_examples=50, deadline=None)
@given(st.floats(-12.0, 2.0), st.floats(-12.0, 2.0), st.floats(-6.0, 2.0))
def test_the_slopes_of_the_likelihood_are_those_of_its_differences(white, variance, corner):
    at = np.geomspace(0.01, np.pi, 20)
    data = np.cos(at), np.random.default_rng(0).exponential(size=20), np.arange(1.0, 21.0)
    p, step = np.array([white, variance, corner]), 1e-5
    ours = misfit(p, *data)[1]
    theirs = [(misfit(p + step * e, *data)[0] - misfit(p - step * e, *data)[0]) / (2.0 * step) for e in np.eye(3)]
    scale = np.abs(ours).max() + abs(misfit(p, *data)[0])
    assert np.abs(ours - theirs).max() < 1e-6 * scale  # truncation step^2, rounding 1e-16 / step


@pytest.mark.parametrize("seed", range(40))
def test_the_drift_found_is_at_least_as_likely_as_the_true_one(seed):
    """White noise up to a thousand times the drift's or below it, memories of one to 300 samples, any unit."""
    rng = np.random.default_rng(seed)
    size, unit = 3000, 10.0 ** rng.uniform(-12.0, 12.0)
    truth = Drift(unit, unit * 10.0 ** rng.uniform(-3.0, 3.0), float(np.exp(-(10.0 ** rng.uniform(-2.5, 0.0)))))
    values = drawn(truth, size, rng)
    at, power, count = binned(values)

    def likelihood(drift):
        spectrum = drift.spectrum(np.cos(at))
        return -0.5 * np.sum(count * (np.log(spectrum) + power / spectrum))

    assert likelihood(drift_of(values)) > likelihood(truth) - 0.05


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_whitened_and_made_again(seed):
    """BIC takes the drift where there is one, and only there; `colour` is the inverse of `whiten`."""
    rng, size = np.random.default_rng(seed), 3000
    plain, drifting = rng.standard_normal(size), drawn(Drift(0.04, 1.0, 0.98), size, rng)
    noise = coloured([plain, drifting], [1e-6, 1e-6])
    assert noise.drifts[0] is None and noise.drifts[1] is not None
    for k, values in enumerate((plain, drifting)):
        assert np.std(noise.whiten(k, values)) == pytest.approx(1.0, rel=0.1)
        again = noise.colour(k, rng.standard_normal(size))
        band = np.abs(np.fft.rfft(again * np.hanning(size))) ** 2, np.abs(np.fft.rfft(values * np.hanning(size))) ** 2
        for part in (slice(3, 60), slice(600, 1500)):  # means of 57 and 900 exponential ordinates, half of them apart
            ratio = band[0][part].mean() / band[1][part].mean()
            assert abs(np.log(ratio)) < 5.0 * np.sqrt(4.0 / len(band[0][part]))


def drifting_beside_a_discrepancy(seed, white, drift, lasting):
    """Return a fit whose discrepancy, 2 % of the motion, lives where its sensor drifts; and the sensor's noise."""
    rng = np.random.default_rng(seed)
    model, (record,) = tank_case([], seed=seed, kinds=("waves",), noise=0.0, tolerance=0.0, duration=40.0)
    x = record.channels["Heave"]
    size, phase = x.std(), np.outer(record.time, np.linspace(3.0, 16.0, 60))
    D = 0.02 * size / np.sqrt(60.0) * np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    truth = Drift((white * size) ** 2, (drift * size) ** 2, float(np.exp(-0.05 / lasting)))
    read = x + D @ rng.standard_normal(120) + drawn(truth, x.size, rng)
    setting = replace(setting_of(model, [replace(record, channels={**record.channels, "Heave": read})],
                                 tolerances(0.02)), discrepancy=(D,))
    problem, floors = Problem(setting), (white * size,)
    null, _ = null_fit(setting_of(model, [record], tolerances(0.02)))
    return fit_free_noise(problem, floors, null.noise, problem.extend(null.q, null.problem)), floors, truth


def log_likelihood(covariance, values):
    root = cho_factor(covariance, lower=True)
    return -0.5 * values @ cho_solve(root, values) - np.sum(np.log(np.diag(root[0])))


@pytest.mark.parametrize("seed", range(3))
def test_the_noise_is_as_likely_as_any_with_the_discrepancy_integrated_out(seed):
    """The likelihood of all readings, D D' and the noise in one covariance, against its maximum by simplex."""
    found, floors, truth = drifting_beside_a_discrepancy(seed, 0.004, 0.01, 0.4)
    (D,), lags = found.problem.setting.discrepancy, np.arange(found.point.residuals[0].size)
    read = found.point.residuals[0] + D @ found.q[-D.shape[1]:]

    def likelihood(white, variance, memory):
        return log_likelihood(D @ D.T + toeplitz(variance * memory**lags) + white * np.eye(lags.size), read)

    def of(noise):
        (drift,), (taps,) = noise.drifts, noise.filters
        assert taps.size == 1
        scale = noise.deviation[0] ** 2 / (drift.predicted + drift.white)
        return likelihood(scale * drift.white, scale * drift.variance, drift.memory)

    start = np.log([truth.white, truth.variance, -np.log(truth.memory)])
    best = minimize(lambda p: -likelihood(*np.exp(p[:2]), np.exp(-np.exp(p[2]))), start, method="Nelder-Mead",
                    options={"maxfev": 120})
    # As far below the maximum as the truth itself once in a thousand.
    near = 0.5 * chi2.isf(1e-3, 3)
    assert of(noise_left(found, floors)) > -best.fun - near
    assert of(coloured(found.point.residuals, [0.9 * floors[0]])) < -best.fun - near


@pytest.mark.parametrize("seed", range(5))
def test_what_falls_with_the_motion_is_not_noise(seed):
    rng = np.random.default_rng(seed)
    motion = np.exp(-0.2 * np.arange(30)) * rng.exponential(size=30) + 1e-6
    chance = rng.exponential(size=30)
    least, likely = steady(chance * 4.0, motion)  # n^2 = 4
    assert 0.5 < least <= likely < 8.0  # mean of 30 exponentials, five standard deviations
    least, _ = steady(chance * motion, motion)
    assert least < 0.05 * np.mean(chance * motion)
    assert steady(chance, np.ones(30))[0] == 0.0  # as large all the time: nothing can be said


@pytest.mark.parametrize("seed", range(4))
def test_an_offset_is_no_noise(seed):
    """However large: a drift that lasted as long as the record would take up any constant."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 100.0, 0.1)
    motion, white = np.exp(-0.03 * time) * np.cos(time), 0.01 * rng.standard_normal(time.size)
    channel = Channel(0, "displacement", time, motion)
    assert noise_in(channel, 0.2 + white, 1.0) < 0.02


@pytest.mark.parametrize("seed", range(5))
def test_an_event_is_no_noise(seed):
    """Energies of blocks are exponential where noise is steady; a gust holds most of it in three of thirty."""
    rng = np.random.default_rng(seed)
    assert not eventful(rng.exponential(size=30))
    gust = np.zeros(30)
    gust[rng.integers(2, 26) + np.arange(3)] = 30.0
    assert eventful(rng.exponential(size=30) + gust * rng.exponential(size=30) + gust)


@pytest.mark.parametrize("seed", range(5))
def test_a_residual_at_the_motions_frequency_is_no_drift(seed):
    rng, time, omega = np.random.default_rng(seed), np.arange(0.0, 250.0, 0.25), 1.0
    drift = drawn(Drift(1e-4, 9e-4, np.exp(-0.1)), time.size, rng)
    assert is_drift(time, drift, omega)
    narrow = 0.06 * np.cos(omega * time + 0.5 * np.sin(0.03 * time))
    assert not is_drift(time, drift + narrow, omega)


@pytest.mark.parametrize("seed", range(4))
def test_tones_far_above_the_motion_are_noise_unless_they_fall_with_it(seed):
    """A hum of 0.3 in a decay is noise, as large as it is; a hum that dies away with the motion is not."""
    rng, time, omega = np.random.default_rng(seed), np.arange(0.0, 100.0, 0.05), 1.0
    motion, white = np.exp(-0.03 * time) * np.cos(time), 0.01 * rng.standard_normal(time.size)
    channel = Channel(0, "displacement", time, motion)
    hum = 0.3 * np.sin(24.0 * time + rng.uniform(0.0, 6.28))
    # A mean square of 16 blocks; the likeliest is on a grid of steps of 17 %.
    assert noise_in(channel, hum + white, omega) == pytest.approx(0.3 / np.sqrt(2.0), rel=0.1)
    assert noise_in(channel, np.exp(-0.03 * time) * hum, omega) < 0.03
    assert noise_in(channel, 0.3 * np.sin(2.0 * time), omega) < 0.01  # what leaks across the record's ends


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("records", [0, 1, 2, 3])
def test_a_sensor_drifts_if_it_does_so_in_most_of_its_records(records, seed):
    """In the others the residual is a share of the motion, as where a law is missing."""
    rng, time, omega = np.random.default_rng([records, seed]), np.arange(0.0, 150.0, 0.1), 2.0
    motion = np.exp(-0.02 * time) * np.cos(omega * time)
    channel = Channel(0, "displacement", time, motion)
    drifts = Drift(1e-6, 1e-4, float(np.exp(-0.1 * omega / np.pi)))
    lacks = 0.05 * np.roll(motion, 4) + 1e-4 * rng.standard_normal(time.size)
    left = [drawn(drifts, time.size, rng) if k < records else lacks for k in range(3)]
    setting = SimpleNamespace(records=[SimpleNamespace(channels=[channel])] * 3, model=SimpleNamespace(dofs=("Heave",)),
                              scales={"Heave": SimpleNamespace(omega=omega)})
    found = SimpleNamespace(problem=SimpleNamespace(setting=setting), point=SimpleNamespace(residuals=left))
    assert drifting(found) == [records > 1] * 3


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_drifting_sensor_is_no_missing_effect(seed):
    """Nothing is hidden; each displacement sensor drifts by 3 % of the motion within half a period."""
    model, records = tank_case([], seed=seed, kinds=("decay", "waves"))
    rng, drifting = np.random.default_rng(seed), []
    for record in records:
        x = record.channels["Heave"]
        step, period = float(np.median(np.diff(record.time))), 2.0 * np.pi * np.sqrt(
            (model.M + model.A_inf)[0, 0] / model.C[0, 0])
        noise = drawn(Drift(1e-12, (0.03 * np.nanstd(x)) ** 2, float(np.exp(-2.0 * step / period))), x.size, rng)
        drifting.append(replace(record, channels={**record.channels, "Heave": x + noise}))
    found = diagnose(model, drifting)
    assert found.verdict.status == "no_gap"
    assert any("does not go with it: noise" in note for note in found.notes)
    assert not any("does not go with it" in note for note in diagnose(model, records).notes)


@pytest.mark.parametrize("seed", [0, 1])
def test_drag_is_named_beside_a_drifting_sensor(seed):
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=seed, kinds=("decay", "waves"))
    rng, drifting = np.random.default_rng(seed), []
    for record in records:
        x = record.channels["Heave"]
        drift = Drift(1e-12, (0.02 * np.nanstd(x)) ** 2, 0.95)
        drifting.append(replace(record, channels={**record.channels, "Heave": x + drawn(drift, x.size, rng)}))
    found = diagnose(model, drifting).verdict
    assert found.status == "effect" and [effect.name for effect in found.effects] == ["quadratic_drag"]
