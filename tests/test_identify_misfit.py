"""`identify` says so when a linear model with noise cannot explain a record, and is silent when it can."""

import numpy as np
import pytest
from identify_studies import decay, warned
from identify_tank import BAND, drawn_truth, jonswap, sail, tank, with_waves
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag
from seeds import some

import radiation_ss as rss
from radiation_ss import Record, identify
from radiation_ss.identification import Law, MotionLikelihood, known_force, motion_channels
from radiation_ss.inference import parametrise

DRAG = 400.0    # N s^2/m^2


def test_sound_records_are_not_warned_of():
    """By a chance of 1e-4 for a record: one of eight bodies that `benchmarks/identify_seeds.py` tries."""
    assert not warned(0)


@pytest.mark.parametrize("seed", some(range(4)))
def test_drag_is_warned_of(seed):
    rng = np.random.default_rng(seed)
    body = drawn_truth(tank(), rng)
    record, _ = sail(body, 30.0, rng)
    y = rss.simulate(body, record, [("quadratic_drag", "Heave", {"coefficient": DRAG})]).outputs[0]
    dragged = record.with_channels(Heave=y + 0.01 * y.std() * rng.standard_normal(y.size))
    # What drag leaves beside its best linear damping (Gaussian motion: 1 - 8/(3 pi) of its
    # mean square) is not small: it is above the force noise of 1 %: there is something to see.
    velocity = np.gradient(y, record.time)
    assert np.sqrt(1.0 - 8.0 / (3.0 * np.pi)) * DRAG * np.std(velocity * np.abs(velocity)) > 0.01 * np.std(
        record.channels["Heave_force"])
    found = identify(tank(), dragged, "prediction-error", omega=BAND, draws=50)
    assert any("does not look linear" in text and "quadratic drag [Heave]" in text for text in found.warnings)
    assert found.baseline["nonlinearity_test"]["quadratic drag [Heave]"]["estimate"] > 0.0


@pytest.mark.parametrize(("drag", "lost"), [(200.0, 0.0), (800.0, 0.01)])
def test_drag_is_named_with_its_size(drag, lost):
    """Not the first step from a linear fit, which has put part of the drag down to other parameters."""
    rng, body = np.random.default_rng(3), tank()
    record, _ = sail(body, 60.0, rng)
    F, G = body.matrices()
    time, force = record.time, record.channels["Heave_force"]
    known = CubicSpline(time, force)
    state = solve_ivp(lambda t, x: F @ x + G[:, 0] * (known(t) - drag * abs(x[-1]) * x[-1]), time[[0, -1]],
                      np.zeros(F.shape[0]), t_eval=time, rtol=1e-8, atol=1e-10).y
    heave = state[-2] + 0.005 * state[-2].std() * rng.standard_normal(time.size)
    heave[rng.random(time.size) < lost] = np.nan
    found = identify(tank(), Record(time, {"Heave": heave, "Heave_force": force}), "prediction-error", omega=BAND,
                     draws=50)
    row = found.baseline["nonlinearity_test"]["quadratic drag [Heave]"]
    assert row["estimate"] == pytest.approx(drag, rel=0.1)
    assert row["std"] < 0.1 * drag
    assert any("N s^2/m^2 (p" in text for text in found.warnings)


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_dry_friction_is_named_with_its_size(friction):
    """Without it in the list, a negative drag or a cubic stiffness was asked for."""
    body, time, rng = tank(), 0.05 * np.arange(300), np.random.default_rng(7)
    F, G = body.matrices()
    start = np.zeros(F.shape[0])
    start[-2] = 0.03
    heave = solve_ivp(lambda t, x: F @ x - G[:, 0] * friction * np.tanh(x[-1] / 1e-3), time[[0, -1]], start,
                      t_eval=time, rtol=1e-7, atol=1e-9, method="LSODA").y[-2]
    record = Record(time, {"Heave": heave + 1e-4 * rng.standard_normal(time.size)}, kind="decay")
    found = identify(body, record, "prediction-error", omega=BAND, draws=50)
    (said,) = [text for text in found.warnings if "does not look linear" in text]
    assert "dry friction [Heave]" in said
    assert found.baseline["nonlinearity_test"]["dry friction [Heave]"]["estimate"] == pytest.approx(friction, rel=0.2)


