"""Noise of one sensor in the rows of two motions: taken out of each, and what is left is what the rows state."""

import numpy as np

import radiation_ss as rss
from radiation_ss.effects import tolerances
from radiation_ss.inference import equation_error, force_noise, measured_motion


def test_the_noise_of_a_free_sway_leaves_the_roll_that_it_is_coupled_with():
    inertia, stiffness, damping = np.array([[276.0, 10.4], [10.4, 13.7]]), np.diag([0.0, 157.0]), np.diag([40.0, 5.0])
    fit = rss.RadiationFit(("Sway", "Roll"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Sway", "Roll"), inertia, np.zeros((2, 2)), stiffness, fit, damping)
    rng, time = np.random.default_rng(4), np.arange(0.0, 120.0, 0.04)
    omega = np.linspace(2.0, 5.0, 40)
    force = rng.normal(size=(2, 40)) * np.exp(2j * np.pi * rng.random((2, 40))) * np.array([[30.0], [2.0]])
    Z = stiffness - omega[:, None, None] ** 2 * inertia + 1j * omega[:, None, None] * damping
    motion = np.linalg.solve(Z, force.T[:, :, None])[:, :, 0].T
    wave = np.exp(1j * np.outer(omega, time))
    x, f = (motion @ wave).real, (force @ wave).real
    x = x + np.array([[5e-4], [3e-4]]) * rng.standard_normal(x.shape)
    channels = {"Sway": x[0], "Roll": x[1], "Sway_force": f[0], "Roll_force": f[1]}
    run = measured_motion(model, rss.Record(time, channels, kind="waves", name="sea"))
    problem = equation_error(model, [run], tolerances(0.02))
    for place in problem.places:
        ratio = problem.rows.error[place.rows] ** 2 / problem.rows.noise[place.rows]
        assert 0.6 < np.median(ratio) / 0.455 < 1.6  # the median of chi squared with one degree of freedom
    roll = problem.places[1]
    alone = np.tile(force_noise(model, run, roll), len(run.basis))
    assert np.median(problem.rows.noise[roll.rows] / alone) < 0.6


def test_of_a_decay_the_late_rows_lose_the_other_sensor_s_noise():
    """Large motion at the start says nothing of what the model's error of the small one later is."""
    inertia, stiffness, damping = np.array([[54.0, 2.6], [2.6, 3.3]]), np.diag([64.0, 23.0]), np.diag([6.0, 0.3])
    fit = rss.RadiationFit(("Surge", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Surge", "Pitch"), inertia, np.zeros((2, 2)), stiffness, fit, damping)
    rng, time = np.random.default_rng(7), np.arange(0.0, 80.0, 0.05)
    F, _ = model.matrices()
    values, vectors = np.linalg.eig(F)
    x = (vectors[:2] @ (np.exp(np.outer(values, time)) * np.linalg.solve(vectors, [0.2, 0.0, 0.0, 0.0])[:, None])).real
    x = x + np.array([[1e-3], [5e-5]]) * rng.standard_normal(x.shape)
    run = measured_motion(model, rss.Record(time, {"Surge": x[0], "Pitch": x[1]}, kind="decay", name="surge"))
    problem = equation_error(model, [run], tolerances(0.02))
    surge, pitch = problem.places
    noise, ratio = problem.rows.noise[pitch.rows], problem.rows.error[pitch.rows] ** 2 / problem.rows.noise[pitch.rows]
    assert 0.5 < np.median(ratio[noise.size // 2:]) / 0.455 < 2.0  # chi squared of one degree of freedom
    kept = (noise.reshape(-1, pitch.bins) / force_noise(model, run, pitch))[:, : surge.bins]
    assert np.all(kept[-1] < kept[0] + 1e-9) and kept[-1].min() < 0.5 * kept[0].min()
