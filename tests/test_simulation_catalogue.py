"""Effects of the catalogue against closed forms, published equations and an independent integrator."""

from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import radiation_ss as rss
from radiation_ss.effects import Active, Line, Scales, catenary, effect_named, library, named, optional, slab
from radiation_ss.errors import InputError
from radiation_ss.simulation import Corrected, linearise

EVERY = {**library(), **optional()}
TIME = np.arange(0.0, 30.0, 0.02)


def sizes(F=1.0, X=1.0, s=1.0, m=1.0):
    """Sizes of one motion with force, motion, time and wave height in other units."""
    speed, other = 1.0 / s, Scales(x=0.3 * X, v=0.3 * X / s, a=0.3 * X / s**2, u=20.0 * F, force=30.0 * F,
                                   omega=1.1 / s, duration=60.0 * s)
    return Scales(x=0.2 * X, v=0.2 * X / s, a=0.21 * X / s**2, u=10.0 * F, force=25.0 * F, omega=1.0 * speed,
                  duration=60.0 * s, natural=1.2 * speed, other=other, elevation=0.1 * m, orbital=0.12 * X / s,
                  speed=0.5 * m / s)


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_prior_is_the_same_in_any_units(name):
    """Force in kN, motion in mm, time in minutes: every number of a slab turns by its parameter's own unit."""
    units = {"F": 1e-3, "X": 1e3, "Y": 1e3, "s": 1.0 / 60.0, "m": 7.0, "rad": 1.0, "J": 1.0}
    if name in ("mooring_lines", "water_on_deck"):
        units |= {"m": 1e3, "rad": 1e3}  # of its motions
    one, other = sizes(), sizes(*(units[key] for key in ("F", "X", "s", "m")))
    for key, parameter in EVERY[name].parameters.items():
        factor = eval(parameter.unit.replace("^", "**"), {}, units)
        before, after = slab(EVERY[name], key, one), slab(EVERY[name], key, other)
        assert before.lower <= min(before.mean) and max(before.mean) <= before.upper
        assert parameter.fixed or before.sd > 0.0
        for a, b in zip((*before.mean, *before[1:]), (*after.mean, *after[1:])):
            assert b == pytest.approx(factor * a, rel=1e-9, abs=1e-12 * factor)


@pytest.mark.parametrize("name", [name for name, e in EVERY.items() if e.family == "damping" and e.force is not None])
def test_what_only_dissipates_has_no_negative_strength(name):
    strengths = [key for key, p in EVERY[name].parameters.items() if p.strength and p.unit != "F/X"]
    # The whole of the radiation force may be missing, and what it fades by in another time is as good as any.
    lowest = {"share": -1.0, "slower": -np.inf} if name == "radiation_damping" else dict.fromkeys(strengths, 0.0)
    assert {key: slab(EVERY[name], key, sizes()).lower for key in strengths} == lowest


def regular(model, elevation, **forces):
    rest = {dof: 0.0 * TIME for dof in model.dofs}
    force = {f"{dof}_force": forces.get(dof, 0.0 * TIME) for dof in model.dofs}
    return rss.Record(TIME, {**rest, **force, "wave_elevation": elevation})


CUBE = np.cbrt(tank_model().M[0, 0] / 1000.0)  # edge of a cube of the displacement [m]


def integrated(model, extra, force):
    """The tank with an extra force(t, x, v) by a library integrator."""
    total = (model.M + model.A_inf)[0, 0]

    def rate(t, s):
        a = force(t) + extra(t, s[-2], s[-1]) - (model.fit.c @ s[:-2])[0] - model.C[0, 0] * s[-2]
        return np.concatenate([model.fit.a @ s[:-2] + model.fit.b[:, 0] * s[-1], [s[-1], a / total]])

    return solve_ivp(rate, TIME[[0, -1]], np.zeros(5), t_eval=TIME, method="LSODA", rtol=1e-9, atol=1e-12).y[3]


@pytest.mark.parametrize("effect, extra", [
    (("morison_drag", {"coefficient": 200.0}),
     lambda t, x, v, h, w: -200.0 * abs(v - w) * (v - w)),
    (("linear_morison_drag", {"coefficient": 20.0, "depth": 0.2}),
     lambda t, x, v, h, w: -20.0 * (v - np.exp(-5.0**2 / 9.81 * 0.2 * CUBE) * w)),
    (("wave_stiffness", {"in_phase": 6000.0, "quadrature": 300.0}),
     lambda t, x, v, h, w: -(6000.0 * h + 300.0 * w) * x),
    (("end_stop", {"stiffness": 2000.0, "gap": 2e-3, "width": 1e-6}),
     lambda t, x, v, h, w: -2000.0 * (max(x - 2e-3, 0.0) - max(-x - 2e-3, 0.0)))])
