"""numba's compiler with the package's options, cached on disk where the disk lets us."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

# Inlined always, so that a loop has the same machine code in the session that compiles it as in those that take it from
# the cache: which copy of an inner function is linked differs between the two, and with it the last bit.
INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": True}


def jit(function: Callable | None = None, *, inner: bool = False, **options: Any) -> Any:
    """Compile without Python objects; cached between sessions unless the installation is read-only throughout.

    `inner` functions can only be called by compiled ones, which saves compiling their entrance from Python.
    """
    if function is None:
        return lambda f: jit(f, inner=inner, **options)
    if inner:
        options |= INNER
    options = {"nogil": True, "fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", **options}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba finds no folder that it may write its cache to
        return numba.njit(**options)(function)
