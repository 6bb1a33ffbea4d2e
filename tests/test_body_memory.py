"""The radiation model of a body's motion: right where the body swings, whatever the wave frequencies are like."""

import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import radiation_ss as rss
from radiation_ss.body import natural_modes
from radiation_ss.cli import main

OMEGA = np.linspace(0.05, 6.0, 90)
A_INF, MASS, C = 1e6, 4e6, 1e5


def kernel(s):
    """A radiation kernel of three resonances among the waves, in closed form."""
    return (2e6 * s / (s**2 + 0.25 * s + 1.2**2) + 3e6 * s / (s**2 + 0.2 * s + 2.4**2)
            + 1e6 * s / (s**2 + 0.3 * s + 3.6**2))


def slow_body():
    """A slowly swinging body whose file violates the Kramers-Kronig relations at high frequencies, as panels do."""
    K = kernel(1j * OMEGA)
    K = np.where(OMEGA > 1.0, K.real + 1j * K.imag * (1.0 - 0.6 * np.sin(np.pi * (OMEGA - 1.0) / 5.0)), K)
    return rss.HydroData(OMEGA, A_INF + (K.imag / OMEGA)[:, None, None], K.real[:, None, None], A_inf=[[A_INF]],
                         dofs="Surge", M=[[MASS]], C=[[C]])


def swing():
    """Its frequency [rad/s] and damping ratio, by fixed point from the closed form."""
    omega = 0.1
    for _ in range(100):
        inertia = MASS + A_INF + kernel(1j * omega).imag / omega
        omega = np.sqrt(C / inertia)
    return omega, kernel(1j * omega).real / (2.0 * omega * inertia)


@pytest.mark.parametrize("order", [4, 6])
def test_a_slow_motion_keeps_its_period_and_damping_though_the_waves_are_fitted_badly(order):
    omega, ratio = swing()
    model = rss.Model.from_hydro(slow_body(), order=order)
    found = natural_modes(model)
    assert model.fit.relative_error > 0.1
    assert found.period[0] == pytest.approx(2.0 * np.pi / omega, rel=1e-3)
    assert found.ratio[0] == pytest.approx(ratio, rel=0.02)
    assert any("natural frequency" in note for note in model.fit.notes)


@pytest.mark.parametrize("order", [3, 5])
def test_a_motion_that_nothing_restores_is_not_damped_at_rest(order):
    """A mooring holds it far below the waves, where the closed form has hardly any damping."""
    data, omega = slow_body().replace(C=[[0.0]]), 0.03
    exact, free = kernel(1j * omega).real, rss.fit_radiation(data, order).frequency_response([omega])[0, 0, 0].real
    model = rss.Model.from_hydro(data, order=order)
    assert model.fit.passive
    assert abs(model.fit.frequency_response([omega])[0, 0, 0].real - exact) < 0.01 * abs(free - exact)
    assert any("the closest fit damps Surge more" in note for note in model.fit.notes)
    asked = rss.Model.from_hydro(data, order=order, at_zero="free").fit
    assert asked.frequency_response([omega])[0, 0, 0].real == pytest.approx(free)


@pytest.mark.parametrize("share", [0.6, 2.4, 4.0])
@pytest.mark.parametrize(("order", "period"), [(3, 0.02), (5, 0.005)])
def test_a_slow_moored_motion_has_no_more_damping_than_the_file(order, period, share):
    """Its frequency is a `share` of the file's first one: below it, or among it, where the damping is next to none."""
    K, omega = kernel(1j * OMEGA)[:, None, None], share * OMEGA[0]
    data = rss.HydroData(OMEGA, A_INF + K.imag / OMEGA[:, None, None], K.real, A_inf=[[A_INF]], dofs="Surge",
                         M=[[10.0 * MASS]], C=[[omega**2 * (10.0 * MASS + A_INF + kernel(1j * omega).imag / omega)]])
    exact, free = kernel(1j * omega).real, rss.fit_radiation(data, order).frequency_response([omega])[0, 0, 0].real
    model = rss.Model.from_hydro(data, order=order)
    assert model.fit.passive
    assert abs(model.fit.frequency_response([omega])[0, 0, 0].real - exact) < 0.1 * abs(free - exact)
    assert natural_modes(model).period[0] == pytest.approx(2.0 * np.pi / omega, rel=period)


def test_what_is_wrong_with_the_fit_is_said_once():
    """Several orders are tried, each of which misses damping of the other sign."""
    data = slow_body()
    with pytest.warns(rss.errors.InputWarning) as said:
        rss.Model.from_hydro(data.replace(B=-data.B), accuracy=0.01)
    assert len([one for one in said if "the fit does not follow K of Surge" in str(one.message)]) == 1


def test_points_and_fits_of_ones_own_are_kept():
    data = slow_body()
    own = rss.fit_radiation(data, 4)
    assert rss.Model.from_hydro(data, own).fit is own
    omega = OMEGA[33]
    asked = rss.Model.from_hydro(data, order=4, points=[omega]).fit
    assert asked.frequency_response([omega])[0, 0, 0] == pytest.approx(data.K[33, 0, 0], rel=1e-3)


def test_commands_and_python_make_the_same_model_of_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 22.0, 30), depth=0.45).select("Heave")
    rss.write_hydro(section.replace(M=[[16.0]]), "body.nc")
    time = np.arange(0.0, 20.0, 0.05)
    rss.write_record(rss.Record(time, {"Heave": 0.01 * np.exp(-time) * np.cos(7.0 * time)}, kind="decay"), "decay.csv")
    assert main(["simulate", "body.nc", "decay.csv", "--out", "motion.csv"]) == 0
    by_command = rss.read_record("motion.csv").channels["Heave"]
    by_python = rss.simulate("body.nc", "decay.csv").outputs[0]
    assert np.abs(by_command - by_python).max() < 1e-9 * np.abs(by_python).max()


@pytest.mark.parametrize("name, stiffness", [("sphere.1", 6e4), ("sphere.1", 1e5), ("sphere_bemio.h5", 6e4)])
def test_a_lightly_damped_moored_motion_resonates_as_the_file_says(data, name, stiffness):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        sphere = rss.read_hydro(data / "bem" / "formats" / name, **({"rho": 1000.0} if name == "sphere.1" else {}))
    sphere, M = sphere.select("Surge"), np.array([[261364.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        plant = rss.cummins(rss.Model.from_hydro(sphere.replace(M=M, C=[[stiffness]])))
    omega = np.linspace(0.3, 0.8, 20001)
    A, B = (CubicSpline(sphere.omega, part[:, 0, 0])(omega) for part in (sphere.A, sphere.B))
    told = 1.0 / np.abs(stiffness - omega**2 * (M[0, 0] + A) + 1j * omega * B)
    poles = np.linalg.eigvals(plant.A)
    near = poles[np.argmin(np.abs(poles - 1j * omega[np.argmax(told)]))]
    at = near.imag + np.linspace(-5.0, 5.0, 401) * near.real
    force, moved = plant.B[:, plant.input_labels.index("surge_force")], plant.output_labels.index("surge")
    found = [abs(plant.C[moved] @ np.linalg.solve(1j * w * np.eye(len(poles)) - plant.A, force)) for w in at]
    assert 0.8 < max(found) / told.max() < 1.25
