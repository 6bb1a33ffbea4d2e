"""Free motions and static tests in one diagnosis: what SciPy integrates, and what stands in balance."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import radiation_ss as rss

MASS, C, NOISE = 1000.0, 2300.0, 1e-3
OMEGA = np.sqrt(C / MASS)
DAMPING = 0.02 * np.sqrt(C * MASS)
LOADS = np.concatenate([np.linspace(0.0, 300.0, 7), np.linspace(250.0, -300.0, 12), np.linspace(-250.0, 0.0, 6)])


def body():
    return rss.body(dof="Heave", mass=MASS, added_mass=0.0, C=C, damping_ratio=0.5 * DAMPING / np.sqrt(C * MASS))


def moved(time, force, start, extra):
    """Return what a body does under a force of time and an extra one by place and velocity."""
    def rates(t, y):
        return [y[1], (force(t) - C * y[0] - DAMPING * y[1] + extra(*y)) / MASS]
    return solve_ivp(rates, (time[0], time[-1]), [start, 0.0], t_eval=time, max_step=0.05, method="LSODA", rtol=1e-7,
                     atol=1e-9).y[0]


def seen(time, x, rng, kind, force=None, name=""):
    channels = {"Heave": x + NOISE * rng.standard_normal(x.size)}
    return rss.Record(time, channels if force is None else {**channels, "Heave_force": force}, kind=kind, name=name)


def sea(time, rng):
    omega = np.linspace(0.8, 2.6, 24)
    size, phase = 60.0 * rng.standard_normal(24), rng.uniform(0.0, 2.0 * np.pi, 24)
    return (size[:, None] * np.cos(np.outer(omega, time) + phase[:, None])).sum(axis=0)


def in_balance(friction, cubic):
    """Return the places that loads hold the body at which dry friction lets go no earlier."""
    at, places = 0.0, []
    for load in LOADS:
        left = load - C * at - cubic * at**3
        if abs(left) > friction:
            at = brentq(lambda x: load - C * x - cubic * x**3 - np.sign(left) * friction, -2.0, 2.0)  # noqa: B023
        places.append(at)
    return np.array(places)


RIVALS = ["coulomb_friction", "cubic_stiffness", "linear_stiffness", "quadratic_drag", "linear_damping", "hysteresis"]


@pytest.mark.parametrize(("seed", "step", "effects"), [(0, 1.0, None), (1, 60.0, RIVALS)], ids=["library", "slow"])
def test_a_static_test_tells_the_stiffness_that_a_decay_alone_takes_for_friction(seed, step, effects):
    """Two laws at once; numbers are those of both tests together, at whatever pace the places were read."""
    friction, cubic, rng, time = 60.0, 3000.0, np.random.default_rng(10 * seed), np.arange(0.0, 60.0, 0.05)
    extra = lambda x, v: -cubic * x**3 - friction * np.tanh(v / 1e-3)  # noqa: E731
    waves = sea(time, rng)
    decay = seen(time, moved(time, lambda t: 0.0, 0.5, extra), rng, "decay", name="decay")
    pull = seen(step * np.arange(LOADS.size), in_balance(friction, cubic), rng, "static", LOADS, "pull")
    later = seen(time, moved(time, lambda t: np.interp(t, time, waves), 0.0, extra), rng, "forced", waves, "waves")
    found = rss.diagnose(body(), [decay, pull], effects, withhold=[later])
    assert found.verdict.status == "effect"
    assert {e.name: e for e in found.verdict.effects}.keys() == {"coulomb_friction", "cubic_stiffness"}
    for effect, name, true in zip(sorted(found.verdict.effects, key=lambda e: e.name), ("force", "stiffness"),
                                  (friction, cubic)):
        value, std = effect.parameters[name]
        assert abs(value - true) < 4.0 * std < true


@pytest.mark.parametrize("cause", ["linear_damping", "excitation_delay"])
def test_a_pull_that_never_rests_shows_damping_and_the_clock_of_the_load(cause):
    """Both open the loop of a slow sine; hysteresis would be the only cause of a loop in a body at rest."""
    rng, time = np.random.default_rng(4), np.arange(0.0, 60.0, 0.05)
    slow, span = np.arange(0.0, 160.0, 0.2), 160.0
    more, late = (0.6 * np.sqrt(C * MASS), 0.0) if cause == "linear_damping" else (0.0, 0.25)
    pulled, waves = 600.0 * np.sin(2.0 * np.pi * slow / span) ** 3, sea(time, rng)
    extra = lambda x, v: -more * v  # noqa: E731
    decay = seen(time, moved(time, lambda t: 0.0, 0.5, extra), rng, "decay", name="decay")

    def under(at, force, kind, name):
        return seen(at, moved(at, lambda t: np.interp(t - late, at, force), 0.0, extra), rng, kind, force, name)

    pull = under(slow, pulled, "static", "pull")
    driven = [under(time, waves, "forced", name) for name in ("one", "other")]
    found = rss.diagnose(body(), [decay, pull, driven[0]], withhold=[driven[1]])
    assert [e.name for e in found.verdict.effects] == [cause]
    assert found.verdict.probability > 0.8
    ((value, std),) = found.verdict.effects[0].parameters.values()
    assert abs(value - (more or late)) < 4.0 * std < 0.3 * (more or late)
