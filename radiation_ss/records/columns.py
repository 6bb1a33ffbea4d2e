"""Columns and comments of a record's file: names, units, kind, speed, and anything else."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray, listed
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, force_unit, mode, motion_unit
from radiation_ss.units import in_si, is_unit, plain_unit, understood

# `name [unit]`, `name (unit)`, `name, unit`
_HEADER = re.compile(r"^(?P<name>[^\[\](),]+?)\s*(?:\[(?P<a>[^\[\]]+)\]|\((?P<b>[^()]+)\)|,(?P<c>[^\[\],]+))$")
RATES = {"": "", "_velocity": "/s", "_acceleration": "/s^2"}  # suffix of a motion by its order, and of its unit
SUFFIXES = ("_velocity", "_acceleration", "_force")
_MODES = (*TRANSLATIONS, *ROTATIONS)
# What may stand behind a degree of freedom, and the suffix that it means; the last three of rotations only
_QUANTITIES = {"displacement": "", "velocity": "_velocity", "vel": "_velocity", "acceleration": "_acceleration",
               "acc": "_acceleration", "force": "_force", "angle": "", "rate": "_velocity", "moment": "_force"}
_OF_ROTATIONS = ("angle", "rate", "moment")
_COMMENT = re.compile(r"^\s*#\s*(?P<key>[A-Za-z][\w .-]*?)\s*:\s*(?P<value>.*?)\s*$", re.DOTALL)
_SPEED = re.compile(r"^\s*(?P<value>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)(?P<unit>[^\d]*)$", re.ASCII)
KNOT = 1852.0 / 3600.0  # m/s
OWN = ("kind", "name", "start", "speed")


@dataclass(frozen=True)
class ColumnChoice:
    """What is read of a table, and how."""

    ignore: Collection[str] = ()  # Columns to leave out
    degrees: Collection[str] = ()  # Columns of rotations that are in degrees, and become radians
    largest: int = 500_000_000  # Most numbers that a file may hold; each takes 8 bytes of memory

    def __post_init__(self) -> None:
        object.__setattr__(self, "ignore", tuple(listed(self.ignore)))
        object.__setattr__(self, "degrees", tuple(spelled(name) or name for name in listed(self.degrees)))


@dataclass(frozen=True)
class Column:
    """What a column of a table holds: the channel (None if it is left out), its unit, and one of that in SI."""

    name: str | None
    unit: str = ""
    factor: float = 1.0


def split(channel: str) -> tuple[str, str]:
    """Return degree of freedom and suffix of a channel's name: 'Heave', '_force' of 'Heave_force'."""
    suffix = next((s for s in SUFFIXES if channel.endswith(s)), "")
    return channel.removesuffix(suffix), suffix


def channel_unit(channel: str) -> str:
    """Return the SI unit of a channel by its name: 'm/s' of 'Heave_velocity', 's' of 'time'.

    InputError if the name is none that a record may hold.
    """
    if channel == "time":
        return "s"
    if channel == "wave_elevation":
        return "m"
    dof, suffix = split(channel)
    if mode(dof) not in _MODES:
        near = _near(channel, dof)
        hint = f"; did you mean {near!r}?" if near else ""
        raise InputError(f"channel {channel!r} is not one of time, wave_elevation, <Dof>, <Dof>_velocity, "
                         f"<Dof>_acceleration, <Dof>_force with <Dof> among {', '.join(_MODES)}{hint}")
    return force_unit(dof) if suffix == "_force" else motion_unit(dof) + RATES[suffix]


def _near(channel: str, dof: str) -> str | None:
    """Return the name that was probably meant, None if there is no guess."""
    if channel.lower() in ("eta", "zeta", "elevation", "wave", "waves"):
        return "wave_elevation"
    if spelled(channel):
        return spelled(channel)
    return next((channel.replace(mode(dof), m) for m in _MODES if m.lower() == mode(dof).lower()), None)


