"""Composite (Cummins) models, their makers, their discretisation; `rss.body(...)` makes one from a few numbers.

The package is called as a function, so that `rss.body` is both: see `radiation_ss.body.make.body`.
"""

import sys
from types import ModuleType
from typing import Any

from radiation_ss.methods import door


class _Maker(ModuleType):
    """A module that makes a model when it is called."""

    def __call__(self, *system: Any, **given: Any) -> Any:
        """Return the model of a few numbers; see `radiation_ss.body.make.body`."""
        return __getattr__("body")(*system, **given)


sys.modules[__name__].__class__ = _Maker

__getattr__, __all__ = door(__name__, {
    "composite": "cummins mass_matrix rigid_body system_matrices",
    "make": "body",
    "dynamics": "Modes natural_modes",
    "particulars": "RIGID",
})