def test_motion_in_a_regular_wave_agrees_with_an_independent_integrator(effect, extra):
    """In deep water at the surface the heave velocity of the water is the elevation's rate."""
    model, size, w, grown = tank_model(), 0.02, 5.0, np.pi / TIME[-1]

    def height(t):  # a wave that grows and dies out within the record
        return size * np.sin(w * t) * np.sin(grown * t) ** 2

    def rate(t):
        return size * (w * np.cos(w * t) * np.sin(grown * t) ** 2 + grown * np.sin(w * t) * np.sin(2.0 * grown * t))

    record = regular(model, height(TIME), Heave=3.0 * np.cos(w * TIME))
    found = np.asarray(rss.simulate(model, record, [effect], start=np.zeros(5)).outputs)[0]
    expected = integrated(model, lambda t, x, v: extra(t, x, v, height(t), rate(t)), lambda t: 3.0 * np.cos(w * t))
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()


def test_water_on_deck_comes_over_the_freeboard_and_drains():
    """Without motion: T z' = max(h - f, 0)^1.5 / f^.5 - z in a regular wave, by a library integrator."""
    effect, (k, f, T), w = effect_named("water_on_deck"), (400.0, 0.01, 0.3), 5.0
    p = named(effect, [k, f, T])
    elevation = 0.03 * np.sin(w * TIME)

    def ours(t, z):
        s = SimpleNamespace(x=0.0, z=[z[0]], elevation=0.03 * np.sin(w * t))
        return [float(effect.rates(s, p)[0])]

    z = solve_ivp(ours, TIME[[0, -1]], [0.0], t_eval=TIME, rtol=1e-8, atol=1e-11, max_step=0.02).y[0]
    impulse = np.exp(-TIME / T) / T
    expected = np.convolve(np.maximum(elevation - f, 0.0) ** 1.5 / f**0.5, impulse)[:TIME.size] * TIME[1]
    assert np.abs(z - expected).max() < 0.05 * 0.03  # the edge is rounded over a tenth of the freeboard
    force = float(effect.force(SimpleNamespace(z=[2.0]), p))
    assert force == -k * 2.0 and effect.places(["Surge", "float__Heave"]) == [("float__Heave", "")]


def test_waves_are_asked_for_where_an_effect_needs_them():
    model = tank_model()
    record = rss.Record(TIME, {"Heave": 0.0 * TIME, "Heave_force": np.sin(TIME)})
    with pytest.raises(InputError, match="wave_elevation"):
        rss.simulate(model, record, [("morison_drag", {"coefficient": 1.0})])
    still = rss.Record(TIME, dict(record.channels), kind="forced")
    drag = [("quadratic_drag", {"coefficient": 100.0})], [("morison_drag", {"coefficient": 100.0})]
    one, other = (rss.simulate(model, still, effects, start=np.zeros(5)).outputs[0] for effects in drag)
    assert np.allclose(one, other, atol=1e-12)


def test_bouc_wen_is_the_benchmarks_equation():
    """z' = alpha v - (beta gamma |v| z + beta delta v |z|), Noel & Schoukens' hysteretic benchmark (2016), nu = 1."""
    alpha, beta, gamma, delta, size, w = 5e4, 1e3, 0.8, -1.1, 1e-3, 20.0
    effect, reach = effect_named("bouc_wen"), 4e-4
    p = named(effect, [alpha, beta * gamma * reach, beta * delta * reach, 1.0, reach])
    v = lambda t: size * w * np.cos(w * t)  # noqa: E731

    def benchmark(t, z):
        return alpha * v(t) - beta * (gamma * abs(v(t)) * z + delta * v(t) * abs(z))

    def ours(t, z):
        s = type("S", (), {"v": v(t), "z": [z[0]], "x": 0.0})()
        return [float(effect.rates(s, p)[0])]

    options = {"t_eval": np.linspace(0.0, 1.0, 400), "rtol": 1e-9, "atol": 1e-12, "max_step": 1e-3}
    expected = solve_ivp(benchmark, (0.0, 1.0), [0.0], **options).y[0]
    found = alpha * reach * solve_ivp(ours, (0.0, 1.0), [0.0], **options).y[0]
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def transfer(name, values, omega):
    """Force over velocity of a linear effect with own states, from its expressions."""
    effect = effect_named(name)
    s = type("S", (), {})()
    x, v, z = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("z", effect.states)
    s.x, s.v, s.z = x, v, ca.vertsplit(z)
    p = named(effect, values)
    both = ca.vertcat(ca.vertcat(*effect.rates(s, p)), effect.force(s, p))
    slope = np.array(ca.DM(ca.evalf(ca.jacobian(both, ca.vertcat(z, x, v)))))
    k = effect.states
    state = np.array([np.linalg.solve(1j * w * np.eye(k) - slope[:k, :k], slope[:k, k] / (1j * w) + slope[:k, k + 1])
                      for w in omega])
    return state @ slope[k, :k] + slope[k, k] / (1j * omega) + slope[k, k + 1]