@pytest.mark.parametrize("drag", [0.0, 400.0])
def test_drag_is_named_by_the_elevation_too(drag):
    """The truth is an integration by scipy under the sum of |X| a cos(w t); the model's X is a tenth too large."""
    rng, body = np.random.default_rng(5), with_waves(tank())
    time, F, G = 0.05 * np.arange(800), *body.matrices()
    w = np.sort(rng.uniform(4.0, 13.0, 60))
    a = np.sqrt(2.0 * jonswap(w, hs=0.02) * 9.0 / 60.0) * np.exp(2j * np.pi * rng.random(60))
    waves = np.exp(1j * np.outer(time, w))
    X = np.interp(w, body.hydro.omega, body.hydro.X[:, 0, 0].real)
    elevation, force = (waves @ a).real, CubicSpline(time, (waves @ (X * a)).real)
    state = solve_ivp(lambda t, x: F @ x + G[:, 0] * (force(t) - drag * abs(x[-1]) * x[-1]), time[[0, -1]],
                      np.zeros(F.shape[0]), t_eval=time, rtol=1e-8, atol=1e-10).y
    heave = state[-2] + 0.01 * state[-2].std() * rng.standard_normal(time.size)
    believed = body.replace(hydro=body.hydro.replace(X=1.1 * body.hydro.X))
    found = identify(believed, Record(time, {"Heave": heave, "wave_elevation": elevation}, kind="waves"),
                     "prediction-error", omega=BAND, draws=200)
    named = any("quadratic drag [Heave]" in text for text in found.warnings)
    assert named == (drag > 0.0)
    row = found.baseline["nonlinearity_test"]["quadratic drag [Heave]"]
    assert abs(row["estimate"] - drag) < 4.0 * row["std"] + 0.1 * drag  # in proportion to a force a tenth too large
    B = body.fit.frequency_response(BAND)[:, 0, 0].real
    held = (found.B.lower[:, 0, 0] <= B) & (B <= found.B.upper[:, 0, 0])
    assert held[(BAND > 4.5) & (BAND < 8.0)].mean() > 0.6


def test_numbers_that_only_the_elevation_asks_for_may_be_X():
    rng, body = np.random.default_rng(5), with_waves(tank())
    time, w = 0.05 * np.arange(1600), np.sort(rng.uniform(4.0, 13.0, 60))
    a = np.sqrt(2.0 * jonswap(w, hs=0.02) * 9.0 / 60.0) * np.exp(2j * np.pi * rng.random(60))
    X = np.interp(w, body.hydro.omega, body.hydro.X[:, 0, 0].real)
    K, waves = body.fit.frequency_response(w)[:, 0, 0], np.exp(1j * np.outer(time, w))
    receptance = 1.0 / (body.C[0, 0] + 1j * w * K - w**2 * (1.2 * body.M + body.A_inf)[0, 0])
    heave, elevation, force = ((waves @ (part * a)).real for part in (X * receptance, 1.0, X))
    heave = heave + 0.01 * heave.std() * rng.standard_normal(time.size)
    asked = {}
    for name, column in (("wave_elevation", elevation), ("Heave_force", force)):
        record = Record(time, {"Heave": heave, name: column}, kind="waves")
        found = identify(body, record, "prediction-error", omega=BAND, draws=200)
        asked[name] = [text for text in found.warnings if "the records ask for" in text and "tolerance" in text]
    assert asked["wave_elevation"] and "X with the damping" in asked["wave_elevation"][0]
    assert asked["Heave_force"] and "X" not in asked["Heave_force"][0]


