"""Errors within tolerance that no nominal number describes: they are no effect, and evidence does not count them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from scipy.integrate import quad
from scipy.linalg import block_diag

from radiation_ss.effects import effect_named
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import InputError
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.gap.how_far import unseen
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.gap.tolerance import null_fit as without_effects
from radiation_ss.gap.tolerance import tolerated
from radiation_ss.gap.tolerance.null_fit import null_fit
from radiation_ss.gap.which import bootstrap, verdict
from radiation_ss.gap.which import search as stage
from radiation_ss.gap.which.candidates import numbers_of
from radiation_ss.gap.which.material import out_of_tolerance, pulled
from radiation_ss.gap.which.null_law import NullLaw, claimed, null_law
from radiation_ss.gap.which.verdict import Verdict, decide
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate

TIME = np.arange(0.0, 15.0, 0.05)
FREE = SimpleNamespace(bound=np.inf)  # a number of the model without a bound


def with_mode(model, omega, width, size):
    """The model with one more mode size c1 s / (s^2 + c1 s + omega^2) in its memory."""
    c1, fit = width * omega, model.fit
    a = block_diag(fit.a, [[0.0, 1.0], [-omega**2, -c1]])
    b, c = np.vstack([fit.b, [[0.0], [1.0]]]), np.hstack([fit.c, [[0.0, size * c1]]])
    return model.replace(fit=type(fit)(fit.dofs, a, b, c, fit.order + 2))


def decay(model, x0, name, noise=0.0, rng=None):
    start = np.zeros(model.fit.states + 2)
    start[model.fit.states] = x0
    x = simulate(model, (TIME, np.zeros((1, TIME.size))), (), start=start).outputs[0]
    if rng is not None:
        x = x + noise * x.std() * rng.standard_normal(TIME.size)
    return Record(TIME, {"Heave": x, "Heave_force": np.zeros(TIME.size)}, kind="decay", name=name)


def largest(model, setting):
    omega = setting.scales["Heave"].omega * np.geomspace(0.1, 10.0, 200)
    f = model.fit
    return max(abs((f.c @ np.linalg.solve(1j * w * np.eye(f.states) - f.a, f.b))[0, 0]) for w in omega)


@pytest.mark.parametrize("mode", [2, 11, 18, 25])
def test_one_more_mode_of_the_memory_does_what_is_computed(mode):
    model = tank_model()
    record = decay(model, 0.03, "decay")
    found, _ = null_fit(setting_of(model, [record], tolerances(0.02)))
    unit, draws = tolerated.memory_errors(found, np.random.default_rng(0), 5)
    shapes = [(w, width) for w in tolerated.mode_frequencies(found) for width in tolerated.WIDTHS]
    assert unit[0].shape == (TIME.size, len(shapes)) and draws.shape == (len(shapes), 5)
    np.testing.assert_array_equal(np.abs(draws).sum(axis=0), 1.0)
    omega = shapes[mode][0]
    size = 0.02 * largest(model, found.problem.setting)
    truth = with_mode(model, omega, shapes[mode][1], size)
    change = decay(truth, 0.03, "").channels["Heave"] - record.channels["Heave"]
    # To first order in 2 % of the memory.
    assert np.linalg.norm(unit[0][:, mode] - change) < 0.06 * np.linalg.norm(change)


def memory_cases(seed):
    """Decays of a body with one more mode in its memory at the edge of the tolerance, hardly any noise."""
    model, rng = tank_model(), np.random.default_rng(seed)
    probe = setting_of(model, [decay(model, 0.03, "")], tolerances(0.02))
    omega = rng.uniform(2.0, 3.5) * probe.scales["Heave"].omega
    truth = with_mode(model, omega, 0.3, rng.choice([-1.0, 1.0]) * 0.02 * largest(model, probe))
    return model, [decay(truth, x0, f"decay {x0}", 5e-4, rng) for x0 in (0.01, 0.03)]


@pytest.mark.parametrize("seed", range(3))
def test_a_memory_with_one_more_mode_within_tolerance_is_no_gap(seed):
    model, records = memory_cases(seed)
    found = diagnose(model, records, pairs=False)
    assert found.verdict.status == "no_gap"
    assert found.settings["null"]["replicates"] > 0


def test_without_that_freedom_the_law_of_the_null_asks_for_more(monkeypatch):
    """Errors of the same records' memory alone would claim much evidence; with the freedom, hardly more than chance."""
    model, records = memory_cases(0)
    setting = setting_of(model, records, tolerances(0.02))
    free = stage.search(setting, terms_of(setting), pairs=False).law
    monkeypatch.setattr(without_effects, "discrepancy", lambda null, floors, rng: ((), 0))
    bound = stage.search(setting, terms_of(setting), pairs=False).law
    assert max(bound.evidence.values()) > 10.0 > 5.0 > max(free.evidence.values())
    assert bound.left > 2.0 * free.left


