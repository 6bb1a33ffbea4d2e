"""Bad samples of a load cell and a wave gauge: left out where the motion does not answer, never from a blow."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from seeds import some

import radiation_ss as rss
from radiation_ss.simulation import measured_driven, measured_freely, without_spikes_of_force

MASS, ADDED, STIFF = 50.0, 30.0, 3000.0
GAIN, P, Q = 300.0, 8.0, 60.0  # K(s) = GAIN s / (s^2 + P s + Q)
STEP = 0.05
TIME = np.arange(0.0, 40.0, STEP)


def known(**more):
    fit = rss.RadiationFit(("Heave",), [[-P, -Q], [1.0, 0.0]], [[GAIN], [0.0]], [[1.0, 0.0]], 2)
    return rss.Model(("Heave",), [[MASS]], [[ADDED]], [[STIFF]], fit, **more)


def moved(force, time=TIME, drag=0.0, stop=np.inf):
    """Return displacement, velocity and acceleration by SciPy, of a force that is linear between its samples."""
    def rate(t, y):
        x, v, r, s = y
        push = np.interp(t, time, force) - STIFF * x - r - drag * abs(v) * v - 1e5 * max(x - stop, 0.0)
        return [v, push / (MASS + ADDED), GAIN * v - P * r - Q * s, r]

    y = solve_ivp(rate, time[[0, -1]], np.zeros(4), t_eval=time, max_step=0.5 * STEP, rtol=1e-8, atol=1e-10).y
    return y[0], y[1], np.array([rate(t, y[:, k])[1] for k, t in enumerate(time)])


def random_force(rng, time=TIME, low=3.0, high=10.0):
    omega, phase = np.sort(rng.uniform(low, high, 40)), rng.uniform(0.0, 2.0 * np.pi, 40)
    force = np.cos(np.outer(time, omega) + phase).sum(axis=1)
    return 40.0 * force / force.std()


def read(rng, values, share=0.01):
    return values + share * values.std() * rng.standard_normal(values.size)


SENSORS = {"Heave": 0, "Heave_velocity": 1, "Heave_acceleration": 2}


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("size, drag", [(4.0, 0.0), (10.0, 0.0), (10.0, 60.0)])
def test_a_bad_sample_of_a_load_cell_is_left_out_and_a_blow_is_not(size, drag, sensor):
    """The same reading of the force twice: once no force of one sample acts, once it does."""
    for seed in some(range(3)):
        rng = np.random.default_rng(seed)
        force = random_force(rng)
        at = np.sort(rng.choice(np.arange(60, TIME.size - 60, 30), 3, replace=False))
        struck = force.copy()
        struck[at] += size * force.std() * rng.choice([-1.0, 1.0], at.size)
        for acting, expected in ((force, at), (struck, at[:0])):
            motion = read(rng, moved(acting, drag=drag)[SENSORS[sensor]])
            record = rss.Record(TIME, {sensor: motion, "Heave_force": read(rng, struck)}, kind="forced", name="run 7")
            kept, said = measured_freely(known(), record)
            missing = np.flatnonzero(np.isnan(kept.channels["Heave_force"]))
            assert np.array_equal(missing, expected), (seed, acting is struck)
            assert len(said) == bool(expected.size)
            if said:
                assert f"Heave_force of run 7: 3 of {TIME.size} samples stand apart" in said[0]
                assert all(f"{TIME[k]:.4g}" in said[0] for k in at)


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_blow_that_is_read_too_large_or_too_small_stays(times):
    """A gain that is off: the motion has of each blow another size than the model says, but it has it."""
    rng = np.random.default_rng(1)
    force = random_force(rng)
    force[[200, 411, 630]] += 8.0 * force.std()
    record = rss.Record(TIME, {"Heave": read(rng, moved(force)[0]), "Heave_force": times * force}, kind="forced")
    assert without_spikes_of_force(known(), record) == (record, ())


def test_forces_that_jump_lose_no_sample():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(TIME.size)
    taps = np.zeros(TIME.size)
    taps[100:-60:150] = 400.0
    forces = {"square": 40.0 * np.sign(np.sin(1.3 * TIME)), "steps": np.repeat(40.0 * noise[:40], 20), "taps": taps,
              "held by a converter": random_force(rng)[np.arange(TIME.size) // 6 * 6], "white": 40.0 * noise,
              "short pulses": 40.0 * (np.arange(TIME.size) % 97 < 2), "saw": 40.0 * (TIME % 3.0)}
    for what, force in forces.items():
        x = read(rng, moved(force)[0])
        for seen in (force, read(rng, force)):
            record = rss.Record(TIME, {"Heave": x, "Heave_force": seen}, kind="forced")
            assert without_spikes_of_force(known(), record) == (record, ()), what


def test_what_cannot_be_told_stays():
    """A spike that would move the body less than the sensor's noise, and one of a body whose motion is not measured."""
    rng = np.random.default_rng(3)
    force = random_force(rng)
    x = moved(force)[0]
    force[300] += 4.0 * force.std()
    faint = rss.Record(TIME, {"Heave": read(rng, x, 10.0), "Heave_force": force}, kind="forced")
    assert without_spikes_of_force(known(), faint) == (faint, ())
    unseen = rss.Record(TIME, {"Heave_force": force}, kind="forced")
    assert without_spikes_of_force(known(), unseen) == (unseen, ())