@pytest.mark.parametrize("factor", [3.0, 1.0 / 3.0])
def test_a_force_of_the_wrong_size_is_said_of_X_and_leaves_the_kernel_alone(factor):
    """The elevation's force has a size that motion shows: a stated gain a few times off is X, not the motion sensor."""
    rng, truth = np.random.default_rng(7), with_waves(tank())
    time, w = 0.05 * np.arange(800), np.sort(rng.uniform(4.0, 13.0, 60))
    a = 2e-3 * np.exp(2j * np.pi * rng.random(60))
    X = np.interp(w, truth.hydro.omega, truth.hydro.X[:, 0, 0].real)
    K, waves = truth.fit.frequency_response(w)[:, 0, 0], np.exp(1j * np.outer(time, w))
    receptance = 1.0 / (truth.C[0, 0] + 1j * w * K - w**2 * (truth.M + truth.A_inf)[0, 0])
    heave, elevation = (waves @ (X * receptance * a)).real, (waves @ a).real
    record = Record(time, {"Heave": heave + 0.01 * heave.std() * rng.standard_normal(time.size),
                           "wave_elevation": elevation}, kind="waves")
    believed = truth.replace(hydro=truth.hydro.replace(X=factor * truth.hydro.X))
    found = identify(believed, record, "prediction-error", omega=BAND, draws=200)
    asked = [text for text in found.warnings if "the records ask for" in text]
    assert len(asked) == 1 and "force [Heave]" in asked[0] and "X" in asked[0]
    row = found.parameters["force [Heave]"]
    assert abs(row["mean"] + 1.0 - 1.0 / factor) < 3.0 * row["std"]
    inside, K = (BAND > 4.5) & (BAND < 12.0), truth.fit.frequency_response(BAND)[:, 0, 0]
    assert np.linalg.norm((found.K.mean[:, 0, 0] - K)[inside]) < 0.1 * np.linalg.norm(K[inside])


def test_motion_that_laws_are_made_of_is_the_true_one_from_the_first_sample_on():
    """At the start a prediction is the prior's zero: the velocity by it was off by the motion's own size."""
    body, t = tank(), np.arange(0.0, 20.0, 0.05)
    form, w = parametrise(body.fit, body.A_inf, 0.15), np.array([5.0, 6.5, 8.0])
    X = (body.C - w[:, None, None] ** 2 * (body.M + body.A_inf)
         + 1j * w[:, None, None] * body.fit.frequency_response(w))[:, 0, 0]
    wave = np.exp(1j * (np.outer(t, w) + [0.3, 1.0, 2.0]))
    x, force = wave.real.sum(axis=1), (wave @ X).real
    noise = 0.01 * x.std() * np.random.default_rng(0).standard_normal(t.size)
    record = Record(t, {"Heave": x + noise, "Heave_force": force})
    channels, known = motion_channels(body, record), known_force(body, record)
    part = MotionLikelihood(body, form, channels, known)
    off = part.filtered(np.zeros(form.size), np.zeros(part.size))[:, 0] + np.mean(x + noise) - x
    assert np.abs(off).max() < 0.04 * x.std() and np.std(off) < 0.8 * noise.std()


def test_score_of_a_force_is_the_likelihood_s_slope():
    body, rng = tank(), np.random.default_rng(0)
    form = parametrise(body.fit, body.A_inf, 0.15)
    record = decay(body, 1)
    channels, force = motion_channels(body, record), known_force(body, record)
    part = MotionLikelihood(body, form, channels, force)
    u, v = 0.2 * rng.standard_normal(6), np.zeros(part.size)
    law = Law("any", 1e-3 * rng.standard_normal(force.shape), 1.0)
    ((score, information, cross),) = part.scores_of([law], u, v)

    def value(step):
        moved, at = part.with_law(law, v, step)
        return moved.value(u, at)

    assert score == pytest.approx((value(0.5) - value(-0.5)), rel=1e-6)
    assert -information == pytest.approx(value(1.0) + value(-1.0) - 2.0 * value(0.0), rel=1e-4)
    assert cross.shape == (6 + part.size,)


