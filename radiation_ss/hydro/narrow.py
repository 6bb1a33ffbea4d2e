"""Narrow features of A and B: irregular frequencies of the panel method, wrong values, and a body's own peaks."""

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from radiation_ss.arrays import FloatArray, lagrange
from radiation_ss.hydro.data import HydroData, mode
from radiation_ss.hydro.findings import Finding
from radiation_ss.hydro.measures import bands, damping_scale, mass_scale, named, pair, percent, scaled, worst


def roughness(data: HydroData) -> FloatArray:
    """Return how far A and B, scaled, leave their neighbours, shape (nw, n, n); see `narrow_features`."""
    damping, silent = damping_scale(data)
    return np.maximum(narrow_features(data.omega, scaled(data.B, damping)),
                      narrow_features(data.omega, scaled(data.A, mass_scale(data, silent))))


def narrow_features(omega: FloatArray, curves: FloatArray, width: float = 0.02, coarse: float = 0.3) -> FloatArray:
    """Return how far each point lies off the cubic through two neighbours on either side, shape of `curves`.

    Neighbours are taken at several strides, up to a `width` relative to the frequency; of the strides the largest
    departure counts. What a smooth curve shows at this spacing (its median departure nearby) is taken off. Between
    neighbours farther apart than a share `coarse` of the frequency a body's own peak, half as wide as its frequency is
    high, leaves its cubic by some hundredths: nothing is said there.
    """
    departure = np.zeros_like(curves)
    n = omega.size
    stride = 1
    while 4 * stride < n:
        k = np.arange(2 * stride, n - 2 * stride)
        apart = omega[k + stride] - omega[k - stride]
        k = k[apart < (coarse if stride == 1 else 2.0 * width) * omega[k]]
        if k.size == 0:
            break
        beside = k[:, None] + stride * np.array([-2, -1, 1, 2])
        x = omega[beside] - omega[k, None]
        cubic = np.einsum("kj,kj...->k...", lagrange(x, np.zeros(k.size)), curves[beside])
        # The cubic overshoots next to a spike: it counts only where the chord is left as well.
        chord = (x[:, 2, None, None] * curves[k - stride] - x[:, 1, None, None] * curves[k + stride]) / (
            x[:, 2] - x[:, 1])[:, None, None]
        size = np.minimum(np.abs(curves[k] - cubic), np.abs(curves[k] - chord))
        nearby = np.arange(k.size)[:, None] + stride * np.arange(-10, 11)
        usual = np.median(size[np.clip(nearby, 0, k.size - 1)], axis=1)
        departure[k] = np.maximum(departure[k], np.maximum(size - 4.0 * usual, 0.0))
        stride *= 2
    return departure


def nearby(values: FloatArray, reach: int) -> FloatArray:
    """Return the largest of values (nw, ...) up to some samples to either side; 0 beyond the ends."""
    padded = np.pad(values, [(reach, reach), *[(0, 0)] * (values.ndim - 1)])
    return np.asarray(sliding_window_view(padded, 2 * reach + 1, axis=0).max(axis=-1))


def not_of_a_body(data: HydroData, rough: FloatArray, residual: FloatArray, smallest: FloatArray,
                  tolerance: float, causal: float = 0.3) -> FloatArray:
    """Return the narrow features (nw, n, n) that no causal, passive body has, 0 elsewhere.

    Near them damping is negative, or the entry breaks Kramers-Kronig by `tolerance` and by a share `causal` of the
    feature: a body's own peak, however narrow, does not. Or they lie where irregular frequencies are.
    """
    near, negative = nearby(np.abs(residual), 2), nearby(-smallest, 2) > tolerance
    low = _lowest_irregular(data)
    beyond = np.zeros(data.omega.size, dtype=bool) if low is None else data.omega > low
    return np.where(((near > tolerance) & (near > causal * rough)) | (negative | beyond)[:, None, None], rough, 0.0)


def narrow(data: HydroData, rough: FloatArray, residual: FloatArray, smallest: FloatArray,
           tolerance: float) -> Iterator[Finding]:
    """Name narrow features: those that no causal, passive body has are irregular frequencies of the panel method."""
    size, wrong = rough.max(axis=(1, 2)), not_of_a_body(data, rough, residual, smallest, tolerance).max(axis=(1, 2))
    irregular = []
    for first, last in bands(data.omega, size > tolerance):
        here = np.flatnonzero((data.omega >= first) & (data.omega <= last))
        if wrong[here].max() > tolerance:
            irregular.append(here)
            continue
        most, (k, i, j) = worst(rough[here])
        yield Finding("spike", most > 2.0 * tolerance, most, ((first, last),), pair(data, i, j),
                      f"{named(data, i, j)} is off its neighbours by {percent(most)} at {data.omega[here[k]]:.3g} "
                      "rad/s, with no harm to Kramers-Kronig: a peak of the body or of enclosed water (gap, moonpool), "
                      "narrow for these steps, or an irregular frequency of the panels")
    if not irregular:
        return
    places = np.concatenate(irregular)
    most, (k, i, j) = worst(rough[places])
    peaks = [int(k) for k in np.sort(places) if size[k] >= size[max(k - 2, 0):k + 3].max()]
    more = f" and {len(peaks) - 12} more" if len(peaks) > 12 else ""
    at = ", ".join(f"{w:.3g}" for w in data.omega[peaks[:12]]) + more
    yield Finding("irregular frequency", most > 2.0 * tolerance, most,
                  tuple((float(data.omega[here[0]]), float(data.omega[here[-1]])) for here in irregular),
                  pair(data, i, j), f"at {at} rad/s A and B leave their neighbours, by up to {percent(most)} "
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
