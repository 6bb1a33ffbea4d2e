"""Wrong units, dead forces and short records: named by column and rows; sound records pass in silence."""

import re

import numpy as np
import pytest
from identify_tank import sail, tank, with_waves
from plant_bodies import tank_model
from scipy.integrate import solve_ivp

import radiation_ss as rss
from benchmarks.heave_tank import sea_record
from benchmarks.heave_tank import tank as heave_tank
from radiation_ss import Record
from radiation_ss.cli import main
from radiation_ss.errors import InputError
from radiation_ss.records import column_conflicts
from radiation_ss.simulation import check_decays, check_units, doubts, memory_length, other_readings

SEEDS = range(6)


def decay(model, seed, duration=12.0, noise=1e-3):
    """Return a decay test from 20 mm, exact by the matrix exponential's eigenvalues, with noise of 1e-3 of that."""
    F, _ = model.matrices()
    poles, vectors = np.linalg.eig(F)
    state = np.zeros(F.shape[0])
    state[-2] = 0.02
    t = 0.02 * np.arange(round(duration / 0.02))
    y = (vectors[-2] * np.linalg.solve(vectors, state)) @ np.exp(np.outer(poles, t))
    return Record(t, {"Heave": y.real + 0.02 * noise * np.random.default_rng(seed).standard_normal(t.size),
                      "Heave_force": np.zeros(t.size)}, kind="decay")


@pytest.mark.parametrize("seed", SEEDS)
def test_sound_records_pass(seed):
    model, rng = with_waves(tank()), np.random.default_rng(seed)
    waves, _ = sail(model, 30.0, rng, noise=0.05)
    rough = waves.channels["Heave"].copy()
    rough[rng.random(rough.size) < 0.2] = np.nan
    rough[rng.random(rough.size) < 0.01] += 20.0 * np.nanstd(rough)
    silent = Record(waves.time, {**waves.channels, "Roll": 1e-6 * rng.standard_normal(rough.size)})
    for record in (waves, waves.with_channels(Heave=rough), silent, decay(model, seed)):
        check_units(model, [record])
        check_decays(model, [record])
        assert not doubts(model, record)
    record, force = sea_record(seed, noise=0.05)
    check_units(heave_tank(), [record, record.with_channels(Heave_force=force)])
    spiky = {name: v + 20.0 * v.std() * (rng.random(v.size) < 0.01) for name, v in record.channels.items()}
    check_units(heave_tank(), [Record(record.time, spiky)])
    # Slow drift that only the displacement has, a hundred times the waves: no wrong unit.
    drifting = record.channels["Heave"] + 100.0 * np.std(record.channels["Heave"]) * np.sin(0.3 * record.time)
    assert not column_conflicts(record.with_channels(Heave=drifting), "Heave")


@pytest.mark.parametrize("factor", [1000.0, 180.0 / np.pi, 1e-3])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_motion_column_is_named(factor, seed):
    record, _ = sea_record(seed)
    for name in ("Heave", "Heave_velocity", "Heave_acceleration"):
        wrong = record.with_channels(**{name: factor * record.channels[name]})
        said = column_conflicts(wrong, "Heave")
        assert len(said) == 1 and said[0].startswith(f"column {name}, all 3000 rows")
        for method in ("spectral", "joint", "dual-enkf"):
            with pytest.raises(InputError, match=f"column {name}, all 3000 rows"):
                rss.identify(heave_tank(), wrong, method)
        for preset in (None, "paper"):
            with pytest.raises(InputError, match=f"column {name}, all 3000 rows"):
                rss.DualEnKF(heave_tank(), preset=preset).run(wrong)


@pytest.mark.parametrize("factor", [1000.0, 1e-3])
def test_force_elevation_and_time_are_held_against_the_model(factor):
    model = with_waves(tank())
    record, force = sea_record(0)
    wrong = record.with_channels(Heave_force=factor * force)
    for run in (rss.DualEnKF(heave_tank()).run, lambda r: rss.identify(heave_tank(), r, "prediction-error")):
        with pytest.raises(InputError, match=r"column Heave_force or Heave, all 3000 rows.*look at Heave_force first"):
            run(wrong)
    for run in (rss.DualEnKF(heave_tank()).run, lambda r: rss.identify(heave_tank(), r)):
        with pytest.raises(InputError, match="column time, all 3000 rows"):
            run(Record(factor * record.time, record.channels))
    waves, _ = sail(model, 30.0, np.random.default_rng(1))
    elevation = waves.channels["Heave"] * factor      # of about the body's size where it follows the waves
    wrong = Record(waves.time, {"Heave": waves.channels["Heave"], "wave_elevation": elevation})
    with pytest.raises(InputError, match="column wave_elevation or Heave, all 600 rows"):
        rss.identify(model, wrong, "prediction-error")