@pytest.mark.parametrize("kind, damper", [("decay", 13.0), ("forced", 26.0)])  # the waves' own is 26 at most
def test_a_damper_that_the_model_lacks_is_no_radiation(kind, damper):
    """By SciPy's integrator."""
    model, rng = tank(), np.random.default_rng(1)
    fit, m = model.fit, model.fit.states
    inertia, C = float((model.M + model.A_inf)[0, 0]), float(model.C[0, 0])
    time = np.arange(0.0, 8.0 if kind == "decay" else 30.0, 0.02)
    phases, omega = rng.uniform(0.0, 6.28, 30), rng.uniform(4.0, 10.0, 30)
    push = 0.0 if kind == "decay" else 0.5 * np.cos(np.outer(time, omega) + phases).sum(axis=1)
    force = CubicSpline(time, push + 0.0 * time)

    def rate(t, s):
        x, v = s[m:]
        pull = fit.c[0] @ s[:m] + model.D[0, 0] * v + damper * v + C * x
        return [*(fit.a @ s[:m] + fit.b[:, 0] * v), v, (force(t) - pull) / inertia]

    start = np.r_[np.zeros(m), 0.02 if kind == "decay" else 0.0, 0.0]
    heave = solve_ivp(rate, time[[0, -1]], start, t_eval=time, rtol=1e-9, atol=1e-12, max_step=0.02).y[m]
    heave = heave + 2e-3 * heave.std() * rng.standard_normal(time.size)
    record = Record(time, {"Heave": heave} | ({} if kind == "decay" else {"Heave_force": force(time)}), kind=kind)
    found = identify(model, record, "prediction-error", omega=BAND, draws=200)
    B = model.fit.frequency_response(BAND).real
    assert np.all(np.abs(found.B.mean - B) < 3.0 * (found.B.upper - found.B.lower) / 3.92)
    row = found.parameters["damping [Heave]"]
    assert abs(row["mean"] - damper) < 3.0 * row["std"] < damper
    (told,) = (text for text in found.warnings if "linear damping [Heave]" in text)
    assert "waves do not carry away" in told and not any("not look linear" in text for text in found.warnings)
    (plant,) = found.plants(1)
    known = found.form.rigid(found.u, model.M + model.A_inf, model.C)[0][0, 0, 0]
    drawn = found.damping["damping [Heave]"]
    assert -plant.A[-1, -1] * known == pytest.approx(float(model.D[0, 0]) + drawn[0], rel=1e-6)
    at_resonance = found.form.K(found.draws, [np.sqrt(C / inertia)])[:, 0, 0, 0].real
    assert np.std(drawn + at_resonance) < np.hypot(drawn.std(), at_resonance.std())  # what one takes the other leaves


@pytest.mark.parametrize("damper, order", [(0.0, 8), (0.3, 4)])  # the damper over the waves' own
def test_a_hump_of_the_damping_is_told_from_a_damper_whatever_the_order_of_the_fit(data, damper, order):
    """A published table and a quarter more damping about the natural frequency, causal, by Fourier series."""
    model = rss.read_model(data / "bem" / "formats" / "sphere_capytaine.nc", dofs=["Heave"], order=order)
    table, rng, count, dt = model.hydro, np.random.default_rng(3), 4000, 0.1
    omega, inertia, C = 2.0 * np.pi * np.fft.rfftfreq(count, dt)[1:], model.M[0, 0] + model.A_inf[0, 0], model.C[0, 0]
    natural, K, t = np.sqrt(C / inertia), table.K[:, 0, 0], np.linspace(0.0, 100.0, 4001)
    B, fine = np.interp(natural, table.omega, K.real), np.linspace(0.01, table.omega[-1], 1500)
    hump = 0.25 * np.interp(fine, table.omega, K.real) * np.exp(-0.5 * (np.log(fine / natural) / 0.3) ** 2)
    kernel = 2.0 / np.pi * np.trapezoid(hump * np.cos(np.outer(t, fine)), fine)
    more = np.array([np.trapezoid(kernel * np.exp(-1j * w * t), t) for w in fine])

    def true(w):
        return sum(np.interp(w, at, part.real) + 1j * np.interp(w, at, part.imag)
                   for at, part in ((table.omega, K), (fine, more)))

    inside = (omega > table.omega[0]) & (omega < table.omega[-1])
    push = np.exp(-2.0 * np.log(omega / natural) ** 2) * (rng.standard_normal((2, omega.size)).T @ [1.0, 1j]) * inside
    heave = push / (C - omega**2 * inertia + 1j * omega * (true(omega) + damper * B))
    force, heave = (np.fft.irfft(np.r_[0.0, some], count)[:2500] for some in (1e4 * push, 1e4 * heave))
    record = Record(dt * np.arange(2500), {
        "Heave": heave + 5e-3 * heave.std() * rng.standard_normal(2500), "Heave_force": force}, kind="forced")
    at = natural * np.linspace(0.6, 1.5, 7)
    found = identify(model, record, "prediction-error", omega=at, draws=300)
    deviation = (found.B.upper - found.B.lower)[:, 0, 0] / 3.92
    assert np.all(np.abs(found.B.mean[:, 0, 0] - true(at).real) < 3.0 * deviation)
    row = found.parameters.get("damping [Heave]", {"mean": 0.0, "std": 0.0})
    assert abs(row["mean"] - damper * B) <= 3.0 * row["std"] < 0.5 * B


