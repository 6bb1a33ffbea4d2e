"""Pairs along the measured motion: states and forces against closed forms, the weighing against least squares."""

from itertools import combinations

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from scipy.integrate import solve_ivp

from radiation_ss.effects import effect_named
from radiation_ss.effects.definition import Active
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.posterior.fitting import residual_energy
from radiation_ss.gap.posterior.measured import Measured, measured, path_along, radiation_along, states_along
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import Term, setting_of, terms_of
from radiation_ss.gap.tolerance.null_fit import tolerant
from radiation_ss.gap.which.along import beginnings, pairs_along, refined, weighed
from radiation_ss.gap.which.scan import MANY

STRONG = {"quadratic_drag": {"coefficient": 400.0}, "cubic_stiffness": {"stiffness": 2.5e5},
          "hysteresis": {"force": 1.2, "reach": 0.004, "sharpness": 5.0}}


def strong_case(names, seed, **more):
    model, records = tank_case([(name, STRONG[name]) for name in names], seed=seed, duration=20.0, **more)
    return setting_of(model, records, tolerances(0.02))


def harmonic(omega, amplitude=0.01):
    time = np.arange(0.0, 12.0, 0.005)
    x = amplitude * np.sin(omega * time)[:, None]
    v = amplitude * omega * np.cos(omega * time)[:, None]
    return Measured(time, x, v, -(omega**2) * x, np.zeros((time.size, 0)))


def test_radiation_states_along_a_steady_speed_are_the_static_ones():
    model = tank_model()
    states = radiation_along(model, np.ones((4000, 1)), 0.02)
    assert states[-1] == pytest.approx(-np.linalg.solve(model.fit.a, model.fit.b)[:, 0], rel=1e-6)


@pytest.mark.parametrize("omega", [4.0, 7.0])
def test_own_states_along_a_motion_are_those_of_their_equation(omega):
    motion, tank, hysteresis = harmonic(omega), effect_named("tank_resonance"), effect_named("hysteresis")
    shapes = [{"frequency": w, "damping_ratio": 0.05} for w in (5.0, 6.5)]
    terms = [Term(Active(tank, "Heave", values), (1.0, 1.0, 1.0)) for values in shapes]
    for values, states in zip(shapes, states_along(terms, motion, 0)):
        w, zeta = values["frequency"], values["damping_ratio"]
        exact = solve_ivp(lambda t, z, w=w, zeta=zeta: [z[1], -w**2 * z[0] - 2 * zeta * w * z[1]
                                                      + 0.01 * omega**2 * np.sin(omega * t)],
                          (0.0, 11.99), [0.0, 0.0], t_eval=motion.time[::2], rtol=1e-9, atol=1e-12).y
        assert np.abs(states.T - exact).max() < 1e-5 * np.abs(exact).max()
    # Bouc and Wen's rule of exponent 1 is followed in closed form up to the first turn.
    (states,) = states_along([Term(Active(hysteresis, "Heave", {"reach": 0.004}), (1.0, 1.0, 1.0))], motion, 0)
    loading = motion.time[::2] < 0.5 * np.pi / omega
    assert states[loading, 0] == pytest.approx(1.0 - np.exp(-motion.x[::2][loading, 0] / 0.004), abs=1e-3)


def test_the_model_moves_along_the_measured_path_as_it_is_measured():
    """Where nothing is missing, the derivatives along the measured motion are those along the model's own."""
    model, records = tank_case([], seed=3, noise=0.0, tolerance=0.0, kinds=("waves", "waves"), duration=20.0)
    setting = setting_of(model, records, tolerances(0.02))
    problem = Problem(setting)
    zero = np.zeros(problem.size)
    along = [path_along(model, measured(setting, r)) for r in range(2)]
    for own, read in zip(problem.at(zero).slopes, problem.at(zero, paths=along).slopes):
        size = np.linalg.norm(own, axis=0)
        keep = size > 0.0
        assert np.all(np.linalg.norm(own - read, axis=0)[keep] < 0.05 * size[keep])


def test_without_a_displacement_there_is_no_measured_path():
    model, records = tank_case([], seed=3, kinds=("waves",), duration=10.0)
    record = records[0]
    channels = {"Heave_force": record.channels["Heave_force"], "Heave_acceleration": record.channels["Heave"]}
    other = type(record)(record.time, channels, kind="waves", name="accelerations")
    setting = setting_of(model, [other], tolerances(0.02))
    assert measured(setting, 0) is None
    assert beginnings(setting, terms_of(setting), (1e-3,)) == []


@pytest.mark.parametrize("seed", range(3))
def test_every_pair_is_weighed_as_by_least_squares(seed):
    rng = np.random.default_rng(seed)
    J, C, r = rng.standard_normal((60, 3)), rng.standard_normal((60, 4, 2)), 5.0 * rng.standard_normal(60)
    names = ["cubic_stiffness", "parametric_stiffness", "quadratic_stiffness", "parametric_stiffness"]
    terms = [Term(Active(effect_named(name), "Heave", {"frequency": float(k)} if name.startswith("par") else {}),
                  (1.0,) * len(effect_named(name).parameters)) for k, name in enumerate(names)]
    C[:, [0, 2], 1] = 0.0  # one strength

    def gain(columns):
        table = np.concatenate([columns, np.eye(columns.shape[1])])
        right = np.concatenate([r, np.zeros(columns.shape[1])])
        return -0.5 * float(np.sum((right - table @ np.linalg.lstsq(table, right, rcond=None)[0]) ** 2))

    expected: dict = {}
    for i, j in combinations(range(4), 2):
        if terms[i].key != terms[j].key:
            pair = frozenset((terms[i].key, terms[j].key))
            value = gain(np.concatenate([J, C[:, i], C[:, j]], axis=1)) - gain(J)
            expected[pair] = max(value, expected.get(pair, 0.0))
    found = weighed(terms, r, J, C)
    assert {frozenset(t.key for t in b.terms): b.gain for b in found} == pytest.approx(expected)
    assert [b.gain for b in found] == sorted((b.gain for b in found), reverse=True)
    best = found[0]
    rest = r - J @ best.others - sum(C[:, terms.index(t), : s.size] @ s for t, s in zip(best.terms, best.strengths))
    assert J.T @ rest == pytest.approx(best.others, abs=1e-9)  # the least-squares optimum of J, too


def test_a_single_shape_is_surrounded_and_many_are_made_denser():
    assert refined([2.0]) == pytest.approx([1.2, 6.0])
    assert refined([1.0, 4.0]) == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    many = [float(k) for k in range(MANY + 1)]
    assert refined(many) == pytest.approx(np.arange(-0.5, MANY + 0.75, 0.5).tolist())


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("names", [("quadratic_drag", "cubic_stiffness"), ("cubic_stiffness", "hysteresis")])
def test_the_hidden_pair_is_the_best_along_the_motion_however_far_the_null_is(names, seed):
    setting = strong_case(names, seed)
    terms = terms_of(setting)
    null, floors = tolerant(setting)
    best = beginnings(null.problem.setting, terms, floors)[0]
    assert {t.active.name for t in best.terms} == set(names)
    fit = min(pairs_along(null, terms, floors, [null]), key=residual_energy)
    for active in fit.problem.actives(fit.q)[len(null.problem.setting.nominal):]:
        ((name, size), *_) = STRONG[active.name].items()
        # Numbers of the model are off by 2 % each; a stiffness beside a cube of the motion shows as either.
        assert active.values[name] == pytest.approx(size, rel=0.15)
