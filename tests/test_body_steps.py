"""A sampled system taken back to the continuous one, by SciPy's own sampling; plants in anybody's coordinates."""

import control as ct
import numpy as np
import pytest

import radiation_ss as rss
from benchmarks.heave_tank import MASS, STIFFNESS, sea_record, tank, with_force
from radiation_ss.filter import UncertainPlant
from radiation_ss.inference import parametrise

METHODS = ("zoh", "foh", "tustin", "euler", "backward_diff")


def rig(p):
    """Sway and roll with one radiation kernel between them, in scrambled states, roll's outputs first."""
    inertia = np.array([[76.8, -1.5], [-1.5, 1.32]])
    restoring, D = np.diag([60.0, 459.0 * p["GM"]]), np.diag([2.0, p["drag"]])
    g = np.array([[1.0, -0.08]])
    a, b, c = np.array([[0.0, 1.0], [-30.0, -7.0]]), np.array([[0.0], [1.0]]) @ g, g.T @ np.array([[0.0, 160.0]])
    inverse, zero = np.linalg.inv(inertia), np.zeros((2, 2))
    F = np.block([[a, zero, b], [zero, zero, np.eye(2)], [-inverse @ c, -inverse @ restoring, -inverse @ D]])
    G, T = np.vstack([zero, zero, inverse]), np.random.default_rng(3).standard_normal((6, 6)) + 3.0 * np.eye(6)
    return ct.ss(T @ F @ np.linalg.inv(T), T @ G, np.linalg.inv(T)[[3, 2, 5, 4]], np.zeros((4, 2)), name="rig",
                 inputs=["sway_force", "roll_force"], outputs=["roll", "sway", "roll_vel", "sway_vel"])


def driven(seed=0, dt=0.025, duration=20.0):
    """Motion of the rig under a known force that is linear between samples, by python-control."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, duration, dt)
    w, phase = rng.uniform(2.0, 7.0, (2, 60)), rng.uniform(0.0, 6.3, (2, 60))
    force = np.array([[4.0], [0.2]]) * np.cos(w[..., None] * t + phase[..., None]).sum(axis=1)
    roll, sway = ct.forced_response(rig({"GM": 0.066, "drag": 0.35}), t, force).outputs[:2]
    noisy = {k: v + 0.01 * np.std(v) * rng.standard_normal(t.size) for k, v in (("Sway", sway), ("Roll", roll))}
    return rss.Record(t, noisy | {"Sway_force": force[0], "Roll_force": force[1]})


@pytest.mark.parametrize("method", METHODS)
def test_a_system_sampled_by_python_control_is_the_continuous_one(method):
    plant = rig({"GM": 0.066, "drag": 0.35})
    sampled = ct.sample_system(plant, 0.02, method)
    found, expected, w = rss.as_model(sampled), rss.as_model(plant), np.array([1.0, 3.0, 6.0])
    for name in ("M", "C", "D"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.fit.frequency_response(w), expected.fit.frequency_response(w), rtol=1e-6)


def test_what_takes_a_model_takes_a_sampled_system():
    record, plant = driven(duration=12.0), rig({"GM": 0.066, "drag": 0.35})
    sampled = ct.sample_system(plant, 0.025, "zoh")
    np.testing.assert_allclose(rss.simulate(sampled, record).outputs, rss.simulate(plant, record).outputs, atol=1e-9)
    assert rss.diagnose(sampled, record, ["quadratic_drag", "linear_damping"]).verdict.status == "no_gap"
    K = [rss.identify(one, record, "prediction-error", omega=[3.0], draws=100).K.mean for one in (plant, sampled)]
    np.testing.assert_allclose(K[1], K[0], rtol=1e-5, atol=1e-6)


def test_rounding_adds_no_parameter():
    """K(0) = 0 makes a coefficient zero; what a change of coordinates leaves of it there is none to estimate."""
    fit = rss.as_model(rig({"GM": 0.066, "drag": 0.35})).fit
    plain = parametrise(fit, np.eye(2), 0.15)
    for seed in range(20):
        T = np.random.default_rng(seed).standard_normal((2, 2)) * 10.0**seed**0.3 + np.eye(2)
        turned = fit.replace(a=T @ fit.a @ np.linalg.inv(T), b=T @ fit.b, c=fit.c @ np.linalg.inv(T))
        form = parametrise(turned, np.eye(2), 0.15)
        assert form.size == plain.size
        np.testing.assert_allclose(form.mean, plain.mean, rtol=1e-6, atol=1e-9)


def test_a_system_that_is_no_state_space_is_refused_in_a_sentence():
    with pytest.raises(rss.InputError, match=r"TransferFunction found; a ct\.StateSpace"):
        rss.as_model(ct.tf([1.0], [1.0, 1.0, 1.0]))
    with pytest.raises(rss.InputError, match=r"by none of zoh, foh, .*give the continuous"):
        rss.as_model(ct.sample_system(tank().to_ss(), 0.02, "gbt", alpha=0.3))


def test_named_parameters_do_not_depend_on_the_plants_coordinates():
    """A Model, its system, that in other states that turn with the parameters, and sampled: one answer."""
    record, force = sea_record(0, 10.0)
    record = with_force(record, force, 0)
    given = {"mass": (1.1 * MASS, 0.15), "stiffness": (0.95 * STIFFNESS, 0.15)}

    def model(p):
        return tank().replace(M=[[p["mass"]]], C=[[p["stiffness"]]])

    def scrambled(p):
        T = np.random.default_rng(1).standard_normal((5, 5)) + 3.0 * np.eye(5)
        return ct.similarity_transform(model(p).to_ss(), T)

    builds = (model, lambda p: model(p).to_ss(), scrambled, lambda p: ct.sample_system(scrambled(p), 0.01, "foh"))
    first, *others = [rss.DualEnKF(UncertainPlant(one, given), n_ensemble=20).run(record) for one in builds]
    for other in others:
        for name, p in first.parameters.items():    # what differs is the start of the radiation states
            assert abs(other.parameters[name].mean - p.mean) < 0.3 * p.std
            assert other.parameters[name].std == pytest.approx(p.std, rel=0.02)
        late = slice(200, None)
        for part, whole in zip(other.force, first.force):
            np.testing.assert_allclose(part[:, late], whole[:, late], atol=1e-3 * force.std())


def test_identify_and_diagnose_take_a_plant_with_named_parameters():
    """Its medians are the model; roll's stiffness is as unsure as GM is, so that 8 % off are found and no effect."""
    record = driven(1)
    plant = UncertainPlant(rig, {"GM": (0.061, 0.1), "drag": (0.35, 0.1)})
    model = rss.as_model(plant)
    assert model.tolerance["stiffness"] == pytest.approx(0.1, rel=0.1) and "mass" not in model.tolerance
    found = rss.identify(plant, record, "prediction-error", omega=[3.0, 4.0])
    change = found.parameters["stiffness [Roll]"]
    assert change["prior_std"] == pytest.approx(model.tolerance["stiffness"])
    assert abs(change["mean"] - (0.066 / 0.061 - 1.0)) < 3.0 * change["std"] + 0.005
    (said,) = [text for text in found.warnings if "stiffness" in text]
    assert f"tolerance {model.tolerance['stiffness']:.1%}" in said
    considered = ["linear_stiffness", "added_inertia", "quadratic_drag", "linear_damping"]
    assert rss.diagnose(plant, record, considered, tolerance=dict(model.tolerance)).verdict.status == "no_gap"
