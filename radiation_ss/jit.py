"""numba's compiler with the package's options, cached on disk where the disk lets us, and safe against damage there."""

import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

# Inlined always, so that a loop has the same machine code in the session that compiles it as in those that take it from
# the cache: which copy of an inner function is linked differs between the two, and with it the last bit.
INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": True}


class CheckedFile(IndexDataCacheFile):  # type: ignore[misc]
    """numba's cache file of one function; machine code that is not what was written counts as absent."""

    def load(self, key: Any) -> Any:
        """Return an entry, None where it is absent or damaged."""
        try:
            return super().load(key)
        except Exception:  # unpickling damaged bytes can raise anything: any class may be named in them
            return None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # as above; a lost index only costs a compilation
            return {}

    def _load_data(self, name: str) -> Any:
        digest, data = super()._load_data(name)
        return pickle.loads(data) if digest == hashlib.sha256(data).digest() else None

    def _save_data(self, name: str, data: Any) -> None:
        inside = self._dump(data)
        super()._save_data(name, (hashlib.sha256(inside).digest(), inside))


def _sources(function: Callable, found: set[str]) -> set[str]:
    """Add the files of a function and of the compiled ones that it may call, which are part of its machine code."""
    path = function.__code__.co_filename
    if path not in found:
        found.add(path)
        for value in function.__globals__.values():
            if isinstance(value, Dispatcher):
                _sources(value.py_func, found)
    return found


def _stamp(function: Callable) -> tuple[tuple[str, int, int], ...]:
    """Return names, times and sizes of a function's sources."""
    found = [(Path(path).name, os.stat(path)) for path in sorted(_sources(function, set()))]
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in found)


def _cached(function: Callable, options: dict[str, Any]) -> Any:
    """Return the compiled function with its cache on disk; RuntimeError without a folder to write that to."""
    compiled, kept = numba.njit(**options)(function), FunctionCache(function)
    file = kept._cache_file
    kept._cache_file = CheckedFile(file._cache_path, file._index_name.removesuffix(".nbi"),
                                   (file._source_stamp, _stamp(function)))
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "1":
        compiled._cache = kept
    return compiled


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
        return _cached(function, options)
    except RuntimeError:  # numba finds no folder that it may write its cache to
        return numba.njit(**options)(function)
