"""numba's compiler with the package's options, cached on disk where the disk lets us."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def jit(function: Callable | None = None, **options: Any) -> Any:
    """Compile without Python objects; cached between sessions unless the installation is read-only throughout."""
    if function is None:
        return lambda f: jit(f, **options)
    options = {"nogil": True, "fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", **options}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba finds no folder that it may write its cache to
        return numba.njit(**options)(function)
