"""Motion only: the likelihood against the time domain, what it finds, and the force that comes with it."""

import tracemalloc

import numpy as np
import pytest
from gap_cases import tank_case
from identify_studies import motion_alone
from identify_tank import (
    BAND,
    LENGTH,
    G,
    drawn_truth,
    group_velocity,
    jonswap,
    ratio,
    sail,
    tank,
    with_waves,
)
from scipy.linalg import expm, toeplitz
from seeds import some

from radiation_ss import Record, identify
from radiation_ss.errors import InputError
from radiation_ss.identification import (
    Coefficients,
    ForceSpectra,
    SeaModel,
    Settings,
    SpectralRules,
    Study,
    cautious,
    motion_channels,
    relation,
    smooth_one,
    spectral_likelihood,
    total_deviation,
)
from radiation_ss.inference import parametrise
from radiation_ss.records import filled
from radiation_ss.waves import jonswap_density


def peaked(omega):
    return 1.0 / (0.05 + (np.maximum(omega, 0.0) - 4.0) ** 2) + 0.02


def test_banded_covariance_is_that_of_the_windowed_record():
    nt, dt = 240, 0.1
    c = Coefficients(np.zeros((1, nt, 1)), dt, 8, 40)
    S = np.where(c.fine > 0.0, peaked(c.fine), 0.0)[:, None, None]
    band = c.covariance(S, np.array([0.3]))
    # r(tau) by the same sum over fine frequencies, then C = W R W^H in full.
    w = c.spacing / 4 * np.arange(1, 400)
    r = np.cos(np.outer(dt * np.arange(nt), w)) @ (peaked(w) * (w <= c.fine[-1])) * c.spacing / 4
    centre = 0.5 * (nt - 1)
    F = np.exp(-1j * np.outer(c.omega, dt * (np.arange(nt) - centre))) * c.window
    full = F @ (toeplitz(r) + 0.3 * np.eye(nt)) @ F.conj().T
    size = np.sqrt(np.outer(np.diag(full).real, np.diag(full).real))
    for d in range(band.shape[0]):
        error = np.abs(band[d, :c.omega.size - d] - np.diag(full, -d)) / np.diag(size, -d)
        assert error.max() < 5e-3        # what the dropped side lobes and the negative frequencies amount to
    z = F @ np.ones(nt)
    np.testing.assert_allclose(Coefficients(np.ones((1, nt, 1)), dt, 8, 40).z[0, :, 0], z, atol=1e-10)


@pytest.mark.parametrize("p", [1, 2])
def test_gradient_is_exact(p):
    rng = np.random.default_rng(p)
    c = Coefficients(rng.standard_normal((3, 200, p)), 0.1, 15, 60)
    g = 1.0 + 0.3 * rng.standard_normal((c.fine.size, p))
    g = g if p == 1 else g + 0.5j * rng.standard_normal(g.shape)
    dg, noise = rng.standard_normal(g.shape), np.full(p, 0.1)

    def S(e):
        h = g + e * dg
        return h[:, :, None] * h.conj()[:, None, :]

    value, by_S, by_noise = c.gradient(S(0.0), noise)
    alone = [Coefficients(y[None], 0.1, 15, 60).log_likelihood(S(0.0), noise) for y in c.y]
    assert value == pytest.approx(c.log_likelihood(S(0.0), noise), rel=1e-12) == pytest.approx(sum(alone), rel=1e-12)
    numeric = (c.log_likelihood(S(1e-5), noise) - c.log_likelihood(S(-1e-5), noise)) / 2e-5
    assert np.sum(by_S * (S(1e-5) - S(-1e-5)) / 2e-5).real == pytest.approx(numeric, rel=1e-5, abs=1e-5)
    step = 1e-6 * np.eye(p)[0]
    slope = (c.log_likelihood(S(0.0), noise + step) - c.log_likelihood(S(0.0), noise - step)) / 2e-6
    assert by_noise[0] == pytest.approx(slope, rel=1e-5)


def test_sea_model_is_jonswap_without_deviation():
    w = np.linspace(2.0, 20.0, 50)
    sea = SeaModel(0.01, 1.1, np.geomspace(2.0, 20.0, 8))
    v = np.zeros(sea.size + 1)
    gamma = float(sea.natural(v)[2])
    np.testing.assert_allclose(sea.density(v, w), jonswap_density(w, 0.01, 1.1, gamma), rtol=0.02)
    sea = SeaModel(0.01, 1.1, np.geomspace(2.0, 20.0, 8), name="departing")
    v = np.r_[np.zeros(4), np.random.default_rng(0).standard_normal(8)]
    assert np.ptp(np.log(sea.density(v, w) / jonswap_density(w, 0.01, 1.1, gamma))) > 0.05
    sea = SeaModel(0.01, 1.1, np.geomspace(2.0, 20.0, 8), name="two systems")
    v = np.r_[sea.with_second(np.zeros(3), 0.5, 0.7), np.zeros(sea.size - 6)]
    both = jonswap_density(w, 0.01, 1.1, gamma) + jonswap_density(w, 0.01 * np.sqrt(0.5), 0.77, gamma)
    np.testing.assert_allclose(sea.density(v, w), both, rtol=0.02)


