"""Errors of sensors that no model states, forces that set in late or follow the waves, and coefficients at odds."""

import dataclasses

import numpy as np
import pytest
from fit_systems import data_of, random_passive
from plant_bodies import tank_model
from scipy.integrate import odeint, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import lfilter
from seeds import some

import radiation_ss as rss
from radiation_ss.diagnosis import contradiction
from radiation_ss.inference import measured_motion


def roll():
    return rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.01)


def heave():
    return rss.body(dof="Heave", mass=2.0, added_mass=1.0, C=8.0, damping_ratio=0.05)


def driven(model, rng, periods=60, force=lambda t, x, v: 0.0):
    """Fine times, an irregular force and the motion by a library integrator; `force` is one more against it."""
    total, C, D = (float(part[0, 0]) for part in (model.M + model.A_inf, model.C, model.D))
    w = np.sqrt(C / total)
    time = np.arange(0.0, periods * 2 * np.pi / w, 2 * np.pi / w / 240)
    waves, phase, size = w * np.exp(rng.uniform(-0.7, 0.7, 60)), rng.uniform(0, 6.28, 60), rng.normal(size=60)
    pull = 0.0125 * C * np.cos(np.outer(time, waves) + phase) @ size * np.clip(time * w / 20.0, 0, 1)
    at = CubicSpline(time, pull)

    def rate(t, s):
        x, v = s.tolist()
        return v, (float(at(t)) - D * v - C * x - force(t, x, v)) / total

    # LSODA; solve_ivp's answer to 2e-7, 1e-5 with stops, in a sixth of the time: longer than a diagnosis of it took.
    moved = odeint(rate, [0.0, 0.0], time, tfirst=True, rtol=1e-9, atol=1e-11, hmax=time[1] * 8)[:, 0]
    return time, at, CubicSpline(time, moved)


def recorded(model, rng, kind, name):
    """A record of 30 samples a period with 3 % noise of the motion itself, or times that are off by .4 samples."""
    time, force, moved = driven(model, rng)
    even = time[::8][:-1]
    jitter = 0.4 * even[1] * rng.uniform(-1, 1, even.size) if kind == "jitter" else 0.0
    read = moved(np.clip(even + jitter, 0.0, time[-1])) * (1 + (kind == "noise") * 0.03 * rng.normal(size=even.size))
    read += 0.001 * np.std(read) * rng.normal(size=even.size)
    dof = model.dofs[0]
    return rss.Record(even, {dof: read, f"{dof}_force": force(even)}, kind="forced", name=name)


@pytest.mark.parametrize("kind", ["noise", "jitter"])
def test_errors_that_grow_with_the_motion_are_no_gap(kind):
    answers = []
    for model, seeds in ((roll(), some([0, 1])), (heave(), some([1, 0]))):
        for seed in seeds:
            rng = np.random.default_rng(seed)
            seen, unseen = (recorded(model, rng, kind, name) for name in ("seen", "unseen"))
            answers.append(rss.diagnose(model, seen, withhold=unseen).verdict)
    assert not any(answer.effects for answer in answers)
    quiet = sum(answer.status == "no_gap" for answer in answers)
    assert quiet >= 0.75 * len(answers)  # three of four: an excess of two deviations is chance


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_zero_that_drifts_is_no_gap(seed):
    """By a tenth of the motion's rms to each side over the record, as the sensor warms up."""
    for model in (roll(), heave()):
        rng, dof, records = np.random.default_rng(seed), model.dofs[0], []
        for name in ("seen", "unseen"):
            record = recorded(model, rng, "still", name)
            motion = record.channels[dof]
            drift = 0.1 * motion.std() * np.linspace(-1.0, 1.0, motion.size)
            records.append(rss.Record(record.time, {**record.channels, dof: motion + drift}, kind="forced", name=name))
        assert rss.diagnose(model, records[0], withhold=records[1]).verdict.status == "no_gap"


RIVALS = ["quadratic_drag", "linear_damping", "linear_stiffness", "cubic_stiffness", "coulomb_friction", "slow_drift"]


@pytest.fixture(scope="module")
def dragged():
    """A record of a body with drag, and its diagnosis."""
    time, force, moved = driven(heave(), np.random.default_rng(7), force=lambda t, x, v: 6.0 * v * abs(v))
    even = time[::8]
    read = moved(even) + 0.005 * np.std(moved(even)) * np.random.default_rng(8).normal(size=even.size)
    whole = rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced", name="seen")
    return whole, rss.diagnose(heave(), whole, RIVALS)


