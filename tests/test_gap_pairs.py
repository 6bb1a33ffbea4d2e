"""Which pairs are tried: only gains that can be true, and none below the sensors' noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_cases import tank_case
from hypothesis import given
from hypothesis import strategies as st

from radiation_ss.effects import effect_named
from radiation_ss.effects.definition import Active
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.posterior.fitting import residual_energy
from radiation_ss.gap.posterior.setting import Term, setting_of, shapes_of, terms_of
from radiation_ss.gap.tolerance.null_fit import tolerant
from radiation_ss.gap.which import search
from radiation_ss.gap.which.material import gap_left
from radiation_ss.gap.which.score import score_all, scores
from radiation_ss.gap.which.search import credible, pair_fits, promised_energy, refit_term

EFFECTS = ("quadratic_drag", "cubic_stiffness", "coulomb_friction")


@given(seed=st.integers(0, 2**32 - 1), own=st.integers(1, 5), more=st.integers(1, 4), size=st.floats(-2.0, 3.0))
def test_no_gain_is_more_than_the_cost(seed, own, more, size):
    """Wherever the fit is, converged or not: to first order the cost is half a sum of squares."""
    rng = np.random.default_rng(seed)
    J, C = 10.0**size * rng.standard_normal((40, own)), 10.0**size * rng.standard_normal((40, more))
    r, q = rng.standard_normal(40) + C @ rng.standard_normal(more), 3.0 * rng.standard_normal(own)
    active = Active(effect_named("linear_stiffness"), "Heave", {"stiffness": 0.0})
    terms = [Term(active, (1.0,))] * more
    inverse = np.linalg.inv(J.T @ J + np.eye(own))
    found = score_all(terms, [1] * more, r, J, C, inverse, q)
    cost = 0.5 * float(r @ r + q @ q)
    assert all(item.gain <= cost * (1.0 + 1e-9) for item in found)
    assert max(item.gain for item in found) > 0.0
    # What the two quadratic problems really differ by.
    whole = np.concatenate([np.concatenate([J, C[:, :1]], axis=1), np.eye(own + 1)])
    right = np.concatenate([r, -q, [0.0]])
    costs = [0.5 * float(np.sum((right - m @ np.linalg.lstsq(m, right, rcond=None)[0]) ** 2))
             for m in (whole[:, :own], whole)]
    assert found[0].gain == pytest.approx(costs[0] - costs[1], rel=1e-6, abs=1e-9 * cost)


@pytest.fixture(scope="module")
def roots():
    """Two singles of a tank with drag and a cubic spring, and the terms."""
    model, records = tank_case([("quadratic_drag", {"coefficient": 60.0}), ("cubic_stiffness", {"stiffness": 5e4})],
                               seed=3, kinds=("decay", "waves"), duration=20.0)
    null, floors = tolerant(setting_of(model, records, tolerances(0.02)))
    scales = null.problem.setting.scales["Heave"]
    terms = [term for name in EFFECTS for term in shapes_of(effect_named(name), "Heave", "", scales)]
    listed = {item.term.key: item for item in reversed(scores(null, terms))}
    singles = [refit_term(null, listed[name, "Heave", ""], floors) for name in EFFECTS[:2]]
    return singles, terms, floors


def test_a_promise_is_the_gain_and_ends_at_the_noise(roots):
    (root, _), _, floors = roots
    sizes = np.array([r.size for r in root.point.residuals])
    assert promised_energy(root, 0.0, floors) == pytest.approx(residual_energy(root))
    gains = np.linspace(0.0, 2.0 * root.cost, 50)
    found = np.array([promised_energy(root, gain, floors) for gain in gains])
    assert np.all(np.diff(found) <= 0.0) and found[-1] == found[-2] < found[0]
    # A small gain of log posterior lowers twice the log of the residual's energy by as much.
    assert found[0] - promised_energy(root, 1.0, floors) == pytest.approx(2.0, rel=2.0 / sizes.sum())
    pulls = float(root.q @ root.q)
    assert found[-1] >= float(sizes @ np.log(np.square(floors))) + pulls - 1e-6 * abs(found[-1])


def test_a_root_whose_derivatives_are_rounding_starts_no_pair(roots, monkeypatch):
    """One gain beyond the whole cost gives the root away; the pair is found from the other."""
    (first, second), terms, floors = roots
    module = "radiation_ss.gap.which.search.scores"

    def blown(root, terms):
        found = scores(root, terms)
        return [replace(found[0], gain=1e17), *found[1:]] if root is second else found

    assert credible(second, scores(second, terms)) and not credible(second, [replace(scores(second, terms)[0],
                                                                                     gain=1.01 * second.cost)])
    monkeypatch.setattr(module, blown)
    both = pair_fits([second, first], terms, floors)
    assert both and all(pair.problem.terms[0].key == first.problem.terms[0].key for pair in both)
    best = min(both, key=residual_energy)
    assert {term.key[0] for term in best.problem.terms} == {"quadratic_drag", "cubic_stiffness"}
    assert residual_energy(best) < residual_energy(first) - 100.0


@pytest.mark.parametrize("steps, left, again", [((1, 2), 0.003, True), ((2, 2), 0.003, False), ((3, 2), 0.003, False),
                                                ((1, 2), 0.05, False)])
def test_the_members_of_the_best_pair_get_its_steps(monkeypatch, steps, left, again):
    """A right effect alone must not lose to a pair by the integrator's error; one that leaves much is not right."""
    def fitted(halvings, cost, *keys):
        terms = tuple(SimpleNamespace(key=key) for key in keys)
        problem = SimpleNamespace(terms=terms, setting=SimpleNamespace(halvings=halvings))
        return SimpleNamespace(problem=problem, cost=cost)

    alone, both = steps
    fits = [fitted(0, 90.0), fitted(alone, 20.0, "hysteresis"), fitted(0, 50.0, "drift"),
            fitted(both, 10.0, "hysteresis", "tank")]
    asked = []
    monkeypatch.setattr(search, "information_criterion", lambda one: one.cost)
    monkeypatch.setattr(search, "gap_left", lambda one, floors: left if one is fits[1] else 0.002)
    monkeypatch.setattr(search, "members", lambda together, floors: asked.append(together) or ["alone"])
    assert search.members_as_fine(fits, ()) == (["alone"] if again else [])
    assert asked == ([[fits[3]]] if again else [])
    assert search.members_as_fine(fits[:3], ()) == []


def test_a_cut_off_force_beside_another_cause_is_looked_for_from_a_typical_strength():
    """Where it is cut off the score test has no slope to see, once the first effect's numbers have made up for it."""
    truth = [("cubic_stiffness", {"stiffness": 3e5}), ("actuator_saturation", {"share": 1.0, "limit": 2.0})]
    model, records = tank_case(truth, seed=2, noise=0.005, kinds=("decay", "waves", "waves"))
    null, floors = tolerant(setting_of(model, records, tolerances(0.02)))
    setting = null.problem.setting
    cubic, bent = (terms_of(setting, [effect_named(name)]) for name in ("cubic_stiffness", "actuator_saturation"))
    root = refit_term(null, scores(null, cubic)[0], floors)
    found = search.with_bent_inputs(root, [*cubic, *bent], floors, [root])
    best = min(found, key=residual_energy)
    names = [term.active.name for term in best.problem.terms]
    assert names == ["cubic_stiffness", "actuator_saturation"]
    values = best.problem.actives(best.q)[-1].values
    assert values["limit"] == pytest.approx(2.0, rel=0.05)
    assert gap_left(best, floors) < 0.3 * gap_left(root, floors)
    assert search.with_bent_inputs(root, cubic, floors, [root]) == []