def test_viscous_memory_is_the_half_derivative_over_a_decade():
    omega = 2.0 * np.geomspace(1.0 / 3.0, 3.0, 30)
    found = transfer("viscous_memory", [7.0, 2.0], omega)
    exact = -7.0 * np.sqrt(1j * omega / 2.0)
    assert np.abs(found / exact - 1.0).max() < 0.02
    assert np.all(transfer("viscous_memory", [7.0, 2.0], np.geomspace(1e-3, 1e3, 40)).real < 0.0)


@pytest.mark.parametrize("turned", [0.1, 0.5, 1.5])
def test_late_feedback_is_late(turned):
    omega, delay = np.array([2.0]), turned / 2.0
    exact = -(5.0 + 30.0 / (2j)) * np.exp(-1j * turned)
    # The remainder of Pade's (2, 2) approximation is (w T)^5 / 720.
    assert abs(transfer("delayed_feedback", [5.0, 30.0, delay], omega)[0] / exact - 1.0) < turned**5 / 700.0 + 1e-12
    lag = transfer("lagged_feedback", [5.0, delay], omega)[0]
    assert lag == pytest.approx(-5.0 / (1.0 + 1j * turned), rel=1e-12)


def test_slamming_takes_energy_on_the_way_out_only():
    effect, rng = effect_named("slamming"), np.random.default_rng(0)
    p = named(effect, [3.0, 0.1, 1.0, 0.001])
    for x, v in rng.normal(0.0, 0.5, (200, 2)):
        force = float(effect.force(type("S", (), {"x": x, "v": v})(), p))
        assert force == pytest.approx(-3.0 * v**2 if x > 0.11 and v > 0.0 else 0.0, abs=1e-3 if x > 0.09 else 1e-6) or (
            0.09 < x < 0.11)


def test_waves_slam_while_they_rise_over_a_level_of_the_body():
    effect, rng = effect_named("wave_slamming"), np.random.default_rng(1)
    p = named(effect, [3.0, 0.1, 0.001])
    for x, v, height, rate in rng.normal(0.0, 0.5, (200, 4)):
        s = type("S", (), {"x": x, "v": v, "elevation": height, "elevation_rate": rate})()
        over, speed = height - x - 0.1, rate - v
        if abs(over) > 0.01:
            expected = 3.0 * speed**2 if min(over, speed) > 0.0 else 0.0
            assert float(effect.force(s, p)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name, values, matrix", [
    ("relative_damping", {"coefficient": 4e5}, "D"), ("relative_stiffness", {"stiffness": 3e5}, "C")])
def test_a_joint_is_the_matrix_of_both_bodies(name, values, matrix):
    model = coupled_model(("float__Heave", "spar__Heave"))
    force = np.stack([1e5 * np.cos(0.8 * TIME), 5e4 * np.sin(0.6 * TIME)])
    (size,) = values.values()
    joined = model.replace(**{matrix: getattr(model, matrix) + size * np.array([[1.0, -1.0], [-1.0, 1.0]])})
    expected = np.asarray(rss.simulate(joined, (TIME, force)).outputs)
    (place,) = EVERY[name].places(model.dofs)
    found = rss.simulate(model, (TIME, force), [(name, ",".join(place), values)]).outputs
    # The integrator's step: 0.45 rad of the fastest natural motion.
    assert np.abs(np.asarray(found) - expected)[:2].max() < 1e-3 * np.abs(expected[:2]).max()
    extra = linearise(model, Corrected({}, (Active(EVERY[name], place[0], values, place[1]),)))
    assert np.allclose(getattr(model, matrix) + getattr(extra, matrix), getattr(joined, matrix))


def test_joints_only_join_the_same_motion_of_two_bodies():
    effect = EVERY["relative_damping"]
    assert effect.places(("Surge", "Heave")) == []
    assert effect.places(("a__Heave", "a__Pitch", "b__Heave", "b__Pitch")) == [("a__Heave", "b__Heave"),
                                                                               ("a__Pitch", "b__Pitch")]