@pytest.mark.parametrize("missing", [0.35, 1.3])
def test_a_stretch_without_readings_is_neither_guessed_nor_joined(dragged, missing):
    """Eight stretches of a third of a period, or three of more than one, in a record of a body with drag."""
    (whole, first), period = dragged, 2.0 * np.pi / np.sqrt(8.0 / 3.0)
    even = whole.time
    starts = np.linspace(0.2, 0.8, 8 if missing < 0.5 else 3) * even[-1]
    lost = np.any([(even > t) & (even < t + missing * period) for t in starts], axis=0)
    second = rss.diagnose(heave(), whole.with_channels(Heave=np.where(lost, np.nan, whole.channels["Heave"])),
                          RIVALS)
    assert [e.name for e in second.verdict.effects] == ["quadratic_drag"]
    value, std = second.verdict.effects[0].parameters["coefficient"]
    assert abs(value - 6.0) < 3.0 * std < 6.0
    assert second.budget.after < 2.0 * first.budget.after
    assert any("is not measured from" in note for note in second.notes) == (missing > 0.5)


def test_a_record_whose_readings_are_all_too_short_is_left_out_and_said_beside_others(dragged):
    whole, _ = dragged
    period = 2.0 * np.pi / np.sqrt(8.0 / 3.0)
    lost = whole.time % (2.0 * period) > 0.9 * period
    torn = dataclasses.replace(whole, name="torn").with_channels(Heave=np.where(lost, np.nan, whole.channels["Heave"]))
    found = rss.diagnose(heave(), [whole, torn], effects=["quadratic_drag"])
    assert [e.name for e in found.verdict.effects] == ["quadratic_drag"]
    assert any("torn" in note and note.endswith("it is left out.") for note in found.notes)
    with pytest.raises(rss.InputError, match="no stretch without gaps"):
        rss.diagnose(heave(), torn)


def test_a_part_of_nothing_but_noise_is_left_out_and_said(dragged):
    """Ten periods after the last reading of the motion the logger runs on, without force, for twenty more."""
    whole, first = dragged
    step, noise = whole.time[1], 0.005 * whole.channels["Heave"].std() * np.random.default_rng(9).normal(size=1200)
    later = whole.time[-1] + 10.0 * 2.0 * np.pi / np.sqrt(8.0 / 3.0) + step * np.arange(1200)
    time = np.concatenate([whole.time, later])
    channels = {"Heave": noise, "Heave_force": np.zeros(1200)}
    longer = rss.Record(time, {k: np.append(v, channels[k]) for k, v in whole.channels.items()}, kind="forced")
    found = rss.diagnose(heave(), longer, RIVALS)
    assert [e.name for e in found.verdict.effects] == [e.name for e in first.verdict.effects]
    assert any("holds only noise" in note for note in found.notes)


