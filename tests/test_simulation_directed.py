"""Effects that couple two degrees of freedom one way: the first with the second is not the second with the first."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from plant_bodies import coupled_model

import radiation_ss as rss
from radiation_ss import RadiationFit
from radiation_ss.diagnosis import unit_of
from radiation_ss.effects import (
    Effect,
    Parameter,
    Scales,
    activate,
    effect_named,
    library,
    optional,
    slab,
)
from radiation_ss.errors import InputError
from radiation_ss.simulation import nonlinear_system, simulate

DOFS = ("Sway", "Heave")
TIME = np.arange(0.0, 30.0, 0.02)
START = np.array([0.9, -0.7])  # displacements
SLOPE = 4e5  # a quarter of the inertia for each metre


def lossless():
    """Two degrees of freedom without any damping, memory included."""
    model = coupled_model(DOFS)
    fit = model.fit
    return model.replace(fit=RadiationFit(DOFS, fit.a, 0.0 * fit.b, 0.0 * fit.c, fit.order))


def released(model, effects):
    """Return displacements and velocities of a body let go."""
    start = np.concatenate([np.zeros(model.fit.states), START, np.zeros(2)])
    found = np.asarray(simulate(model, (TIME, np.zeros((2, TIME.size))), effects, start=start).outputs)
    return found[:2], found[2:4]


def energy(model, x, v, slope, first, second):
    """Return kinetic and potential energy with the inertia of `first` growing with the position of `second`."""
    inertia = model.M + model.A_inf
    linear = 0.5 * np.einsum("it,ij,jt->t", v, inertia, v) + 0.5 * np.einsum("it,ij,jt->t", x, model.C, x)
    return linear + 0.5 * slope * x[second] * v[first] ** 2


@pytest.mark.parametrize("first, second", [(0, 1), (1, 0)])
def test_immersion_keeps_the_energy_of_its_lagrangian(first, second):
    model = lossless()
    x, v = released(model, [("immersion", f"{DOFS[first]},{DOFS[second]}", {"slope": SLOPE})])
    total = energy(model, x, v, SLOPE, first, second)
    drift = np.ptp(total) / total[0]
    # What the integrator itself loses of a linear motion, whose energy it keeps no better.
    plain = energy(model, *released(model, []), 0.0, first, second)
    assert drift < 10.0 * np.ptp(plain) / plain[0] + 1e-6
    # Either half of the law alone would show.
    assert np.ptp(0.5 * SLOPE * x[second] * v[first] ** 2) / total[0] > 100.0 * drift


def test_the_two_directions_are_different_laws():
    model = lossless()
    one, other = (released(model, [("immersion", places, {"slope": SLOPE})])[0]
                  for places in ("Sway,Heave", "Heave,Sway"))
    assert np.abs(one - other).max() > 0.1 * np.abs(one).max()


def test_crossflow_drag_of_pure_motions_is_the_textbooks():
    """All strips alike in sway: -c |v| v. In yaw the mean of |r|^3 over the length: -c L^3 / 32 |w| w (Faltinsen)."""
    law, p = effect_named("crossflow_drag").force, SimpleNamespace(coefficient=7.0, length=5.0)
    for v, w, force, moment in ((-1.2, 0.0, 7.0 * 1.44, 0.0), (0.0, 0.3, 0.0, -7.0 * 125.0 / 32.0 * 0.09)):
        found = law(SimpleNamespace(v=v, other=SimpleNamespace(v=w)), p)
        np.testing.assert_allclose(np.array(found, dtype=float), (force, moment), rtol=0.01, atol=1e-12)


def test_crossflow_drag_takes_the_work_of_all_strips():
    model = lossless()
    model = model.replace(dofs=("Heave", "Pitch"), fit=replace(model.fit, dofs=("Heave", "Pitch")))
    x, v = released(model, [("crossflow_drag", "Heave,Pitch", {"coefficient": 2e5, "length": 2.0})])
    total = energy(model, x, v, 0.0, 0, 1)
    arms = 2.0 * ((np.arange(400) + 0.5) / 400 - 0.5)
    rate = 2e5 * np.mean(np.abs(v[0] + arms[:, None] * v[1]) ** 3, axis=0)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(TIME))])
    assert work[-1] > 0.1 * total[0]
    assert np.abs(total[0] - total - work).max() < 5e-3 * total[0]


@pytest.mark.parametrize("amplitude, omega", [(0.3, 1.1), (0.02, 7.0)])
def test_drift_force_of_a_harmonic_motion_is_steady(amplitude, omega):
    """-c times the squared amplitude of the velocity, nothing at twice the frequency."""
    phase = omega * TIME
    s = SimpleNamespace(x=amplitude * np.cos(phase), v=-amplitude * omega * np.sin(phase),
                        a=-amplitude * omega**2 * np.cos(phase))
    force = effect_named("drift_force").force(s, SimpleNamespace(coefficient=120.0))
    np.testing.assert_allclose(force, -120.0 * (amplitude * omega) ** 2, rtol=1e-12)


def test_places_of_each_scope():
    dofs = ("Sway", "Heave", "Roll")
    force = {"parameters": {"c": Parameter("F")}, "force": lambda s, p: p.c}
    assert Effect("a", scope="body", **force).places(dofs) == [("", "")]
    assert Effect("a", scope="dof", **force).places(dofs) == [(d, "") for d in dofs]
    hulls = Effect("a", scope="pair", modes=("Heave,Pitch",), **force)
    assert hulls.places(("a__Pitch", "a__Heave", "b__Heave", "b__Pitch", "a__Sway")) == [
        ("a__Heave", "a__Pitch"), ("b__Heave", "b__Pitch")]
    pairs = Effect("a", scope="pair", **force).places(dofs)
    assert pairs == [("Sway", "Heave"), ("Sway", "Roll"), ("Heave", "Roll")]
    assert set(Effect("a", scope="directed", **force).places(dofs)) == {*pairs, *((b, a) for a, b in pairs)}
    assert all(not Effect("a", scope=scope, **force).places(dofs[:1]) for scope in ("pair", "directed"))
    with pytest.raises(InputError, match="directed"):
        Effect("a", scope="both", **force)


def test_an_optional_effect_is_known_by_name_only():
    assert set(optional()) >= {"immersion", "drift_force"} and not set(optional()) & set(library())
    (active,) = activate([("immersion", "Heave", {"slope": 1.0})], DOFS)
    assert (active.label, active.other) == ("immersion on Heave with Sway", "Sway")
    assert activate([("coupling_inertia", "Sway", {"inertia": 1.0})], DOFS)[0].label.endswith("Sway and Heave")
    assert unit_of("F/(X/s^2)/Y", "Sway", "Roll") == "N/(m/s^2)/rad"


def test_a_prior_knows_the_size_of_the_other_motion():
    small = Scales(x=0.1, v=0.1, a=0.2, u=1.0, force=3.0, omega=1.0, duration=40.0,
                   other=Scales(x=0.02, v=0.02, a=0.02, u=1.0, force=3.0, omega=1.0, duration=40.0))
    assert slab(effect_named("cross_axis"), "share", small).sd == pytest.approx(0.1 * 0.1 / 0.02)
    # One without a scale of its own: 0.12 of the restoring force where x times the other's x is of its typical size.
    product = Effect("product", {"k": Parameter("F/X/Y")}, lambda s, p: -p.k * s.x * s.other.x, scope="directed")
    rms = np.sqrt(1.5) * 0.1 * 0.02  # of 2 a b cos^2
    assert slab(product, "k", small).sd == pytest.approx(0.12 * 3.0 / rms)


def test_a_directed_effect_moves_the_body_as_by_python_control():
    """python-control's own integrator of the system with the effect gives the same motion as simulate."""
    import control as ct

    model = coupled_model(DOFS)
    effect = Effect("tilted", {"k": Parameter("F/X/Y")}, scope="directed",
                    force=lambda s, p: (-p.k * s.x * s.other.x, -0.5 * p.k * s.x**2))
    active = rss.effects.Active(effect, "Sway", {"k": 3e5}, "Heave")
    time = np.arange(0.0, 20.0, 0.02)
    force = np.stack([6e5 * np.cos(0.9 * time), 5e5 * np.sin(0.7 * time)])
    result = ct.input_output_response(nonlinear_system(model, [active]), time, force,
                                      solve_ivp_kwargs={"rtol": 1e-8, "atol": 1e-10})
    expected = np.asarray(simulate(model, (time, force), [active]).outputs[:2])
    plain = np.asarray(simulate(model, (time, force)).outputs[:2])
    assert np.abs(result.outputs[:2] - expected).max() < 5e-3 * np.abs(expected).max()
    assert np.abs(plain - expected).max() > 0.1 * np.abs(expected).max()


