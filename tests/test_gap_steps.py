"""Steps of integrator and fit: halved where a law turns faster than the body, and never far into a shape unseen."""

from dataclasses import replace

import numpy as np
import pytest
from gap_cases import tank_case

from radiation_ss.effects import effect_named
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.posterior import fitting
from radiation_ss.gap.posterior.fitting import LONG, PATIENCE, STALLED, fit
from radiation_ss.gap.posterior.noise import white
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.gap.posterior.steps import curvature
from radiation_ss.gap.which.refits import HALVINGS, ROUGH, in_fine_steps, step_error


@pytest.fixture(scope="module")
def setting():
    model, records = tank_case([("hysteresis", {"force": 0.8, "reach": 0.004, "sharpness": 6.0})], seed=2,
                               kinds=("decay", "waves"), duration=15.0)
    return setting_of(model, records, tolerances(0.02))


def term(setting, name):
    return next(t for t in terms_of(setting, [effect_named(name)]))


def test_half_the_step_ends_on_the_same_motion_and_keeps_the_readings(setting):
    finer = setting.finer
    assert finer.h == 0.5 * setting.h
    assert finer is setting.finer
    for one, other in zip(setting.records, finer.records):
        assert one.channels is other.channels
        assert other.grid[::2] == pytest.approx(one.grid[: other.grid[::2].size])
    q = np.zeros(Problem(setting).size)
    q[-5:] = 0.5
    coarse, fine = (Problem(s).at(q, slopes=False).residuals for s in (setting, finer))
    # The linear part is stepped exactly: only the force between samples differs.
    for a, b, channel in zip(coarse, fine, (c for item in setting.records for c in item.channels)):
        assert np.abs(a - b).max() < 1e-3 * np.abs(channel.value).max()


@pytest.mark.parametrize("name, halvings", [("quadratic_drag", 0), ("coulomb_friction", 1), ("hysteresis", 2)])
def test_a_law_gets_the_steps_that_it_asks_for(setting, name, halvings):
    fine = setting.fine_enough([term(setting, name), term(setting, "quadratic_drag")])
    assert fine.halvings == halvings
    assert fine.h == setting.h / 2**halvings
    assert fine.fine_enough([term(setting, "quadratic_drag")]) is fine


def test_a_fit_goes_on_in_finer_steps_until_these_change_nothing(setting):
    problem = Problem(setting, (term(setting, "hysteresis"),))
    channels = [c for item in setting.records for c in item.channels]
    floors = tuple(2e-3 * float(np.std(c.value)) for c in channels)
    start = np.zeros(problem.size)
    start[problem.columns(0)[0]] = 1.0
    coarse = fit(problem, white(floors), start, passes=3)
    assert step_error(coarse, floors, setting.finer) > ROUGH
    fine = in_fine_steps(coarse, floors)
    reached = fine.problem.setting
    assert 0 < reached.halvings <= HALVINGS
    assert reached.halvings == HALVINGS or step_error(fine, floors, reached.finer) <= ROUGH
    assert fine.q.size == coarse.q.size


def test_one_step_of_a_fit_leaves_at_least_half_of_a_positive_shape(setting):
    problem = Problem(setting, (term(setting, "coulomb_friction"),))
    rng = np.random.default_rng(0)
    force, width, sharpness = problem.columns(0)
    for _ in range(20):
        q = np.maximum(rng.standard_normal(problem.size), problem.limits())
        lowest = problem.reach(q)
        assert lowest[force] == -np.inf
        before, after = problem.parameters(q), problem.parameters(np.where(np.isfinite(lowest), lowest, q))
        first = int(problem.rollout.offsets[len(setting.nominal)])
        assert after[first + 1:first + 3] == pytest.approx(0.5 * before[first + 1:first + 3])
        assert np.flatnonzero(np.isfinite(lowest)).tolist() == [width, sharpness]


@pytest.mark.parametrize("gain", [0.1 * STALLED, 0.2 * STALLED, 0.5 * STALLED, 20.0 * STALLED])
@pytest.mark.parametrize("patience", [PATIENCE, LONG])
def test_a_fit_creeps_no_longer_than_its_patience(setting, monkeypatch, gain, patience):
    """As many passes that together gain less than what matters end a fit; it counts as converged."""
    def creep(problem, noise, free, here, curve, damping, tolerance):
        return replace(here, cost=here.cost - gain), gain, damping

    monkeypatch.setattr(fitting, "descend", creep)
    problem, costs = Problem(setting), []
    monkeypatch.setattr(fitting, "curvature", lambda *given: costs.append(given[0].cost) or curvature(*given))
    found = fit(problem, white([1.0] * len(setting.slow)), np.zeros(problem.size), passes=12, patience=patience)
    creeps = gain * patience < STALLED
    assert len(costs) - 1 == (patience if creeps else 12)
    assert found.converged == creeps and found.settled == (gain < STALLED)
