"""A tolerance is a bound: the evidence that bounds add against integrals, and what the diagnosis makes of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_bodies import tank_model
from scipy.stats import norm

from radiation_ss.effects.nominal import nominal_effects, tolerances
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.gap.posterior.bounds import EDGE, log_bounded
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate


def log_prior(q, bound):
    """log p(q) of a number that is uniform within its bound, plus a normal error of EDGE."""
    inside = norm.cdf((bound - np.abs(q)) / EDGE) - norm.cdf((-bound - np.abs(q)) / EDGE)
    return np.log(np.maximum(inside, 1e-300)) - np.log(2.0 * bound)


def on_a_grid(mean, covariance, bounds):
    """The same integral by a sum over a fine grid, one or two numbers."""
    deviations = np.sqrt(np.diag(covariance))
    count = 200001 if mean.size == 1 else 1501
    axes = [np.linspace(min(m - 9.0 * s, -b - 9.0 * EDGE), max(m + 9.0 * s, b + 9.0 * EDGE), count)
            for m, s, b in zip(mean, deviations, bounds)]
    q = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    logs = np.sum([log_prior(q[..., k], b) - norm.logpdf(q[..., k]) for k, b in enumerate(bounds)], axis=0)
    away = q - mean
    logs += -0.5 * np.einsum("...i,ij,...j", away, np.linalg.inv(covariance), away)
    logs -= 0.5 * np.linalg.slogdet(2.0 * np.pi * covariance)[1]
    return logs.max() + np.log(np.exp(logs - logs.max()).sum() * np.prod([a[1] - a[0] for a in axes]))


@given(st.floats(-6.0, 6.0), st.floats(0.03, 0.98), st.floats(0.8, 1.5))
def test_of_one_number_it_is_the_integral(mean, variance, bound):
    values = np.array([mean]), np.array([[variance]]), np.array([bound])
    assert log_bounded(*values) == pytest.approx(on_a_grid(*values), abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_of_two_numbers_that_the_records_mix_it_is_the_integral(seed):
    """Expectation propagation is no more than close; a thirtieth of a nat moves no verdict."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((4, 2)) @ np.array([[3.0, -2.5], [0.0, 0.6]])
    covariance = np.linalg.inv(rows.T @ rows + np.eye(2))
    mean = covariance @ rows.T @ (rows @ rng.uniform(-2.5, 2.5, 2) + rng.standard_normal(4))
    bounds = np.array([1.0, 1.4])
    assert log_bounded(mean, covariance, bounds) == pytest.approx(on_a_grid(mean, covariance, bounds), abs=0.03)


def test_what_the_records_say_nothing_of_changes_nothing():
    assert log_bounded(np.zeros(3), np.eye(3), np.ones(3)) == pytest.approx(0.0, abs=1e-6)
    assert log_bounded(np.zeros(0), np.zeros((0, 0)), np.zeros(0)) == 0.0


@pytest.mark.parametrize("variance", [1e-86, 1e-14])
def test_numbers_claimed_to_be_known_beyond_all_reason_are_taken_as_exact(variance):
    """Along a stiff friction derivatives may grow until nothing is left of a variance."""
    mean, bounds = np.array([1.2, -0.2]), np.array([1.2, 1.0])
    exact = sum(log_prior(mean, bounds) - norm.logpdf(mean))
    assert log_bounded(mean, np.diag([variance, 2.0 * variance]), bounds) == pytest.approx(exact, abs=1e-3)


@pytest.mark.parametrize("level", [0.2, 0.05])
def test_numbers_within_their_bounds_seldom_lose(level):
    """A ratio of evidences: below log(level) with a probability of at most the level, whatever is measured."""
    rng, count = np.random.default_rng(0), 1500
    rows = np.array([[2.0, 1.5, 0.0], [0.0, 1.0, -1.0], [6.0, -6.0, 0.5]])
    covariance = np.linalg.inv(rows.T @ rows + np.eye(3))
    q = rng.uniform(-1.0, 1.0, (count, 3)) + EDGE * rng.standard_normal((count, 3))
    means = (q @ rows.T + rng.standard_normal((count, 3))) @ rows @ covariance
    lost = np.mean([log_bounded(mean, covariance, np.ones(3)) < np.log(level) for mean in means])
    assert lost < level + 3.0 * np.sqrt(level / count)


def test_both_parts_of_the_inertia_may_be_at_their_edge():
    model = tank_model()
    found = {own.active.name: own for own in nominal_effects(model, tolerances(0.02), force=True)}
    inertia, share = found["nominal_inertia"], 0.02
    assert inertia.bound * inertia.spread == pytest.approx(share)
    assert found["nominal_stiffness"].bound == found["nominal_force"].bound == 1.0
    assert found["nominal_kernel"].bound == found["nominal_force_phase"].bound == np.inf


def body_off_by(mass, stiffness, seed):
    """The model, and decays and waves of a body whose mass and stiffness are off by so many tolerances of 2 %."""
    model, rng = tank_model(), np.random.default_rng(seed)
    truth = model.replace(M=model.M * (1.0 + 0.02 * mass), C=model.C * (1.0 + 0.02 * stiffness))
    time, records = np.arange(0.0, 25.0, 0.05), []
    for k in range(3):
        start = np.array([0.0, 0.0, 0.0, 0.02 * (k == 0), 0.0])
        omega = np.linspace(4.0, 12.0, 60)
        size = (k > 0) * 0.8 * np.exp(-(((omega - 8.0) / 1.5) ** 2))
        force = size @ np.cos(np.outer(omega, time) + rng.uniform(0.0, 2.0 * np.pi, (60, 1)))
        x = simulate(truth, (time, force[None]), (), start=start).outputs[0]
        x = x + 0.01 * x.std() * rng.standard_normal(time.size)
        records.append(Record(time, {"Heave": x, "Heave_force": force}, kind="waves" if k else "decay", name=f"{k}"))
    return model, records


@pytest.mark.parametrize("seed", range(2))
def test_numbers_at_their_edge_are_no_gap(seed):
    assert diagnose(*body_off_by(-1.0, 1.0, seed), pairs=False).verdict.status == "no_gap"


@pytest.mark.parametrize("seed", range(2))
def test_a_number_far_beyond_its_bound_is_a_gap_although_retuning_closes_it(seed):
    """Inertia and stiffness share the error between them, each within what a normal prior allows."""
    found = diagnose(*body_off_by(0.5, 5.0, seed), pairs=False)
    assert found.how_far.gap_retuned < 1.5 * found.how_far.noise_floor
    names = {found.verdict.effects[0].name} | {name for names in found.verdict.indistinguishable for name in names}
    assert found.verdict.status in ("effect", "ambiguous") and "linear_stiffness" in names
    assert found.verdict.status == "ambiguous" or "Retuning closes it as well" in found.sentence
