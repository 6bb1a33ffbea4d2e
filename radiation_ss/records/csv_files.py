"""Records as CSV text, plain or gzipped, read and written in pieces."""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.records.columns import (
    Column,
    ColumnChoice,
    missing_or_number,
    name_and_unit,
    names_channel,
    plain_columns,
)
from radiation_ss.records.comments import OWN, comment_of

PIECE = 1 << 20          # characters read at once
LONGEST_LINE = 1 << 20   # characters
PACKED = 200             # times its size that a gzipped file of more than 100 PIECEs may unpack to
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass
class _Table:
    """What has been read so far: header, comments, and the numbers of each column in pieces."""

    where: str
    choice: ColumnChoice
    comments: dict[str, str] = field(default_factory=dict)
    columns: list[Column] = field(default_factory=list)
    pieces: list[list[FloatArray]] = field(default_factory=list)
    lines: list[Sequence[int]] = field(default_factory=list)
    held: int = 0
    header: tuple[int, list[str]] | None = None  # Line and cells, until the line after it is known: it may hold units
    separator: str = ","
    marks: str = ""  # Of a file without commas between cells: what its numbers have had as decimal marks so far

    def add(self, rows: list[str], first: int) -> None:
        """Take lines of text that begin with line number `first`."""
        at = 0
        while at < len(rows) and (not self.columns or self.header):
            if not self.columns:
                self._add_head(rows[at], first + at)
            elif not self._add_units(rows[at]):
                break
            at += 1
        if at == len(rows):
            return
        rows, first = self._plain(rows[at:], first + at), first + at
        lines: Sequence[int] = range(first, first + len(rows))
        values = _quick_values(rows, len(self.columns))
        if values is None:
            values, lines = self._careful_values(rows, first)
        self.held += values.size
        if self.held > self.choice.largest:
            raise InputError(f"{self.where}: more than {self.choice.largest:.4g} numbers; read a part of it, or raise "
                             "`largest` (each number takes 8 bytes of memory)")
        self.lines.append(lines)
        for i, piece in enumerate(self.pieces):
            if self.columns[i].name is not None:
                piece.append(np.array(values[:, i]))

    def _add_head(self, row: str, line: int) -> None:
        """Take a line before the samples: a comment, the header, or nothing."""
        if row.lstrip().startswith("#"):
            found = comment_of(row)
            if found:
                key, value = found
                if key in OWN and self.comments.get(key, value) != value:
                    raise InputError(f"{self.where}, line {line}: comment {key!r} says {value[:80]!r}, another one "
                                     f"above it {self.comments[key][:80]!r}")
                self.comments[key] = value
        elif row.strip(",; \t"):
            where = f"{self.where}, line {line}"
            if "\0" in row:
                raise InputError(f"{where}: holds zero bytes, as text in UTF-16 does; spreadsheets save UTF-8 as `CSV "
                                 "UTF-8`")
            self.choice = self.choice.with_comments(self.comments)
            self.separator = _separator(row, where, self.choice)
            cells = _cells(row, where, self.separator)
            self.columns = plain_columns(cells, where, self.choice)
            self.pieces, self.header = [[] for _ in self.columns], (line, cells)

    def _add_units(self, row: str) -> bool:
        """Take the line under a header without units if it holds no number, but the units; return whether it was so."""
        line, cells = self.header or (0, [])
        if not row.strip(",; \t"):
            return True
        units = [cell.strip(" []()") for cell in _cells(row, f"{self.where}, line {line + 1}", self.separator)]
        self.header = None
        if (any(name_and_unit(cell)[1] for cell in cells) or len(units) != len(cells) or not any(units)
                or any(missing_or_number(unit.replace(",", ".")) is not None for unit in units if unit)):
            return False
        named = [f"{cell} [{unit}]" if unit else cell for cell, unit in zip(cells, units)]
        self.columns = plain_columns(named, f"{self.where}, line {line}", self.choice)
        return True

    def _plain(self, rows: list[str], first: int) -> list[str]:
        """Return lines with commas between cells and points in numbers, of a file with other separators."""
        if self.separator == ",":
            return rows
        for line, row in enumerate(rows, start=first):
            if row.lstrip().startswith("#"):
                continue
            self.marks += "".join(mark for mark in ",." if mark in row and mark not in self.marks)
            if len(self.marks) > 1:
                raise InputError(f"{self.where}, line {line}: points and commas in numbers; between "
                                 f"{SEPARATORS[self.separator]} one of them is the decimal mark, and thousands have "
                                 "none")
        return [row.replace(",", ".").replace(self.separator, ",") for row in rows]

    def _careful_values(self, rows: Sequence[str], first: int) -> tuple[FloatArray, list[int]]:
        """Return the numbers of lines cell by cell, and their line numbers; comments and empty lines are left out."""
        values, lines = [], []
        for line, row in enumerate(rows, start=first):
            if not row.strip(", \t") or row.lstrip().startswith("#"):
                continue
            cells = _cells(row, f"{self.where}, line {line}")
            if len(cells) != len(self.columns):
                raise InputError(f"{self.where}, line {line}: {len(cells)} cells, but the header has "
                                 f"{len(self.columns)}")
            numbers = [0.0 if column.name is None else missing_or_number(cell)
                       for column, cell in zip(self.columns, cells)]
            if None in numbers:
                at = numbers.index(None)
                clock = self.columns[at].name == "time" and ":" in cells[at]
                raise InputError(f"{self.where}, line {line}, column {self.columns[at].name!r}: {cells[at].strip()!r} "
                                 + ("is a date or a time of day; seconds from the first sample are needed" if clock else
                                    "is not a number (a missing sample is an empty cell or nan; the decimal mark is a "
                                    "point)"))
            values.append(numbers)
            lines.append(line)
        return np.array(values, dtype=float).reshape(len(values), len(self.columns)), lines

    def line_of(self, row: int) -> int:
        """Return the line of the file that a row of samples stands in."""
        for lines in self.lines:
            if row < len(lines):
                return lines[row]
            row -= len(lines)
        raise IndexError(row)

    def values(self) -> dict[str, FloatArray]:
        """Return the columns by name; the pieces are let go of."""
        found = {}
        for i, column in enumerate(self.columns):
            if column.name is not None:
                found[column.name] = np.concatenate(self.pieces[i] or [np.zeros(0)])
                found[column.name].setflags(write=False)
            self.pieces[i] = []
        return found