def test_motion_that_outruns_gravity_is_told_without_a_force():
    record, _ = sea_record(0)
    wrong = Record(record.time, {name: 1000.0 * values for name, values in record.channels.items()})
    for run in (rss.DualEnKF(heave_tank()).run, lambda r: rss.identify(heave_tank(), r)):
        assert any(re.search("column Heave, all 3000 rows.*gravity", text) for text in run(wrong).warnings)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_force_of_zero_in_waves_is_refused(seed):
    model = tank()
    waves, _ = sail(model, 30.0, np.random.default_rng(seed))
    zero = {**waves.channels, "Heave_force": np.zeros(waves.time.size)}
    for kind in ("waves", "decay"):
        wrong = Record(waves.time, zero, kind=kind)
        for run in (rss.DualEnKF(model).run, lambda r: rss.identify(model, r, "prediction-error")):
            with pytest.raises(InputError, match=r"column Heave_force: zero on all 600 rows.*does not die out"):
                run(wrong)


def test_doubtss_are_said():
    model = tank()
    # The kernel's envelope is e^(-slowest pole): below 1 % of its largest value within a factor of two of log(100).
    slowest = -np.linalg.eigvals(model.fit.a).real.max()
    assert 0.2 * np.log(100.0) / slowest < memory_length(model) < 1.5 * np.log(100.0) / slowest
    short = decay(model, 0, duration=0.6)
    assert any("column time: its 30 rows end after 0.58 s" in w for w in rss.DualEnKF(model).run(short).warnings)
    found = rss.identify(model, short, "prediction-error", omega=[5.0, 8.0], draws=50)
    assert any("column time: its 30 rows end after 0.58 s" in w for w in found.warnings)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(("name", "factor", "word"), [
    ("Heave", 1000.0, "column Heave, all 3000 rows"), ("Heave_acceleration", 1e-3, "column Heave_acceleration"),
    ("time", 1000.0, "column time, all 3000 rows"), ("Heave_force", 1000.0, "look at Heave_force first"),
    ("Heave_force", 0.0, "column Heave_force: zero on all 3000 rows")])
def test_wrong_unit_in_a_file_is_status_two(name, factor, word, tmp_path, capsys):
    record, force = sea_record(0)
    columns = {"time": record.time, **record.channels, "Heave_force": force}
    columns[name] = factor * columns[name]
    time = columns.pop("time")
    rss.write_record(Record(time, columns, kind="decay" if factor == 0.0 else "waves"), tmp_path / "run.csv")
    hydro = with_waves(tank()).hydro
    rss.write_hydro(hydro, tmp_path / "model.nc")
    words = ["identify", tmp_path / "model.nc", tmp_path / "run.csv", "--method", "prediction-error", "--order", 3]
    assert main([str(word) for word in [*words, "--out", tmp_path / "out"]]) == 2
    said = capsys.readouterr().err.splitlines()
    assert word in said[-1] and said[-1].startswith("radiation-ss")
    # Reading may have warned of the same column before.
    assert all("warning" in line for line in said[:-1])


def test_a_motion_that_the_recorded_force_does_not_drive_is_no_matter_of_units():
    dofs, none = ("Heave", "Pitch"), np.zeros((0, 0))
    model = rss.Model(dofs, [[2.0, 1e-17], [1e-17, 0.5]], np.zeros((2, 2)), np.diag([8.0, 3.0]),
                      rss.RadiationFit(dofs, none, np.zeros((0, 2)), np.zeros((2, 0)), 0), D=np.diag([0.4, 0.1]))
    time = np.arange(0.0, 60.0, 0.05)
    force = np.cos(1.3 * time) + np.cos(2.1 * time)
    moved = rss.simulate(model, (time, np.stack([force, 0.3 * force]))).outputs
    record = rss.Record(time, {"Heave": moved[0], "Pitch": moved[1], "Heave_force": force, "Pitch_force": 0.0 * time},
                        kind="forced")
    check_units(model, [record])  # raises nothing
    with pytest.raises(InputError, match="Pitch moves"):  # as soon as a force does drive it, its unit is looked at
        check_units(model, [record.with_channels(Pitch_force=3e-4 * force)])


@pytest.mark.parametrize("times, damping, told", [
    (1.0, 0.0, False), (1.3, 0.0, False), (0.2, 0.0, True), (5.0, 0.0, True), (5.0, 0.2, True), (1.0, 3.0, False),
    (1.0, 10.0, False)])
