"""Transforms of records under Slepian tapers, and the bins in which the waves move the body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import dpss

from radiation_ss.arrays import ComplexArray, FloatArray

HALF_BANDWIDTH, TAPERS, BAND = 5.0, 4, 5  # of the multitaper estimate; bins either side that smooth it
LOUD = 0.02  # share of the peak's power above which a bin belongs to the waves


def tapered(values: FloatArray) -> ComplexArray:
    """Return the transforms of columns under each Slepian taper, shape (tapers, nw, columns)."""
    windows = np.asarray(dpss(values.shape[0], HALF_BANDWIDTH, TAPERS))
    return np.asarray(np.fft.rfft(windows[:, :, None] * values[None], axis=1))


def quiet(motion: ComplexArray, omega: FloatArray) -> NDArray[np.bool_]:
    """Return where the motion has little power: there harmonics show, and an error of the nominal model does not.

    In the waves' own band the response to the effect's force hangs on damping and natural frequency to the percent.
    """
    power = np.mean(np.abs(motion) ** 2, axis=0)
    smooth = np.stack([np.convolve(row, np.ones(2 * BAND + 1) / (2 * BAND + 1), mode="same") for row in power.T])
    loud = (smooth > LOUD * smooth.max(axis=1, keepdims=True)).any(axis=0)
    low, high = omega[loud].min(), omega[loud].max()
    return np.asarray((omega < 0.7 * low) | (omega > 1.15 * high))