def read_csv(path: Path, choice: ColumnChoice) -> tuple[dict[str, FloatArray], list[Column], Callable[[int], int],
                                                       dict[str, str]]:
    """Return numbers by column, the columns, the function from row to line number, and the comments of a CSV file.

    The memory that it takes is that of the numbers, 8 bytes each, and a few pieces of text. InputError naming file,
    line and column.
    """
    table = _Table(str(path), choice)
    line, rest = 1, ""
    for piece in _pieces(path):
        rows = (rest + piece).split("\n")
        rest = rows.pop()
        if len(rest) > LONGEST_LINE or any(len(row) > LONGEST_LINE for row in rows):
            at = next((i for i, row in enumerate(rows) if len(row) > LONGEST_LINE), len(rows))
            raise InputError(f"{path}, line {line + at}: longer than {LONGEST_LINE} characters; this is no table of "
                             "samples, one row a line")
        table.add(rows, line)
        line += len(rows)
    if rest:
        table.add([rest], line)
    if not table.columns:
        raise InputError(f"{path}: no header and no samples")
    return table.values(), table.columns, table.line_of, table.comments


def _pieces(path: Path) -> Iterator[str]:
    """Give the text of a file in pieces; any line end becomes a newline."""
    packed = path.suffix == ".gz"
    try:
        size = path.stat().st_size
        with (gzip.open if packed else open)(path, "rt", encoding="utf-8-sig") as text:
            read = 0
            while piece := text.read(PIECE):
                read += len(piece)
                if packed and read > max(100 * PIECE, PACKED * size):
                    raise InputError(f"{path}: unpacks to more than {PACKED} times its size; if that is right, unpack "
                                     "it and read the .csv")
                yield piece
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read as CSV text, it is not in UTF-8 ({error}); spreadsheets save that as "
                         "`CSV UTF-8`") from None
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read as {'gzipped ' if packed else ''}CSV text ({error})") from None


def _separator(row: str, where: str, choice: ColumnChoice) -> str:
    """Return what stands between the cells of a header: of several marks the one that makes every cell a channel."""
    found = [mark for mark in SEPARATORS if mark in re.sub('"[^"]*"', "", row)]
    if len(found) > 1:
        good = [mark for mark in found if all(names_channel(cell, choice) for cell in _cells(row, where, mark))]
        if len(good) != 1:
            said = " and ".join(SEPARATORS[mark] for mark in found)
            raise InputError(f"{where}: {said} found in the header, and none of them alone parts it into channels")
        found = good
    return found[0] if found else ","


def _cells(row: str, where: str, separator: str = ",") -> list[str]:
    if '"' not in row:
        return row.split(separator)
    try:
        return next(csv.reader([row], delimiter=separator), [])
    except csv.Error as error:
        raise InputError(f"{where}: not a line of CSV ({error})") from None


def _quick_values(rows: list[str], width: int) -> FloatArray | None:
    """Return the numbers of plain lines, shape (rows, width); None where a line needs a closer look."""
    text = ",".join(rows)
    if not text.isascii() or any(mark in text for mark in '_"#') or any(row.count(",") != width - 1 for row in rows):
        return None
    cells = text.split(",")
    if "" in cells:
        if width == 1 or any(not row.strip(", \t") for row in rows):
            return None
        cells = [cell or "nan" for cell in cells]
    try:
        values = np.array(list(map(float, cells)))
    except ValueError:
        return None
    return None if np.isinf(values).any() else values.reshape(-1, width)


def write_csv(path: Path, columns: Mapping[str, FloatArray], header: Sequence[str], comments: Sequence[str],
              packed: bool) -> None:
    """Write comments, header and columns; a gzipped file is the same each time it is written."""
    with open(path, "wb") as raw:
        target = gzip.GzipFile(filename="", mode="wb", fileobj=raw, mtime=0) if packed else raw
        text = io.TextIOWrapper(target, encoding="utf-8", newline="\n")  # type: ignore[arg-type]
        for line in (*comments, ",".join(header)):
            text.write(line + "\n")
        values = list(columns.values())
        for start in range(0, values[0].size, 10_000):
            rows = zip(*(column[start:start + 10_000].tolist() for column in values))
            text.writelines(",".join("" if v != v else repr(v) for v in row) + "\n" for row in rows)
        text.close()
