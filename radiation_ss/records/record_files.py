"""Records from and to files: CSV with units in the header, gzipped CSV, Parquet."""

import re
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.atomic import written_whole
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.reading import check_regular, decoded
from radiation_ss.records.columns import (
    Column,
    ColumnChoice,
    OwnDofs,
    channel_unit,
    own_dofs,
    own_text,
    plain_columns,
    values_in_si,
)
from radiation_ss.records.csv_files import OWN, comment_line, read_csv, speed_of, write_csv
from radiation_ss.records.record import Record, time_fault
from radiation_ss.records.record_checks import suspicions

ENDING = r"(?i)\.(csv|csv\.gz|parquet)$"


def infer_kind(channels: Mapping[str, FloatArray]) -> str:
    """Return the kind of a record that does not state it: by its force columns and its wave elevation."""
    forces = [values for name, values in channels.items() if name.endswith("_force")]
    if forces and all(np.nansum(np.abs(values)) == 0.0 and np.isfinite(values).any() for values in forces):
        return "decay"
    return "waves" if "wave_elevation" in channels else "forced" if forces else "motion-only"


def record_of_table(values: Mapping[str, FloatArray], header: Sequence[Column], comments: Mapping[str, str],
                    source: Path | str, kind: str | None, row_of: Callable[[int], str]) -> Record:
    """Build the record of a table, whose rows are called `row_of`; warn of what looks wrong."""
    columns, comments = values_in_si(values, header, comments)
    own, meta = ({key: value for key, value in comments.items() if (key in OWN) == mine} for mine in (True, False))
    time = columns.pop("time", np.arange(float(next(iter(columns.values())).size)))
    missing = np.flatnonzero(~np.isfinite(time))
    fault = (int(missing[0]), "no time given; every row needs one") if missing.size else time_fault(time)
    if fault is not None:
        other = [name for name, column in columns.items() if column.size > 2 and (np.diff(column) > 0.0).all()]
        swapped = "".join(f"; column {name!r} does: is the header of these two swapped?" for name in other[:1])
        raise InputError(f"{source}, {row_of(fault[0])}, column 'time': {fault[1]}{swapped}")
    stated = kind or own.get("kind", "").lower()
    try:
        record = Record(time, columns, kind=stated or infer_kind(columns), start=own.get("start", ""), meta=meta,
                        name=own.get("name", re.sub(ENDING, "", Path(source).name)),
                        speed=speed_of(own.get("speed", "0")),
                        units={dof: unit for dof, unit in own_dofs(own.get("dofs", "")).items() if unit},
                        file=str(source) if isinstance(source, Path) else "")
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    for sentence in suspicions(record, stated=bool(stated)):
        warnings.warn(InputWarning(f"{source}: {sentence}"), stacklevel=4)
    return record


def _read_parquet(path: Path, choice: ColumnChoice) -> tuple[dict[str, FloatArray], list[Column], dict[str, str]]:
    parquet = _pyarrow_parquet(path)

    def table_of() -> tuple[dict[str, FloatArray], list[Column], dict[str, str]]:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            count = file.metadata.num_rows * file.metadata.num_columns
            if count > choice.largest:
                raise InputError(f"{path}: {count} numbers, more than {choice.largest:.4g}; read a part of it, or "
                                 "raise `largest`")
            table = file.read()
        comments = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()
                    if not key.startswith((b"pandas", b"ARROW"))}
        header = plain_columns(table.column_names, str(path), choice.with_comments(comments))
        found = {column.name: values for column, values in zip(header, table.columns) if column.name}
        for name, values in found.items():
            if not str(values.type).startswith(("double", "float", "int", "uint", "halffloat")):
                raise InputError(f"{path}, column {name!r}: holds {values.type}, numbers needed")
        return {name: np.array(values.cast("float64", safe=False).to_numpy(), dtype=float)
                for name, values in found.items()}, header, comments

    return decoded(path, "Parquet file", table_of)


def _pyarrow_parquet(path: Path) -> ModuleType:
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(f"{path}: Parquet needs pyarrow; pip install 'radiation_ss[parquet]'") from None
    return parquet