@pytest.mark.parametrize("seed", some([1, 2]))
def test_radiation_far_off_is_no_damper(data, seed):
    """The model's radiation is 1 / 1.6 of the body's, by Fourier series: four deviations of its prior."""
    model = rss.read_model(data / "bem" / "formats" / "sphere_capytaine.nc", dofs=["Heave"], order=4)
    table, rng, count, dt = model.hydro, np.random.default_rng(seed), 4000, 0.1
    omega, inertia, C = 2.0 * np.pi * np.fft.rfftfreq(count, dt)[1:], model.M[0, 0] + model.A_inf[0, 0], model.C[0, 0]
    natural, K = np.sqrt(C / inertia), 1.6 * table.K[:, 0, 0]
    inside = (omega > table.omega[0]) & (omega < table.omega[-1])
    push = np.exp(-2.0 * np.log(omega / natural) ** 2) * (rng.standard_normal((2, omega.size)).T @ [1.0, 1j]) * inside
    heave = push / (C - omega**2 * inertia + 1j * omega * np.interp(omega, table.omega, K))
    force, heave = (np.fft.irfft(np.r_[0.0, some], count)[:600] for some in (1e4 * push, 1e4 * heave))
    record = Record(dt * np.arange(600), {
        "Heave": heave + 1e-2 * heave.std() * rng.standard_normal(600), "Heave_force": force}, kind="forced")
    at = natural * np.linspace(0.6, 1.5, 7)
    found, true = identify(model, record, "prediction-error", omega=at, draws=300), np.interp(at, table.omega, K).real
    deviation = (found.B.upper - found.B.lower)[:, 0, 0] / 3.92
    assert np.all(np.abs(found.B.mean[:, 0, 0] - true) < np.minimum(3.0 * deviation, 0.05 * true))
    assert not any("linear damping" in text for text in found.warnings)


@pytest.mark.parametrize("order", [2, 4])
def test_what_the_order_leaves_out_of_the_data_is_in_the_answer(order):
    """Two narrow humps of a tenth of the damping, by phasors: bands of B held half of what they should."""
    body, rng, time = with_waves(tank()), np.random.default_rng(4), 0.05 * np.arange(800)
    table, at = body.hydro, body.hydro.omega
    sizes = {centre: float(np.interp(centre, at, table.B[:, 0, 0])) for centre in (5.0, 7.5)}

    def humps(w):
        return sum(0.01 * B * 1j * w * c / (c**2 - w**2 + 0.1j * w * c) for c, B in sizes.items())

    more = humps(at)[:, None, None]
    data = table.replace(B=table.B + more.real, A=table.A + more.imag / at[:, None, None])
    model = body.replace(hydro=data, fit=rss.fit_radiation(data, order))
    omega = rng.uniform(4.0, 13.0, 60)
    waves = np.exp(1j * np.outer(time, omega)) * np.exp(2j * np.pi * rng.random(60))

    def true(w):
        return 1.05 * (body.fit.frequency_response(w)[:, 0, 0] + humps(w))

    inertia = (model.M + model.A_inf)[0, 0]
    heave = waves @ (1.0 / (model.C[0, 0] - omega**2 * inertia + 1j * omega * (true(omega) + model.D[0, 0])))
    clean = heave.real, waves.real.sum(axis=1)
    reads = [read + 0.005 * read.std() * rng.standard_normal(time.size) for read in clean]
    record = Record(time, dict(zip(("Heave", "Heave_force"), reads)), kind="forced")
    found = identify(model, record, "prediction-error", omega=BAND, draws=300)
    B = true(BAND).real
    assert np.mean((found.B.lower[:, 0, 0] < B) & (B < found.B.upper[:, 0, 0])) > 0.85


