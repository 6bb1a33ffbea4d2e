"""A force, an elevation or a motion with its sign turned is told; a light resonance that is a little off is not."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from identify_tank import tank, with_waves

import radiation_ss as rss
from radiation_ss import HydroData, Model, RadiationFit
from radiation_ss.errors import InputError
from radiation_ss.simulation import TurnRules, check_units, doubts, linear_response, turned

SEEDS = range(8)


def light(damping):
    """Return a body of natural frequency 1 rad/s with this share of critical damping, without memory."""
    fit = RadiationFit(("Roll",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    return Model(("Roll",), [[0.6]], [[0.4]], [[1.0]], fit, D=[[2.0 * damping]])


def sea(rng, middle, width, time):
    omega = middle * np.linspace(1.0 - 2.0 * width, 1.0 + 2.0 * width, 120)
    size = np.exp(-0.5 * ((omega / middle - 1.0) / width) ** 2) * rng.rayleigh(size=120)
    return size @ np.cos(np.outer(omega, time) + rng.uniform(0.0, 2.0 * np.pi, (120, 1)))


def run(model, force, time, rng, noise=0.02):
    """Return the record of a body under way: its first third is not in it."""
    x = np.asarray(linear_response(model, time, force).outputs[0])
    x = x + noise * x.std() * rng.standard_normal(x.size)
    late = time > time[-1] / 3.0
    return rss.Record(time[late], {"Roll": x[late], "Roll_force": force[late]}, kind="waves", name="sea")


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.003, 0.3), st.floats(-0.2, 0.2), st.floats(0.5, 2.0),
       st.floats(0.03, 0.3))
def test_a_sound_record_passes_however_light_the_damping(seed, damping, softer, middle, width):
    """Natural frequencies are off by less than what the check allows for; drag may add to the damping."""
    assert abs(softer) < TurnRules().softer
    rng, time = np.random.default_rng(seed), np.arange(0.0, 400.0, 0.25)
    model = light(damping)
    truth = light(damping + rng.choice([0.0, 0.03])).replace(C=model.C * (1.0 + softer))
    assert not turned(model, run(truth, sea(rng, middle, width, time), time, rng, noise=0.1))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_turned_force_or_motion_is_told(seed):
    rng, time = np.random.default_rng(seed), np.arange(0.0, 600.0, 0.25)
    model = light(0.05)
    truth = model.replace(C=model.C * rng.uniform(0.96, 1.04))
    record = run(truth, sea(rng, rng.uniform(0.7, 1.3), 0.2, time), time, rng)
    for name in ("Roll", "Roll_force"):
        wrong = record.with_channels(**{name: -record.channels[name]})
        with pytest.raises(InputError, match=r"record sea, column Roll_force or Roll.* its sign, or that of"):
            check_units(model, [wrong])
    speed = np.gradient(record.channels["Roll"], record.time)
    (said,) = turned(model, record.with_channels(Roll_velocity=-speed))
    assert "the sign of Roll_velocity is turned" in said
    assert not turned(model, record.with_channels(Roll_velocity=speed))


@pytest.mark.parametrize("seed", SEEDS)
def test_motion_of_another_cause_has_no_sign(seed):
    rng, time = np.random.default_rng(seed), np.arange(0.0, 600.0, 0.25)
    model = light(0.05)
    one, other = (run(model, sea(rng, 1.0, 0.2, time), time, rng) for _ in range(2))
    assert not turned(model, one.with_channels(Roll_force=other.channels["Roll_force"]))
    regular = run(model, np.cos(1.3 * time), time, rng)  # half a period of delay is a turned sign, too
    assert not turned(model, regular.with_channels(Roll_force=-regular.channels["Roll_force"]))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_convention_of_X_is_told(seed):
    """X with a phase of its own: the conjugate, the turned elevation and both are told from each other."""
    rng, body = np.random.default_rng(seed), with_waves(tank())
    table = body.hydro
    X = table.X * np.exp(0.8j)
    data = HydroData(table.omega, table.A, table.B, A_inf=table.A_inf, dofs=("Heave",), M=body.M, C=body.C, X=X)
    model = body.replace(hydro=data)
    time = np.arange(0.0, 60.0, 0.05)
    omega = np.linspace(3.0, 12.0, 200)
    amplitudes = 0.01 * np.exp(-(((omega - 6.0) / 1.5) ** 2)) * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, omega.size))
    at = np.interp(omega, table.omega, X[:, 0, 0].real) + 1j * np.interp(omega, table.omega, X[:, 0, 0].imag)
    memory = model.fit.frequency_response(omega)[:, 0, 0]
    moved = at / (model.C[0, 0] - omega**2 * (model.M + model.A_inf)[0, 0] + 1j * omega * (memory + model.D[0, 0]))
    waves = np.exp(1j * np.outer(time, omega))
    eta, x = (waves @ amplitudes).real, (waves @ (moved * amplitudes)).real
    record = rss.Record(time, {"Heave": x + 0.02 * x.std() * rng.standard_normal(x.size), "wave_elevation": eta})
    assert not turned(model, record)
    assert doubts(model, record) == ()
    assert "kgf" in " ".join(doubts(model, record.with_channels(wave_elevation=eta / 9.81)))
    other = body.replace(hydro=HydroData(table.omega, table.A, table.B, A_inf=table.A_inf, dofs=("Heave",), M=body.M,
                                         C=body.C, X=X.conj() * np.exp(-1.2j)))
    # That X is off by 2.8 rad: only a turned sign, not the conjugate (1.2 rad off), is left.
    (said,) = turned(other, record)
    assert "sign of the elevation or of Heave is turned" in said
    conjugate = np.pi / 2 / 0.8  # X of phase pi/2: its conjugate is its negative, and both ways are said
    quarter = body.replace(hydro=HydroData(table.omega, table.A, table.B, A_inf=table.A_inf, dofs=("Heave",), M=body.M,
                                           C=body.C, X=(table.X * np.exp(0.8j * conjugate)).conj()))
    there = (waves @ (moved * amplitudes * np.exp(1j * (np.pi / 2 - 0.8)))).real
    (said,) = turned(quarter, record.with_channels(Heave=there))
    assert "its conjugate fits" in said and "sign of the elevation" in said
    with pytest.raises(InputError, match="moves against the force that the model's X makes of the elevation"):
        rss.diagnose(quarter, record.with_channels(Heave=there))


@pytest.mark.parametrize("dof, factor, said", [("Sway", 1.0, None), ("Sway", -1.0, "sign"), ("Roll", -1.0, "sign"),
                                               ("Roll", 180.0 / np.pi, "degrees"), ("Sway", 1.0, "exchanged")])
def test_a_free_decay_of_coupled_motions_tells_a_turned_sign_degrees_and_an_exchange(dof, factor, said):
    inertia, stiffness = np.array([[10.0, 1.5], [1.5, 1.0]]), np.diag([0.0, 9.0])
    damping = np.diag([1.0, 0.2])
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(inertia, np.c_[stiffness, damping])]])
    time = np.arange(0.0, 25.0, 0.05)
    poles, shapes = np.linalg.eig(rates)
    parts = np.linalg.solve(shapes, np.array([0.0, 0.2, 0.0, 0.0]))
    sway, roll = (shapes[:2] @ (parts[:, None] * np.exp(np.outer(poles, time)))).real
    noise = np.random.default_rng(2).standard_normal((2, time.size))
    motion = {"Sway": sway + 2e-4 * noise[0], "Roll": roll + 1e-3 * noise[1]}
    motion[dof] = factor * motion[dof]
    if said == "exchanged":
        motion = dict(zip(motion, reversed(motion.values())))
    fit = RadiationFit(("Sway", "Roll"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = Model(("Sway", "Roll"), inertia, np.zeros((2, 2)), stiffness, fit, D=damping)
    record = rss.Record(time, motion, kind="decay", name="roll")
    if said != "degrees":
        check_units(model, [record])
        assert [said in text for text in doubts(model, record)] == ([] if said is None else [True])
    else:
        with pytest.raises(InputError, match=f"column Sway or Roll.*{said}"):
            check_units(model, [record])


def driven(heave, pitch):
    """Return a model of heave and pitch and a record in its truth: by the impedance, with a pitch 15 % stiffer."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 120.0, 0.05)
    M, C, D = np.array([[1400.0, 40.0], [40.0, 800.0]]), np.array([[3e4, -1500.0], [-1500.0, 1.5e4]]), [900.0, 400.0]
    omega = np.linspace(1.5, 9.0, 80)
    F = np.array([[heave], [pitch]]) * rng.standard_normal((2, 80)) * np.exp(2j * np.pi * rng.random((2, 80)))
    Z = C * [[1.0, 1.0], [1.0, 1.15]] - omega[:, None, None] ** 2 * M + 1j * omega[:, None, None] * np.diag(D)
    motion = np.linalg.solve(Z, F.T[:, :, None])[..., 0].T
    x, f = ((part @ np.exp(1j * np.outer(omega, time))).real for part in (motion, F))
    rigid = rss.RadiationFit(("Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    channels = {"Heave": x[0], "Pitch": x[1], "Heave_force": f[0], "Pitch_force": f[1]}
    return (rss.Model(("Heave", "Pitch"), M, np.zeros((2, 2)), C, rigid, D=np.diag(D)),
            rss.Record(time, channels, kind="forced"))


@pytest.fixture(scope="module")
def coupled():
    return driven(400.0, 150.0)


@pytest.mark.parametrize("changed, said", [
    ({}, None), ({"Heave": 1.1, "Heave_force": 0.9}, None), ({"Pitch": -1.0, "Pitch_force": -1.0}, "both signs turned"),
    ({"Heave": -1.0, "Heave_force": -1.0}, "both signs turned"), ({"Pitch_force": -1.0}, "Pitch_force.* turned"),
    ({"Heave": "Pitch"}, "Heave and Pitch exchanged"), ({"Heave_force": "Pitch_force"}, "Pitch_force exchanged"),
    ({"Heave_force": 1.0 / 9.81, "Pitch_force": 1.0 / 9.81}, "kgf"),
    ({"Heave_force": 1.0 / 9.81}, "Heave_force .*kgf")])
def test_columns_that_fit_the_model_when_read_in_another_way_are_told(coupled, changed, said):
    """Two columns exchanged, a sign turned, an axis turned with its force (only the coupling shows it), kgf for N."""
    model, record = coupled
    c, channels = record.channels, {}
    for name, how in changed.items():
        channels |= {name: c[how], how: c[name]} if isinstance(how, str) else {name: how * c[name]}
    try:
        check_units(model, [wrong := record.with_channels(**channels)])
        text = " ".join(doubts(model, wrong))
    except InputError as error:
        text = str(error)
    assert re.search(said, text) if said else not text


def test_a_force_in_the_column_of_one_that_is_zero_is_told():
    model, record = driven(400.0, 0.0)
    assert not record.channels["Pitch_force"].any() and doubts(model, record) == ()
    forces = {"Heave_force": record.channels["Pitch_force"], "Pitch_force": record.channels["Heave_force"]}
    (said,) = doubts(model, record.with_channels(**forces))
    assert "Heave_force and Pitch_force exchanged" in said


def test_waves_that_are_called_a_decay_are_doubted(coupled):
    model, record = coupled
    motions = {dof: record.channels[dof] for dof in model.dofs}
    (said,) = doubts(model, rss.Record(record.time, motions, kind="decay"))
    assert "kind decay: no force acts, but the motion does not die out" in said


def test_a_force_at_another_rate_and_a_column_of_no_motion_of_the_model(coupled):
    """Cells between the samples of a slower sensor are empty, not zero."""
    model, record = coupled
    slow = np.where(np.arange(record.time.size) % 5 == 0, record.channels["Heave_force"], np.nan)
    assert doubts(model, record.with_channels(Heave_force=slow)) == ()
    (said,) = doubts(model, record.with_channels(heave=slow))
    assert "column heave: not used; the model's degrees of freedom are Heave, Pitch" in said
    force = rss.Record(record.time, {"Heave_force": slow})
    with pytest.raises(InputError, match=r"no motion of Heave, Pitch in its columns, Heave_force$"):
        rss.diagnose(model, force)
    with pytest.raises(InputError, match="Pitch_force has 0 samples where four are needed; its columns are"):
        rss.simulate(model, force)


def test_a_record_of_fewer_motions_than_the_model_has_says_how_to_narrow_it(coupled, tmp_path):
    """What the message names is a call that works."""
    model, record = coupled
    heave = rss.Record(record.time, {name: record.channels[name] for name in ("Heave", "Heave_force")})
    with pytest.raises(InputError, match=r"read_model\(path, dofs=\('Heave',\)\)$"):
        rss.simulate(model, heave)
    model.write(tmp_path / "both.nc")
    narrow = rss.read_model(tmp_path / "both.nc", dofs=("Heave",))
    assert rss.simulate(narrow, heave).outputs.shape[-1] == record.time.size


@pytest.mark.parametrize("frequency", [0.5, 1.6])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_force_on_a_driven_body_with_its_sign_turned_is_told_in_a_regular_motion(frequency, sign):
    """Z x of a motion that grows slowly, by its derivatives in closed form."""
    model, time = light(0.02), np.arange(0.0, 200.0, 0.1)
    size, w = np.minimum(time / 40.0, 1.0), frequency
    x, v, a = (0.1 * size * part for part in (np.sin(w * time), w * np.cos(w * time), -w**2 * np.sin(w * time)))
    force = sign * (a + model.D[0, 0] * v + x)
    record = rss.Record(time, {"Roll": x, "Roll_force": force}, kind="prescribed")
    assert bool(turned(model, record)) is (sign < 0.0)
