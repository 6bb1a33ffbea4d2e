"""The `vessel` structure of the MSS toolbox (.mat).

Axes forward-starboard-down become forward-port-up: A -> T A T with T = diag(1, -1, -1, 1, -1, -1), a direction beta
becomes -beta. Its frequency 10 rad/s without damping stands for infinity, as MSS's converter from WAMIT writes it.
The file is MATLAB's level 5 (save -v6 and -v7), read as plain dicts, lists, strings and arrays; source: MathWorks,
"MAT-File Format", level 5. Not by scipy's reader: that one ends the process on some damaged files.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, HydroData
from radiation_ss.hydro.readers.assemble import USUAL, assemble, constants
from radiation_ss.reading import decoded

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8", 16: "u1",
           17: "u2", 18: "u4"}
MATRIX, COMPRESSED = 14, 15
MSS_AXES = np.array([1, -1, -1, 1, -1, -1])  # forward-starboard-down of MSS's files becomes forward-port-up
CELL, STRUCT, CHAR, FIRST, LAST = 1, 2, 4, 6, 15  # classes; those from FIRST to LAST hold numbers


def read(path: Path, **given: float) -> HydroData:
    """Read a vessel structure at zero speed.

    InputError if the file is not a MATLAB file up to v7, or holds no vessel with freqs, A and B.
    """
    content = decoded(path, "MATLAB file", lambda: read_mat(path))
    vessel = content.get("vessel")
    if not isinstance(vessel, dict):
        raise InputError(f"{path}: no structure 'vessel' of the MSS toolbox in it; it holds {list(content)[:8]}")
    main = vessel["main"] if isinstance(vessel.get("main"), dict) else {}
    notes: list[str] = []
    stated = constants(path, {name: _scalar(path, main, name) for name in USUAL}, given, notes)
    omega = _numbers(path, vessel, "freqs").ravel()
    still = _zero_speed(path, vessel)
    A, B = (_matrices(path, vessel, name, omega.size, still) for name in ("A", "B"))
    rows = omega.copy()
    if omega.size > 1 and omega[-1] == 10.0 and not B[-1].any():
        rows[-1] = np.inf
        notes.append(f"{path}: the row at 10 rad/s has no damping; taken as the limit of infinite frequency")
    fields: dict[str, Any] = {field: _turned(_matrices(path, vessel, name, None, still)[0])
                              for field, name in (("M", "MRB"), ("C", "C"))
                              if name in vessel}
    if "Bv" in vessel:
        notes.append(f"{path}: viscous damping Bv is left out")
    forces = _forces(path, vessel, rows, still, notes)
    point = _reference(path, vessel, main, notes)
    return assemble(path, rows, _turned(A), _turned(B), RIGID, reference_point=point, notes=notes,
                    **stated, **fields, **forces)


def _numbers(path: Path, owner: Any, name: str) -> Any:
    value = owner.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f" or value.size == 0:
        raise InputError(f"{path}: vessel.{name} is missing or holds no numbers")
    return value


def _scalar(path: Path, owner: Any, name: str) -> float | None:
    if name not in owner:
        return None
    value = _numbers(path, owner, name)
    if value.size != 1:
        raise InputError(f"{path}: vessel.main.{name} has {value.size} values; one is needed")
    return float(value.ravel()[0])


def _zero_speed(path: Path, vessel: Any) -> int:
    """Return the index of zero speed among vessel.velocities."""
    if "velocities" not in vessel:
        return 0
    speed = _numbers(path, vessel, "velocities").ravel()
    if not (speed == 0.0).any():
        raise InputError(f"{path}: vessel.velocities = {speed[:6]} has no zero speed; only zero speed is supported")
    return int(np.flatnonzero(speed == 0.0)[0])


def _matrices(path: Path, vessel: Any, name: str, frequencies: int | None, still: int) -> FloatArray:
    """Return [frequency, i, j] at zero speed of an array (6, 6, frequency[, speed])."""
    value = _numbers(path, vessel, name)
    if value.ndim == 2:
        value = value[:, :, None]
    if value.ndim == 4:
        if still >= value.shape[3]:
            raise InputError(f"{path}: vessel.{name} has {value.shape[3]} speeds; index {still} is needed")
        value = value[..., still]
    if value.shape[:2] != (6, 6) or value.ndim != 3 or (frequencies is not None and value.shape[2] != frequencies):
        raise InputError(f"{path}: vessel.{name} has shape {value.shape}; (6, 6, {frequencies or 'any'}) needed")
    return np.moveaxis(value, 2, 0)


def _turned(matrix: FloatArray) -> FloatArray:
    return MSS_AXES[:, None] * matrix * MSS_AXES


def _forces(path: Path, vessel: Any, omega: FloatArray, still: int, notes: list[str]) -> dict[str, Any]:
    """Return X and directions of vessel.forceRAO where its frequencies are those of A and B."""
    rao = vessel.get("forceRAO")
    if not isinstance(rao, dict) or "headings" not in vessel:
        return {}
    heading, w = _numbers(path, vessel, "headings").ravel(), _numbers(path, rao, "w").ravel()
    X = np.full((omega.size, heading.size, 6), complex(np.nan, np.nan))
    for name in ("amp", "phase"):
        if not isinstance(rao.get(name), list) or len(rao[name]) != 6 or any(
                np.shape(cell)[:2] != (w.size, heading.size) or np.ndim(cell) > 3 for cell in rao[name]):
            raise InputError(f"{path}: vessel.forceRAO.{name} must be a cell of 6 arrays, ({w.size}, {heading.size}) "
                             "for each speed")
    same = np.isclose(w, omega[:, None], rtol=1e-6, atol=0.0)
    known, row = same.any(axis=1), same.argmax(axis=1)
    for i in range(6):
        a, p = (rao[name][i].reshape(w.size, heading.size, -1)[..., still] for name in ("amp", "phase"))
        X[known, :, i] = (MSS_AXES[i] * a * np.exp(1j * p))[row[known]]
    notes.append(f"{path}: forceRAO phases taken as leads over the wave (as MSS has them from WAMIT)")
    return {"X": X, "directions": -heading}


def _reference(path: Path, vessel: Any, main: Any, notes: list[str]) -> tuple[float, float, float]:
    """Return the point of the rotations: the origin CO on the waterline, or the centre of gravity where it says so."""
    if str(vessel.get("hydrodynamic_reference", "")).strip().upper() == "CG" and "CG" in main:
        x, y, z = _numbers(path, main, "CG").ravel()[:3]
        return float(x), -float(y), -float(z)
    notes.append(f"{path}: rotations taken about MSS's origin CO (midships, centreline, waterline)")
    return (0.0, 0.0, 0.0)


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


def _plain(element: tuple[int, memoryview], order: str) -> np.ndarray:
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
    flags, shape = int(_plain(next(parts), order)[0]), [int(v) for v in _plain(next(parts), order)]
    name, kind, count = _text(_plain(next(parts), order)), flags & 0xFF, prod(shape)
    if min(shape, default=-1) < 0 or len(shape) > 16 or count > len(data):
        raise ValueError(f"an array of shape {shape[:16]} in {len(data)} bytes")
    if kind == CELL:
        return name, [_inner(parts, order) for _ in range(count)]
    if kind == STRUCT:
        width, names = int(_plain(next(parts), order)[0]), _plain(next(parts), order)
        if width <= 0 or names.size % width:
            raise ValueError("field names are damaged")
        fields = [_text(row) for row in names.reshape(-1, width)]
        items = [{field: _inner(parts, order) for field in fields} for _ in range(count)]
        return name, items[0] if count == 1 else items
    if kind == CHAR:
        return name, _text(_plain(next(parts), order)) if count else ""
    if not FIRST <= kind <= LAST:
        return name, None
    value = _plain(next(parts), order).astype(float)
    if flags & 0x800:
        value = value + 1j * _plain(next(parts), order)
    if value.size != count:
        raise ValueError(f"{value.size} numbers for an array of shape {shape}")
    return name, value.reshape(shape, order="F")


def _inner(parts: Iterator[tuple[int, memoryview]], order: str) -> Any:
    kind, data = next(parts)
    if kind != MATRIX:
        raise ValueError(f"type {kind} where an array is needed")
    return _matrix(data, order)[1]