@pytest.mark.parametrize("damper", [0.0, 4.0])  # the waves' own is 26 at most, X's tolerance a tenth of it
def test_a_small_damper_in_waves_is_in_the_bands(damper):
    """The truth by Fourier series: X follows B, so the damper may be taken for radiation, and is weighed against it."""
    model, rng, count, dt = with_waves(tank()), np.random.default_rng(5), 3000, 0.05
    omega = 2.0 * np.pi * np.fft.rfftfreq(count, dt)[1:]
    K, table = model.fit.frequency_response(omega)[:, 0, 0], model.hydro
    X = np.interp(omega, table.omega, table.X[:, 0, 0].real) + 1j * np.interp(omega, table.omega, table.X[:, 0, 0].imag)
    waves = np.exp(-0.5 * ((omega - 6.0) / 1.5) ** 2) * (rng.standard_normal((2, omega.size)).T @ [1.0, 1j])
    inertia = (model.M + model.A_inf)[0, 0]
    heave = X * waves / (model.C[0, 0] - omega**2 * inertia + 1j * omega * (K + model.D[0, 0] + damper))
    eta, heave = (np.fft.irfft(np.r_[0.0, some], count)[:1250] for some in (waves, heave))
    record = Record(dt * np.arange(1250), {
        "Heave": heave + 2e-3 * heave.std() * rng.standard_normal(1250), "wave_elevation": eta}, kind="waves")
    found = identify(model, record, "prediction-error", omega=BAND, draws=400)
    B = model.fit.frequency_response(BAND).real
    assert np.mean((found.B.lower < B) & (B < found.B.upper)) == 1.0
    assert not any("linear damping" in text for text in found.warnings)


@pytest.mark.parametrize(("gain", "late"), [(0.8, 0.0), (1.25, 0.05)])
def test_size_and_delay_of_the_recorded_force_are_named(gain, late):
    """By phasors. Both went into mass, stiffness and radiation, whose bands then held a third of B."""
    model, rng, time = tank(), np.random.default_rng(1), 0.05 * np.arange(600)
    omega = rng.uniform(4.0, 13.0, 60)
    waves = np.exp(1j * np.outer(time, omega)) * np.exp(2j * np.pi * rng.random(60))
    K, force = model.fit.frequency_response(omega)[:, 0, 0], np.exp(-0.5 * ((omega - 6.5) / 1.5) ** 2)
    inertia = (model.M + model.A_inf)[0, 0]
    heave = (waves @ (force / (model.C[0, 0] - omega**2 * inertia + 1j * omega * (K + model.D[0, 0])))).real
    column = gain * (waves @ (force * np.exp(-1j * omega * late))).real
    noisy = [read + 0.01 * read.std() * rng.standard_normal(time.size) for read in (heave, column)]
    record = Record(time, dict(zip(("Heave", "Heave_force"), noisy)), kind="forced")
    found = identify(model, record, "prediction-error", omega=BAND, draws=300)
    B = model.fit.frequency_response(BAND).real
    assert np.mean((found.B.lower < B) & (B < found.B.upper)) > 0.85
    told = " ".join(text for text in found.warnings if "the recorded force does not fit the motion" in text)
    for name, size in (("force gain", 1.0 / gain - 1.0), ("late force", late)):
        assert (f"{name} [Heave]" in told) == (size != 0.0)
        if size:
            row = found.baseline["nonlinearity_test"][f"{name} [Heave]"]
            assert abs(row["estimate"] - size) < 3.0 * row["std"] < abs(size)


def test_an_accelerometer_tells_as_much_as_a_displacement():
    """By phasors: to the force at a sample, not to its mean since the last one, the acceleration answers at once."""
    model, rng, time = tank(), np.random.default_rng(1), 0.05 * np.arange(800)
    omega = rng.uniform(4.0, 13.0, 60)
    waves = np.exp(1j * np.outer(time, omega)) * np.exp(2j * np.pi * rng.random(60))
    K, B = model.fit.frequency_response(omega)[:, 0, 0], model.fit.frequency_response(BAND).real
    inertia = (model.M + model.A_inf)[0, 0]
    response = -omega**2 / (model.C[0, 0] - omega**2 * inertia + 1j * omega * (K + model.D[0, 0]))
    read = (waves @ response).real
    read = read + 0.01 * read.std() * rng.standard_normal(time.size)
    record = Record(time, {"Heave_acceleration": read, "Heave_force": waves.real.sum(axis=1)}, kind="forced")
    found = identify(model, record, "prediction-error", omega=BAND, draws=300)
    assert np.mean((found.B.lower < B) & (B < found.B.upper)) > 0.9
    for name in ("inertia [Heave]", "stiffness [Heave]", "sensor [Heave]"):
        row = found.parameters[name]
        assert abs(row["mean"]) < 3.0 * max(row["std"], 0.1 * row["prior_std"])


