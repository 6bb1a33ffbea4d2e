"""Spectra and random seas against closed forms, the ITTC formula and the statistics of a Gaussian process."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import welch

import radiation_ss as rss
from radiation_ss.waves import harmonic_sum

OMEGA = np.concatenate([np.linspace(1e-3, 40.0, 400001), np.geomspace(40.0, 4e3, 20001)[1:]])


@settings(max_examples=20)
@given(hs=st.floats(0.005, 15.0), tp=st.floats(0.5, 20.0), gamma=st.floats(1.0, 10.0))
def test_moments_are_those_of_the_density(hs, tp, gamma):
    sea = rss.jonswap(hs, tp, gamma=gamma)
    w = OMEGA * 2.0 * np.pi / tp
    for order, tolerance in ((-1, 1e-6), (0, 1e-6), (1, 1e-6), (2, 1e-5)):
        assert np.trapezoid(w**order * sea(w), w) == pytest.approx(sea.moment(order), rel=tolerance)
    assert sea.moment(0) == pytest.approx(hs**2 / 16.0, rel=1e-12)
    assert w[np.argmax(sea(w))] == pytest.approx(2.0 * np.pi / tp, rel=1e-3)


def test_ittc_jonswap_by_height_and_mean_period():
    # 17th ITTC: S = 155 H^2/(T1^4 w^5) exp(-944/(T1^4 w^4)) 3.3^Y, Y = exp(-((0.191 w T1 - 1)/(sqrt(2) sigma))^2),
    # whose constants are rounded to three figures.
    hs, t1 = 3.0, 9.0
    w = np.linspace(0.45, 2.0, 400)
    sigma = np.where(w <= 5.24 / t1, 0.07, 0.09)
    y = np.exp(-(((0.191 * w * t1 - 1.0) / (np.sqrt(2.0) * sigma)) ** 2))
    ittc = 155.0 * hs**2 / (t1**4 * w**5) * np.exp(-944.0 / (t1 * w) ** 4) * 3.3**y
    ours = rss.jonswap(hs, t01=t1)(w)
    assert np.max(np.abs(ours - ittc)) < 0.02 * ittc.max()


def test_pierson_moskowitz_is_the_published_formula():
    wind, g = 15.0, 9.81
    w = np.linspace(0.3, 3.0, 50)
    published = 8.1e-3 * g**2 / w**5 * np.exp(-0.74 * (g / (wind * w)) ** 4)
    assert rss.pierson_moskowitz(wind=wind)(w) == pytest.approx(published, rel=1e-10)
    sea = rss.pierson_moskowitz(hs=4.0)
    assert rss.bretschneider(4.0, sea.tp)(w) == pytest.approx(sea(w), rel=1e-12)


def test_user_spectrum_reproduces_a_table():
    sea = rss.jonswap(2.0, 8.0)
    table = rss.user_spectrum(OMEGA[1:200000:20], sea(OMEGA[1:200000:20]))
    assert table.hs == pytest.approx(2.0, rel=1e-3)
    assert table.t01 == pytest.approx(sea.t01, rel=1e-3)
    assert table(1e4) == 0.0


@pytest.mark.parametrize("samples", [64, 75])
def test_harmonic_sum_is_the_sum(samples):
    rng = np.random.default_rng(0)
    h = rng.standard_normal(samples // 2 + 1) + 1j * rng.standard_normal(samples // 2 + 1)
    t = np.arange(samples)
    direct = sum((h[k] * np.exp(2j * np.pi * k * t / samples)).real for k in range(h.size))
    assert harmonic_sum(h, samples) == pytest.approx(direct, abs=1e-12 * samples)


def test_random_phase_record_holds_the_whole_energy():
    sea = rss.jonswap(0.01, t01=0.8)
    for seed in range(5):
        record = rss.realise(sea, 60.0, 0.02, seed=seed)
        assert record.elevation.shape == (3000,)
        assert np.var(record.elevation) == pytest.approx(sea.moment(0), rel=1e-3)


def test_random_amplitude_sea_has_the_variance_of_a_gaussian_process():
    # Var of the record's variance = int S^2 dw * 2 pi / T for a Gaussian process; a random-phase record has none.
    sea, runs = rss.jonswap(2.0, 8.0), 400
    drawn = [np.var(rss.realise(sea, 600.0, 0.5, seed=s, method="amplitude").elevation) for s in range(runs)]
    w = np.linspace(0.2, 6.0, 20001)
    expected = np.sqrt(np.trapezoid(sea(w) ** 2, w) * 2.0 * np.pi / 600.0)
    assert np.mean(drawn) == pytest.approx(sea.moment(0), abs=4.0 * expected / np.sqrt(runs))
    assert np.std(drawn) == pytest.approx(expected, rel=4.0 / np.sqrt(2 * runs))


def test_welch_spectrum_of_a_long_sea_is_the_spectrum():
    sea = rss.jonswap(2.0, 8.0)
    record = rss.realise(sea, 40000.0, 0.5, seed=3)
    f, p = welch(record.elevation, fs=2.0, nperseg=1024)
    band = (f > 0.08) & (f < 0.3)
    assert np.trapezoid(np.abs(p[band] / (2 * np.pi) - sea(2 * np.pi * f[band])), f[band]) < 0.1 * np.trapezoid(
        sea(2 * np.pi * f[band]), f[band])


@pytest.mark.parametrize("call, words", [
    (lambda: rss.jonswap(1.0), "exactly one"),
    (lambda: rss.jonswap(1.0, 8.0, t01=7.0), "exactly one"),
    (lambda: rss.jonswap(-1.0, 8.0), "hs"),
    (lambda: rss.jonswap(1.0, 8.0, gamma=0.5), "gamma"),
    (lambda: rss.jonswap(1.0, float("nan")), "tp"),
    (lambda: rss.user_spectrum([1.0, 0.5], [1.0, 1.0]), "ascending"),
    (lambda: rss.user_spectrum([0.5, 1.0], [-1.0, 1.0]), "negative"),
    (lambda: rss.realise(rss.jonswap(1.0, 8.0), 100.0, 4.0), "energy"),
    (lambda: rss.realise(rss.jonswap(1.0, 8.0), 0.0, 0.1), "duration"),
    (lambda: rss.realise(rss.jonswap(1.0, 8.0), 10.0, 0.1, method="x"), "method"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()


@given(hs=st.floats(0.01, 10.0), tp=st.floats(0.5, 20.0))
def test_energy_period_of_pierson_and_moskowitz_and_of_a_table(hs, tp):
    """Te = Gamma(5/4) 1.25^(-1/4) Tp for gamma 1; a triangle from 0 to 2 w: int S / w = 2 ln 2 S(w)."""
    assert rss.jonswap(hs, tp, gamma=1.0).te == pytest.approx(0.9064024770554771 * 1.25**-0.25 * tp, rel=1e-9)
    w = 2.0 * np.pi / tp
    table = rss.user_spectrum([0.0, w, 2.0 * w], [0.0, hs, 0.0])
    assert table.moment(-1) == pytest.approx(2.0 * np.log(2.0) * hs, rel=1e-9)


def test_a_moment_that_does_not_exist_is_refused():
    sea, table = rss.jonswap(1.0, 8.0), rss.user_spectrum([0.0, 1.0, 2.0], [0.5, 1.0, 0.0])
    for call in (lambda: sea.moment(4), lambda: sea.moment(-2), lambda: table.moment(-1)):
        with pytest.raises(rss.InputError, match="order: "):
            call()
