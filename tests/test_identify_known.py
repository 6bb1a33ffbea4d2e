"""identify(): known force, decay tests, known points, the result's form."""

import json
import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identify_studies import known_force, not_smooth
from identify_tank import BAND, drawn_truth, ratio, sail, tank, with_waves
from plant_bodies import tank_model
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import cont2discrete, dlsim
from seeds import some

from radiation_ss import Model, RadiationFit, Record, fit_radiation, identify
from radiation_ss.errors import InputError
from radiation_ss.identification import passive, uncoupled
from radiation_ss.inference import innovations, log_likelihood, parametrise


@pytest.fixture(scope="module")
def twenty_seconds():
    """A record of a body like its model in waves, and what it says of the body."""
    record, _ = sail(tank(), 20.0, np.random.default_rng(0))
    return record, identify(tank(), record, "prediction-error", omega=BAND, draws=100)


def test_innovations_give_the_likelihood_of_the_joint_normal_distribution():
    rng = np.random.default_rng(3)
    nt, N, p = 12, 3, 2
    Ad, H = 0.4 * rng.standard_normal((N, N)), rng.standard_normal((p, N))
    Q, P0 = np.diag([0.3, 0.2, 0.5]), np.diag([1.0, 2.0, 0.7])
    R = np.array([0.1, 0.4])
    states, cov = [np.eye(N)], np.zeros((N * nt, N * nt))
    blocks = [P0]
    for _ in range(nt - 1):
        blocks.append(Ad @ blocks[-1] @ Ad.T + Q)
        states.append(Ad @ states[-1])
    for i in range(nt):
        for j in range(i, nt):
            part = states[j - i] @ blocks[i]
            cov[j * N:(j + 1) * N, i * N:(i + 1) * N] = part
            cov[i * N:(i + 1) * N, j * N:(j + 1) * N] = part.T
    big_H = np.kron(np.eye(nt), H)
    S = big_H @ cov @ big_H.T + np.kron(np.eye(nt), np.diag(R))
    y = rng.standard_normal((nt, p))
    y[4, 1] = y[7, 0] = np.nan
    keep = np.isfinite(y.ravel())
    S, flat = S[np.ix_(keep, keep)], y.ravel()[keep]
    expected = -0.5 * (np.linalg.slogdet(S)[1] + flat @ np.linalg.solve(S, flat))
    e, s = innovations(Ad, Q, H, R, P0, np.zeros((nt, N)), y, 0.0)
    assert log_likelihood(e, s) == pytest.approx(expected, rel=1e-10)


def test_known_force_finds_the_memory_and_its_bands_hold():
    ratios, inside, moved, errors = known_force(range(2))
    assert np.median(ratios) <= 0.12 and errors.max() < 1.0
    # Bands of 95 % of some three independent frequencies in each of two runs: two of them outside once in 30.
    assert np.mean(inside) > 0.75
    # The data tell more than the model does, whose inertia, stiffness and sensors are not exact.
    assert np.mean(moved) > 0.5


def test_errors_of_the_model_that_are_not_smooth_are_no_damper():
    ratios, inside, damped = not_smooth([1, 3])  # of six, the two whose bands are the first to miss B
    assert ratios.max() < 0.3 and not damped.any()
    assert np.mean(inside) > 0.75


def test_decay_test_alone_brings_K_closer_at_the_natural_frequency():
    start = tank()
    truth = drawn_truth(start, np.random.default_rng(5))
    F, _ = truth.matrices()
    t = np.arange(0.0, 12.0, 0.02)
    state = np.r_[np.zeros(3), 0.02, 0.0]
    y = solve_ivp(lambda _, x: F @ x, (0.0, 12.0), state, t_eval=t, rtol=1e-9, atol=1e-12).y[3]
    record = Record(t, {"Heave": y + 1e-5 * np.random.default_rng(1).standard_normal(t.size)}, kind="decay")
    at = np.array([7.0, 7.5])
    found = identify(start, record, "prediction-error", omega=at, tolerance=0.0)     # mass and stiffness are exact
    assert ratio(found.K.mean, truth, start, at) < 0.2


