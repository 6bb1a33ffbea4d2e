"""Records from and to files: CSV with units in the header, gzipped CSV, Parquet."""

from __future__ import annotations

import csv
import gzip
import io
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, force_unit, mode, motion_unit
from radiation_ss.records.record import SUFFIXES, Record
from radiation_ss.records.record_checks import suspicions
from radiation_ss.records.time_checks import time_fault

_HEADER = re.compile(r"^\s*(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*$")
_COMMENT = re.compile(r"^#\s*(?P<key>[A-Za-z][\w .-]*?)\s*:\s*(?P<value>.*?)\s*$")
_SPEED = re.compile(r"^\s*(?P<value>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)(?P<unit>[^\d]*)$", re.ASCII)
KNOT = 1852.0 / 3600.0  # m/s
_MODES = (*TRANSLATIONS, *ROTATIONS)


def channel_unit(channel: str) -> str:
    """Return the SI unit of a channel by its name: 'm/s' of 'Heave_velocity', 's' of 'time'.

    Raises
    ------
    InputError
        If the name is none that a record may hold.
    """
    if channel == "time":
        return "s"
    if channel == "wave_elevation":
        return "m"
    suffix = next((s for s in SUFFIXES if channel.endswith(s)), "")
    dof = channel.removesuffix(suffix) if suffix else channel
    if mode(dof) not in _MODES:
        near = _near(channel, dof)
        hint = f"; did you mean {near!r}?" if near else ""
        raise InputError(f"channel {channel!r} is not one of time, wave_elevation, <Dof>, <Dof>_velocity, "
                         f"<Dof>_acceleration, <Dof>_force with <Dof> among {', '.join(_MODES)}{hint}")
    if suffix == "_force":
        return force_unit(dof)
    return motion_unit(dof) + {"": "", "_velocity": "/s", "_acceleration": "/s^2"}[suffix]


def _near(channel: str, dof: str) -> str | None:
    """Return the name that was probably meant, None if there is no guess."""
    if channel.lower() in ("t", "time", "time_s", "times"):
        return "time"
    if channel.lower() in ("eta", "zeta", "elevation", "wave", "wave_elevation"):
        return "wave_elevation"
    return next((channel.replace(mode(dof), m) for m in _MODES if m.lower() == mode(dof).lower()), None)


def _plain_unit(unit: str) -> str:
    """Spell a unit one way: 'm/s²', 'm/s2', 'm/s**2' are 'm/s^2'; 'Nm', 'N*m', 'N·m' are 'N m'."""
    text = unit.strip().replace("²", "^2").replace("**", "^")
    text = re.sub(r"/s2$", "/s^2", text)
    text = re.sub(r"^N\s*[*·.]?\s*m$", "N m", text)
    return text


def _check_separator(header: Sequence[str], where: str) -> None:
    """Refuse a table whose cells are not separated by commas, by the name of what separates them."""
    for mark, said in ((";", "semicolons"), ("\t", "tabs")):
        if any(mark in cell for cell in header):
            raise InputError(f"{where}: cells separated by {said} found, commas needed (and points as decimal marks)")


def plain_columns(header: Sequence[str], where: str, ignore: Sequence[str]) -> list[str | None]:
    """Return the channel of each column (None where ignored), units checked."""
    _check_separator(header, where)
    names: list[str | None] = []
    for number, cell in enumerate(header, start=1):
        match = _HEADER.match(cell)
        at = f"{where}, column {number} {cell.strip()!r}"
        if match is None or not match["name"]:
            raise InputError(f"{at}: a header cell reads `name [unit]`, for example `Heave [m]`")
        name = match["name"]
        if name.endswith(")") and match["unit"] is None:
            raise InputError(f"{at}: the unit stands in square brackets, for example `Heave [m]`")
        if name in ignore:
            names.append(None)
            continue
        try:
            unit = channel_unit(name)
        except InputError as error:
            raise InputError(f"{at}: {error} (leave a column out: ignore=({name!r},), or --ignore {name})") from None
        if match["unit"] is not None and _plain_unit(match["unit"]) != unit:
            raise InputError(f"{at}: unit [{match['unit']}] found, [{unit}] needed; convert the column")
        if name in names:
            raise InputError(f"{at}: the column is there twice")
        names.append(name)
    if "time" not in names:
        raise InputError(f"{where}: no column `time [s]`; the header is {', '.join(c.strip() for c in header)}")
    if len([name for name in names if name]) < 2:
        raise InputError(f"{where}: no channel beside time; the separator must be a comma")
    return names


def _number(cell: str) -> float | None:
    """Return the cell as a number, NaN if empty, None if it is neither."""
    text = cell.strip()
    if text == "":
        return np.nan
    try:
        value = float(text)
    except ValueError:
        return None
    return None if np.isinf(value) else value


