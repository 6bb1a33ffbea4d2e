"""Strip theory against prisms, rigid-body laws and closed-form hydrostatics."""

import numpy as np
import pytest

import radiation_ss as rss
from radiation_ss.hydro import box_section, circle_section, strip_theory

RHO, G = 1000.0, 9.81
OMEGA = [0.8, 1.5]


def test_a_prism_is_its_section_times_length_and_its_moments():
    L, section = 20.0, box_section(1.0, 0.8, 0.2)
    ship = strip_theory([(-L / 2, section), (L / 2, section)], OMEGA, 5.0, panels=40, centre_of_gravity=-0.3)
    strip = rss.section_2d(section, OMEGA, 5.0, panels=40, centre_of_gravity=-0.3)
    for name in ("A", "B", "A_inf", "C"):
        whole, part = np.atleast_3d(getattr(ship, name).T).T, np.atleast_3d(getattr(strip, name).T).T
        np.testing.assert_allclose(whole[:, :3, :3], L * part, rtol=1e-12, atol=1e-9)
        if name != "C":
            np.testing.assert_allclose(whole[:, 3, 3], L**3 / 12 * part[:, 1, 1], rtol=1e-12)
            np.testing.assert_allclose(whole[:, 4, 4], L**3 / 12 * part[:, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(ship.X[:, 0, :3], L * strip.X[:, 0], rtol=1e-12)
    np.testing.assert_allclose(ship.X[:, 0, 3:], 0.0, atol=1e-6)
    volume = section.area * L
    GM_L = 2.0 * L**3 / 12 / volume + section.centre_of_buoyancy + 0.3
    assert ship.C[3, 3] == pytest.approx(RHO * G * volume * GM_L)


def test_a_shifted_ship_is_the_same_ship_about_another_point():
    shapes = [None, circle_section(1.0), box_section(1.2, 0.9, 0.4), None]
    here = strip_theory(list(zip([-9.0, -3.0, 4.0, 8.0], shapes)), OMEGA, panels=20, gyradii=(0.8, 4.0, 4.1))
    there = strip_theory(list(zip([-7.0, -1.0, 6.0, 10.0], shapes)), OMEGA, panels=20, gyradii=(0.8, 4.0, 4.1))
    moved = there.at((2.0, 0.0, 0.0))
    for name in ("A", "B", "A_inf", "C", "M", "X"):
        np.testing.assert_allclose(getattr(moved, name), getattr(here, name), rtol=1e-9,
                                   atol=1e-9 * np.abs(getattr(here, name)).max())


def test_inertia_about_the_centre_of_gravity_is_diagonal():
    ship = strip_theory([(0.0, circle_section(1.0)), (10.0, circle_section(1.0))], OMEGA, panels=20,
                        centre_of_gravity=-0.2, gyradii=(0.7, 2.5, 2.6))
    assert ship.M[0, 0] == pytest.approx(RHO * np.pi / 2 * 10)
    about_g = ship.select(("Sway", "Heave", "Roll", "Yaw")).at((5.0, 0.0, -0.2))
    np.testing.assert_allclose(about_g.M, ship.M[0, 0] * np.diag([1.0, 1.0, 0.49, 2.6**2]), atol=1e-6)
    assert ship.M[3, 3] == pytest.approx(ship.M[0, 0] * (2.5**2 + 5.0**2 + 0.2**2))


@pytest.mark.parametrize(("stations", "message"), [
    ([(0.0, circle_section(1.0))], "at least two"),
    ([(1.0, circle_section(1.0)), (0.0, None)], "ascending"),
    ([(0.0, None), (1.0, None)], "all are tips"),
    ([(0.0, [(0, -1), (1, -1)]), (1.0, None)], "must end on the waterline"),
])
def test_bad_stations_are_one_clear_error(stations, message):
    with pytest.raises(rss.InputError, match=message):
        strip_theory(stations, OMEGA)
