"""Identified memories are passive; prior and records that contradict each other are named."""

import numpy as np
import pytest
from identify_studies import contradicting
from identify_tank import BAND, drawn_truth, sail, tank, with_waves
from seeds import some
from test_identify_known import sway_roll

from radiation_ss import RadiationFit, identify
from radiation_ss.identification import nearest_passive, passive
from radiation_ss.inference import Target, find_peak, parametrise, sample


@pytest.mark.parametrize("model", [tank(), sway_roll()])
def test_passive_draws_are_those_that_the_certificate_accepts(model):
    form = parametrise(model.fit, model.A_inf, 0.15)
    theta = form.mean * (1.0 + 0.08 * np.random.default_rng(0).standard_normal((150, form.mean.size)))
    proved = np.array([form.realise(row).passive for row in theta])
    found = passive(form, theta)
    assert 0.05 < proved.mean() < 0.95
    # Where they differ, damping is negative by next to nothing, between or beyond the frequencies looked at.
    margins = np.array([form.realise(row).passivity_margin for row in theta[found & ~proved]])
    assert not (proved & ~found).any() and (margins > -1e-4).all()


def test_the_fit_handed_on_is_moved_no_further_than_it_has_to_be():
    model = tank()
    form = parametrise(model.fit, model.A_inf, 0.15)
    theta = form.theta(np.random.default_rng(1).standard_normal((300, form.active.size)))
    bad = theta[~passive(form, theta)][0]
    moved, said = nearest_passive(form, bad, theta, matters=0.0)
    assert form.realise(moved).passive and "negative damping" in said and "handed on is passive" in said
    assert not form.realise(bad + 0.99 * (moved - bad)).passive
    quiet, nothing = nearest_passive(form, bad, theta, matters=10.0)     # standard deviations of K
    assert nothing == "" and np.array_equal(quiet, moved)
    good = theta[passive(form, theta)][0]
    same, said = nearest_passive(form, good, theta)
    assert said == "" and same is good


@pytest.mark.parametrize("model", [tank(), sway_roll()])
def test_no_passive_place_on_the_way_to_a_draw_is_more_probable_than_the_fit_handed_on(model):
    form = parametrise(model.fit, model.A_inf, 0.15)
    theta = form.theta(np.random.default_rng(1).standard_normal((300, form.active.size)))
    root, inside = np.linalg.cholesky(np.cov(theta.T)), passive(form, theta)
    for bad in theta[~inside][:4]:
        near = bad + 0.02 * (theta - bad)           # sure of it, so that no draw is passive
        moved, said = nearest_passive(form, bad, near)
        ways = (bad + np.linspace(0.02, 1.0, 50)[:, None, None] * (theta[inside] - bad)).reshape(-1, bad.size)
        far = np.linalg.norm(np.linalg.solve(root, (np.vstack([moved, ways[passive(form, ways)]]) - bad).T), axis=0)
        assert form.realise(moved).passive and "of its standard deviations" in said
        assert far[0] < 1.001 * far[1:].min()


def everywhere(u):
    return np.ones(u.shape[0], dtype=bool)


class Measured:
    """A likelihood that knows the first parameter with a deviation of 0.5 about a value."""

    size = 0

    def __init__(self, value):
        self.at = value

    def value(self, u, v):
        return -2.0 * (u[0] - self.at) ** 2

    def local(self, u, v):
        return self.value(u, v), np.array([-4.0 * (u[0] - self.at), 0.0]), np.diag([4.0, 0.0])


def test_draws_keep_the_constraint_and_say_how_probable_it_was():
    """Against the truncated normal posterior: mean 0.8, variance 0.2 before u0 > 1 is made a condition."""
    rng = np.random.default_rng(0)
    target = Target(2, [Measured(1.0)], everywhere, lambda u: u[:, 0] > 1.0)
    draws, share = sample(target, [find_peak(target, np.zeros(2))], rng, 4000, 0.02)
    reference = 0.8 + np.sqrt(0.2) * rng.standard_normal(200_000)
    kept = reference[reference > 1.0]
    assert draws[:, 0].min() > 1.0
    assert share == pytest.approx(np.mean(reference > 1.0), abs=0.05)
    assert draws[:, 0].mean() == pytest.approx(kept.mean(), abs=5.0 * kept.std() / np.sqrt(4000))
    hopeless = Target(2, [Measured(1.0)], everywhere, lambda u: u[:, 0] > 4.0)
    draws, share = sample(hopeless, [find_peak(hopeless, np.zeros(2))], rng, 400, 0.02)
    assert share <= 0.02 and draws[:, 0].mean() == pytest.approx(0.8, abs=0.2)