def test_points_are_the_linear_gaussian_conditional_of_passive_memories():
    start = tank()
    truth = drawn_truth(start, np.random.default_rng(2))
    at = np.array([3.0, 9.9])
    known = {w: K for w, K in zip(at, truth.fit.frequency_response(at))}
    found = identify(start, [], "points", points=known, omega=BAND, draws=800)
    # Conditional mean of theta from K(iw) P(iw) - Q(iw) = 0, linear in theta, with vanishing noise.
    form = parametrise(start.fit, start.A_inf, 0.15)
    s = 1j * at[:, None]
    rows = np.hstack([np.array([known[w].item() for w in at])[:, None] * s ** np.arange(3), -(s ** np.arange(3))])
    right = -np.array([known[w].item() for w in at]) * (1j * at) ** 3
    rows, right = np.vstack([rows.real, rows.imag]), np.r_[right.real, right.imag]
    V = form.root @ form.root.T
    gain = V @ rows.T @ np.linalg.inv(rows @ V @ rows.T)
    # The conditional normal distribution, cut off where the memory is not passive.
    exact = form.theta(np.random.default_rng(0).standard_normal((6000, 6)))
    exact += (right - exact @ rows.T) @ gain.T
    exact = exact[passive(form, exact, 0.01)]      # but for 1 %, the kernel's tolerance
    mean = exact.mean(axis=0)
    estimated = np.array([found.parameters[name]["mean"] for name in form.names])
    spread = np.array([found.parameters[name]["std"] for name in form.names])
    assert np.abs(estimated - mean).max() < 4.0 * (spread / np.sqrt(300)).max() + 0.02 * form.std.max()
    assert ratio(found.K.mean, truth, start) < 0.3
    assert any("points do the work" in text for text in found.warnings) or found.information["data"].max() == 0.0
    np.testing.assert_allclose(found.information["prior"] + found.information["points"], 1.0)


def sway_roll() -> Model:
    """Two coupled modes, entries of order 2 with poles of their own, L24 = L42."""
    entry = {(0, 0): (2.0, 1.5, 40.0, 30.0), (0, 1): (3.0, 2.0, -4.0, -3.0), (1, 1): (4.0, 1.8, 3.0, 2.0)}
    a, b, c = np.zeros((8, 8)), np.zeros((8, 2)), np.zeros((2, 8))
    for i, (j, k) in enumerate([(0, 0), (0, 1), (1, 0), (1, 1)]):
        a1, a2, b1, b2 = entry[min(j, k), max(j, k)]
        a[2 * i:2 * i + 2, 2 * i:2 * i + 2] = [[0.0, 1.0], [-a1, -a2]]
        b[2 * i + 1, k] = 1.0
        c[j, 2 * i:2 * i + 2] = [b1, b2]
    fit = RadiationFit(("Sway", "Roll"), a, b, c, order=2)
    A_inf, C = [[20.0, 0.5], [0.5, 1.0]], [[100.0, 0.0], [0.0, 30.0]]
    return Model(("Sway", "Roll"), [[50.0, 1.0], [1.0, 4.0]], A_inf, C, fit)


def test_what_the_fit_leaves_out_of_its_data_is_known():
    data = with_waves(tank()).hydro
    fit = fit_radiation(data, 1)
    model = tank().replace(fit=fit, hydro=data)
    found = identify(model, [], "points", points=[7.0])
    inside = (data.omega > 2.0) & (data.omega < 15.0)
    alone, left = (np.linalg.norm((K - data.K)[inside]) for K in (fit.frequency_response(data.omega), found.prior["K"]))
    assert fit.relative_error > 0.15 and not any("leaves out" in text for text in found.warnings)
    assert left < 1e-9 * alone
    low, high = found.B.lower[inside], found.B.upper[inside]
    assert np.mean((low <= data.B[inside]) & (data.B[inside] <= high)) > 0.9


def test_coupled_entries_keep_their_own_poles_and_share_the_off_diagonal():
    model = sway_roll()
    form = parametrise(model.fit, model.A_inf, 0.15)
    assert form.mean.size == 12
    w = np.linspace(0.2, 6.0, 20)
    np.testing.assert_allclose(form.K(form.mean, w), model.fit.frequency_response(w), rtol=1e-8)
    theta = form.theta(0.5 * np.random.default_rng(0).standard_normal(12))
    np.testing.assert_allclose(form.realise(theta).frequency_response(w), form.K(theta, w), rtol=1e-9)


