"""Measured or simulated records: time series with named channels, read from CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, FrozenMap, read_only
from radiation_ss.errors import InputError
from radiation_ss.methods import Shown, later
from radiation_ss.records.columns import own_dofs, split

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


LARGEST = 1e60  # that a sensor may read: powers of larger numbers overflow
PLACES = ("probe", "heading")  # keys of meta that are read, in any case
KINDS = ("decay", "waves", "motion-only", "forced", "prescribed", "static")


@dataclass(frozen=True, eq=False, repr=False)
class Record(Shown):
    """One run: times and channels; missing samples are NaN.

    Parameters
    ----------
    time : array_like, shape (nt,), or pandas.DataFrame
        Sample times [s], strictly ascending; any rate, jitter allowed. A DataFrame alone is read as `from_pandas` does.
    channels : mapping of str to array_like, shape (nt,)
        `<Dof>` [m or rad], `<Dof>_velocity`, `<Dof>_acceleration`, `<Dof>_force` [N or N m] (wave-exciting force
        known from elsewhere; absent means unknown), `wave_elevation` [m] at the body.
    kind : str
        What is known of the force: "decay" (none acts), "forced" (measured), "waves" (force or elevation measured),
        "motion-only" (nothing); "prescribed" (the motion is the input, `<Dof>_force` the measured total force on the
        body, which is what is predicted); "static" (offsets under steady loads; no dynamics; times 0, 1, 2, ... are
        row numbers).
    name, start : str
        From the file's leading comments.
    meta : mapping
        Every other `# key: value` comment.
    speed : float
        Forward speed of the body [m/s]; 0 at rest.
    units : mapping of str to str
        "m" or "rad" of degrees of freedom that are no rigid-body mode: {"flap": "rad"}. Files need it.
    file : str
        Where it was read from; messages name it.

    Raises
    ------
    InputError
        If times do not ascend or jump, a channel has another length or a number beyond 1e60, the kind is unknown, a
        decay has a force, a prescribed record has no motion, or the speed is no number.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> record = rss.Record(np.arange(5) / 10.0, {"Heave": [0.1, 0.05, 0.0, -0.05, -0.08]}, kind="decay")
    >>> towed = rss.Record([0.0, 0.5, 1.0], {"Roll": [0.1, 0.0, -0.09]}, kind="decay", name="run 5", speed=0.97)
    >>> towed.dofs, towed.kind, towed.speed
    (('Roll',), 'decay', 0.97)
    """

    time: FloatArray
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    kind: str = "waves"
    name: str = "record"
    start: str = ""
    meta: Mapping[str, str] = field(default_factory=dict)
    speed: float = 0.0
    units: Mapping[str, str] = field(default_factory=dict)
    file: str = ""

    def __post_init__(self) -> None:
        if hasattr(self.time, "columns") or hasattr(self.time, "data_vars"):
            self._take(type(self).from_pandas(self.time, kind=None if self.kind == "waves" else self.kind))
            return
        if isinstance(self.time, str | Path):
            raise InputError(f"{self.time}: Record takes arrays; read_record reads a file")
        if not all(isinstance(name, str) for name in (self.name, self.kind, *self.channels)):
            raise InputError(f"record {self.name}: names of records, kinds and channels are texts")
        time = read_only(self.time, "time", (None,))
        if time.size < 2:
            raise InputError(f"record {self.name}: {time.size} sample(s); at least two are needed")
        if (fault := time_fault(time)) is not None:
            raise InputError(f"record {self.name}, time [s], sample {fault[0]}: {fault[1]}")
        if self.kind not in KINDS:
            raise InputError(f"record {self.name}: kind {self.kind!r} is unknown; use one of {', '.join(KINDS)}")
        channels = {name: read_only(values, f"record {self.name}, channel {name}", (time.size,), finite=False)
                    for name, values in self.channels.items()}
        for name, values in channels.items():
            if (beyond := np.flatnonzero(np.abs(values) > LARGEST)).size:
                value = values[beyond[0]]
                what = f"{value:.4g} is beyond {LARGEST:g}" if np.isfinite(value) else (
                    "infinite; a missing sample is nan")
                raise InputError(f"record {self.name}, channel {name}, sample {beyond[0]}: {what}")
        pushed = [name for name, values in channels.items() if name.endswith("_force") and np.nansum(np.abs(values))]
        if self.kind == "decay" and pushed:
            raise InputError(f"record {self.name}: kind decay states that no force acts, but {pushed[0]} is not zero")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", FrozenMap(channels))
        object.__setattr__(self, "meta", FrozenMap({key.lower() if str(key).lower() in PLACES else key: value
                                                    for key, value in self.meta.items()}))
        object.__setattr__(self, "units", FrozenMap(own_dofs(self.units)))
        if self.kind == "prescribed" and all(c == "wave_elevation" or c.endswith("_force") for c in channels):
            raise InputError(f"record {self.name}: kind prescribed states that the motion is given, but no channel "
                             "holds one; add <Dof> [m or rad]")
        try:
            object.__setattr__(self, "speed", float(self.speed))
        except (TypeError, ValueError):
            raise InputError(f"record {self.name}: speed {self.speed!r} is not a number of m/s") from None
        if not np.isfinite(self.speed):
            raise InputError(f"record {self.name}: speed is {self.speed}; metres per second are needed, 0 at rest")

    def _take(self, given: Record) -> None:
        """Take the fields of another record; a name given here stays."""
        name = self.name
        for each in fields(self):
            object.__setattr__(self, each.name, getattr(given, each.name))
        if name != "record":
            object.__setattr__(self, "name", name)

    def __str__(self) -> str:
        return later("records.convert:text", self)

    def plot(self) -> Figure:
        """Draw the channels over time (see `report.plots.plot_record`).

        >>> towed.plot().axes[0].get_ylabel()
        '[rad]'
        """
        return later("report.plots:plot_record", self)

    @classmethod
    def from_pandas(cls, frame: pd.DataFrame, **options: Any) -> Record:
        """Return the record of a pandas.DataFrame (see `radiation_ss.records.convert.from_pandas`).

        >>> rss.Record.from_pandas(record.to_pandas()).kind
        'decay'
        """
        return later("records.convert:from_pandas", frame, **options)

    def to_pandas(self) -> pd.DataFrame:
        """Return a pandas.DataFrame over time [s] (see `radiation_ss.records.convert.to_pandas`).

        >>> record.to_pandas().columns.tolist()
        ['Heave']
        """
        return later("records.convert:to_pandas", self)

    def to_xarray(self) -> xr.Dataset:
        """Return an xarray.Dataset over time [s] (see `radiation_ss.records.convert.to_xarray`).

        >>> record.to_xarray()["Heave"].attrs["units"]
        'm'
        """
        return later("records.convert:to_xarray", self)

    @property
    def dofs(self) -> tuple[str, ...]:
        """Degrees of freedom that any channel belongs to, in the order of the channels."""
        return tuple(dict.fromkeys(split(channel)[0] for channel in self.channels if channel != "wave_elevation"))

    def get(self, quantity: str, dofs: Sequence[str]) -> FloatArray | None:
        """Return a quantity of some degrees of freedom, shape (n, nt), NaN where one is absent; None if all are.

        The force of a decay record is zero where no column says so: that is what the kind states.

        Parameters
        ----------
        quantity : str
            "displacement", "velocity", "acceleration" or "force".
        dofs : sequence of str

        >>> record.get("displacement", ["Heave"]).shape
        (1, 5)
        """
        suffix = "" if quantity == "displacement" else f"_{quantity}"
        at_rest = quantity == "force" and self.kind == "decay"
        if not at_rest and not any(dof + suffix in self.channels for dof in dofs):
            return None
        absent = np.full(self.time.size, 0.0 if at_rest else np.nan)
        return np.stack([self.channels.get(dof + suffix, absent) for dof in dofs])

    def force_from_elevation(self, dofs: Sequence[str]) -> bool:
        """Return whether the force on some motions can come from `wave_elevation` only: none is recorded.

        >>> record.force_from_elevation(["Heave"])
        False
        """
        return "wave_elevation" in self.channels and self.get("force", dofs) is None

    def window(self, start: float, end: float) -> Record:
        """Return the part with start <= time < end [s].

        >>> record.window(0.1, 0.25).time.tolist()
        [0.1, 0.2]
        """
        keep = (self.time >= start) & (self.time < end)
        return replace(self, time=self.time[keep], channels={k: v[keep] for k, v in self.channels.items()})

    def with_channels(self, **channels: ArrayLike) -> Record:
        """Return a copy with channels added or replaced.

        >>> record.with_channels(Heave_force=np.zeros(5)).channels["Heave_force"].size
        5
        """
        return replace(self, channels={**self.channels, **channels})  # type: ignore[dict-item]


def time_fault(time: FloatArray, *, longest_gap: float = 3600.0, share: float = 10.0,
               lasting: tuple[float, float] = (1e-6, 3.2e8)) -> tuple[int, str] | None:
    """Return the sample at which times do not ascend or jump, and what is wrong with it; None if they are sound.

    A gap is a jump of the clock if it is longer than `longest_gap` and than 1000 median steps, and if all such gaps
    together last `share` times longer than the rest of the record. An even grid over such times would be almost empty,
    and can be larger than the memory of the machine. `time` (nt,): [s]. `longest_gap`: [s]. `lasting`: shortest and
    longest time [s] that a record can last, a microsecond and ten years; others are in another unit.

    >>> import numpy as np
    >>> at, what = time_fault(np.array([0.0, 0.1, 0.2, 2592000.3, 2592000.4]))
    >>> at, what
    (3, 'the clock jumps by 2.592e+06 s (30 days) after 0.2 s')
    """
    steps = np.diff(time)
    if steps.size == 0:
        return None
    if steps.min() <= 0.0:
        at = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        what = "is there twice" if steps[at - 1] == 0.0 else f"comes after {time[at - 1]:.10g} s"
        return at, f"{time[at]:.10g} s {what}; times must ascend without repeats"
    gaps = steps > max(longest_gap, 1000.0 * float(np.median(steps)))
    if gaps.any() and steps[gaps].sum() > share * steps[~gaps].sum():
        at = int(np.argmax(steps)) + 1
        size = steps[at - 1]
        return at, f"the clock jumps by {size:.4g} s ({_spoken(size)}) after {time[at - 1]:.10g} s"
    whole = float(time[-1] - time[0])
    if not lasting[0] <= whole <= lasting[1]:
        return time.size - 1, f"{whole:.4g} s ({_spoken(whole)}) after the first; the unit of time is the second"
    return None


def _spoken(seconds: float) -> str:
    """Return a long time in hours, days or years."""
    for unit, length in (("years", 31557600.0), ("days", 86400.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds / 3600.0:.3g} hours"
