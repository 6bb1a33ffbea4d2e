"""Many members at once against one after the other."""

from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from multiprocessing import get_context

import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model

import radiation_ss as rss
from radiation_ss.errors import InputError
from radiation_ss.simulation import simulate_ensemble

TIME = np.arange(0.0, 12.0, 0.04)


def in_its_own_process(*arguments, **options):
    """Return `simulate_ensemble` of a new process: JAX has threads, and other tests of this process fork."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(simulate_ensemble, *arguments, **options).result()


@pytest.mark.parametrize("backend", ["numpy", "jax"])
def test_members_move_as_each_does_alone(backend):
    if backend == "jax" and find_spec("jax") is None:
        pytest.skip("jax absent")
    run = in_its_own_process if backend == "jax" else simulate_ensemble
    model, rng = coupled_model(), np.random.default_rng(0)
    force = 1e5 * np.cos(rng.uniform(0.4, 1.5, (5, 2, 1)) * TIME + rng.uniform(0.0, 6.28, (5, 2, 1)))
    drags, loads = rng.uniform(0.0, 8e5, 5), rng.uniform(1e4, 5e4, 5)
    named = [("quadratic_drag", "Sway", {"coefficient": 1.0}),
             ("hysteresis", "Roll", {"force": 1.0, "reach": 0.05, "sharpness": 1.0})]
    parameters = np.stack([drags, loads, np.full(5, 0.05), np.full(5, 1.0)], axis=1)
    found = run(model, TIME, force, named, parameters=parameters, substeps=8, backend=backend)
    for k in range(5):
        one = [(named[0][0], "Sway", {"coefficient": drags[k]}),
               (named[1][0], "Roll", {"force": loads[k], "reach": 0.05, "sharpness": 1.0})]
        alone = np.asarray(rss.simulate(model, (TIME, force[k]), one, step=0.005).outputs)[:2]
        assert found.peak[k] == pytest.approx(np.abs(alone).max(axis=1), rel=2e-3)
        assert found.rms[k] == pytest.approx(np.sqrt(np.mean(alone**2, axis=1)), rel=0.01)
        m = model.fit.states
        assert np.allclose(found.final[k, m:m + 2], alone[:, -1], atol=1e-4 * np.abs(alone).max())


def test_parameters_starts_and_forces_are_shared_where_there_is_one():
    model = tank_model()
    start = np.zeros((3, 5))
    start[:, 3] = 0.01, 0.02, 0.03
    found = simulate_ensemble(model, TIME, 0.0 * TIME[None], start=start)
    assert np.allclose(found.peak[:, 0], start[:, 3])  # linear, at rest: a decay's first value is its largest
    assert np.allclose(found.final[1], 2.0 * found.final[0])


def test_batches_give_the_same_motions():
    model, rng = tank_model(), np.random.default_rng(1)
    force, start = 20.0 * rng.standard_normal((7, 1, TIME.size)), 0.01 * rng.standard_normal((7, 5))
    whole, parts = (simulate_ensemble(model, TIME, force, start=start, batch=batch) for batch in (7, 3))
    assert whole.peak == pytest.approx(parts.peak, rel=1e-9)
    assert np.allclose(whole.final, parts.final, atol=1e-9 * np.abs(whole.final).max())


@pytest.mark.parametrize("arguments, word", [
    ({"force": np.zeros((3, 2, TIME.size))}, "force: shape"), ({"batch": 0}, "batch: 0 members"),
    ({"force": np.zeros((3, 1, TIME.size)), "start": np.zeros((2, 5))}, "start: 2 members found, 1 or 3 needed"),
    ({"parameters": np.zeros((3, 2))}, "parameters: shape"),
    ({"backend": "fortran"}, "backend: 'fortran' is unknown"),
    ({"effects": [("sensor_delay", {"delay": 0.1})]}, "neither waves, speed, sensors nor delays")])
def test_what_does_not_fit_is_named(arguments, word):
    with pytest.raises(InputError, match=word):
        simulate_ensemble(tank_model(), TIME, **{"force": 0.0 * TIME[None], **arguments})