def test_haskind_s_relation_is_read_off_the_section_s_own_exciting_force():
    model = with_waves(tank())
    w = np.linspace(3.0, 15.0, 30)
    found, warnings = relation(model, parametrise(model.fit, model.A_inf, 0.15), w)
    B = 1.3 * found.damping
    assert warnings == ()
    np.testing.assert_allclose(np.abs(found.exciting_force(B)[:, 0]) ** 2,
                               2.0 * 1000.0 * G * group_velocity(w) * LENGTH * B[:, 0], rtol=1e-3)
    bare, warnings = relation(tank(), parametrise(model.fit, model.A_inf, 0.15), w)
    assert len(warnings) == 1
    np.testing.assert_allclose(np.abs(bare.exciting_force(B)[:, 0]) ** 2, 1000.0 * G**2 / w * B[:, 0], rtol=1e-9)


def test_smoother_is_the_conditional_mean_of_the_whole_record():
    rng = np.random.default_rng(0)
    omega = np.linspace(0.0, 20.0, 1001)
    force = (1.0 + 0.2j * omega)[:, None]
    motion = force / (4.0 - omega**2 + 0.6j * omega)[:, None]
    model = ForceSpectra(omega, force, motion, peaked(omega) * (omega > 0.5), np.array([1e-3]))
    dt, nt = 0.1, 700
    lags = dt * np.arange(-(nt - 1), nt)
    at = np.arange(nt)[:, None] - np.arange(nt) + nt - 1
    Ryy = model.covariance(motion, motion, lags)[at][:, :, 0, 0] + model.noise * np.eye(nt)
    Rfy = model.covariance(force, motion, lags)[at][:, :, 0, 0]
    y = np.linalg.cholesky(Ryy) @ rng.standard_normal(nt)
    exact = Rfy @ np.linalg.solve(Ryy, y)
    mean, variance = smooth_one(model, y[:, None], dt, 1.5)
    assert np.sqrt(np.mean((mean[:, 0] - exact) ** 2) / np.mean(exact**2)) < 0.02
    gap = y.copy()
    gap[300:360] = np.nan
    _, opened = smooth_one(model, gap[:, None], dt, 1.5)
    assert opened[330, 0] > 2.0 * variance[330, 0]


@pytest.mark.parametrize("m", [4, 16])
def test_band_of_a_few_draws_holds_what_it_says(m):
    rng, between, within = np.random.default_rng(m), 1.0, 0.3
    truth = between * rng.standard_normal(40000)            # one more draw of the posterior, and its own error
    value = truth + np.sqrt(within) * rng.standard_normal(truth.size)
    means = between * rng.standard_normal((m, truth.size))
    half = 1.959964 * np.sqrt(within + means.var(axis=0, ddof=1) * (1.0 + 1.0 / m))
    short_of = [0.95 - np.mean(np.abs(value - means.mean(axis=0)) < size)
                for size in (half, total_deviation(means, np.full(means.shape, within)))]
    error = np.sqrt(0.95 * 0.05 / truth.size)
    assert short_of[0] > 4.0 * error and abs(short_of[1]) < 0.5 * short_of[0] + error     # a normal band is too narrow


def test_motion_alone_brings_K_and_the_force_closer():
    after, before, inside, force_inside, gained = motion_alone(range(3))
    assert np.linalg.norm(after) < 0.9 * np.linalg.norm(before)       # van Trees' bound of such records: 0.7 to 0.8
    assert np.mean(inside) > 0.75 and np.mean(force_inside) > 0.75
    assert max(gained) > 0.2 and min(gained) >= 0.0


def test_the_force_is_found_where_a_body_hardly_moves():
    """Of a soft body under a swell near its own frequency: most of the force is far above the motion's frequencies."""
    model = with_waves(tank().replace(C=[[60.0]]))
    errors, inside = [], []
    for seed in some(range(3)):
        record, force = sail(model, 60.0, np.random.default_rng(seed), with_force=False,
                             spectrum=lambda w: jonswap(w) + jonswap(w, 0.006, 3.0))
        found = identify(model, record, seed=seed).force["record"]
        errors.append(np.linalg.norm(found.mean[0] - force) / np.linalg.norm(force))
        inside.append(np.mean((found.lower[0] <= force) & (force <= found.upper[0])))
    assert np.mean(errors) < 0.25 and min(inside) > 0.9       # 0.5 and 0.6 with a sea that ends where the motion does