def test_common_poles_share_one_denominator():
    poles, residues = np.array([-0.5 + 2j, -0.5 - 2j, -1.0]), np.array([[[2.0, 0.3], [0.3, 1.0]]] * 3)
    a = np.kron(np.array([[-0.5, 2.0, 0.0], [-2.0, -0.5, 0.0], [0.0, 0.0, -1.0]]), np.eye(2))
    b = np.kron(np.array([[2.0], [0.0], [1.0]]), np.eye(2))
    c = np.hstack([residues[0], np.zeros((2, 2)), residues[2]])
    fit = RadiationFit(("Sway", "Roll"), a, b, c, order=3)
    form = parametrise(fit, np.eye(2), 0.15)
    assert len(form.blocks) == 1 and form.mean.size == 3 + 3 * 3
    w = np.linspace(0.1, 5.0, 15)
    np.testing.assert_allclose(form.K(form.mean, w), fit.frequency_response(w), rtol=1e-8, atol=1e-10)
    assert np.allclose(np.sort_complex(np.roots([1.0, *form.mean[2::-1]])), np.sort_complex(poles))


def test_high_order_denominators_are_written_in_stable_sections():
    poles = np.array([-0.02 + 1j, -0.02 - 1j, -0.03 + 1.2j, -0.03 - 1.2j, -0.05 + 1.5j, -0.05 - 1.5j])
    a = np.zeros((6, 6))
    for i in (0, 2, 4):
        a[i:i + 2, i:i + 2] = [[poles[i].real, poles[i].imag], [-poles[i].imag, poles[i].real]]
    fit = RadiationFit(("Heave",), a, np.ones((6, 1)), np.ones((1, 6)), order=6)
    form = parametrise(fit, np.eye(1), 0.15)
    w = np.linspace(0.1, 3.0, 25)
    assert form.blocks[0].form == "sections"
    np.testing.assert_allclose(form.K(form.mean, w), fit.frequency_response(w), rtol=1e-8)
    theta = form.theta(np.random.default_rng(0).standard_normal((5, form.active.size)))
    for row in theta:
        assert form.stable(row)
        np.testing.assert_allclose(form.realise(row).frequency_response(w), form.K(row, w), rtol=1e-8)


def test_prior_is_the_spread_of_K_whatever_the_order_and_form():
    w = np.linspace(0.05, 1.0, 60)
    lightly = [[-0.05, 0.5, -0.02], [-0.1, 0.8, 0.1], [-0.08, 1.1, 0.3]]
    for pairs in (1, 2, 3):
        a, c = np.zeros((2 * pairs, 2 * pairs)), np.zeros((1, 2 * pairs))
        for i, (real, imag, share) in enumerate(lightly[:pairs]):
            a[2 * i:2 * i + 2, 2 * i:2 * i + 2] = [[4 * real, imag], [-imag, 4 * real]]
            c[0, 2 * i:2 * i + 2] = [1.0, share]
        form = parametrise(RadiationFit(("Heave",), a, np.ones((2 * pairs, 1)), c, order=2 * pairs), np.eye(1), 0.05)
        K = form.K(form.theta(np.random.default_rng(0).standard_normal((2000, form.active.size))), w)
        away = K - form.K(form.mean, w)
        spread = np.sqrt(np.mean(np.abs(away) ** 2) / np.mean(np.abs(form.K(form.mean, w)) ** 2))
        assert spread == pytest.approx(0.05, rel=0.4)       # other frequencies than the definition's, and curvature


def test_names_of_any_script_keep_their_files_apart(tmp_path, twenty_seconds):
    record, found = twenty_seconds
    mean = record.channels["Heave_force"][None]
    force = SimpleNamespace(time=record.time, mean=mean, lower=mean - 1.0, upper=mean + 1.0)
    names = ("波浪", "波高", "a/b$\\frac{$", "a b", "a_b", "A B", "🌊", "🚢")
    saved = replace(found, force=dict.fromkeys(names, force)).save(tmp_path)
    files = json.loads((saved / "identify.json").read_text(encoding="utf-8"))["force"]
    assert set(files) == set(names) and len({name.casefold() for name in files.values()}) == len(names)
    assert all((saved / name).stat().st_size > 0 and (saved / name).with_suffix(".png").exists()
               for name in files.values())


