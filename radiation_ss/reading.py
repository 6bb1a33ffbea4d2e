"""Files that are read: whatever is wrong with one becomes one sentence with its path."""

import gc
import json
import re
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any, TypeVar

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, RadiationError

T = TypeVar("T")
# Of MATLAB's level 5 the types of elements, and the classes of arrays; those from FIRST to LAST hold numbers.
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8", 16: "u1",
           17: "u2", 18: "u4"}
MATRIX, COMPRESSED = 14, 15
CELL, STRUCT, CHAR, FIRST, LAST = 1, 2, 4, 6, 15


def check_regular(path: str | Path) -> None:
    """Refuse a pipe or a device: reading one may never end."""
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):       # whoever reads it says what is wrong
        return
    if not (S_ISREG(mode) or S_ISDIR(mode)):
        raise InputError(f"{path}: a pipe or a device, a file is needed")


def decoded(path: str | Path, what: str, decode: Callable[[], T]) -> T:
    """Return decode(); whatever it raises on a damaged file becomes one InputError with the path.

    Destructors of half-built file objects stay silent. `what`: what the file should be, for the message.
    """
    check_regular(path)
    before, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        return decode()
    except RadiationError as error:
        if isinstance(error, InputError) and str(Path(path).name) in str(error):
            raise
        absent, reason = False, str(error)
    except Exception as error:  # on damaged bytes h5py, netCDF, SciPy, zip and JSON each raise errors of many classes
        absent = isinstance(error, OSError) and bool(error.strerror)
        reason = f"cannot be read ({error.strerror[:200]})" if absent else _reason(error)  # type: ignore[attr-defined]
        error.__traceback__ = error.__context__ = error.__cause__ = None
        del error
        gc.collect(1)
    finally:
        sys.unraisablehook = before
    raise InputError(f"{path}: {reason}" if absent else f"{path}: not a readable {what} ({reason})") from None


def _reason(error: Exception) -> str:
    if isinstance(error, KeyError):
        within = re.search(r"object ('.*') doesn't exist", str(error))  # h5py's words
        return f"field {within[1] if within else str(error)[:200]} is missing"
    if isinstance(error, RecursionError):
        return "nested too deeply"
    line = next(iter(str(error).splitlines()), "")
    return (line if len(line) <= 200 else f"{line[:200].rsplit(' ', 1)[0]} ...") or type(error).__name__


def is_text(content: bytes, most: int = 4096) -> bool:
    """Whether the first bytes of a file are text: UTF-8 without control characters but for tabs and ends of lines."""
    try:
        words = content[:most].decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start < len(content[:most]) - 3:  # else a character is cut
            return False
        words = content[:error.start].decode("utf-8-sig")
    return bool(words) and all(letter.isprintable() or letter in "\t\r\n\f" for letter in words)


def read_json(path: str | Path, what: str, build: Callable[[dict[str, Any]], T], schema: str | None = None) -> T:
    """Return build(content) of a JSON file of one object, of a schema if any; each field may stand there once."""
    def whole() -> T:
        content = json.loads(Path(path).read_bytes().decode("utf-8-sig"), object_pairs_hook=_once)
        if not isinstance(content, dict):
            raise InputError(f"{path}: one JSON object {{...}} is needed")
        if schema is not None and content.get("schema") != schema:
            raise InputError(f"{path}: field 'schema' must be {schema!r}, {str(content.get('schema'))[:80]!r} found")
        return build(content)

    return decoded(path, what, whole)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) < len(pairs):
        names = [name for name, _ in pairs]
        raise InputError(f"field {next(n for n in names if names.count(n) > 1)!r} stands there twice")
    return fields


def number(value: object, field: str) -> float:
    """Return a finite number of a JSON file as it is; words, truth values and null are none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(float(value)):
        raise InputError(f"field {field}: {str(value)[:80]!r} is not a finite number")
    return float(value)


def whole_number(value: object, field: str) -> int:
    """Return a whole number of a JSON file."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"field {field}: {str(value)[:80]!r} is not a whole number")
    return value


def numbers(value: object, field: str, shape: Sequence[int]) -> FloatArray:
    """Return nested lists of numbers as an array of this shape; NaN may stand in them."""
    flat = [value]
    for size in shape:
        if any(not isinstance(part, list) or len(part) != size for part in flat):
            raise InputError(f"field {field}: lists of numbers, shape {tuple(shape)}, are needed")
        flat = [item for part in flat for item in part]  # type: ignore[attr-defined]
    if any(isinstance(item, bool) or not isinstance(item, int | float) for item in flat):
        raise InputError(f"field {field}: only numbers are allowed in it")
    return np.array(flat, dtype=float).reshape(tuple(shape))


def text(value: object, field: str) -> str:
    """Return a text of a JSON file."""
    if not isinstance(value, str):
        raise InputError(f"field {field}: {str(value)[:80]!r} is not a text")
    return value


def texts(value: object, field: str) -> tuple[str, ...]:
    """Return a list of texts of a JSON file."""
    return tuple(text(item, field) for item in listed(value, field))


