"""Columns of a record's file: names and units."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from shlex import quote
from types import MappingProxyType

import numpy as np

from radiation_ss.arrays import FloatArray, listed
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, ROTATIONS, force_unit, mode, motion_unit
from radiation_ss.units import in_si, is_unit, plain_unit, understood

# `name [unit]`, `name (unit)`, `name, unit`
_HEADER = re.compile(r"^(?P<name>[^\[\](),]+?)\s*(?:\[(?P<a>[^\[\]]+)\]|\((?P<b>[^()]+)\)|,(?P<c>[^\[\],]+))$")
RATES = {"": "", "_velocity": "/s", "_acceleration": "/s^2"}  # suffix of a motion by its order, and of its unit
SUFFIXES = ("_velocity", "_acceleration", "_force")
QUANTITIES = ("displacement", "velocity", "acceleration")  # by the order of the derivative
# What may stand behind a degree of freedom, and the suffix that it means; the last three of rotations only
_QUANTITIES = {"displacement": "", "velocity": "_velocity", "vel": "_velocity", "acceleration": "_acceleration",
               "acc": "_acceleration", "force": "_force", "angle": "", "rate": "_velocity", "moment": "_force"}
_OF_ROTATIONS = ("angle", "rate", "moment")
OwnDofs = Mapping[str, str] | Collection[str]  # Names, with the displacement's unit, "m" or "rad", where it is said


@dataclass(frozen=True)
class ColumnChoice:
    """What is read of a table, and how."""

    ignore: Collection[str] = ()  # Columns to leave out
    degrees: Collection[str] = ()  # Columns of rotations that are in degrees, and become radians
    largest: int = 500_000_000  # Most numbers that a file may hold; each takes 8 bytes of memory
    dofs: OwnDofs = ()  # Degrees of freedom that are no rigid-body mode, with their unit or ""
    kind: str = ""  # Of the record; the rows of a static one need no times

    def __post_init__(self) -> None:
        object.__setattr__(self, "dofs", own_dofs(self.dofs))
        object.__setattr__(self, "ignore", tuple(listed(self.ignore)))
        object.__setattr__(self, "degrees", tuple(name if name in self.dofs else spelled(name) or name
                                                  for name in listed(self.degrees)))

    def with_comments(self, comments: Mapping[str, str]) -> "ColumnChoice":
        """Return the choice with kind and degrees of freedom that a file names itself."""
        named, known = own_dofs(comments.get("dofs", "")), own_dofs(self.dofs)
        return replace(self, dofs=named | {dof: unit or named.get(dof, "") for dof, unit in known.items()},
                       kind=self.kind or comments.get("kind", "").lower())


@dataclass(frozen=True)
class Column:
    """What a column of a table holds: the channel (None if it is left out), its unit, and one of that in SI."""

    name: str | None
    unit: str = ""
    factor: float = 1.0
    own: str = ""  # Of a degree of freedom that is no rigid-body mode: "m" or "rad"


def split(channel: str) -> tuple[str, str]:
    """Return degree of freedom and suffix of a channel's name: 'Heave', '_force' of 'Heave_force'."""
    suffix = next((s for s in SUFFIXES if channel.endswith(s)), "")
    return channel.removesuffix(suffix), suffix


def own_dofs(given: OwnDofs | str) -> dict[str, str]:
    """Return the unit of degrees of freedom that are no rigid-body mode, "" where it is not said; of a comment, too.

    >>> own_dofs("flap [rad], pump"), own_dofs(("pump", "Heave"))
    ({'flap': 'rad', 'pump': ''}, {'pump': ''})
    """
    if isinstance(given, str):
        parts = [re.fullmatch(r"(.+?)\s*(?:\[(.*)\])?", part.strip()) for part in given.split(",")]
        found = {part[1]: part[2] or "" for part in parts if part is not None}
    else:
        found = dict(given) if isinstance(given, Mapping) else dict.fromkeys(given, "")
    for name, unit in found.items():
        if unit not in ("", "m", "rad"):
            raise InputError(f"degree of freedom {name!r}: its unit is {unit!r}; m or rad is needed")
    return {name: unit for name, unit in found.items() if mode(name) not in RIGID}


