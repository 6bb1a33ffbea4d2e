"""Effects: definitions, motions against an independent integrator, derivatives against differences."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model
from scipy.integrate import solve_ivp

from radiation_ss import Record, simulate
from radiation_ss.effects import (
    Active,
    Effect,
    Parameter,
    activate,
    library,
    named,
    numeric,
    register_effect,
)
from radiation_ss.errors import InputError
from radiation_ss.simulation import Motion, MotionEquations, interpolate, prepare, run_in_steps, step_size

NAMES = """quadratic_drag linear_damping coulomb_friction linear_stiffness cubic_stiffness quadratic_stiffness
slack_mooring parametric_stiffness added_inertia coupling_inertia radiation_damping constant_force slow_drift
tank_resonance hysteresis excitation_gain excitation_delay sensor_delay sensor_gain sensor_bias clock_drift cross_axis
actuator_saturation""".split()
TIME = np.arange(0.0, 12.0, 0.05)
FORCE = 8.0 * np.cos(6.0 * TIME) + 3.0 * np.sin(9.0 * TIME)


def reference(force, inertia=0.0):
    """Integrate the tank with an extra force(t, x, v, u) by a stiff library integrator."""
    model = tank_model()
    total = (model.M + model.A_inf)[0, 0] + inertia

    def rate(t, s):
        memory, x, v = s[:3], s[3], s[4]
        u = 8.0 * np.cos(6.0 * t) + 3.0 * np.sin(9.0 * t)
        a = (u - (model.fit.c @ memory)[0] - model.C[0, 0] * x + force(t, x, v, u)) / total
        return np.concatenate([model.fit.a @ memory + model.fit.b[:, 0] * v, [v, a]])

    return solve_ivp(rate, (0.0, TIME[-1]), np.zeros(5), t_eval=TIME, method="LSODA", rtol=1e-9, atol=1e-12).y[3]


def test_library_has_every_name():
    assert set(NAMES) <= set(library())


@pytest.mark.parametrize("effect, force, inertia", [
    (("quadratic_drag", {"coefficient": 150.0}), lambda t, x, v, u: -150.0 * abs(v) * v, 0.0),
    (("coulomb_friction", {"force": 0.6, "width": 0.02}), lambda t, x, v, u: -0.6 * v / np.hypot(v, 0.02), 0.0),
    (("coulomb_friction", {"force": 2.0, "width": 0.004, "sharpness": 50.0}),
     lambda t, x, v, u: -2.0 * np.clip(v / 0.004, -1.0, 1.0), 0.0),
    (("linear_damping", {"coefficient": 8.0}), lambda t, x, v, u: -8.0 * v, 0.0),
    (("cubic_stiffness", {"stiffness": 2e5}), lambda t, x, v, u: -2e5 * x**3, 0.0),
    (("added_inertia", {"inertia": 1.5}), lambda t, x, v, u: 0.0, 1.5),
    (("excitation_gain", {"gain": 0.2}), lambda t, x, v, u: 0.2 * u, 0.0),
    (("actuator_saturation", {"share": 0.8, "limit": 6.0, "width": 0.5}),
     lambda t, x, v, u: -0.4 * (2 * u + np.hypot(u - 6.0, 0.5) - np.hypot(u + 6.0, 0.5)), 0.0),
])
def test_motion_agrees_with_an_independent_integrator(effect, force, inertia):
    motion = simulate(tank_model(), (TIME, FORCE), [effect]).outputs[0]
    expected = reference(force, inertia)
    assert np.abs(motion - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("sharpness, loading", [(0.0, lambda x: 1.0 - np.exp(-x)), (1.0, np.tanh),
                                                (400.0, lambda x: np.minimum(x, 1.0))])
def test_hysteresis_loads_and_unloads_as_bouc_wen_has_it(sharpness, loading):
    """In closed form: 1 - e^-x and tanh x for exponents 1 and 2, elastic-plastic in the limit; unloading is elastic."""
    effect, reach, step = library()["hysteresis"], 0.01, 1e-5
    p = SimpleNamespace(force=1.0, reach=reach, sharpness=sharpness)

    def moved(z, v, count):
        path = [z]
        for _ in range(count):  # the rule is rate-independent: any speed will do
            half = z + 0.5 * step * float(effect.rates(SimpleNamespace(v=v, z=[z]), p)[0])
            z += step * float(effect.rates(SimpleNamespace(v=v, z=[half]), p)[0])
            path.append(z)
        return np.array(path)

    up = moved(0.0, 1.0, 2500)
    # An exponent n is within 1/n of its limit.
    assert np.abs(up - loading(np.arange(2501) * step / reach)).max() < (1e-3 if sharpness < 2.0 else 1.5 / sharpness)
    back = moved(up[-1], -1.0, 400)
    assert back == pytest.approx(up[-1] - np.arange(401) * step / reach, abs=2e-3)


def test_hysteresis_stays_bounded_in_steps_too_coarse_for_it():
    effect, rng = library()["hysteresis"], np.random.default_rng(0)
    p, z = SimpleNamespace(force=1.0, reach=0.01, sharpness=8.0), 0.0
    for v in rng.normal(0.0, 1.0, 2000):  # 0.01 s moves the body by its whole reach
        z += 0.01 * float(effect.rates(SimpleNamespace(v=v, z=[z]), p)[0])
        assert abs(z) < 1.0 + 5.0


def test_sensors_change_the_reading_and_not_the_motion():
    model = tank_model()
    plain = simulate(model, (TIME, FORCE)).outputs[0]
    read = simulate(model, (TIME, FORCE), [("sensor_gain", {"gain": 0.1}), ("sensor_bias", {"bias": 0.01})]).outputs[0]
    assert np.allclose(read, 1.1 * plain + 0.01, atol=1e-12)
    late = simulate(model, (TIME, FORCE), [("sensor_delay", {"delay": 0.1})]).outputs[0]
    assert np.abs(late[2:] - plain[:-2]).max() < 1e-12  # 0.1 s is two samples


def test_a_reciprocal_coupling_keeps_energy_balance():
    """The coupling inertia is a symmetric part of the mass matrix: the same motion as with M changed."""
    model = coupled_model()
    time = np.arange(0.0, 40.0, 0.2)
    force = np.stack([1e5 * np.cos(0.8 * time), 5e4 * np.sin(0.6 * time)])
    extra = np.array([[0.0, 2e5], [2e5, 0.0]])
    expected = np.asarray(simulate(model.replace(M=model.M + extra), (time, force)).outputs)
    found = simulate(model, (time, force), [("coupling_inertia", "Sway,Roll", {"inertia": 2e5})]).outputs
    assert np.abs(np.asarray(found) - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("rigid", [0.0, 0.7, 1.0])
def test_a_tank_is_a_mass_on_a_spring_of_which_the_model_may_hold_a_share(rigid):
    model, mass, w, ratio = tank_model(), 1.2, 6.5, 0.03
    total = (model.M + model.A_inf)[0, 0] - rigid * mass

    def rate(t, s):
        memory, x, v, y, u = s[:3], s[3], s[4], s[5], s[6]
        pull = mass * (w**2 * (y - x) + 2.0 * ratio * w * (u - v))
        drive = 8.0 * np.cos(6.0 * t) + 3.0 * np.sin(9.0 * t)
        a = (drive - (model.fit.c @ memory)[0] - model.C[0, 0] * x + pull) / total
        return np.concatenate([model.fit.a @ memory + model.fit.b[:, 0] * v, [v, a, u, -pull / mass]])

    expected = solve_ivp(rate, (0.0, TIME[-1]), np.zeros(7), t_eval=TIME, method="LSODA", rtol=1e-9, atol=1e-12).y[3]
    tank = {"coupling": mass, "frequency": w, "damping_ratio": ratio, "rigid": rigid}
    found = simulate(model, (TIME, FORCE), [("tank_resonance", tank)]).outputs[0]
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()


def test_radiation_of_all_motions_is_scaled_by_one_share():
    model = coupled_model()
    time = np.arange(0.0, 40.0, 0.2)
    force = np.stack([1e5 * np.cos(0.8 * time), 5e4 * np.sin(0.6 * time)])
    expected = np.asarray(simulate(model.replace(fit=replace(model.fit, c=1.3 * model.fit.c)), (time, force)).outputs)
    found = simulate(model, (time, force), [("radiation_damping", {"share": 0.3})]).outputs
    assert np.abs(np.asarray(found) - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("longer", [0.0, 0.5, -0.3, -0.9])
def test_a_memory_of_another_length_is_the_kernel_stretched(longer):
    """K(t / (1 + longer)) is the model's own realisation with its states' rates divided by 1 + longer."""
    model = coupled_model()
    time = np.arange(0.0, 40.0, 0.2)
    force = np.stack([1e5 * np.cos(0.8 * time), 5e4 * np.sin(0.6 * time)])
    other = model.fit.replace(a=model.fit.a / (1.0 + longer))
    expected = np.asarray(simulate(model.replace(fit=other), (time, force)).outputs)
    slower = [("radiation_damping", {"slower": 1.0, "longer": longer})]
    found = np.asarray(simulate(model, (time, force), slower).outputs)
    assert np.abs(found - expected)[:4].max() < 2e-3 * np.abs(expected[:4]).max()


def test_a_gain_is_that_of_the_displacement_of_every_sensor_or_of_every_other_one():
    model, gain = tank_model(), {"gain": 0.25}
    plain = np.asarray(simulate(model, (TIME, FORCE)).outputs)
    for every, factors in ((1.0, (1.25, 1.25, 1.25)), (0.0, (1.25, 1.0, 1.0)), (-1.0, (1.0, 1.25, 1.25))):
        found = np.asarray(simulate(model, (TIME, FORCE), [("sensor_gain", {**gain, "all_sensors": every})]).outputs)
        np.testing.assert_allclose(found, np.array(factors)[:, None] * plain, atol=1e-9 * np.abs(plain).max())


def test_own_effect_in_a_few_lines():
    effect = Effect("cubic_drag_of_a_test", {"coefficient": Parameter("F/(X/s)^3", sign=1)},
                    force=lambda s, p: -p.coefficient * s.v**3)
    register_effect(effect, replace=True)
    try:
        motion = simulate(tank_model(), (TIME, FORCE), [("cubic_drag_of_a_test", {"coefficient": 500.0})]).outputs[0]
        expected = reference(lambda t, x, v, u: -500.0 * v**3)
        assert np.abs(motion - expected).max() < 2e-3 * np.abs(expected).max()
        with pytest.raises(InputError, match="exists"):
            register_effect(effect)
    finally:
        from radiation_ss.effects import shelf

        del shelf()["cubic_drag_of_a_test"]


def test_bad_effects_are_refused_with_a_clear_word():
    with pytest.raises(InputError, match="is unknown; the library has"):
        activate([("no_such_effect", {})], ["Heave"])
    for near, meant in (("drag", "quadratic_drag"), ("quadratic_dragg", "quadratic_drag"),
                        ("mooring", "mooring_lines")):
        with pytest.raises(InputError, match=f"{near}.* is unknown; nearest are .*{meant}"):
            activate([(near, {})], ["Heave"])
    with pytest.raises(InputError, match="no parameter 'c'"):
        activate([("quadratic_drag", {"c": 1.0})], ["Heave"])
    with pytest.raises(InputError, match="not among"):
        activate([("quadratic_drag", "Roll", {"coefficient": 1.0})], ["Heave"])
    for wrong in (3, ["quadratic_drag"], {"quadratic_drag": {"coefficient": 1.0}}):
        with pytest.raises(InputError, match=r"effects: .*write"):
            activate(wrong, ["Heave"])
    with pytest.raises(InputError, match=r"no number with width = sharpness = 0.*give width \[X/s\]"):
        activate(("coulomb_friction", {"force": 1.0}), ["Heave"])        # F v / sqrt(v^2 + width^2) at rest is 0 / 0
    with pytest.raises(InputError, match="longer -1 found, more than -1 needed"):
        simulate(coupled_model(), (TIME, np.zeros((2, TIME.size))),
                 [("radiation_damping", {"share": 0.1, "longer": -1.0})])
    assert activate(None, ["Heave"]) == () == activate([], ["Heave"])


def test_a_saturated_force_stays_at_its_limit():
    """Of a force swept slowly past its limit all beyond is lost: the body stands where the limit holds it."""
    model, time = tank_model(), np.arange(0.0, 40.0, 0.05)
    force = 10.0 * np.minimum(time / 20.0, 1.0)
    effect = ("actuator_saturation", {"share": 1.0, "limit": 6.0, "width": 0.01})
    motion = simulate(model, (time, force[None]), [effect]).outputs[0]
    assert motion[-1] == pytest.approx(6.0 / model.C[0, 0], rel=2e-3)


@pytest.mark.parametrize("x0", [-0.05, 0.02, 0.08])
@pytest.mark.parametrize("reach", [0.002, 0.0005])
def test_a_start_is_fitted_through_dry_friction_and_stiff_hysteresis(x0, reach):
    """Slopes at rest say nothing of a released body there; the fit of the start has to come back to the truth."""
    model = tank_model()
    effects = [("hysteresis", {"force": 4.0, "reach": reach}), ("coulomb_friction", {"force": 2.0, "width": 0.002})]
    still = np.zeros((1, TIME.size))
    true = np.asarray(simulate(model, (TIME, still), effects, start=[0.0, 0.0, 0.0, x0, 0.0]).outputs)[0]
    found = simulate(model, Record(TIME, {"Heave": true}, kind="decay", name="release"), effects)
    assert np.abs(np.asarray(found.outputs)[0] - true).max() < 1e-3 * abs(x0)


@pytest.mark.parametrize("name", sorted(name for name, effect in library().items() if effect.force is not None
                                        and effect.scope == "dof" and effect.states == 0))
def test_linear_and_other_force_add_up_to_the_equation_of_motion(name):
    """inertia * a = memory, springs and damping + exciting force + the effect's own expression, written out."""
    model, effect = coupled_model(), library()[name]
    equations = MotionEquations(model, [Active(effect, "Roll", {})])
    m, n = model.fit.states, model.n
    for seed in range(3):
        rng = np.random.default_rng(seed)
        s, force, p = rng.standard_normal(equations.ns), rng.standard_normal(n), 0.1 + rng.random(equations.np)
        driven, t = np.append(force, rng.standard_normal(equations.drives - n)), 0.7
        at = np.stack([driven, 0.0 * driven, 0.0 * driven], axis=1)
        added, rest, linear, _ = (np.asarray(value) for value in equations.core(s, at, t, p))
        a = linear @ s + rest[:, 0]
        passive = -model.fit.c @ s[:m] - model.C @ s[m:m + n] - model.D @ s[m + n:]
        here = SimpleNamespace(x=s[m + 1], v=s[m + n + 1], a=a[1], u=force[1], t=t, memory=(model.fit.c @ s[:m])[1],
                               speed=driven[-1], elevation=driven[n % driven.size], elevation_rate=0.0,
                               envelope=driven[(n + 1) % driven.size], orbital=driven[min(n + 3, driven.size - 1)],
                               below=[driven[min((k + 2) * n + 3, driven.size - 1)] for k in range(3)])
        effects = np.array([0.0, float(numeric(effect.force(here, named(effect, list(p)))))])
        inertia = model.M + model.A_inf
        assert np.allclose(inertia @ a, passive + force + effects, rtol=1e-9, atol=1e-9 * np.abs(passive).max())
        beyond = added @ s + rest[:, 0]
        assert np.allclose(beyond, a - np.linalg.solve(inertia, passive), rtol=1e-9, atol=1e-9 * np.abs(a).max())


