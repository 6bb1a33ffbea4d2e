"""Rows of WAMIT's files as arrays: one entry for each period and pair of modes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError

MOST_MODES = 600
Entries = dict[tuple[int, int], tuple[float, float]]


class Radiation(NamedTuple):
    """Rows of a .1 file: period column, and for each period the entries (i, j) -> (A, B)."""

    period: FloatArray
    A: FloatArray
    B: FloatArray
    modes: list[int]


class Forces(NamedTuple):
    """Rows of a .3 file: period column, headings [deg], X [period, heading, mode]."""

    period: FloatArray
    heading: FloatArray
    X: ComplexArray


def matrices(path: Path, table: dict[float, Entries], last: int) -> Radiation:
    """Return arrays of the entries, which all periods must have alike; absent ones are zero by symmetry."""
    if not any(table.values()):
        raise InputError(f"{path}: no added mass in it")
    usual = Counter(frozenset(entries) for entries in table.values()).most_common(1)[0][0]
    for per, entries in table.items():
        if set(entries) != usual:
            raise InputError(f"{path}, up to line {last + 1}: first column {per:g} has {len(entries)} entries, the "
                             f"others {len(usual)}; the file is cut off or mixed")
    modes = sorted(i for i, j in usual if i == j)
    if not modes:
        raise InputError(f"{path}: no diagonal entry of the added mass in it")
    place = {m: k for k, m in enumerate(modes)}
    A = np.zeros((len(table), len(modes), len(modes)))
    B = np.zeros_like(A)
    for k, entries in enumerate(table.values()):
        for (i, j), (a, b) in entries.items():
            if i in place and j in place:
                A[k, place[i], place[j]], B[k, place[i], place[j]] = a, b
    return Radiation(np.array(list(table)), A, B, modes)


def force_array(path: Path, table: dict[tuple[float, float], dict[int, complex]], modes: list[int]) -> Forces:
    """Return X [period, heading, mode] of the entries; every period needs the same headings and modes."""
    if not table:
        raise InputError(f"{path}: no exciting force in it")
    periods, headings = list(dict.fromkeys(p for p, _ in table)), list(dict.fromkeys(h for _, h in table))
    usual = Counter(frozenset(entries) for entries in table.values()).most_common(1)[0][0]
    X = np.zeros((len(periods), len(headings), len(modes)), dtype=complex)
    for k, per in enumerate(periods):
        for h, heading in enumerate(headings):
            entries = table.get((per, heading), {})
            if set(entries) != usual:
                raise InputError(f"{path}: first column {per:g}, heading {heading:g} has {len(entries)} modes, the "
                                 f"others {len(usual)}; the file is cut off or mixed")
            X[k, h] = [entries.get(m, 0.0) for m in modes]
    return Forces(np.array(periods), np.array(headings), X)
