"""Columns and comments of a record's file: names, units, kind, speed, and anything else."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from radiation_ss.arrays import listed
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, force_unit, mode, motion_unit

_HEADER = re.compile(r"^\s*(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*$")
RATES = {"": "", "_velocity": "/s", "_acceleration": "/s^2"}  # suffix of a motion by its order, and of its unit
SUFFIXES = ("_velocity", "_acceleration", "_force")
_MODES = (*TRANSLATIONS, *ROTATIONS)
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
        object.__setattr__(self, "degrees", tuple(listed(self.degrees)))


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
    if channel.lower() in ("t", "time", "time_s", "times"):
        return "time"
    if channel.lower() in ("eta", "zeta", "elevation", "wave", "wave_elevation"):
        return "wave_elevation"
    return next((channel.replace(mode(dof), m) for m in _MODES if m.lower() == mode(dof).lower()), None)


def _plain_unit(unit: str) -> str:
    """Spell a unit one way: 'm/s²', 'm/s2', 'm/s**2' are 'm/s^2'; 'Nm', 'N*m', 'N·m' are 'N m'."""
    text = re.sub(r"/s2$", "/s^2", unit.strip().replace("²", "^2").replace("**", "^"))
    return re.sub(r"^N\s*[*·.]?\s*m$", "N m", text)


def plain_columns(header: Sequence[str], where: str, choice: ColumnChoice) -> list[str | None]:
    """Return the channel of each column (None where ignored), units checked."""
    for mark, said in ((";", "semicolons and commas"), ("\t", "tabs")):
        if any(mark in cell for cell in header):
            raise InputError(f"{where}: cells separated by {said} found, commas needed (and points as decimal marks), "
                             "or semicolons")
    names: list[str | None] = []
    for number, cell in enumerate(header, start=1):
        match = _HEADER.match(cell)
        at = f"{where}, column {number} {cell.strip()!r}"
        if match is None or not match["name"]:
            raise InputError(f"{at}: a header cell reads `name [unit]`, for example `Heave [m]`")
        name = match["name"]
        if name.endswith(")") and match["unit"] is None:
            raise InputError(f"{at}: the unit stands in square brackets, for example `Heave [m]`")
        if name in choice.ignore:
            names.append(None)
            continue
        try:
            unit = channel_unit(name)
        except InputError as error:
            raise InputError(f"{at}: {error} (leave a column out: ignore=({name!r},), or --ignore {name})") from None
        _check_unit(match["unit"], unit, name, at, choice)
        if name in names:
            raise InputError(f"{at}: the column is there twice")
        names.append(name)
    absent = [name for name in choice.degrees if name not in names]
    if absent:
        raise InputError(f"{where}: degrees={tuple(absent)!r}, but there is no column {absent[0]!r}")
    if "time" not in names:
        raise InputError(f"{where}: no column `time [s]`; the header is {', '.join(c.strip() for c in header)}")
    if len([name for name in names if name]) < 2:
        raise InputError(f"{where}: no channel beside time; the separator must be a comma or a semicolon")
    return names


def _check_unit(found: str | None, unit: str, name: str, at: str, choice: ColumnChoice) -> None:
    """Refuse a column in another unit than its own, or than the degrees that it was said to be in."""
    if name in choice.degrees:
        if not unit.startswith("rad"):
            raise InputError(f"{at}: degrees={tuple(choice.degrees)!r}, but its unit is {unit}")
        if found is not None and not _plain_unit(found).startswith("deg"):
            raise InputError(f"{at}: said to be in degrees, but the header has [{found}]")
        return
    if found is None or _plain_unit(found) == unit:
        return
    offer = f", or read it with degrees=({name!r},), --degrees {name}" if _plain_unit(found).startswith("deg") else ""
    raise InputError(f"{at}: unit [{found}] found, [{unit}] needed; convert the column{offer}")


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
