"""What a random force does to a body, as the rows of its motion see it; the truth by python-control's response."""

import control as ct
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.signal import freqz, lfilter
from seeds import some

import radiation_ss as rss
from radiation_ss.inference import compliance, measured_motion, narrow_resonance, noise_at_resonance, projected_on

INERTIA, DAMPING, STIFFNESS = 10.0, 1.0, 40.0  # kg, N s/m, N/m: 2 rad/s, 2.5 % of critical damping
MODEL = rss.body(dof="Sway", mass=INERTIA, added_mass=0.0, C=STIFFNESS,
                 damping_ratio=0.5 * DAMPING / np.sqrt(STIFFNESS * INERTIA))


@pytest.mark.parametrize("seed", some(range(2)))
def test_variance_of_rows_by_white_force(seed):
    """Every row within chance, although the resonance is an eighth of a bin wide and stands in all windows' tails.

    Of B blocks the mean square of a row has a standard deviation of sqrt(2 / B) where they are independent; a motion
    that rings for 2/(damping ratio x frequency) makes about this time's blocks to one.
    """
    rng, time = np.random.default_rng(seed), np.arange(0.0, 1500.0, 0.04)
    force = rng.standard_normal(time.size + 5000)
    body = ct.ss([[0.0, 1.0], [-STIFFNESS / INERTIA, -DAMPING / INERTIA]], [[0.0], [1.0 / INERTIA]], [[1.0, 0.0]], 0)
    moved = ct.forced_response(body, 0.04 * np.arange(force.size), force).outputs[5000:]
    run = measured_motion(MODEL, rss.Record(time, {"Sway": moved, "Sway_force": force[5000:]}, kind="forced"))
    moving, pushing = (np.mean(projected_on(run.basis, values[0])[1:-1] ** 2, axis=0)
                       for values in (run.raw, run.force))
    spread = moving / (compliance(MODEL, run)[0] @ pushing)
    blocks = len(run.basis) - 2
    ringing = 2.0 / (0.025 * 2.0) * blocks / time[-1] + 1.0
    assert np.abs(np.log(spread)).max() < 5.0 * np.sqrt(2.0 * ringing / blocks)


def test_all_motion_by_white_force_is_in_the_rows():
    """Rows are orthonormal: their variances add up to that of the motion, the integral of |1/Z|^2."""
    time = np.arange(0.0, 4000.0, 0.1)
    record = rss.Record(time, {"Sway": np.sin(2.0 * time) + 1e-3 * np.random.default_rng(0).standard_normal(time.size),
                               "Sway_force": 0.0 * time}, kind="forced")
    run = measured_motion(MODEL, record)
    whole = quad(lambda w: 1.0 / abs(STIFFNESS - w**2 * INERTIA + 1j * w * DAMPING) ** 2, 0.0, 100.0, points=[2.0],
                 limit=500)[0] / np.pi * run.dt
    rows = compliance(MODEL, run)[0].sum() * len(run.basis) / run.time.size
    assert rows == pytest.approx(whole, rel=0.05)  # T is 200 times as long as the motion rings


def test_damping_of_an_effect_is_damping_of_the_model():
    """The same whether it is in the model or in what the impedance is less by, but for frequencies beyond the bins'."""
    time = np.arange(0.0, 400.0, 0.1)
    record = rss.Record(time, {"Sway": np.sin(2.0 * time), "Sway_force": 0.0 * time}, kind="forced")
    run = measured_motion(MODEL, record)
    more = MODEL.replace(D=[[4.0 * DAMPING]])
    Z = STIFFNESS - run.omega_fine**2 * INERTIA + 1j * run.omega_fine * DAMPING
    change = -3j * run.omega_fine * DAMPING / Z
    np.testing.assert_allclose(compliance(MODEL, run, change[:, None]), compliance(more, run), rtol=1e-5)


def test_a_free_body_goes_as_far_as_the_record_is_long():
    """Nothing restores it: the slowest force moves it most, by a finite way."""
    time = np.arange(0.0, 400.0, 0.1)
    record = rss.Record(time, {"Sway": np.sin(2.0 * time), "Sway_force": 0.0 * time}, kind="forced")
    run = measured_motion(MODEL, record)
    found = compliance(MODEL.replace(C=[[0.0]]), run)[0]
    assert np.all(np.isfinite(found)) and found.sum() < 1.0 / (INERTIA / time[-1] ** 2) ** 2
    assert np.argmax(found.sum(axis=1)) == 0