def read_record(path: str | Path, *, kind: str | None = None, ignore: Collection[str] = (),
                degrees: Collection[str] = (), dofs: OwnDofs = (), largest: int = 500_000_000) -> Record:
    """Read a record from .csv, .csv.gz or .parquet (the latter needs pyarrow).

    The header names `time [s]`, `<Dof> [m or rad]`, `<Dof>_velocity`, `<Dof>_acceleration`, `<Dof>_force` and
    `wave_elevation`, in any case, with blanks or underscores. The unit that it states counts: `Heave (mm)`, `t_s`, or a
    line of units below it. Values become SI, and the comment `converted` says which; without a unit they are SI.
    Leading `# key: value` comments give kind, name, start, speed [m/s] and anything else. Without a kind: every force 0
    is decay; force and elevation is waves; force alone is forced; elevation alone is waves; neither is motion-only.

    Parameters
    ----------
    path : path
    kind : {"decay", "waves", "forced", "motion-only", "prescribed", "static"}, optional
        Overrides the file's own.
    ignore : collection of str
        Columns (names without unit) to leave out.
    degrees : collection of str
        Columns of rotations that are in degrees, degrees/s or degrees/s^2; they become radians.
    dofs : collection of str, or mapping of str to str
        Degrees of freedom that are no rigid-body mode, as the model names them: ("flap",). The header states their
        unit, `flap [rad]`, or a mapping does: {"flap": "rad"}. A file of `write_record` names its own.
    largest : int
        Most numbers that the file may hold; each takes 8 bytes of memory.

    Raises
    ------
    InputError
        Naming file, line and column: unknown name or unit, a cell that is no number, times that do not ascend.

    Warns
    -----
    InputWarning
        If a channel looks like a slip of the unit, is constant or is clipped.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> rss.write_record(rss.Record([0.0, 0.1], {"Heave": [0.02, 0.01]}, kind="decay"), "decay.csv")
    >>> rss.read_record("decay.csv").kind
    'decay'
    """
    choice = ColumnChoice(ignore, degrees, largest, dofs, kind or "")
    path = Path(path)
    try:
        found = path.is_file()
    except (OSError, ValueError) as error:      # a name that no file can have
        raise InputError(f"{path}: no name of a file ({error})") from None
    check_regular(path)
    if not found:
        raise InputError(f"{path}: {'a folder, a file is needed' if path.is_dir() else 'no such file'}")
    if path.name.endswith((".csv", ".csv.gz")):
        columns, header, line_of, comments = read_csv(path, choice)
    elif path.suffix == ".parquet":
        columns, header, comments = _read_parquet(path, choice)
        line_of = (1).__add__  # type: ignore[assignment]
    else:
        raise InputError(f"{path}: a record is .csv, .csv.gz or .parquet")
    return record_of_table(columns, header, comments, path, kind, lambda row: f"line {line_of(row)}")


def write_record(record: Record, path: str | Path) -> None:
    """Write a record as .csv, .csv.gz or .parquet; `read_record` gives it back unchanged.

    Parameters
    ----------
    record : Record, pandas.DataFrame, xarray.Dataset or path
    path : path

    Raises
    ------
    InputError
        If the suffix is another one, a channel's unit is not known (`Record.units`), or the file cannot be written:
        then what was there before is still there.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> rss.write_record(rss.Record([0.0, 0.1], {"Heave": [0.02, 0.01]}, kind="decay"), "decay.csv")
    >>> rss.read_record("decay.csv").channels["Heave"].tolist()
    [0.02, 0.01]
    """
    if not isinstance(record, Record):
        record = read_record(record) if isinstance(record, str | Path) else Record(record)
    path = Path(path)
    columns = {"time": record.time, **record.channels}
    header = [f"{name} [{channel_unit(name, record.units)}]" for name in columns]
    if taken := [key for key in record.meta if key.lower() in OWN]:
        raise InputError(f"record {record.name}: {taken[0]!r} in meta is a field of the record itself; set that")
    comments = {"name": record.name, **{key: str(value) for key, value in facts_of(record).items()}}
    if path.suffix == ".parquet":
        parquet = _pyarrow_parquet(path)
        import pyarrow as pa

        table = pa.table(dict(zip(header, map(np.asarray, columns.values()))))
        with written_whole(path) as beside:
            parquet.write_table(table.replace_schema_metadata(comments), beside, write_page_checksum=True)
        return
    if not path.name.endswith((".csv", ".csv.gz")):
        raise InputError(f"{path}: a record is written as .csv, .csv.gz or .parquet")
    lines = [comment_line(key, value) for key, value in comments.items()]
    with written_whole(path) as beside:
        write_csv(beside, columns, header, lines, packed=path.suffix == ".gz")


def facts_of(record: Record) -> dict[str, Any]:
    """Return what a record says beside its columns: its own fields, where they say something, then others."""
    fields = {"name": record.name, "kind": record.kind, "start": record.start, "speed": record.speed,
              "dofs": own_text(record.units)}
    own = {key: value for key, value in fields.items() if value}
    return {**own, **record.meta, **own}


def unit_of(record: Record, channel: str) -> str:
    """Return the unit of a record's channel, nothing where its name is none that a file may hold."""
    try:
        return channel_unit(channel, record.units)
    except InputError:
        return ""
