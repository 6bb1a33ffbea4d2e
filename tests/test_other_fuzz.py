"""Whatever bytes a file of any form holds: the right answer, other numbers that stand in it, or one sentence."""

import json

import numpy as np
import other_fuzz_targets
import pytest
from fuzzing import attack

import radiation_ss as rss

TARGETS = other_fuzz_targets.targets()


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_damaged_files_are_refused_or_read_right(target):
    if "parquet" in target.name:
        pytest.importorskip("pyarrow")
    wrong = [o for o in attack([target], 30, seed=1) if not o.allowed]
    assert not wrong, (wrong[0].kind, wrong[0].result, wrong[0].detail, wrong[0].content[-200:])


def test_an_hdf5_file_that_states_any_shape_is_refused_before_it_is_read(tmp_path):
    import h5py

    for name, read in (("body.nc", rss.read_hydro), ("body.h5", rss.read_hydro), ("fit.h5", rss.read_fit)):
        with h5py.File(tmp_path / name, "w") as file:
            file.create_dataset("omega", (10**6, 10**6), "f8", chunks=(1000, 1000))
        assert (tmp_path / name).stat().st_size < 10_000
        with pytest.raises(rss.InputError, match="unpacks to 8000000000000 bytes"):
            read(tmp_path / name)


def test_what_a_file_of_a_fit_says_is_taken_as_it_stands(tmp_path):
    path = other_fuzz_targets.tank_model().fit.write(tmp_path / "fit.json")
    whole = json.loads(path.read_text())
    for change, words in (({"order": 3.7}, "order: '3.7' is not a whole number"), ({"order": True}, "order"),
                          ({"dofs": "Heave"}, "dofs: a list is needed"), ({"a": [[1.0, 2.0]]}, "field a: lists"),
                          ({"c": [["1.0", 0.0, 1.0]]}, "field c: only numbers"), ({"method": None}, "not a text"),
                          ({"at_zero": "maybe"}, "at_zero"), ({"relative_error": 1e999}, "relative_error")):
        path.write_text(json.dumps({**whole, **change}))
        with pytest.raises(rss.InputError, match=rf"fit\.json.*{words}"):
            rss.read_fit(path)
    path.write_text(json.dumps(whole).replace('"order": 3', '"order": 4, "order": 3'))
    with pytest.raises(rss.InputError, match="'order' stands there twice"):
        rss.read_fit(path)


def test_coefficients_that_changed_since_a_model_was_written_are_said(tmp_path):
    import h5py

    model = other_fuzz_targets.tank_model().replace(name="tank")
    model.write(tmp_path / "model.nc")
    assert rss.read_model(tmp_path / "model.nc").name == "tank"
    with h5py.File(tmp_path / "model.nc", "r+") as file:
        file["added_mass"][...] = 1.01 * file["added_mass"][()]
    changed = rss.read_model(tmp_path / "model.nc", order=3)
    assert changed.name != "tank" and any("changed since" in note for note in changed.hydro.notes)
    with h5py.File(tmp_path / "model.nc", "r+") as file:
        file["radiation_ss/model"][...] = file["radiation_ss/model"][()].replace(b'"order": 3', b'"order": 2')
    with pytest.raises(rss.InputError, match="not what was written"):
        rss.read_model(tmp_path / "model.nc")


def test_a_correction_for_another_model_is_refused(tmp_path):
    model = other_fuzz_targets.tank_model()
    found = other_fuzz_targets.Corrected({("nominal_kernel_shape_9", "Heave"): 0.1}, ())
    found.write(tmp_path / "corrected.json")
    with pytest.raises(rss.InputError, match=r"corrected\.json.*nominal_kernel_shape_9"):
        other_fuzz_targets.read_corrected(tmp_path / "corrected.json", model)


def test_complex_numbers_are_no_real_ones():
    with pytest.raises(rss.InputError, match="A: complex numbers"):
        rss.HydroData([1.0], np.ones((1, 1, 1)) * 1j, np.ones((1, 1, 1)), dofs=("Heave",))
