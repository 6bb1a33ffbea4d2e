"""Driven motions with the force measured, made here from phasors: what a diagnosis says of the force's error."""

import numpy as np
import pytest

import radiation_ss as rss

TIME = np.arange(0.0, 40.0, 0.02)


def model_of(dof, inertia, added, stiffness, memory):
    c1, c0, gain = memory
    fit = rss.RadiationFit((dof,), np.array([[0.0, 1.0], [-c0, -c1]]), np.array([[0.0], [1.0]]),
                           np.array([[0.0, gain]]), 2)
    return rss.Model((dof,), [[inertia]], [[added]], [[stiffness]], fit)


def driven(dof, numbers, size, middle, hidden, seed):
    """A sum of twelve sines; the true body's inertia, memory and stiffness are 1, -1.5 and 1.2 % off the model's."""
    rng = np.random.default_rng(seed)
    omega = middle * np.linspace(0.5, 1.6, 12)
    phasor = size / 3.0 * rng.uniform(0.4, 1.0, 12) * np.exp(2j * np.pi * rng.random(12))
    inertia, added, stiffness, (c1, c0, gain) = numbers
    memory = gain * 1j * omega / (c0 - omega**2 + 1j * omega * c1)
    x, v, linear = (np.real((phasor * part) @ np.exp(1j * np.outer(omega, TIME))) for part in (
        1.0, 1j * omega, 1.012 * stiffness - 1.01 * omega**2 * (inertia + added) + 0.985j * omega * memory))
    force = linear + hidden(x, v)
    noise = rng.standard_normal((2, TIME.size))
    return rss.Record(TIME, {dof: x + 2e-3 * x.std() * noise[0],
                             f"{dof}_force": force + 5e-3 * force.std() * noise[1]}, kind="prescribed", name=f"{seed}")


HEAVE = ("Heave", (40.0, 30.0, 2300.0, (3.0, 20.0, 120.0)), 0.05, 5.0)
SWAY = ("Sway", (40.0, 20.0, 0.0, (3.0, 20.0, 120.0)), 0.08, 4.0)
ROLL = ("Roll", (1.0, 0.3, 20.0, (3.0, 16.0, 0.6)), 0.12, 4.0)


@pytest.mark.parametrize("test, hidden, told", [
    (HEAVE, lambda x, v: 60.0 * v * np.abs(v), {"quadratic_drag": 60.0}), (HEAVE, lambda x, v: 0.0 * v, {}),
    (SWAY, lambda x, v: 80.0 * v * np.abs(v), {"quadratic_drag": 80.0}), (SWAY, lambda x, v: 0.0 * v, {}),
    (ROLL, lambda x, v: 0.06 * np.tanh(v / 0.01) + 150.0 * x**3, {"coulomb_friction": 0.06, "cubic_stiffness": 150.0}),
    (ROLL, lambda x, v: 0.0 * v, {})])
def test_driven_heave_sway_and_roll_tell_effects_with_their_size_and_no_others(test, hidden, told):
    dof, numbers, size, middle = test
    seen = [driven(dof, numbers, size * share, middle, hidden, seed) for seed, share in ((1, 0.8), (2, 1.0))]
    found = rss.diagnose(model_of(dof, *numbers), seen, withhold=[driven(dof, numbers, 0.9 * size, middle, hidden, 9)])
    assert {e.name for e in found.verdict.effects} == set(told)
    for effect in found.verdict.effects:
        value, deviation = next(iter(effect.parameters.values()))
        assert abs(value - told[effect.name]) < max(3.0 * deviation, 0.03 * told[effect.name])
    assert found.how_far.gap_after < 0.02 and 0.003 < found.how_far.noise_floor < 0.02
