"""Rows of WAMIT's files as arrays, and what their first column is: a period, frequency, wavenumber or wavelength."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.transforms import added_mass_from_damping

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


READINGS = ("period", "omega", "wavenumber", "deep_wavenumber", "wavelength")


def to_omega(column: FloatArray, reading: str, g: float, depth: float, length: float) -> FloatArray:
    """Return circular frequencies [rad/s].

    A period or wavelength 0 is w = inf and a negative one w = 0; for frequencies and wavenumbers the reverse.
    `wavenumber` is that of the water's depth, `deep_wavenumber` w^2 / g; both are multiplied by WAMIT's length scale.
    """
    if reading not in READINGS:
        raise InputError(f"first_column: {reading!r} is none of {list(READINGS)}")
    inverse = reading in ("period", "wavelength")
    size = np.abs(column)
    with np.errstate(divide="ignore"):
        k = 2.0 * np.pi / size if inverse else size / length
    if reading == "omega":
        omega = size
    elif reading == "period":
        omega = k
    else:
        finite = np.isfinite(k)
        deep = reading == "deep_wavenumber" or np.isinf(depth)
        share = np.ones_like(k) if deep else np.tanh(np.where(finite, k, 1.0) * depth)
        omega = np.sqrt(g * k * np.where(finite, share, 1.0))
    return np.where(column < 0.0, 0.0 if inverse else np.inf, omega)


def recognise(rows: Radiation, g: float, depth: float, length: float, clear: float = 5.0) -> tuple[str, str]:
    """Return the reading of the first column under which A and B satisfy Kramers-Kronig, and a note ('' if none).

    It is a period, as WAMIT writes by default, unless another reading leaves at most 1/`clear` of the residual.
    """
    column = rows.period
    inside = column > 0.0
    if inside.sum() < 8:
        return "period", (f"first column taken as a period: {int(inside.sum())} frequencies are too few to tell it "
                          "from others (option first_column=)")
    residual = {}
    for reading in READINGS:
        if reading != "deep_wavenumber" or np.isfinite(depth):
            omega = to_omega(column[inside], reading, g, depth, length)
            residual[reading] = _residual(omega, rows.A[inside], rows.B[inside])
    best = min(residual, key=lambda reading: residual[reading])
    if not clear * residual[best] < residual["period"]:
        return "period", ""
    return best, (f"first column taken as {best}: added mass and damping then satisfy Kramers-Kronig within "
                  f"{100 * residual[best]:.2g} % of the change of the added mass, as a period within "
                  f"{100 * residual['period']:.2g} % (option first_column=)")


def _residual(omega: FloatArray, A: FloatArray, B: FloatArray) -> float:
    """Return the median over frequencies and modes of |A - A_inf - (what B implies)|, relative to the range of A."""
    order = np.argsort(omega)
    w, mass = omega[order], np.einsum("kii->ki", A[order])
    damping = np.einsum("kii->ki", B[order]) * w[:, None]
    radiates = np.ptp(mass, axis=0) > 1e-3 * np.abs(mass).max(axis=0)
    if not radiates.any() or not (np.diff(w) > 0.0).all():
        return np.inf
    implied = added_mass_from_damping(w, damping[:, None, radiates])[:, 0]
    middle = (w > w[0]) & (w < 0.9 * w[-1])
    off = (mass[:, radiates] - implied)[middle]
    return float(np.median(np.abs(off - np.median(off, axis=0)) / np.ptp(mass[:, radiates], axis=0)))