@pytest.mark.parametrize("place, seed", [("Sway,Heave", 0), ("Heave,Sway", 1)])
def test_diagnose_names_the_direction(place, seed):
    model, rng = coupled_model(DOFS, seed), np.random.default_rng(seed)
    time, name, key, value = np.arange(0.0, 120.0, 0.25), "immersion", "slope", 3e5
    records = []
    for k in range(2):
        omega, phase = rng.uniform(0.4, 1.2, (2, 6)), rng.uniform(0.0, 6.28, (2, 6))
        force = 2e5 * np.cos(omega[:, :, None] * time + phase[:, :, None]).sum(axis=1)
        motion = np.asarray(simulate(model, (time, force), [(name, place, {key: value})]).outputs[:2])
        noise = 1e-3 * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
        channels = dict(zip(DOFS, motion + noise)) | {f"{d}_force": f for d, f in zip(DOFS, force)}
        records.append(rss.Record(time, channels, kind="forced", name=f"r{k}"))
    found = rss.diagnose(model, records, ["quadratic_drag", "cubic_stiffness", "linear_damping", "immersion"])
    assert found.verdict.status == "effect"
    (named,) = found.verdict.effects
    assert (named.name, named.dof) == (name, place)
    estimate, deviation = named.parameters[key]
    assert abs(estimate - value) < 4.0 * deviation + 0.02 * value  # model numbers may be off by 2 %
    assert place in str(found)
