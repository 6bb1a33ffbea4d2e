"""Numbers out of text files: every message says file, line and what would be right."""

import gzip
import re
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

from radiation_ss.errors import InputError
from radiation_ss.reading import check_regular

# Fortran writes 1.0D-05, and 1.0-105 where the exponent has three digits.
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[EeDd]([+-]?\d+)|([+-]\d+))?")


def lines(path: Path, largest: int = 1 << 30) -> list[str]:
    """Return the lines of a text file, gzipped or not, or say why not."""
    check_regular(path)
    try:
        raw = path.read_bytes()
        if raw.startswith(b"\x1f\x8b"):
            with gzip.open(path) as file:
                raw = file.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(raw) > largest:
        raise InputError(f"{path}: unpacks to more than {largest} bytes")
    content = raw.decode("utf-8-sig", errors="replace")
    found = content.splitlines()
    if len(found) > 1 and not content.endswith(("\n", "\r")):
        above, last = (re.search(r"[eE][+-]?(\d+)$", line) for line in found[-2:])
        if above and (last is None or len(last[1]) < len(above[1])) and found[-1][-1:].isdigit():
            raise InputError(f"{path}, line {len(found)}: the file ends within a number, {found[-1][-20:]!r}")
    return found


def number(token: str) -> float | None:
    """Return the finite value of a token, or None where it is none (words, NaN, asterisks of an overflow)."""
    if (match := _NUMBER.fullmatch(token)) is None:
        return None
    mantissa, exponent, bare = match.groups()
    value = float(f"{mantissa}e{exponent or bare or 0}")
    return value if abs(value) < float("inf") else None


def row(path: Path, k: int, text: str, columns: int | Iterable[int] | None, what: str) -> list[float]:
    """Return the numbers of line `k` (counted from 0), which must have one of the given counts of columns, if any."""
    tokens = text.split()
    allowed = [len(tokens)] if columns is None else [columns] if isinstance(columns, int) else list(columns)
    if len(tokens) not in allowed:
        wanted = " or ".join(str(c) for c in allowed)
        raise InputError(f"{path}, line {k + 1}: {len(tokens)} columns found, {wanted} needed ({what})")
    values = []
    for token in tokens:
        if (value := number(token)) is None:
            raise InputError(f"{path}, line {k + 1}: {token!r} is not a finite number ({what})")
        values.append(value)
    return values


def index(path: Path, k: int, value: float, limit: int, what: str) -> int:
    """Return a count or index read as a float; InputError unless it is a whole number from 1 to `limit`."""
    if not 1 <= value <= limit or value != int(value):
        raise InputError(f"{path}, line {k + 1}: {what} {value:g} is not a whole number from 1 to {limit}")
    return int(value)


def leading(path: Path, k: int, text: str, count: int, what: str) -> list[float]:
    """Return the first `count` numbers of a line that may carry a comment behind them."""
    values = [number(token) for token in text.split()[:count]]
    if len(values) < count or any(value is None for value in values):
        raise InputError(f"{path}, line {k + 1}: {count} numbers needed ({what}), found {text.strip()[:60]!r}")
    return [value for value in values if value is not None]


def head_and_rows(path: Path, head: int, what: str) -> tuple[list[str], list[list[float]]]:
    """Return the first `head` lines of a file, and the numbers of each line after them that is not empty."""
    found = lines(path)
    if len(found) <= head:
        raise InputError(f"{path}: not {what}: {head} header lines, then rows of numbers are needed")
    return found[:head], [row(path, k, text, None, what) for k, text in enumerate(found) if k >= head and text.strip()]


class Lines:
    """The lines of a file that hold something, and a place among them; every number that is taken is checked."""

    def __init__(self, path: Path, comment: Callable[[str], bool]) -> None:
        self.path, self.text = path, lines(path)
        self.rows = [(k, line) for k, line in enumerate(self.text) if line.strip() and not comment(line)]
        self.at = 0

    @property
    def k(self) -> int:
        """Number of the line that was taken last, counted from 0."""
        return self.rows[self.at - 1][0] if self.at else -1

    def wrong(self, what: str) -> InputError:
        """Return the error of the line that was taken last."""
        return InputError(f"{self.path}, line {self.k + 1}: {what}")

    def ahead(self) -> str | None:
        """Return the line ahead, None at the end of the file."""
        return self.rows[self.at][1].strip() if self.at < len(self.rows) else None

    def take(self, what: str) -> str:
        """Return the next line."""
        if self.ahead() is None:
            raise self.wrong(f"the file ends where {what} is expected")
        self.at += 1
        return self.rows[self.at - 1][1]

    def row(self, columns: int | Iterable[int], what: str) -> list[float]:
        """Return the numbers of the next line, see `row`."""
        line = self.take(what)
        return row(self.path, self.k, line, columns, what)

    def leading(self, count: int, what: str) -> list[float]:
        """Return the first numbers of the next line, see `leading`."""
        line = self.take(what)
        return leading(self.path, self.k, line.partition("!")[0], count, what)

    def index(self, value: float, most: int, what: str) -> int:
        """Return a count or index of the line that was taken last, see `index`."""
        return index(self.path, self.k, value, most, what)