def test_a_decay_in_another_time_scale_is_told_and_one_slowed_by_damping_is_not(times, damping, told):
    model = tank_model()
    critical = 2.0 * float(np.sqrt(model.C * (model.M + model.A_inf))[0, 0])
    time = np.linspace(0.0, 20.0, 801)
    moved = rss.simulate(model.attached(damping={"Heave": damping * critical}), (time, np.zeros((1, time.size))),
                         start={"Heave": 0.03}).outputs[0]
    noise = 3e-4 * np.random.default_rng(1).standard_normal(time.size)
    said = doubts(model, Record(times * time, {"Heave": 0.01 + moved + noise}, kind="decay", name="d"))
    found = [text for text in said if "times as fast as the model" in text]
    assert len(found) == told
    if told:
        scale = float(re.search(r"by Froude about 1 : ([0-9.]+)\)", found[0])[1])
        assert scale == pytest.approx(25.0, rel=0.25)  # to the spectrum's lines


def own_body():
    """Heave with a natural frequency of 4 rad/s, critical damping 5 %, and no radiation."""
    none = np.zeros((0, 0))
    fit = rss.RadiationFit(("Heave",), none, np.zeros((0, 1)), np.zeros((1, 0)), 0)
    return rss.Model(("Heave",), [[50.0]], [[0.0]], [[800.0]], fit, D=[[20.0]])


