"""Plants with named uncertain parameters: what a known force tells of them, and nothing where it is not known."""

import numpy as np
import pytest
from scipy.signal import lsim
from scipy.stats import chi2
from seeds import some

import radiation_ss as rss
from benchmarks.heave_tank import BAND, INERTIA, MASS, STIFFNESS, sea_record, tank, with_force
from radiation_ss.filter import UncertainPlant

TRUTH = {"mass": MASS, "stiffness": STIFFNESS, "drag": 5.0}


def build(p):
    return tank().replace(M=[[p["mass"]]], C=[[p["stiffness"]]], D=[[p["drag"]]])


def plant(off):
    """Medians off the truth by some factors."""
    return UncertainPlant(build, {name: (value * factor, 0.15)
                                  for (name, value), factor in zip(TRUTH.items(), off)})


def forced(seed, duration=10.0):
    """Motion of the plant with its drag under a known smooth force, exact for a force linear over .6 ms.

    Parameters are known to .04 % here: the record has to be as exact. A force that is linear between samples of 10 ms
    is short by (w dt)^2 / 12, and `simulate` in its own steps is off by 3e-3.
    """
    record, force = sea_record(seed, duration, dt=0.01 / 16)
    force = force * np.minimum(record.time, 1.0)
    motion = rss.linear_response(build(TRUTH), record.time, force).outputs[:, ::16]
    time, force = record.time[::16], force[::16]
    rng = np.random.default_rng(seed + 500)  # not the numbers that `with_force` draws
    names = ("Heave", "Heave_velocity", "Heave_acceleration")
    noisy = {name: row + 0.01 * row.std() * rng.standard_normal(row.size) for name, row in zip(names, motion)}
    return with_force(rss.Record(time, noisy), force, seed), force


def test_a_known_force_teaches_named_parameters_as_surely_as_it_says():
    off, seeds = [], some(range(4), 2)
    for seed in seeds:
        record, force = forced(seed)
        medians = 1.0 + 0.12 * np.random.default_rng(seed).standard_normal(3)
        found = rss.DualEnKF(plant(medians), seed=seed).run(record)
        assert not found.warnings
        for name, value in TRUTH.items():
            p = found.parameters[name]
            assert abs(p.mean - value) < 0.1 * p.prior_std and p.std < 0.1 * p.prior_std
            off.append((p.mean - value) / p.std)
        assert np.std((found.force.mean[0] - force)[100:]) < 0.02 * force.std()
    # Mass and stiffness go together: of three numbers two free directions a record at least.
    assert np.sum(np.square(off)) < 3.0 / 2.0 * chi2.ppf(0.999, 2 * len(seeds))


@pytest.mark.parametrize("scale", [1.1, 1.3])
def test_a_plant_whose_radiation_is_off_says_so_and_its_bands_still_hold(scale):
    fit = tank().fit

    def off(p):
        return build(p | {"drag": TRUTH["drag"]}).replace(fit=fit.replace(c=scale * fit.c))

    record, _ = forced(0)
    found = rss.DualEnKF(UncertainPlant(off, {"mass": (1.1 * MASS, 0.15), "stiffness": (0.9 * STIFFNESS, 0.15)}),
                         seed=0, n_ensemble=20).run(record)
    assert any("normalised innovation" in text and "does not explain" in text for text in found.warnings)
    assert found.counts["refused"] == 3 * record.time.size + record.time.size - found.used.sum()
    for name in found.parameters:
        p = found.parameters[name]
        assert p.lower < TRUTH[name] < p.upper


def spiked(record, share, names, seed=3, many=8):
    """Return the record with spikes, of a share of each channel's deviation, and without those samples."""
    rng, out, without = np.random.default_rng(seed), {}, {}
    for name in names:
        values = np.array(record.channels[name])
        at = rng.choice(np.arange(100, values.size - 5), many, replace=False)
        size = share * values.std() * rng.choice([-1.0, 1.0], many)
        out[name], without[name] = values.copy(), values.copy()
        out[name][at] += size
        without[name][at] = np.nan
    return record.with_channels(**out), record.with_channels(**without)


@pytest.mark.parametrize("share, names", [
    (0.2, ["Heave"]), (20.0, ["Heave", "Heave_velocity", "Heave_acceleration", "Heave_force"]),
    (1e12, ["Heave_acceleration"])])
def test_what_the_gate_refuses_teaches_nothing(share, names):
    """Noise is a share of .01: the smallest spikes are 20 deviations of it. They change what is seen of it by 1 %."""
    record, _ = forced(0, 6.0)
    medians = 1.0 + 0.12 * np.random.default_rng(0).standard_normal(3)
    spiky, without = spiked(record, share, names)
    here, there = (rss.DualEnKF(plant(medians), seed=0, n_ensemble=20).run(one) for one in (spiky, without))
    assert here.counts["refused"] == 8 * len(names) and there.counts["refused"] == 0
    assert not here.warnings
    for name in TRUTH:
        told, p = here.parameters[name], there.parameters[name]
        assert told.std == pytest.approx(p.std, rel=0.02) and abs(told.mean - p.mean) < 0.05 * p.std
    assert here.force.mean == pytest.approx(there.force.mean, abs=0.02 * there.force.mean.std())


