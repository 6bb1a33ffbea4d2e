"""One-file HTML pages: no network, readable in light and dark, all text escaped.

A page is a tuple of sections; a section is a heading and blocks (Verdict, Text, Table, Picture, Points).
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss import style
from radiation_ss.atomic import write_whole
from radiation_ss.errors import RadiationError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Verdict:
    """The result in one sentence. tone: 'good', 'warn', 'bad' or 'plain'."""

    sentence: str
    tone: str = "plain"
    detail: str = ""


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Points:
    """A list of short statements."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """A table; numbers should come formatted. The first column is the row's name."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure, embedded as SVG; `alt` says what a reader who cannot see it should know."""

    figure: Figure
    caption: str
    alt: str = ""

    @cached_property
    def data(self) -> str:
        """The picture as a data URI; drawn once, also where several pages show it."""
        return "data:image/svg+xml;base64," + b64encode(svg(self.figure)).decode("ascii")


def svg(figure: Figure) -> bytes:
    """Return a figure as an SVG document."""
    raw = BytesIO()
    with style.look():
        figure.savefig(raw, format="svg", facecolor="white", metadata={"Date": None})
    return raw.getvalue()


Block = Verdict | Text | Points | Table | Picture


@dataclass(frozen=True)
class Part:
    """A heading and what stands under it."""

    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """A whole page."""

    title: str
    sections: Sequence[Part]
    subtitle: str = ""
    footer: str = ""


def brief(text: str, lines: int = 10, width: int = 100) -> str:
    """Return a text broken at `width` characters and cut at `lines` lines; the last says how many are left out."""
    broken = [part for line in text.splitlines()
              for part in wrap(line, width, subsequent_indent="    ", drop_whitespace=True) or [""]]
    left = len(broken) - lines + 1
    return "\n".join(broken if left < 2 else [*broken[:lines - 1], f"... {left} more lines: print() shows all"])


def png(figure: Figure, colours: int = 32, dpi: int = 100) -> bytes:
    """Return a figure as a PNG of few colours."""
    from PIL import Image

    raw, out = BytesIO(), BytesIO()
    with style.look():
        figure.savefig(raw, format="png", facecolor="white", dpi=dpi)
    Image.open(raw).convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(out, "png", optimize=True)
    return out.getvalue()


def fragment(item: Any, largest: int = 150_000) -> str:
    """Return a result for a notebook: its text's first lines, and its picture, as PNG above `largest` letters."""
    html = f"<pre>{escape(brief(str(item)))}</pre>"
    try:
        figure = item.plot()
    except RadiationError:  # a fit that was read from a file without its data, a diagnosis without predictions
        return html
    drawing = svg(figure).decode()
    drawing = drawing[drawing.index("<svg"):]
    if len(drawing) > largest:
        drawing = f'<img alt="" src="data:image/png;base64,{b64encode(png(figure)).decode()}">'
    close(figure)
    return html + drawing


def render(page: Page) -> str:
    """Return the page as one HTML document."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(loader=PackageLoader("radiation_ss", "page"), autoescape=True, undefined=StrictUndefined,
                              trim_blocks=True, lstrip_blocks=True)
    return environment.get_template("page.html").render(page=page)


def write(page: Page, path: str | Path) -> Path:
    """Write the page to a file, close its figures and return the path."""
    place = Path(path)
    write_whole(place, render(page))
    close_figures(page)
    return place


def close_figures(page: Page) -> None:
    """Close the page's figures, so that a long session does not collect them."""
    close(*(block.figure for section in page.sections for block in section.blocks if isinstance(block, Picture)))


def close(*figures: Figure) -> None:
    """Close figures."""
    from matplotlib import pyplot as plt

    for figure in figures:
        plt.close(figure)


def number(value: Any, digits: int = 3, unit: str = "") -> str:
    """Format a number for a table: `digits` significant digits, a dash where there is none."""
    if value is None or value != value:  # NaN is the only value that differs from itself
        return "–"
    size = abs(float(value))
    if size and not 1e-4 <= size < 1e7:
        text = f"{float(value):.{digits}g}"
    else:
        text = np.format_float_positional(float(value), precision=digits, fractional=False, trim="-")
    return f"{text} {unit}".strip()


def with_error(value: float, deviation: float, unit: str = "") -> str:
    """Format a value and its standard deviation to the same decimal place, two digits of the deviation."""
    largest = max(abs(value), abs(deviation))
    if not (np.isfinite(largest) and largest and deviation > 0.0):
        return number(value, 3, unit)
    power = int(np.floor(np.log10(largest)))
    power = 0 if -4 <= power < 6 else power
    value, deviation = value / 10.0**power, deviation / 10.0**power
    places = int(np.clip(1 - np.floor(np.log10(deviation)), 0, 9))
    text = f"{value:.{places}f} ± {deviation:.{places}f}"
    return f"{f'({text})e{power}' if power else text} {unit}".strip()