def test_plants_spread_as_the_bands_where_the_record_has_power(twenty_seconds):
    """Damping by each plant's response: of 100 draws a band's edges are known to a fifth of its width."""
    _, found = twenty_seconds
    at = found.omega[found.information["power"]]
    motion = np.array([plant(1j * at)[plant.output_labels.index("heave")] for plant in found.plants(100)])
    edges = np.quantile((1.0 / motion).reshape(100, -1).imag / at, [0.025, 0.975], axis=0)
    band = found.B.lower[found.information["power"], 0, 0], found.B.upper[found.information["power"], 0, 0]
    assert np.all(np.abs(edges - band) < 0.4 * (band[1] - band[0]))


def test_a_system_in_any_coordinates_is_a_model(twenty_seconds):
    import control as ct

    start, (record, one) = tank(), twenty_seconds
    system, T = start.to_ss(), np.random.default_rng(1).standard_normal((5, 5))
    turned = ct.ss(T @ system.A @ np.linalg.inv(T), T @ system.B, system.C @ np.linalg.inv(T), system.D,
                   inputs=system.input_labels, outputs=system.output_labels)
    for plant in (turned, ct.c2d(system, 0.05)):
        other = identify(plant, record, "prediction-error", omega=BAND, draws=100)
        np.testing.assert_allclose(other.prior["K"], one.prior["K"], rtol=1e-4)
        assert np.linalg.norm(other.K.mean - one.K.mean) < 0.02 * np.linalg.norm(one.K.mean)
    draw = one.plants(100)[7]           # a plant's poles and static gain are those of its draw
    assert draw.input_labels == system.input_labels and draw.nstates >= 5
    change = one.form.nominal_change(one.u[7])
    stiffness = next(i for i, row in enumerate(one.form.nominal) if row[0] == "stiffness")
    assert draw.dcgain()[0, 0] * start.C[0, 0] * (1.0 + change[stiffness]) == pytest.approx(1.0)
    with pytest.raises(InputError, match="from 1 to 100"):
        one.plants(101)
    with pytest.raises(InputError, match="heave_vel"):
        short = ct.ss(system.A, system.B, system.C[:1], system.D[:1], inputs=["heave_force"], outputs=["heave"])
        identify(short, record)


def test_a_wrong_mass_is_named_and_kept_out_of_K():
    start = tank()
    ratios, named = [], 0
    for seed in some(range(3)):
        rng = np.random.default_rng(seed)
        truth = drawn_truth(start, rng)
        record, _ = sail(truth.replace(M=1.08 * truth.M), 60.0, rng)
        found = identify(start, record, "prediction-error", omega=BAND, draws=200)
        ratios.append(ratio(found.K.mean, truth, start))
        named += any("inertia [Heave]" in text and "mass or A_inf" in text for text in found.warnings)
    assert named == len(ratios) and np.median(ratios) < 0.35


def test_no_answer_where_no_record_has_power():
    start = tank()
    t = np.arange(0.0, 60.0, 0.05)
    w = np.array([5.0, 6.0])
    H = 1.0 / (start.C - w[:, None, None] ** 2 * (start.M + start.A_inf)
               + 1j * w[:, None, None] * start.fit.frequency_response(w))[:, 0, 0]
    rng = np.random.default_rng(0)
    records = [Record(t, {"Heave": (h * np.exp(1j * x * t)).real + 1e-5 * rng.standard_normal(t.size),
                          "Heave_force": np.cos(x * t)}, name=f"{x:g}") for x, h in zip(w, H)]
    grid = np.linspace(0.5, 15.0, 59)
    found = identify(start, records, "prediction-error", omega=grid, draws=200)
    there = found.information["power"]
    assert there[np.abs(grid[:, None] - w).min(axis=1) < 0.13].all() and not there[(grid < 3.0) | (grid > 9.0)].any()
    assert found.information["data"][~there].max() == 0.0
    free = identify(start, [], "points", points=[5.0], point_tolerance=0.9, omega=grid, draws=2000)
    wide = (free.B.upper - free.B.lower)[~there, 0, 0]
    assert np.mean((found.B.upper - found.B.lower)[~there, 0, 0] > 0.7 * wide) > 0.9
    assert "the data speak at" in str(found)


