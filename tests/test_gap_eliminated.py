"""The discrepancy eliminated from a fit: the same numbers as with its directions among all others."""

from types import SimpleNamespace

import numpy as np
import pytest
from gap_cases import tank_case
from hypothesis import given
from hypothesis import strategies as st

from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.posterior.drift import Drift
from radiation_ss.gap.posterior.eliminated import Eliminated, eliminated
from radiation_ss.gap.posterior.evidence import log_evidence, within_bounds
from radiation_ss.gap.posterior.fitting import refit
from radiation_ss.gap.posterior.noise import Noise, coloured
from radiation_ss.gap.posterior.problem import Point
from radiation_ss.gap.posterior.setting import setting_of
from radiation_ss.gap.posterior.steps import Place, curvature, least_squares, limited_step, placed
from radiation_ss.gap.tolerance.null_fit import tolerant

EPS = np.finfo(float).eps
RANDOM = {"seed": st.integers(0, 2**32 - 1), "count": st.integers(1, 6), "directions": st.integers(0, 5),
          "size": st.floats(-3.0, 4.0), "twin": st.booleans()}


def system(seed, count, directions, size, twin):
    """Random derivatives, directions and residuals of two channels and their coloured noise; with a twin column."""
    rng = np.random.default_rng(seed)
    sizes = (23, 31)
    J = [10.0**size * rng.standard_normal((n, count)) for n in sizes]
    D = [10.0**size * rng.standard_normal((n, directions)) for n in sizes]
    if twin and directions:
        for a, b in zip(J, D):
            a[:, 0] = b[:, 0] * (1.0 + 1e-7 * rng.standard_normal(a.shape[0]))
    for part in (J[0], D[0]):
        part[:, 1::2] = 0.0  # of the other record only
    drift = Drift(*rng.uniform(0.1, 0.9, 3))
    noise = Noise((0.5, 2.0), (np.ones(1), np.array([1.0, -rng.uniform(-0.9, 0.9)])), (drift, None))
    channels = [SimpleNamespace(time=np.zeros(n)) for n in sizes]
    setting = SimpleNamespace(discrepancy=tuple(D), stacked=np.concatenate(D), unnamed=directions,
                              squares=np.stack([d.T @ d for d in D]), records=[SimpleNamespace(channels=channels)])
    problem = SimpleNamespace(setting=setting, rolled=count, size=count + directions)
    point = Point([rng.standard_normal(n) for n in sizes], J)
    return problem, noise, point, rng.standard_normal(count + directions)


def all_columns(problem, noise, point):
    parts = [np.concatenate(pair, axis=1) for pair in zip(point.slopes, problem.setting.discrepancy)]
    return np.concatenate([noise.whiten(k, part) for k, part in enumerate(parts)])


@given(**RANDOM)
def test_elimination_gives_the_step_of_the_whole_system(seed, count, directions, size, twin):
    problem, noise, point, q = system(seed, count, directions, size, twin)
    free = eliminated(problem.setting, noise)
    here = placed(problem, noise, free, q, point)
    J = all_columns(problem, noise, point).astype(np.longdouble)
    r = np.concatenate([noise.whiten(k, part) for k, part in enumerate(point.residuals)])
    table = np.concatenate([J, np.eye(J.shape[1])]).astype(float)
    condition = np.linalg.cond(table)
    whole = np.linalg.lstsq(table, np.concatenate([r, -q]), rcond=None)[0]
    # An undamped step after the elimination ends where that of the whole system does, in every number.
    step = limited_step(here.q, curvature(here, noise, free), np.full(q.size, -np.inf), 0.0)
    moved = Point([res - s @ step for res, s in zip(here.point.residuals, point.slopes)])
    end = placed(problem, noise, free, here.q + np.concatenate([step, np.zeros(directions)]), moved)
    scale = np.linalg.norm(r) + np.linalg.norm(q)
    # The normal equations are taken where their scaled Cholesky factor keeps 1e-5: they lose up to 1e10 EPS.
    assert np.allclose(end.q, q + whole, atol=(1e3 * condition * EPS + 1e11 * EPS) * scale)
    left = np.concatenate([r, -q]) - table @ whole
    assert end.cost == pytest.approx(0.5 * float(left @ left), rel=1e-6)


