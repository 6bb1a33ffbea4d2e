"""A small set of tests that does what a whole menu does: greedy, then without what it does not need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.design.information import Information
from radiation_ss.design.programme import PlannedTest
from radiation_ss.design.words import APART, SHOWN


def counts(information: Information, chosen: Sequence[int]) -> tuple[int, int, float]:
    """Return effects seen, pairs told apart, and the same without a threshold: what makes greedy steps go on."""
    size, left = information.detectability(chosen), information.separation(chosen)
    pairs = np.minimum(left, left.T)[np.triu_indices(size.size, 1)]
    smooth = np.minimum(size / SHOWN, 1.0).sum() + np.minimum(pairs / APART, 1.0).sum()
    return int((size >= SHOWN).sum()), int((pairs >= APART).sum()), float(smooth)


def rank(information: Information, chosen: Sequence[int]) -> tuple[int, float]:
    """Return what sets are compared by; small differences leave the choice to the menu's order, simple tests first."""
    seen, apart, smooth = counts(information, chosen)
    return seen + apart, round(smooth, 1)


def needed(information: Information, menu: Sequence[PlannedTest], whole: Sequence[int]) -> list[int]:
    """Return tests that do what the whole menu does; none can be left out, or replaced by one earlier on the menu."""
    goal, chosen = rank(information, whole)[0], list[int]()
    while not chosen or (rank(information, chosen)[0] < goal and len(chosen) < len(whole)):
        chosen = max((with_test(menu, chosen, k) for k in range(len(menu)) if k not in chosen),
                     key=lambda some: rank(information, some))
    goal = rank(information, chosen)[0]
    for k in list(chosen):
        rest = [other for other in chosen if other != k]
        taken = [id(menu[other].record) for other in rest]
        simpler = [[*rest, other] for other in range(k) if id(menu[other].record) not in taken]
        for some in ([rest] if rest else []) + simpler:
            if rank(information, some)[0] >= goal:
                chosen = some
                break
    return chosen


def with_test(menu: Sequence[PlannedTest], chosen: Sequence[int], k: int) -> list[int]:
    """Return the set with a test more; the same run with other sensors is not done twice."""
    return [*(other for other in chosen if menu[other].record is not menu[k].record), k]


def in_order(information: Information, chosen: Sequence[int]) -> list[list[int]]:
    """Return the growing sets, the most telling test first."""
    sets: list[list[int]] = [[]]
    while len(sets[-1]) < len(chosen):
        left = [k for k in chosen if k not in sets[-1]]
        sets.append(max(([*sets[-1], k] for k in left), key=lambda some: rank(information, some)))
    return sets[1:]
