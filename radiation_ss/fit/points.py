"""Frequency points where K is to be met exactly: within the band, and what of the data's K they can hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData


def points_within(points: ArrayLike | None, data: HydroData) -> FloatArray:
    """Return the frequency points, checked."""
    wanted = np.unique(np.zeros(0) if points is None else np.atleast_1d(np.asarray(points, dtype=float)))
    outside = ~((wanted >= data.omega[0]) & (wanted <= data.omega[-1]))
    if outside.any():
        raise InputError(f"points: {wanted[outside][0]:g} rad/s lies outside the data "
                         f"({data.omega[0]:g} to {data.omega[-1]:g} rad/s)")
    return wanted


def asymmetry_at(data: HydroData, points: FloatArray) -> list[str]:
    """Return a note where K of the data is not symmetric at the points."""
    at = np.array([np.abs(data.omega - w).argmin() for w in points], dtype=int)
    K = data.K[at]
    half, mean = np.abs(K - np.swapaxes(K, 1, 2)) / 2.0, np.abs(K + np.swapaxes(K, 1, 2)) / 2.0
    share = np.divide(half, mean, out=np.zeros(half.shape), where=half > 1e-9 * mean.max(initial=0.0))
    if not share.any():
        return []
    _, i, j = np.unravel_index(share.argmax(), share.shape)
    return [f"points: K of the data is not symmetric there, {data.dofs[i]}-{data.dofs[j]} by up to {share.max():.1%} "
            "of its mean with the transpose; the mean of both is what is met"]