def test_no_more_is_lost_than_there_is():
    """A share of 3 beyond a limit is a cut-off, not a force that turns back."""
    limits = {"limit": 6.0, "width": 0.5}
    cut, more = (simulate(tank_model(), (TIME, FORCE), [("actuator_saturation", {"share": share, **limits})]).outputs[0]
                 for share in (1.0, 3.0))
    assert np.abs(more - cut).max() < 0.06 * np.abs(cut).max()


@pytest.mark.parametrize("velocity", [0.0, 0.1])
def test_a_late_sensor_reads_the_motion_before_the_record(velocity):
    """To first order in the delay: a body held before its release stays, one under way comes from where it was."""
    model, delay = tank_model(), 0.02
    begin = np.zeros(model.fit.states + 2)
    begin[-2:] = 0.01, velocity
    late = simulate(model, (TIME, 0.0 * TIME), [("sensor_delay", {"delay": delay})], start=begin).outputs[0]
    assert late[0] == pytest.approx(0.01 - velocity * delay, abs=1e-9)


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 4.0])
def test_a_late_sensor_of_a_body_under_way_reads_where_it_was(phase):
    """A sine before the record: the first cubic goes on; a straight line misses its curvature."""
    omega, grid = 2.0, np.arange(0.0, 6.0, 0.2)
    states = np.stack([np.sin(omega * grid + phase), omega * np.cos(omega * grid + phase)], axis=1)
    still = SimpleNamespace(model=SimpleNamespace(n=1, fit=SimpleNamespace(states=0)))
    early = np.array([-0.15, -0.05, 0.0, 0.33])
    read, slope, _ = interpolate(still, Motion(states), grid, 0, "displacement", early, under_way=True)
    # The remainder w^4 t^2 (t - h)^2 / 24 of the cubic, and its derivative.
    assert np.allclose(read, np.sin(omega * early + phase), atol=2e-3)
    assert np.allclose(slope, omega * np.cos(omega * early + phase), atol=4e-2)
    released, _, _ = interpolate(still, Motion(states), grid, 0, "displacement", early)
    assert np.allclose(released[:2], states[0, 0] + states[0, 1] * early[:2])