def test_a_nonlinear_joint_is_linearised_on_both_bodies():
    """8/(3 pi) c a w of the relative motion, with the opposite force on the other body."""
    model = coupled_model(("float__Heave", "spar__Heave"))
    drag = Active(EVERY["relative_drag"], "float__Heave", {"coefficient": 2e5}, "spar__Heave")
    extra = linearise(model, Corrected({}, (drag,), motion={"float__Heave": (0.5 / np.sqrt(2.0), 1.3)}))
    b = 8.0 / (3.0 * np.pi) * 2e5 * 0.5 * 1.3
    assert np.allclose(extra.D, b * np.array([[1.0, -1.0], [-1.0, 1.0]]), rtol=1e-3)


def jonkman(line, distance):
    """Horizontal tension by Jonkman's (2007, appendix B) two equations for the line's ends; no friction on the bed."""
    def missed(ends):
        H, V = np.exp(ends)
        w, L, EA = line.weight, line.length, line.axial
        if w * L > V:
            x = L - V / w + H / w * np.arcsinh(V / H) + H * L / EA
            z = H / w * (np.sqrt(1.0 + (V / H) ** 2) - 1.0) + V**2 / (2.0 * EA * w)
        else:
            low = (V - w * L) / H
            x = H / w * (np.arcsinh(V / H) - np.arcsinh(low)) + H * L / EA
            z = H / w * (np.hypot(1.0, V / H) - np.hypot(1.0, low)) + (V * L - 0.5 * w * L**2) / EA
        return [x - distance, z - line.depth]

    return np.exp(fsolve(missed, np.log([5e5, 5e5]), xtol=1e-12))[0]


# OC4 DeepCwind (Robertson et al. 2014, table 3-14): 835.5 m, 108.63 kg/m in water, 753.6 MN, fairlead 186 m above.
OC4 = Line(835.5, 108.63 * 9.81, 186.0, 837.6 - 40.868, 0.0, 753.6e6)


@pytest.mark.parametrize("distance", [770.0, 785.0, 796.73, 805.0, 812.0, 816.0])
def test_a_lines_tension_is_the_catenarys(distance):
    assert float(OC4.tension(distance)) == pytest.approx(jonkman(OC4, distance), rel=2e-4)


def test_mooring_lines_hold_a_body_and_a_polynomial_follows_them():
    """Three lines 120 degrees apart: at rest no force, alike in surge and sway, stiffer outwards."""
    lines = [Line(OC4.length, OC4.weight, OC4.depth, OC4.distance, heading, OC4.axial)
             for heading in (np.pi / 3, np.pi, -np.pi / 3)]
    effect, model = catenary(lines), coupled_model(("Surge", "Sway", "Heave"))
    x = ca.SX.sym("x", 3)
    signals = [type("S", (), {"x": x[i], "dof": dof})() for i, dof in enumerate(model.dofs)]
    s = type("S", (), {"all": signals})()
    force = ca.Function("force", [x], [ca.vertcat(*effect.force(s, named(effect, [1.0])))])
    assert np.abs(np.asarray(force([0.0, 0.0, 0.0]))).max() < 1e-6 * float(OC4.tension(OC4.distance))
    slope = np.array([(np.asarray(force(h)) - np.asarray(force(-h))).ravel() / 0.02 for h in 0.01 * np.eye(3)])
    assert slope[0, 0] == pytest.approx(slope[1, 1], rel=1e-4) and slope[0, 0] < 0.0 and not slope[2].any()
    # Robertson et al. (2014), table 3-16: the linearised mooring stiffness in surge is 7.08e4 N/m.
    assert -slope[0, 0] == pytest.approx(7.08e4, rel=0.02)
    pushed = np.stack([np.full(TIME.size, 1e5), 0.0 * TIME, 0.0 * TIME])
    moored = model.replace(C=np.diag([0.0, 0.0, 1e6]), D=np.diag([1e6] * 3))
    time = 20.0 * TIME
    at = np.asarray(rss.simulate(moored, (time, pushed), [Active(effect, "", {"share": 1.0})]).outputs)[:2, -1]
    assert float(force([*at, 0.0])[0]) == pytest.approx(-1e5, rel=1e-2)


def test_bad_lines_are_refused_with_a_clear_word():
    with pytest.raises(InputError, match="length 100 m; it must be above the depth"):
        Line(100.0, 10.0, 186.0, 50.0)
    with pytest.raises(InputError, match="line: weight: must be positive and finite, found -1 N/m"):
        Line(100.0, -1.0, 80.0, 50.0)


