"""A plan as text, picture and files: what each test shows, what the plan tells apart."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.arrays import FloatArray
from radiation_ss.atomic import folder_written_whole, write_whole
from radiation_ss.design.isolability import SHOWN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss import TestPlan


def save(plan: TestPlan, folder: str | Path) -> None:
    """Write plan.json and plan.png."""
    with folder_written_whole(folder) as out:
        write_whole(out / "plan.json", json.dumps(plan.to_dict(), indent=1))
        plot_plan(plan).savefig(out / "plan.png")


@style.look()
def plot_plan(plan: TestPlan) -> Figure:
    """Draw standard deviations of each effect in each test, and of each effect beside each other in the plan."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    k, rows = len(plan.labels), len(plan.tests) + 1
    figure, axes = style.figure(2, 1, size=(3.4 + 0.46 * k, 2.6 + 0.24 * rows + 0.27 * k))
    # White at the threshold of 5 standard deviations: above it blue, below it red.
    shades = LinearSegmentedColormap.from_list("seen", [style.VERMILION, "#FFFFFF", style.BLUE])
    norm = LogNorm(SHOWN / 20.0, SHOWN * 20.0)
    marks = {name: f"{position}." for position, name in enumerate(plan.chosen, 1)}
    names = [f"{test.name}   {marks.get(test.name, '')}".rstrip() for test in plan.tests]
    labels = short_labels(plan.labels)
    table(axes[0, 0], np.vstack([plan.single, plan.detectability]), [*names, "the plan together"], labels, shades, norm)
    for label, test in zip(axes[0, 0].get_yticklabels(), [*plan.tests, None]):
        label.set_fontweight("bold" if test is None or test.name in marks else "normal")
    axes[0, 0].set_title("How clearly each test alone shows\neach effect (tests to do: 1., 2., ...)", loc="left")
    beside = plan.separation.copy()
    np.fill_diagonal(beside, np.nan)
    table(axes[1, 0], beside, labels, labels, shades, norm)
    axes[1, 0].set_title("The plan: what is left of the row's\neffect beside the column's", loc="left")
    bar = figure.colorbar(ScalarMappable(norm, shades), ax=axes[:, 0], shrink=0.4, pad=0.02,
                          label="standard deviations; red: cannot be seen or told apart")
    bar.set_ticks([0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0], labels=["0.5", "1", "2", "5", "10", "20", "50", "100"])
    return figure


def table(axis: Axes, values: FloatArray, rows: list[str] | tuple[str, ...], columns: tuple[str, ...], shades: object,
          norm: object) -> None:
    """Draw a table of numbers on colours."""
    axis.imshow(np.clip(values, SHOWN / 20.0, SHOWN * 20.0), cmap=shades, norm=norm, aspect="auto")  # type: ignore[arg-type]
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            strong = value > 35.0 or value < 0.6
            axis.text(j, i, short(value), ha="center", va="center", fontsize=6.5,
                      color="white" if strong else style.BLACK)
    axis.set_yticks(range(len(rows)), [plain(name) for name in rows], fontsize=7.5)
    axis.set_xticks(range(len(columns)), [plain(name) for name in columns], rotation=40, ha="right",
                    rotation_mode="anchor", fontsize=7.5)
    axis.grid(False)
    axis.tick_params(length=0)
    for side in axis.spines.values():
        side.set_visible(False)


def short_labels(labels: tuple[str, ...]) -> tuple[str, ...]:
    """Return labels without the degree of freedom where there is only one."""
    places = {label.partition(" on ")[2] for label in labels} - {""}
    return tuple(label.partition(" on ")[0] for label in labels) if len(places) == 1 else labels


def plain(label: str) -> str:
    """Return a label without underscores."""
    return style.literal(label.replace("_", " "))


def short(value: float) -> str:
    """Return a number of at most three characters."""
    return f"{value:.1f}" if value < 9.95 else f"{min(value, 999.0):.0f}"


def text(plan: TestPlan) -> str:
    """Return the plan as a table."""
    pairs = len(plan.labels) * (len(plan.labels) - 1) // 2
    wide = max(len(test.name) for test in plan.tests) + 2
    lines = [f"Tests for {plan.name}: the whole menu shows {plan.reachable[0]} of {len(plan.labels)} effects and tells "
             f"{plan.reachable[1]} of {pairs} pairs apart.", "", f"{'to do':{wide + 3}s} seen  apart  shows first"]
    for k, step in enumerate(plan.steps, 1):
        new = wrap(", ".join(step.adds) or "none, tells more apart", 60)
        lines.append(f"{k:2d} {step.test:{wide}s} {step.seen:4d}  {step.apart:5d}  {new[0]}")
        lines += [" " * (wide + 17) + more for more in new[1:]]
    about = {test.name: test.description for test in plan.tests}
    lines += ["", *(f"   {name}: {about[name]}" for name in plan.chosen), "",
              f"{'each test alone':{wide + 3}s} seen  apart"]
    lines += [f"   {test.name:{wide}s} {seen:4d}  {apart:5d}" for test, (seen, apart) in zip(plan.tests, plan.alone)]
    lines += ["", f"{'effect':44s} {'sd':>7s}  {'beside its closest rival':>7s}"]
    beside = plan.separation + np.diag(np.full(len(plan.labels), np.inf))
    for i, label in enumerate(plan.labels):
        rival = int(np.argmin(beside[i]))
        lines.append(f"{label:44s} {plan.detectability[i]:7.1f}  {plan.separation[i, rival]:7.1f}  "
                     f"{plan.labels[rival] if rival != i else ''}".rstrip())
    lines += ["", "inseparable by any of these tests:"]
    lines += [f"   {' / '.join(c.pair)}: {c.why}" for c in plan.confounded] or ["   none"]
    lines += ["shown by none of these tests:"]
    return "\n".join(lines + ([f"   {u.effect}: {u.why}" for u in plan.unseen] or ["   none"]))
