"""The dual filter with coupled degrees of freedom: the plant is the model's, the loops are the readable ones."""

import copy

import numpy as np
import pytest
from scipy.linalg import expm

import radiation_ss as rss
from benchmarks.coupled_body import body, noise_record
from benchmarks.filter_by_numpy import advance, assimilate, printed_step, transition, usable
from radiation_ss.filter import SampleBlock, UncertainPlant, fill_gaussian
from radiation_ss.inference import channels, subsystems_of


def coupled():
    """Two degrees of freedom with every kind of coupling: memory, inertia, stiffness, damping."""
    model = body(2, 3, ((0, 1),))
    return model.replace(M=[[5.3, 0.4], [0.4, 4.0]], C=[[580.0, 30.0], [30.0, 400.0]], D=[[2.0, 0.5], [0.5, 3.0]])


def test_shared_parameters_make_the_papers_count():
    parts = subsystems_of(body(2, 5, ((0, 1),)).fit)
    assert parts.theta.size == 30 and parts.states + 4 == 24
    K = parts.K(parts.theta, [3.0, 8.0])
    np.testing.assert_array_equal(K, K.swapaxes(1, 2))
    np.testing.assert_allclose(parts.fit(parts.theta).frequency_response([3.0, 8.0]), K, rtol=1e-9)


def test_the_filters_plant_is_the_models():
    model = coupled()
    parts = subsystems_of(model.fit)
    engine = rss.DualEnKF(model).prepare(noise_record(model, 80)).engine
    F = transition(engine.system._replace(force=np.zeros((2, 2, 2))), parts.theta, 0.01)
    # The same body with its memory in the filter's own coordinates.
    A, G = model.replace(fit=parts.fit(parts.theta)).matrices()
    both = np.block([[A, np.insert(G, [1, 2], 0.0, axis=1)], [np.zeros((4, A.shape[0] + 4))]])
    # Three poles at -8 rad/s: the step's error is a few (8 x 0.01)^5 / 120 of the largest entries.
    np.testing.assert_allclose(F, expm(0.01 * both), atol=5e-5 * np.abs(F).max())


def test_entries_that_are_not_asked_for_keep_their_values():
    model, record = coupled(), noise_record(coupled(), 200)
    with pytest.raises(ValueError, match="not in tuple"):
        rss.DualEnKF(model, entries=[("Dof0", "Heave")])
    prior = np.where([name.startswith("Dof0.") for name in rss.DualEnKF(model).parts.names], 0.05, 0.0)
    estimate = rss.DualEnKF(model, prior=prior, learn="always").run(record)
    fixed = prior == 0.0
    np.testing.assert_allclose(estimate.theta[fixed, -1], estimate.baseline["theta"][fixed], rtol=1e-12)
    assert max(p.moved for p, still in zip(estimate.parameters.values(), fixed) if not still) > 0.0


@pytest.mark.parametrize("learn", ["never", "always"])
def test_compiled_default_filter_is_the_readable_one(learn):
    model = coupled()
    record = noise_record(model, 80)
    engine = rss.DualEnKF(model, seed=1, prior=0.02, n_ensemble=24, learn=learn).prepare(record).engine
    engine.window, state = None, copy.deepcopy(engine.state)  # the loop alone: no window is taken again
    y = channels(record, model.dofs).T.copy()
    y[20:25, 1] = np.nan
    engine.advance(SampleBlock(y, np.full(80, 0.02), np.full(80, 2)))
    for sample in y:
        advance(engine.system, state, 0.01, 2)
        assimilate(engine.system, state, sample, usable(engine.system, state, sample, engine.rules), learn == "always")
    for name, values, expected in zip(state._fields, engine.state, state):
        scale = np.nanmax(np.abs(values))
        np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-8 * scale, err_msg=name)


