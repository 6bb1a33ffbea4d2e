"""Names of records as names of files."""

from __future__ import annotations

import hashlib
import re

LONGEST = 120  # characters of a stem; file systems take 255 bytes with suffixes
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE | re.ASCII)  # names of devices on Windows


def file_name(name: str) -> str:
    """Return a file's stem for any name: safe on every system, different for different names.

    Letters, digits, `_`, `-` and inner points stay; every other character becomes `=` and two hexadecimal digits for
    each byte of its UTF-8 form. A stem of more than 120 characters is cut and ends in a digest; all others can be
    turned back by `name_of_file`. Names that differ in capitals alone are one file on a system that does not tell them
    apart.

    Examples
    --------
    >>> file_name("run 7"), file_name("Welle/ö")
    ('run=207', 'Welle=2F=C3=B6')
    >>> name_of_file(file_name("a/b$"))
    'a/b$'
    """
    stem = "".join(c if c.isascii() and (c.isalnum() or c in "_-.") else _escaped(c) for c in name)
    if stem[:1] in ("", ".", "-") or _RESERVED.match(stem):
        stem = _escaped(name[:1]) + stem[1:] if name else "="
    if stem.endswith("."):
        stem = stem[:-1] + _escaped(".")
    if len(stem) <= LONGEST:
        return stem
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    return f"{stem[:LONGEST - 20]}=={digest}"


def _escaped(text: str) -> str:
    return "".join(f"={byte:02X}" for byte in text.encode("utf-8", "surrogatepass"))


def name_of_file(stem: str) -> str:
    """Return the name whose `file_name` is this stem; of one that was cut, what is left of it.

    Examples
    --------
    >>> name_of_file("run=207")
    'run 7'
    """
    if stem == "=":
        return ""
    whole, cut, _ = stem.partition("==")
    raw = re.sub(rb"=([0-9A-F]{2})", lambda match: bytes([int(match[1], 16)]), whole.encode())
    return raw.decode("utf-8", "replace" if cut else "surrogatepass")
