"""The paper's filter behind `identify` and the command line."""

import json

import numpy as np
import pytest
from identify_tank import BAND, sail, tank, with_waves

import radiation_ss as rss
from radiation_ss.cli import main
from radiation_ss.errors import InputError


def sailed():
    """Return the tank with its data and a record with all that the paper measures."""
    model = with_waves(tank())
    record, _ = sail(model, 15.0, np.random.default_rng(0), dt=0.02, noise=0.0)
    y = record.channels["Heave"]
    velocity = np.gradient(y, record.time)
    record = record.with_channels(Heave_velocity=velocity, Heave_acceleration=np.gradient(velocity, record.time))
    return model, rss.Record(record.time, {name: record.channels[name] for name in
                                           ("Heave", "Heave_velocity", "Heave_acceleration")}, kind="motion-only")


def test_smaller_parameter_noise_keeps_the_parameters_nearer_to_their_start():
    """Section 3.2: theta walks by steps of variance Q_theta."""
    model, record = sailed()
    away = []
    for Q in (8.0739e-5, 8.0739e-7):
        found = rss.identify(model, record, preset="paper", Q_theta=Q, omega=BAND)
        assert found.method == "dual-enkf" and set(found.force) == {"record"}
        away.append(max(abs(p["mean"] / p["prior_mean"] - 1.0) for p in found.parameters.values()))
    assert away[1] < 0.5 * away[0]
    same = rss.identify(model, record, "paper", Q_theta=8.0739e-7, omega=BAND)
    np.testing.assert_array_equal(same.K.mean, found.K.mean)


@pytest.mark.parametrize(("options", "message"), [
    (dict(Q_theta=-1.0, preset="paper"), "Q_theta"), (dict(Q_tetha=1.0), "Q_tetha"),
    (dict(R=1.0, method="prediction-error"), "options of the dual filter")])
def test_wrong_options_of_the_filter_are_named(options, message):
    model, record = sailed()
    with pytest.raises(InputError, match=message):
        rss.identify(model, record, **options)


def test_the_command_line_has_the_paper(tmp_path, monkeypatch):
    model, record = sailed()
    model.write(tmp_path / "tank.nc")
    rss.write_record(record, tmp_path / "run.csv")
    out = tmp_path / "out"
    assert main(["identify", str(tmp_path / "tank.nc"), str(tmp_path / "run.csv"), "--method", "paper", "--q-theta",
                 "8e-7", "--q-state", "8e-5", "--r", "8e-5", "--order", "3", "--out", str(out)]) == 0
    assert json.loads((out / "identify.json").read_text())["method"] == "dual-enkf"