@pytest.mark.parametrize("seed", range(2))
def test_a_number_that_k_of_zero_makes_of_the_others_has_no_prior_to_be_told(seed):
    """K(0) is the sum of numerators over denominators at zero: the first numerator is what makes it zero."""
    companion = np.zeros((5, 5))
    companion[:2, :2], companion[2:4, 2:4], companion[4, 4] = [[0, 1], [-30.0, -4.0]], [[0, 1], [-120.0, -3.0]], -5.0
    c = np.array([[-40.0, 60.0, 80.0, 25.0, 5.0 * (40.0 / 30.0 - 80.0 / 120.0)]])  # of K(0) = 0
    fit = RadiationFit(("Heave",), companion, np.array([[0.0, 1.0, 0.0, 1.0, 1.0]]).T, c, order=5)
    start = tank().replace(fit=fit)
    record, _ = sail(start, 40.0, np.random.default_rng(seed))
    found = identify(start, record, "prediction-error", omega=BAND, draws=100)
    rows = {line.split()[0]: line for line in str(found).splitlines() if " +- " in line and "[" not in line}
    tied = [name for name in rows if "(model " in rows[name]]
    assert "prior" not in "".join(rows[name] for name in tied) and not any("+- 0," in row for row in rows.values())
    value = {name: float(row.split()[1]) for name, row in rows.items()}
    parts = [value[name] / value[name.replace("r", "c", 1)] for name in value if name.startswith(("r0_", "r_"))]
    assert tied and tied[0].startswith("r") and abs(sum(parts)) < 0.02 * np.abs(parts).max()


def test_saved_form_is_the_interface_s(tmp_path, twenty_seconds):
    _, found = twenty_seconds
    found.save(tmp_path)
    report = json.loads((tmp_path / "identify.json").read_text())
    assert report["schema"] == "radiation_ss.identification/1" and report["dofs"] == ["Heave"]
    assert {"method", "omega", "A", "B", "K_zero", "A_inf", "parameters", "sea", "information", "force", "baseline",
            "warnings"} <= set(report)
    assert np.shape(report["A"]["mean"]) == np.shape(report["B"]["upper"]) == (BAND.size, 1, 1)
    assert {"mean", "std", "prior_mean", "prior_std"} <= set(report["parameters"]["a1"])
    assert (tmp_path / "coefficients.png").stat().st_size > 0
    assert pickle.loads(pickle.dumps(found)).omega.size == BAND.size


def test_same_seed_same_answer(twenty_seconds):
    record, found = twenty_seconds
    again, other = (identify(tank(), record, "prediction-error", omega=BAND, draws=100, seed=seed) for seed in (0, 1))
    np.testing.assert_array_equal(again.B.mean, found.B.mean)
    assert np.all(other.B.mean != found.B.mean)


@pytest.mark.parametrize(("change", "message"), [
    (dict(method="magic"), "method"), (dict(method="points"), "points"), (dict(prior=0.0), "prior"),
    (dict(method="dual-enkf", tolerance=0.1), "tolerance"), (dict(method="paper", tolerance=0.0), "tolerance"),
    (dict(records=[]), "records"), (dict(omega=[2.0, 1.0]), "omega"), (dict(points=[-1.0]), "points")])
def test_bad_settings_are_named(change, message):
    record = sail(tank(), 20.0, np.random.default_rng(0))[0]
    with pytest.raises(InputError, match=message):
        identify(tank(), **{"records": record, "method": "prediction-error", **change})


@pytest.mark.parametrize(("options", "needed"), [
    *(({"draws": value}, "a whole number, at least 20,") for value in (19, 0, -100, 50.5, "many", np.nan, None, True)),
    *(({name: value}, "a number") for value in (-0.1, np.nan, "x", None, True) for name in (
        "beyond", "point_tolerance", "hopeless", "contradiction", "doubt")),
    *(({name: value}, "a number from 0 to 1") for value in (-0.1, 1.5, np.nan, "x") for name in (
        "least_passive", "nonlinear", "nonlinear_elevation", "misfit")),
    *(({"most_laws": value}, "a whole number, 0 or more,") for value in (-1, 1.5, np.nan, "x")),
    *(({"method": "dual-enkf", "n_ensemble": value}, "a whole number, at least 4 members for a covariance,")
      for value in (3, -5, 20.5, np.nan, np.inf, "x", True)),
    *(({"omega": value}, "positive ascending frequencies") for value in ("x", [np.nan], [1.0, np.inf], [[1.0]], [])),
    ({"tolerance": "x"}, "a share between 0 and 1"), ({"prior": True}, "relative standard deviation")])
