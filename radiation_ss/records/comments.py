"""Comments of a record's file: kind, name, start, speed, and anything else."""

from __future__ import annotations

import json
import re

from radiation_ss.errors import InputError

_COMMENT = re.compile(r"^\s*#\s*(?P<key>[A-Za-z][\w .-]*?)\s*:\s*(?P<value>.*?)\s*$", re.DOTALL)
_SPEED = re.compile(r"^\s*(?P<value>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)(?P<unit>[^\d]*)$", re.ASCII)
KNOT = 1852.0 / 3600.0  # m/s
OWN = ("kind", "name", "start", "speed", "dofs")


def comment_of(line: str) -> tuple[str, str] | None:
    """Return key and value of a comment; None if the line is another remark. Spreadsheets end it with separators.

    >>> comment_of("# Kind: decay;;;"), comment_of("# made in May")
    (('kind', 'decay'), None)
    """
    match = _COMMENT.match(line.rstrip(",;\t "))
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
    """Return the line that `comment_of` reads as this key and value, quoted where it must be."""
    plain = f"# {key}: {value}"
    writable = value == value.encode(errors="replace").decode()  # half of a character pair cannot be written
    if writable and "\n" not in value and "\r" not in value and comment_of(plain) == (key, value):
        return plain
    quoted = f"# {key}: {json.dumps(value)}"
    if comment_of(quoted) != (key, value):
        raise InputError(f"comment {key!r}: a key begins with a letter and holds letters, digits, blanks, points and "
                         "hyphens")
    return quoted


def number_in(text: str, unit: str) -> float:
    """Return the number that a comment states, its unit behind it or not; NaN if it is none.

    >>> number_in("90 [deg]", "deg"), number_in("-1.5 m", "m")
    (90.0, -1.5)
    """
    try:
        return float(text.removesuffix(f"[{unit}]").removesuffix(unit))
    except ValueError:
        return float("nan")


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
