"""Put a measured table between the marks of a hand-written page."""

from __future__ import annotations

from pathlib import Path

START, END = "<!-- table: written by the benchmark -->", "<!-- end of table -->"


def write_table(page: Path, text: str, start: str = START, end: str = END) -> None:
    """Replace what stands between the marks of a page; ValueError if the page has none."""
    content = page.read_text(encoding="utf-8")
    before, marked, rest = content.partition(start)
    _, ended, after = rest.partition(end)
    if not marked or not ended:
        raise ValueError(f"{page}: the marks {start} and {end} are missing")
    page.write_text(f"{before}{start}\n\n{text.strip()}\n\n{end}{after}", encoding="utf-8")