def test_options_that_are_no_such_numbers_are_told_in_one_sentence(options, needed):
    (name, value), = ((name, value) for name, value in options.items() if name != "method")
    with pytest.raises(InputError) as told:
        identify(tank(), Record(np.arange(40.0), {"Heave": np.ones(40)}), **{"method": "prediction-error", **options})
    text = str(told.value)
    assert text.startswith((f"{name}: ", f"{name} of mass: ")) and f"{needed}" in text and "\n" not in text
    assert repr(value) in text


@pytest.mark.parametrize("where, words", [
    ([(9.0, 11.0)], ["not measured from 9 to 11 s", "2 parts"]), ([(-1.0, 0.5), (19.0, 21.0)], ["from 0 to 0.5"]),
    ([(6.0, 6.2), (12.0, 12.3)], ["gaps of the force", "are filled"])])
def test_gaps_of_a_known_force_are_filled_or_part_the_record(twenty_seconds, where, words):
    """K is that of the whole record, within what it is known by; the true force in the gaps is not looked at."""
    record, whole = twenty_seconds
    force = np.array(record.channels["Heave_force"])
    for start, end in where:
        force[(record.time > start) & (record.time < end)] = np.nan
    found = identify(tank(), record.with_channels(Heave_force=force), "prediction-error", omega=BAND, draws=100)
    assert all(any(word in text for text in found.warnings) for word in words), found.warnings
    off = (found.B.mean - whole.B.mean)[:, 0, 0] / (whole.B.upper - whole.B.lower)[:, 0, 0]
    assert np.abs(off).max() < 0.5


def test_a_tolerance_may_be_any_real_number():
    record, _ = sail(tank(), 10.0, np.random.default_rng(0))
    found = [identify(tank(), record, "prediction-error", omega=[7.0], draws=20, tolerance=number(0.03)).B.mean
             for number in (float, np.float64)]
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(("channels", "message"), [
    ({"Heave": np.ones(400), "Heave_force": np.zeros(400)}, "constant"),
    ({"Sway": np.arange(400.0)}, "no motion of Heave"),
    ({"Heave": np.sin(np.arange(400))}, "force is not known"),
    ({"Heave": np.sin(np.arange(400)), "Heave_force": np.where(np.arange(400) % 25 < 9, np.nan, np.arange(400.0))},
     "has gaps, and no part between them is long enough")])
def test_bad_records_are_named(channels, message):
    with pytest.raises(InputError, match=message):
        identify(tank(), Record(0.05 * np.arange(400), channels), "prediction-error")


@pytest.mark.parametrize("channels", [
    {"Heave": np.sin(0.3 * np.arange(400)), "Heave_velocity": np.cos(0.3 * np.arange(400))},      # units contradict
    {"Heave": np.sin(3e-4 * np.arange(400))}, {"Heave": np.zeros(400)}, {"Heave": np.full(400, np.nan)},
    {"Heave": np.sin(0.3 * np.arange(400)), "Heave_force": np.full(400, np.nan)},
    {"Heave": np.sin(0.3 * np.arange(400)), "Heave_force": np.full(400, np.nan), "wave_elevation": np.ones(400)}])
def test_a_force_that_is_not_there_is_told_before_anything_else(channels):
    """Each record has other faults, too, and is given twice."""
    record = Record(0.001 * np.arange(400), channels, kind="waves")
    lacking = "column Heave_force is empty" if "Heave_force" in channels else "no Heave_force among its columns Heave"
    with pytest.raises(InputError, match=rf"^record record: the force is not known \({lacking}.* needs none$"):
        identify(tank(), [record, record], "prediction-error")


def test_one_force_of_two_that_is_not_there_is_told_before_anything_else():
    still = {"Sway": np.zeros(400), "Roll": np.zeros(400), "Sway_force": np.zeros(400)}
    with pytest.raises(InputError, match="Roll_force is missing while other forces are there"):
        identify(sway_roll(), Record(0.05 * np.arange(400), still), "prediction-error")


def test_a_static_test_is_said_to_have_no_radiation():
    offsets = Record(np.arange(9.0), {"Heave": np.linspace(-0.1, 0.1, 9), "Heave_force": np.linspace(-60.0, 60.0, 9)},
                     kind="static")
    for method in ("prediction-error", "spectral", "dual-enkf"):
        with pytest.raises(InputError, match="no motion that radiates"):
            identify(tank(), offsets, method)


