"""Records as CSV text, plain or gzipped, read and written in pieces; the comments above their header."""

import csv
import gzip
import io
import json
import re
import warnings
import zlib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import chain, islice
from pathlib import Path

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.reading import is_text
from radiation_ss.records.columns import (
    Column,
    ColumnChoice,
    missing_or_number,
    name_and_unit,
    names_channel,
    plain_columns,
)
from radiation_ss.records.record import PLACES
from radiation_ss.units import KNOT

PIECE = 1 << 20          # characters read at once
LONGEST_LINE = 1 << 20   # characters
ROWS = 30_000            # numbers turned at once
PACKED = 200             # times its size that a gzipped file of more than 100 PIECEs may unpack to
Table = tuple[dict[str, FloatArray], list[Column], Callable[[int], int], dict[str, str]]
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
OWN = ("kind", "name", "start", "speed", "dofs")  # comments that are fields of a record
_COMMENT = re.compile(r"^\s*#\s*(?P<key>[A-Za-z][\w .-]*?)\s*(\[(?P<unit>[^][:]*)\])?\s*:\s*(?P<value>.*?)\s*$",
                      re.DOTALL)
_SPEED = re.compile(r"^\s*(?P<value>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)(?P<unit>[^\d]*)$", re.ASCII)


def read_csv(path: Path, choice: ColumnChoice) -> Table:
    """Return numbers by column, the columns, the function from row to line number, and the comments of a CSV file."""
    with closing(_pieces(path)) as pieces:
        return _table(chain.from_iterable(pieces), str(path), choice)


