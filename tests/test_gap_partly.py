"""A part of a gap whose whole cause is unknown: told where it is beyond doubt, and only there."""

import numpy as np
import pytest
from plant_bodies import coupled_model

import radiation_ss as rss
from radiation_ss.simulation.run import simulate

DOFS = ("Sway", "Heave")
TIME = np.arange(0.0, 120.0, 0.25)


def records(effects, seed):
    """Return model and two forced runs of the body with effects."""
    model, rng = coupled_model(DOFS), np.random.default_rng(seed)
    found = []
    for k in range(2):
        omega, phase = rng.uniform(0.4, 1.2, (2, 6)), rng.uniform(0.0, 6.28, (2, 6))
        force = 1.2e5 * np.cos(omega[:, :, None] * TIME + phase[:, :, None]).sum(axis=1)
        motion = np.asarray(simulate(model, (TIME, force), effects).outputs[:2])
        motion += 1e-3 * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
        channels = dict(zip(DOFS, motion)) | {f"{d}_force": f for d, f in zip(DOFS, force)}
        found.append(rss.Record(TIME, channels, kind="forced", name=f"r{k}"))
    return model, found


@pytest.mark.parametrize("hardening, slope", [(2e5, 3e5), (3e5, 4e5)])
def test_a_sure_part_of_an_unknown_cause_is_told(hardening, slope):
    """Hardening in sway is not among the laws that are offered; immersion is, and is real."""
    hidden = [("cubic_stiffness", "Sway", {"stiffness": hardening}), ("immersion", "Sway,Heave", {"slope": slope})]
    found = rss.diagnose(*records(hidden, 0), ["quadratic_drag", "immersion", "linear_damping"], pairs=False)
    assert found.verdict.status == "unknown_effect" and not found.verdict.effects
    assert any("part of the gap is immersion on Sway with Heave" in note for note in found.notes)


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_not_there_is_no_part(seed):
    hidden = [("cubic_stiffness", "Sway", {"stiffness": 4e5})]
    found = rss.diagnose(*records(hidden, seed), ["quadratic_drag", "immersion", "linear_damping"], pairs=False)
    assert found.verdict.status == "unknown_effect"
    assert not any("immersion" in note for note in found.notes)