def pushed(model, seed, lowest, highest):
    """Return a forced test with forces between two frequencies [rad/s] and a noise of 2 %."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 90.0, 0.04)
    force = sum(rng.normal() * np.cos(w * time + rng.uniform(0.0, 6.0)) for w in np.linspace(lowest, highest, 9))
    heave = rss.simulate(model, (time, force[None])).outputs[0]
    heave = heave + 0.02 * heave.std() * rng.standard_normal(time.size)
    return Record(time, {"Heave": heave, "Heave_force": force}, kind="forced", name="push")


@pytest.mark.parametrize("band", [(0.5, 2.0), (8.0, 14.0)])     # near static, and where inertia rules
@pytest.mark.parametrize("times", [9.80665, 1.0 / 9.80665, 10.0, 0.1, 4.0])
def test_a_force_that_stiffness_and_inertia_do_not_need_is_told(times, band):
    model, record = own_body(), pushed(own_body(), 1, *band)
    assert not doubts(model, record)
    wrong = record.with_channels(Heave_force=times * record.channels["Heave_force"])
    check_units(model, [wrong])
    (said,) = doubts(model, wrong)
    assert "column Heave_force or Heave, all 2250 rows" in said and "Heave_force in N, Heave in m" in said
    assert float(re.search("it is ([0-9.]+) times the force", said)[1]) == pytest.approx(times, rel=0.05)
    assert ("kgf" in said) == (0.09 < times < 0.11)


@pytest.mark.parametrize("body", [{"M": [[80.0]]}, {"M": [[35.0]]}, {"C": [[1200.0]]}, {"C": [[480.0]]},
                                  {"D": [[200.0]]}, {"D": [[0.0]]}])
@pytest.mark.parametrize("band", [(0.5, 2.0), (3.0, 5.0), (1.0, 9.0), (6.0, 14.0)])
def test_a_body_unlike_its_model_is_no_matter_of_the_force_s_unit(body, band):
    true = own_body().replace(**{name: np.array(value) for name, value in body.items()})
    for seed in SEEDS[:3]:
        assert not doubts(own_body(), pushed(true, seed, *band))


def test_a_static_load_in_kilograms_is_told():
    model, place = own_body(), np.array([-0.02, -0.01, 0.0, 0.01, 0.02])
    record = Record(np.arange(5.0), {"Heave": place, "Heave_force": 800.0 * place}, kind="static", name="weights")
    assert not doubts(model, record)
    (said,) = doubts(model, record.with_channels(Heave_force=800.0 / 9.80665 * place))
    assert "0.102 times the force" in said and "kgf" in said


def test_a_body_that_friction_holds_passes_where_a_static_load_heels_it_as_stated():
    """Creep through friction of 297 N m s/rad where the model swings freely: a fiftieth of its motion."""
    model = rss.body(dof="Roll", mass=1000.0, GM=0.08, gyradius=0.35, period=2.5, damping_ratio=0.02)
    t, C = 0.05 * np.arange(4000), float(model.C[0, 0])
    moment = np.sum([np.cos(w * t + k) for k, w in enumerate(np.linspace(1.5, 3.5, 30))], axis=0)
    creep = np.zeros(t.size)
    for k in range(t.size - 1):  # 60 times the critical damping leaves no inertia
        creep[k + 1] = creep[k] + 0.05 * (moment[k] - C * creep[k]) / (120.0 * C / 2.5)
    held = Record(t, {"Roll": creep, "Roll_force": moment}, kind="forced", name="held")
    heel = np.linspace(-0.08, 0.08, 9)
    static = Record(np.arange(9.0), {"Roll": heel, "Roll_force": C * heel}, kind="static", name="heeled")
    check_units(model, [held, static])
    with pytest.raises(InputError, match=r"record held, .*times as much as the model"):
        check_units(model, [held])


@pytest.mark.parametrize("times, told", [(1.0, False), (2.8, True)])
def test_a_force_that_x_makes_too_large_names_x(times, told):
    """A body that nothing restores, in a sea of three lines; its motion in closed form."""
    time, omega, mass = np.arange(0.0, 120.0, 0.1), np.array([0.8, 1.0, 1.3]), 5.0
    table, one = np.linspace(0.2, 4.0, 20), np.ones((20, 1, 1))
    data = rss.HydroData(table, 1.0 * one, 1e-6 * one, A_inf=[[1.0]], dofs="Sway", M=[[mass - 1.0]], C=[[0.0]],
                         X=20.0 * times * one.astype(complex), directions=[0.0])
    model = rss.Model.from_hydro(data, rss.RadiationFit(("Sway",), np.zeros((0, 0)), np.zeros((0, 1)),
                                                        np.zeros((1, 0)), 0))
    waves = np.cos(np.outer(time, omega))
    record = rss.Record(time, {"wave_elevation": waves.sum(axis=1), "Sway": waves @ (-20.0 / (mass * omega**2))},
                        kind="waves", name="sea")
    said = " ".join(doubts(model, record))
    assert ("check X (N per metre of wave amplitude)" in said) == told


def test_a_moored_decay_may_last_where_the_model_does_not_restore():
    """Surge of a period of 100 s that loses a tenth a swing, with its heave; the model has no mooring."""
    model = rss.body(dof=("Surge", "Heave"), mass=1e6, added_mass={"Surge": 2e5, "Heave": 8e5},
                     C={"Surge": 0.0, "Heave": 5e6}, damping_ratio={"Heave": 0.1})
    t = 0.5 * np.arange(1200)
    surge = 5.0 * np.exp(-0.1 * t / 100.0) * np.cos(2.0 * np.pi * t / 100.0)
    record = Record(t, {"Surge": surge, "Heave": 0.01 * surge, "Surge_force": 0.0 * t, "Heave_force": 0.0 * t},
                    kind="decay")
    check_decays(model, [record])
    with pytest.raises(InputError, match="does not die out"):
        check_decays(model, [Record(t, {"Heave": surge, "Heave_force": 0.0 * t}, kind="decay")])


def test_a_motion_that_only_a_numerical_coupling_drives_is_not_compared_with_the_model():
    omega = np.linspace(0.2, 4.0, 40)
    s = 1j * omega[:, None, None]
    K = s / (s**2 + 1.2 * s + 1.0) * np.array([[6e5, 0.3], [0.3, 6e4]])
    A_inf = np.diag([9e5, 5e5])
    data = rss.HydroData(omega, A_inf + K.imag / omega[:, None, None], K.real, A_inf, dofs=("Heave", "Roll"),
                         M=np.diag([8e5, 7e6]), C=np.diag([3e6, 5e6]))
    model = rss.Model.from_hydro(data, order=4)
    time, rng = np.arange(0.0, 300.0, 0.2), np.random.default_rng(0)
    moment = 4e4 * np.convolve(rng.normal(size=time.size), np.hanning(12), "same")
    moved = rss.simulate(model, (time, np.stack([0.0 * moment, moment])), [("linear_damping", "Roll", {
        "coefficient": 3e5})]).outputs
    heave = 1e3 * moved[0] + 1e-9 * rng.normal(size=time.size)  # a thousand times the model's, and nothing beside roll
    record = rss.Record(time, {"Heave": heave, "Heave_force": 0.0 * time, "Roll": moved[1], "Roll_force": moment},
                        kind="forced")
    found = rss.diagnose(model, [record], effects=["linear_damping", "quadratic_drag"])
    assert [(e.name, e.dof) for e in found.verdict.effects] == [("linear_damping", "Roll")]
    assert {dof for _, dof in found.budget.by_record} == {"Roll"}


@pytest.mark.parametrize("seed", range(3))
def test_regular_tests_with_force_in_kilograms_are_told_together(seed):
    model = rss.body(dof="Heave", mass=50.0, C=3000.0, period=1.0, damping_ratio=0.06)
    rng, time = np.random.default_rng(seed), np.arange(0.0, 20.0, 0.02)
    inertia, D, C = (model.M + model.A_inf)[0, 0], model.D[0, 0], model.C[0, 0]

    def tests(share, unit):
        """Return a test at each of four frequencies, of a body with `share` of the stiffness."""
        for omega in (3.0, 4.5, 8.0, 10.0):
            x, v = 0.08 * np.sin(omega * time), 0.08 * omega * np.cos(omega * time)
            force = ((share * C - inertia * omega**2) * x + D * v) / unit + 0.5 * rng.normal(size=time.size)
            yield Record(time, {"Heave": x + 1e-4 * rng.normal(size=time.size), "Heave_force": force},
                         kind="prescribed", name=f"{omega:g}")

    said, = other_readings(model, list(tests(1.0, 9.81)))
    assert said.startswith("records 3, 4.5, 8, 10, column Heave_force") and "taken from kgf to N" in said
    assert not other_readings(model, list(tests(0.7, 1.0))) and not other_readings(model, list(tests(1.0, 1.0)))


@pytest.mark.parametrize("seed", range(3))
def test_a_motion_exchanged_with_the_elevation_is_told(seed):
    model, rng, time = with_waves(tank()), np.random.default_rng(seed), np.arange(0.0, 60.0, 0.05)
    data = model.hydro
    w = data.omega[(data.omega > 3.0) & (data.omega < 12.0)]
    A, B, X = (row[np.isin(data.omega, w)].ravel() for row in (data.A, data.B, data.X))
    Z = -w**2 * (model.M[0, 0] + A) + 1j * w * B + model.C[0, 0]
    amplitude = (rng.normal(size=w.size) + 1j * rng.normal(size=w.size)) * 0.01 * np.exp(-(w - 6.0) ** 2 / 8.0)
    heave, waves = (np.real(np.exp(1j * np.outer(time, w)) @ (amplitude * by)) for by in (X / Z, 1.0))
    record = Record(time, {"Heave": heave, "wave_elevation": waves}, kind="waves", name="sea")
    assert not other_readings(model, [record])
    said, = other_readings(model, [record.with_channels(Heave=waves, wave_elevation=heave)])
    assert "with Heave and wave_elevation exchanged the model leaves" in said


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("drag", [0.0, 3000.0])
def test_a_release_on_top_of_waves_is_the_start_s_and_a_unit_is_still_told(seed, drag):
    """Moored surge of 100 s that swings from 10 m in forces of 8 s, which move it by some centimetres."""
    none, omega = np.zeros((0, 0)), 2.0 * np.pi / 100.0
    model = rss.Model(("Surge",), [[1e5]], [[2e4]], [[1.2e5 * omega**2]], rss.RadiationFit(
        ("Surge",), none, np.zeros((0, 1)), np.zeros((1, 0)), 0), D=[[0.06 * 1.2e5 * omega]])
    rng, time = np.random.default_rng(seed), 0.4 * np.arange(1600)
    w = 2.0 * np.pi / 8.0 * np.linspace(0.7, 1.5, 20)
    phase = rng.uniform(0.0, 2.0 * np.pi, w.size)

    def force(t):
        return 700.0 * np.cos(np.multiply.outer(t, w) + phase).sum(axis=-1)

    moved = solve_ivp(lambda t, s: [s[1], (force(t) - drag * s[1] * abs(s[1]) - model.D[0, 0] * s[1]
                                           - model.C[0, 0] * s[0]) / 1.2e5],
                      (0.0, time[-1]), [(-1.0) ** seed * 10.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-9).y[0]
    surge = moved + 0.003 * rng.standard_normal(time.size)
    record = Record(time, {"Surge": surge, "Surge_force": force(time)}, kind="forced", name="release")
    check_units(model, [record])
    assert not doubts(model, record)
    for wrong in (record.with_channels(Surge_force=1e-3 * force(time)), record.with_channels(Surge=1e3 * surge)):
        with pytest.raises(InputError, match="column Surge_force or Surge"):
            check_units(model, [wrong])
    said = " ".join(doubts(model, record.with_channels(Surge_force=1e3 * force(time))))
    assert re.search("it is 9[0-9]{2} times the force", said) and "mN is 1e+03 times" in said
