"""Shares of a budget: exact laws of Shapley's division."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radiation_ss.diagnosis import Error, Row, alternatives, budget, shapley

TIME = np.arange(0.0, 40.0, 0.1)


@given(st.integers(1, 7), st.integers(0, 10**6))
@settings(max_examples=30)
def test_shares_add_up_to_what_all_causes_together_take_away(count, seed):
    values: dict[frozenset[int], float] = {}
    rng = np.random.default_rng(seed)

    def value(parts):
        return np.array([values.setdefault(parts, float(rng.random()))])

    shares = shapley(count, value)
    assert shares.sum() == pytest.approx(float(value(frozenset())[0] - value(frozenset(range(count)))[0]))


@given(st.integers(0, 10**6))
@settings(max_examples=10)
def test_a_cause_that_changes_nothing_has_no_share_and_alike_ones_have_the_same(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.random(2)

    def value(parts):
        return np.array([10.0 - a * ((0 in parts) + (1 in parts)) - b * ((0 in parts) and (1 in parts))])

    shares = shapley(3, value)[:, 0]
    assert shares[2] == pytest.approx(0.0) and shares[0] == pytest.approx(shares[1])


@pytest.mark.parametrize("seed", range(3))
def test_budget_of_known_parts(seed):
    rng = np.random.default_rng(seed)
    drag, bias = np.sin(1.3 * TIME), 0.5
    noise = 0.1 * rng.standard_normal(TIME.size)
    measured = 10.0 * np.cos(TIME)

    def predict(parts):
        return [Error("unseen", 0, "displacement", TIME, measured, (0 not in parts) * drag + bias + noise)]

    row = Row("quadratic_drag", "Heave", 0.0, (0.0, 0.0), 0.9)
    found = budget([row], predict, np.full((1, 2), 0.1), ["Heave"], 5.0, rng)
    shares = {row.cause: row.share for row in found.rows}
    assert sum(shares.values()) == pytest.approx(1.0)
    energy = {"quadratic_drag": np.mean(drag**2), "offset": bias**2, "noise": 0.01}
    total = np.mean((drag + bias + noise) ** 2)
    for cause, size in energy.items():  # cross terms of sin, noise and offset are of the order 1/sqrt(400)
        assert shares[cause] == pytest.approx(size / total, abs=0.1)
    assert abs(shares["unexplained"]) < 0.02
    assert found.before == pytest.approx(np.sqrt(total / np.mean(measured**2)))


@pytest.mark.parametrize("taken, worse", [(0.5, False), (0.0, False), (-0.1, True)])
def test_effects_that_surely_add_to_the_gap_are_told(taken, worse):
    gap = np.sin(1.3 * TIME)

    def predict(parts):
        return [Error("unseen", 0, "displacement", TIME, np.cos(TIME), gap * (1.0 - taken * (0 in parts)))]

    row = Row("linear_damping", "Surge", 0.0, (0.0, 0.0), 0.9)
    assert budget([row], predict, np.zeros((1, 2)), ["Surge"], 5.0, np.random.default_rng(0)).worse is worse


def test_what_two_effects_make_against_each_other():
    """One takes twice the gap away and the other gives it back once: energies 1, 1, 4 and 0, so shares 2 and -1."""
    gap = np.sin(1.3 * TIME)

    def predict(parts):
        return [Error("unseen", 0, "displacement", TIME, np.cos(TIME), gap * (1.0 - 2.0 * (0 in parts) + (1 in parts)))]

    rows = [Row(name, "Roll", 0.0, (0.0, 0.0), 0.9) for name in ("viscous_memory", "delayed_feedback")]
    found = budget(rows, predict, np.zeros((1, 2)), ["Roll"], 5.0, np.random.default_rng(0))
    assert [row.share for row in found.rows[:2]] == pytest.approx([2.0, -1.0])
    assert found.against == pytest.approx(1.0)
    alone = budget(rows[:1], predict, np.zeros((1, 2)), ["Roll"], 5.0, np.random.default_rng(0))
    assert alone.against == 0.0
    curve = budget([replace(row, law="damping") for row in rows], predict, np.zeros((1, 2)), ["Roll"], 5.0,
                   np.random.default_rng(0))
    assert curve.against == 0.0     # terms of one curve


def test_what_all_sets_have_is_said_once():
    sets = (("coulomb_friction", "slack_mooring"), ("coulomb_friction",), ("constant_force", "coulomb_friction"))
    assert alternatives(sets) == ("coulomb_friction in every set that may hold; these records do not tell apart what "
                                  "goes with it: slack_mooring or nothing more or constant_force")
    assert alternatives((("drag",), ())) == "These records do not tell apart: drag or recalibration alone"