def test_uncoupled_groups_are_identified_apart_and_coupled_ones_together():
    model = sway_roll()
    form = parametrise(model.fit, model.A_inf, 0.15)
    rng = np.random.default_rng(4)
    theta = form.theta(0.7 * rng.standard_normal(form.active.size))
    truth = form.realise(theta)
    dt, nt = 0.1, 450
    w = 2.0 * np.pi / (4.0 * nt * dt) * np.arange(1, 400)
    F = (rng.standard_normal((w.size, 2)) + 1j * rng.standard_normal((w.size, 2))) * np.exp(-((w - 1.5) ** 2))[:, None]
    Z = -(w**2)[:, None, None] * (model.M + model.A_inf) + 1j * w[:, None, None] * truth.frequency_response(w) + model.C
    wave = np.exp(1j * np.outer(dt * np.arange(nt), w))
    f, y = (wave @ F).real, (wave @ np.linalg.solve(Z, F[:, :, None])[:, :, 0]).real
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    channels = {"Sway": y[:, 0], "Roll": y[:, 1], "Sway_force": f[:, 0], "Roll_force": f[:, 1]}
    record = Record(dt * np.arange(nt), channels)
    at = np.linspace(0.8, 2.5, 12)
    found = identify(model, record, "prediction-error", omega=at)
    true, start = truth.frequency_response(at), model.fit.frequency_response(at)
    assert np.linalg.norm(found.K.mean - true) < 0.3 * np.linalg.norm(start - true)
    assert uncoupled(model) == [[0, 1]]
    diagonal = Model(model.dofs, np.diag([50.0, 4.0]), np.diag([20.0, 1.0]), np.diag([100.0, 30.0]),
                     RadiationFit(model.dofs, np.diag([-1.0, -2.0]), np.eye(2), np.eye(2), order=1))
    assert uncoupled(diagonal) == [[0], [1]]
    both = np.ones((2, 2))      # rounding, where nothing restores the one and only the other radiates
    heave = RadiationFit(model.dofs, [[-1.0]], [[1e-9, 1.0]], [[1e-9], [1.0]], order=1)
    assert uncoupled(diagonal.replace(C=np.diag([0.0, 30.0]) + 1e-12 * both, D=1e-12 * both, fit=heave)) == [[0], [1]]
    part = form.part([1])
    np.testing.assert_allclose(part.K(theta, at)[:, 0, 0], form.K(theta, at)[:, 1, 1])
    assert part.involved.sum() == 4


def test_a_double_pole_of_the_model_stays_in_the_prior_mean():
    # (2 s + 1) / (s + 2)^2: poles split by 1e-4 move a double pole's term by that, the sum of residues would lose it.
    fit = RadiationFit(("Heave",), [[-4.0, -4.0], [1.0, 0.0]], [[1.0], [0.0]], [[2.0, 1.0]], order=2)
    form, w = parametrise(fit, np.eye(1), 0.15), np.geomspace(0.1, 20.0, 30)
    np.testing.assert_allclose(form.K(form.mean, w), fit.frequency_response(w), atol=1e-3)


def test_a_simulated_record_without_noise_has_an_answer():
    """Three sines through the transfer function itself, no integrator: nothing is left for noise to explain."""
    model = tank_model()
    plant = model.to_ss()["heave", "heave_force"]
    time = np.arange(0.0, 30.0, 0.05)
    waves = [2.0 * np.exp(1j * w * time) for w in (5.0, 7.0, 8.5)]
    heave = sum((plant(1j * w) * x).real for w, x in zip((5.0, 7.0, 8.5), waves))
    record = Record(time, {"Heave": heave, "Heave_force": sum(x.real for x in waves)})
    found = identify(model, record, "prediction-error", omega=[7.0], draws=50)
    truth = model.fit.frequency_response(np.array([7.0])).real[0, 0, 0]
    assert found.B.lower[0, 0, 0] < truth < found.B.upper[0, 0, 0]


@pytest.mark.parametrize("share", [-0.06, 0.05])
def test_the_band_of_the_added_mass_holds_what_the_records_say_of_A_inf(share):
    start = tank()
    truth = start.replace(A_inf=(1.0 + share) * start.A_inf)
    record, _ = sail(truth, 100.0, np.random.default_rng(0))
    omega = np.array([5.0, 7.0, 9.0])
    found = identify(start, record, "prediction-error", omega=omega, tolerance={"A_inf": 0.05, "mass": 0.01})
    A = truth.A_inf[0, 0] + truth.fit.frequency_response(omega)[:, 0, 0].imag / omega
    band = found.A
    assert np.all((band.lower[:, 0, 0] < A) & (A < band.upper[:, 0, 0]))
    assert np.all(np.abs(band.mean[:, 0, 0] - A) < 0.3 * abs(share) * A)
    held = identify(start, record, "prediction-error", omega=omega, tolerance={"A_inf": 0.0, "mass": 0.05}).A
    assert np.all(np.abs(held.mean[:, 0, 0] - A) > 0.5 * abs(share) * start.A_inf[0, 0])     # all of it is the mass's


