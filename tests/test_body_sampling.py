"""What a time step does, against python-control's sampling, the bilinear theorem and the convolution integral."""

import pickle

import control as ct
import numpy as np
import pytest
from plant_bodies import coupled_fit, coupled_model, tank_fit, tank_model

import radiation_ss as rss

THEIRS = {"zoh": "zoh", "tustin": "bilinear", "foh": "foh"}


@pytest.mark.parametrize("method", ["zoh", "tustin", "foh"])
@pytest.mark.parametrize("plant", [tank_fit(), coupled_fit(("Sway", "Roll"))], ids=["siso", "mimo"])
def test_same_transfer_function_as_scipy(plant, method):
    system = plant.to_ss()
    ours = rss.sampled(plant, 0.05, method).to_ss()
    theirs = ct.sample_system(system, 0.05, method=THEIRS[method])
    z = np.exp(1j * np.linspace(0.01, 3.1, 30))
    assert ours.isdtime(strict=True) and ours.input_labels == system.input_labels
    assert ours(z) == pytest.approx(theirs(z), rel=1e-9)


def test_tustin_keeps_passivity_and_zero_order_hold_loses_it():
    # Re K -> 0 at high frequency; a hold turns the phase by w dt / 2 more, so the real part goes negative.
    for seed in range(5):
        fit = coupled_fit(("Sway", "Roll"), seed)
        assert rss.sampled(fit, 0.3, "tustin").passive
        assert not rss.sampled(fit, 0.3, "zoh").passive


def test_error_falls_with_the_step_at_the_order_of_the_method():
    # Frequency error at fixed w: zero-order hold w dt / 2 (first order), the other two second order.
    for method, order in (("zoh", 1), ("foh", 2), ("tustin", 2)):
        coarse, fine = (rss.sampled(tank_fit(), dt, method).error_at(8.0) for dt in (0.02, 0.01))
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.1)
    assert rss.sampled(tank_fit(), 0.01, "zoh").error_at(8.0) == pytest.approx(8.0 * 0.01 / 2.0, rel=0.02)


@pytest.mark.parametrize("plant", [tank_fit(), tank_model(), coupled_model()], ids=["fit", "heave", "two"])
def test_first_order_hold_follows_the_convolution_integral(plant):
    # Interpolating sin(w t) linearly leaves an error of at most (w dt)^2 / 8.
    report = rss.sampled(plant, 0.02, "foh", band=8.0)
    assert report.stable
    assert report.convolution_error < (8.0 * 0.02) ** 2 / 8.0
    assert report.convolution_error < 0.2 * rss.sampled(plant, 0.02, "zoh", band=8.0).convolution_error


def test_report_reads_and_pickles():
    report = rss.sampled(tank_model(), 0.05, "zoh")
    text = str(pickle.loads(pickle.dumps(report)))
    assert "zoh" in text and "passive" in text and "convolution" in text
    assert 0.0 < report.bandwidth < np.pi / 0.05
    assert report.to_ss().output_labels == ["heave", "heave_vel", "heave_acc"]


def test_a_body_without_restoring_drifts_and_is_passive():
    """Its pole at z = 1 only adds up velocity; a spring of the other sign gives energy."""
    free = tank_model().replace(C=[[0.0]])
    report = rss.sampled(free, 0.05, "tustin")
    assert np.isnan(report.convolution_error) and not report.stable and report.drifts and report.passive
    assert "drifts" in str(report) and "nan" not in str(report)
    fallen = rss.sampled(free.replace(C=[[-50.0]]), 0.05, "tustin")
    assert not fallen.drifts and not fallen.passive and "NOT stable" in str(fallen)


def test_couplings_that_are_zero_but_for_rounding_do_not_count():
    """Two bodies side by side are as exact as the worse of them, in whatever units."""
    system = tank_fit().to_ss()
    alone = rss.sampled(system, 0.02).bandwidth
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]     # so that zeros are rounding errors
    for unit in (1.0, 1e6):
        pair = ct.append(system, unit * system)
        turned = ct.ss(turn @ pair.A @ turn.T, turn @ pair.B, pair.C @ turn.T, pair.D)
        assert rss.sampled(turned, 0.02).bandwidth == pytest.approx(alone, rel=1e-6)


@pytest.mark.parametrize("call, words", [
    (lambda: rss.sampled(tank_fit(), 0.0), "dt"),
    (lambda: rss.sampled(tank_fit(), 0.1, "euler"), "method"),
    (lambda: rss.sampled(rss.sampled(tank_fit(), 0.1).to_ss(), 0.1), "discrete"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()
