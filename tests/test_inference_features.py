"""The force of an effect along a measured motion."""

import resource
import signal
import tempfile

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from scipy.signal import lsim

import radiation_ss as rss
from radiation_ss.effects import Parameter, activate, effect_named, fractional, tolerances
from radiation_ss.inference import (
    Symbols,
    equation_error,
    features,
    joined,
    measured_motion,
    terms_of,
    unseen_strengths,
)


@pytest.mark.parametrize("frequency", [8.0, 40.0, 160.0])
def test_own_states_that_are_fast_for_the_sampling_follow_their_equation(frequency):
    model, time = tank_model(), np.arange(0.0, 20.0, 0.08)
    record = rss.Record(time, {"Heave": 0.02 * np.exp(-0.1 * time) * np.cos(6.0 * time)}, kind="decay")
    run = measured_motion(model, record)
    active, = activate([("viscous_memory", {"coefficient": 1.0, "frequency": frequency})], ("Heave",))
    (feature,), = features(Symbols(model, active), active, [run])
    poles, whole, residues = fractional(3)
    v = run.v[0]
    wanted = -whole * v
    for pole, residue in zip(frequency * poles, residues):
        wanted -= residue * lsim(([1.0, 0.0], [1.0, pole]), v, run.time - run.time[0])[1]
    assert run.dt * frequency * poles.max() > 1.5
    np.testing.assert_allclose(feature.force[0], wanted, atol=0.01 * np.abs(wanted).max())


def test_columns_that_all_records_share_do_not_grow_with_their_number():
    model, records = tank_case([], 1, ("decay", "waves") * 3, duration=15.0)
    few, many = (equation_error(model, [measured_motion(model, r) for r in some], tolerances(0.02))
                 for some in (records[:2], records))
    assert few.base.count == many.base.count and len(many.rows.own) == 6
    for part, place in zip(many.rows.own, many.places):
        assert [rows for rows, _, _ in part.parts] == [place.rows] and all(
            values.shape == (place.rows.stop - place.rows.start, at.size) for _, at, values in part.parts)


@pytest.mark.parametrize("powers, name", [("x^3 v^0", "cubic_stiffness"), ("x^2 v^0", "quadratic_stiffness")])
def test_a_coherent_error_is_to_the_data_what_the_effect_of_its_law_is(powers, name):
    model, records = tank_case([], 1, ("decay", "waves"), duration=15.0)
    problem = equation_error(model, [measured_motion(model, r) for r in records], tolerances(0.02))
    (term,) = terms_of(problem, [effect_named(name)])
    at = problem.labels.index(f"{powers}|Heave|")
    # Both are columns of the rows and changes of the data's impedance, but for one factor.
    base = np.asarray(problem.base.values)[:, at]
    factor = (base @ term.columns.values[:, 0]) / np.sum(term.columns.values[:, 0] ** 2)
    for one, two in ((base, term.columns.values[:, 0]),
                     (problem.base.relative.toarray()[:, at], term.columns.relative.toarray()[:, 0])):
        np.testing.assert_allclose(one, factor * two, atol=1e-9 * np.abs(one).max())


@pytest.mark.parametrize("kind", ["static", "prescribed"])
def test_of_a_given_motion_the_force_is_what_is_predicted(kind):
    """What multiplies the measured force changes the density of the data by as much; what goes with motion does not."""
    model, (sea,) = tank_case([], 1, ("waves",), duration=15.0)
    load = 0.02 * model.C[0, 0] * np.sin(2.0 * np.pi * np.arange(400.0) / 80.0)

    def problem_of(size):
        test = rss.Record(np.arange(400.0), {"Heave": load / model.C[0, 0], "Heave_force": size * load}, kind=kind)
        return equation_error(model, [measured_motion(model, record) for record in (sea, test)], tolerances(0.02))

    problem, larger = problem_of(1.0), problem_of(1.001)
    place = next(p for p in problem.places if p.record == 1 and p.order < 0)
    by_force = (larger.rows.error - problem.rows.error)[place.rows] / 0.001
    fine = problem.rows.fine[np.unique(problem.rows.kind[place.rows])].ravel()
    share = np.asarray(problem.base.values)[place.rows, problem.labels.index("nominal_force|Heave|")]
    # The residual error - share * column has the slope 1 - share * relative times that of the error alone.
    change = problem.base.relative.toarray()[fine, problem.labels.index("nominal_force|Heave|")]
    told = ~problem.quiet[place.rows]  # where there is more than noise
    np.testing.assert_allclose(share, np.mean(change) * by_force * told, atol=1e-9 * np.abs(share).max())
    assert problem.rows.weight[fine].sum() == pytest.approx(problem.rows.power[place.rows][told].sum())
    (spring,) = terms_of(problem, [effect_named("linear_stiffness")])
    assert not np.any(spring.columns.relative.toarray()[fine])
    assert not np.any(problem.base.relative.toarray()[fine][:, problem.labels.index("nominal_stiffness|Heave|")])


