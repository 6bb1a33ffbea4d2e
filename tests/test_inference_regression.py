"""The Gaussian regression against SciPy's normal density, finite differences and sampling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, norm

from radiation_ss.inference import Columns, Own, Rows, Sizes, gains, learn, size_slopes, solve


def problem(seed=0, count=60, unknowns=3, change=0.0):
    """Rows in two bins with random columns; `change` makes the impedance depend on the first unknown."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((count, unknowns))
    relative = np.zeros((4, unknowns), complex)
    relative[:, 0] = change * (rng.standard_normal(4) + 1j * rng.standard_normal(4))
    kind = np.arange(count) % 2
    rows = Rows(values @ rng.standard_normal(unknowns) + 0.5 * rng.standard_normal(count), np.full(count, 0.1),
                np.ones(count), np.ones(count), kind, np.zeros(count, int), np.array([0.2, 0.3]), np.array([0.1, 0.1]),
                np.ones(count), np.full(4, 0.5 * count / 4), np.array([[0, 1], [2, 3]]), kind)
    columns = Columns(values, rng.uniform(0.5, 2.0, unknowns), np.full(unknowns, -np.inf),
                      np.equal(np.arange(unknowns), unknowns - 1).astype(int), relative)
    return rows, columns, Sizes(np.log(rows.share), np.log(rows.ambient), np.zeros(1), 0.3)


@pytest.mark.parametrize("seed", range(4))
def test_evidence_is_the_normal_density(seed):
    rows, columns, sizes = problem(seed)
    spread = columns.spread * np.where(columns.factor, np.exp(0.3), 1.0)
    noise = 0.1 + np.array([0.2, 0.3])[rows.group] ** 2 + 0.1**2
    covariance = np.diag(noise) + (columns.values * spread) @ (columns.values * spread).T
    found = solve(rows, columns, sizes)
    assert found.log_evidence == pytest.approx(multivariate_normal(np.zeros(60), covariance).logpdf(rows.error))
    mean = (columns.values * spread**2).T @ np.linalg.solve(covariance, rows.error)
    assert np.allclose(found.mean, mean)


