"""The descents that find where IPOPT starts: exact derivatives, passive models, and what random starts reach."""

import numpy as np
import pytest
from fit_systems import data_of, random_passive
from numpy.testing import assert_allclose

from radiation_ss.fit import Descent, block_problem, certify, fit_single, observer_form


def problem_of(zero, seed=11, states=6):
    data = data_of(*random_passive(states, 1, seed, zero=zero == "zero"), omega=np.linspace(0.05, 6.0, 120))
    return block_problem(data, [0], at_zero=zero)


@pytest.mark.parametrize("zero", ["zero", "free"])
@pytest.mark.parametrize("passive", [True, False])
@pytest.mark.parametrize("order", [2, 3, 6])
def test_gradient_and_hessian_are_those_of_the_cost(order, passive, zero):
    problem, rng = problem_of(zero), np.random.default_rng(order)
    descent = Descent.of(problem, order, np.full(order, 1e-3), np.full(order, 20.0), passive)
    v = rng.normal(size=(4, 2 * order - problem.zero))
    along = rng.normal(size=v.shape)
    _, g, H = descent.expand(v)
    h = 1e-5
    ahead, behind = (descent.expand(v + sign * h * along) for sign in (1.0, -1.0))
    # Central differences: truncation h^2, round-off 1e-16 / h, times the spread of the polynomials' coefficients.
    slope = (ahead[0] - behind[0]) / (4.0 * h)
    assert_allclose(slope, np.sum(g * along, axis=1), rtol=1e-5, atol=1e-7 * np.abs(g).max())
    curve = (H @ along[:, :, None])[:, :, 0]
    assert_allclose((ahead[1] - behind[1]) / (2.0 * h), curve, rtol=1e-5, atol=1e-7 * np.abs(curve).max())


@pytest.mark.parametrize("seed", range(3))
def test_every_point_of_a_descent_is_passive_and_no_step_goes_up(seed):
    problem, rng = problem_of("zero", seed), np.random.default_rng(seed)
    descent = Descent.of(problem, 4, np.full(4, 1e-2), np.full(4, 20.0), True)
    v = rng.normal(size=(5, 7))
    costs = [descent.expand(v)[0]]
    for _ in range(3):
        v, cost = descent.descend(v, 8)
        costs.append(cost)
        for one in v:
            certificate = certify(*observer_form(*descent.polynomials(one)))
            assert certificate.stable and certificate.passive
    assert (np.diff(costs, axis=0) <= 0.0).all() and (costs[-1] < costs[0]).all()


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_random_start_with_those_grown_from_smaller_orders_reaches_the_best(seed):
    problem, rng = problem_of("zero", seed), np.random.default_rng(seed)
    costs = []
    for _ in range(20):
        w, zeta = problem.x[-1] * np.exp(rng.uniform(np.log(0.05), 0.0, 2)), rng.uniform(0.1, 1.0, 2)
        den = np.convolve([1.0, 2 * zeta[0] * w[0], w[0] ** 2], [1.0, 2 * zeta[1] * w[1], w[1] ** 2])
        costs.append(fit_single(problem, 4, starts=[den[:0:-1]]).cost)
    best = min(min(costs), fit_single(problem, 4).cost)
    assert np.mean(np.array(costs) <= 1.02 * best) >= 0.95
