"""Damaged files: seeds, mutations, and what a reader made of each. `benchmarks/fuzz.py` runs many, the tests a few.

A target is one file of one form. Four kinds of mutation, each with what may come of it:

keep     the same numbers in another dress (tabs, line ends, blanks): read the same
damage   a line or a word lost, doubled or replaced by junk, the file cut: refused, or nothing that is read was hit
value    a digit changed: refused or read, possibly with another number (no reader can know)
bytes    any bytes changed, lost, inserted: likewise
"""

import gc
import hashlib
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import radiation_ss as rss

ALLOWED = {"keep": {"same"}, "damage": {"refused", "same"}, "value": {"refused", "same", "changed"},
           "bytes": {"refused", "same", "changed"}}
JUNK = (b"nan", b"inf", b"1e400", b"***", b"x", b"1_000", b"--", b"1,5", b"\x00", b"\xe9", b"0x1F", b"1d")
LONGEST = 1200  # characters of a message


@dataclass(frozen=True)
class Target:
    """One file that is damaged: `write` makes the whole set in a folder and returns what `read` is given."""

    name: str
    write: Callable[[Path], Path]
    file: str
    read: Callable[[Path], object]
    digest: Callable[[object], bytes]
    text: bool = True


@dataclass(frozen=True)
class Outcome:
    """What came of one mutation: refused, same, changed, or what should not be."""

    target: str
    kind: str
    result: str
    detail: str = ""
    content: bytes = b""

    @property
    def allowed(self) -> bool:
        return self.result in ALLOWED[self.kind]


def arrays_digest(*values: object) -> bytes:
    """Return a digest of arrays and numbers, None included."""
    found = hashlib.sha256()
    for value in values:
        found.update(b"none" if value is None else repr(np.shape(value)).encode() + np.asarray(value).tobytes()
                     if not isinstance(value, tuple) else repr(value).encode())
    return found.digest()


def mutations(content: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """Return `content` after one mutation of this kind."""
    return {"keep": _keep, "damage": _damage, "value": _value, "bytes": _bytes}[kind](content, rng)


def _keep(content: bytes, rng: np.random.Generator) -> bytes:
    way = rng.integers(5)
    if way == 0:
        return content.replace(b" ", b"\t")
    if way == 1:
        return content.replace(b"\n", b"\r\n")
    if way == 2:
        return content.replace(b"\n", b"  \n")
    if way == 3:
        return content + b"\n\n"
    return re.sub(rb"(?<=\w) (?=\S)", b"  ", content)


def _damage(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    k = int(rng.integers(len(lines)))
    words = lines[k].split(b" ")
    full = [j for j, word in enumerate(words) if word]
    way = rng.integers(6)
    if way == 0:
        return content[:int(rng.integers(len(content)))]
    if way == 1 or not full:
        del lines[k]
    elif way == 2:
        lines.insert(k, lines[k])
    elif way == 3:
        del words[rng.choice(full)]
        lines[k] = b" ".join(words)
    elif way == 4:
        words[rng.choice(full)] = JUNK[rng.integers(len(JUNK))]
        lines[k] = b" ".join(words)
    else:
        words.insert(int(rng.choice(full)), JUNK[rng.integers(len(JUNK))])
        lines[k] = b" ".join(words)
    return b"\n".join(lines)


def _value(content: bytes, rng: np.random.Generator) -> bytes:
    places = [k for k, c in enumerate(content) if 48 <= c <= 57]
    at = int(rng.choice(places))
    return content[:at] + bytes([int(rng.integers(48, 58))]) + content[at + 1:]


def _bytes(content: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        at, length = int(rng.integers(len(out))), int(rng.integers(1, 9))
        way = rng.integers(4)
        if way == 0:
            out[at:at + length] = rng.bytes(length)
        elif way == 1:
            out[at:at + length] = b""
        elif way == 2:
            out[at:at] = rng.bytes(length)
        else:
            out = out[:max(at, 1)]
        if not out:
            return b"\0"
    return bytes(out)


def classify(target: Target, kind: str, content: bytes, whole: bytes, path: Path, folder: Path,
             slow: float = 60.0) -> Outcome:
    """Read the damaged file in `folder` (where the whole set lies) and say what came of it."""
    (folder / target.file).write_bytes(content)
    start = time.monotonic()
    noise: list[str] = []
    with warnings.catch_warnings(), _unraised(noise):
        warnings.simplefilter("error")
        try:
            result, detail = "same" if target.digest(target.read(path)) == whole else "changed", ""
        except rss.InputError as error:
            result, detail = "refused", str(error)
            if len(detail) > LONGEST or "\n" in detail.strip():
                result = f"message of {len(detail)} characters, {detail.count(chr(10))} line ends"
            elif folder.name not in detail and str(folder) not in detail:
                result = "message without the file"
        except BaseException as error:
            result, detail = f"crashed: {type(error).__name__}", str(error)[:300]
            if isinstance(error, KeyboardInterrupt):
                raise
    if noise:
        result, detail = "printed a traceback", noise[0]
    if time.monotonic() - start > slow:
        result = f"took {time.monotonic() - start:.0f} s"
    return Outcome(target.name, kind, result, detail, content)


class _unraised:
    """Collect what Python would print as `Exception ignored in`."""

    def __init__(self, noise: list[str]) -> None:
        self.noise = noise

    def __enter__(self) -> None:
        self.before = sys.unraisablehook
        sys.unraisablehook = lambda event: self.noise.append(repr(event.exc_value))

    def __exit__(self, *_: object) -> None:
        gc.collect(1)
        sys.unraisablehook = self.before


def attack(targets: list[Target], tries: int, seed: int = 0) -> Iterator[Outcome]:
    """Damage each target `tries` times in all kinds and yield what came of it; the same for the same seed."""
    for target in targets:
        with tempfile.TemporaryDirectory(prefix="fuzz_") as name:
            folder = Path(name)
            path = target.write(folder)
            whole = target.digest(target.read(path))
            content = (folder / target.file).read_bytes()
            rng = np.random.default_rng([seed, *target.name.encode()])
            for k in range(tries):
                kind = ("keep", "damage", "value", "bytes")[k % 4] if target.text else "bytes"
                yield classify(target, kind, mutations(content, kind, rng), whole, path, folder)


def table(outcomes: list[Outcome]) -> list[list[str]]:
    """Return rows target | tries | refused | same | changed | failures."""
    rows = [["file", "tries", "refused", "read the same", "read, other numbers", "failures"]]
    for name in dict.fromkeys(o.target for o in outcomes):
        mine = [o for o in outcomes if o.target == name]
        count = Counter(o.result for o in mine)
        rows.append([name, str(len(mine)), *(str(count[r]) for r in ("refused", "same", "changed")),
                     str(sum(not o.allowed for o in mine))])
    return rows