@pytest.mark.parametrize("seed", range(3))
def test_slopes_by_the_sizes_are_those_of_finite_differences(seed):
    rows, columns, sizes = problem(seed)
    (slope, _), x = size_slopes(rows, columns, solve(rows, columns, sizes)), sizes.vector
    for k in range(x.size):
        up, down = (solve(rows, columns, Sizes.of(x + d * (np.arange(x.size) == k), 2)).log_evidence
                    for d in (1e-4, -1e-4))
        assert slope[k] == pytest.approx((up - down) / 2e-4, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_mode_is_where_the_whole_density_is_flat(seed):
    # Jacobian and noise through a changed impedance: the mode found is that of the density written out here.
    rows, columns, sizes = problem(seed, change=0.1)
    found = solve(rows, columns, sizes, iterations=60)

    def density(theta):
        s = 1.0 - columns.relative @ theta
        change = (np.abs(s) ** 2)[rows.fine].mean(axis=1)
        v = 0.1 * change[rows.kind] + np.array([0.2, 0.3])[rows.group] ** 2 + 0.01
        r = rows.error - columns.values @ theta
        spread = columns.spread * np.where(columns.factor, np.exp(0.3), 1.0)
        return (-0.5 * np.sum(np.log(v) + r**2 / v) + np.sum(rows.weight * np.log(np.abs(s)))
                - 0.5 * np.sum((theta / spread) ** 2))

    for k in range(3):
        step = 1e-4 * (np.arange(3) == k)
        slope = (density(found.mean + step) - density(found.mean - step)) / 2e-4
        bend = abs(density(found.mean + step) + density(found.mean - step) - 2 * density(found.mean)) / 1e-8
        assert abs(slope) < 0.02 * np.sqrt(bend)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("off", [-3.0, 0.0, 2.0])
def test_learned_sizes_are_the_likeliest(seed, off):
    """Against SciPy's search without derivatives, from sizes that are far off."""
    rows, columns, sizes = problem(seed)
    found = learn(rows, columns, replace(sizes, share=sizes.share + off, noise=sizes.noise - off))
    best = minimize(lambda x: -learn(rows, columns, Sizes.of(x, 2), steps=0).log_evidence, found.sizes.vector,
                    method="Powell", bounds=[(-9.0, 9.0)] * 5 + [(0.0, 1.09), (-9.0, 0.0), (-9.0, 0.0), (-1.6, 0.0)])
    assert found.log_evidence > -best.fun - 0.1


def test_a_column_that_explains_gains_and_one_that_does_not_loses():
    rng = np.random.default_rng(5)
    rows, columns, sizes = problem(5)
    null = learn(rows, columns, sizes)
    true = Columns(null.residual[:, None] + 0.1 * rng.standard_normal((60, 1)), np.array([1.0]), np.array([-np.inf]),
                   np.array([0]), np.zeros((4, 1), complex))
    idle = Columns(rng.standard_normal((60, 1)), np.array([1.0]), np.array([-np.inf]), np.array([0]),
                   np.zeros((4, 1), complex))
    found = gains(rows, columns, null, [true, idle])
    assert found[0] > 5.0 and found[1] < found[0] - 5.0


def test_the_score_of_a_column_is_the_change_of_evidence():
    rows, columns, sizes = problem(7)
    rng = np.random.default_rng(8)
    new = Columns(rng.standard_normal((60, 1)), np.array([0.2]), np.array([-np.inf]), np.array([0]),
                  np.zeros((4, 1), complex))
    before, after = solve(rows, columns, sizes), solve(rows, columns + new, sizes)
    # Beyond the evidence the score holds the chance of values within four standard deviations, which is next to one.
    assert gains(rows, columns, before, [new])[0] == pytest.approx(after.log_evidence - before.log_evidence, abs=2e-3)


def with_own(seed):
    """Rows of two records that have unknowns of their own, and all their columns side by side."""
    rng = np.random.default_rng(seed)
    rows, columns, sizes = problem(seed)
    parts, own = (slice(0, 25), slice(25, 60)), []
    for part, k in zip(parts, (2, 3)):
        values = rng.standard_normal((part.stop - part.start, k))
        own.append(Own(((part, np.arange(k), values),), rng.uniform(0.3, 2.0, k), 1 * (np.arange(k) == 1)))
    whole = np.zeros((60, 5))
    whole[:25, :2], whole[25:, 2:] = own[0].parts[0][2], own[1].parts[0][2]
    both = columns + Columns(whole, np.concatenate([o.spread for o in own]), np.full(5, -np.inf),
                             np.concatenate([o.factor == 1 for o in own]), np.zeros((4, 5), complex))
    both = replace(both, values=np.asarray(both.values))
    return replace(rows, parts=parts, own=tuple(own)), rows, columns, both, sizes


@pytest.mark.parametrize("seed", range(3))
def test_unknowns_of_one_record_are_marginalised(seed):
    # Against SciPy's density with their columns written out among all the others.
    rows, _, columns, both, sizes = with_own(seed)
    spread = both.spread * np.where(both.factor, np.exp(0.3), 1.0)
    noise = 0.1 + np.array([0.2, 0.3])[rows.group] ** 2 + 0.1**2
    covariance = np.diag(noise) + (both.values * spread) @ (both.values * spread).T
    found = solve(rows, columns, sizes)
    assert found.log_evidence == pytest.approx(multivariate_normal(np.zeros(60), covariance).logpdf(rows.error))
    gain = (both.values * spread**2).T @ np.linalg.inv(covariance)
    assert np.allclose(np.concatenate([found.mean, found.own_mean]), gain @ rows.error)
    left = np.diag(spread**2) - gain @ (both.values * spread**2)
    assert np.allclose(found.covariance, left[:3, :3]) and np.allclose(found.own_std**2, np.diag(left)[3:])


@pytest.mark.parametrize("seed", range(2))
def test_own_unknowns_count_in_slopes_and_gains(seed):
    rows, plain, columns, both, sizes = with_own(seed)
    dense, arrow = solve(plain, both, sizes), solve(rows, columns, sizes)
    assert np.allclose(size_slopes(rows, columns, arrow)[0], size_slopes(plain, both, dense)[0])
    new = Columns(np.random.default_rng(seed).standard_normal((60, 1)), np.array([0.7]), np.array([0.0]),
                  np.array([0]), np.zeros((4, 1), complex))
    assert gains(rows, columns, arrow, [new]) == pytest.approx(gains(plain, both, dense, [new]))


@pytest.mark.parametrize("lower", [-0.6, -0.1, 0.0])
def test_evidence_counts_what_is_above_a_physical_bound(lower):
    """Against the integral of likelihood times prior, cut at the bound, by quadrature."""
    rows, columns, sizes = problem(1, change=0.0)
    at = next(k for k in range(columns.count) if not columns.factor[k])
    one = Columns(columns.values[:, [at]], columns.spread[[at]], np.array([lower]), np.array([0]),
                  np.zeros((4, 1), complex))
    variance = rows.noise + (rows.share[rows.group] ** 2 + rows.ambient[rows.group] ** 2)
    beta = np.linspace(lower, 8.0 * one.spread[0], 20001)
    residual = rows.error[:, None] - one.values * beta
    height = -0.5 * np.sum(np.log(2 * np.pi * variance)[:, None] + residual**2 / variance[:, None], axis=0)
    weight = norm.pdf(beta, 0.0, one.spread[0]) / norm.sf(lower, 0.0, one.spread[0])
    expected = height.max() + np.log(trapezoid(weight * np.exp(height - height.max()), beta))
    learned = learn(rows, one, sizes, steps=0).log_evidence - learn(
        rows, replace(one, lower=np.array([-np.inf])), sizes, steps=0).log_evidence
    free = solve(rows, one, sizes).log_evidence
    assert free + learned == pytest.approx(expected, abs=5e-3)


def written_out(rows, columns, found, new):
    """The score test of one set of columns with everything else eliminated in dense matrices."""
    s, W = 1.0 - columns.relative @ found.mean, rows.power / found.variance
    precision = new.values.T @ (W[:, None] * new.values)
    cross = columns.values.T @ (W[:, None] * new.values)
    precision = precision - cross.T @ found.covariance @ cross
    count, q = rows.fine.shape[1], new.relative / s[:, None]
    change = (np.abs(s) ** 2)[rows.fine].mean(axis=1)
    share = rows.power * found.noise / found.variance
    pull = np.bincount(rows.kind, -0.5 * share * (1.0 - found.residual**2 / found.variance), 2)
    stiff = np.bincount(rows.kind, 0.5 * share * found.noise / found.variance, 2)
    moved = -2.0 * ((np.abs(s) ** 2)[:, None] * q.real)[rows.fine].reshape(2, count, -1).mean(axis=1) / change[:, None]
    score = new.values.T @ (W * found.residual) + pull @ moved - rows.weight @ q.real
    fisher = q.real.T @ (rows.weight[:, None] * q.real) - q.imag.T @ (rows.weight[:, None] * q.imag)
    scale = np.outer(new.spread, new.spread)
    values, vectors = np.linalg.eigh(fisher * scale)
    A = (precision + moved.T @ (stiff[:, None] * moved)) * scale + vectors @ np.diag(np.maximum(values, 0)) @ vectors.T
    b, P = score * new.spread, A + np.eye(new.count)
    mean, deviation = np.linalg.solve(P, b), np.sqrt(np.diag(np.linalg.inv(P)))
    inside = np.where(new.lower == 0.0, norm.logcdf(mean / deviation) + np.log(2.0), 0.0)
    return 0.5 * mean @ b - 0.5 * np.linalg.slogdet(P)[1] + inside.sum()


@pytest.mark.parametrize("seed", range(3))
def test_scores_of_many_sets_at_once_are_those_of_each_written_out(seed):
    rng = np.random.default_rng(100 + seed)
    rows, _, columns, both, sizes = with_own(seed)
    rows = replace(rows, kind=(np.arange(60) >= 25).astype(int))  # each record has bins of its own
    plain = replace(rows, parts=(), own=())
    change = np.zeros((4, both.count), complex)
    change[:, 0] = 0.05 * (rng.standard_normal(4) + 1j * rng.standard_normal(4))
    both, columns = replace(both, relative=change), replace(columns, relative=change[:, :3])
    new = [Columns(rng.standard_normal((60, k)), rng.uniform(0.2, 1.0, k),
                   np.where(rng.uniform(size=k) < 0.4, 0.0, -np.inf), np.zeros(k, int),
                   moves * 0.1 * (rng.standard_normal((4, k)) + 1j * rng.standard_normal((4, k))))
           for k, moves in ((1, 0), (2, 1), (1, 1), (3, 1), (2, 0), (1, 1))]
    alone = solve(plain, both, sizes, iterations=60, accuracy=1e-12)
    expected = [written_out(plain, both, alone, c) for c in new]
    together = gains(rows, columns, solve(rows, columns, sizes, iterations=60, accuracy=1e-12), new)
    assert together == pytest.approx(expected, rel=1e-6, abs=1e-6)
