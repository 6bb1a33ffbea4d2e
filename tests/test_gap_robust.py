"""Fits that run away or stall: the candidate is dropped or the step shortened, and the diagnosis goes on."""

import numpy as np
import pytest
from gap_cases import tank_case

from radiation_ss.effects import Effect, Parameter, effect_named
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import SolverError
from radiation_ss.gap import diagnose as stage
from radiation_ss.gap.posterior.fitting import attempt, fit
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, shapes_of
from radiation_ss.gap.posterior.steps import Place
from radiation_ss.gap.tolerance.null_fit import null_fit
from radiation_ss.gap.which.score import Score, scores, strength_columns
from radiation_ss.gap.which.search import TYPICAL, at_size, refit_term, search

# Drives the motion ever faster as soon as it is strong: its motion leaves every bound in finite time.
RUNAWAY = Effect("runaway", {"coefficient": Parameter("F/(X/s)^3", sign=1)},
                 force=lambda s, p: p.coefficient * s.v**3, family="damping")


@pytest.fixture(scope="module")
def null():
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=1, kinds=("decay",), duration=15.0)
    return null_fit(setting_of(model, records, tolerances(0.02)))


def runaway(null):
    setting = null.problem.setting
    (term,) = shapes_of(RUNAWAY, "Heave", "", setting.scales["Heave"])
    (score,) = scores(null, [term])
    return Score(term, 1e3, np.array([1e6]), score.columns, score.gradient, score.information, score.slopes,
                 score.follows)


def test_a_candidate_that_runs_away_is_dropped(null, monkeypatch):
    found, floors = null
    item = runaway(found)
    problem = Problem(found.problem.setting, (item.term,))
    q = problem.extend(found.q, found.problem)
    q[strength_columns(problem, 0, item.term)] = 1e6
    with pytest.raises(SolverError, match="without bounds"):
        problem.at(q)
    assert refit_term(found, item, floors) is None
    monkeypatch.setattr("radiation_ss.gap.which.search.scores", lambda root, terms: [runaway(root)])
    result = search(found.problem.setting, [item.term])
    assert [c.key for c in result.candidates] == [()]


def test_a_step_into_the_unbounded_is_shortened(null):
    found, _ = null
    item = runaway(found)
    problem = Problem(found.problem.setting, (item.term,))
    wild = problem.extend(found.q, found.problem)
    wild[strength_columns(problem, 0, item.term)] = 0.05
    here = Place(np.zeros(problem.size), found.point, np.zeros(0), np.inf)
    assert attempt(problem, found.noise, None, here, wild) is None
    wild[strength_columns(problem, 0, item.term)] = 0.0
    assert attempt(problem, found.noise, None, here, wild) is not None


def test_a_fit_that_stalls_is_settled_and_one_cut_short_is_not(null):
    found, _ = null
    problem = found.problem
    short = fit(problem, found.noise, np.zeros(problem.size), passes=1, tolerance=0.0)
    stalled = fit(problem, found.noise, np.zeros(problem.size), passes=60, tolerance=0.0)
    assert not short.settled
    assert stalled.settled and not stalled.converged


def test_effects_that_run_away_on_unseen_data_are_not_handed_on(monkeypatch):
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=2, kinds=("decay", "decay"))
    measure = stage.measure

    def grows(model, held, found, answer, fits, seed):
        if answer.status in stage.NAMED:
            raise SolverError("the motion grows without bounds")
        return measure(model, held, found, answer, fits, seed)

    monkeypatch.setattr(stage, "measure", grows)
    found = stage.diagnose(model, records[:1], ["quadratic_drag"], withhold=records[1:], pairs=False)
    assert found.verdict.status == "unknown_effect" and not found.verdict.effects
    assert not found.corrected.effects
    assert any("grows without bounds on unseen" in note for note in found.notes)


def test_nonlinear_dampings_are_fitted_from_a_typical_strength_too():
    """Only those that the score test has not listed, and no linear one."""
    model, records = tank_case([("coulomb_friction", {"force": 0.6, "width": 0.002})], seed=1,
                               kinds=("decay", "decay"), duration=15.0)
    setting = setting_of(model, records, tolerances(0.02))
    names = ("coulomb_friction", "linear_damping", "radiation_damping")
    terms = [t for name in names for t in shapes_of(effect_named(name), "Heave", "", setting.scales["Heave"])]
    ranked = scores(null_fit(setting)[0], terms)
    (extra,) = at_size(ranked, set())
    assert extra.term.active.name == "coulomb_friction"
    assert extra.strength == pytest.approx(TYPICAL)
    assert at_size(ranked, {extra.term.key}) == []
