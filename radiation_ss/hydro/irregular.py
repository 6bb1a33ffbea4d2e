"""What is found in coefficients, and the narrow features among it: irregular frequencies, spikes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.hydro.data import HydroData, mode
from radiation_ss.hydro.measures import bands, named, pair, percent

KINDS = ("irregular frequency", "negative damping", "asymmetry", "Kramers-Kronig", "A_inf offset", "A_inf missing",
         "spike", "coarse band", "short band", "late band", "silent mode")
Bands = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    problem : bool
        True if a model made from the data inherits an error of this size; False for a remark.
    value : float
        Its size, relative to the largest value of its curve.
    bands : tuple of (float, float)
        Where [rad/s].
    dofs : tuple of str
    message : str
    """

    kind: str
    problem: bool
    value: float
    bands: Bands
    dofs: tuple[str, ...]
    message: str


def narrow(data: HydroData, rough: FloatArray, residual: FloatArray, smallest: FloatArray,
           tolerance: float) -> Iterator[Finding]:
    """Name narrow features: those that no causal, passive body has are irregular frequencies of the panel method."""
    size = rough.max(axis=(1, 2))
    broken = np.maximum(np.abs(residual).max(axis=(1, 2)), -smallest)
    irregular, low = [], _lowest_irregular(data)
    for first, last in bands(data.omega, size > tolerance):
        here = np.flatnonzero((data.omega >= first) & (data.omega <= last))
        near = slice(max(here[0] - 2, 0), here[-1] + 3)
        if broken[near].max() > tolerance or (low is not None and data.omega[here[size[here].argmax()]] > low):
            irregular.append(here)
            continue
        k, i, j = (int(v) for v in np.unravel_index(rough[here].argmax(), rough[here].shape))
        worst = float(rough[here][k, i, j])
        yield Finding("spike", worst > 2.0 * tolerance, worst, ((first, last),), pair(data, i, j),
                      f"{named(data, i, j)} leaves its neighbours by {percent(worst)} at {data.omega[here[k]]:.3g} "
                      "rad/s, with no harm to Kramers-Kronig: a mode of enclosed water (gap, moonpool), or an "
                      "irregular frequency of the panels")
    if not irregular:
        return
    places = np.concatenate(irregular)
    k, i, j = (int(v) for v in np.unravel_index(rough[places].argmax(), rough[places].shape))
    worst = float(rough[places][k, i, j])
    peaks = _peaks(size, places)
    more = f" and {len(peaks) - 12} more" if len(peaks) > 12 else ""
    at = ", ".join(f"{w:.3g}" for w in data.omega[peaks[:12]]) + more
    yield Finding("irregular frequency", worst > 2.0 * tolerance, worst,
                  tuple((float(data.omega[here[0]]), float(data.omega[here[-1]])) for here in irregular),
                  pair(data, i, j), f"at {at} rad/s A and B leave their neighbours, by up to {percent(worst)} "
                  f"({named(data, i, j)} at {data.omega[places[k]]:.3g} rad/s), as no causal and passive body does: "
                  "irregular frequencies of the panel method, a wrong value, or a resonance of enclosed water finer "
                  "than the steps. Compute again with a lid (WAMIT: IRR) or finer steps; data.clean(spikes=True) "
                  "leaves them out")


def _lowest_irregular(data: HydroData) -> float | None:
    """Return the frequency [rad/s] that irregular ones lie above, and a moonpool's piston mode below; None if unknown.

    Irregular frequencies are those of the water inside the body, closed at its hull: of a wall-sided one w^2 = g k
    coth(k T), above g / T for any k. The draught T is the displaced volume over the waterplane.
    """
    heave = [i for i, dof in enumerate(data.dofs) if mode(dof) == "Heave"]
    if data.M is None or data.C is None or len(heave) != 1:
        return None
    mass, stiffness = data.M[heave[0], heave[0]], data.C[heave[0], heave[0]]
    return float(np.sqrt(stiffness / mass)) if mass > 0.0 and stiffness > 0.0 else None


def _peaks(size: FloatArray, places: np.ndarray) -> list[int]:
    """Return the places that are larger than the two on either side, ascending."""
    return [int(k) for k in np.sort(places) if size[k] >= size[max(k - 2, 0):k + 3].max()]