def test_three_seas_share_one_body():
    start = with_waves(tank())
    rng = np.random.default_rng(7)
    truth = drawn_truth(start, rng)
    records = [sail(truth, 30.0, rng, with_force=False)[0] for _ in range(3)]
    one = identify(start, records[0], "spectral", omega=BAND)
    three = identify(start, records, "spectral", omega=BAND)
    assert set(three.sea) == {"record", "record_2", "record_3"} == set(three.force)
    assert three.information["data"].mean() > one.information["data"].mean()


def test_a_gap_splits_the_record_and_short_ones_are_filled():
    start = with_waves(tank())
    record, _ = sail(start, 60.0, np.random.default_rng(0), with_force=False)
    y = np.array(record.channels["Heave"])
    y[500:560] = np.nan
    y[200] = y[900] = np.nan
    form = parametrise(start.fit, start.A_inf, 0.15)
    part, _ = spectral_likelihood(start, form, motion_channels(start, Record(record.time, {"Heave": y})))
    assert [c.y.shape[1] for c in part.coefficients] == [500, 640]
    whole, _ = spectral_likelihood(start, form, motion_channels(start, record))
    filled = part.coefficients[0].y[0, 200, 0] * part.channels.rms[0]
    assert filled == pytest.approx(whole.coefficients[0].y[0, 200, 0] * whole.channels.rms[0],
                                   abs=0.1 * whole.channels.rms[0])


def test_a_long_record_is_cut_and_tells_what_the_whole_does_in_less_memory():
    """1600 periods of 940 samples: the information of the parts is the whole's, and so is the slope."""
    start = with_waves(tank())
    record, _ = sail(drawn_truth(start, np.random.default_rng(1)), 1500.0, np.random.default_rng(0), dt=0.001,
                     with_force=False)
    form, channels = parametrise(start.fit, start.A_inf, 0.15), motion_channels(start, record)
    tracemalloc.start()
    part, _ = spectral_likelihood(start, form, channels)
    assert tracemalloc.get_traced_memory()[1] < 20 * channels.y.nbytes
    tracemalloc.stop()
    whole, _ = spectral_likelihood(start, form, channels, rules=SpectralRules(longest=1e6))
    assert len(part.coefficients[0].y) == 4 and len(whole.coefficients[0].y) == 1
    whole = type(whole)(start, form, channels, whole.coefficients, part.sea, whole.rules)
    u, v = np.zeros(form.size), np.zeros(part.size)
    (_, slope, information), (_, all_slope, all_information) = part.local(u, v), whole.local(u, v)
    body, size = slice(form.size), np.sqrt(np.diag(all_information))
    np.testing.assert_allclose(np.diag(information)[body], np.diag(all_information)[body], rtol=0.02)
    np.testing.assert_allclose((slope / size)[body], (all_slope / size)[body], atol=0.5)


def test_gaps_up_to_half_a_period_are_filled_to_the_noise():
    start, rng = with_waves(tank()), np.random.default_rng(4)
    y = sail(start, 100.0, rng, noise=0.0, with_force=False)[0].channels["Heave"]
    holes = np.where(rng.random(y.size) < 0.2, np.nan, y + 0.01 * y.std() * rng.standard_normal(y.size))
    holes[595:613] = y[595:613]
    holes[600:608] = np.nan         # 0.4 s of a period of 0.9 s
    holes[1200:1260] = np.nan
    out = filled(holes, 9, 27)
    error = (out - y) / y.std()
    assert np.isnan(out[1200:1260]).all() and np.isfinite(np.delete(out, np.s_[1180:1280])[5:-5]).all()
    assert np.abs(error[600:608]).max() < 0.1
    short = np.isnan(holes) & np.isfinite(out)
    assert np.sqrt(np.mean(error[short] ** 2)) < 0.02


def test_joint_filter_is_not_worse_than_doing_nothing_and_follows_the_force():
    start = with_waves(tank())
    ratios = []
    for seed in some([1, 2, 3]):
        rng = np.random.default_rng(seed)
        truth = drawn_truth(start, rng)
        record, force = sail(truth, 90.0, rng, with_force=False)
        found = identify(start, record, "joint", omega=BAND)
        ratios.append(ratio(found.K.mean, truth, start))
        estimate = found.force["record"]
        assert np.sqrt(np.mean((estimate.mean[0] - force) ** 2) / np.mean(force**2)) < 0.3
        history = found.baseline["history"]
        assert len(history["time"]) == len(history["mean"]) >= 2
    assert np.median(ratios) < 1.0