@pytest.mark.parametrize("analysis", ["stochastic", "square-root"])
def test_compiled_paper_filter_is_the_readable_one(analysis):
    model = coupled()
    record = noise_record(model, 60)
    engine = rss.DualEnKF(model, seed=2, preset="paper", prior=0.02, n_ensemble=24, analysis=analysis, inflation=1.01,
                          points=[5.0]).prepare(record).engine
    y, members = channels(record, model.dofs).T.copy(), 24
    y[20:25, 4] = np.nan
    ensembles, generator = copy.deepcopy(engine.state), copy.deepcopy(engine.generator)
    drawn = sum(part.size for part in (engine.noise if engine.variant.perturbed else engine.noise[:3]))
    for sample in y[:, :6] / engine.units.motion:
        draws = np.zeros((sum(part.size for part in engine.noise), members))
        fill_gaussian(generator, draws[:drawn].reshape(-1))
        printed_step(engine, ensembles, (sample, 0.01 / engine.units.time, 1), draws)
    engine.advance(SampleBlock(y, np.full(60, 0.01), np.ones(60, dtype=np.int64)))
    np.testing.assert_allclose(engine.state.theta, ensembles.theta, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(engine.state.z, ensembles.z, rtol=1e-6, atol=1e-6)


def adrift(dofs):
    """Return a body that nothing restores in surge, its record in a sea of forty harmonics, and their forces (n, nt).

    With the second degree of freedom, heave, it is two bodies in one.
    """
    n = len(dofs)
    a, b, c = (np.kron(np.eye(n), part) for part in ([[0.0, 1.0], [-9.0, -3.0]], [[0.0], [1.0]], [[0.0, 4.0]]))
    fit = rss.RadiationFit(dofs, a, b, c, 2)
    C = np.diag([0.0, 250.0][:n])
    model = rss.Model(dofs, 2.0 * np.eye(n), np.eye(n), C, fit, D=0.01 * np.eye(n))
    rng, time = np.random.default_rng(0), 0.05 * np.arange(800)
    w, phase = rng.uniform(3.0, 6.0, 40), rng.uniform(0.0, 2.0 * np.pi, (n, 40))
    waves = 0.3 * np.exp(1j * phase)
    K = fit.frequency_response(w) + model.D
    size = -w**2 * 3.0 + 1j * w * np.einsum("wii->iw", K) + np.diag(C)[:, None]
    back = np.exp(1j * np.outer(w, time))
    force, moved = (waves @ back).real, ((waves / size) @ back).real
    noisy = moved + 0.005 * moved.std() * rng.standard_normal(moved.shape)
    return model, rss.Record(time, dict(zip(dofs, noisy)), kind="waves"), force


@pytest.mark.parametrize("dofs", [("Surge",), ("Surge", "Heave")])
@pytest.mark.parametrize("options", [{}, {"preset": "paper"}])
def test_a_body_that_nothing_restores_is_filtered_as_any_other(dofs, options):
    model, record, force = adrift(dofs)
    filter_ = rss.DualEnKF(model, n_ensemble=20, **options)
    assert 0.0 < filter_.omega[0] and np.isfinite([*filter_.omega, *filter_.units]).all()
    unknown = filter_.run(record)
    assert np.isfinite(unknown.K).all() and np.isfinite(unknown.force.mean).all()
    assert options or np.std((unknown.force.mean - force)[:, 200:]) < 0.3 * force.std()
    told = rss.identify(model, record.with_channels(**{f"{dof}_force": row for dof, row in zip(dofs, force)}),
                        "paper" if options else "dual-enkf")
    truth = model.fit.frequency_response(told.omega)
    assert np.isfinite(told.K.mean).all()
    assert options or np.linalg.norm(told.K.mean - truth) < 0.15 * np.linalg.norm(truth)


def test_named_parameters_of_a_body_that_nothing_restores_are_learned():
    model, record, force = adrift(("Surge",))
    heavy = UncertainPlant(lambda p: model.replace(M=[[p["mass"]]]), {"mass": (2.2, 0.1)})
    found = rss.DualEnKF(heavy, n_ensemble=20).run(record.with_channels(Surge_force=force[0]))
    assert found.parameters["mass"].lower < 2.0 < found.parameters["mass"].upper
    assert found.parameters["mass"].std < 0.05
