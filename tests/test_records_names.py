"""Records are told apart by name: the file's whole name, and a number where two are alike."""

import gzip

import numpy as np
import pytest

import radiation_ss as rss

TIME = np.arange(0.0, 12.0, 0.05)


@pytest.mark.parametrize("name", ["decay_0.05", "run 7.2", "plain"])
def test_a_file_keeps_its_name(tmp_path, name):
    for ending, opened in ((".csv", open), (".csv.gz", gzip.open)):
        with opened(tmp_path / (name + ending), "wt") as file:
            file.write("time [s],Heave [m]\n0,1\n1,2\n2,1\n")
        assert rss.read_record(tmp_path / (name + ending)).name == name


def test_a_diagnosis_is_the_same_with_and_without_names():
    """Two decays of the same name: sizes and errors are kept by name."""
    fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    rng, decays = np.random.default_rng(0), []
    for size in (0.1, 0.02):
        motion = rss.simulate(model, (TIME, 0.0 * TIME[None]), [("quadratic_drag", {"coefficient": 400.0})],
                              start={"Heave": size}).outputs[0]
        decays.append(motion + 1e-4 * rng.standard_normal(TIME.size))
    answers = [rss.diagnose(model, [rss.Record(TIME, {"Heave": x}, kind="decay", name=name)
                                    for x, name in zip(decays, names)], ["quadratic_drag", "linear_damping"])
               for names in (("large", "small"), ("decay", "decay"))]
    assert answers[0].how_far.gap_before == pytest.approx(answers[1].how_far.gap_before, rel=1e-9)
    found = [list(a.where.records.values()) for a in answers]
    assert found[0] == pytest.approx(found[1])
    assert list(answers[1].where.records) == ["decay", "decay_2"]


def test_a_record_counts_once(tmp_path):
    model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    rss.write_record(rss.Record(TIME, {"Heave": np.cos(2.0 * TIME)}, kind="decay"), tmp_path / "one.csv")
    one, copy = str(tmp_path / "one.csv"), str(tmp_path / "copy.csv")
    (tmp_path / "copy.csv").write_bytes((tmp_path / "one.csv").read_bytes())
    with pytest.raises(rss.InputError, match=r"record 1 \(.*one.csv\) and record 2 \(.*copy.csv\) hold the same"):
        rss.identify(model, [one, copy], "prediction-error")
    with pytest.raises(rss.InputError, match=r"record 1 \(.*one.csv\) and withheld record 1 \(.*copy.csv\) hold"):
        rss.diagnose(model, one, withhold=copy)