def test_what_a_nominal_number_can_do_goes_into_the_retuned_model():
    """Numbers off by their tolerance: the discrepancy takes a part in the fit and hands it back for the prediction."""
    model, records = tank_case([], seed=6, kinds=("decay", "waves"), noise=1e-3, duration=20.0)
    null, _ = without_effects.tolerant(setting_of(model, records, tolerances(0.02)))
    setting, q = null.problem.setting, tolerated.retuned(null)
    assert setting.unnamed and np.any(null.q[-setting.unnamed:] != 0.0) and np.all(q[-setting.unnamed:] == 0.0)
    dropped = null.q.copy()
    dropped[-setting.unnamed:] = 0.0
    sizes = [sum(float(r @ r) for r in null.problem.at(x, slopes=False).residuals) for x in (null.q, q, dropped)]
    assert sizes[1] - sizes[0] < 0.3 * (sizes[2] - sizes[0])


@pytest.mark.parametrize("sign", [0, 1])
@pytest.mark.parametrize("gradient", [-3.0, 0.5, 6.0])
def test_claimed_evidence_is_the_integral_over_the_prior(sign, gradient):
    term = SimpleNamespace(signs=(sign,), strengths=[0], alternatives=3)
    information = 2.5

    def integrand(x):
        return np.exp(gradient * x - 0.5 * information * x**2 - 0.5 * x**2) / np.sqrt(2.0 * np.pi) * (1 + sign)

    exact = np.log(quad(integrand, 0.0 if sign else -12.0, 12.0)[0] / 3.0)
    (value,) = claimed(term, np.array([[information]]), np.array([[gradient]]))
    assert value == pytest.approx(exact, abs=1e-6)


def test_the_law_holds_on_fresh_noise():
    """Of nulls with white noise few exceed the hundredth that the law allows them."""
    model, records = tank_case([], seed=4, kinds=("decay", "waves"), duration=20.0)
    setting = setting_of(model, records, tolerances(0.02))
    null, _ = without_effects.tolerant(setting)
    ranked = stage.scores(null, stage.scan(null, terms_of(setting)))
    laws = [null_law(null, ranked, null.noise, -4.0, np.random.default_rng(k)) for k in range(2)]
    assert set(laws[0].evidence) == {item.term.key for item in ranked}
    for key, value in laws[0].evidence.items():
        assert laws[1].evidence[key] == pytest.approx(value, abs=2.5)
    assert laws[0].threshold([ranked[0].term.key], 50.0) == 50.0
    assert NullLaw({("a", "", ""): 9.0}).threshold([("a", "", ""), ("b", "", "")], 3.5) == 9.0


@pytest.mark.parametrize("pulls, informed, odd", [((2.0, 1.5, 0.5), 3, False), ((4.0, 0.0, 0.0), 3, True),
                                                  ((2.7,) + (1.0,) * 16, 17, False), ((2.6, 2.6, 0.0), 1, True)])
def test_pulls_are_odd_only_against_as_many_numbers_as_the_records_inform(pulls, informed, odd):
    n = len(pulls)
    covariance = np.diag([0.0] * informed + [1.0] * (n - informed))
    setting = SimpleNamespace(nominal=(FREE,) * n, unnamed=0)
    fit = SimpleNamespace(q=np.array(pulls), covariance=covariance, problem=SimpleNamespace(setting=setting))
    assert out_of_tolerance(fit) == odd


def test_a_nominal_number_far_off_is_not_hidden_by_many_small_pulls():
    setting = SimpleNamespace(nominal=(FREE, FREE), unnamed=60)
    q = np.concatenate([[3.4, 2.0], 0.3 * np.ones(60)])
    fit = SimpleNamespace(q=q, covariance=np.zeros((62, 62)), problem=SimpleNamespace(setting=setting))
    assert out_of_tolerance(fit) and out_of_tolerance(fit, named=True)


