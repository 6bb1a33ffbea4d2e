"""Whatever bytes a file holds, a reader gives the right data or an InputError, and nothing else."""

from pathlib import Path

import hydro_fuzz_targets
import pytest
from fuzzing import attack
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import radiation_ss as rss

TARGETS = hydro_fuzz_targets.targets()


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_damaged_files_are_refused_or_read_right(target):
    wrong = [o for o in attack([target], 30, seed=1) if not o.allowed]
    assert not wrong, (wrong[0].kind, wrong[0].result, wrong[0].detail, wrong[0].content[-200:])


@pytest.mark.parametrize("target", [t for t in TARGETS if t.text], ids=lambda target: target.name)
def test_no_line_can_be_lost_unnoticed(target, tmp_path):
    """Each line in turn is left out: the file is refused, or nothing that is read was on it."""
    path = target.write(tmp_path)
    whole = target.digest(target.read(path))
    lines = (tmp_path / target.file).read_text().splitlines(keepends=True)
    step = max(1, len(lines) // 150)
    for k in [*range(0, len(lines), step), *range(len(lines) - 3, len(lines))]:
        (tmp_path / target.file).write_text("".join(lines[:k] + lines[k + 1:]))
        try:
            assert target.digest(target.read(path)) == whole, lines[k]
        except rss.InputError:
            continue


@pytest.mark.parametrize("suffix", sorted({Path(t.file).suffix for t in TARGETS} - {".dat", ".tec"}))
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=300))
def test_arbitrary_bytes(tmp_path, suffix, content):
    path = tmp_path / f"body{suffix}"
    path.write_bytes(content)
    if suffix == ".3":
        path.with_suffix(".1").write_bytes(content)
    with pytest.raises(rss.InputError, match=r"body|missing"):
        rss.read_hydro(path)