def _column_values(cells: Sequence[str], name: str, where: str, lines: Sequence[int]) -> FloatArray:
    values = [_number(cell) for cell in cells]
    for value, cell, line in zip(values, cells, lines):
        if value is None:
            raise InputError(f"{where}, line {line}, column {name!r}: {cell.strip()!r} is not a number "
                             "(a missing sample is an empty cell or nan; the decimal mark is a point)")
    return np.array(values, dtype=float)


def checked_time(time: FloatArray, where: str, lines: Sequence[int], counted: str = "line") -> None:
    """Raise InputError, naming the line, where times are missing, do not ascend or jump."""
    missing = np.flatnonzero(np.isnan(time))
    if missing.size:
        raise InputError(f"{where}, {counted} {lines[missing[0]]}, column 'time': no time given; every row needs one")
    fault = time_fault(time)
    if fault is not None:
        raise InputError(f"{where}, {counted} {lines[fault[0]]}, column 'time': {fault[1]}")


def infer_kind(channels: Mapping[str, FloatArray]) -> str:
    """Return the kind of a record that does not state it.

    Every force known and 0: decay. Force known, not 0: waves where a wave elevation stands beside it, else forced.
    No force: waves where there is a wave elevation, else motion-only.
    """
    forces = [values for name, values in channels.items() if name.endswith("_force")]
    waves = "wave_elevation" in channels
    if forces and all(np.nansum(np.abs(values)) == 0.0 and np.isfinite(values).any() for values in forces):
        return "decay"
    if forces:
        return "waves" if waves else "forced"
    return "waves" if waves else "motion-only"


def speed_of(text: str) -> float:
    """Return the speed that a `# speed:` comment states [m/s]; `m/s` may stand behind the number.

    Raises
    ------
    InputError
        If it is no number, or in another unit; knots are named with what they are in m/s.

    Examples
    --------
    >>> speed_of("0.97 m/s")
    0.97
    """
    match = _SPEED.match(text)
    if match is None:
        raise InputError(f"comment 'speed': {text!r} is not a speed; write metres per second, for example 0.97")
    value, unit = float(match["value"]), match["unit"].strip(" []").lower()
    if unit in ("", "m/s"):
        return value
    factor = {"kn": KNOT, "kt": KNOT, "kts": KNOT, "knot": KNOT, "knots": KNOT, "km/h": 1.0 / 3.6}.get(unit)
    hint = "" if factor is None else f"; write {value * factor:.4g}"
    raise InputError(f"comment 'speed': {text!r} found, m/s needed{hint}")


def record_of_columns(time: FloatArray, channels: dict[str, FloatArray], comments: Mapping[str, str],
                      source: Path | str, kind: str | None) -> Record:
    """Build the record of a file's columns and comments; warn of what looks wrong."""
    meta = dict(comments)
    stated = meta.pop("kind", None)
    try:
        speed = speed_of(meta.pop("speed", "0"))
        record = Record(time, channels, kind=kind or (stated or "").lower() or infer_kind(channels),
                        name=meta.pop("name", Path(source).name.split(".")[0]), start=meta.pop("start", ""), meta=meta,
                        speed=speed)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    for sentence in suspicions(record):
        warnings.warn(InputWarning(f"{source}: {sentence}"), stacklevel=4)
    return record


def _read_csv(path: Path, kind: str | None, ignore: Sequence[str]) -> Record:
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        text = raw.decode("utf-8-sig")
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as {'gzipped ' if path.suffix == '.gz' else ''}CSV text "
                         f"({error})") from None
    comments: dict[str, str] = {}
    rows: list[list[str]] = []
    lines: list[int] = []
    for line, row in enumerate(csv.reader(io.StringIO(text)), start=1):
        if row and row[0].lstrip().startswith("#"):
            match = _COMMENT.match(",".join(row).strip())
            if match and not rows:
                comments[match["key"].strip().lower()] = match["value"]
        elif any(cell.strip() for cell in row):
            rows.append(row)
            lines.append(line)
    if not rows:
        raise InputError(f"{path}: no header and no samples")
    names = plain_columns(rows[0], f"{path}, line {lines[0]}", ignore)
    for row, line in zip(rows[1:], lines[1:]):
        if len(row) != len(names):
            raise InputError(f"{path}, line {line}: {len(row)} cells, but the header has {len(names)}")
    columns = {name: _column_values([row[i] for row in rows[1:]], name, str(path), lines[1:])
               for i, name in enumerate(names) if name is not None}
    time = columns.pop("time")
    checked_time(time, str(path), lines[1:])
    return record_of_columns(time, columns, comments, path, kind)


