"""Where the measured data lie."""

from __future__ import annotations

import os
from pathlib import Path


def data_folder() -> Path | None:
    """Return the folder of measured data: RADIATION_SS_DATA, else shared/data beside the checkout; None if absent."""
    places = [os.environ.get("RADIATION_SS_DATA", ""), str(Path(__file__).parents[2] / "shared" / "data")]
    return next((Path(p) for p in places if p and Path(p).is_dir()), None)