def test_a_load_cell_of_a_driven_body_and_a_wave_gauge():
    rng = np.random.default_rng(5)
    force = random_force(rng)
    x = moved(force)[0]
    at = np.array([150, 420])
    spiked, elevation = read(rng, force), read(rng, random_force(rng))
    spiked[at] += 10.0 * force.std()
    record = rss.Record(TIME, {"Heave": read(rng, x, 1e-3), "Heave_force": spiked}, kind="prescribed")
    kept, said = measured_driven(known(), record)
    assert np.array_equal(np.flatnonzero(np.isnan(kept.channels["Heave_force"])), at) and len(said) == 1
    assert np.array_equal(kept.channels["Heave"], record.channels["Heave"])
    elevation[at] += 6.0 * elevation.std()
    gauge = rss.Record(TIME, {"Heave": read(rng, x), "wave_elevation": elevation}, kind="waves")
    kept, said = measured_freely(known(), gauge)
    assert np.array_equal(np.flatnonzero(np.isnan(kept.channels["wave_elevation"])), at) and len(said) == 1


def test_a_rig_that_jerks_makes_a_force_of_one_sample():
    """The speed of a driven body jumps: its inertia is in the load cell for one sample, and no spike."""
    rng = np.random.default_rng(6)
    since = np.maximum(TIME - TIME[400], 0.0)
    x = 0.05 * np.sin(3.0 * TIME) + 0.3 * since * np.exp(-since)
    v = np.gradient(x, STEP)
    force = (MASS + ADDED) * np.gradient(v, STEP) + STIFF * x
    force[399:402] = 0.05 * (STIFF - 9.0 * (MASS + ADDED)) * np.sin(3.0 * TIME[399:402])
    force[400] += (MASS + ADDED) * 0.3 / STEP
    record = rss.Record(TIME, {"Heave": read(rng, x, 1e-3), "Heave_force": read(rng, force, 1e-3)}, kind="prescribed")
    assert measured_driven(known(), record) == (record, ())


def test_one_bad_sample_is_no_saturation():
    rng = np.random.default_rng(2)
    force = random_force(rng)
    x, seen = moved(force)[0], read(rng, force)
    seen[352] += 6.0 * force.std()
    record = rss.Record(TIME, {"Heave": read(rng, x), "Heave_force": seen}, kind="forced")
    found = rss.diagnose(known(), record, effects=["actuator_saturation", "quadratic_drag", "cubic_stiffness"])
    assert found.verdict.status == "no_gap"
    assert any("1 of 800 samples stand apart" in note and "17.6 s" in note for note in found.notes)
