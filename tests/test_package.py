"""What stands in several places about the package agrees: version, dependencies, programs."""

import re
import tomllib
from pathlib import Path

import radiation_ss

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


def test_one_version():
    stated = {PROJECT["version"], radiation_ss.__version__,
              re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)[1],
              re.search(r'version = "(.+)"', (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8"))[1]}
    assert len(stated) == 1
    assert f"## {radiation_ss.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_conda_recipe_states_the_dependencies_of_the_wheel():
    recipe = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    run = re.search(r"\n  run:\n(.*?)\n\n", recipe, re.DOTALL)[1]
    stated = {tuple(line.strip(" -").split(" >=")) for line in run.splitlines()}
    wanted = {tuple(r.split(">=")) for r in PROJECT["dependencies"]}
    assert stated == {(CONDA_NAMES.get(name, name), low) for name, low in wanted} | {("python", "3.11")}


def test_studies_are_tests():
    """A name that no test has would leave nothing out."""
    for line in (ROOT / "tests" / "studies.txt").read_text(encoding="utf-8").splitlines():
        name, _, test = line.partition("::")
        assert f"\ndef {test.partition('[')[0]}(" in (ROOT / "tests" / name).read_text(encoding="utf-8"), line
