"""Resonances just above the band: irregular frequencies of the panel method whose beginning is in the data."""

from collections.abc import Iterator

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.findings import Finding
from radiation_ss.hydro.measures import percent


def beyond_band(omega: FloatArray, K: ComplexArray, share: float = 0.2, near: float = 0.1, floor: float = 0.05,
                exact: float = 0.2) -> tuple[float, FloatArray]:
    """Return the frequency nu [rad/s] of a resonance just above the band, and its part r / (nu - w) of Im K, (nw,).

    NaN and zeros where there is none. Over the last `share` of the band w (A - A_inf) of a body is c / w; the sum of
    both, linear in nu, r - c and c nu once multiplied by w (nu - w), must hold to `exact` of the part at the band's
    end, which must be above `floor` of the largest |K|, with nu within `near` of the end.
    """
    x, y = omega / omega[-1], K.imag / max(float(np.abs(K).max()), 1e-300)
    last = x > 1.0 - share
    w, end = x[last], y[last]
    if w.size < 8:
        return np.nan, np.zeros(omega.size)
    rows = np.stack([end * w, -w, -np.ones(w.size)], axis=1)
    nu, r_less_c, c_nu = np.linalg.lstsq(rows, end * w**2, rcond=None)[0]
    if not 1.0 < nu < 1.0 + near:
        return np.nan, np.zeros(omega.size)
    part = (r_less_c + c_nu / nu) / (nu - x)
    off = np.abs(end - part[last] - c_nu / nu / w).max()
    if part[-1] < floor or off > exact * part[-1]:
        return np.nan, np.zeros(omega.size)
    return float(nu * omega[-1]), np.where(part > floor, part, 0.0)


def above(data: HydroData, silent: np.ndarray, tolerance: float) -> Iterator[Finding]:
    """Name resonances just above the band, whose beginning is in it."""
    if data.A_inf is None:
        return
    found = {i: beyond_band(data.omega, data.K[:, i, i]) for i in np.flatnonzero(~silent)}
    found = {i: run for i, run in found.items() if run[1].any()}
    if not found:
        return
    end, most = float(data.omega[-1]), max(float(part[-1]) for _, part in found.values())
    first = min(float(data.omega[np.flatnonzero(part)[0]]) for _, part in found.values())
    each = ", ".join(f"{data.dofs[i]} {nu:.3g} rad/s ({percent(float(part[-1]))})" for i, (nu, part) in found.items())
    yield Finding("irregular frequency", most > 2.0 * tolerance, most, ((first, end),),
                  tuple(data.dofs[i] for i in found), f"towards {end:.3g} rad/s, where the band ends, K rises as to a "
                  f"resonance just above it: {each} of the largest |K|: an irregular frequency of the panel method, or "
                  "enclosed water. Compute again with a lid (WAMIT: IRR), or leave the last frequencies out")
