"""The demo does the whole main job from nothing and leaves files that the command line can go on with."""

import json

from radiation_ss.cli import main


def test_demo_from_nothing_to_a_page(tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["fit"]["passive"] and found["fit"]["relative_error"] < 0.01
    start = found["identification"]["start"]["error_of_K"]
    with_points = found["identification"]["dual filter with two known points"]
    assert with_points["error_of_K"] < 0.1 * start
    verdict = found["diagnosis"]["verdict"]
    assert [e["name"] for e in verdict["effects"]] == ["quadratic_drag"]
    coefficient, deviation = verdict["effects"][0]["parameters"]["coefficient"]
    assert abs(coefficient - 90.0) < 4.0 * deviation
    assert found["diagnosis"]["how_far"]["gap_after"] < 0.1 * found["diagnosis"]["how_far"]["gap_before"]
    assert not found["diagnosis"]["notes"]  # its records are sound
    for name in ("report.html", "tank.nc", "fit.json", "waves_30s.csv", "diagnosis/report.json"):
        assert (tmp_path / name).stat().st_size > 100
