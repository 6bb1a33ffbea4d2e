"""Processes that are killed and disks that are full, at every write: what is left must be whole.

A job is a function that writes into a folder. It is run in a forked child that is killed at its n-th file operation, or
as soon as one of its files would grow beyond a number of bytes; or here, on a disk that is full.
"""

import gc
import hashlib
import os
import re
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import radiation_ss as rss

CHANGES = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "shutil.rmtree"}
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
Job = Callable[[Path], object]


def in_child(job: Job, folder: Path, prepare: Callable[[], None]) -> int:
    """Run a job in a forked child; return its exit status, negative for the signal that ended it."""
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            prepare()
            job(folder)
            status = 0
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def killed_at(job: Job, folder: Path, operation: int) -> bool:
    """Run a job that is killed (-9) before its n-th file operation; False where it has fewer and ran to its end."""
    count = 0

    def hook(event: str, arguments: tuple) -> None:
        nonlocal count
        if event in CHANGES or (event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITES):
            count += 1
            if count == operation:
                os.kill(os.getpid(), signal.SIGKILL)

    def prepare() -> None:
        flush = os.fsync
        os.fsync = lambda handle: (hook("os.remove", ()), flush(handle))[1]
        sys.addaudithook(hook)

    status = in_child(job, folder, prepare)
    assert status in (0, -signal.SIGKILL), status
    return status != 0


def killed_beyond(job: Job, folder: Path, size: int) -> bool:
    """Run a job that the system kills when a file would grow beyond `size` bytes; False where none does."""
    def prepare() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    status = in_child(job, folder, prepare)
    assert status in (0, -signal.SIGXFSZ), status
    return status != 0


@contextmanager
def files_no_longer_than(size: int) -> Iterator[None]:
    """Let every write beyond `size` bytes of a file fail inside the block (EFBIG, which needs no disk of its own)."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def content(folder: Path) -> dict[str, str]:
    """Return a digest of every file below a folder that is not hidden; of a page whether it is whole."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and not any(part.startswith(".") for part in name.parts):
            raw = path.read_bytes()
            if path.name == "blind.json":       # when it was sealed is no part of what is resumed
                raw = re.sub(rb'"sealed": "[^"]*"', b"", raw)
            if path.suffix in (".nc", ".h5"):   # where in the file a value stands depends on what was there before
                raw = values_of_hdf5(path)
            whole = raw.rstrip().endswith(b"</html>") if path.suffix == ".html" else None
            found[str(name)] = hashlib.sha256(raw).hexdigest() if whole is None else f"a whole page: {whole}"
    return found


def values_of_hdf5(path: Path) -> bytes:
    """Return names and values of an HDF5 file; nothing where it cannot be read."""
    import h5py

    found: list[str] = []
    try:
        with h5py.File(path, "r") as file:
            file.visititems(lambda name, item: found.append(
                f"{name}{item.shape}{np.asarray(item[()]).tobytes()!r}" if isinstance(item, h5py.Dataset)
                and item.dtype.kind != "O" and "dof" not in name else name))
    except OSError:
        return b""
    return "".join(sorted(found)).encode()


def wrong_after_a_kill(job: Job, folder: Path, kill: Callable[[Job, Path, int], bool], place: int, old: dict[str, str],
                       new: dict[str, str]) -> tuple[bool, str | None]:
    """Kill a job at a place, look at what is left, and do it again; return whether it was killed, and what is wrong.

    Each file has to be the old or the new one, whole, and after the second run everything has to be the new one, to the
    last bit.
    """
    killed = kill(job, folder, place)
    half = [name for name, digest in content(folder).items() if digest not in (old.get(name), new.get(name))]
    if half:
        return killed, f"left neither old nor new: {half}"
    if in_child(job, folder, lambda: None):
        return killed, "did not go on"
    left = content(folder)
    other = sorted(name for name in {*new, *(set(left) - set(old))} if left.get(name) != new.get(name))
    return killed, f"not the same as without the kill: {other}" if other else None


def wrong_on_a_full_disk(job: Job, folder: Path, name: str) -> str | None:
    """Run a job where writing fails; return what is wrong: another error, a file that is cut, one that is left over."""
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    noise = []
    hook, sys.unraisablehook = sys.unraisablehook, lambda event: noise.append(repr(event.exc_value))
    try:
        job(folder)
        return "no error"
    except rss.InputError as error:
        if name not in str(error):
            return f"message without the path: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        gc.collect()
        sys.unraisablehook = hook
    if noise:
        return f"printed a traceback: {noise[0]}"
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    cut = [path.name for path in before if after.get(path) != before[path]]
    return f"damaged {cut}" if cut else f"left {sorted(p.name for p in set(after) - set(before))}" if (
        set(after) - set(before)) else None