def spelled(text: str) -> str | None:
    """Return the channel that a text is another spelling of, None if it is none.

    Upper and lower case, blanks and underscores make no difference.

    >>> spelled("Wave elevation"), spelled("buoy__heave vel"), spelled("roll moment"), spelled("heave moment")
    ('wave_elevation', 'buoy__Heave_velocity', 'Roll_force', None)
    """
    body, mark, rest = text.strip().rpartition("__")
    words = re.split(r"[\s_]+", rest.lower())
    if words in (["t"], ["time"], ["wave", "elevation"]):
        return {"t": "time", "time": "time"}.get(words[0], "wave_elevation") if not mark else None
    dof = words[0].capitalize()
    said = words[1] if len(words) == 2 else "displacement"
    if dof not in _MODES or len(words) > 2 or said not in _QUANTITIES or (
            said in _OF_ROTATIONS and dof not in ROTATIONS):
        return None
    return f"{body}{mark}{dof}{_QUANTITIES[said]}"


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Return the name in a header's cell and the unit that it states, None if it states none.

    >>> name_and_unit("Roll force [kN m]"), name_and_unit("t_s"), name_and_unit("Heave")
    (('Roll force', 'kN m'), ('t', 's'), ('Heave', None))
    """
    cell = cell.strip()
    match = _HEADER.match(cell)
    if match is not None:
        return match["name"], (match["a"] or match["b"] or match["c"]).strip()
    if spelled(cell) is None:
        for gap in re.finditer(r"[\s_]+|/", cell):  # `name_unit`, `name unit`, `name/unit`
            name, unit = cell[:gap.start()], cell[gap.end():]
            if spelled(name) and is_unit(unit):
                return name, unit
    return cell, None


def plain_columns(header: Sequence[str], where: str, choice: ColumnChoice) -> list[Column]:
    """Return what each column holds, by the cells of the header; InputError naming the one that is not understood."""
    columns: list[Column] = []
    if not any(names_channel(cell, choice) for cell in header):
        raise InputError(f"{where}: no cell of it names a channel; the header reads `time [s],Heave [m]`, and lines "
                         f"above it begin with #. The line is {', '.join(cell.strip() for cell in header)}")
    for number, cell in enumerate(header, start=1):
        at = f"{where}, column {number} {cell.strip()!r}"
        text, unit = name_and_unit(cell)
        if not text:
            raise InputError(f"{at}: a header cell reads `name [unit]`, for example `Heave [m]`")
        name = spelled(text) or text
        if not {name, text, cell.strip()}.isdisjoint(choice.ignore):
            columns.append(Column(None))
            continue
        try:
            si = channel_unit(name)
        except InputError as error:
            raise InputError(f"{at}: {error} (leave a column out: ignore=({text!r},), or --ignore {text})") from None
        if name in (column.name for column in columns):
            raise InputError(f"{at}: the column is there twice")
        columns.append(Column(name, *_unit_of(unit, si, name, at, choice)))
    names = [column.name for column in columns]
    absent = [name for name in choice.degrees if name not in names]
    if absent:
        raise InputError(f"{where}: degrees={tuple(absent)!r}, but there is no column {absent[0]!r}")
    if "time" not in names:
        raise InputError(f"{where}: no column `time [s]`; the header is {', '.join(c.strip() for c in header)}")
    if len([name for name in names if name]) < 2:
        raise InputError(f"{where}: no channel beside time; the separator must be a comma, a semicolon or a tab")
    return columns


def names_channel(cell: str, choice: ColumnChoice) -> bool:
    """Whether a header's cell names a channel, by any spelling that is understood or nearly so, or what is left out."""
    name = name_and_unit(cell)[0]
    return bool(name in choice.ignore or spelled(name) or _near(name, split(name)[0]))


def _unit_of(found: str | None, si: str, name: str, at: str, choice: ColumnChoice) -> tuple[str, float]:
    """Return the unit of a column, and what one of it is in its SI unit."""
    if name in choice.degrees:
        if not si.startswith("rad"):
            raise InputError(f"{at}: degrees={tuple(choice.degrees)!r}, but its unit is {si}")
        if found is not None and not plain_unit(found).startswith("deg"):
            raise InputError(f"{at}: said to be in degrees, but the header has [{found}]")
        found = found or si.replace("rad", "deg")
    factor = 1.0 if found is None else in_si(found, si)
    if factor is None:
        raise InputError(f"{at}: unit [{found}] is not understood; {name} may be in {understood(si)}")
    return plain_unit(found or si), factor


def values_in_si(values: Mapping[str, FloatArray], columns: Sequence[Column],
                 comments: Mapping[str, str]) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """Return the columns of a table in SI, and its comments with one more, `converted`, if there was another unit."""
    other = {column.name: column for column in columns if column.name and column.factor != 1.0}
    found = {name: np.asarray(column * other[name].factor) if name in other else column
             for name, column in values.items()}
    if not other:
        return found, dict(comments)
    said = ", ".join(f"{name} from {column.unit}" for name, column in other.items())
    return found, {**comments, "converted": "; ".join(filter(None, (comments.get("converted"), said)))}


def missing_or_number(text: str) -> float | None:
    """Return the cell as a number, NaN if it is empty, None if it is neither.

    Python's own spellings of numbers with underscores, other digits or infinity are none.
    """
    text = text.strip()
    if text == "":
        return float("nan")
    try:
        value = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        return None
    return None if value in (float("inf"), float("-inf")) else value


def comment_of(line: str) -> tuple[str, str] | None:
    """Return key and value of a comment; None if the line is another remark.

    >>> comment_of("# Kind: decay"), comment_of("# made in May")
    (('kind', 'decay'), None)
    """
    match = _COMMENT.match(line)
    if match is None:
        return None
    key, value = match["key"], match["value"]
    if len(value) > 1 and value[0] == value[-1] == '"':
        try:
            value = str(json.loads(value))
        except ValueError:
            pass
    return (key.lower() if key.lower() in OWN else key), value


def comment_line(key: str, value: str) -> str:
    """Return the line that `comment_of` reads as this key and value; the value is quoted where it must be.

    InputError if the key cannot be one.
    """
    plain = f"# {key}: {value}"
    writable = value == value.encode(errors="replace").decode()  # half of a character pair cannot be written
    if writable and "\n" not in value and "\r" not in value and comment_of(plain) == (key, value):
        return plain
    quoted = f"# {key}: {json.dumps(value)}"
    if comment_of(quoted) != (key, value):
        raise InputError(f"comment {key!r}: a key begins with a letter and holds letters, digits, blanks, points and "
                         "hyphens")
    return quoted


def speed_of(text: str) -> float:
    """Return the speed that a `# speed:` comment states [m/s]; `m/s` may stand behind the number.

    InputError if it is no number, or in another unit; knots are named with what they are in m/s.

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