@pytest.mark.parametrize("spread", [0.05, 0.3, 0.6, 2.0])
def test_cautious_answer_has_the_least_expected_ratio_of_errors(spread):
    start = with_waves(tank())
    form = parametrise(start.fit, start.A_inf, 0.15)
    study = Study(start, form, (), None, None, 0, np.random.default_rng(0), Settings())
    u = 0.5 * (0.6 + spread * np.random.default_rng(1).standard_normal((6000, 1))) * np.eye(6)[0]
    # On a line, by quadrature: int |a - x| / max(|x|, a tenth of its rms) p(x) dx, x ~ N(0.6, spread^2).
    x = 0.6 + spread * np.linspace(-6.0, 6.0, 4001)
    weight = np.exp(-0.5 * ((x - 0.6) / spread) ** 2) / np.maximum(np.abs(x), 0.1 * np.hypot(0.6, spread))
    a = 0.6 * np.linspace(0.0, 1.0, 201)
    best = a[np.argmin(np.abs(a[:, None] - x) @ weight)] / 0.6
    assert cautious(study, u, [(3.5, 14.0)])[0] / u[:, 0].mean() == pytest.approx(best, abs=0.1)


def test_two_peaked_sea_is_seen_and_mixed_in():
    start, rng = with_waves(tank()), np.random.default_rng([9001, 3])
    truth = drawn_truth(start, rng)
    record, _ = sail(truth, 120.0, rng, with_force=False,
                     spectrum=lambda w: 0.5 * jonswap(w, 0.01, 1.35) + 0.5 * jonswap(w, 0.01, 0.85))
    assert identify(start, record, "spectral", omega=BAND).sea["record"]["two_systems"] > 0.5
    plain, _ = sail(truth, 120.0, rng, with_force=False)
    assert identify(start, plain, "spectral", omega=BAND).sea["record"]["two_systems"] < 0.5


def test_a_white_sea_between_two_edges_is_free_and_said_so():
    start, rng = with_waves(tank()), np.random.default_rng(3)
    record, _ = sail(start, 120.0, rng, with_force=False, spectrum=lambda w: 1e-6 * ((w > 4.0) & (w < 12.0)))
    found = identify(start, record, "spectral", omega=BAND, draws=300)
    families = found.sea["record"]["families"]
    assert families["free"] + families["free lumpy"] > 0.9
    assert any("not JONSWAP-like" in text for text in found.warnings)
    true = start.fit.frequency_response(BAND)       # the truth is the model: the band holds it, and no other is named
    inside = (found.B.lower <= true.real) & (true.real <= found.B.upper)
    assert inside.mean() > 0.9 and not any("ask for" in text for text in found.warnings)
    low, high = found.sea["record"]["omega"][[0, -1]]
    assert low < 4.5 and high > 11.0


def test_dual_filter_says_that_motion_alone_tells_nothing_of_the_body():
    start = with_waves(tank())
    record, _ = sail(start, 20.0, np.random.default_rng(0), with_force=False)
    y = record.channels["Heave"]
    velocity = np.gradient(y, record.time)
    record = record.with_channels(Heave_velocity=velocity, Heave_acceleration=np.gradient(velocity, record.time))
    found = identify(start, record, "dual-enkf", omega=BAND)
    assert any("says nothing about the parameters" in text for text in found.warnings)
    assert found.information["data"].mean() < 0.15 and set(found.force) == {"record"}


def test_a_decay_test_joins_the_records_in_waves():
    start = with_waves(tank())
    rng = np.random.default_rng(11)
    truth = drawn_truth(start, rng)
    record, _ = sail(truth, 30.0, rng, with_force=False)
    F, _ = truth.matrices()
    t = np.arange(0.0, 8.0, 0.05)
    y = np.array([(expm(F * x) @ np.r_[0.0, 0.0, 0.0, 0.02, 0.0])[3] for x in t])
    decay = Record(t, {"Heave": y + 1e-4 * rng.standard_normal(t.size)}, kind="decay", name="decay")
    alone = identify(start, record, "spectral", omega=BAND, draws=200)
    both = identify(start, [record, decay], "spectral", omega=BAND, draws=200)
    assert set(both.sea) == {"record"}
    assert ratio(both.K.mean, truth, start) < ratio(alone.K.mean, truth, start)
    with pytest.raises(InputError, match="only decay tests"):
        identify(start, decay, "spectral")


def test_seas_of_lines_and_strong_drag_get_an_answer_with_a_warning():
    """Sixty lines are no sea of one system: in three records together they drive the body 12 prior deviations away."""
    model, runs = tank_case([("quadratic_drag", "Heave", {"coefficient": 1500.0})], 1, ("waves",) * 3, duration=150.0,
                            dt=0.1)
    records = [Record(run.time, {"Heave": run.channels["Heave"]}, kind="motion-only", name=run.name)
               for run in runs]
    found = identify(model, records, omega=[6.0, 8.0, 10.0])
    assert any("the bands do not hold that" in text for text in found.warnings)
    assert max(abs(row["mean"] - row["prior_mean"]) / row["prior_std"] for row in found.parameters.values()) < 4.0
