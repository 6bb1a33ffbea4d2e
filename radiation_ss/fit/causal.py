"""What of K no causal body has, by Kramers-Kronig, and the size of what one has."""

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.spikes import spikes
from radiation_ss.hydro.data import RIGID, HydroData, body, mode, motion_unit
from radiation_ss.hydro.narrow import nearby
from radiation_ss.hydro.transforms import added_mass_from_damping, beside_implied, fit_tail


def scales(data: HydroData, silence: float = 1e-5) -> FloatArray:
    """Return s_i = sqrt(max_w |K_ii|), shape (n,); infinite, which leaves it out, where a motion does not radiate.

    Spikes that are not causal do not count: beside one all else would be nothing. Below `silence` of the largest of the
    translations, or of the rotations, of the same body K is numerical noise.
    """
    size = np.where(wrong_values(data) > 0.0, 0.0, np.abs(np.einsum("wii->wi", data.K))).max(axis=0)
    rigid = [mode(dof) in RIGID for dof in data.dofs]
    kinds = [(body(dof), motion_unit(dof) if own else dof) for dof, own in zip(data.dofs, rigid)]
    largest = np.array([max(other for other, same in zip(size, kinds) if same == kind) for kind in kinds])
    return np.where(size > silence * largest, np.sqrt(size), np.inf)


def not_causal(data: HydroData, within: float = 0.1) -> FloatArray:
    """Return how much of each |K| no causal body has, over s_i s_j, (nw, n, n): what breaks Kramers-Kronig, and spikes.

    One spike of B breaks it everywhere: the rest is judged with these bridged. `within`: accuracy of the relation for
    samples of a band that ends. K is the mean of it and its transpose.
    """
    off, size = wrong_values(data), scales(data)
    either = np.maximum((off / size**2)[:, :, None], (off / size**2)[:, None, :])
    A, B = (0.5 * (part + np.swapaxes(part, 1, 2)) for part in (data.A, data.B))
    for i, j in np.argwhere(either.any(axis=0)):
        there = either[:, i, j] == 0.0
        for values in (A, B) if there.any() else ():
            values[~there, i, j] = np.interp(data.omega[~there], data.omega[there], values[there, i, j])
    return np.maximum(either, nearby(broken(data.omega, A, B), 1) / np.outer(size, size) - within)


def wrong_values(data: HydroData, causal: float = 0.5) -> FloatArray:
    """Return how far each K_ii is off its neighbours, (nw, n), where a spike breaks Kramers-Kronig, else 0.

    Near it K breaks it by a share `causal` of the spike at least: a body's own peak, however narrow, does not. Smaller
    spikes are found beside larger ones.
    """
    A, B = (np.einsum("wii->wi", part)[:, :, None] for part in (data.A, data.B))
    near, found = nearby(broken(data.omega, A, B, True), 2)[:, :, 0], np.zeros((data.omega.size, data.n))
    for i in range(data.n):
        K, off = data.K[:, i, i], found[:, i]
        while (size := np.abs(K[off == 0.0]).max(initial=0.0)) > 0.0:
            apart = size * spikes(data.omega, K / size)
            new = (off == 0.0) & (apart > 0.0) & (near[:, i] > causal * apart)
            off[new] = apart[new]
            if not new.any():
                break
    return found


def together(off: NDArray[np.bool_]) -> FloatArray:
    """Return how many samples in a row, along the first axis, a sample belongs to that is off; 1 of the others."""
    count = np.cumsum(off, axis=0)
    before = np.maximum.accumulate(np.where(off, 0, count), axis=0)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(off, count[-1:], count), axis=0), axis=0), axis=0)
    return np.maximum(after - before, 1).astype(np.float64)


def broken(omega: FloatArray, A: FloatArray, B: FloatArray, spiky: bool = False, fewest: int = 8) -> FloatArray:
    """Return how much of each |K| breaks Kramers-Kronig, of the shape (nw, ..., ...) of A; 0 of less than `fewest`.

    It is w |A - A_inf - what B implies| beyond what is unsure of that: what the damping above the band may add, by the
    share of all damping that lies there, everything where that is most of it and shows no decay; and, but for `spiky`
    data, the change by every second sample alone, large where a peak is as narrow as the steps.
    """
    if omega.size < fewest:
        return np.zeros_like(A)
    beside, _ = beside_implied(omega, A, B)
    implied, tail = added_mass_from_damping(omega, B), fit_tail(omega, B)
    above = implied - added_mass_from_damping(omega, B, tail=False)
    unsure = np.abs(above - np.median(above, axis=0)) / (1.0 - tail.share)
    unsure = np.where(~tail.fitted & (tail.share > 0.5), np.inf, unsure)
    for first in range(0 if spiky else 2):
        unsure[first::2] += np.abs(implied[first::2] - added_mass_from_damping(omega[first::2], B[first::2]))
    return np.asarray(omega[:, None, None] * np.maximum(np.abs(beside) - unsure, 0.0))
