"""How many of a law's seeds are tried: the first ones, or all of them by `benchmarks/all_seeds.py`."""

import os
from collections.abc import Iterable


def some(seeds: Iterable[int], count: int = 1) -> list[int]:
    """Return the first `count` seeds; all of them where RADIATION_SS_SEEDS is "all"."""
    listed = list(seeds)
    return listed if os.environ.get("RADIATION_SS_SEEDS") == "all" else listed[:count]