def test_the_pulls_of_the_discrepancy_count_only_where_all_are_asked_for():
    setting = SimpleNamespace(nominal=(FREE, FREE), unnamed=2)
    fit = SimpleNamespace(q=np.array([1.0, 0.5, 5.0, 4.0]), covariance=np.zeros((4, 4)),
                          problem=SimpleNamespace(setting=setting))
    assert out_of_tolerance(fit) and not out_of_tolerance(fit, named=True)
    assert pulled(fit) == pytest.approx(42.25) and pulled(fit, named=True) == pytest.approx(1.25)


def test_of_two_effects_that_fail_on_unseen_data_one_alone_is_tried(monkeypatch):
    term = SimpleNamespace(active=SimpleNamespace(label="friction"))
    two = Verdict("effect", SimpleNamespace(terms=(term, term)), [], 1.0, 0.0)
    one = Verdict("effect", SimpleNamespace(terms=(term,)), [], 0.9, 0.0)
    monkeypatch.setattr(unseen, "decide", lambda found, most: one)

    def predicted(gaps):
        def gap(answer):
            after = gaps[len(answer.chosen.terms) if answer.status == "effect" else 0]
            return SimpleNamespace(gap_before=0.1, gap_after=after, noise_floor=0.01, sure=None), {}
        return gap

    chosen, (far, _), notes = unseen.on_unseen(None, two, predicted({2: 0.5, 1: 0.02}))
    assert chosen is one and far.gap_after == 0.02 and "friction" in notes[0]
    chosen, _, notes = unseen.on_unseen(None, two, predicted({2: 0.03, 1: 0.02}))
    assert chosen is two and not notes
    chosen, (far, _), _ = unseen.on_unseen(None, two, predicted({2: 0.5, 1: 0.6}))
    assert chosen is two and unseen.spoiled(far)


def test_an_effect_lost_by_itself_is_found_through_the_pair_that_has_it(monkeypatch):
    """The single's refit from the null is made to fail; the backward step from the pair brings it back, alone."""
    model, records = tank_case([("cubic_stiffness", {"stiffness": 2e5})], 2, ("decay", "decay"), duration=15.0)
    setting = setting_of(model, records, tolerances(0.02))
    terms = [t for t in terms_of(setting) if t.active.name in ("cubic_stiffness", "quadratic_drag")]
    refit = stage.refit_term

    def forgetful(root, item, *rest):
        lost = not root.problem.terms and item.term.active.name == "cubic_stiffness"
        return None if lost else refit(root, item, *rest)

    monkeypatch.setattr(stage, "refit_term", forgetful)
    found = stage.search(setting, terms)
    assert decide(found).chosen.key == (("cubic_stiffness", "Heave", ""),)


def test_nulls_fitted_anew_set_the_threshold_and_are_kept(tmp_path, monkeypatch):
    model, records = tank_case([], seed=3, kinds=("decay",), duration=12.0)
    asked = {"effects": ["quadratic_drag", "cubic_stiffness"], "pairs": False, "cache": tmp_path / "null.json"}
    first = diagnose(model, records, bootstrap=2, **asked)
    assert first.settings["null"]["refits"] == 2 and first.verdict.status == "no_gap"
    kept = json.loads((tmp_path / "null.json").read_text())["claims"]
    assert len(kept) == 2 and all(np.isfinite(kept)) and kept[0] != kept[1]
    monkeypatch.setattr(bootstrap, "largest_claim", lambda found, terms, rng: 40.0)
    again = diagnose(model, records, bootstrap=3, **asked)
    assert json.loads((tmp_path / "null.json").read_text())["claims"] == [*kept, 40.0]
    assert again.settings["null"]["threshold"] > 35.0
    other = diagnose(model, records, bootstrap=1, seed=1, **asked)
    assert other.settings["null"]["threshold"] == 40.0  # another seed: nothing that was kept counts
    again.save(tmp_path)
    assert "1 fitted anew" not in (tmp_path / "report.html").read_text()
    assert "3 fitted anew" in (tmp_path / "report.html").read_text()
    with pytest.raises(InputError, match="bootstrap"):
        diagnose(model, records, bootstrap=-1)


def test_simulated_nulls_are_the_same_tests_of_a_body_without_the_effect():
    """Records that hold drag, simulated anew: the noise is kept, drag is not needed any more."""
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=5, kinds=("decay", "decay"))
    setting = setting_of(model, records, tolerances(0.02))
    terms = [t for t in terms_of(setting) if t.active.name == "quadratic_drag"]
    found = stage.search(setting, terms, pairs=False)
    null = next(c for c in found.candidates if not c.terms)
    assert found.candidates[0].evidence > null.evidence + 100.0
    claims = [bootstrap.largest_claim(found, terms, np.random.default_rng(k)) for k in range(3)]
    assert max(claims) < 5.0
    made = bootstrap.simulated(found, np.random.default_rng(0))
    for old, new in zip(setting.records, made.records):
        assert [c.time.size for c in old.channels] == [c.time.size for c in new.channels]
        assert 0.3 < np.std(new.channels[0].value) / np.std(old.channels[0].value) < 3.0


