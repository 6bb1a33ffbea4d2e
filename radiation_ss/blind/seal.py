"""The seal: labels in a folder of their own, their hash beside the cases, and a lock that the diagnosis cannot open."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

from radiation_ss.atomic import made_folder, write_whole
from radiation_ss.errors import InputError

LABELS = "labels.json"
READS = ("open", "os.listdir", "os.scandir", "os.rename", "os.link", "os.symlink", "shutil.copyfile",
         "subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "ctypes.dlopen")


def sealed_folder(folder: Path) -> Path:
    """Return where the labels of a folder of cases lie."""
    return folder.with_name(folder.name + "-sealed")


def write_seal(folder: Path, labels: list[dict[str, Any]]) -> str:
    """Write the labels and return their SHA-256."""
    made_folder(folder)
    raw = (json.dumps(labels, indent=1) + "\n").encode()
    write_whole(folder / LABELS, raw)
    return hashlib.sha256(raw).hexdigest()


def open_seal(folder: Path, digest: str) -> list[dict[str, Any]]:
    """Return the labels.

    Raises
    ------
    InputError
        If the labels are absent or not those that were sealed.
    """
    path = folder / LABELS
    if not path.is_file():
        raise InputError(f"{path}: no such file; the labels of a blind run lie there")
    raw = path.read_bytes()
    if hashlib.sha256(raw).hexdigest() != digest:
        raise InputError(f"{path}: its SHA-256 is not the one printed when it was sealed ({digest}); labels changed")
    return json.loads(raw)


def lock_out(folder: Path) -> None:
    """Make this process unable to read below a folder, or to start another process that could; for good.

    A Python audit hook cannot be removed once it is set.
    """
    sealed = str(folder.resolve())

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in READS:
            return
        if event.startswith(("subprocess", "os.system", "os.exec", "os.posix_spawn")):
            raise PermissionError(f"the diagnosing process starts no other process ({event})")
        for item in arguments[:2]:
            if isinstance(item, (str, bytes, Path)):
                name = item.decode(errors="replace") if isinstance(item, bytes) else str(item)
                if name and str(Path(name).resolve()).startswith(sealed):
                    raise PermissionError(f"{name}: sealed")

    sys.addaudithook(hook)