@pytest.mark.parametrize("share", [0.25, 4.0])
def test_a_narrow_resonance_is_moved_as_one_and_a_wide_one_row_by_row(share):
    """Fourier components at the resonance make most of the motion by a white force, and how blocks go together.

    40 records of 300 s show both within chance.
    """
    model = MODEL.replace(D=[[share * DAMPING]])
    rng, time, start = np.random.default_rng(3), np.arange(0.0, 300.0, 0.2), 1000
    (F, G), paths = model.matrices(), []
    body = ct.ss(F, G, [[1.0, 0.0]], 0)
    for _ in range(40):
        force = rng.standard_normal(time.size + start)
        response = ct.forced_response(body, 0.2 * np.arange(force.size), force)
        # The start is free in every fit: what rings on from before is none of the record's.
        before = ct.forced_response(body, time, 0.0, response.states[:, start]).outputs
        paths.append(response.outputs[start:] - before)
    run = measured_motion(model, rss.Record(time, {"Sway": paths[0], "Sway_force": force[start:]}, kind="forced"))
    at, bins = narrow_resonance(model, run, 0), run.basis[0].omega
    assert (at.size > 0) == (share < 1.0)
    if not at.size:
        return
    assert at.min() < np.sqrt(STIFFNESS / INERTIA) < at.max()
    size = np.sqrt(2.0 * 0.2 / run.dt / run.time.size)  # of a force that is white in finer steps
    forces = size * np.concatenate([wave(at[:, None] * run.time) for wave in (np.cos, np.sin)])
    k, middle = int(np.argmin(np.abs(bins - 2.0))), slice(len(run.basis) // 4, -len(run.basis) // 4)
    rows, made = (projected_on(run.basis, some)[:, middle, k]
                  for some in (CubicSpline(time, paths, axis=1)(run.time),
                               np.array([ct.forced_response(body, run.time, f).outputs for f in forces])))
    one = np.mean(rows**2)
    assert abs(np.log(np.mean(np.sum(made**2, axis=0)) / one)) < 0.2 + 5.0 * np.sqrt(2.0 / 40.0)
    together, told = (np.mean(np.sum(some[:, :-1] * some[:, 1:], axis=0)) / count for some, count in
                      ((rows, len(paths)), (made, 1)))
    assert abs(told - together) < 5.0 * one * np.sqrt(1.0 / 40.0)
    assert abs(told) > 0.2 * one


def test_noise_of_a_recorded_force_moves_a_body_at_its_resonance():
    """A quiet sea, and white noise on the force alone: by SciPy's response to it, as large as what is said."""
    rng, time = np.random.default_rng(5), np.arange(0.0, 300.0, 0.1)
    model = MODEL.replace(D=[[0.25 * DAMPING]])
    sea, noise = np.sin(5.0 * time) + np.sin(5.5 * time), 0.1 * rng.standard_normal((20, time.size))
    body = ct.ss(*model.matrices(), [[1.0, 0.0]], 0)
    record = rss.Record(time, {"Sway": ct.forced_response(body, time, sea).outputs, "Sway_force": sea + noise[0]},
                        kind="waves")
    run = measured_motion(model, record)
    made = np.array([ct.forced_response(body, run.time, f).outputs for f in noise_at_resonance(model, run, 0)])
    true = np.array([ct.forced_response(body, time, f).outputs for f in noise])
    assert abs(np.log(np.mean(np.sum(made**2, axis=0)) / np.mean(true**2))) < 0.2 + 5.0 * np.sqrt(2.0 / 20.0)
    still = measured_motion(model, rss.Record(time, {"Sway": np.exp(-0.02 * time) * np.cos(2.0 * time)}, kind="decay"))
    assert not noise_at_resonance(model, still, 0).size


@pytest.mark.parametrize("colour", [0.0, 0.7, 0.9])
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_sensor_in_the_band_of_the_motion_by_its_colour(seed, colour):
    """Truth by SciPy's response of the filter that makes the noise; below the motion are too few frequencies to tell.

    Far above the motion 7000 samples tell the level to a few per cent, but at the motion its colour and a tail leave
    a factor of 2. White noise of the level there is 3.5 to 11 times too small.
    """
    rng, time = np.random.default_rng([seed, 5]), np.arange(0.0, 350.0, 0.05)
    omega = rng.uniform(1.5, 2.5, 40)
    heave = np.cos(np.outer(time, omega) + rng.uniform(0.0, 6.3, 40)).sum(axis=1)
    noise = lfilter([1.0], [1.0, -colour], 0.02 * rng.standard_normal(time.size + 100))[100:]
    run = measured_motion(MODEL, rss.Record(time, {"Sway": heave + noise, "Sway_force": 0.0 * time}, kind="forced"))
    at = run.basis[0].omega
    there = (at > 1.0) & (at < 6.0)
    truth = 0.02 * np.abs(freqz([1.0], [1.0, -colour], at[there] * 0.05)[1]) * np.sqrt(0.05 / run.dt)
    ratio = run.noise[0, there] / truth
    assert 0.5 < ratio.min() and ratio.max() < 2.0


@pytest.mark.parametrize("step", [0.107, 0.13, 0.151])
def test_noise_of_a_sensor_is_the_same_where_ends_of_a_record_are_left_out(data, step):
    """Whatever the steps are: the ends whose force by the elevation is unsure hold no whole number of them."""
    hydro = rss.read_hydro(data / "bem" / "formats" / "sphere_capytaine.nc").select(["Heave"])
    model, rng = rss.Model.from_hydro(hydro, order=4), np.random.default_rng(5)
    time, omega = np.arange(0.0, 400.0, step), rng.uniform(0.8, 1.6, 40)
    sea = np.cos(np.outer(time, omega) + rng.uniform(0.0, 6.3, 40)).sum(axis=1)
    noise = 0.02 * rng.standard_normal(time.size)
    run = measured_motion(model, rss.Record(time, {"Heave": sea + noise, "wave_elevation": sea}, kind="waves"))
    assert run.time[0] > 1.0
    ratio = run.noise[0] / (0.02 * np.sqrt(step / run.dt))
    assert 0.5 < ratio.min() and ratio.max() < 2.0
