"""How far a model is from the data: one definition for fits, audits and benchmarks."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import HydroData


def scales(data: HydroData) -> FloatArray:
    """Return s_i = sqrt(max_w |K_ii|), shape (n,); 1 where a degree of freedom does not radiate."""
    size = np.abs(np.einsum("wii->wi", data.K)).max(axis=0)
    return np.where(size > 0.0, np.sqrt(size), 1.0)


def joint_error(data: HydroData, K: ComplexArray) -> float:
    """Return ||S^-1 (K_data - K) S^-1|| / ||S^-1 K_data S^-1|| over all samples and entries (Frobenius)."""
    pairs = np.outer(scales(data), scales(data))
    return float(np.linalg.norm((data.K - K) / pairs) / np.linalg.norm(data.K / pairs))


def entry_errors(data: HydroData, K: ComplexArray) -> FloatArray:
    """Return ||K_ij,data - K_ij|| / ||K_ij,data|| for each entry, shape (n, n); NaN where the data are zero."""
    size = np.linalg.norm(data.K, axis=0)
    miss = np.linalg.norm(data.K - K, axis=0)
    return np.asarray(np.divide(miss, size, out=np.full(size.shape, np.nan), where=size > 0.0))
