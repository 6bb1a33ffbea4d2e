"""Print the lowest versions that pyproject.toml allows, one requirement a line, for pip.

python .ci/lowest.py > lowest.txt && python -m pip install -r lowest.txt
"""

import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
for requirement in [*project["dependencies"], *project["optional-dependencies"]["test"]]:
    print(requirement.replace(">=", "=="))
