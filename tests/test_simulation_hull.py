"""Restoring from a hull's shape: the wall-sided formula, a sphere's cap, and a large roll decay."""

from itertools import pairwise
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import radiation_ss as rss
from radiation_ss.effects import Active, hull_restoring, named, station
from radiation_ss.errors import InputError

RHO, G = 1000.0, 9.81


def box(breadth=2.0, draft=0.5, freeboard=1.0, length=10.0, cuts=1):
    edges = np.linspace(-0.5, 0.5, cuts + 1) * length
    outline = [(-breadth / 2, -draft), (breadth / 2, -draft), (breadth / 2, freeboard), (-breadth / 2, freeboard)]
    return [station(0.5 * (a + b), b - a, outline[::-1] if cuts % 2 else outline) for a, b in pairwise(edges)]


def beyond(effect, elevation=0.0, **motion):
    """The effect's force on heave, roll and pitch."""
    s = SimpleNamespace(elevation=elevation)
    s.all = [SimpleNamespace(dof=dof, x=motion.get(dof, 0.0)) for dof in ("Heave", "Roll", "Pitch")]
    return np.array([float(ca.DM(ca.evalf(ca.SX(f)))) for f in effect.force(s, named(effect, [1.0]))])


@pytest.mark.parametrize("roll", [-0.4, 0.1, 0.3, 0.45])
def test_a_box_rolls_as_the_wall_sided_formula_has_it(roll):
    """Righting arm (GM + BM tan^2 / 2) sin while neither bilge nor deck crosses the water (Barrass & Derrett)."""
    mass, height = RHO * 10.0, 0.2
    bm, kb = 2.0**2 / (12.0 * 0.5), -0.25
    gm = kb + bm - height
    expected = -mass * G * ((gm + 0.5 * bm * np.tan(roll)**2) * np.sin(roll) - gm * roll)
    found = beyond(hull_restoring(box(), mass=mass, height=height), Roll=roll)
    assert found[1] == pytest.approx(expected, rel=1e-9)
    assert found[0] == pytest.approx(0.0, abs=1e-6)


def test_a_deck_that_goes_under_and_a_bottom_that_comes_out():
    """Wall-sided between: nothing beyond the linear; past either end the lift stays what it is there."""
    effect = hull_restoring(box(), mass=RHO * 10.0, height=0.0)
    per_metre = RHO * G * 20.0
    assert beyond(effect, Heave=0.3)[0] == pytest.approx(0.0, abs=1e-6)
    assert beyond(effect, Heave=0.8)[0] == pytest.approx(per_metre * 0.3, rel=1e-9)
    assert beyond(effect, Heave=-1.4)[0] == pytest.approx(-per_metre * 0.4, rel=1e-9)


def test_pitch_of_a_box_is_linear_until_its_ends_come_out():
    effect = hull_restoring(box(cuts=40), mass=RHO * 10.0, height=0.0)
    assert beyond(effect, Pitch=0.05)[2] == pytest.approx(0.0, abs=1e-6)
    angle = 0.15  # the end at x = 5 m has 0.75 m of travel for a draft of 0.5 m
    x = np.linspace(-5.0, 5.0, 20001)
    lost = np.maximum(-x * angle - 0.5, 0.0)  # of the linear immersion, where the bottom is out of the water
    assert beyond(effect, Pitch=angle)[2] == pytest.approx(-RHO * G * 2.0 * np.trapezoid(x * lost, x), rel=0.01)


@pytest.mark.parametrize("heave", [-0.5, 0.2, 0.6])
def test_a_sphere_heaves_as_its_cap_has_it(heave):
    count, pieces = 40, 24
    angle = 2.0 * np.pi * np.arange(count) / count
    same_area = np.sqrt(2.0 * np.pi / count / np.sin(2.0 * np.pi / count))
    circle = same_area * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    middles = -1.0 + 2.0 * (np.arange(pieces) + 0.5) / pieces
    stations = [station(m, 2.0 / pieces, np.sqrt(1.0 - m**2) * circle) for m in middles]
    found = beyond(hull_restoring(stations, mass=RHO * 2.0 / 3.0 * np.pi, height=0.0), Heave=heave)[0]
    depth = 1.0 - heave  # immersed cap pi d^2 (3 - d) / 3, waterplane pi
    expected = RHO * G * np.pi * (depth**2 * (3.0 - depth) / 3.0 - 2.0 / 3.0 + heave)
    # Polygons and stations are within 0.2 % of the sphere, of which the linear part is taken away.
    assert found == pytest.approx(expected, abs=3e-3 * RHO * G * np.pi * abs(heave))


def test_raising_the_water_is_lowering_the_body():
    effect = hull_restoring(box(), mass=RHO * 10.0, height=0.0, waves=True)
    assert effect.needs == "waves"
    assert np.allclose(beyond(effect, elevation=1.3, Roll=0.2), beyond(effect, Heave=-1.3, Roll=0.2), atol=1e-6)


def test_a_large_roll_decay_has_the_period_of_the_righting_arm():
    mass, height, inertia = RHO * 10.0, 0.2, 1.2e4
    bm = 2.0**2 / 6.0
    gm = -0.25 + bm - height
    rigid = rss.RadiationFit(("Roll",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    model = rss.Model(("Roll",), [[inertia]], [[0.0]], [[mass * G * gm]], rigid)
    time = np.arange(0.0, 12.0, 0.02)
    effect = Active(hull_restoring(box(), mass=mass, height=height), "", {"share": 1.0})
    found = np.asarray(rss.simulate(model, (time, 0.0 * time), [effect], start=[0.4, 0.0]).outputs)[0]

    def rate(t, s):
        return [s[1], -mass * G * (gm + 0.5 * bm * np.tan(s[0])**2) * np.sin(s[0]) / inertia]

    expected = solve_ivp(rate, (0.0, 12.0), [0.4, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    assert np.abs(found - expected).max() < 5e-3 * 0.4


def test_bad_outlines_are_refused_with_a_clear_word():
    with pytest.raises(InputError, match="at least three"):
        station(0.0, 1.0, [(0.0, 0.0), (1.0, 0.0)])
    with pytest.raises(InputError, match="area 0"):
        station(0.0, 1.0, [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])