def test_where_the_best_effect_is_what_nulls_claim_a_worse_one_is_not_named(monkeypatch):
    """A tank by 40 nats that memory errors would claim, too, does not make friction by 20 nats the cause."""
    def candidate(name, evidence):
        keys = ((name, "Heave", ""),) if name else ()
        return SimpleNamespace(key=keys, terms=keys, evidence=evidence)

    def found(claim):
        some = [candidate("tank_resonance", 40.0), candidate("coulomb_friction", 20.0), candidate("", 0.0)]
        return SimpleNamespace(candidates=some, law=NullLaw({("tank_resonance", "Heave", ""): claim}))

    monkeypatch.setattr(verdict, "material", lambda *_: True)
    monkeypatch.setattr(verdict, "has_size", lambda *_: True)
    assert verdict.simplest(found(50.0), 3.5, 1).terms == ()
    assert verdict.simplest(found(30.0), 3.5, 1).key[0][0] == "tank_resonance"


@pytest.mark.parametrize("matters", [False, True])
def test_the_same_law_refined_says_nothing_against_it(monkeypatch, matters):
    """Two stiffnesses beat a slack line by 500 nats and close hardly more: the line is named, as surely as it was."""
    def candidate(evidence, *names):
        terms = tuple(SimpleNamespace(active=SimpleNamespace(effect=effect_named(name))) for name in names)
        keys = tuple((name, "Heave", "") for name in names)
        return SimpleNamespace(key=keys, terms=terms, evidence=evidence, fit=None)

    two = candidate(1000.0, "cubic_stiffness", "quadratic_stiffness")
    some = [two, candidate(500.0, "slack_mooring"), candidate(496.0, "hysteresis"), candidate(0.0)]
    found = SimpleNamespace(candidates=some, floors=(), law=NullLaw({}, left=0.0))
    monkeypatch.setattr(verdict, "material", lambda found, one, other: other is not two or matters)
    for name, value in {"has_size": True, "twins": False, "gap_left": 0.001, "noise_with_drift": ()}.items():
        monkeypatch.setattr(verdict, name, lambda *_, value=value: value)
    answer = decide(found)
    assert answer.status == "effect" and answer.chosen is some[0 if matters else 1]
    sure = 1.0 if matters else 1.0 / (1.0 + np.exp(-4.0))
    assert answer.probability == pytest.approx(verdict.RELIABLE * sure, rel=1e-6)


@pytest.mark.parametrize("strength, evidence, seen", [(3.0, 5.0, True), (1.0, 45.0, False), (1.0, 60.0, True)])
def test_an_effect_has_size_beyond_chance_or_no_set_does_without_it(monkeypatch, strength, evidence, seen):
    """Strength in standard deviations; evidence above the best set that lacks the effect, which counts from 50 nats."""
    term = SimpleNamespace(key=("actuator_saturation", "Heave", ""))
    fit = SimpleNamespace(problem=None, covariance=np.eye(1), q=np.array([strength]))
    there = SimpleNamespace(key=(term.key,), terms=(term,), evidence=100.0 + evidence, fit=fit)
    others = [SimpleNamespace(key=(("quadratic_drag", "Heave", ""),), evidence=100.0),
              SimpleNamespace(key=(), evidence=0.0)]
    monkeypatch.setattr(verdict, "strength_columns", lambda *_: [0])
    assert verdict.has_size(SimpleNamespace(candidates=[there, *others]), there) is seen


@pytest.mark.parametrize("evidence, claim, matters, lighter, likely", [
    (2.0, -1.0, True, 0.0, True), (2.0, 3.0, True, 0.0, False), (-0.5, -1.0, True, 0.0, False),
    (2.0, -1.0, False, 11.0, True), (2.0, -1.0, False, 3.0, False), (-0.5, -1.0, False, 11.0, False)])