@given(**RANDOM)
def test_elimination_gives_the_determinant_of_the_whole_system(seed, count, directions, size, twin):
    problem, noise, point, q = system(seed, count, directions, size, twin)
    free = eliminated(problem.setting, noise)
    here = placed(problem, noise, free, q, point)
    J = all_columns(problem, noise, point)
    roots = (curvature(here, noise, free).root, free.root)
    found = 2.0 * sum(np.sum(np.log(np.abs(np.diag(root)))) for root in roots)
    singular = np.linalg.svd(np.concatenate([J, np.eye(J.shape[1])]), compute_uv=False)
    assert found == pytest.approx(2.0 * np.sum(np.log(singular)), abs=1e-4)


def test_the_first_place_has_no_slope_along_the_discrepancy():
    problem, noise, point, q = system(1, 3, 4, 1.0, False)
    here = placed(problem, noise, eliminated(problem.setting, noise), q, point)
    D = all_columns(problem, noise, point)[:, 3:]
    assert np.allclose(D.T @ here.r, here.q[3:], atol=1e4 * EPS * np.abs(D).sum())
    assert np.array_equal(here.q[:3], q[:3])


def test_a_held_parameter_stays_at_its_limit():
    """Two like columns, one of which may not fall: the other takes over what both would."""
    J = np.array([[1.0, 0.9], [0.0, 0.1], [0.5, 0.5]])
    r = J @ np.array([2.0, -3.0])
    place = Place(np.zeros(2), Point([r], [J]), r / 1e-6, 0.0)
    curve = curvature(place, Noise((1e-6,), (np.ones(1),), (None,)), None)
    step = limited_step(place.q, curve, np.array([-np.inf, 0.0]), 0.0)
    assert step[1] == 0.0
    assert step[0] == pytest.approx(J[:, 0] @ r / (J[:, 0] @ J[:, 0]), rel=1e-9)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 8))
def test_damped_steps_solve_their_least_squares(seed, count):
    rng = np.random.default_rng(seed)
    matrix, right = rng.standard_normal((count + 3, count)), rng.standard_normal(count + 3)
    size = 0.1 + rng.random(count)
    table = np.concatenate([matrix, np.diag(size)])
    expected = np.linalg.lstsq(table, np.concatenate([right, np.zeros(count)]), rcond=None)[0]
    bound = 100.0 * EPS * np.linalg.cond(table) ** 2 * np.linalg.norm(right) / size.min()
    assert np.allclose(least_squares(matrix, size, right), expected, atol=bound)


@pytest.fixture(scope="module")
def null():
    model, records = tank_case([], seed=6, kinds=("decay", "waves"), noise=1e-3, duration=20.0)
    found, floors = tolerant(setting_of(model, records, tolerances(0.02)))
    assert found.problem.setting.unnamed
    return found, floors


@pytest.mark.parametrize("colour", [False, True])
def test_a_fit_is_a_maximum_of_the_whole_posterior(null, colour):
    found, floors = null
    if colour:
        found = refit(found, coloured([r + np.roll(r, 1) for r in found.point.residuals], floors))
    r, J = found.whitened()
    curve = J.T @ J + np.eye(found.q.size)
    assert np.allclose(found.covariance @ curve, np.eye(found.q.size), atol=1e-5)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(curve)[1], rel=1e-9)
    gradient = J.T @ r - found.q
    assert found.converged and 0.5 * float(gradient @ found.covariance @ gradient) < 1e-3
    assert found.cost == pytest.approx(0.5 * float(r @ r + found.q @ found.q), rel=1e-12)
    at = found.problem.at(found.q, slopes=False)
    assert all(np.allclose(a, b, atol=1e-9) for a, b in zip(at.residuals, found.point.residuals))
    laplace = -found.cost - 0.5 * np.linalg.slogdet(curve)[1]
    assert log_evidence(found) == pytest.approx(laplace + within_bounds(found), abs=1e-6)


def test_white_noise_needs_no_whitened_copy(null):
    found, _ = null
    free, setting = found.discrepancy, found.problem.setting
    assert isinstance(free, Eliminated) and free.columns is setting.stacked
    slow = np.concatenate([found.noise.whiten(k, part) for k, part in enumerate(setting.discrepancy)])
    r = np.concatenate([found.noise.whiten(k, part) for k, part in enumerate(found.point.residuals)])
    assert np.allclose(free.along(r), slow.T @ r, rtol=1e-9, atol=1e-9)
    assert np.allclose(free.root.T @ free.root, slow.T @ slow + np.eye(setting.unnamed), rtol=1e-9, atol=1e-9)
