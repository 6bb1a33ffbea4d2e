"""The look of every figure: colours that survive colour blindness, units on axes, bands drawn as bands."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe & Ito (2008), in the order of use.
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, YELLOW, BLACK = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#222222")
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
GREY = "#8A8A8A"


@contextmanager
def look() -> Iterator[None]:
    """Draw in the package's look inside a `with` block; the user's own settings are untouched outside it."""
    import matplotlib as mpl
    from cycler import cycler

    settings: Any = {
        "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.25,
        "grid.linewidth": 0.6, "lines.linewidth": 1.4, "legend.frameon": False, "figure.constrained_layout.use": True,
        "axes.titlesize": 10, "axes.titleweight": "bold", "savefig.dpi": 130, "svg.fonttype": "none",
        "axes.prop_cycle": cycler(color=COLOURS)}
    with mpl.rc_context(settings):
        yield


def figure(rows: int = 1, columns: int = 1, *, size: tuple[float, float] | None = None,
           share_x: bool = False) -> "tuple[Figure, np.ndarray]":
    """Return a figure in the package's look and its axes, shape (rows, columns).

    `size`: width and height [inch]; by default 3.4 by 2.5 for each panel. `share_x`: share the horizontal axis along
    each column.
    """
    from matplotlib import pyplot as plt

    with look():
        return plt.subplots(rows, columns, figsize=size or (3.4 * columns + 0.6, 2.5 * rows + 0.4), squeeze=False,
                            sharex="col" if share_x else False)


def literal(text: str) -> str:
    """Return text that matplotlib does not read as mathematics; half a surrogate pair becomes its escape."""
    return text.encode("utf-8", "backslashreplace").decode().replace("$", r"\$")


def band(axes: "Axes", x: ArrayLike, lower: ArrayLike, upper: ArrayLike, colour: str, label: str | None = None) -> None:
    """Draw an uncertainty band between two curves."""
    axes.fill_between(np.asarray(x), np.asarray(lower), np.asarray(upper), color=colour, alpha=0.22, linewidth=0,
                      label=label)
