"""Shared fixtures: the folder of third-party data, which is never part of the repository."""

import os
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")


def data_folder() -> Path | None:
    places = [os.environ.get("RADIATION_SS_DATA", ""), str(Path(__file__).parents[2] / "shared" / "data")]
    return next((Path(p) for p in places if p and Path(p).is_dir()), None)


@pytest.fixture(scope="session")
def data() -> Path:
    folder = data_folder()
    if folder is None:
        pytest.skip("third-party data absent: set RADIATION_SS_DATA")
    return folder