def test_an_effect_more_probable_than_none_is_said_beside_none(monkeypatch, evidence, claim, matters, lighter, likely):
    """Below the threshold of a verdict, above even odds and above what nulls claim: one of the two, not no gap.

    If it closes enough, or lightens the pulls by enough.
    """
    keys = (("excitation_gain", "Heave", ""),)
    term = SimpleNamespace(active=SimpleNamespace(effect=effect_named("excitation_gain")))
    some = [SimpleNamespace(key=key, terms=(term,) * len(key), evidence=value, fit=pulls)
            for key, value, pulls in ((keys, evidence, 4.0), ((), 0.0, 4.0 + lighter))]
    found = SimpleNamespace(candidates=sorted(some, key=lambda c: -c.evidence), floors=(),
                            law=NullLaw({keys[0]: claim}, left=0.0))
    monkeypatch.setattr(verdict, "material", lambda *_: matters)
    monkeypatch.setattr(verdict, "pulled", lambda fit, named=False: fit)
    monkeypatch.setattr(verdict, "gap_left", lambda *_: 0.001)
    monkeypatch.setattr(verdict, "imitable", lambda *_: True)
    monkeypatch.setattr(verdict, "noise_with_drift", lambda fit, floors: floors)
    monkeypatch.setattr(verdict, "has_size", lambda *_: True)
    monkeypatch.setattr(verdict, "sprung", lambda *_: False)
    answer = decide(found)
    assert answer.status == ("ambiguous" if likely else "no_gap")
    if likely:
        assert [c.key for c in answer.rivals] == [keys, ()]
        assert answer.probability == pytest.approx(1.0)


@pytest.mark.parametrize("gaps, pulls, cause", [
    # Three quarters of the energy, a tenth of it; pulls that come home, from far and from near; pulls that stay away.
    ((0.018, 0.009), (10.0, 10.0), True), ((0.018, 0.0171), (10.0, 10.0), False),
    ((0.001, 0.001), (400.0, 12.0), True), ((0.001, 0.001), (35.0, 25.0), True),
    ((0.018, 0.0171), (736.0, 479.0), False)])
def test_what_leaves_more_than_it_explains_is_no_cause(monkeypatch, gaps, pulls, cause):
    none, other = (SimpleNamespace(fit=k, terms=(SimpleNamespace(key=k),) * k, key=()) for k in (0, 1))
    monkeypatch.setattr(verdict, "imitable", lambda *_: True)
    found = SimpleNamespace(null=0, floors=())
    monkeypatch.setattr(verdict, "gap_left", lambda fit, _: gaps[fit])
    monkeypatch.setattr(verdict, "pulled", lambda fit, named: pulls[fit])
    monkeypatch.setattr(verdict, "unusual", lambda fit, named: max(pulls[fit] - 10.0, 0.0))
    monkeypatch.setattr(verdict, "out_of_tolerance", lambda fit, named: pulls[fit] > 30.0)
    assert verdict.material(found, none, other) == cause


@pytest.mark.parametrize("left, cause", [((0.16, 0.0049, 0.0028), False), ((0.02, 0.0046, 0.001), True)])
def test_a_small_second_effect_must_leave_nothing(monkeypatch, left, cause):
    one, two = (SimpleNamespace(fit=k, terms=(k,) * k, key=("first", "second")[:k]) for k in (1, 2))
    monkeypatch.setattr(verdict, "gap_left", lambda fit, _: left[fit])
    monkeypatch.setattr(verdict, "pulled", lambda fit, named=False: (0.0, 40.0, 10.0)[fit] if not named else 5.0)
    monkeypatch.setattr(verdict, "unusual", lambda fit, named: 0.0)
    monkeypatch.setattr(verdict, "out_of_tolerance", lambda fit, named=False: fit == 1 and not named)
    assert verdict.material(SimpleNamespace(null=0, floors=()), one, two) == cause


@pytest.mark.parametrize("first, closed, cause", [("kept", 0.015, False), ("kept", 0.025, True),
                                                  ("given up", 0.015, True), ("given up", 0.005, False)])
def test_a_second_effect_must_close_a_fifth_of_the_first_and_two_others_a_tenth(monkeypatch, first, closed, cause):
    keys = ("first" if first == "kept" else "third", "second")
    left = (0.1005, 0.03, np.sqrt(0.03**2 - closed**2))
    one, two = (SimpleNamespace(fit=k, terms=(k,) * k, key=key) for k, key in ((1, ("first",)), (2, keys)))
    monkeypatch.setattr(verdict, "gap_left", lambda fit, _: left[fit])
    monkeypatch.setattr(verdict, "pulled", lambda *_, **named: 5.0)
    monkeypatch.setattr(verdict, "unusual", lambda *_, **named: 0.0)
    monkeypatch.setattr(verdict, "out_of_tolerance", lambda *_, **named: False)
    assert verdict.material(SimpleNamespace(null=0, floors=()), one, two) == cause