@pytest.mark.parametrize("load", [0.0, 0.5])
def test_a_free_surge_is_identified_however_far_it_drifts(load):
    """By SciPy's integrator, metres away from where it began: it was refused, of one period of the motion."""
    fit = rss.RadiationFit(("Surge",), [[0.0, 1.0], [-9.0, -2.4]], [[0.0], [1.0]], [[0.0, 60.0]], order=2)
    model, rng, time = rss.Model(("Surge",), [[60.0]], [[20.0]], [[0.0]], fit), np.random.default_rng(1), np.arange(
        0.0, 60.0, 0.05)
    omega, phase = rng.uniform(1.5, 6.0, 25), rng.uniform(0.0, 6.28, 25)

    def force(t):
        return 6.0 * np.cos(np.multiply.outer(t, omega) + phase).sum(axis=-1)

    def rate(t, s):
        return [s[1], -9.0 * s[0] - 2.4 * s[1] + s[3], s[3], (force(t) + load - 66.0 * s[1]) / 80.0]

    surge = solve_ivp(rate, time[[0, -1]], np.zeros(4), t_eval=time, rtol=1e-9, atol=1e-11, max_step=0.05).y[2]
    record = Record(time, {"Surge": surge + 1e-3 * rng.standard_normal(time.size), "Surge_force": force(time)},
                    kind="forced")
    found = identify(model, record, "prediction-error", omega=np.linspace(1.5, 6.0, 20), draws=200)
    B = 1.1 * fit.frequency_response(found.omega).real
    assert np.ptp(surge) > 3.0 * (load > 0.0)
    assert np.mean((found.B.lower < B) & (B < found.B.upper)) > 0.85


def test_a_damper_between_two_bodies_is_found():
    """A power take-off between bodies that a spring couples; by SciPy's integrator."""
    one, rng, spring, damper = tank(), np.random.default_rng(3), 60.0, 20.0
    dofs, m = ("a__Heave", "b__Heave"), one.fit.states
    a, b, c = (block_diag(part, part) for part in (one.fit.a, one.fit.b, one.fit.c))
    joint = spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = rss.Model(dofs, np.diag([1.0, 1.5]) * one.M, np.eye(2) * one.A_inf, np.eye(2) * one.C + joint,
                      rss.RadiationFit(dofs, a, b, c, m))
    inertia, D = np.linalg.inv(model.M + model.A_inf), damper / spring * joint
    time = np.arange(0.0, 20.0, 0.08)
    phases, omega = rng.uniform(0.0, 6.28, (30, 2)), rng.uniform(4.0, 10.0, (30, 2))
    force = CubicSpline(time, 0.5 * np.cos(time[:, None, None] * omega + phases).sum(axis=1))

    def rate(t, s):
        x, v = s[2 * m:2 * m + 2], s[2 * m + 2:]
        return [*(a @ s[:2 * m] + b @ v), *v, *(inertia @ (force(t) - c @ s[:2 * m] - D @ v - model.C @ x))]

    moved = solve_ivp(rate, time[[0, -1]], np.zeros(2 * m + 4), t_eval=time, rtol=1e-8, atol=1e-11, max_step=0.04).y
    read = moved[2 * m:2 * m + 2]
    read = read + 5e-3 * read.std(axis=1)[:, None] * rng.standard_normal(read.shape)
    record = Record(time, dict(zip(dofs, read)) | {f"{dof}_force": row for dof, row in zip(dofs, force(time).T)},
                    kind="forced")
    found = identify(model, record, "prediction-error", omega=BAND, draws=50)
    rows = {name: row for name, row in found.parameters.items() if name.startswith("damping [")}
    (row,) = rows.values()
    between = (10.0 * 0.08) ** 2 / 12.0 * damper  # the law's force is a straight line from sample to sample
    assert "damping [a__Heave,b__Heave]" in rows and abs(row["mean"] - damper) < 3.0 * row["std"] + between


def test_frequencies_are_the_results_own():
    omega = np.array([5.0, 6.0])
    found = identify(tank(), [], "points", points=[6.0], omega=omega)
    omega[:] = 1.0
    assert found.omega.tolist() == [5.0, 6.0]