def test_columns_in_a_file_are_those_in_memory():
    # slow_drift has numbers of its own in each record, parametric_stiffness two strengths and many frequencies.
    model, records = tank_case([], 1, ("decay", "waves") * 2, duration=15.0)
    problem = equation_error(model, [measured_motion(model, r) for r in records], tolerances(0.02))
    effects = [effect_named(n) for n in ("quadratic_drag", "parametric_stiffness", "slow_drift", "sensor_gain")]
    filed, kept = terms_of(problem, effects, held=0), terms_of(problem, effects)
    assert len(filed) == len(kept) > 10
    for one, other in zip(filed, kept):
        assert not isinstance(one.columns.values, np.ndarray)
        assert np.array_equal(one.columns.values, other.columns.values)
        assert np.array_equal(one.columns.values[7:40], np.asarray(other.columns.values)[7:40])
    several = [term.columns for term in (filed[0], filed[1], filed[-2], filed[-1])]
    whole, x = np.concatenate([np.asarray(c.values) for c in several], axis=1), np.arange(sum(c.count for c in several))
    assert np.allclose(joined(several).values @ x, whole @ x, rtol=1e-12)
    drift = next(term.columns for term in filed if term.active.name == "slow_drift")
    assert drift.count == 8 and np.all(np.count_nonzero(drift.values, axis=1) <= 2)


def test_a_temporary_folder_without_room_is_named():
    model, records = tank_case([], 1, ("decay",), duration=15.0)
    problem = equation_error(model, [measured_motion(model, r) for r in records], tolerances(0.02))
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
        with pytest.raises(rss.InputError, match=f"{tempfile.gettempdir()}: .*MB"):
            terms_of(problem, [effect_named("quadratic_drag")], held=0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)



@pytest.mark.parametrize("turning", [0.0, 1.0])
def test_unseen_are_the_strengths_whose_force_is_zero_along_the_motion(turning):
    """Springs on the whole body, force -k G x; the pitch rests where nothing pushes it."""
    rigid = rss.RadiationFit(("Heave", "Pitch"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    model = rss.Model(("Heave", "Pitch"), np.diag([2.0, 3.0]), np.zeros((2, 2)), np.diag([18.0, 75.0]), rigid,
                      np.diag([0.6, 0.9]))
    time, rng = np.arange(0.0, 60.0, 0.05), np.random.default_rng(2)
    push = np.stack([size * np.convolve(rng.normal(size=1200), np.hanning(20), "same") for size in (1.0, turning)])
    x = rss.simulate(model, (time, push)).outputs[:2]
    record = rss.Record(time, {"Heave": x[0], "Pitch": x[1], "Heave_force": push[0], "Pitch_force": push[1]},
                        kind="forced")
    springs = {"own": [[1.0, 0.0], [0.0, 0.0]], "turn": [[0.0, 0.0], [0.0, 1.0]], "lift": [[0.0, 1.0], [0.0, 0.0]]}

    def force(s, p):
        return [-sum(getattr(p, name) * G[i][j] * s.all[j].x for name, G in springs.items() for j in range(2))
                for i in range(2)]

    effect = rss.Effect("springs", {name: Parameter("F/X", slab=lambda s: 1.0) for name in springs}, force,
                        scope="body", family="stiffness", linear=True)
    problem = equation_error(model, [measured_motion(model, record)], tolerances(0.02))
    term, = terms_of(problem, [effect])
    assert unseen_strengths(problem, term) == {name for name, G in springs.items() if not np.any(np.array(G) @ x)}


@pytest.mark.parametrize("noise, told", [(1e-3, 1.0), (0.05, 1.0), (0.6, 0.0)])
def test_a_motion_is_read_as_far_up_as_it_stands_out_of_noise(noise, told):
    """Stops and drags see all of a motion, waves on a slow one too, also where the rows end below them."""
    model = rss.body(dof="Surge", mass=1000.0, added_mass=400.0, C=100.0, damping_ratio=0.02)
    rng, time = np.random.default_rng(5), np.arange(0.0, 400.0, 0.2)
    x = np.cos(0.3 * time) + 0.1 * np.cos(2.2 * time) + noise * rng.standard_normal(time.size)
    run = measured_motion(model, rss.Record(time, {"Surge": x}, kind="motion-only", name="sea"))
    assert run.reach[0] < 2.2
    waves = [np.cos(0.3 * run.time), np.cos(2.2 * run.time), np.sin(2.2 * run.time)]
    _, size, late = np.linalg.lstsq(np.stack(waves, axis=1), run.x[0])[0]
    # Of N samples an amplitude is off by sqrt(2 / N) of their noise; what is left out is none.
    assert abs(size - 0.1 * told) < 0.01 and abs(late) < 0.01


def test_the_noise_of_an_accelerometer_is_largest_in_slow_motion():
    """White noise of S in an acceleration is one of S / omega^4 in the displacement."""
    model = rss.body(dof="Heave", mass=1000.0, added_mass=400.0, C=5600.0, damping_ratio=0.02)
    rng, time = np.random.default_rng(6), np.arange(0.0, 300.0, 0.05)
    a = -4.0 * np.cos(2.0 * time) + 0.1 * rng.standard_normal(time.size)
    run = measured_motion(model, rss.Record(time, {"Heave_acceleration": a}, kind="motion-only", name="sea"))
    omega = run.basis[0].omega
    kept = omega > 0.5
    expected = 0.1 / np.sqrt(run.kept) / omega**2
    assert np.abs(run.noise[0, kept] / expected[kept] - 1.0).max() < 0.25  # of a spectrum in 8 pieces
