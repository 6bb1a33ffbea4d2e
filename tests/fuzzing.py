"""Damaged files: seeds, mutations, and what a reader made of each. `benchmarks/fuzz.py` runs many, the tests a few.

A target is one file of one form. Five kinds of mutation, each with what may come of it:

keep     the same numbers in another dress (tabs, line ends, blanks, order of keys): read the same
damage   a line or a word lost, doubled or replaced by junk, the file cut: refused, or nothing that is read was hit
value    a digit changed: refused or read, possibly with another number (no reader can know)
bytes    any bytes changed, lost, inserted: likewise
odd      a sound file with a field lost, renamed, or of another type, shape or depth: likewise

Where a form carries a checksum, other numbers are a failure. Where a target says which numbers stand in a file, each
number that is read must be one of them; a line that is lost then means that its numbers are not read.
"""

import gc
import hashlib
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import radiation_ss as rss
from radiation_ss.errors import InputWarning

ALLOWED = {"keep": {"same"}, "damage": {"refused", "same"}, "value": {"refused", "same", "changed"},
           "bytes": {"refused", "same", "changed"}, "odd": {"refused", "same", "changed"}}
JUNK = (b"nan", b"inf", b"1e400", b"***", b"x", b"1_000", b"--", b"1,5", b"\x00", b"\xe9", b"0x1F", b"1d")
LONGEST = 1200  # characters of a message
# Forms whose arrays have checksums and whose names and attributes have none.
PARTLY = dict.fromkeys(("Capytaine .nc", "model .nc", "fit .npz", "record .parquet"), "of arrays")
Mutation = Callable[[bytes, np.random.Generator], bytes]


@dataclass(frozen=True)
class Target:
    """One file that is damaged: `write` makes the whole set in a folder and returns what `read` is given.

    `own` are mutations of this form alone, beside or in place of those of all text files. `values` are the numbers that
    were read, `pool` those that stand in a file; `sealed` says that the form has a checksum over them.
    """

    name: str
    write: Callable[[Path], Path]
    file: str
    read: Callable[[Path], object]
    digest: Callable[[object], bytes]
    text: bool = True
    own: Mapping[str, Mutation] = field(default_factory=dict)
    values: Callable[[object], np.ndarray] | None = None
    pool: Callable[[bytes], np.ndarray] | None = None
    sealed: bool = False

    @property
    def mutations(self) -> dict[str, Mutation]:
        """Mutations by kind."""
        text = {"keep": _keep, "damage": _damage, "value": _value} if self.text else {}
        return {**text, "bytes": _bytes, **self.own}


@dataclass(frozen=True)
class Outcome:
    """What came of one mutation: refused, same, changed, or what should not be."""

    target: str
    kind: str
    result: str
    detail: str = ""
    content: bytes = b""
    visible: bool = False

    @property
    def allowed(self) -> bool:
        return self.result in ALLOWED[self.kind] or (self.visible and self.result == "changed" and self.kind != "keep")


def arrays_digest(*values: object) -> bytes:
    """Return a digest of arrays and numbers, None included."""
    found = hashlib.sha256()
    for value in values:
        found.update(b"none" if value is None else repr(np.shape(value)).encode() + np.asarray(value).tobytes()
                     if not isinstance(value, tuple) else repr(value).encode())
    return found.digest()


def stand_in(values: np.ndarray, pool: np.ndarray) -> bool:
    """Whether each number, or its negative, is one of the pool; zero and NaN always are."""
    values, pool = np.abs(np.ravel(values).astype(float)), np.sort(np.abs(np.ravel(pool)[np.isfinite(np.ravel(pool))]))
    values = values[np.isfinite(values) & (values > 0.0)]
    if not pool.size:
        return not values.size
    at = np.searchsorted(pool, values).clip(1, pool.size - 1) if pool.size > 1 else np.zeros(values.size, int)
    nearest = np.minimum(np.abs(pool[at] - values), np.abs(pool[at - 1] - values))
    return bool(np.all(nearest <= 1e-12 * values))


def numbers_of_text(content: bytes) -> np.ndarray:
    """Return every number that stands in a text."""
    words = re.findall(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", content)
    with np.errstate(over="ignore"):
        return np.array([float(word) for word in words])


def numbers_of_bytes(content: bytes) -> np.ndarray:
    """Return the numbers at every place of a file, whatever type the file may say they have."""
    found = [np.frombuffer(content[at:at + (len(content) - at) // int(kind[1]) * int(kind[1])], f"<{kind}")
             for kind in ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8") for at in range(int(kind[1]))]
    with np.errstate(invalid="ignore"):
        return np.concatenate([part.astype(float) for part in found])


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
    mark = b"," if content.count(b",") > content.count(b" ") else b" "
    lines = content.split(b"\n")
    k = int(rng.integers(len(lines)))
    words = lines[k].split(mark)
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
        lines[k] = mark.join(words)
    elif way == 4:
        words[rng.choice(full)] = JUNK[rng.integers(len(JUNK))]
        lines[k] = mark.join(words)
    else:
        words.insert(int(rng.choice(full)), JUNK[rng.integers(len(JUNK))])
        lines[k] = mark.join(words)
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
        warnings.simplefilter("ignore", InputWarning)
        try:
            result, detail = judged(target, target.read(path), content, whole), ""
        except rss.InputError as error:
            result, detail = "refused", str(error)
            if len(detail) > LONGEST or "\n" in detail.strip():
                result = f"message of {len(detail)} characters, {detail.count(chr(10))} line ends"
            elif folder.name not in detail and Path(target.file).name not in detail:
                result = "message without the file"
        except BaseException as error:
            result, detail = f"crashed: {type(error).__name__}", str(error)[:300]
            if isinstance(error, KeyboardInterrupt):
                raise
    if noise:
        result, detail = "printed a traceback", noise[0]
    if time.monotonic() - start > slow:
        result = f"took {time.monotonic() - start:.0f} s"
    return Outcome(target.name, kind, result, detail, content, target.values is not None)


def judged(target: Target, found: object, content: bytes, whole: bytes) -> str:
    """Say whether what was read is the same, or other numbers that the file may give."""
    if target.digest(found) == whole:
        return "same"
    if target.sealed:
        return "changed in spite of its checksum"
    if target.values is not None and target.pool is not None and not stand_in(target.values(found),
                                                                              target.pool(content)):
        return "numbers that do not stand in the file"
    return "changed"


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
            kinds = list(target.mutations.items())
            for k in range(tries):
                kind, mutate = kinds[k % len(kinds)]
                yield classify(target, kind, mutate(content, rng), whole, path, folder)


def table(outcomes: list[Outcome], targets: list[Target]) -> list[list[str]]:
    """Return rows target | tries | refused | same | changed | failures | checksum."""
    sealed = {target.name for target in targets if target.sealed}
    rows = [["file", "tries", "refused", "read the same", "read, other numbers", "failures", "checksum"]]
    for name in dict.fromkeys(o.target for o in outcomes):
        mine = [o for o in outcomes if o.target == name]
        count = Counter(o.result for o in mine)
        rows.append([name, str(len(mine)), *(str(count[r]) for r in ("refused", "same", "changed")),
                     str(sum(not o.allowed for o in mine)), "of all" if name in sealed else PARTLY.get(name, "none")])
    return rows
