"""Members of the dual filter: lognormal prior, iterated updates, passivity kept by the least move."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize
from scipy.stats import chi2
from seeds import some

import radiation_ss as rss
from benchmarks.coupled_body import body, noise_record
from benchmarks.filter_by_numpy import noise_covariance, rate
from benchmarks.heave_tank import BAND, POINTS, TRUTH, drawn_about, known, sea_record, start, tank
from radiation_ss.filter import Draws, Evidence, conditions, damping_slopes, drawing, finish, lognormal, most_probable
from radiation_ss.inference import point_values, subsystems_of

NO_POINTS = (np.zeros(0), np.zeros((0, 1, 1), dtype=complex))


def with_force(record, force, seed):
    noise = 0.01 * force.std() * np.random.default_rng(seed + 77).standard_normal(force.size)
    return record.with_channels(Heave_force=force + noise)


def drawn(model, points=None, size=100, seed=0):
    parts = subsystems_of(model.fit)
    at = NO_POINTS if points is None else point_values(model, points)
    return drawing(parts, 0.15 * np.abs(parts.theta), conditions(parts, *at), 1e-3, BAND,
                   (size, np.random.default_rng(seed)))


def test_linear_conditions_give_the_gaussian_posterior():
    """With a prior so narrow that its exponential is straight."""
    rng = np.random.default_rng(0)
    start, H = np.array([2.0, 3.0, 0.0, 5.0]), rng.standard_normal((2, 4)) * 1e5
    prior = lognormal(start, np.full(4, 1e-5), (H, H @ start + rng.standard_normal(2), np.array([0.5, 2.0])))
    assert prior.free.tolist() == [0, 1, 3]
    root = rng.standard_normal((3, 3))
    data = Evidence(rng.standard_normal(3), rng.standard_normal(3), root @ root.T)
    J = H[:, prior.free] * prior.start[prior.free] * 1e-5 / prior.std[:, None]
    precision = np.eye(3) + J.T @ J + data.information
    right = J.T @ ((prior.y - H @ prior.start) / prior.std) + data.information @ data.centre + data.gradient
    zero = Draws(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros((1, 3)))
    mode = finish(most_probable(prior, data, zero))[0]
    np.testing.assert_allclose(mode, np.linalg.solve(precision, right), atol=2e-4)
    count = 20_000
    draws = Draws(rng.standard_normal((count, 3)), rng.standard_normal((count, 2)),
                  rng.standard_normal((count, 3)) @ root.T)
    rows = finish(most_probable(prior, data, draws))
    # Five standard errors of a sample covariance.
    np.testing.assert_allclose(np.cov(rows.T), np.linalg.inv(precision), atol=5.0 * np.sqrt(2.0 / count))


@pytest.mark.parametrize("which, expected", [("start", 0.95), ("truth", 0.943)])
def test_bands_hold_wherever_the_truth_is_drawn(which, expected):
    inside = []
    for seed in some(range(40), 20):
        model, theta = drawn_about(which, seed)
        filter_ = rss.DualEnKF(model, seed=seed, points=known(POINTS, theta), omega=BAND)
        table = filter_.run(sea_record(0, duration=0.5)[0]).parameters.values()
        inside.append([p.lower <= truth <= p.upper for p, truth in zip(table, theta)])
    # A start of 1 + 0.15 z is not lognormal. Two free directions in each case: three standard errors of as many draws.
    assert np.mean(inside) > expected - 3.0 * np.sqrt(expected * (1.0 - expected) / (2.0 * len(inside)))


def test_a_record_is_off_by_its_own_standard_deviations_in_every_direction():
    """What it knows best included: a plane of theta, as points are, and no plane of the logarithm."""
    total, straight, seeds = 0.0, 0.0, some(range(8), 4)
    for seed in seeds:
        record, force = sea_record(seed, duration=20.0)
        filter_ = rss.DualEnKF(start(seed), seed=seed, omega=BAND)
        filter_.run(with_force(record, force, seed))
        iterated, window = filter_.engine.iterated, filter_.engine.window
        centre, truth = (iterated.drawing.prior.u(theta) for theta in (filter_.engine.state.theta[:, -2], TRUTH))
        tangents = iterated.run_at(centre)
        finish(iterated.take(tangents, window.samples()))
        data = Evidence(centre, tangents.gradient, tangents.information)
        best = np.linalg.solve(data.information, data.gradient)
        change = data.change(iterated.drawing.prior, truth)
        total += (change - best) @ data.information @ (change - best)
        straight += (truth - centre - best) @ data.information @ (truth - centre - best)
    low, high = chi2.ppf((0.0005, 0.9995), 6 * len(seeds))
    assert low < total < high < straight


def test_a_repair_takes_no_width_from_the_bands():
    filter_ = rss.DualEnKF(start(1), seed=1, omega=BAND)
    found = filter_.run(sea_record(1, duration=0.5)[0])
    assert found.counts["made_passive"] > 20
    reach = [np.log(p.upper / p.lower) for p in found.parameters.values()]
    # Exact draws of the lognormal prior: the width is the prior's.
    np.testing.assert_allclose(reach, 2.0 * 1.959964 * np.sqrt(np.log1p(0.15**2)), rtol=1e-9)
    assert np.all(np.log(found.members).std(axis=1, ddof=1) < np.sqrt(np.log1p(0.15**2)))


def test_iterated_updates_are_as_sure_as_they_are_right():
    """A straight line through the first seconds leaves errors of several of its standard deviations."""
    apart = {True: [], False: []}
    for seed in some(range(8), 4):
        record, force = sea_record(seed, duration=20.0)
        for iterated, rows in apart.items():
            filter_ = rss.DualEnKF(start(seed), seed=seed, omega=BAND)
            filter_.prepare(with_force(record, force, seed))
            if not iterated:
                filter_.engine.window = None
            y = np.vstack([*record.channels.values(), with_force(record, force, seed).channels["Heave_force"]])
            filter_.advance(record.time, y)
            theta, std = filter_.settle()
            rows.append((theta - TRUTH) / std)
    rms = {key: np.sqrt(np.mean(np.square(rows))) for key, rows in apart.items()}
    # Two free directions a record at least: the rms of a right filter is 1 +- 1 / sqrt(2 x 2 x records).
    assert rms[True] < 1.0 + 3.0 / np.sqrt(4.0 * len(apart[True]))
    assert rms[False] > rms[True]


def test_settling_again_changes_nothing():
    record, force = sea_record(2, duration=10.0)
    filter_ = rss.DualEnKF(start(2), seed=2, omega=BAND).prepare(with_force(record, force, 2))
    filter_.advance(record.time, np.vstack([*record.channels.values(), force]))
    first, std = filter_.settle()
    second, _ = filter_.settle()
    assert np.all(np.abs(second - first) < 0.3 * std)
    with pytest.raises(rss.InputError, match="default filter"):
        rss.DualEnKF(start(2), preset="paper").prepare(record).settle()


def test_what_refused_samples_say_is_not_learnt():
    record, force = sea_record(3, duration=15.0)
    record = with_force(record, force, 3)
    spoilt = record.channels["Heave_acceleration"].copy()
    spoilt[::70] += 30.0 * spoilt.std()
    clean = rss.DualEnKF(start(3), seed=3, omega=BAND).run(record)
    spiky = rss.DualEnKF(start(3), seed=3, omega=BAND).run(record.with_channels(Heave_acceleration=spoilt))
    assert spiky.counts["refused"] >= 0.9 * (spoilt[::70].size - 2)
    for one, two in zip(clean.parameters.values(), spiky.parameters.values()):
        assert abs(one.mean - two.mean) < two.std


def test_the_forces_noise_is_that_of_the_exact_integral():
    engine = rss.DualEnKF(tank()).prepare(sea_record(0, duration=2.0)[0]).engine
    q, size = engine.system.q, engine.system.H.shape[1]
    G = rate(engine.system, np.repeat(TRUTH[:, None], size, axis=1), np.eye(size))
    N = np.zeros((size, size))
    N[-q.size:, -q.size:] = np.diag(q)
    # Van Loan (1978).
    both = expm(0.01 * np.block([[-G, N], [np.zeros_like(G), G.T]]))
    exact = both[size:, size:].T @ both[:size, size:]
    scale = np.sqrt(np.diag(exact))
    scale[scale == 0.0] = 1.0
    found = noise_covariance(engine.system, TRUTH, 0.01)
    np.testing.assert_allclose(found / np.outer(scale, scale), exact / np.outer(scale, scale), atol=2e-3)


@pytest.mark.parametrize("points", [None, POINTS[1:]])
def test_every_member_is_passive_or_made_so_by_the_least_move(points):
    moved_some = 0
    for seed in range(6):
        how = drawn(start(seed), points, seed=seed)
        parts, rule = how.parts, how.rule
        draws = Draws(*np.split(how.draws, [6, 12], axis=1)[::2], np.zeros((100, 6)))
        free = finish(most_probable(how.prior, Evidence.none(6), draws))
        bad = parts.damping(how.prior.theta(free), rule.omega, rule.scale).min(axis=-1) < rule.floor
        found = finish(how.members())
        assert (parts.damping(found.theta.T, rule.omega, rule.scale).min(axis=-1) >= rule.floor).all()
        assert parts.stable(found.theta.T).all()
        kept = how.prior.u(found.theta.T)
        np.testing.assert_allclose(kept[~bad], free[~bad], atol=1e-9)
        assert found.not_passive in (bad.sum(), bad.sum() + 1)  # the centre may be one of them
        off = how.prior.off(kept) - how.prior.off(free)
        assert np.abs(off).max(initial=0.0) <= 0.1
        moved_some += int(bad.sum())
    assert moved_some > 20


def test_the_move_is_the_nearest():
    how = drawn(start(1), seed=1)
    parts, rule, checked = how.parts, how.rule, 0
    for before, after in zip(how.prior.theta(how.draws[:, :6]), finish(how.members()).theta.T):
        u0, u1 = how.prior.u(before), how.prior.u(after)
        if np.allclose(u0, u1):
            continue

        def room(u):
            return parts.damping(how.prior.theta(u), rule.omega, rule.scale) - rule.floor - 1e-6

        other = minimize(lambda u, at: np.sum((u - at) ** 2), u1, args=(u0,), method="SLSQP",
                         constraints={"type": "ineq", "fun": room})
        assert np.linalg.norm(u1 - u0) <= np.linalg.norm(other.x - u0) * 1.01 + 1e-3
        checked += 1
        if checked == 8:
            break
    assert checked == 8


def test_damping_slopes_are_the_derivatives():
    parts = subsystems_of(body(2, 3, ((0, 1),)).fit)
    w, scale, theta = np.array([0.5, 3.0, 12.0]), np.array([[4.0, 2.0], [2.0, 1.0]]), parts.theta
    values, slopes = damping_slopes(parts, theta, w, scale)
    np.testing.assert_allclose(values, parts.damping(theta, w, scale), rtol=1e-9)
    for p in range(theta.size):
        step = np.zeros(theta.size)
        step[p] = 1e-6 * abs(theta[p])
        both = [parts.damping(theta + sign * step, w, scale) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(slopes[:, p], (both[0] - both[1]) / (2.0 * step[p]), rtol=1e-4, atol=1e-9)


def test_coupled_members_are_passive_as_a_matrix_and_the_mass_stays_positive():
    model = body(2, 3, ((0, 1),))
    filter_ = rss.DualEnKF(model, prior=0.8, seed=1).prepare(noise_record(model, 100))
    members, counts = filter_.engine.projected()
    rule = filter_.engine.iterated.drawing.rule
    assert (filter_.parts.damping(members.T, rule.omega, rule.scale).min(axis=-1) >= rule.floor).all()
    assert filter_.parts.stable(members.T).all()
    assert counts["made_passive"] > 0 and counts["repaired"] > 0
    assert np.linalg.eigvalsh(model.M + model.A_inf)[0] > 0.0
