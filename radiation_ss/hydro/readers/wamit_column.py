"""The first column of WAMIT's .1 and .3: a period, frequency, wavenumber or wavelength; the file does not say which."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.readers.wamit_tables import Radiation
from radiation_ss.hydro.transforms import added_mass_from_damping

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
