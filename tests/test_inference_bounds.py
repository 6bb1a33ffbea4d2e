"""Steps of a fit that meet physical bounds, against SciPy's bounded least squares."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from radiation_ss.inference import bounded_step


@given(st.integers(0, 10**6), st.integers(2, 6), st.floats(-2.0, 2.0))
def test_one_bound_is_met_where_the_quadratic_is_lowest(seed, size, bound):
    rng = np.random.default_rng(seed)
    root, target, q = rng.normal(size=(size + 3, size)), rng.normal(size=size + 3), rng.normal(size=size)
    q[0] = max(q[0], bound)
    lower = np.r_[bound, np.full(size - 1, -np.inf)]
    found = bounded_step(root.T @ root, root.T @ (target - root @ q), q, lambda p: np.maximum(p, lower))
    best = lsq_linear(root, target, (lower, np.inf), tol=1e-14).x
    np.testing.assert_allclose(root @ found, root @ best, atol=1e-6 * np.linalg.norm(target))


def test_what_rests_on_its_bound_does_not_keep_the_others_from_moving():
    """Clipped after the step, the second number would leave the valley and the cost would rise."""
    valley = np.array([[1.0, 0.999], [0.999, 1.0]])
    q, lowest = np.array([0.0, 1.0]), np.array([-50.0, 50.5])
    found = bounded_step(valley, valley @ (lowest - q), q, lambda p: np.maximum(p, 0.0))
    cost = [(p - lowest) @ valley @ (p - lowest) for p in (found, q, np.maximum(lowest, 0.0))]
    assert cost[0] < cost[1] < cost[2] and found[0] == 0.0
