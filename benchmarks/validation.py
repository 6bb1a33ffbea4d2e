"""Put measured tables into the pages of docs/validation, between `<!-- name -->` and `<!-- end -->`."""

import argparse
import re
import subprocess
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def arguments(doc, page, **numbers):
    """Return from the command line whether to write the page's tables, and numbers of the types of their defaults."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"write its tables in docs/validation/{page}.md")
    for name, usual in numbers.items():
        parser.add_argument(f"--{name}", type=type(usual), default=usual)
    found = parser.parse_args()
    return (found.write, *(getattr(found, name) for name in numbers))


def table(header, rows):
    """Return a markdown table."""
    head, *lines = ("| " + " | ".join(str(cell) for cell in line) + " |" for line in (header, *rows))
    return "\n".join([head, "|---" * len(header) + "|", *lines])


def commit():
    """Return the short name of the commit that is checked out."""
    done = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def publish(page, write, **tables):
    """Print tables; with `write`, replace the sections of that name in docs/validation/<page>.md and stamp it."""
    tables["stamp"] = f"Measured {datetime.now(UTC):%Y-%m-%d} at commit {commit()}."
    path = ROOT / "docs" / "validation" / f"{page}.md"
    text = path.read_text(encoding="utf-8") if write else ""
    for name, content in tables.items():
        print(content, end="\n\n")
        text = re.sub(rf"(<!-- {name} -->\n).*?(<!-- end -->)", lambda m, c=content: f"{m[1]}{c}\n{m[2]}", text,
                      flags=re.DOTALL)
    if write:
        path.write_text(text, encoding="utf-8")