@pytest.mark.parametrize("seed, drift", [*((k, 0.0) for k in some(range(3))), *((k, 2.0) for k in some([3, 4]))])
def test_a_moored_body_that_swings_far_slower_than_its_waves_is_seen_at_their_frequency(seed, drift):
    """From rest; the free motion, of 7.4 s, has most of the energy, and the sea 1 to 2 s. The model is the truth.

    Or a force of 40 to 120 s, of the rms `drift` over the waves', that no column has, moves it most.
    """
    F = np.array([[0.0, 1.0, 0.0, 0.0], [-0.72, -0.003, 0.0, -4.0 / 3.0], [0.0, 0.0, 0.0, 1.0], [0.0, 1.0, -9.0, -3.0]])
    G = np.array([[0.0], [1.0 / 3.0], [0.0], [0.0]])  # states: displacement, velocity, two of the radiation
    fit = RadiationFit(("Surge",), F[2:, 2:], np.array([[0.0], [1.0]]), np.array([[0.0, 4.0]]), 2)
    model = Model(("Surge",), [[2.0]], [[1.0]], [[2.16]], fit, D=[[0.009]])
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(20000)
    w = rng.uniform(3.0, 6.0, 40)
    force = 0.3 * np.cos(np.outer(time, w) + rng.uniform(0.0, 2.0 * np.pi, 40)).sum(axis=1)
    slow = np.cos(np.outer(time, 0.85 / rng.uniform(5.0, 16.0, 12)) + rng.uniform(0.0, 2.0 * np.pi, 12)).sum(axis=1)
    pushed = (force + drift * 0.3 * np.sqrt(40.0 / 12.0) * slow)[:, None]
    moved = dlsim(cont2discrete((F, G, np.eye(4)[:1], np.zeros((1, 1))), 0.01, method="foh"), pushed)[1][:, 0]
    record = Record(time[::5], {"Surge": (moved + 0.005 * moved.std() * rng.standard_normal(time.size))[::5],
                                "Surge_force": force[::5]}, kind="waves")
    omega = np.linspace(3.0, 6.0, 20)
    found = identify(model, record, "prediction-error", omega=omega, draws=100)
    truth = model.fit.frequency_response(omega)
    assert np.linalg.norm(found.K.mean - truth) < 0.1 * np.linalg.norm(truth)
    inside = (found.B.lower <= truth.real) & (truth.real <= found.B.upper)
    assert inside.mean() > 0.9
    assert not any("the records ask for" in text for text in found.warnings)


def test_of_decays_alone_a_wrong_stiffness_is_told_as_one_of_two():
    F = np.array([[0.0, 1.0, 0.0, 0.0], [-3.2, 0.0, 0.0, -4.0 / 3.0], [0.0, 0.0, 0.0, 1.0], [0.0, 1.0, -9.0, -3.0]])
    fit = RadiationFit(("Heave",), F[2:, 2:], np.array([[0.0], [1.0]]), np.array([[0.0, 4.0]]), 2)
    model, rng, step = Model(("Heave",), [[2.0]], [[1.0]], [[8.0]], fit), np.random.default_rng(0), expm(0.05 * F)
    states = np.array([np.linalg.matrix_power(step, k) @ [0.3, 0.0, 0.0, 0.0] for k in range(500)])
    record = Record(0.05 * np.arange(500), {"Heave": states[:, 0] + 2e-4 * rng.normal(size=500)}, kind="decay")
    warnings = identify(model, record, "prediction-error", draws=50).warnings
    assert any("the records ask for" in text and "decays tell their ratio alone" in text for text in warnings)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_record_of_a_few_samples_is_refused_by_their_number(count):
    moved = np.sin(np.arange(count))
    with pytest.raises(InputError, match=f"{count} samples; at least 20 are needed"):
        identify(tank(), Record(0.05 * np.arange(count), {"Heave": moved, "Heave_force": moved}), "prediction-error")