def test_every_draw_and_the_fit_are_passive():
    start = with_waves(tank())
    assert not start.fit.passive        # Table 3's row is not, by a hair
    form = parametrise(start.fit, start.A_inf, 0.15)
    for seed in some(range(2)):
        rng = np.random.default_rng([seed, 5])
        record, _ = sail(drawn_truth(start, rng), 40.0, rng, with_force=False)
        for method in ("spectral", "joint"):
            found = identify(start, record, method, omega=BAND, draws=200)
            assert found.fit.passive and passive(form, found.draws, 0.01).all() and found.K.mean.real.min() >= 0.0
            assert not passive(form, found.draws).all()
            for plant in found.plants(10):
                velocity = plant(1j * np.geomspace(0.01, 1e3, 500))[plant.output_labels.index("heave_vel"), 0]
                assert velocity.real.min() > -1e-6 * velocity.real.max()


def test_a_move_that_the_prior_thinks_impossible_is_named():
    start = tank()
    rng = np.random.default_rng(3)
    truth = drawn_truth(start, rng, prior=0.25)
    record, _ = sail(truth, 60.0, rng)
    narrow = identify(start, record, "prediction-error", prior=0.02, omega=BAND, draws=200)
    assert any("contradict" in text or "the records ask for" in text for text in narrow.warnings)
    wide = identify(start, record, "prediction-error", prior=0.25, omega=BAND, draws=200)
    assert not any("contradict" in text or "the records ask for" in text for text in wide.warnings)


def test_bodies_of_the_prior_are_said_to_contradict_it_as_seldom_as_one_number_would():
    """The largest of several numbers is farther out than one: a limit for one is passed by most bodies."""
    assert contradicting(range(5)).sum() <= 5 * 0.317  # P(|z| > 1); of one number in six, 0.9


def test_no_added_mass_at_rest_stays_so():
    """A fit with K(0) = 0 keeps it in every draw, though none of its partial fractions is zero there."""
    s = np.poly1d([1.0, 0.0])
    fit = memory([np.poly1d([1.0, 0.3, 4.0]), np.poly1d([1.0, 0.5, 9.0]), np.poly1d([1.0, 2.0])], 3.0 * s * s * s)
    form = parametrise(fit, np.eye(1), 0.15)
    assert form.blocks[0].form == "sections" and form.blocks[0].zero
    theta = form.theta(np.random.default_rng(0).standard_normal((50, form.active.size)))
    size = np.abs(form.K(theta, np.linspace(0.5, 5.0, 40))).max()
    assert np.abs(form.K(theta, [0.0])).max() < 1e-12 * size
    w = np.linspace(0.2, 6.0, 20)
    np.testing.assert_allclose(form.K(form.mean, w), fit.frequency_response(w), rtol=1e-8)
    np.testing.assert_allclose(form.realise(theta[3]).frequency_response(w), form.K(theta[3], w), rtol=1e-9)


def memory(factors, numerator):
    """Return the fit numerator / product of factors, one degree of freedom, in controller form."""
    den = np.poly1d([1.0])
    for factor in factors:
        den = den * factor
    r = den.order
    a = np.diag(np.ones(r - 1), 1)
    a[-1] = -den.coeffs[:0:-1]
    b, c = np.zeros((r, 1)), np.zeros((1, r))
    b[-1, 0] = 1.0
    c[0, :numerator.order + 1] = numerator.coeffs[::-1]
    return RadiationFit(("Heave",), a, b, c, order=r)


@pytest.mark.filterwarnings("error")
def test_draws_of_several_motions_that_are_far_from_passive_are_refused_without_a_warning():
    rng, names = np.random.default_rng(0), ("Surge", "Heave", "Pitch", "Sway")
    skew, b = rng.standard_normal((8, 8)), rng.standard_normal((8, 4))
    fit = RadiationFit(names, skew - skew.T - np.diag(rng.uniform(0.2, 2.0, 8)), b, b.T, 2)
    form = parametrise(fit, np.eye(4), 0.15)
    theta = form.theta(6.0 * rng.standard_normal((400, form.active.size)))
    proved = np.array([form.realise(row).passive for row in theta])
    assert not (proved & ~passive(form, theta)).any() and not passive(form, theta).all()