def listed(value: object, field: str) -> list[Any]:
    """Return a list of a JSON file."""
    if not isinstance(value, list):
        raise InputError(f"field {field}: a list is needed, {str(value)[:80]!r} found")
    return value


def named_numbers(value: object, field: str) -> dict[str, float]:
    """Return an object of a JSON file whose values are numbers."""
    if not isinstance(value, Mapping):
        raise InputError(f"field {field}: names with numbers are needed, {str(value)[:80]!r} found")
    return {str(name): number(item, f"{field}.{name}") for name, item in value.items()}


def read_arrays(path: str | Path, largest: int = 1 << 30) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz that unpacks to at most `largest` bytes; nothing pickled is read."""
    with zipfile.ZipFile(path) as packed:
        within(path, sum(item.file_size for item in packed.infolist()), largest)
    with np.load(path, allow_pickle=False) as file:
        return {key: file[key] for key in file.files}


def hdf5_text(file: Any, name: str) -> str:
    """Return a text of an open HDF5 file, empty where it is not there."""
    if name not in file:
        return ""
    value = np.atleast_1d(file[name][()]).ravel()[0]
    return value.decode(errors="replace").strip() if isinstance(value, bytes) else str(value).strip()


def check_size(path: str | Path, largest: int = 1 << 30) -> None:
    """Refuse an HDF5 file whose data sets unpack to more than `largest` bytes: a few bytes can state any shape.

    State spaces are read entry by entry: what counts of them is what was written.
    """
    import h5py

    sizes: list[int] = []

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and "/state_space/A/" in name and item.chunks:
            sizes.append(item.id.get_num_chunks() * prod(item.chunks) * item.dtype.itemsize)
        elif isinstance(item, h5py.Dataset):
            sizes.append(item.size * item.dtype.itemsize if item.shape is not None else 0)

    with h5py.File(path, "r") as file:
        file.visititems(add)
    within(path, sum(sizes), largest)


def within(path: str | Path, size: int, largest: int = 1 << 30) -> None:
    """Refuse a file of which `size` bytes come, more than `largest`."""
    if size > largest:
        raise InputError(f"{path}: unpacks to {size} bytes, more than {largest}")


def read_mat(path: Path, most: int = 1 << 30) -> dict[str, Any]:
    """Return the variables of a MATLAB file, level 5 (save -v6 and -v7); one above `most` bytes unpacked is refused.

    A struct is a dict, an array of structs and a cell a list, other classes None. Source: MathWorks, "MAT-File Format".
    Not by scipy's reader: that one ends the process on some damaged files. ValueError if the file is no level 5 file,
    or is damaged.
    """
    content = path.read_bytes()
    if content.startswith(b"MATLAB 7.3"):
        raise ValueError("MATLAB v7.3; save it with save(..., '-v7')")
    if (order := {b"IM": "<", b"MI": ">"}.get(content[126:128])) is None:
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


def _unpacked(element: tuple[int, memoryview], order: str) -> np.ndarray:
    kind, data = element
    if kind not in NUMBERS:
        raise ValueError(f"type {kind} where numbers are needed")
    return np.frombuffer(data, order + NUMBERS[kind])


def _letters(values: np.ndarray) -> str:
    return "".join(chr(int(v)) for v in values if 0 < v < 0x110000).rstrip()


def _matrix(data: memoryview, order: str) -> tuple[str, Any]:
    """Return name and value of one variable, cell or field."""
    parts = _elements(data, order)
    if len(data) == 0:
        return "", np.zeros((0, 0))
    flags, shape = int(_unpacked(next(parts), order)[0]), [int(v) for v in _unpacked(next(parts), order)]
    name, kind, count = _letters(_unpacked(next(parts), order)), flags & 0xFF, prod(shape)
    if min(shape, default=-1) < 0 or len(shape) > 16 or count > len(data):
        raise ValueError(f"an array of shape {shape[:16]} in {len(data)} bytes")
    if kind == CELL:
        return name, [_inner(parts, order) for _ in range(count)]
    if kind == STRUCT:
        width, names = int(_unpacked(next(parts), order)[0]), _unpacked(next(parts), order)
        if width <= 0 or names.size % width:
            raise ValueError("field names are damaged")
        fields = [_letters(row) for row in names.reshape(-1, width)]
        items = [{field: _inner(parts, order) for field in fields} for _ in range(count)]
        return name, items[0] if count == 1 else items
    if kind == CHAR:
        return name, _letters(_unpacked(next(parts), order)) if count else ""
    if not FIRST <= kind <= LAST:
        return name, None
    value = _unpacked(next(parts), order).astype(float)
    if flags & 0x800:
        value = value + 1j * _unpacked(next(parts), order)
    if value.size != count:
        raise ValueError(f"{value.size} numbers for an array of shape {shape}")
    return name, value.reshape(shape, order="F")


def _inner(parts: Iterator[tuple[int, memoryview]], order: str) -> Any:
    kind, data = next(parts)
    if kind != MATRIX:
        raise ValueError(f"type {kind} where an array is needed")
    return _matrix(data, order)[1]