def test_the_guide_names_every_effect():
    text = (Path(__file__).parents[1] / "docs" / "guide" / "effects.md").read_text(encoding="utf-8")
    assert [name for name in EVERY if f"`{name}`" not in text] == []


@pytest.mark.parametrize("seed", range(4))
def test_lines_pull_back_by_their_even_powers_however_far_the_body_is_off(seed):
    lines, rng = effect_named("mooring_lines"), np.random.default_rng(seed)
    scales = Scales(1.0, 0.6, 0.4, 1.0, 2.0, 0.6, 100.0)
    even = [name for name in lines.parameters if all(name.split("_").count(d) % 2 == 0 and d in ("Surge", "Sway", "Yaw")
                                                     for d in name.split("_"))]
    assert {"Surge_Surge", "Yaw_Yaw", "Surge_Surge_Sway_Sway"} < set(even)
    numbers = dict.fromkeys(lines.parameters, 0.0) | {
        name: max(slab(lines, name, scales).lower, float(rng.normal())) for name in even}
    off = 10.0 * rng.normal(size=3)
    motions = [SimpleNamespace(x=x, dof=dof) for x, dof in zip(off, ("Surge", "Sway", "Yaw"))]
    for motion in motions:
        motion.all = motions
    force = np.array(lines.force(motions[0], SimpleNamespace(**numbers)), dtype=float)
    assert np.all(force * off <= 0.0) and np.any(force)


@pytest.mark.parametrize("effect, missing", [(("slack_mooring", {"stiffness": 1.0, "slack": 0.1}), "side"),
                                             (("quadratic_drag", {}), "coefficient")])
def test_what_does_nothing_without_a_number_asks_for_it(effect, missing):
    with pytest.raises(InputError, match=f"effect {effect[0]}: {missing} is missing"):
        rss.simulate(tank_model(), (TIME, np.sin(TIME)[None]), [effect])


def test_a_law_that_decides_in_python_is_told_what_to_write():
    law = rss.Effect("own", {"c": rss.effects.Parameter("F", 1)}, force=lambda s, p: -p.c if s.v > 0.0 else p.c)
    for effect in ((law, {"c": 1.0}), [(law, "Heave", {"c": 1.0})]):
        with pytest.raises(InputError, match="effect own: its law decides by `if`"):
            rss.simulate(tank_model(), (TIME, np.sin(TIME)[None]), effect)


@pytest.mark.parametrize("width", [1e-2, 1e-3])
def test_a_brake_that_is_stronger_than_the_load_holds(width):
    """SciPy's implicit method on the same law: what slips is a small share of the width."""
    model, time = rss.body(dof="Heave", mass=1000.0, added_mass=500.0, C=20000.0), np.arange(0.0, 10.0, 0.05)
    def rates(t, y):
        friction = 2e4 * (y[1] / width) / (1.0 + np.abs(y[1] / width) ** 3) ** (1.0 / 3.0)
        return [y[1], (3000.0 * np.sin(2.5 * t) - 20000.0 * y[0] - friction) / 1500.0]
    true = solve_ivp(rates, time[[0, -1]], [0.0, 0.0], "Radau", t_eval=time, rtol=1e-8, atol=1e-12).y
    brake = ("coulomb_friction", "Heave", {"force": 2e4, "width": width, "sharpness": 1.0})
    found = rss.simulate(model, (time, 3000.0 * np.sin(2.5 * time)[None]), [brake]).outputs
    assert np.abs(found[0] - true[0]).max() < 1e-2 * np.abs(true[0]).max()
    with pytest.raises(rss.InputError, match=r"sets in so abruptly that \S+ steps are needed.*a larger width"):
        rss.simulate(model, (time, found[:1]), [(*brake[:2], {**brake[2], "width": 1e-8})])


@pytest.mark.parametrize("effect, dof, said", [
    ("relative_damping", "a__Heave,a__Heave", "two different ones are needed"),
    ("relative_damping", "a__Heave,a__Pitch", "are different motions"),
    ("relative_damping", "a__Heave", "dof = 'a__Heave,b__Heave'"),
    ("coupling_stiffness", "b__Heave,b__Heave", "two different ones are needed")])
def test_a_pair_of_motions_that_is_none_is_said(effect, dof, said):
    (name,) = [k for k, p in rss.effects.effect_named(effect).parameters.items() if p.strength]
    with pytest.raises(rss.InputError, match=said):
        rss.effects.activate([(effect, dof, {name: 1.0})], ("a__Heave", "b__Heave", "a__Pitch"))