@pytest.mark.parametrize("zero", [0.0, 0.5, -2.0])
def test_a_zero_of_the_sensor_hides_no_drag_of_a_decay(zero):
    """`zero` in rms of the motion; the records are a decay to a twentieth and another one, withheld."""
    model, coefficient, records = heave(), 6.0, []
    total, C, D = (float(part[0, 0]) for part in (model.M + model.A_inf, model.C, model.D))
    time = np.linspace(0.0, 12.0 * 2.0 * np.pi * np.sqrt(total / C), 600)
    for name, start in (("seen", 0.1), ("unseen", 0.08)):
        moved = solve_ivp(lambda t, s: [s[1], -(D * s[1] + C * s[0] + coefficient * s[1] * abs(s[1])) / total],
                          time[[0, -1]], [start, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
        read = moved + 0.01 * moved.std() * np.random.default_rng(len(name)).normal(size=time.size)
        records.append(rss.Record(time, {"Heave": read + zero * moved.std()}, kind="decay", name=name))
    found = rss.diagnose(model, records[0], withhold=records[1])
    assert [effect.name for effect in found.verdict.effects] == ["quadratic_drag"]
    value, std = found.verdict.effects[0].parameters["coefficient"]
    assert abs(value - coefficient) < 3.0 * std < coefficient


@pytest.mark.parametrize("share, loss", [(0.6, 0.0), (0.85, 3.0)])
def test_end_stops_are_found_beside_a_slow_force(share, loss):
    """Stops near the end of the largest motion, as stiff as the body's restoring four times over, and a slow push."""
    model, rng = heave(), np.random.default_rng(5)
    time, force, moved = driven(model, rng)
    gap = share * float(np.abs(moved(time)).max())

    def extra(t, x, v):
        pressed = 32.0 * (max(x - gap, 0.0) - max(-x - gap, 0.0)) + loss * v * (abs(x) > gap)
        return pressed - 0.05 * gap * 8.0 * np.sin(2 * np.pi * t / time[-1])

    records = []
    for name, seed in (("seen", 5), ("unseen", 6)):
        time, force, moved = driven(model, np.random.default_rng(seed), force=extra)
        even = time[::8]
        read = moved(even) + 0.005 * np.std(moved(even)) * rng.normal(size=even.size)
        records.append(rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced", name=name))
    found = rss.diagnose(model, records[0], withhold=records[1])
    sets = found.verdict.indistinguishable or [[effect.name for effect in found.verdict.effects]]
    assert sets and all("end_stop" in labels for labels in sets)
    assert found.budget.unexplained < 0.05 < found.budget.before and found.budget.after < 0.3 * found.budget.before
    value, std = next(row for row in found.budget.rows if row.cause == "end_stop").parameters["gap"]
    assert 0.0 < std and abs(value - gap) < 0.1 * gap


@pytest.mark.parametrize("seed", some(range(4)))
def test_a_stop_is_as_stiff_as_it_is(seed):
    """Sharp stops ten times as stiff as the body's restoring, hit in most strokes."""
    gap = 0.5 * float(np.abs(driven(heave(), np.random.default_rng(seed))[2](np.linspace(0.0, 40.0, 900))).max())
    time, force, moved = driven(heave(), np.random.default_rng(seed), periods=25, force=lambda t, x, v: 80.0 * (
        max(x - gap, 0.0) - max(-x - gap, 0.0)))
    even = time[::8]
    read = moved(even) + 0.01 * np.std(moved(even)) * np.random.default_rng(seed).normal(size=even.size)
    record = rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced")
    (row,) = (row for row in rss.diagnose(heave(), record, effects=["end_stop"]).budget.rows if row.cause == "end_stop")
    value, std = row.parameters["stiffness"]
    assert abs(value - 80.0) < 3.0 * std < 8.0


def test_the_prior_of_a_strong_force_does_not_pull_its_number():
    """A drag that takes nearly all of the exciting force, in short and noisy records: its errors have mean zero."""
    off, true = [], 1000.0
    for seed in some(range(6), 3):
        rng = np.random.default_rng(seed)
        time, force, moved = driven(heave(), rng, periods=12, force=lambda t, x, v: true * v * abs(v))
        even = time[::8]
        read = moved(even) + 0.2 * np.std(moved(even)) * rng.normal(size=even.size)
        record = rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced")
        found = rss.diagnose(heave(), record, effects=["quadratic_drag"])
        value, std = found.verdict.effects[0].parameters["coefficient"]
        off.append((value - true) / std)
    assert abs(np.mean(off)) < 3.0 / np.sqrt(len(off))


def pushed(model, rng, top, rms, name):
    """A record of a body pushed by a random force below `top` natural frequencies, of `rms` times C and the motion."""
    C, w = float(model.C[0, 0]), np.sqrt(float(model.C[0, 0] / (model.M + model.A_inf)[0, 0]))
    waves, phase = top * w * rng.uniform(0.1, 1.0, 20), rng.uniform(0.0, 6.28, 20)
    rms = rms * C * 0.08  # the free motion's, nearly
    push = lambda t: rms * np.sqrt(0.1) * float(np.sum(np.cos(waves * t + phase)))  # noqa: E731
    time, force, moved = driven(model, rng, force=lambda t, x, v: -push(t))
    even = time[::8]
    read = moved(even) + 0.001 * np.std(moved(even)) * rng.normal(size=even.size)
    dof = model.dofs[0]
    made = np.sqrt(np.mean(np.square([push(t) for t in even[::4]])))
    return made, rss.Record(even, {dof: read, f"{dof}_force": force(even)}, kind="forced", name=name)


@pytest.mark.parametrize("seed, later", [(0, 0.3), (1, 5.0)])
def test_a_slow_force_of_unknown_course_is_told_with_its_size(seed, later):
    """Below a third of the natural frequency, of its own course in each record: nothing predicts it. The later one is
    as strong, or so strong that most of the motion is its.
    """
    rng = np.random.default_rng(seed)
    (one, seen), (other, unseen) = (pushed(heave(), rng, 0.33, rms, f"of {rms}") for rms in (0.3, later))
    found = rss.diagnose(heave(), seen, withhold=unseen)
    assert found.verdict.status == "ambiguous" and found.verdict.probability == found.rules.slow
    assert found.verdict.indistinguishable == (("slow_drift",),)
    (value, std), = (row.parameters["rms"] for row in found.budget.rows if row.cause == "slow_drift")
    assert abs(value - np.sqrt((one**2 + other**2) / 2.0)) < 3.0 * std < 0.3 * value
    share = next(row.share for row in found.budget.rows if row.cause == "slow_drift")
    assert share > 0.8 and found.how_far.gap_after > 0.5 * found.how_far.gap_before
    assert found.how_far.shrinkage < 1.1 * (1.0 - share)  # explained, not predicted
    without = rss.diagnose(heave(), seen, withhold=unseen, absent=["slow_drift"]).verdict
    assert without.status == "unknown_effect"


def adrift(rng, name, released=0.0):
    """A moored body in waves far above its natural frequency, or let go, that a slow force moves most, by SciPy.

    Its mooring is 1 % stiffer than the model's C of 8.
    """
    w, hours = np.sqrt(8.0 / 3.0), 14 if released else 60
    time = np.arange(0.0, hours * 2 * np.pi / w, 2 * np.pi / w / 30)
    (fast, slow), sizes = ((w * rng.uniform(2.5, 4.0, 40), w / rng.uniform(5.0, 16.0, 12)), 0.6 * rng.normal(size=40))
    waves, push = (CubicSpline(time, np.cos(np.outer(time, at) + rng.uniform(0.0, 6.28, at.size)) @ size)
                   for at, size in ((fast, sizes * (released == 0.0)), (slow, np.full(12, 0.26 if released else 0.65))))

    def rate(t, s):
        return s[1], (float(waves(t) + push(t)) - 0.06 * np.sqrt(24.0) * s[1] - 8.08 * s[0]) / 3.0

    moved = odeint(rate, [released, 0.0], time, tfirst=True, rtol=1e-9, atol=1e-10, hmax=0.1)[:, 0]
    channels = {"Surge": moved + 0.005 * np.std(moved) * rng.normal(size=time.size)}
    return rss.Record(time, channels if released else {**channels, "Surge_force": waves(time)},
                      kind="decay" if released else "waves", name=name)


@pytest.mark.parametrize("seed", some(range(3)))
def test_a_motion_that_is_mostly_a_drift_leaves_the_stiffness_where_it_is(seed):
    """Of a slow force that nobody measured less stiffness would make less."""
    rng, model = np.random.default_rng(seed), rss.body(dof="Surge", mass=2.0, added_mass=1.0, C=8.0, damping_ratio=0.03)
    records = [adrift(rng, "first", 1.0), adrift(rng, "second", 1.2), adrift(rng, "seen")]
    found = rss.diagnose(model, records, withhold=adrift(rng, "unseen"))
    assert found.verdict.indistinguishable == (("slow_drift",),)
    stiffness, = (number for number in found.recalibrated if number.name == "stiffness")
    assert abs(stiffness.value - 0.01) < 3.0 * stiffness.std < 0.1


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_slow_force_that_comes_once_is_not_named(seed):
    """A ship that passes: pressure, then suction, over two and a half periods of each record."""
    rng, records = np.random.default_rng(seed), []
    for name in ("first", "second", "unseen"):
        at = rng.uniform(40.0, 150.0)
        time, force, moved = driven(
            heave(), rng, force=lambda t, x, v, at=at: 2.0 * (t - at) * np.exp(-(((t - at) / 6.0) ** 2)))
        even = time[::8]
        read = moved(even) + 0.001 * np.std(moved(even)) * rng.normal(size=even.size)
        records.append(rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced", name=name))
    assert rss.diagnose(heave(), records[:2], withhold=records[2]).verdict.status == "unknown_effect"


def test_a_random_force_of_all_frequencies_is_no_slow_one():
    rng = np.random.default_rng(5)
    (_, seen), (_, unseen) = (pushed(heave(), rng, 2.0, 0.3, name) for name in ("seen", "unseen"))
    assert rss.diagnose(heave(), seen, withhold=unseen).verdict.status == "unknown_effect"


def drifting(rng, coefficient, name):
    """A moored body's surge in a sea of components, and a force with the squared envelope, by SciPy's integrator."""
    time, w = np.arange(0.0, 900.0, 0.5), rng.uniform(0.5, 0.9, 40)
    parts = 0.2 * rng.rayleigh(size=40)[:, None] * np.exp(1j * (np.outer(w, time) + rng.uniform(0, 6.28, (40, 1))))
    sea = np.sum(parts, axis=0) * np.clip(time / 50.0, 0.0, 1.0)
    force = np.sum(4e5 * 1j * parts, axis=0).real * np.clip(time / 50.0, 0.0, 1.0)
    push = CubicSpline(time, force + coefficient * np.abs(sea) ** 2)
    moved = solve_ivp(lambda t, s: [s[1], (push(t) - 3e4 * s[1] - 5e4 * s[0]) / 5e6], time[[0, -1]], [0.0, 0.0],
                      t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.5).y[0]
    read = moved + 0.005 * np.std(moved) * rng.normal(size=time.size)
    return rss.Record(time, {"Surge": read, "Surge_force": force, "wave_elevation": sea.real}, kind="waves", name=name)


def test_drift_with_the_envelope_of_the_waves_is_named():
    rng, model = np.random.default_rng(8), rss.body(dof="Surge", mass=4e6, added_mass=1e6, C=5e4, damping_ratio=0.03)
    found = rss.diagnose(model, drifting(rng, 4e3, "seen"), withhold=drifting(rng, 4e3, "unseen"))
    (effect,) = found.verdict.effects
    assert effect.name == "wave_drift" and found.budget.after < 0.2 * found.budget.before
    value, std = effect.parameters["coefficient"]
    assert abs(value - 4e3) < 3.0 * std < 1.2e3


@pytest.mark.parametrize("share", [0.0, 0.1, 0.2])
def test_what_contradicts_itself_is_told_of_the_coefficients(share):
    """Damping of a passive system, its coupling moved in one direction only, of the largest damping."""
    omega = np.linspace(0.1, 12.0, 120)
    data = data_of(*random_passive(4, 2, 0), omega, dofs=("Surge", "Heave"), A_inf=np.eye(2))
    B = data.B.copy()
    largest = np.abs(B).max()
    B[:, 0, 1] += share * largest * np.exp(-((omega - 4.0) ** 2))
    model = rss.Model(data.dofs, M=np.eye(2), A_inf=np.eye(2), C=np.eye(2), fit=rss.fit_radiation(data, order=2),
                      hydro=data.replace(B=B))
    # Of the damping of the two motions themselves, and where it makes the damping negative by that.
    assert 0.8 * share <= contradiction(model) <= 2.0 * share
    time, met = np.arange(0.0, 200.0, 0.1), []
    for w in (4.0, 10.0):  # where it is, and where no coefficient is off
        swing = np.stack([np.cos(w * time), np.sin(w * time)])
        record = rss.Record(time, dict(zip(data.dofs, swing)), kind="motion-only")
        met.append(contradiction(model, [measured_motion(model, record)]))
    assert met[0] >= 0.75 * share and met[1] <= 0.05 * share


@pytest.mark.parametrize("duration", [120.0, 300.0])
def test_a_decay_is_checked_where_it_moves_not_where_only_noise_is_left(duration):
    model = rss.body(dof="Heave", mass=2.0e5, added_mass=1.0e5, C=3.0e5, damping_ratio=0.03)
    time, rng = np.arange(0.0, duration, 0.05), np.random.default_rng(0)
    moved = rss.simulate(model, (time, np.zeros((1, time.size))), [("quadratic_drag", "Heave", {"coefficient": 4.0e4})],
                         start={"Heave": 1.0})
    record = rss.Record(time, {"Heave": moved.outputs[0] + 0.004 * rng.normal(size=time.size)}, kind="decay")
    found = rss.diagnose(model, record, effects=["quadratic_drag", "linear_stiffness", "linear_damping"])
    assert [effect.name for effect in found.verdict.effects] == ["quadratic_drag"]
    assert found.how_far.gap_before > 1.4 * found.how_far.noise_floor
    assert found.how_far.gap_after < 1.1 * found.how_far.noise_floor


def test_a_record_that_is_sampled_for_the_slow_motion_has_no_gaps_in_the_quick_one():
    dofs, M, C = ("Sway", "Heave"), np.diag([4.0e4, 7.0e4]), np.diag([1.8e3, 4.9e5])
    fit = rss.RadiationFit(dofs, np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model, rng = rss.Model(dofs, M, np.zeros((2, 2)), C, fit, D=np.diag([4.0e2, 1.0e4])), np.random.default_rng(0)
    records = []
    for dof, span, step in (("Sway", 300.0, 1.85), ("Heave", 25.0, 0.14)):
        time = np.arange(0.0, span, step)
        moved = rss.simulate(model, (time, np.zeros((2, time.size))), start={dof: 1.0}).outputs[:2]
        moved = moved + 0.002 * rng.normal(size=moved.shape)
        records.append(rss.Record(time, dict(zip(dofs, moved)), kind="decay", name=dof))
    found = rss.diagnose(model, records, effects=["linear_damping"])
    assert found.verdict.status == "no_gap"
    assert not any("not measured" in note for note in found.notes)


def test_of_a_decay_with_a_gap_the_part_that_is_only_noise_is_left_out():
    time, rng = np.arange(0.0, 120.0, 0.05), np.random.default_rng(0)
    moved = rss.simulate(heave(), (time, np.zeros((1, time.size))), start={"Heave": 1.0}).outputs[0]
    moved = moved + 0.01 * rng.normal(size=time.size)
    moved[800:1400] = np.nan  # from 70 s on it is some thousandths of the noise
    found = rss.diagnose(heave(), rss.Record(time, {"Heave": moved}, kind="decay"), effects=["linear_damping"])
    assert found.verdict.status == "no_gap"


def test_readings_that_are_lost_just_before_the_last_one_are_no_gap():
    model = rss.body(dof="Heave", mass=2.0e5, added_mass=1.0e5, C=3.0e5, damping_ratio=0.03)
    time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(0)
    moved = rss.simulate(model, (time, np.zeros((1, time.size))), start={"Heave": 1.0}).outputs[0]
    heave = moved + 0.002 * rng.normal(size=time.size)
    heave[-5:-1] = np.nan
    found = rss.diagnose(model, rss.Record(time, {"Heave": heave}, kind="decay"), effects=["linear_damping"])
    assert found.verdict.status == "no_gap"


@pytest.mark.parametrize("column, lost", [("Heave", np.s_[:50]), ("Heave_force", np.s_[-50:]),
                                          ("Heave", np.s_[400:450])], ids=["start", "end", "middle"])
def test_what_a_sensor_did_not_record_is_not_put_in(column, lost):
    """Nearly two periods of motion or force are missing: the other records' and this one's rest tell the drag."""
    records = []
    for seed in range(2):
        rng, dof = np.random.default_rng(seed), "Heave"
        time, force, moved = driven(heave(), rng, force=lambda t, x, v: 0.4 * v * abs(v))
        even = time[::8]
        rows = {dof: moved(even) + 0.001 * np.std(moved(even)) * rng.normal(size=even.size), "Heave_force": force(even)}
        rows[column][lost] = np.nan
        records.append(rss.Record(even, rows, kind="forced", name=f"sea {seed}"))
    found = rss.diagnose(heave(), records[0], withhold=records[1])
    (effect,) = found.verdict.effects
    value, std = effect.parameters["coefficient"]
    assert effect.name == "quadratic_drag" and abs(value - 0.4) < 3.0 * std < 0.1
    assert found.how_far.gap_after < 1.5 * found.how_far.noise_floor
    assert any("not measured" in note for note in found.notes)


@pytest.mark.parametrize("colour, unseen", [(0.0, 4), (0.85, 3)])
def test_noise_of_the_recorded_force_at_a_faint_resonance_is_no_gap(colour, unseen):
    """A soft mooring: what the force's sensor adds swings the model far below the waves, and the body not at all.

    By how much is chance: in the record of seed 4 it is a third more than expected.
    """
    model = rss.body(dof="Surge", mass=2.0e5, added_mass=0.0, C=2.0e3, damping_ratio=0.005)

    def sea(seed):
        time, rng = np.arange(0.0, 600.0, 0.25), np.random.default_rng(seed)
        omega, phase = rng.uniform(0.6, 1.3, 40), rng.uniform(0.0, 2.0 * np.pi, 40)
        force = 2.0e4 * np.cos(np.outer(time, omega) + phase).sum(axis=1)
        moved = rss.simulate(model, (time, force[None])).outputs[0]
        noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], rng.normal(size=time.size))
        return rss.Record(time, {"Surge": moved + 0.01 * moved.std() * rng.normal(size=time.size),
                                 "Surge_force": force + 0.02 * force.std() * noise}, kind="forced", name=f"sea {seed}")

    found = rss.diagnose(model, [sea(1), sea(2)], withhold=sea(unseen))
    assert found.verdict.status == "no_gap"
    assert found.how_far.gap_after > 0.05  # what the noise moves in the prediction


def coupled(coupling):
    """Surge and pitch of a body whose added mass couples them, by this share of the motions' own."""
    rigid = rss.RadiationFit(("Surge", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    return rss.Model(("Surge", "Pitch"), np.diag([2.0, 1.0]), np.array([[1.0, coupling], [coupling, 1.0]]),
                     np.diag([8.0, 9.0]), rigid, D=np.diag([0.3, 0.25]))


@pytest.mark.parametrize("stated, true, names", [(0.002, 0.022, set()), (0.002, 0.3, {"coupling_inertia"}),
                                                 (0.0, 0.3, {"coupling_inertia"})])
def test_a_coupled_added_mass_is_off_by_what_the_motions_own_are_however_small_it_is(stated, true, names):
    body, model = coupled(true), coupled(stated)
    inertia = np.linalg.inv(body.M + body.A_inf)

    def record(seed):
        rng = np.random.default_rng(seed)
        time, omega = np.arange(0.0, 120.0, 0.1), rng.uniform(0.8, 4.0, (40, 2))
        force = np.cos(time[:, None, None] * omega + rng.uniform(0.0, 6.28, (40, 2))).sum(axis=1) / 6.0
        force *= np.clip(time / 10.0, 0.0, 1.0)[:, None]
        at = CubicSpline(time, force)
        moved = odeint(lambda s, t: [*s[2:], *(inertia @ (at(t) - body.D @ s[2:] - body.C @ s[:2]))], np.zeros(4), time,
                       rtol=1e-8, atol=1e-10)[:, :2]
        moved += 0.005 * moved.std(axis=0) * rng.normal(size=moved.shape)
        return rss.Record(time, {"Surge": moved[:, 0], "Pitch": moved[:, 1], "Surge_force": force[:, 0],
                                 "Pitch_force": force[:, 1]}, kind="forced", name=f"seed {seed}")

    found = rss.diagnose(model, [record(1), record(2)], withhold=record(3))
    assert {e.name for e in found.verdict.effects} == names


def test_a_coupled_inertia_is_found_whatever_the_sizes_of_the_motions():
    """A slow, large surge and a quick, small heave let go; the truth by the matrix exponential."""
    M, C, D, lacking = np.diag([11.0, 13.0]), np.diag([11.6, 800.0]), np.diag([0.5, 20.0]), -4.0
    rigid = rss.RadiationFit(("Surge", "Heave"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Surge", "Heave"), M, 0.0 * M, C, rigid, D=D)
    inverse = np.linalg.inv(M + np.array([[0.0, lacking], [lacking, 0.0]]))
    step = expm(0.05 * np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ C, -inverse @ D]]))

    def decay(surge, heave, seed):
        states, rng = [np.array([surge, heave, 0.0, 0.0])], np.random.default_rng(seed)
        while len(states) < 800:
            states.append(step @ states[-1])
        x = np.array(states)[:, :2].T
        read = x + 0.005 * x.std(axis=1)[:, None] * rng.normal(size=x.shape)
        return rss.Record(0.05 * np.arange(800), {"Surge": read[0], "Heave": read[1]}, kind="decay", name=f"d{seed}")

    found = rss.diagnose(model, [decay(0.4, 0.0, 0), decay(0.2, 0.02, 1)], withhold=decay(0.3, -0.02, 2))
    (effect,) = found.verdict.effects
    value, deviation = effect.parameters["inertia"]
    assert effect.name == "coupling_inertia" and abs(value - lacking) < 3.0 * deviation < 1.2


def by_elevation(seed, error, X=lambda w: 8.0 * np.exp(-0.1 * w**2), column="wave_elevation", **meta):
    """Return the diagnosis of steady heave in closed form, X off by a complex error of the frequency, of its size."""
    rng, omega = np.random.default_rng(seed), np.linspace(0.05, 12.0, 240)
    a, b, c = np.array([[-1.5, -4.0], [1.0, 0.0]]), np.array([[1.0], [0.0]]), np.array([[1.0, 0.0]])
    data = data_of(a, b, c, omega).replace(X=X(omega)[:, None, None], directions=[0.0],
                                           M=[[2.0]], C=[[16.0]])
    model = rss.Model.from_hydro(data, fit=rss.fit_radiation(data, order=2))

    def sea(name):
        time, w = np.arange(0.0, 400.0, 0.1), rng.uniform(0.8, 3.2, 60)
        waves = 0.02 * (rng.normal(size=60) + 1j * rng.normal(size=60)) * np.exp(1j * np.outer(time, w))
        Z = 16.0 - w**2 * (model.M + model.A_inf)[0, 0] + 1j * w * model.fit.frequency_response(w)[:, 0, 0]
        heave = (waves @ ((X(w) + error(w)) / Z)).real
        read = heave + 0.002 * heave.std() * rng.normal(size=time.size)
        known = {"wave_elevation": waves.sum(axis=1).real, "Heave_force": (waves @ X(w)).real}
        return rss.Record(time, {"Heave": read, column: known[column]}, kind="waves", name=name, meta=meta)

    return rss.diagnose(model, [sea("a"), sea("b")], withhold=sea("c"))


def test_a_recorded_force_needs_no_X_of_its_direction():
    """X is for following waves; the record's go across, and its force is in its column."""
    found = by_elevation(0, lambda w: 0.0 * w, column="Heave_force", heading="90")
    assert found.verdict.status == "no_gap" and found.how_far.gap_after < 0.01


def test_a_steady_force_is_no_force_of_waves():
    model, rng = heave(), np.random.default_rng(4)
    data = rss.HydroData([0.5, 1.0, 2.0, 4.0], np.ones((4, 1, 1)), np.zeros((4, 1, 1)), dofs=("Heave",), M=[[2.0]],
                         C=[[8.0]], A_inf=[[1.0]], X=np.ones((4, 1, 1)), directions=[0.0])
    model = model.replace(hydro=data)
    w, time = np.sqrt(8.0 / 3.0), np.arange(0.0, 80.0, 0.2)

    def pushed_down(start, name):
        decay = 0.1 + (start - 0.1) * np.exp(-0.05 * w * time) * np.cos(w * np.sqrt(1.0 - 0.05**2) * time)
        channels = {"Heave": decay + 1e-4 * rng.normal(size=time.size), "Heave_force": np.full(time.size, 0.8)}
        return rss.Record(time, channels, kind="waves", name=name)

    found = rss.diagnose(model, pushed_down(0.3, "a"), withhold=pushed_down(-0.1, "b"))
    assert found.verdict.status == "no_gap"


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_force_by_the_elevation_is_as_sure_as_the_tolerance_at_each_frequency(seed):
    """X is off by 2 % everywhere, at a phase that turns three times over the sea."""
    found = by_elevation(seed, lambda w: 0.16 * np.exp(-0.1 * w**2 + 1j * (1.5 * seed + 2.0 * np.pi * (w - 0.8) / 0.8)))
    assert found.verdict.status == "no_gap" and found.how_far.gap_before == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("seed", some(range(2)))
def test_a_smooth_error_of_the_exciting_force_within_its_tolerance_is_no_effect(seed):
    """A complex Gaussian process over log2 w, 2 % rms, whose correlation falls in .7 octaves."""
    octaves = np.linspace(-1.0, 2.5, 60)
    apart = np.subtract.outer(octaves, octaves) / 0.7
    process = np.linalg.cholesky(np.exp(-0.5 * apart**2) + 1e-8 * np.eye(60))
    values = 0.02 / np.sqrt(2.0) * process @ (np.random.default_rng([seed, 1]).normal(size=(60, 2)) @ [1.0, 1j])
    found = by_elevation(seed, lambda w: 8.0 * np.exp(-0.1 * w**2) * np.interp(np.log2(w), octaves, values))
    assert not found.verdict.effects and found.verdict.status != "unknown_effect"


@pytest.mark.parametrize("seed, column", [(0, "wave_elevation"), (1, "Heave_force")])
def test_a_long_body_is_not_judged_where_its_waves_cancel(seed, column):
    """X of a wall-sided box by Froude and Krylov passes through zero at 2 rad/s; the true one is 1 % longer."""
    def X(w, longer=1.0):
        return 8.0 * np.sinc(0.25 * longer * w**2) * longer * np.exp(-0.1 * w**2)

    found = by_elevation(seed, lambda w: X(w, 1.01) - X(w), X, column)
    assert not found.verdict.effects and found.verdict.status != "unknown_effect"


@pytest.mark.parametrize("kept, words", [(np.s_[:5], "5 usable samples of Heave"), (np.s_[:0], "0 usable samples"),
                                         (np.s_[:], r"noise alone \(a flat spectrum\)")])
def test_what_shows_no_motion_says_why(kept, words):
    values, noise = np.full(400, np.nan), np.random.default_rng(0).standard_normal(400)
    values[kept] = noise[kept]
    with pytest.raises(rss.InputError, match=words):
        rss.diagnose(tank_model(), rss.Record(0.05 * np.arange(400), {"Heave": values}, kind="decay"))


@pytest.mark.parametrize("seed", some(range(2)))
def test_what_hardly_moves_in_a_decay_says_nothing_of_couplings(seed):
    """A motion of less than a thousandth of the other's energy: the model knows its couplings no better."""
    body, rng, time = coupled(0.0), np.random.default_rng(seed), np.arange(0.0, 60.0, 0.05)

    def decay(dof, start):
        i = body.dofs.index(dof)
        k, c, m = body.C[i, i], body.D[i, i], (body.M + body.A_inf)[i, i]
        moved = odeint(lambda s, t: [s[1], -(k * s[0] + c * s[1]) / m], [start, 0.0], time, rtol=1e-9, atol=1e-12)[:, 0]
        other = next(d for d in body.dofs if d != dof)
        stray = 1e-5 * np.exp(-0.05 * time) * np.sin(1.1 * time)
        read = {name: x + 0.01 * x.std() * rng.normal(size=time.size) for name, x in ((dof, moved), (other, stray))}
        return rss.Record(time, read, kind="decay", name=dof)

    found = rss.diagnose(body, [decay("Surge", 1.0), decay("Pitch", 0.3)], withhold=decay("Surge", 0.7))
    assert found.verdict.status == "no_gap"
    assert any("Record Surge: Pitch shows no motion" in note for note in found.notes)
