"""Samples that leave their neighbours by more than the curve shows nearby: irregular frequencies, wrong values."""

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray, lagrange


def spikes(omega: FloatArray, K: ComplexArray, reach: int = 4, deviations: float = 6.0,
            floor: float = 0.02, step: float = 0.8) -> FloatArray:
    """Return how far each sample lies off the line through its neighbours where that is a spike, else 0.

    A spike is off by `deviations` robust standard deviations (Hampel's test over `reach` neighbours on each side, so
    that slopes and peaks pass) and by `floor` of the largest value, in the real or the imaginary part; and no
    neighbour is off by more than `step` of it.
    """
    apart = np.zeros(omega.size)
    if omega.size < 2 * reach + 1:
        return apart
    share = (omega[1:-1] - omega[:-2]) / (omega[2:] - omega[:-2])
    for values in (K.real, K.imag):
        off = np.zeros(values.size)
        off[1:-1] = values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(off, reach, mode="reflect"), 2 * reach + 1)
        deviation = 1.4826 * np.median(np.abs(windows - np.median(windows, axis=1, keepdims=True)), axis=1)
        # The line through the neighbours of a spike is off by half the spike on both sides: keep the largest only.
        # At a step two neighbours are off by as much, to opposite sides; that is no spike.
        largest = np.abs(windows).argmax(axis=1) == reach
        beside = np.maximum(np.abs(windows[:, reach - 1]), np.abs(windows[:, reach + 1]))
        spike = largest & (np.abs(off) > deviations * deviation) & (np.abs(off) > floor)
        spike &= beside < step * np.abs(off)
        apart = np.maximum(apart, np.where(spike, np.abs(off), 0.0))
    for k in np.flatnonzero(apart):
        _add_flanks(apart, omega, K, int(k), deviations, floor)
    return apart


def _add_flanks(apart: FloatArray, omega: FloatArray, K: ComplexArray, spike: int, deviations: float,
                floor: float, narrow: float = 0.5) -> None:
    """Add to `apart` the samples next to a spike that belong to it: an irregular frequency decays as 1 / |w - w0|.

    They are off the cubic through two samples on either side of what is taken out by `floor`, and by `deviations`
    robust standard deviations of what is as wide nearby. At a distance d a resonance of damping rate a has the shape
    1 / (a + i d). One with a > `narrow` d is resolved by the samples, as that of a moonpool may be, and is kept.
    """
    for h in range(1, (omega.size - 4) // 2):
        centres = np.arange(max(spike - 3 * (h + 2), h + 2), min(spike + 3 * (h + 2), omega.size - h - 3) + 1)
        if spike not in centres:
            return
        edges, outside = (centres[:, None] + np.array(steps) for steps in ([-h, h], [-h - 2, -h - 1, h + 1, h + 2]))
        off = np.stack([K[edge] - np.einsum("kj,kj->k", lagrange(omega[outside], omega[edge]), K[outside])
                        for edge in edges.T], axis=1)
        least, at = max(floor, deviations * 1.4826 * float(np.median(np.abs(off)))), off[centres == spike][0]
        own = np.where((np.abs(at) > least) & (np.abs(at.real) < narrow * np.abs(at.imag)), np.abs(at), 0.0)
        if not own.any():
            return
        apart[[spike - h, spike + h]] = np.maximum(apart[[spike - h, spike + h]], own)
