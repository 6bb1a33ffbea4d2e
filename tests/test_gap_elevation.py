"""Records whose force comes from the elevation: the slow force is unknown, whatever the candidate."""

import numpy as np
import pytest
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.blind import cases
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.how_far.ledger import Error, HowFar, pooled_gap
from radiation_ss.gap.how_far.unseen import spoiled, without_slow
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.hydro.files import write_hydro
from radiation_ss.records.record import Record


def settings(kind, tmp_path, seed=1):
    case = cases.make(np.random.SeedSequence(seed), "none", "heave", kind)
    write_hydro(case.data, tmp_path / "MODEL.nc")
    return setting_of(rss.read_model(tmp_path / "MODEL.nc"), case.records, tolerances(0.02))


def offset(setting):
    (term,) = [t for t in terms_of(setting) if t.active.name == "constant_force"]
    problem = Problem(setting, (term,))
    slopes = problem.at(np.zeros(problem.size)).slopes
    return [float(np.abs(s[:, problem.columns(0)]).max() / np.std(c.value)) for s, c in
            zip(slopes, [c for r in setting.records for c in r.channels])]


def test_a_slow_force_is_no_fault_of_the_body_where_only_the_elevation_is_known(tmp_path):
    setting = settings("elevation", tmp_path)
    assert setting.drift_unknown
    assert not [t for t in terms_of(setting) if t.active.name == "slow_drift"]
    driven = [r.record.kind != "decay" for r in setting.records for _ in r.channels]
    for values, hides in zip(setting.slow, driven):
        assert (values.shape[1] > 0) == hides
        assert np.allclose(values.T @ values, np.eye(values.shape[1]))
    rng = np.random.default_rng(0)
    for k, values in enumerate(setting.slow):
        slow = values @ rng.standard_normal(values.shape[1])
        assert np.allclose(setting.without_slow(k, slow), 0.0)


def test_with_a_recorded_force_nothing_is_left_out(tmp_path):
    setting = settings("waves", tmp_path)
    assert not setting.drift_unknown
    assert all(values.size == 0 for values in setting.slow)
    assert [t for t in terms_of(setting) if t.active.name == "slow_drift"]
    assert min(offset(setting)) > 1e-3


@pytest.mark.parametrize("drift, refused", [(0.05, False), (0.0, True)])
def test_the_veto_leaves_slow_motion_out(drift, refused):
    """A prediction that misses only a slow motion which no elevation holds is not refused; a wrong wave motion is."""
    model, time = tank_model(), np.arange(0.0, 40.0, 0.05)
    record = Record(time, {"Heave": np.sin(6.0 * time), "wave_elevation": 0.02 * np.sin(6.0 * time)}, kind="waves",
                    name="sea")
    error = drift * np.cos(2.0 * np.pi * 0.02 * time) if drift else 0.05 * np.sin(6.0 * time + 1.0)
    item = Error("sea", 0, "displacement", time, np.sin(6.0 * time), error)
    after = pooled_gap(without_slow(model, record, [item]))
    assert spoiled(HowFar(0.02, 0.02, pooled_gap([item]), 0.005, 0.0, (0.0, 0.0), (), (0.02, after))) == refused
    forced = Record(time, {**record.channels, "Heave_force": time}, kind="waves", name="sea")
    assert without_slow(model, forced, [item])[0].error is item.error
