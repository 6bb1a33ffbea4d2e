"""Records from and to what other libraries hold, and as text."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, mode
from radiation_ss.records.columns import RATES, ColumnChoice, OwnDofs, name_and_unit, plain_columns, spelled
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import facts_of, read_record, record_of_table, unit_of

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from radiation_ss.body.model import Model

RecordLike = Any  # Record, pandas.DataFrame, xarray.Dataset, or the path of a file


def as_record(given: RecordLike, **options: Any) -> Record:
    """Return whatever stands for a record as a Record: itself, a pandas.DataFrame, an xarray.Dataset, a file.

    Parameters
    ----------
    given : Record, pandas.DataFrame, xarray.Dataset (of `Record.to_xarray`) or path
    **options
        For `read_record` or `from_pandas`: kind, ignore, degrees, dofs.

    Raises
    ------
    InputError
        If it is none of them, or the file or the frame is not that of a record.

    Examples
    --------
    >>> import pandas as pd
    >>> import radiation_ss as rss
    >>> frame = pd.DataFrame({"time": [0.0, 0.1, 0.2], "Heave [m]": [0.1, 0.08, 0.03]})
    >>> rss.as_record(frame, kind="decay").dofs
    ('Heave',)
    """
    if isinstance(given, Record):
        return given
    if isinstance(given, str | Path):
        return read_record(given, **options)
    if is_table(given):
        return from_pandas(given, **options)
    raise InputError(f"record: a Record, a pandas.DataFrame, an xarray.Dataset or the name of a file is needed, "
                     f"{type(given).__name__} found")


def is_table(given: Any) -> bool:
    """Return whether something is a pandas.DataFrame or an xarray.Dataset."""
    return hasattr(given, "data_vars") or (hasattr(given, "columns") and hasattr(given, "index"))


def as_records(given: Any, model: Model | None = None) -> Any:
    """Return whatever stands for records as Records, alone or in a sequence, with the columns of a model."""
    dofs = () if model is None else model.dofs
    several = isinstance(given, Iterable) and not isinstance(given, str | Mapping) and not is_table(given)
    return [as_record(item, dofs=dofs) for item in given] if several else as_record(given, dofs=dofs)


def as_one_record(given: Any, model: Model | None = None) -> Record:
    """Return one record of whatever stands for it, with the columns of a model; InputError for several."""
    found = as_records(given, model)
    if isinstance(found, list):
        raise InputError(f"record: a list of {len(found)} found; give one record, and call again for each other")
    return found


def as_record_or_force(given: Any, model: Model | None = None) -> Any:
    """Return one record of whatever stands for it; (time, force) as it is."""
    arrays = isinstance(given, list | tuple) and len(given) == 2 and not any(
        isinstance(item, Record | str | Path) or is_table(item) for item in given)
    return given if arrays else as_one_record(given, model)


def from_pandas(frame: pd.DataFrame, *, kind: str | None = None, ignore: Collection[str] = (),
                degrees: Collection[str] = (), dofs: OwnDofs = ()) -> Record:
    """Return the record of a DataFrame with the columns of a record file; times are its column `time` or its index.

    An index of dates or time differences gives seconds from the first row; its name may state a unit, `time [ms]`.
    Labels of several levels are read as one, ("Heave", "mm"). `frame.attrs` may carry what a file's comments say; of a
    Dataset the attribute `units` counts. Options as of `read_record`.
    """
    if hasattr(frame, "data_vars"):  # an xarray.Dataset
        attributes = frame.attrs
        stated = {name: f"{name} [{values.attrs['units']}]" for name, values in frame.variables.items()
                  if values.attrs.get("units") and name_and_unit(str(name))[1] is None}
        bare = [name for name in frame.dims if name not in frame.variables]
        frame = frame.to_dataframe().rename(columns=stated).rename_axis(index=lambda name: stated.get(name, name))
        frame.index.name = None if bare else frame.index.name  # it counts the rows
        frame.attrs.update(attributes)
    labels = [" ".join(map(str, column)) if isinstance(column, tuple) else str(column) for column in frame.columns]
    start = ""
    columns = [frame.iloc[:, i] for i in range(len(labels))]
    if not any(spelled(name_and_unit(label)[0]) == "time" for label in labels):
        index, name = frame.index, str(frame.index.name or "time")
        counts = type(index).__name__ == "RangeIndex" and index.name is None
        if index.dtype.kind == "M":
            index, start = index - index[0], index[0].isoformat()
        if index.dtype.kind == "m":
            index, name = index.total_seconds(), "time"
        elif counts or spelled(name_and_unit(name)[0]) != "time":
            if (kind or frame.attrs.get("kind")) != "static":
                raise InputError("data frame: no column `time [s]`, and its index "
                                 + ("only counts the rows; add the times" if counts else
                                    f"is {name!r}; if that is the time, call it `time [s]`"))
            name = "time"
        labels, columns = [name, *labels], [index, *columns]
    choice = ColumnChoice(ignore, degrees, dofs=dofs).with_comments({"dofs": str(frame.attrs.get("dofs", ""))})
    header = plain_columns(labels, "data frame", choice)
    given = {said.name: _numbers(column, said.name) for said, column in zip(header, columns) if said.name}
    comments = {"start": start, **{str(key): str(value) for key, value in frame.attrs.items()}}
    return record_of_table(given, header, comments, "data frame", kind, "row {}".format)


def to_pandas(record: Record) -> pd.DataFrame:
    """Return a DataFrame with the times as index `time` [s] and one column a channel; `from_pandas` is its inverse."""
    import pandas as pd

    frame = pd.DataFrame({name: np.array(values) for name, values in record.channels.items()},
                         index=pd.Index(np.array(record.time), name="time"))
    frame.attrs.update(facts_of(record))
    return frame


def to_xarray(record: Record) -> xr.Dataset:
    """Return a Dataset with the coordinate time [s] and one variable a channel, units as attributes."""
    import xarray as xr

    variables = {name: ("time", np.array(values), {"units": unit_of(record, name)})
                 for name, values in record.channels.items()}
    time = ("time", np.array(record.time), {"units": "s"})
    return xr.Dataset(variables, coords={"time": time}, attrs=facts_of(record))


def _numbers(column: Any, name: str) -> FloatArray:
    if getattr(column.dtype, "kind", "O") not in "fiu":
        raise InputError(f"data frame, column {name!r}: holds {column.dtype}, numbers needed")
    return np.asarray(column.to_numpy(dtype=float, na_value=np.nan), dtype=np.float64)


MOST_CHANNELS = 8


def text(record: Record) -> str:
    """Return the record in ten lines at most: what it is, and the range of each channel."""
    steps = np.diff(record.time)
    speed = f", speed {record.speed:g} m/s" if record.speed else ""
    name = " ".join(record.name.split())[:60]
    lines = [f"Record {name}: {record.kind}{speed}; {record.time.size} samples from {record.time[0]:.6g} to "
             f"{record.time[-1]:.6g} s, every {np.median(steps):.4g} s"]
    names = list(record.channels)
    for name in names[:MOST_CHANNELS]:
        values = record.channels[name]
        there = values[np.isfinite(values)]
        span = f"{there.min():.4g} to {there.max():.4g} {unit_of(record, name)}" if there.size else "no samples"
        missing = f", {values.size - there.size} missing" if there.size < values.size else ""
        lines.append(f"  {name[:60]}  {span}{missing}")
    if len(names) > MOST_CHANNELS:
        lines.append(f"  and {len(names) - MOST_CHANNELS} more: {', '.join(names[MOST_CHANNELS:])[:80]}")
    return "\n".join(lines)


def in_radians(record: Record, *names: str) -> Record:
    """Return the record with rotations that are in degrees, degrees/s or degrees/s^2 in radians.

    Parameters
    ----------
    record : Record
    *names : str
        Degrees of freedom (with all their motion channels); all rotations if absent.

    Raises
    ------
    InputError
        If a name is no rotation of the record.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> record = rss.Record([0.0, 1.0], {"Roll": [90.0, 0.0], "Roll_force": [1.0, 0.0]}, kind="forced")
    >>> float(rss.in_radians(record).channels["Roll"][0])
    1.5707963267948966
    """
    record = as_record(record)
    turns = [dof for dof in record.dofs if mode(dof) in ROTATIONS or record.units.get(dof) == "rad"]
    wanted = names or tuple(turns)
    for dof in wanted:
        if dof not in turns:
            raise InputError(f"record {record.name}: {dof!r} is none of its rotations")
    changed = {dof + suffix: np.deg2rad(record.channels[dof + suffix]) for dof in wanted
               for suffix in RATES if dof + suffix in record.channels}
    return record.with_channels(**changed)