@pytest.mark.parametrize("alone, both, drop, home", [(True, False, 20.0, True), (True, True, 20.0, False),
                                                     (False, False, 20.0, False), (True, False, 3.0, False)])
def test_a_second_effect_that_brings_every_number_home_is_material(monkeypatch, alone, both, drop, home):
    """However little of the motion it closes; not one that leaves some number beyond its tolerance."""
    sizes = ((alone, 5.0 + drop), (both, 5.0))
    one, two = (SimpleNamespace(fit=SimpleNamespace(out=out, size=size)) for out, size in sizes)
    monkeypatch.setattr(verdict, "out_of_tolerance", lambda fit: fit.out)
    monkeypatch.setattr(verdict, "pulled", lambda fit: fit.size)
    assert verdict.brought_home(one, two) is home


@pytest.mark.parametrize("moved, status", [(3.0, "no_gap"), (6.0, "unknown_effect")])
def test_a_number_moved_by_many_tolerances_is_a_gap(monkeypatch, moved, status):
    setting = SimpleNamespace(nominal=(None, None))
    fit = SimpleNamespace(q=np.array([0.1, -moved, 9.0]), problem=SimpleNamespace(setting=setting))  # the last: a start
    none = SimpleNamespace(key=(), terms=(), evidence=0.0, fit=fit)
    monkeypatch.setattr(verdict, "gap_left", lambda *_: 0.001)
    monkeypatch.setattr(verdict, "noise_with_drift", lambda fit, floors: floors)
    assert decide(SimpleNamespace(candidates=[none], floors=(), law=NullLaw())).status == status


def test_what_lightens_the_pulls_is_said_only_if_no_larger_set_is_better_by_far(monkeypatch):
    """Measured heave: pairs that no unseen data need were 168 decades ahead of the single effect that would be said."""
    keys = (("slack_mooring", "Heave", ""),)
    term = SimpleNamespace(active=SimpleNamespace(effect=effect_named("slack_mooring")))
    rows = (((*keys, ("coulomb_friction", "Heave", "")), 400.0, 3.0), (keys, 12.0, 4.0), ((), 0.0, 30.0))
    some = [SimpleNamespace(key=key, terms=(term,) * len(key), evidence=value, fit=pulls) for key, value, pulls in rows]
    monkeypatch.setattr(verdict, "material", lambda *_: False)
    monkeypatch.setattr(verdict, "has_size", lambda *_: True)
    monkeypatch.setattr(verdict, "imitable", lambda *_: True)
    monkeypatch.setattr(verdict, "pulled", lambda fit, named=False: fit)
    for candidates, said in ((some, 0), (some[1:], 1)):
        found = SimpleNamespace(candidates=candidates, law=NullLaw({}))
        assert len(verdict.more_likely(found, some[-1])) == said


def test_numbers_of_each_record_count():
    """A slow force has three numbers in every record; BIC that counts them once would give it two records free."""
    model, records = tank_case([], seed=1, kinds=("decay", "decay", "waves"), duration=15.0)
    setting = setting_of(model, records, tolerances(0.02))
    terms = {t.active.name: t for t in terms_of(setting)}
    for name, count in (("slow_drift", 9), ("quadratic_drag", 1)):
        problem = Problem(setting, (terms[name],))
        assert numbers_of(SimpleNamespace(problem=problem)) == count


def test_a_larger_set_that_fewer_effects_beat_is_not_chosen(monkeypatch):
    """A pair behind a single effect, be that one too small to matter, is no better explanation than it."""
    def candidate(names, evidence):
        keys = tuple((name, "Heave", "") for name in names)
        return SimpleNamespace(key=keys, terms=keys, evidence=evidence)

    some = [candidate(["tank_resonance"], 11.4), candidate(["tank_resonance", "slack_mooring"], 6.4),
            candidate([], 0.0)]
    monkeypatch.setattr(verdict, "has_size", lambda *_: True)
    monkeypatch.setattr(verdict, "material", lambda _, one, other: len(other.terms) == 2)
    found = SimpleNamespace(candidates=some, law=NullLaw())
    assert verdict.simplest(found, 3.5).terms == ()
    some[1].evidence = 16.4
    assert len(verdict.simplest(SimpleNamespace(candidates=some, law=NullLaw()), 3.5).terms) == 2
