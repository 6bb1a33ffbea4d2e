"""Files that are there whole or not at all: written beside, flushed to the disk, then put in place."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from radiation_ss.errors import InputError


@contextmanager
def _named(path: str | Path, what: str = "cannot be written") -> Iterator[None]:
    """Make of an error of the system an InputError that names the path."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: {what} ({error.strerror or error})") from error


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """Give a name beside `path` to write to; after the block that file takes the place of `path`.

    A process that is killed, and a disk that is full, leave what was there before. A failed block leaves no file of its
    own. What is no plain file (a pipe, /dev/stdout) is written directly; a link stays, and its target is replaced.
    InputError if the folder is absent or the disk is full, naming the path.

    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "result.txt"
    >>> with written_whole(target) as beside:
    ...     _ = beside.write_text("done")
    >>> target.read_text(), len(list(target.parent.iterdir()))
    ('done', 1)
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise InputError(f"{path}: a folder, the name of a file is needed")
    if not target.parent.is_dir():
        raise InputError(f"{path}: the folder {target.parent} does not exist")
    plain = target.is_file() or not target.exists()
    # The suffixes stay: some writers choose the form by them.
    suffixes = "".join(target.suffixes[-2:])[-40:]
    beside = target.with_name(f".{secrets.token_hex(6)}{suffixes}") if plain else target
    try:
        with _named(path):
            yield beside
            if plain:
                _flush(beside)
                os.replace(beside, target)
                _flush(target.parent)
    finally:
        if plain:
            with contextlib.suppress(OSError):
                beside.unlink()


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write text (as UTF-8; half a surrogate pair as its escape) or bytes, whole or not at all; see `written_whole`."""
    with written_whole(path) as beside:
        beside.write_bytes(content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content)


def write_rows(path: str | Path, lines: Sequence[str], matrices: Sequence[Iterable[Iterable[float]]]) -> None:
    """Write lines of text, and below them the rows of matrices, numbers with 17 digits; see `write_whole`."""
    rows = [" ".join(f"{value:.16e}" for value in row) for matrix in matrices for row in matrix]
    write_whole(path, "\n".join([*lines, *rows]) + "\n")


def write_first(path: str | Path, content: str) -> None:
    """Write text to a file that is not there; one that another process wrote in the meantime stays."""
    target = Path(path)
    beside = target.with_name(f".{secrets.token_hex(6)}")
    try:
        write_whole(beside, content)
        with _named(path), contextlib.suppress(FileExistsError):
            os.link(beside, target)
    finally:
        beside.unlink(missing_ok=True)


def made_folder(path: str | Path) -> Path:
    """Return a folder, made with those above it where it is not there."""
    folder = Path(path)
    with _named(path, "no folder can be made there"):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def folder_written_whole(path: str | Path, beside: str | Path | None = None) -> Iterator[Path]:
    """Give a folder to write to, below `beside`; after the block it becomes `path`, after an error nothing does.

    Where `path` is there already its content goes in; two processes do not mix their files where the system has locks.
    """
    folder = Path(path)
    with _named(path, "no folder can be made there"):
        place = Path(beside or folder.parent) / f".{folder.name[:40]}.{secrets.token_hex(6)}"
        place.mkdir(parents=True)
    try:
        with _named(path):
            yield place
            made_folder(folder.parent)
            if not folder.exists():
                with contextlib.suppress(OSError):      # another process made it in the meantime
                    os.rename(place, folder)
            if place.exists():
                with _locked(made_folder(folder)):
                    for item in place.iterdir():
                        if item.is_dir():
                            shutil.rmtree(folder / item.name, ignore_errors=True)
                        os.replace(item, folder / item.name)
    except InputError as error:         # of a file in the place that is gone by then
        raise InputError(str(error).replace(str(place), str(folder))) from error
    finally:
        shutil.rmtree(place, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other processes that lock the folder waiting; does nothing where the system has no such locks."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _flush(path: Path) -> None:
    """Flush a file or a folder's entries to the disk; some systems cannot do so for a folder."""
    with contextlib.suppress(PermissionError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