def _read_parquet(path: Path, kind: str | None, ignore: Sequence[str]) -> Record:
    parquet = _pyarrow_parquet(path)
    try:
        table = parquet.read_table(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as Parquet ({error})") from None
    names = plain_columns(table.column_names, str(path), ignore)
    columns = {}
    for name, column in zip(names, table.columns):
        if name is None:
            continue
        if not str(column.type).startswith(("double", "float", "int", "uint", "halffloat")):
            raise InputError(f"{path}, column {name!r}: holds {column.type}, numbers needed")
        columns[name] = np.array([np.nan if v is None else float(v) for v in column.to_pylist()])
    time = columns.pop("time")
    checked_time(time, str(path), range(1, time.size + 1))
    comments = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()
                if not key.startswith((b"pandas", b"ARROW"))}
    return record_of_columns(time, columns, comments, path, kind)


def _pyarrow_parquet(path: Path) -> ModuleType:
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(f"{path}: Parquet needs pyarrow; pip install 'radiation_ss[parquet]'") from None
    return parquet


def read_record(path: str | Path, *, kind: str | None = None, ignore: Sequence[str] = ()) -> Record:
    """Read a record from .csv, .csv.gz or .parquet (the latter needs pyarrow).

    The header names `time [s]`, `<Dof> [m or rad]`, `<Dof>_velocity`, `<Dof>_acceleration`, `<Dof>_force` and
    `wave_elevation`; a unit in brackets may be left out, and is never converted. Leading `# key: value` comments give
    kind, name, start, speed [m/s] and anything else. Without a kind: every force 0 is decay; force and elevation is
    waves; force alone is forced; elevation alone is waves; neither is motion-only.

    Parameters
    ----------
    path : path
    kind : {"decay", "waves", "forced", "motion-only", "prescribed", "static"}, optional
        Overrides the file's own.
    ignore : sequence of str
        Columns (names without unit) to leave out.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        Naming file, line and column: unknown name, wrong unit, a cell that is no number, times that do not ascend.

    Warns
    -----
    InputWarning
        If a channel looks like a slip of the unit, is constant or is clipped.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: {'a folder, a file is needed' if path.is_dir() else 'no such file'}")
    if path.name.endswith((".csv", ".csv.gz")):
        return _read_csv(path, kind, ignore)
    if path.suffix == ".parquet":
        return _read_parquet(path, kind, ignore)
    raise InputError(f"{path}: a record is .csv, .csv.gz or .parquet")


def _comments(record: Record) -> dict[str, str]:
    comments = {"name": record.name, "kind": record.kind}
    if record.start:
        comments["start"] = record.start
    if record.speed:
        comments["speed"] = repr(record.speed)
    for key, value in {**comments, **record.meta}.items():
        if "\n" in str(value) or not _COMMENT.match(f"# {key}: {value}"):
            raise InputError(f"record {record.name}: {key!r}: {value!r} cannot be a `# key: value` comment of one line")
    return {**comments, **{key: str(value) for key, value in record.meta.items()}}


def write_record(record: Record, path: str | Path) -> None:
    """Write a record as .csv, .csv.gz or .parquet; `read_record` gives it back unchanged.

    Parameters
    ----------
    record : Record
    path : path

    Raises
    ------
    InputError
        If the suffix is another one, a channel's name has no unit, or a comment does not fit on one line.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import radiation_ss as rss
    >>> path = Path(tempfile.mkdtemp()) / "decay.csv"
    >>> rss.write_record(rss.Record([0.0, 0.1, 0.2], {"Heave": [0.05, 0.03, 0.0]}, kind="decay"), path)
    >>> rss.read_record(path).kind
    'decay'
    """
    path = Path(path)
    columns = {"time": record.time, **record.channels}
    header = [f"{name} [{channel_unit(name)}]" for name in columns]
    if path.suffix == ".parquet":
        import_parquet = _pyarrow_parquet(path)
        import pyarrow as pa

        table = pa.table(dict(zip(header, map(np.asarray, columns.values()))))
        import_parquet.write_table(table.replace_schema_metadata(_comments(record)), path)
        return
    if not path.name.endswith((".csv", ".csv.gz")):
        raise InputError(f"{path}: a record is written as .csv, .csv.gz or .parquet")
    lines = [f"# {key}: {value}" for key, value in _comments(record).items()]
    lines.append(",".join(header))
    lines += [",".join("" if v != v else repr(v) for v in row)
              for row in zip(*(values.tolist() for values in columns.values()))]
    raw = ("\n".join(lines) + "\n").encode()
    path.write_bytes(gzip.compress(raw, mtime=0) if path.suffix == ".gz" else raw)
