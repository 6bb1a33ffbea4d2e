"""The section solver against closed forms, reference tables and physical laws that its equations do not contain."""

import numpy as np
import pytest

import radiation_ss as rss
from radiation_ss.hydro.section import circle_section, solve_section

G = 9.81
RHO = 1000.0


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.fixture(scope="module")
def tank():
    """The paper's section: b = d = 0.1 m, area ratio 0.9, 0.45 m of water."""
    kb = np.array([1e-3, 0.05, 0.1, 0.3, 0.7, 1.0, 1.7, 3.0, 6.0])
    return solve_section(rss.lewis_section(0.1, 0.1, 0.9), np.sqrt(kb * G / 0.1), 0.45)


def test_semicircle_in_deep_water_against_the_reference_table(data):
    ref = np.genfromtxt(data / "reference" / "semicircle_deepwater.csv", delimiter=",", names=True)
    a = 2.0
    mass, tick = 0.5 * np.pi * RHO * a**2, np.sqrt(a / G)
    h = rss.section_2d(circle_section(a), ref["omega_sqrt_a_over_g"] / tick, panels=60)
    for dof, name in ((0, "22"), (1, "33")):
        suffix = "_bem" if dof == 0 else ""
        assert relative(h.A[:, dof, dof] / mass, ref[f"a{name}{suffix}"]) < 1e-4
        assert relative(h.B[:, dof, dof] / mass * tick, ref[f"b{name}{suffix}"]) < 2e-4


def test_lewis_section_in_deep_water_against_the_reference_table(data):
    ref = np.genfromtxt(data / "reference" / "lewis_H0_1_sigma_0p9_deepwater_per_metre.csv", delimiter=",", names=True)
    h = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), ref["omega_rad_s"], panels=60)
    for name, i, j in (("22", 0, 0), ("33", 1, 1), ("44", 2, 2), ("24", 0, 2)):
        assert relative(h.A[:, i, j], ref[f"A{name}"]) < 2e-4
        assert relative(h.B[:, i, j], ref[f"B{name}"]) < 2e-4
    for i, name in enumerate("234"):
        expected = ref[f"X{name}_abs"] * np.exp(1j * np.deg2rad(ref[f"X{name}_lead_deg"]))
        assert relative(h.X[:, 0, i], expected) < 3e-4


def test_infinite_frequency_closed_forms():
    lewis = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), [1.0])
    assert lewis.A_inf[1, 1] == pytest.approx(1.183586 * RHO * np.pi * 0.1**2 / 2, rel=1e-6)
    circle = rss.section_2d(circle_section(1.0), [1.0])
    assert circle.A_inf[0, 0] == pytest.approx(4 / np.pi**2 * RHO * np.pi / 2, rel=1e-4)
    assert np.abs(circle.A_inf[2]).max() < 1e-3 * RHO  # a circle turns without moving water


def test_long_waves_in_finite_depth_have_the_shallow_water_damping(tank):
    assert tank.hydro.B[0, 1, 1] / RHO == pytest.approx(2 * 0.1**2 * np.sqrt(G / 0.45), rel=1e-3)


def test_great_depth_is_deep_water():
    section, omega = rss.lewis_section(0.1, 0.1, 0.9), np.sqrt(np.array([0.1, 0.5, 1.0, 3.0]) * G / 0.1)
    deep, finite = rss.section_2d(section, omega), rss.section_2d(section, omega, 100.0)
    for name in ("A", "B", "X"):
        np.testing.assert_allclose(getattr(finite, name), getattr(deep, name), rtol=1e-4,
                                   atol=1e-4 * np.abs(getattr(deep, name)).max())


def test_energy_haskind_and_symmetry_hold_for_all_modes(tank):
    assert tank.checks.worst < 1e-3
