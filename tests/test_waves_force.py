"""Exciting force of random seas against single harmonics, known shifts in direction and the spectrum of the force."""

import numpy as np
import pytest
from plant_bodies import tank_fit
from scipy.optimize import brentq

import radiation_ss as rss
from radiation_ss import exciting_force
from radiation_ss.simulation import wave_force
from radiation_ss.waves import Sea, cosine_spreading, energy_outside, transfer

OMEGA = np.linspace(0.2, 4.0, 60)
DIRECTIONS = np.linspace(-np.pi, np.pi, 13)


def body(directions=DIRECTIONS):
    """Surge and heave of a point-like body: heave force even, surge force ~ cos(direction), smooth in frequency."""
    X = np.empty((OMEGA.size, len(directions), 2), dtype=complex)
    X[:, :, 0] = 2e5j * OMEGA[:, None] * np.exp(-OMEGA[:, None]) * np.cos(directions)
    X[:, :, 1] = 1e6 * np.exp(-0.3 * OMEGA[:, None] ** 2) * np.ones(len(directions))
    zeros = np.zeros((OMEGA.size, 2, 2))
    return rss.HydroData(OMEGA, zeros, zeros, dofs=("Surge", "Heave"), X=X, directions=directions, source="point")


def single(k, amplitude, direction=0.0, samples=400, dt=0.25):
    harmonics = np.zeros((1, samples // 2 + 1), dtype=complex)
    harmonics[0, k] = amplitude
    return Sea(dt, samples, samples, harmonics, np.array([direction]))


def test_one_harmonic_is_the_transfer_function():
    sea = single(16, 0.5 * np.exp(0.7j), direction=np.pi / 3)
    w = sea.omega[16]
    X = np.array([2e5j * w * np.exp(-w) * 0.5, 1e6 * np.exp(-0.3 * w**2)])
    expected = (X[:, None] * 0.5 * np.exp(0.7j) * np.exp(1j * w * sea.time)).real
    # Directions are 30 degrees apart and pi/3 is one of them; in frequency the data are interpolated.
    assert exciting_force(body(), sea) == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_direction_is_linear_between_and_goes_round():
    data = body()
    w = OMEGA[10:12]
    midway = transfer(data, w, np.pi / 12)
    assert midway == pytest.approx(0.5 * (transfer(data, w, 0.0) + transfer(data, w, np.pi / 6)))
    assert transfer(data, w, 2 * np.pi - 0.3) == pytest.approx(transfer(data, w, -0.3))


def test_headings_all_round_close_the_circle():
    headings = np.radians(np.arange(0.0, 360.0, 30.0))
    data, w = body(headings), OMEGA[10:12]
    between = transfer(data, w, np.radians(345.0))
    assert between == pytest.approx(0.5 * (transfer(data, w, np.radians(330.0)) + transfer(data, w, 0.0)))
    assert transfer(data, w, headings[3]) == pytest.approx(data.X[10:12, 3], rel=1e-9)
    assert transfer(data, w, headings[-1]) == pytest.approx(data.X[10:12, -1], rel=1e-9)


def test_beam_seas_are_not_the_mean_of_head_and_following_seas():
    two = body(np.radians([0.0, 180.0]))
    for angle, at in ((0.0, 0), (np.pi, 1), (-np.pi, 1)):
        assert transfer(two, OMEGA, angle) == pytest.approx(two.X[:, at], rel=1e-9)
    with pytest.raises(rss.InputError, match="90 deg lies between 0 and 180 deg"):
        transfer(two, OMEGA, np.pi / 2.0)


def test_probe_sees_the_wave_of_the_dispersion_relation():
    depth, w = 0.8, single(16, 1.0).omega[16]
    k = brentq(lambda k: 9.81 * k * np.tanh(k * depth) - w**2, 1e-6, 100.0, xtol=1e-14)
    sea = single(16, 0.3, direction=np.pi / 6)
    expected = 0.3 * np.cos(w * sea.time - k * (2.0 * np.cos(np.pi / 6) + 1.0 * np.sin(np.pi / 6)))
    assert sea.elevation_at(2.0, 1.0, depth=depth) == pytest.approx(expected, abs=1e-9)
    assert np.array_equal(sea.elevation_at(0.0), sea.elevation)


def test_force_variance_is_the_integral_of_its_spectrum():
    spectrum = rss.jonswap(2.0, 6.0)
    spread = cosine_spreading(DIRECTIONS[:-1], 0.0, 8.0)
    sea = rss.realise(spectrum, 2000.0, 0.5, seed=4, directions=DIRECTIONS[:-1], spreading=spread)
    force = exciting_force(body(), sea)
    w = np.linspace(0.2, 4.0, 4000)
    for dof in range(2):
        density = sum(s * np.abs(transfer(body(), w, d)[:, dof]) ** 2 for s, d in zip(spread, DIRECTIONS))
        # Components of one frequency from several directions interfere: the variance scatters by 1/sqrt(2 B T).
        assert np.var(force[dof]) == pytest.approx(np.trapezoid(density * spectrum(w), w), rel=0.2)


def test_spreading_is_the_longuet_higgins_density():
    angles = np.linspace(-np.pi, np.pi, 361)[:-1]
    share = cosine_spreading(angles, 0.4, 5.0)
    assert share.sum() == pytest.approx(1.0)
    # G(5) = 2^9 / pi * Gamma(6)^2 / Gamma(11)
    density = 2.0**9 / np.pi * 120.0**2 / 3628800.0 * np.cos(0.5 * (angles - 0.4)) ** 10
    assert share / np.radians(1.0) == pytest.approx(density, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("call, words", [
    (lambda: exciting_force(body().replace(X=None, directions=None), single(16, 1.0)), "X is missing"),
    (lambda: exciting_force(body(), single(1, 1.0)), "outside the frequencies"),
    (lambda: exciting_force(body(), rss.realise(rss.jonswap(1.0, 6.0), 60.0, 0.1)), r"say which.*directions=\["),
    (lambda: exciting_force(body(np.linspace(0.0, 1.0, 3)), single(16, 1.0, 2.0)), "direction"),
    (lambda: rss.realise(rss.jonswap(1.0, 6.0), 60.0, 0.1, directions=[0.0, 1.0], spreading=[1.0]), "spreading"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()


def test_the_energy_outside_the_band_of_x_is_left_out_where_that_is_allowed():
    sea = single(16, 1.0)
    amplitudes = np.array(sea.amplitudes)
    amplitudes[0, 1], amplitudes[0, 120] = 0.1, 0.2         # 0.06 and 7.5 rad/s; X from 0.2 to 4
    mixed = Sea(sea.dt, sea.samples, sea.period, amplitudes, sea.directions)
    share, said = energy_outside(body(), mixed)
    assert share == pytest.approx(0.05 / 1.05)
    assert "(1.0% below 0.2 rad/s, 3.8% above 4 rad/s)" in said
    with pytest.raises(rss.InputError, match=r"4\.8% of the sea's energy.*more than 0\.01.*outside=0\.05, --outside"):
        exciting_force(body(), mixed)
    assert exciting_force(body(), mixed, outside=0.05) == pytest.approx(exciting_force(body(), sea), rel=1e-9, abs=1e-3)
    with pytest.raises(rss.InputError, match="from 0 to 1"):
        exciting_force(body(), sea, outside=5.0)


def test_a_model_brings_its_own_data():
    data = body().select("Heave")
    model = rss.Model(("Heave",), [[1e5]], [[1e5]], [[1e5]], tank_fit(), hydro=data)
    assert np.array_equal(exciting_force(model, single(16, 1.0)), exciting_force(data, single(16, 1.0)))


def test_the_force_of_a_long_body_keeps_its_size_between_the_frequencies_of_a_file():
    """X of a body whose force comes 6 s late turns once in eight frequencies: it is the elevation 6 s earlier."""
    omega, late = np.linspace(0.1, 3.0, 23), 6.0
    assert 2.0 * np.pi / late / (omega[1] - omega[0]) == pytest.approx(8.0, rel=0.01)
    X = 1e6 * np.exp(-1j * omega * late)[:, None, None]
    zeros = np.zeros((omega.size, 1, 1))
    fit = tank_fit()
    data = rss.HydroData(omega, zeros, zeros, dofs=fit.dofs, X=X)
    model = rss.Model(fit.dofs, [[1.0]], [[1.0]], [[1.0]], fit, hydro=data)
    rng, time = np.random.default_rng(3), np.arange(0.0, 600.0, 0.2)
    sea = [(w, rng.uniform(0.0, 2.0 * np.pi)) for w in rng.uniform(0.5, 2.5, 40)]
    elevation = lambda t: sum(np.cos(w * t + phase) for w, phase in sea)  # noqa: E731
    record = rss.Record(time, {"Heave": 0.0 * time, "wave_elevation": elevation(time)}, kind="waves")
    (force,) = wave_force(model, record)
    inside = time[(time > 60.0) & (time < 540.0)]
    expected = 1e6 * elevation(inside - late)
    error = np.std(force(inside) - expected) / np.std(expected)
    assert error < 0.02  # straight lines: 0.05


@pytest.mark.parametrize("apart, told", [(10.0, False), (45.0, True)])
def test_a_long_body_between_coarse_directions_is_warned_of(apart, told, caplog):
    """Of a line of length L along x the force is that of the water under it, sin(z) / z with z = k L cos(beta) / 2."""
    omega, beta = np.linspace(0.4, 1.6, 40), np.radians(np.arange(0.0, 181.0, apart))
    z = 0.5 * omega[:, None] ** 2 / 9.81 * 40.0 * np.cos(beta)
    X = (1e5 * np.sinc(z / np.pi))[:, :, None].astype(complex)
    table = np.full((40, 1, 1), 1e4)
    data = rss.HydroData(omega, table, table, A_inf=[[1e4]], dofs=("Heave",), X=X, directions=beta, depth=np.inf)
    sea = rss.realise(rss.jonswap(2.0, tp=6.0), 300.0, 0.5, seed=0, directions=[np.radians(67.0)])
    rss.exciting_force(data, sea, outside=0.2)
    assert any("linear between the directions" in text for text in caplog.messages) == told


def test_degrees_are_no_radians():
    with pytest.raises(rss.InputError, match="radians"):
        rss.realise(rss.jonswap(2.0, tp=6.0), 60.0, 0.5, directions=[90.0])
    with pytest.raises(rss.InputError, match="radians"):
        cosine_spreading([0.0, 45.0, 90.0])


@pytest.mark.parametrize("step", [0.02, 0.1])
@pytest.mark.parametrize("away", [50.0, 200.0, -200.0])
def test_a_body_far_from_the_phases_origin_has_the_force_of_its_place(step, away, caplog):
    """X = e^(-2k - ikR) in deep water, given at frequencies between which it turns by up to 12 rad."""
    omega = np.arange(round(0.1 / step), round(3.0 / step) + 1) * step
    one, k = np.ones((omega.size, 1, 1)), omega**2 / 9.81
    data = rss.HydroData(omega, 1e4 * one, 1e2 * one, [[1e4]], ("Heave",), M=[[1e4]], C=[[1e5]],
                         X=(1e5 * np.exp(-2.0 * k - 1j * k * away))[:, None, None], directions=[0.0])
    sea = rss.realise(rss.jonswap(1.0, tp=7.5), 300.0, 0.2, seed=2)
    inside = (sea.omega >= 0.1) & (sea.omega <= 3.0)
    w, a = sea.omega[inside], np.squeeze(sea.amplitudes)[inside]
    true = (1e5 * np.exp(-(2.0 + 1j * away) * w**2 / 9.81) * a * np.exp(1j * np.outer(sea.time, w))).sum(axis=1).real
    error = rss.exciting_force(data, sea, outside=0.1)[0] - true
    assert error.std() < 2e-3 * true.std() and not caplog.records


def test_a_force_that_turns_too_far_between_frequencies_is_said(caplog):
    omega = np.arange(0.1, 3.01, 0.1)
    one = np.ones((omega.size, 1, 1))
    data = rss.HydroData(omega, 1e4 * one, 1e2 * one, [[1e4]], ("Heave",), M=[[1e4]], C=[[1e5]],
                         X=np.exp(-20j * omega)[:, None, None], directions=[0.0])
    rss.exciting_force(data, rss.realise(rss.jonswap(1.0, tp=7.5), 300.0, 0.2, seed=2), outside=0.1)
    assert "X of Heave turns by more than a radian" in caplog.text