def _table(rows: Iterator[str], where: str, choice: ColumnChoice) -> Table:
    """Return what `read_csv` does of the lines of a file."""
    comments, marks = dict[str, str](), set[str]()
    line, separator, columns, samples = _header(rows, where, choice, comments)
    values: list[list[FloatArray]] = [[] for _ in columns]
    lines: list[Sequence[int]] = []
    held = 0
    while some := list(islice(samples, max(1, ROWS // len(columns)))):
        if separator != ",":
            some = _plain(some, line, where, separator, marks)
        block, numbers = _quick_values(some, len(columns)), range(line, line + len(some))
        found, seen = (block, numbers) if block is not None else _careful_values(some, line, where, columns)
        line, held = line + len(some), held + found.size
        if held > choice.largest:
            raise InputError(f"{where}: more than {choice.largest:.4g} numbers; read a part of it, or raise `largest` "
                             "(each number takes 8 bytes of memory)")
        lines.append(seen)
        for column, pieces, part in zip(columns, values, found.T):
            if column.name is not None:
                pieces.append(np.array(part))

    whole = {}
    for column in columns:
        pieces = values.pop(0)
        if column.name is not None:
            whole[column.name] = np.concatenate(pieces or [np.zeros(0)])
            whole[column.name].setflags(write=False)  # so that a record need not copy it
    return whole, columns, lambda row: next(islice(chain.from_iterable(lines), row, None)), comments


def _header(rows: Iterator[str], where: str, choice: ColumnChoice,
            comments: dict[str, str]) -> tuple[int, str, list[Column], Iterator[str]]:
    """Return the first line of samples by its number, the separator, the columns, and the lines from there on.

    Separators that end the header may end each line, too.
    """
    line, header = _head(rows, where, comments)
    choice, at, below = choice.with_comments(comments), f"{where}, line {line}", list[str]()
    separator = _separator(header, at, choice)
    cells = _cells(header, at, separator)
    width = max((k for k, cell in enumerate(cells, 1) if cell.strip()), default=0)
    if 0 < width < len(cells):
        cells, ending = cells[:width], re.compile(rf"( *{separator}){{1,{len(cells) - width}}} *$")
        rows = (ending.sub("", row) for row in rows)
    columns = plain_columns(cells, at, choice)
    for row in rows:  # the line below a header without units may hold them
        below.append(row)
        if row.strip(",; \t"):
            named = _with_units(cells, _cells(row, f"{where}, line {line + len(below)}", separator))
            if named is not None:
                return line + len(below) + 1, separator, plain_columns(named, at, choice), rows
            break
    return line + 1, separator, columns, chain(below, rows)


def _head(rows: Iterator[str], where: str, comments: dict[str, str]) -> tuple[int, str]:
    """Return number and text of the header, and take up the comments above it."""
    lines, stated = dict[str, int](), ""
    for line, row in enumerate(rows, start=1):
        if row.lstrip().startswith("#"):
            key, value = comment_of(row) or ("", "")
            if not key and (slip := re.match(rf"\s*#\s*({'|'.join(OWN)})\s*[=;]", row, re.IGNORECASE)):
                raise InputError(f"{where}, line {line}: {row.strip()[:80]!r} is no comment that is read; write "
                                 f"`# {slip[1].lower()}: ...`")
            if key in (*OWN, *PLACES) and comments.get(key, value) != value:
                raise InputError(f"{where}, line {line}: comment {key!r} says {value[:80]!r}, another one above it, in "
                                 f"line {lines[key]}, {comments[key][:80]!r}")
            comments |= {key: value} if key else {}
            lines[key] = line
        elif "\0" in row:
            raise InputError(f"{where}, line {line}: holds zero bytes, as text in UTF-16 does; spreadsheets save UTF-8 "
                             "as `CSV UTF-8`")
        elif line == 1 and re.match(r"sep=[,;\t]", row):  # which Excel writes
            stated = row[4]
        elif row.strip(",; \t"):
            if stated not in row:
                raise InputError(f"{where}, line 1: 'sep={stated}', but the header, line {line}, holds none: "
                                 f"{row[:80]!r}")
            return line, row
    raise InputError(f"{where}: no header and no samples")


def _with_units(cells: list[str], below: list[str]) -> list[str] | None:
    """Return a header's cells with the units that the line below holds; None if it holds numbers or other words."""
    units = [cell.strip(" []()") for cell in below]
    if (any(name_and_unit(cell)[1] for cell in cells) or len(units) != len(cells) or not any(units)
            or any(missing_or_number(unit.replace(",", ".")) is not None for unit in units if unit)):
        return None
    return [f"{cell} [{unit}]" if unit else cell for cell, unit in zip(cells, units)]


def _plain(rows: list[str], first: int, where: str, separator: str, marks: set[str]) -> list[str]:
    """Return lines with commas between cells and points in numbers; `marks`: decimal marks that were seen so far."""
    for line, row in enumerate(rows, start=first):
        if not _is_comment(row):
            marks |= {mark for mark in ",." if mark in row}
        if len(marks) > 1:
            raise InputError(f"{where}, line {line}: points and commas in numbers; between {SEPARATORS[separator]} one "
                             "of them is the decimal mark, and thousands have none")
    return [row.replace(",", ".").replace(separator, ",") for row in rows]


def _careful_values(rows: Sequence[str], first: int, where: str,
                    columns: Sequence[Column]) -> tuple[FloatArray, list[int]]:
    """Return the numbers of lines cell by cell, and their line numbers; comments and empty lines are left out."""
    values, lines = [], []
    for line, row in enumerate(rows, start=first):
        if (comment_of(row) or ("",))[0] in OWN:
            raise InputError(f"{where}, line {line}: {row.strip()[:80]!r} stands below the header; comments stand "
                             "above it")
        if not row.strip(", \t") or _is_comment(row):
            continue
        cells = _cells(row, f"{where}, line {line}")
        if len(cells) != len(columns):
            commas = len(cells) > len(columns) and "." not in row
            raise InputError(f"{where}, line {line}: {len(cells)} cells, but the header has {len(columns)}"
                             + ("; where commas are decimal marks, semicolons part the cells" if commas else ""))
        numbers = [0.0 if column.name is None else missing_or_number(cell) for column, cell in zip(columns, cells)]
        if None in numbers:
            at = numbers.index(None)
            clock = columns[at].name == "time" and ":" in cells[at]
            raise InputError(f"{where}, line {line}, column {columns[at].name!r}: {cells[at].strip()!r} "
                             + ("is a date or a time of day; seconds from the first sample are needed" if clock else
                                "is not a number (a missing sample is an empty cell or nan; the decimal mark is a "
                                "point)"))
        values.append(numbers)
        lines.append(line)
    return np.array(values, dtype=float).reshape(len(values), len(columns)), lines


def _is_comment(row: str) -> bool:
    return row.lstrip().startswith("#") and re.match(r"\s*#N(/A|V)\s*([,;\t]|$)", row) is None


def _encoding(head: bytes, path: Path) -> str:
    """Return the encoding by the first bytes: UTF-16 by its mark, else UTF-8, or Windows' own of what is no UTF-8."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        head.decode()
    except UnicodeDecodeError as error:
        words = head.decode("cp1252", "replace")
        if error.start < len(head) - 3 and "\ufffd" not in words and is_text(words.encode(), 2 * len(head)):
            warnings.warn(InputWarning(f"{path}: not in UTF-8; read as Windows text (cp1252), in which its first other "
                                       f"letter is {words[error.start]!r}"), stacklevel=2)
            return "cp1252"
    return "utf-8-sig"


def _pieces(path: Path) -> Generator[list[str], None, None]:
    """Give the lines of a file, some at a time; any line end becomes a newline."""
    packed = path.suffix == ".gz"
    try:
        most = max(100 * PIECE, PACKED * path.stat().st_size) if packed else np.inf
        with (gzip.open if packed else open)(path, "rb") as raw:
            encoding = _encoding(raw.read(1 << 16), path)
        with (gzip.open if packed else open)(path, "rt", encoding=encoding) as text:
            read, line, rest = 0, 1, ""
            while piece := text.read(PIECE):
                read += len(piece)
                if read > most:
                    raise InputError(f"{path}: unpacks to more than {PACKED} times its size; if that is right, unpack "
                                     "it and read the .csv")
                *rows, rest = (rest + piece).split("\n")
                if long := next((at for at, row in enumerate((*rows, rest), line) if len(row) > LONGEST_LINE), None):
                    raise InputError(f"{path}, line {long}: longer than {LONGEST_LINE} characters; this is no table of "
                                     "samples, one row a line")
                line += len(rows)
                yield rows
            yield [rest] if rest else []
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


def comment_of(line: str) -> tuple[str, str] | None:
    """Return key and value of a comment; None if the line is another remark. Spreadsheets end it with separators.

    A unit behind the key, as columns have it, goes behind the value.

    >>> comment_of("# Kind: decay;;;"), comment_of("# speed [m/s]: 2"), comment_of("# made in May")
    (('kind', 'decay'), ('speed', '2 m/s'), None)
    """
    if (match := _COMMENT.match(line.rstrip(",;\t "))) is None:
        return None
    key, value = match["key"], match["value"]
    if len(value) > 1 and value[0] == value[-1] == '"':
        try:
            value = str(json.loads(value))
        except ValueError:
            pass
    if match["unit"]:
        value = f"{value} {match['unit'].strip()}"
    return (key.lower() if key.lower() in (*OWN, *PLACES) else key), value


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
    if (match := _SPEED.match(text)) is None:
        raise InputError(f"comment 'speed': {text!r} is not a speed; write metres per second, for example 0.97")
    value, unit = float(match["value"]), match["unit"].strip(" []").lower()
    if unit in ("", "m/s"):
        return value
    factor = {"kn": KNOT, "kt": KNOT, "kts": KNOT, "knot": KNOT, "knots": KNOT, "km/h": 1.0 / 3.6}.get(unit)
    hint = "" if factor is None else f"; write {value * factor:.4g}"
    raise InputError(f"comment 'speed': {text!r} found, m/s needed{hint}")
