"""MATLAB's level 5 .mat (save -v6 and -v7) as plain dicts, lists, strings and arrays.

Source: MathWorks, "MAT-File Format", level 5. Not scipy's reader: that one ends the process on some damaged files.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8", 16: "u1",
           17: "u2", 18: "u4"}
MATRIX, COMPRESSED = 14, 15
MSS_AXES = np.array([1, -1, -1, 1, -1, -1])  # forward-starboard-down of MSS's files becomes forward-port-up
CELL, STRUCT, CHAR, FIRST, LAST = 1, 2, 4, 6, 15  # classes; those from FIRST to LAST hold numbers


def read_mat(path: Path, most: int = 1 << 30) -> dict[str, Any]:
    """Return the variables of a file; one that unpacks to more than `most` bytes is refused.

    A struct is a dict, an array of structs and a cell a list, other classes None. ValueError if the file is no level 5
    file, or is damaged.
    """
    content = path.read_bytes()
    if content.startswith(b"MATLAB 7.3"):
        raise ValueError("MATLAB v7.3; save it with save(..., '-v7')")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise ValueError("no MATLAB level 5 head")
    found: dict[str, Any] = {}
    for kind, data in _elements(memoryview(content)[128:], order):
        if kind == COMPRESSED:
            unpacked = zlib.decompressobj().decompress(data, most)
            kind, data = next(_elements(memoryview(unpacked), order))
        if kind == MATRIX:
            name, value = _matrix(data, order)
            found[name] = value
    return found


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of each element; up to four bytes may stand within the tag."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise ValueError("cut off within a tag")
        kind, size = (int(v) for v in np.frombuffer(data[at:at + 8], order + "u4"))
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
            after = at + 8
        else:
            start = at + 8
            after = start + size + (0 if kind == COMPRESSED else -size % 8)
        if start + size > len(data) or (start == at + 4 and size > 4):
            raise ValueError(f"an element of {size} bytes is cut off")
        yield kind, data[start:start + size]
        at = after


def _numbers(element: tuple[int, memoryview], order: str) -> np.ndarray:
    kind, data = element
    if kind not in NUMBERS:
        raise ValueError(f"type {kind} where numbers are needed")
    return np.frombuffer(data, order + NUMBERS[kind])


def _text(values: np.ndarray) -> str:
    return "".join(chr(int(v)) for v in values if 0 < v < 0x110000).rstrip()


def _matrix(data: memoryview, order: str) -> tuple[str, Any]:
    """Return name and value of one variable, cell or field."""
    parts = _elements(data, order)
    if len(data) == 0:
        return "", np.zeros((0, 0))
    flags, shape = int(_numbers(next(parts), order)[0]), [int(v) for v in _numbers(next(parts), order)]
    name, kind, count = _text(_numbers(next(parts), order)), flags & 0xFF, prod(shape)
    if min(shape, default=-1) < 0 or len(shape) > 16 or count > len(data):
        raise ValueError(f"an array of shape {shape[:16]} in {len(data)} bytes")
    if kind == CELL:
        return name, [_inner(parts, order) for _ in range(count)]
    if kind == STRUCT:
        width, names = int(_numbers(next(parts), order)[0]), _numbers(next(parts), order)
        if width <= 0 or names.size % width:
            raise ValueError("field names are damaged")
        fields = [_text(row) for row in names.reshape(-1, width)]
        items = [{field: _inner(parts, order) for field in fields} for _ in range(count)]
        return name, items[0] if count == 1 else items
    if kind == CHAR:
        return name, _text(_numbers(next(parts), order)) if count else ""
    if not FIRST <= kind <= LAST:
        return name, None
    value = _numbers(next(parts), order).astype(float)
    if flags & 0x800:
        value = value + 1j * _numbers(next(parts), order)
    if value.size != count:
        raise ValueError(f"{value.size} numbers for an array of shape {shape}")
    return name, value.reshape(shape, order="F")


def _inner(parts: Iterator[tuple[int, memoryview]], order: str) -> Any:
    kind, data = next(parts)
    if kind != MATRIX:
        raise ValueError(f"type {kind} where an array is needed")
    return _matrix(data, order)[1]