def test_the_smoothed_force_of_named_parameters_is_nearer_than_the_filtered_one():
    record, force = sea_record(4, 6.0)
    springy = UncertainPlant(lambda p: tank().replace(C=[[p["stiffness"]]]), {"stiffness": (STIFFNESS, 0.001)})
    filter_ = rss.DualEnKF(springy, n_ensemble=20)
    filtered, smoothed = (filter_.run(record, smooth=smooth).force for smooth in (False, True))
    late = slice(100, 500)
    error = [np.std((band.mean[0] - force)[late]) for band in (filtered, smoothed)]
    assert error[1] < 0.9 * error[0]
    assert np.mean((smoothed.lower[0] < force) & (force < smoothed.upper[0])) > 0.85


def test_without_the_force_the_answer_is_the_prior_and_says_so():
    record, force = sea_record(0, 10.0)
    springy = UncertainPlant(lambda p: tank().replace(C=[[p["stiffness"]]]), {"stiffness": (STIFFNESS, 0.02)})
    found = rss.DualEnKF(springy, noise={"Heave": 1e-5}).run(record)
    assert found.parameters["stiffness"].mean == pytest.approx(STIFFNESS)
    assert any("says nothing about the parameters" in text for text in found.warnings)
    spread = np.log(found.members[0]).std(ddof=1)
    assert spread == pytest.approx(np.sqrt(np.log1p(0.02**2)), rel=1e-6)
    assert np.std((found.force.mean[0] - force)[200:]) < 0.1 * force.std()


def test_with_nothing_uncertain_to_speak_of_it_is_the_default_filter():
    """Exact transitions here, Runge-Kutta steps there; one prior of 1e-9 is none."""
    record, _ = sea_record(1, 8.0)
    general = rss.DualEnKF(UncertainPlant(lambda p: tank().replace(C=[[p["k"]]]), {"k": (STIFFNESS, 1e-9)})).run(record)
    default = rss.DualEnKF(tank(), prior=0.0, n_ensemble=4, omega=BAND).run(record)
    late = record.time > 2.0  # the radiation states start with another spread
    gap = (general.force.mean - default.force.mean)[:, late]
    assert np.abs(gap).max() < 0.02 * default.force.mean.std()
    width = [(e.force.upper - e.force.mean)[:, late].mean() for e in (general, default)]
    assert width[0] == pytest.approx(width[1], rel=0.01)


def test_plants_of_named_parameters_are_given_and_bad_ones_refused():
    record, _ = sea_record(2, 3.0)
    found = rss.DualEnKF(plant((1.0, 1.0, 1.0)), n_ensemble=20).run(record)
    heavy = found.plants(20)
    inertia = 1.0 / np.array([one.D[2, 0] for one in heavy])
    np.testing.assert_allclose(inertia, found.members[0] + INERTIA - MASS, rtol=1e-9)
    with pytest.raises(rss.InputError, match="whole records"):
        rss.DualEnKF(plant((1.0, 1.0, 1.0))).prepare(record)
    with pytest.raises(rss.InputError, match="drag is"):
        UncertainPlant(build, {"drag": (0.0, 0.1)})
    with pytest.raises(rss.InputError, match="none; name"):
        UncertainPlant(build, {})


def test_truths_drawn_from_wide_priors_are_found_and_held():
    """Truths by SciPy; full steps from the medians go round in circles for some of them."""
    medians, inside = {"mass": 50.0, "stiffness": 800.0, "drag": 10.0}, []
    spread = {"mass": 0.2, "stiffness": 0.2, "drag": 0.3}
    fit = rss.RadiationFit(("Heave",), [[-3.0]], [[4.0]], [[1.0]], 1)
    uncertain = UncertainPlant(
        lambda p: rss.Model(("Heave",), [[p["mass"]]], [[0.0]], [[p["stiffness"]]], fit, D=[[p["drag"]]]),
        {name: (value, spread[name]) for name, value in medians.items()})
    fine = np.arange(0.0, 40.0, 0.00625)    # SciPy's force is linear in between
    for seed in range(12):
        rng = np.random.default_rng(seed)
        true = {name: value * np.exp(spread[name] * rng.standard_normal()) for name, value in medians.items()}
        omega = rng.uniform(1.5, 7.0, 60)
        force = 20.0 * np.cos(np.outer(fine, omega) + rng.uniform(0.0, 2.0 * np.pi, 60)).sum(axis=1)
        m, k, d = true["mass"], true["stiffness"], true["drag"]
        F = [[0.0, 1.0, 0.0], [-k / m, -d / m, -1.0 / m], [0.0, 4.0, -3.0]]
        moved = lsim((F, [[0.0], [1.0 / m], [0.0]], [[1.0, 0.0, 0.0]], [[0.0]]), force, fine)[1]
        time, force, moved = fine[::8], force[::8], moved[::8]
        heave = moved + 0.01 * moved.std() * rng.standard_normal(time.size)
        found = rss.DualEnKF(uncertain, seed=seed).run(rss.Record(time, {"Heave": heave, "Heave_force": force}))
        inside += [found.parameters[name].lower <= value <= found.parameters[name].upper
                   for name, value in true.items()]
    assert np.mean(inside) > 0.85


def test_options_and_parameters_that_are_not_there_are_told():
    with pytest.raises(rss.InputError, match="points: no option of a plant with named parameters"):
        rss.DualEnKF(plant((1.0, 1.0, 1.0)), points=[2.0])
    with pytest.raises(rss.InputError, match="it asks for a parameter 'drag'; there are mass, stiffness"):
        rss.DualEnKF(UncertainPlant(build, {"mass": (50.0, 0.1), "stiffness": (4000.0, 0.1)}))
