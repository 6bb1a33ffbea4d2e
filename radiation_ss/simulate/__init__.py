"""Measured records, effects, and time-domain simulation."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Stage(ModuleType):
    """The folder as a module that can be called: `rss.simulate(model, record)` although a folder has the name too."""

    def __call__(self, *args: Any, **keywords: Any) -> Any:
        from radiation_ss.simulate.run import simulate

        return simulate(*args, **keywords)


sys.modules[__name__].__class__ = _Stage
