"""Hands objects to the functions that draw or write them.

Data classes draw and write nothing: their methods `plot` and `save` name a module of `radiation_ss.report` and a
function of it, which is loaded only then. So data modules import nothing of the report.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def present(module: str, function: str, *args: Any, **options: Any) -> Any:
    """Call a function of `radiation_ss.report.<module>`."""
    return getattr(import_module(f"radiation_ss.report.{module}"), function)(*args, **options)