def test_a_record_says_whether_its_body_is_under_way():
    model, values = tank_model(), 0.01 * np.sin(4.0 * TIME)
    for kind, under_way in (("decay", False), ("waves", True)):
        record = Record(TIME, {"Heave": values, "Heave_force": 0.0 * TIME}, kind=kind, name=kind)
        (channel,) = prepare(model, record, 0.05).channels
        assert channel.under_way == channel.window(0.0, 1.0).under_way == under_way


def test_a_users_stiff_effect_is_stepped_finely_enough():
    """A damper behind a spring that is much faster than the body is nearly the damper itself."""
    lagged = Effect("lagged_damper", {"coefficient": Parameter("F/(X/s)", 1)}, lambda s, p: -p.coefficient * s.z[0],
                    rates=lambda s, p: [(s.v - s.z[0]) / 0.002], states=1)
    motion = simulate(tank_model(), (TIME, FORCE), [Active(lagged, "Heave", {"coefficient": 8.0})]).outputs[0]
    plain = simulate(tank_model(), (TIME, FORCE), [("linear_damping", {"coefficient": 8.0})]).outputs[0]
    assert np.abs(motion - plain).max() < 0.01 * np.abs(plain).max()


@pytest.mark.parametrize("phase", [0.0, 1.57, 2.5])
@pytest.mark.parametrize("cycles", [0.9, 1.0, 1.1, 1.9, 2.05])
def test_force_faster_than_the_steps_does_not_come_back_as_a_slow_one(cycles, phase):
    """Vibration of one cycle a step, taken at ends and middles only, would be a steady force."""
    model = tank_model()
    model = model.replace(C=model.C / 500.0)
    time = np.arange(0.0, 60.0, 0.002)
    smooth = 2.0 * np.cos(1.5 * time)

    def moved(force, step):
        record = Record(time, {"Heave": 0.0 * time, "Heave_force": force}, name="soft")
        start = np.zeros(model.fit.states + 2)
        return run_in_steps(model, record, (), start, step, True)[2].state[:, model.fit.states]

    h = step_size(model, [Record(time, {"Heave": 0.0 * time, "Heave_force": smooth}, name="soft")])
    shaken = smooth + 0.25 * np.cos(2.0 * np.pi * cycles / h * time + phase)  # 0.8 % of the variance
    found, expected = moved(shaken, h), moved(shaken, h / 32)[::32]
    count = min(found.size, expected.size)
    assert np.abs(found[:count] - expected[:count]).max() < 0.02 * np.abs(expected).max()
