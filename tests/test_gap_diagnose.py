"""Diagnosis on small simulated cases: verdicts, sizes, shrinkage, files."""

import json

import numpy as np
import pytest
from gap_cases import tank_case

from radiation_ss.errors import InputError
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.simulation.run import predict_record

FIRST = ["quadratic_drag", "linear_damping", "coulomb_friction", "linear_stiffness", "added_inertia", "sensor_delay",
         "sensor_gain"]


@pytest.fixture(scope="module")
def drag():
    model, records = tank_case([("quadratic_drag", {"coefficient": 150.0})], seed=2)
    return model, records, diagnose(model, records[:1] + records[2:3], FIRST, withhold=[records[1], records[3]])


def test_drag_is_found_with_its_size(drag):
    _, _, found = drag
    assert found.verdict.status == "effect"
    (effect,) = found.verdict.effects
    value, deviation = effect.parameters["coefficient"]
    assert effect.name == "quadratic_drag"
    assert abs(value - 150.0) < 4.0 * deviation
    assert found.where.amplitude_dependent and found.where.phase == "damping"


def test_the_gap_shrinks_on_unseen_records(drag):
    _, _, found = drag
    h = found.how_far
    assert h.on == ("decay 2", "waves 4")
    assert h.gap_after < 0.2 * h.gap_before
    assert h.interval[0] <= h.shrinkage <= h.interval[1]


def test_files_have_the_agreed_form(drag, tmp_path):
    model, records, found = drag
    found.save(tmp_path)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["schema"] == "radiation_ss.diagnosis/1"
    assert set(report) >= {"verdict", "candidates", "where", "how_far"}
    assert set(report["verdict"]) == {"status", "effects", "probability", "indistinguishable", "not_testable",
                                      "next_record"}
    assert sum(share for _, _, share in report["where"]["bands"]) == pytest.approx(1.0)
    assert "<html" in (tmp_path / "report.html").read_text()
    predicted = predict_record(model, records[3], tmp_path / "corrected.json")
    error = predicted.channels["Heave"] - records[3].channels["Heave"]
    assert np.std(error) < 0.05 * np.std(records[3].channels["Heave"])


@pytest.mark.parametrize("seed", range(2))
def test_no_effect_is_invented(seed):
    model, records = tank_case([], seed=seed, kinds=("decay", "waves"))
    found = diagnose(model, records, FIRST, pairs=False)
    assert found.verdict.status == "no_gap"
    assert not found.verdict.effects


def test_tolerance_is_demanded():
    model, records = tank_case([], kinds=("decay",), duration=5.0)
    with pytest.raises(InputError, match="tolerance"):
        diagnose(model, records, tolerance=None)
    with pytest.raises(InputError, match="between 0 and 1"):
        diagnose(model, records, tolerance=2.0)


def test_noise_alone_is_refused():
    model, records = tank_case([], kinds=("decay",), duration=15.0)
    noise = np.random.default_rng(0).standard_normal(records[0].time.size)
    with pytest.raises(InputError, match="only noise"):
        diagnose(model, records[0].with_channels(Heave=noise))


def test_a_record_of_another_body_is_refused():
    model, records = tank_case([], kinds=("decay",), duration=15.0)
    from dataclasses import replace

    foreign = replace(records[0], channels={"Roll": records[0].channels["Heave"]})
    with pytest.raises(InputError, match="degrees of freedom"):
        diagnose(model, foreign)


def test_jitter_gaps_and_two_rates_do_not_matter():
    model, records = tank_case([("coulomb_friction", {"force": 0.5, "width": 0.004})], seed=4,
                               kinds=("decay", "waves"), duration=20.0)
    rng = np.random.default_rng(1)
    rough = []
    for record in records:
        shift = 0.05 * rng.uniform(-0.3, 0.3, record.time.size)
        time = record.time + shift - shift[0]
        channels = {name: np.interp(time, record.time, values) for name, values in record.channels.items()}
        channels["Heave"][rng.random(time.size) < 0.1] = np.nan
        channels["Heave"][100:115] = np.nan
        channels["Heave_force"][1::2] = np.nan if record.kind == "waves" else 0.0
        rough.append(type(record)(time, channels, kind=record.kind, name=record.name))
    found = diagnose(model, rough, FIRST, pairs=False)
    assert [effect.name for effect in found.verdict.effects] == ["coulomb_friction"]
    value, deviation = found.verdict.effects[0].parameters["force"]
    assert abs(value - 0.5) < 4.0 * deviation


@pytest.mark.parametrize("seed", [4, 5])
def test_a_slow_force_of_a_record_goes_on_in_the_part_that_no_fit_has_seen(seed):
    """It is the record's own: in its tail it closes the gap down to the noise, in another record it is unknown."""
    drift = ("slow_drift", {"cosine": 2.0, "sine": 1.0, "frequency": 0.6})
    model, records = tank_case([drift], seed=seed)
    waves = [record for record in records if record.kind == "waves"]
    found = diagnose(model, waves, ["slow_drift", "quadratic_drag", "linear_stiffness"], pairs=False)
    h = found.how_far
    (effect,) = found.verdict.effects
    assert effect.name == "slow_drift"
    assert h.gap_after < 1.5 * h.noise_floor < 0.5 * h.gap_retuned
    assert list(effect.by_record) == [record.name for record in waves]
    assert effect.by_record[waves[0].name] == effect.parameters
    assert effect.to_dict()["by_record"].keys() == effect.by_record.keys()
    for record in waves:
        assert f"in {record.name}: cosine" in found.sentence
        for name, true in drift[1].items():
            value, deviation = effect.by_record[record.name][name]
            assert abs(value - true) < 4.5 * deviation