def channel_unit(channel: str, own: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the SI unit of a channel, 's' of 'time'; `own`: m or rad of motions that are no rigid-body mode."""
    if channel == "time":
        return "s"
    if channel == "wave_elevation":
        return "m"
    dof, suffix = split(channel)
    if own.get(dof):
        force = "N m" if own[dof] == "rad" else "N"
        return force if suffix == "_force" else own[dof] + RATES[suffix]
    if mode(dof) not in RIGID:
        alike = get_close_matches(mode(dof).capitalize(), RIGID, 1, 0.7)
        near = _near(channel, dof) or (alike and channel.replace(mode(dof), alike[0]))
        hint = f"; did you mean {near!r}?" if near else (
            f"; one of your own needs its unit: dofs={{{dof!r}: 'm'}}, --dofs {quote(dof)}=m, "
            f"Record(units={{{dof!r}: 'm'}})")
        raise InputError(f"channel {channel!r} is not one of time, wave_elevation, <Dof>, <Dof>_velocity, "
                         f"<Dof>_acceleration, <Dof>_force with <Dof> among {', '.join(RIGID)}{hint}")
    return force_unit(dof) if suffix == "_force" else motion_unit(dof) + RATES[suffix]


def _near(channel: str, dof: str) -> str | None:
    """Return the name that was probably meant, None if there is no guess."""
    if channel.lower() in ("eta", "zeta", "elevation", "wave", "waves"):
        return "wave_elevation"
    if spelled(channel):
        return spelled(channel)
    return next((channel.replace(mode(dof), m) for m in RIGID if m.lower() == mode(dof).lower()), None)


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
    if dof not in RIGID or len(words) > 2 or said not in _QUANTITIES or (
            said in _OF_ROTATIONS and dof not in ROTATIONS):
        return None
    return f"{body}{mark}{dof}{_QUANTITIES[said]}"


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Return the name in a header's cell and the unit that it states, None if it states none.

    >>> name_and_unit("Roll force [kN m]"), name_and_unit("t_s"), name_and_unit("Heave")
    (('Roll force', 'kN m'), ('t', 's'), ('Heave', None))
    """
    cell = cell.strip()
    if (match := _HEADER.match(cell)) is not None:
        return match["name"], (match["a"] or match["b"] or match["c"]).strip()
    if spelled(cell) is None:
        for gap in re.finditer(r"[\s_]+|/", cell):  # `name_unit`, `name unit`, `name/unit`
            name, unit = cell[:gap.start()], cell[gap.end():]
            if spelled(name) and is_unit(unit):
                return name, unit
    return cell, None


def plain_columns(header: Sequence[str], where: str, choice: ColumnChoice) -> list[Column]:
    """Return what each column holds, by the cells of the header; InputError naming the one that is not understood."""
    columns, left = list[Column](), _left_out(header, choice)
    if not any(names_channel(cell, choice) for cell in header):
        if len(header) == 1 and any(names_channel(word, choice) for word in header[0].split()):
            raise InputError(f"{where}: blanks in {header[0].strip()!r}; the separator must be a comma, a semicolon or "
                             "a tab")
        raise InputError(f"{where}: no cell of it names a channel; the header reads `time [s],Heave [m]`, and lines "
                         f"above it begin with #. The line is {', '.join(cell.strip() for cell in header)}")
    for number, cell in enumerate(header, start=1):
        at = f"{where}, column {number} {cell.strip()!r}"
        text, unit = name_and_unit(cell)
        if not text:
            raise InputError(f"{at}: a header cell reads `name [unit]`, for example `Heave [m]`; a line ends without a "
                             "separator")
        name = text if split(text)[0] in choice.dofs else spelled(text) or text
        if number - 1 in left:
            columns.append(Column(None))
            continue
        own = _own_unit(name, unit, at, choice, columns)
        try:
            si = channel_unit(name, own)
        except InputError as error:
            raise InputError(f"{at}: {error} (leave a column out: ignore=({text!r},), or --ignore {quote(text)})"
                             ) from None
        if name in (column.name for column in columns):
            raise InputError(f"{at}: the column is there twice")
        columns.append(Column(name, *_unit_of(unit, si, name, at, choice), *own.values()))
    names = [column.name for column in columns]
    if absent := [name for name in choice.degrees if name not in names]:
        raise InputError(f"{where}: degrees={tuple(absent)!r}, but there is no column {absent[0]!r}")
    if "time" not in names and choice.kind != "static":
        raise InputError(f"{where}: no column `time [s]`; the header is {', '.join(c.strip() for c in header)}")
    if not {*names} - {None, "time"}:
        raise InputError(f"{where}: no channel beside time; the separator must be a comma, a semicolon or a tab")
    return columns


def names_channel(cell: str, choice: ColumnChoice) -> bool:
    """Whether a header's cell names a channel, by any spelling that is understood or nearly so, or what is left out."""
    name = name_and_unit(cell)[0]
    return bool(_left_out([cell], choice) or split(name)[0] in choice.dofs or spelled(name)
                or _near(name, split(name)[0]))


def _left_out(header: Sequence[str], choice: ColumnChoice) -> set[int]:
    """Return the places of columns to leave out: as they are named, else in any case, with blanks or underscores."""
    cells = [(text := name_and_unit(cell)[0], spelled(text) or text, cell.strip()) for cell in header]
    found = set[int]()
    for name in choice.ignore:
        exact = {at for at, known in enumerate(cells) if name in known}
        found |= exact or {at for at, known in enumerate(cells) if _plainly(name) in map(_plainly, known)}
    return found


def _plainly(text: str) -> str:
    return re.sub(r"[\s_]+", " ", text.strip().lower())


def _own_unit(name: str, found: str | None, at: str, choice: ColumnChoice, columns: Sequence[Column]) -> dict[str, str]:
    """Return "m" or "rad" of a column's own degree of freedom, by the header (`found`) or the columns before."""
    dof = split(name)[0]
    known = own_dofs(choice.dofs)
    if dof not in known:
        return {}
    units = {kind: channel_unit(name, {dof: kind}) for kind in ("m", "rad")}
    said = {kind for kind, si in units.items() if found is not None and in_si(found, si)}
    if found is not None and not said:
        raise InputError(f"{at}: unit [{found}] is not understood; {name} may be in {' or '.join(units.values())}")
    said |= {known[dof], *(column.own for column in columns if column.name and split(column.name)[0] == dof)} - {""}
    if name in choice.degrees:
        said.add("rad")
    if not said:
        raise InputError(f"{at}: no unit; write `{name} [{units['m']}]` or `{name} [{units['rad']}]`, or "
                         f"dofs={{{dof!r}: 'm'}}, --dofs {quote(dof)}=m")
    if len(said) > 1:
        raise InputError(f"{at}: {dof} is in m elsewhere and in rad here, or the other way round; all columns of it "
                         f"are of one kind, {', '.join(units.values())}")
    return {dof: said.pop()}


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
    if own := {split(column.name)[0]: column.own for column in columns if column.name and column.own}:
        comments = {**comments, "dofs": own_text(own)}
    other = {column.name: column for column in columns if column.name and column.factor != 1.0}
    found = {name: np.asarray(column * other[name].factor) if name in other else column
             for name, column in values.items()}
    if not other:
        return found, dict(comments)
    said = ", ".join(f"{name} from {column.unit}" for name, column in other.items())
    return found, {**comments, "converted": "; ".join(filter(None, (comments.get("converted"), said)))}


def own_text(own: Mapping[str, str]) -> str:
    """Return the comment that `own_dofs` reads."""
    return ", ".join(f"{dof} [{unit}]" for dof, unit in own.items())


def missing_or_number(text: str) -> float | None:
    """Return the cell as a number, NaN if it is empty or #N/A (in German #NV), which Excel writes.

    None if it is neither, or one as Python alone spells them.
    """
    text = text.strip()
    if text in ("", "#N/A", "#NV"):
        return float("nan")
    try:
        value = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        return None
    return None if value in (float("inf"), float("-inf")) else value
