"""What a prompt shows of a result: at most ten lines of at most a hundred characters; a notebook has a picture too."""

import numpy as np
import pytest
from fit_systems import data_of, random_passive

import radiation_ss as rss
from radiation_ss.filter import UncertainPlant
from radiation_ss.page import brief

TIME = np.arange(0.0, 12.0, 0.05)


@pytest.fixture(scope="module")
def results():
    """One of each result."""
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.geomspace(0.3, 30.0, 60), 0.45, gyradius=0.07)
    data = section.times(0.297).select("Heave")
    model = rss.Model.from_hydro(data, rss.fit_radiation(data, 3))
    drag = ("quadratic_drag", "Heave", {"coefficient": 90.0})
    motion = rss.simulate(model, (TIME, np.zeros((1, TIME.size))), [drag], start=np.r_[0.0, 0.0, 0.0, 0.04, 0.0])
    noise = 1e-4 * np.random.default_rng(0).standard_normal(TIME.size)
    record = rss.Record(TIME, {"Heave": motion.outputs[0] + noise}, kind="decay")
    own = UncertainPlant(lambda p: model.replace(M=[[p["mass"]]]), {"mass": (float(model.M[0, 0]), 0.1)})
    found = rss.diagnose(model, [record], effects=["quadratic_drag", "coulomb_friction"])
    return {
        "HydroData": data, "RadiationFit": model.fit, "Model": model, "Record": record, "Diagnosis": found,
        "Identification": rss.identify(model, [record], method="prediction-error"),
        "QualityReport": data.check(), "Audit": rss.audit(model.fit, data), "Sampled": rss.sampled(model.fit, 0.05),
        "ExcitationFit": rss.fit_excitation(data, data.directions[0], states=4),
        "Spectrum": rss.jonswap(0.1, 1.2), "Sea": rss.realise(rss.jonswap(0.1, 1.2), 20.0, 0.1, seed=0),
        "Estimate": rss.DualEnKF(model, seed=0).run(record), "PlantEstimate": rss.DualEnKF(own, seed=0).run(record),
        "Budget": found.budget, "Corrected": found.corrected,
        "Isolability": rss.isolability(model, record, effects=["quadratic_drag", "coulomb_friction"]),
        "TestPlan": rss.plan_tests(model, amplitude=0.04, tests=("decay",),
                                   effects=["quadratic_drag", "constant_force"])}


@pytest.mark.parametrize("name", ["HydroData", "RadiationFit", "Model", "Record", "Diagnosis", "Identification",
                                  "QualityReport", "TestPlan", "Audit", "Sampled", "Budget", "Corrected",
                                  "Isolability", "ExcitationFit", "Spectrum", "Sea", "Estimate", "PlantEstimate"])
def test_reprs_are_short(results, name):
    item = results[name]
    lines = repr(item).splitlines()
    assert type(item).__name__ == name and len(lines) <= 10 and max(map(len, lines)) <= 100
    if hasattr(item, "plot"):
        assert "<svg" in item._repr_html_()


def test_a_notebook_keeps_no_megabyte_of_a_picture():
    data = data_of(*random_passive(12, 6, 0), np.linspace(0.5, 40.0, 300),
                   ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"), 3.0 * np.eye(6))
    pages = [item._repr_html_() for item in (data, rss.fit_radiation(data, 1))]
    assert max(map(len, pages)) <= 200_000 and "<svg" in pages[0] and "image/png" in pages[1]


def test_a_cut_text_says_how_much_is_left_out():
    text = "\n".join([*map(str, range(30)), "word " * 50])
    assert brief(text).splitlines()[-1] == "... 24 more lines: print() shows all"
    assert brief("\n".join(map(str, range(10)))).splitlines() == list(map(str, range(10)))
    assert brief("  one " + "word " * 40).splitlines()[1].startswith("    word")
